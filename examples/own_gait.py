"""A gait of one's own under every controller: it needs ``update`` and ``initial_state``."""

import numpy as np

import harpy_pin as hp

LOW, HIGH = 0.52, 0.6  # heights of the body, m
PRESS = 0.005  # how deep into the ground the feet aim, m
FEET = np.array([(0.0, 0.125, 0.0), (0.0, -0.125, 0.0)])
RATE = 2.0 * np.pi / 1.5  # rad/s: one squat in 1.5 s


class Squats(hp.Gait):
    """The body goes down and up; both feet stay where they are."""

    def __init__(self, robot: hp.Robot) -> None:
        super().__init__(robot)
        self.target.stance[:] = 1.0  # both on the ground, always
        self.target.phase[:] = 0.5

    def update(self, t: float) -> hp.GaitTarget:
        body = self.target.body  # position, velocity, acceleration
        depth, wave = 0.5 * (HIGH - LOW), RATE * t
        body[2] = HIGH - depth * (1.0 - np.cos(wave))
        body[5], body[8] = -depth * RATE * np.sin(wave), -depth * RATE**2 * np.cos(wave)
        self.target.foot_position[:] = FEET - body[:3] - (0.0, 0.0, PRESS)  # relative to the body
        self.target.foot_velocity[:] = -body[3:6]
        self.target.foot_acceleration[:] = -body[6:9]
        return self.target

    def initial_state(self, *, penetration: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        legs = [hp.model.LegGeometry.from_robot(self.robot, foot) for foot in self.robot.feet]
        angles = [
            hp.model.leg_inverse_kinematics(leg, foot - (0.0, 0.0, HIGH))
            for leg, foot in zip(legs, FEET, strict=True)
        ]
        q = np.concatenate(([0.0, 0.0, HIGH - penetration, 0.0, 0.0, 0.0, 1.0], *angles))
        return q, np.zeros(self.robot.model.nv)


for controller in (
    hp.Governed(governor="paper"),
    hp.Governed(governor="filter"),
    hp.WholeBody(),
    hp.Condensed(),
):
    scenario = hp.Scenario(controller=controller, ground=hp.Ground(mu_s=0.4), duration=3.0)
    run = hp.walk(scenario, gait=Squats(hp.load_harpy()))
    height = run["q"][:, 2]
    name = f"{controller.name} {getattr(controller, 'governor', '')}"
    print(
        f"{name:16s} {run.ending}: body from {height.min():.3f} to {height.max():.3f} m, "
        f"slip {1e3 * run['slip_path'][-1].sum():.2f} mm"
    )
