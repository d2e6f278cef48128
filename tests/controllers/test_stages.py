"""The tick as a list of stages: kernels in a row, and samples that are checked once."""

from __future__ import annotations

import numpy as np
import pytest
from random_states import draw

import harpy_pin as hp
from harpy_pin.errors import KernelError
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.source import fingerprint

ROBOT = hp.load_harpy()


@kernel
def double(x):
    x *= 2.0


@kernel
def add_one(x):
    x += 1.0


@kernel
def add_twice(x):
    double(x)
    add_one(x)


def in_a_row(*stages: Kernel) -> Kernel:
    """A kernel that calls others one after the other, the first of them where x is not zero."""

    @kernel(x=("n",))
    def row(x):
        for stage in stages:
            if x[0] != 0.0:
                stage(x)

    return row


@pytest.mark.parametrize(
    "stages", [(), (double,), (double, add_one), (add_one, double, add_twice, double)]
)
def test_kernels_in_a_row_are_called_in_their_order(stages):
    x = np.array([3.0, -1.0])
    expected = x.copy()
    for stage in stages:
        stage.py_func(expected)
    in_a_row(*stages)(x)
    np.testing.assert_array_equal(x, expected)
    nothing = np.zeros(1)
    in_a_row(*stages)(nothing)
    assert nothing[0] == 0.0


def test_rows_of_other_kernels_are_other_kernels():
    rows = [(double,), (double, add_one), (add_one, double), (double, double), (add_twice,)]
    assert len({fingerprint(in_a_row(*row).py_func) for row in rows}) == len(rows)


def test_a_jump_out_of_a_row_is_refused():
    stages = double, add_one

    @kernel
    def row(x):
        for stage in stages:
            stage(x)
            break

    with pytest.raises(KernelError, match="a jump out of kernels in a row"):
        row(np.ones(2))


@pytest.mark.parametrize("solver", ["active_set", "proxqp"])
@pytest.mark.parametrize("added", [False, True])
def test_a_state_of_lists_is_that_of_arrays(solver, added):
    """Thrusts that lag move once in a tick, whatever the sample is made of."""
    made = [
        hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4, solver=solver, thrust_lag=0.02)
        for _ in range(2)
    ]
    for controller in made if added else ():
        controller.add(hp.CentreOfMassTask(), weight=1e-3)
    q, v = hp.make_gait(ROBOT).initial_state()
    rng, feet = np.random.default_rng(5), np.zeros((2, 3))
    for k in range(12):
        force = np.full((2, 3), (0.0, 0.0, 4.9 * ROBOT.mass))
        moving = v + 0.2 * rng.standard_normal(len(v))
        state = hp.State(0.001 * k, q.copy(), moving, feet, feet, force)
        listed = hp.State(
            state.t,
            state.q.tolist(),
            state.v,
            state.foot_position,
            state.foot_velocity,
            state.foot_force.tolist(),
        )
        command = made[0].step(state)
        torque, thrust = command.torque.copy(), command.thrust.copy()
        other = made[1].step(listed if k % 3 == 2 else state)
        tolerance = 0.0 if solver == "active_set" else 1e-3
        np.testing.assert_allclose(other.torque, torque, rtol=0, atol=tolerance)
        np.testing.assert_allclose(other.thrust, thrust, rtol=0, atol=tolerance)


class _Jumps(hp.Gait):
    """A gait whose body is somewhere impossible at one time."""

    def __init__(self, inner: hp.Gait, when: float) -> None:
        super().__init__(inner.robot)
        self.inner, self.when = inner, when
        self.step_duration, self.double_support = inner.step_duration, inner.double_support
        self.controller_parameters = inner.controller_parameters

    def update(self, t):
        target = self.inner.update(t)
        if t == self.when:
            target.body[0] = 1e7
        return target

    def initial_state(self, *, penetration=0.0):
        return self.inner.initial_state(penetration=penetration)


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_estimates_stay_where_the_targets_are_bad(name):
    gait = _Jumps(hp.make_gait(ROBOT), 0.02)
    controller = hp.make_controller(name, gait, mu=0.4, estimate_joint_friction=True)
    rng, found = np.random.default_rng(1), []
    for k in range(25):
        state = draw(ROBOT, rng)
        state.t, state.foot_force[:] = 0.001 * k, 20.0
        controller.step(state)
        found.append(np.array(controller.telemetry()["viscous_estimate"]))
    assert controller.bad_samples == 1
    assert (found[19] > 0.0).any()
    np.testing.assert_array_equal(found[20], found[19])
    assert (found[21] != found[20]).any()
