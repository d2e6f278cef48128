"""A controller of one's own squats: the legs carry, and the thrusters keep the body in place."""

import numpy as np

import harpy_pin as hp


class Squat:
    """PD on joint angles from inverse kinematics, and a spring on the body by the thrusters."""

    def __init__(self, gait: hp.Gait) -> None:
        self.legs = [hp.model.LegGeometry.from_robot(gait.robot, foot) for foot in gait.robot.feet]

    def step(self, state: hp.State) -> hp.Command:
        height = 0.55 + 0.04 * np.cos(2.0 * np.pi * 0.5 * state.t)
        feet = [(0.0, 0.15, -height), (0.0, -0.15, -height)]
        angles = [
            hp.model.leg_inverse_kinematics(leg, foot)
            for leg, foot in zip(self.legs, feet, strict=True)
        ]
        torque = 400.0 * (np.concatenate(angles) - state.q[7:]) - 3.0 * state.v[6:]
        spring = 200.0 * (np.array([0.0, 0.0, height]) - state.q[:3]) - 20.0 * state.v[:3]
        return hp.Command(torque, np.array([0.5 * spring, 0.5 * spring]))


run = hp.walk(
    hp.Scenario(ground=hp.Ground(mu_s=0.6), gait=hp.Straight(speed=0.0), duration=4.0),
    controller=Squat,
)
low, high = run["q"][:, 2].min(), run["q"][:, 2].max()
print(f"{run.ending}: the body moved between {low:.3f} and {high:.3f} m")
