"""A shield behind inverse kinematics and joint PD, as with Pink or mink: the feet hold on ice."""

import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield

MU = 0.15


class Loop:
    """Joint PD to the angles of inverse kinematics; the thrusters keep the body in place."""

    def __init__(self, gait: hp.Gait) -> None:
        self.legs = [hp.model.LegGeometry.from_robot(gait.robot, foot) for foot in gait.robot.feet]

    def step(self, state: hp.State) -> hp.Command:
        lean = 0.03 * np.sin(2.0 * np.pi * state.t)
        feet = [(-lean, 0.15, -0.55), (-lean, -0.15, -0.55)]
        angles = [
            hp.model.leg_inverse_kinematics(leg, foot)
            for leg, foot in zip(self.legs, feet, strict=True)
        ]
        torque = 400.0 * (np.concatenate(angles) - state.q[7:]) - 3.0 * state.v[6:]
        spring = 200.0 * (np.array([lean, 0.0, 0.55]) - state.q[:3]) - 20.0 * state.v[:3]
        return hp.Command(torque, np.array([0.5 * spring, 0.5 * spring]))


class Shielded(Loop):
    """The same, with the shield behind it: two lines."""

    def __init__(self, gait: hp.Gait) -> None:
        super().__init__(gait)
        self.shield = Shield(gait.robot, mu=MU)

    def step(self, state: hp.State) -> hp.Command:
        command, _ = self.shield(state, super().step(state))
        return command


for loop in (Loop, Shielded):
    scenario = hp.Scenario(ground=hp.Ground(mu_s=MU), gait=hp.Straight(speed=0.0), duration=3.0)
    run = hp.walk(scenario, controller=loop)
    slip = 1e3 * run["slip_path"][-1].sum()
    print(f"{loop.__name__:8s} {run.ending}: slip {slip:.2f} mm")
