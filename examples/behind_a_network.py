"""A shield behind a neural network that stands on slippery ground, is pushed, and must not slip."""

from time import perf_counter

import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield
from harpy_pin.contrib.shield_batch import ShieldBatch

MU, HEIGHT, N = 0.2, 0.6, 1000
robot, random = hp.load_harpy(), np.random.default_rng(0)
legs = (hp.model.LegGeometry.from_robot(robot, foot) for foot in robot.feet)
posture = map(hp.model.leg_inverse_kinematics, legs, [(0, 0.125, -HEIGHT), (0, -0.125, -HEIGHT)])
REST = np.concatenate(([0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0], *posture, np.zeros(12)))


def teach(x: np.ndarray) -> np.ndarray:
    """Springs, which the network learns: deviations x (n, 24) to torques and thrusts (n, 12)."""
    spring = -(150.0 * x[:, :3] + 20.0 * x[:, 12:15])
    return np.hstack((-400.0 * x[:, 6:12] - 3.0 * x[:, 18:24], spring, spring))


samples = random.normal(size=(5000, 24)) * np.repeat((0.1, 1.0), 12)
inner = random.normal(size=(24, 64)) * np.repeat((0.5, 0.05), 12)[:, None]  # a random hidden layer
outer = np.linalg.lstsq(np.tanh(samples @ inner), teach(samples))[0]


class Network:
    """The policy; ``mu`` puts a shield behind it."""

    def __init__(self, mu: float | None) -> None:
        self.shield, self.changed = None if mu is None else Shield(robot, mu=mu), 0

    def of(self, gait: hp.Gait) -> "Network":
        return self

    def step(self, state: hp.State) -> hp.Command:
        x = np.concatenate((state.q[:3], 2.0 * state.q[3:6], state.q[7:], state.v)) - REST
        y = np.tanh(x @ inner) @ outer
        command = hp.Command(y[:6], y[6:].reshape(2, 3))
        if self.shield is not None:
            command, report = self.shield(state, command)
            self.changed += report.changed
        return command


STAND = hp.Straight(speed=0.0)
PUSH = hp.Disturbances(pushes=(hp.Push(0.6, (3.5, 0.0, 0.0)),))
SCENARIO = hp.Scenario(ground=hp.Ground(mu_s=MU), gait=STAND, duration=2.0, disturbances=PUSH)
for policy in (Network(None), Network(MU)):
    run = hp.walk(SCENARIO, controller=policy.of)
    slip = 1e3 * run["slip_path"][-1].sum()
    print(f"{run.ending}: slip {slip:.1f} mm, {policy.changed} commands changed")
arrays = [run[name][:N] for name in ("q", "v", "foot_force", "torque", "thrust")]
batch = ShieldBatch(robot, N, mu=MU)
batch(*arrays)
begin = perf_counter()
torque, thrust, report = batch(*arrays)
print(f"{N} at once: {1e6 * (perf_counter() - begin) / N:.1f} µs each, {report.safe.sum()} safe")
