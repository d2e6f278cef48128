"""A controller and a gait of one's own, walked by the library."""

from collections.abc import Mapping
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import harpy_pin as hp

Vector = NDArray[np.float64]


class Legs:
    """Joints held where they were at the first tick."""

    period = 1e-3

    def __init__(self, gait: hp.Gait) -> None:
        self.rest: Vector | None = None

    def step(self, state: hp.State) -> hp.Command:
        assert_type(state.q, Vector)
        assert_type(state.t, float)
        if self.rest is None:
            self.rest = state.q[7:].copy()
        torque = 300.0 * (self.rest - state.q[7:]) - 3.0 * state.v[6:]
        return hp.Command(torque, np.zeros((2, 3)))


class Bow(hp.Gait):
    """Stands, and lowers the body a little."""

    double_support = 1.0

    def __init__(self, robot: hp.Robot) -> None:
        super().__init__(robot)
        self.inner = hp.make_gait(robot, speed=0.0)

    def update(self, t: float) -> hp.gaits.GaitTarget:
        inner = self.inner.update(t)
        self.target.body[:] = inner.body
        self.target.foot_position[:] = inner.foot_position
        self.target.stance[:] = 1.0
        drop = 0.01 * np.sin(t)
        self.target.body[2] -= drop
        self.target.foot_position[:, 2] += drop
        return self.target

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        return self.inner.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, float]:
        return {"drop": 0.01}


scenario = hp.Scenario(controller="wbc", ground=hp.Ground(mu_s=0.6), duration=0.05)
gait: hp.Gait = Bow(hp.load_harpy())
for run in (hp.walk(scenario, gait=gait), hp.walk(scenario, controller=Legs)):
    assert_type(run, hp.Run)
    if run.ending != "completed":
        raise AssertionError(run.ending)
