"""Arguments of a wrong shape or kind, wherever data enters: refused by name, and nothing else is
touched.
"""

import numpy as np
import pytest
from guarded_walks import (
    NAMES,
    REFERENCE,
    X_R,
    X,
    command_of,
    controller_of,
    copy,
    equal,
    governor_of,
)

import harpy_pin as hp
from harpy_pin.governors import ForceRows
from reproduction.gait.spatial import make_named_gait
from reproduction.vlip_model import AngleRow

GUARD = 16
CANARY = 1.2345e67


def guarded(array):
    """A copy in the middle of a larger buffer, and a function that says whether the rest of it is
    untouched.
    """
    array = np.asarray(array, dtype=np.float64)
    buffer = np.full(array.size + 2 * GUARD, CANARY)
    inner = buffer[GUARD : GUARD + array.size].reshape(array.shape)
    inner[...] = array
    return (
        inner,
        lambda: (buffer[:GUARD] == CANARY).all() and (buffer[GUARD + array.size :] == CANARY).all(),
    )


SIZES = ("q", "v", "foot_position", "foot_force", "torque", "thrust")


def misshapen(rng, array):
    """The array in a form that is wrong, or right but unusual; and whether it can be used all the
    same.
    """
    kind = rng.integers(8)
    if kind == 0:
        return array[:-1], False
    if kind == 1:
        return np.concatenate((array, array)), False
    if kind == 2:
        return array[None], False
    if kind == 3:
        return array.ravel()[:1], array.shape == (1,)
    if kind == 4:
        return array[:0], False
    if kind == 5:
        return np.repeat(array, 2, axis=0)[::2], True
    if kind == 6:
        return array.tolist(), True
    return np.asarray(array, dtype=object), True


@pytest.mark.parametrize("name", NAMES)
def test_wrong_states_are_refused_by_name(name, gait, states, fuzz):
    rng = np.random.default_rng(1)
    controller, honest = controller_of(name, gait), controller_of(name, gait)
    for k in range(25 * fuzz):
        state = states[rng.integers(len(states))]
        field = SIZES[rng.integers(4)]
        if name == "wbc" and field == "foot_position":
            continue  # it is not read
        bad = state.copy()
        value, usable = misshapen(rng, getattr(state, field))
        setattr(bad, field, value)
        expected = copy(honest.step(state))
        if usable:
            assert equal(controller.step(bad), expected), (field, k)
        else:
            before = copy(controller.step(state))
            with pytest.raises(hp.InputError, match=field):
                controller.step(bad)
            assert equal(before, expected)
            controller.reset()
            honest.reset()
    assert controller.bad_samples == 0
    for wrong in (None, 3, "state"):
        with pytest.raises(hp.InputError, match="state"):
            controller.step(wrong)


def test_contact_governor_names_what_is_wrong(robot, states):
    governor = hp.ContactForceFilter(robot, hp.ContactForceFilterParameters(mu=0.1))
    state = states[3].copy()
    state.foot_force = np.tile([5.0, 0.0, 30.0], (4, 1))
    with pytest.raises(hp.InputError, match=r"foot_force must have shape \(2, 3\), got \(4, 3\)"):
        governor.update(state, command_of(robot))
    with pytest.raises(hp.InputError, match=r"torque must have shape \(6,\), got \(3,\)"):
        governor.update(states[3], hp.Command(np.zeros(3), np.zeros((2, 3))))
    # Integers cannot hold the bend: they stay as they were, and a new command is returned.
    floats, whole = command_of(robot, 1.0, 20.0), hp.Command(np.full(6, 1), np.full((2, 3), 20))
    expected = governor.update(states[3], floats)
    governor.reset()
    bent = governor.update(states[3], whole)
    assert bent is not whole
    assert equal(bent, expected)
    assert (whole.torque == 1).all()
    assert (whole.thrust == 20).all()
    assert not np.array_equal(bent.torque, whole.torque)


@pytest.mark.parametrize("name", REFERENCE)
def test_wrong_references_are_refused(name, robot):
    governor = governor_of(name, robot)
    governor.reset(X_R)
    for x, x_r, dt in (
        (X[:8], X_R, 1e-3),
        (X, X_R[:5], 1e-3),
        (np.tile(X, 2), X_R, 1e-3),
        (X, np.tile(X_R, 2), 1e-3),
        (X[None], X_R, 1e-3),
        (X, X_R, np.nan),
        (X, X_R, -1e-3),
        ("x", X_R, 1e-3),
        (None, X_R, 1e-3),
        (X.tolist(), X_R, 1e-3),
    ):
        with pytest.raises(hp.InputError):
            governor.update(x, x_r, dt)
    for start in (X_R[:5], 0.6, np.full(6, np.nan), "x"):
        with pytest.raises(hp.InputError, match="x_r"):
            governor.reset(start)
    np.testing.assert_array_equal(governor.applied[:3], X_R[:3])
    assert governor.status.bad_samples == 0


