"""The true-force governor behind a controller of your own: the same walk on slippery ground, without it and with it."""

from __future__ import annotations

import harpy_pin as hp


class Held:
    """Any controller, its command bent so that the feet can stick."""

    period = 1e-3

    def __init__(self, robot: hp.Robot, inner: hp.GovernedController, mu: float) -> None:
        self.inner = inner
        self.governor = hp.ContactForceGovernor(robot, hp.ContactGovernorParameters.robust(mu=mu), period=self.period)

    def step(self, state: hp.State) -> hp.Command:
        return self.governor.update(state, self.inner.step(state))


def main(duration: float = 4.0) -> None:
    robot = hp.load_harpy()
    for held in (False, True):
        gait = hp.make_gait(robot, speed=0.3)
        inner = hp.make_controller("governed", gait, mu=0.2, governor="none")
        assert isinstance(inner, hp.GovernedController)
        controller = Held(robot, inner, mu=0.2) if held else inner
        simulator = hp.Simulator(robot, hp.Ground(mu_s=0.2, mu_c=0.18))
        simulator.reset(*gait.initial_state(sink=simulator.static_sink))
        run = simulator.run(controller, duration)
        slip = hp.measure(run, step_duration=0.75).slip_mm_per_step
        print(f"{'with' if held else 'without'} the governor: slip {slip:.2f} mm per step")


if __name__ == "__main__":
    main()
