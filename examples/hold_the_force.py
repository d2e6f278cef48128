"""The contact-force filter behind any controller: a walk on slippery ground without and with it."""

from __future__ import annotations

import harpy_pin as hp

MU = 0.2


class Held:
    """Any controller, its command bent so that the feet can stick."""

    period = 1e-3

    def __init__(self, inner: hp.Controller, robot: hp.Robot, mu: float) -> None:
        self.inner = inner
        self.governor = hp.ContactForceFilter(
            robot, hp.ContactForceFilterParameters.robust(mu=mu), period=self.period
        )

    def step(self, state: hp.State) -> hp.Command:
        return self.governor.update(state, self.inner.step(state))


def plain(gait: hp.Gait) -> hp.Controller:
    return hp.make_controller("governed", gait, mu=MU, governor="none")


def held(gait: hp.Gait) -> hp.Controller:
    return Held(plain(gait), gait.robot, MU)


def main(duration: float = 4.0) -> None:
    scenario = hp.Scenario(ground=hp.Ground(mu_s=MU), duration=duration)
    for name, controller in (("without", plain), ("with", held)):
        run = hp.walk(scenario, controller=controller)
        slip = hp.measure(run, step_duration=0.75).slip_mm_per_step
        print(f"{name} the governor: slip {slip:.2f} mm per step")


if __name__ == "__main__":
    main()
