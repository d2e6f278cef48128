"""The tick as a list of stages: kernels in a row, and samples that are checked once."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from random_states import draw

import harpy_pin as hp
from harpy_pin.controllers import (
    CondensedController,
    Stage,
    WholeBodyController,
    WholeBodyParameters,
)
from harpy_pin.controllers.task_controller import TaskController
from harpy_pin.errors import KernelError
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.source import fingerprint
from harpy_pin.wbc.weights import thrust_box

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


def mark(index: int) -> Kernel:
    """A kernel that notes when it was called."""

    @kernel
    def note(r, target, q, v, foot_force):
        r.own.count += 1.0
        r.own.order[index] = r.own.count

    return note


@kernel
def begin(r, lower, upper, inputs, usable):
    r.own.solved = 0.0
    r.own.widest = np.max(upper - lower)


@kernel
def between(r, lower, upper, inputs, usable):
    r.own.solved += 1.0 if usable else 0.0
    r.own.torque[:] = inputs[inputs.shape[0] - r.own.torque.shape[0] :]


PHASES = ("before_tasks", "after_tasks", "after_optimum", "closing")
WHO = [("condensed", {}), ("wbc", {"solver": "active_set"}), ("wbc", {})]


def with_stage(name: str, settings: dict, *stages: Stage) -> TaskController:
    kind = CondensedController if name == "condensed" else WholeBodyController
    gait = hp.make_gait(ROBOT)
    return kind(gait, WholeBodyParameters.for_gait(gait, **settings), stages=stages)


def standing() -> hp.State:
    q, v = hp.make_gait(ROBOT).initial_state()
    force = np.full((2, 3), (0.0, 0.0, 4.9 * ROBOT.mass))
    return hp.State(0.0, q, v, *np.zeros((2, 2, 3)), force)


@pytest.mark.parametrize(("name", "settings"), WHO, ids=str)
def test_a_stage_of_ones_own(name, settings):
    """Its kernels are called in their order, after a bad sample the closing ones alone; a reset
    gives its memory back.
    """
    stage = Stage(
        name="own",
        memory={"count": 0.0, "order": np.zeros(4)},
        signals={"order": "order", "last": ("order", 3)},
        **{phase: (mark(k),) for k, phase in enumerate(PHASES)},
    )
    plain = with_stage(name, settings)
    controller, state = with_stage(name, settings, stage), standing()
    command, expected = controller.step(state), plain.step(state)
    exact = name == "condensed" or settings  # ProxQP rounds as its memory lies
    np.testing.assert_allclose(command.torque, expected.torque, atol=0.0 if exact else 1e-3)
    np.testing.assert_array_equal(controller.telemetry()["order"], (1, 2, 3, 4))
    other = copy.deepcopy(controller)
    state.q[0] = np.nan
    controller.step(state)
    np.testing.assert_array_equal(controller.telemetry()["order"], (1, 2, 3, 5))
    assert controller.telemetry()["last"] == 5
    assert other.telemetry()["last"] == 4
    controller.reset()
    np.testing.assert_array_equal(controller.telemetry()["order"], 0.0)


@pytest.mark.parametrize(("name", "settings"), WHO, ids=str)
def test_a_stage_around_the_optimum(name, settings):
    """Found twice with the same limits it is the same optimum, and the thrusts are the stage's."""
    stage = Stage(
        name="own",
        memory={"solved": 0.0, "widest": 0.0, "torque": np.zeros(6)},
        around_optimum=(begin, between, between),
        signals={"solved": "solved", "widest": "widest", "found": "torque"},
    )
    controller, state = with_stage(name, settings, stage), standing()
    torque = with_stage(name, settings).step(state).torque
    command, signals = controller.step(state), controller.telemetry()
    assert signals["solved"] == 2.0
    lower, upper = thrust_box(ROBOT, controller.parameters.limits)
    assert signals["widest"] == max((upper - lower).max(), 2.0 * ROBOT.torque_limit.max())
    np.testing.assert_allclose(command.torque, torque, atol=1e-9 if name == "condensed" else 1e-3)
    np.testing.assert_array_equal(signals["found"], command.torque)
    np.testing.assert_array_equal(command.thrust, 0.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": "two words"}, "a Python name"),
        ({"name": "targets"}, "has"),
        ({"memory": {"x": "a"}}, "numbers and arrays"),
        ({"closing": (print,)}, "kernels in a tuple"),
        ({"signals": {"x": ("y",)}}, "'y'"),
        ({"signals": {"x": 5}}, "field of the signal 'x'"),
        ({"signals": {"x": ()}}, "field of the signal 'x'"),
    ],
    ids=str,
)
def test_what_is_no_stage(wrong, message):
    with pytest.raises(hp.InputError, match=message):
        with_stage("condensed", {}, Stage(**{"name": "own", **wrong}))


def test_stages_that_exclude_each_other():
    around = Stage(name="own", around_optimum=(begin, between, between))
    with pytest.raises(hp.InputError, match="one stage around the optimum"):
        with_stage("condensed", {"thrust_lag": 0.1}, around)
    with pytest.raises(hp.InputError, match="own"):
        with_stage("condensed", {}, *(Stage(name="own", memory={"n": 0}) for _ in range(2)))


@kernel
def let_go(r, target, q, v, foot_force):
    r.inputs[:] = 0.0


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_after_the_optimum_thrusts_and_torques_can_be_changed(name):
    """By a stage that remembers nothing."""
    stage, state = Stage(name="own", after_optimum=(let_go,)), standing()
    assert with_stage(name, {}).step(state).torque.any()
    command = with_stage(name, {}, stage).step(state)
    np.testing.assert_array_equal(command.torque, 0.0)
    np.testing.assert_array_equal(command.thrust, 0.0)