@pytest.mark.parametrize("rows", [ForceRows(mass=4.6, mu=0.25), AngleRow()])
def test_rows_fill_only_what_is_theirs(rows, fuzz):
    rng = np.random.default_rng(3)
    n = len(rows.names)
    right = ((9,), (6,), (n,), (n, 6))
    for _ in range(60 * fuzz):
        arrays, checks = zip(
            *(guarded(np.ones(rng.integers(0, 12, rng.integers(1, 3)))) for _ in right), strict=True
        )
        if tuple(a.shape for a in arrays) != right:
            with pytest.raises(
                Exception, match=r"rows need|dimension|types|No implementation|array"
            ):
                rows.evaluate(*arrays)
        assert all(intact() for intact in checks)
    with pytest.raises(hp.InputError, match="rows need"):
        rows.evaluate(X, X_R, np.zeros(n - 1), np.zeros((n - 1, 6)))


def test_dynamics_check_their_state(robot, draw_state):
    dynamics = hp.Dynamics(robot)
    q, v = draw_state(np.random.default_rng(4))
    dynamics.update(q, v)
    expected = dynamics.bias.copy()
    assert dynamics.finite
    dynamics.update(q.tolist(), list(v))
    np.testing.assert_array_equal(dynamics.bias, expected)
    for bad in (
        (q[:12], v),
        (q, v[:11]),
        (np.tile(q, 2), v),
        (None, v),
        ("q", v),
        (q, np.zeros((2, 12))),
    ):
        with pytest.raises(hp.InputError, match=r"[qv] must"):
            dynamics.update(*bad)
    for i in range(13 + 12):
        both = np.concatenate((q, v))
        both[i] = np.nan
        dynamics.update(both[:13], both[13:])
        assert not dynamics.finite, i
    dynamics.update(q, v)
    assert dynamics.finite


def test_simulator_checks_commands(robot, gait, simulator):
    place, before = simulator.q.copy(), simulator.v.copy()
    act = simulator.advance
    for torque in (
        np.zeros(0),
        np.zeros(3),
        np.zeros(12),
        np.zeros((6, 1)),
        np.full(6, np.nan),
        None,
        "x",
    ):
        with pytest.raises(hp.InputError, match="torque"):
            act(hp.Command(torque, np.zeros((2, 3))))
    for thrust in (
        np.zeros(5),
        np.zeros(6),
        np.zeros((3, 2)),
        np.zeros((3, 3)),
        np.full((2, 3), np.inf),
        None,
    ):
        with pytest.raises(hp.InputError, match="thrust"):
            act(hp.Command(np.zeros(6), thrust))
    with pytest.raises(hp.InputError, match="command"):
        act(None)
    np.testing.assert_array_equal(simulator.v, before)
    np.testing.assert_array_equal(simulator.q, place)
    assert simulator.t == 0.0
    act(hp.Command([1, 1, 1, 1, 1, 1], np.ones((2, 3), dtype=int)))
    again = hp.Simulator(robot, simulator.ground)
    again.reset(*gait.initial_state(penetration=simulator.static_penetration))
    again.advance(command_of(robot, 1.0, 1.0))
    np.testing.assert_array_equal(simulator.v, again.v)


def test_simulator_needs_a_state(robot, gait):
    simulator = hp.Simulator(robot)
    controller = controller_of("none", gait)
    with pytest.raises(hp.InputError, match="reset"):
        simulator.advance(command_of(robot))
    with pytest.raises(hp.InputError, match="reset"):
        simulator.run(controller, 0.01)
    with pytest.raises(hp.InputError, match="reset"):
        _ = simulator.state
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    assert simulator.run(controller, 0.01).ending == "completed"


@pytest.mark.parametrize("name", ["hand", "optimised"])
def test_gaits_refuse_times_that_are_none(name, robot):
    made = make_named_gait(robot, name)
    expected = made.update(0.3).body.copy()
    for t in (np.nan, np.inf, -np.inf, 1e12):
        with pytest.raises(hp.InputError, match="time"):
            made.update(t)
    np.testing.assert_array_equal(made.target.body, expected)
