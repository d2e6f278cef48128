"""A shield behind a policy that ignores friction: a walk on slippery ground without and with it."""

from collections import Counter

import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield

MU = 0.2
reasons: Counter[str] = Counter()


class Policy:
    """Any source of commands; here joint PIDs and thrusters, with noise on the torques."""

    def __init__(self, gait: hp.Gait) -> None:
        self.inner = hp.make_controller("governed", gait, mu=MU, governor="none")
        self.random = np.random.default_rng(0)

    def step(self, state: hp.State) -> hp.Command:
        command = self.inner.step(state)
        noise = self.random.normal(0.0, 0.5, command.torque.shape)
        return hp.Command(command.torque + noise, command.thrust)


class Shielded:
    """The same policy behind the shield."""

    def __init__(self, gait: hp.Gait) -> None:
        self.policy, self.shield = Policy(gait), Shield(gait.robot, mu=MU)

    def step(self, state: hp.State) -> hp.Command:
        command, report = self.shield(state, self.policy.step(state))
        reasons.update(report.reasons)
        return command


for controller in (Policy, Shielded):
    run = hp.walk(hp.Scenario(ground=hp.Ground(mu_s=MU), duration=4.0), controller=controller)
    slip = hp.measure(run, step_duration=0.75).slip_mm_per_step
    print(f"{controller.__name__:9s} {run.ending}: slip {slip:.2f} mm per step")
acted = ", ".join(f"{reason} {count}" for reason, count in reasons.most_common())
print("ticks in which the shield acted:", acted)
