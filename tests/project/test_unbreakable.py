"""Wrong arguments and wrong numbers, wherever data enters: refused by name, or answered and not remembered."""

from __future__ import annotations

import itertools
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.controllers.named_controllers import make_controller, make_governor
from harpy_pin.gaits import make_named_gait
from harpy_pin.governors import AngleRow, ForceRows, StackedRows
from harpy_pin.governors.reduced.point_mass import Law
from harpy_pin.model.entry import FADE, HOLD_TICKS
from harpy_pin.model.thrust import CentreGains
from reproduction.margin import MarginGovernor

NAMES = ("none", "paper", "cone", "filter", "wbc")
REFERENCE = ("paper", "paper, tracked", "cone", "margin", "own rows")
X = np.array([0.0, 0.0, 0.6, 0.3, 0.0, 0.0, 0.02, 0.0, 0.0])
X_R = np.array([0.01, 0.0, 0.6, 0.3, 0.0, 0.0])
GUARD = 16
CANARY = 1.2345e67


class Row:
    """A row given as a function of x and w that returns h and its Jacobian."""

    names = ("forward speed",)

    def __init__(self, function):
        self.function = function

    def evaluate(self, x, w, h, jacobian):
        h[0], jacobian[0] = self.function(x, w)


@pytest.fixture(scope="module")
def gait(robot):
    return hp.make_gait(robot)


@pytest.fixture(scope="module")
def states():
    """States of a walk, every twentieth tick."""
    run = hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=1.5))
    columns = [run[name] for name in ("t", "q", "v", "foot_position", "foot_velocity", "foot_force")]
    return [hp.State(float(t), *(a.copy() for a in rest)) for t, *rest in zip(*columns, strict=True)][::20]


@pytest.fixture
def simulator(robot, gait):
    """The robot at the start of the gait."""
    simulator = hp.Simulator(robot, hp.Ground(mu_s=0.8))
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    return simulator


def controller_of(name, gait):
    if name == "wbc":
        return make_controller("wbc", gait, mu=0.25, parameters={"solver": "daqp"})
    return make_controller("governed", gait, mu=0.25, governor=name)


def governor_of(name, robot):
    if name == "own rows":
        return hp.ExplicitReferenceGovernor(
            StackedRows([ForceRows(mass=robot.mass, mu=0.25), Row(lambda x, w: (0.4 - w[3], (0, 0, 0, -1, 0, 0)))])
        )
    if name == "margin":
        return MarginGovernor(mass=4.6, mu=0.25, k_p=100.0, k_d=20.0)
    kind, _, evaluate_at = name.partition(", ")
    return make_governor(kind, robot, mu=0.25, evaluate_at=evaluate_at or "measured")


def command_of(robot, torque=1.0, thrust=10.0):
    return hp.Command(np.full(len(robot.joints), torque), np.full((len(robot.thrusters), 3), thrust))


def equal(a, b):
    return np.array_equal(a.torque, b.torque) and np.array_equal(a.thrust, b.thrust)


def copy(command):
    return hp.Command(command.torque.copy(), command.thrust.copy())


# ---- memory: shapes and types --------------------------------------------------------------------------------------


def guarded(array):
    """A copy in the middle of a larger buffer, and a function that says whether the rest of it is untouched."""
    array = np.asarray(array, dtype=np.float64)
    buffer = np.full(array.size + 2 * GUARD, CANARY)
    inner = buffer[GUARD : GUARD + array.size].reshape(array.shape)
    inner[...] = array
    return inner, lambda: (buffer[:GUARD] == CANARY).all() and (buffer[GUARD + array.size :] == CANARY).all()


SIZES = ("q", "v", "foot_position", "foot_force", "torque", "thrust")


def misshapen(rng, array):
    """The array in a form that is wrong, or right but unusual; and whether it can be used all the same."""
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


@pytest.mark.parametrize("name", ["paper", "cone", "margin"])
def test_batches_write_only_into_their_references(name, robot):
    governor = governor_of(name, robot)
    x, x_r = np.tile(X, (3, 1)), np.tile(X_R, (3, 1))
    applied, intact = guarded(x_r)
    governor.update_batch(x, x_r, applied, 1e-3)
    expected = applied.copy()
    applied[:] = x_r
    governor.update_batch(x.tolist(), np.asfortranarray(x_r), applied, 1e-3)
    np.testing.assert_array_equal(applied, expected)
    for wrong in (x_r.astype(int), x_r.tolist(), np.tile(x_r, (1, 2))[:, ::2], x_r[:2].copy()):
        with pytest.raises(hp.InputError, match="applied"):
            governor.update_batch(x, x_r, wrong, 1e-3)
    for bad in (np.full((3, 9), np.nan), x[:, :8]):
        with pytest.raises(hp.InputError, match="x must"):
            governor.update_batch(bad, x_r, applied, 1e-3)
    with pytest.raises(hp.InputError, match="dt"):
        governor.update_batch(x, x_r, applied, np.nan)
    assert intact()


@pytest.mark.parametrize("rows", [ForceRows(mass=4.6, mu=0.25), AngleRow()])
def test_rows_fill_only_what_is_theirs(rows, fuzz):
    rng = np.random.default_rng(3)
    n = len(rows.names)
    right = ((9,), (6,), (n,), (n, 6))
    for _ in range(60 * fuzz):
        arrays, checks = zip(*(guarded(np.ones(rng.integers(0, 12, rng.integers(1, 3)))) for _ in right), strict=True)
        if tuple(a.shape for a in arrays) != right:
            with pytest.raises(Exception, match=r"rows need|dimension|types|No implementation|array"):
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
    for bad in ((q[:12], v), (q, v[:11]), (np.tile(q, 2), v), (None, v), ("q", v), (q, np.zeros((2, 12)))):
        with pytest.raises(hp.InputError, match=r"[qv] must"):
            dynamics.update(*bad)
        with pytest.raises(hp.InputError, match=r"[qv] must"):
            dynamics.acceleration(*bad, np.zeros(12))
    for i in range(13 + 12):
        both = np.concatenate((q, v))
        both[i] = np.nan
        dynamics.update(both[:13], both[13:])
        assert not dynamics.finite, i
    dynamics.update(q, v)
    assert dynamics.finite
    force, thrust = np.zeros((2, 3)), np.zeros((2, 3))
    for bad in ((np.zeros(3), force, thrust), (np.zeros(6), np.zeros(3), thrust), (np.zeros(6), force, np.zeros(12))):
        with pytest.raises(hp.InputError, match="must have shape"):
            dynamics.generalised_force(*bad)


def test_contact_map_checks_its_arguments(robot, draw_state):
    q, v = draw_state(np.random.default_rng(4))
    dynamics, force = hp.Dynamics(robot), hp.ContactForceMap(robot)
    dynamics.update(q, v)
    right = {"torque": np.zeros(6), "thrust": np.zeros((2, 3)), "touching": (1.0, 1.0)}
    force.update(dynamics, v, **right)
    for name, value in (("torque", np.zeros(12)), ("torque", np.zeros(3)), ("thrust", np.zeros((4, 3)))):
        with pytest.raises(hp.InputError, match=name):
            force.update(dynamics, v, **{**right, name: value})
    with pytest.raises(hp.InputError, match="v must"):
        force.update(dynamics, np.zeros(24), **right)


def test_simulator_checks_commands(robot, gait, simulator):
    place, before = simulator.q.copy(), simulator.v.copy()
    act = simulator.advance
    for torque in (np.zeros(0), np.zeros(3), np.zeros(12), np.zeros((6, 1)), np.full(6, np.nan), None, "x"):
        with pytest.raises(hp.InputError, match="torque"):
            act(hp.Command(torque, np.zeros((2, 3))))
    for thrust in (np.zeros(5), np.zeros(6), np.zeros((3, 2)), np.zeros((3, 3)), np.full((2, 3), np.inf), None):
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


# ---- one bad sample is one bad tick --------------------------------------------------------------------------------


def spoiled(rng, state, name):
    """A copy of the state with one number of those that a controller reads spoiled."""
    bad = state.copy()
    fields = ["t", "q", "v", "foot_force"] + ([] if name == "wbc" else ["foot_position"])
    field = fields[rng.integers(len(fields))]
    value = (np.nan, np.inf, -np.inf)[rng.integers(3)]
    if field == "t":
        bad.t = value
    else:
        array = getattr(bad, field)
        array.reshape(-1)[rng.integers(array.size)] = value
    return bad


@pytest.mark.parametrize("name", NAMES)
def test_bad_samples_leave_no_trace(name, gait, states, fuzz):
    """Commands at good samples are those of a controller that never saw the bad ones, to the last bit."""
    rng = np.random.default_rng(5)
    controller, clean = controller_of(name, gait), controller_of(name, gait)
    last = hp.Command(np.zeros(6), np.zeros((2, 3)))
    count = 0
    for k, state in enumerate(itertools.islice(itertools.cycle(states), 200 * fuzz)):
        if k % 10 == 0:
            held = controller.step(spoiled(rng, state, name))
            count += 1
            assert equal(held, last), k
        command = controller.step(state)
        assert equal(command, clean.step(state)), k
        assert np.isfinite(command.torque).all()
        assert np.isfinite(command.thrust).all()
        last = copy(command)
    assert controller.bad_samples == count == controller.telemetry()["bad_samples"]
    assert clean.bad_samples == 0
    controller.reset()
    assert controller.bad_samples == 0


@pytest.mark.parametrize("name", NAMES)
def test_blindness_is_held_then_fades(name, gait, states):
    controller = controller_of(name, gait)
    for state in states[:5]:
        good = copy(controller.step(state))
    bad = states[5].copy()
    bad.q[:] = np.nan
    for _ in range(HOLD_TICKS):
        assert equal(controller.step(bad), good)
    for k in range(1, 6):
        command = controller.step(bad)
        np.testing.assert_allclose(command.torque, good.torque * FADE**k, rtol=1e-12)
        np.testing.assert_allclose(command.thrust, good.thrust * FADE**k, rtol=1e-12)
    for _ in range(200):
        command = controller.step(bad)
    assert abs(command.torque).max() < 1e-6
    clean = controller_of(name, gait)
    for state in states[:5]:
        clean.step(state)
    assert equal(controller.step(states[6]), clean.step(states[6]))


@pytest.mark.parametrize("name", REFERENCE)
def test_references_survive_bad_samples(name, robot, fuzz):
    rng = np.random.default_rng(6)
    governor, clean = governor_of(name, robot), governor_of(name, robot)
    governor.reset(X_R)
    clean.reset(X_R)
    bad = 0
    for k in range(200 * fuzz):
        scale = 0.05 if k % 2 else 10.0 ** rng.uniform(-3.0, 2.0)
        x, x_r = X + scale * rng.standard_normal(9), X_R + scale * rng.standard_normal(6)
        if k % 10 == 0:
            both = np.concatenate((x, x_r))
            both[rng.integers(15)] = (np.nan, np.inf, -np.inf)[rng.integers(3)]
            before = governor.applied.copy()
            np.testing.assert_array_equal(governor.update(both[:9], both[9:], 1e-3), before)
            assert governor.status.infeasible
            assert governor.status.least_violation == np.inf
            bad += 1
        np.testing.assert_array_equal(governor.update(x, x_r, 1e-3), clean.update(x, x_r, 1e-3))
        assert np.isfinite(governor.applied).all()
        assert governor.status.infeasible == clean.status.infeasible
        assert governor.status.least_violation < np.inf
    assert governor.status.bad_samples == bad
    assert clean.status.bad_samples == 0


def test_contact_governor_holds_its_bend_and_says_so(robot, states):
    governor, clean = (hp.ContactForceFilter(robot, hp.ContactForceFilterParameters(mu=0.05)) for _ in range(2))
    for state in states[:10]:
        governor.update(state, command_of(robot))
        clean.update(state, command_of(robot))
    bend = governor.bend.copy()
    assert abs(bend).max() > 0.1
    bad = states[10].copy()
    bad.foot_force[0, 2] = np.nan
    for k in range(HOLD_TICKS + 3):
        bent = governor.update(bad, command_of(robot))
        share = FADE ** max(k + 1 - HOLD_TICKS, 0)
        np.testing.assert_allclose(bent.thrust.ravel() - 10.0, share * bend[:6], atol=1e-12)
        np.testing.assert_allclose(bent.torque - 1.0, share * bend[6:], atol=1e-12)
        assert governor.status.infeasible
        assert governor.status.least_violation == np.inf
    assert governor.status.bad_samples == HOLD_TICKS + 3
    good = governor.update(states[11], command_of(robot))
    assert equal(good, clean.update(states[11], command_of(robot)))
    assert governor.status.least_violation < np.inf
    # A command that is no number is no reason to forget either.
    governor.update(states[12], hp.Command(np.full(6, np.nan), np.zeros((2, 3))))
    assert governor.status.infeasible
    assert governor.status.bad_samples == HOLD_TICKS + 4
    assert equal(governor.update(states[13], command_of(robot)), clean.update(states[13], command_of(robot)))


class Flaky:
    """Sensors whose every tenth reading is no number."""

    def __init__(self, count=0):
        self.count = count

    def measure(self, state):
        self.count += 1
        measured = state.copy()
        if self.count % 10 == 0:
            measured.v[self.count % 12] = np.nan
        return measured


@pytest.mark.parametrize("name", NAMES)
def test_walk_with_bad_sensors_is_counted(name, gait, simulator):
    run = simulator.run(controller_of(name, gait), 0.5, sensors=Flaky())
    assert run.ending == "completed"
    measures = hp.measure(run)
    assert measures.bad_samples == 50
    assert not measures.stumbled
    assert np.isfinite(run["torque"]).all()
    assert np.isfinite(run["thrust"]).all()


# ---- no division by zero -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", REFERENCE)
@pytest.mark.parametrize("law", [Law.FULL, Law.PROJECTED])
def test_body_on_its_foot(name, law, robot):
    governor = governor_of(name, robot)
    if name in ("paper", "paper, tracked"):
        gains = CentreGains(k_pr=10.0, k_dr=1.0)
        evaluate_at = "tracked" if "tracked" in name else "measured"
        governor = hp.ExplicitReferenceGovernor(
            ForceRows(mass=4.6, mu=0.25, law=law, evaluate_at=evaluate_at, gains=gains)
        )
    foot = X.copy()
    foot[:3] = foot[6:]
    target = np.append(foot[6:], np.zeros(3))
    governor.reset(target)
    for _ in range(3):
        assert np.isfinite(governor.update(foot, target, 1e-3)).all()
    assert governor.status.infeasible


def test_legs_have_length(robot, urdf_with):
    for upper, lower in ((0.0, 0.3), (0.3, 0.0), (-0.3, 0.3), (np.nan, 0.3)):
        with pytest.raises(hp.InputError, match="link"):
            hp.LegGeometry(hip=(0.0, 0.1, 0.0), offset=0.05, upper=upper, lower=lower)
    model = robot.model.copy()
    foot = model.frames[robot.frame_id("left_foot")]
    foot.placement.translation = np.zeros(3)
    with pytest.raises(hp.RobotError, match="left_foot"):
        hp.make_gait(replace(robot, model=model))


# ---- wrong use that looks right ------------------------------------------------------------------------------------


OWN = {
    "speed": lambda x, w: (0.2 - w[3], (0, 0, 0, -1, 0, 0)),
    "speed and a little lag": lambda x, w: (0.2 - w[3] - 0.1 * (w[0] - x[0]), (-0.1, 0, 0, -1, 0, 0)),
    "height": lambda x, w: (w[2] - 0.65, (0, 0, 1, 0, 0, 0)),
    "height and a little lag": lambda x, w: (w[2] - 0.65 + 0.02 * (w[0] - x[0]), (0.02, 0, 1, 0, 0, 0)),
    "height that falls with the way": lambda x, w: (0.55 - w[2] - 0.02 * w[0], (-0.02, 0, -1, 0, 0, 0)),
    "no gradient": lambda x, w: (-1.0, (0, 0, 0, 0, 0, 0)),
    "gradient that vanishes": lambda x, w: (-0.01 - w[1] ** 2, (0, -2 * w[1], 0, 0, 0, 0)),
    "out of reach behind": lambda x, w: (-1.0 - 1e-3 * w[0], (-1e-3, 0, 0, 0, 0, 0)),
    "out of reach ahead": lambda x, w: (-1.0 + 1e-3 * w[0], (1e-3, 0, 0, 0, 0, 0)),
}
"""Rows that are violated from the start, and stay so at the target."""


@pytest.mark.parametrize("name", OWN)
def test_own_row_violated_from_the_start_does_not_freeze_the_walk(name, robot, gait, simulator):
    """It is repaired where a small change does it; in all other directions x_w goes on with the target."""
    row = Row(OWN[name])
    governor = hp.ExplicitReferenceGovernor(StackedRows([ForceRows(mass=robot.mass, mu=0.8), row]))
    run = simulator.run(hp.GovernedController(gait, governor), 2.0)
    assert run.ending == "completed"
    assert not hp.measure(run).stumbled
    assert run["q"][-1, 0] > 0.5
    assert np.abs(run["x_r"] - run["x_w"])[:, :3].max() < 0.07
    assert run["infeasible"][1:30].all()
    h, jacobian = np.zeros(1), np.zeros((1, 6))
    row.evaluate(np.zeros(9), run["x_w"][-1], h, jacobian)
    if "out of reach" in name or "gradient" in name:
        assert governor.status.stuck
        assert run["infeasible"][1:].all()
    else:
        assert not governor.status.stuck
        assert h[0] > (-5e-3 if "lag" not in name else -0.06)


@pytest.mark.parametrize("conditions", ["algorithm", "equation"])
def test_own_row_is_repaired_by_the_shortest_way(robot, conditions):
    """To just inside, along its gradient; without rates of the rest, nothing else moves."""
    a = np.array([0.0, 3.0, 0.0, -1.0, 0.0, 2.0])
    governor = hp.ExplicitReferenceGovernor(
        StackedRows([ForceRows(mass=robot.mass, mu=0.8), Row(lambda x, w: (a @ (w - X_R) - 0.2, a))]),
        alpha_r=0.0,
        alpha_t=0.0,
        conditions=conditions,
    )
    governor.reset(X_R)
    for _ in range(300):
        governor.update(X, X_R, 1e-3)
    np.testing.assert_allclose(governor.applied - X_R, 0.2 * a / (a @ a), atol=2e-4)
    governor.update(X, X_R, 1e-3)
    assert not governor.status.infeasible


def test_stuck_is_a_matter_of_time(robot):
    governor = hp.ExplicitReferenceGovernor(StackedRows([ForceRows(mass=robot.mass, mu=0.8), Row(OWN["no gradient"])]))
    governor.reset(X_R)
    seen = []
    for _ in range(200):
        governor.update(X, X_R, 1e-3)
        seen.append(governor.status.stuck)
    assert 95 <= seen.index(True) <= 105
    assert all(seen[105:])
    fine = governor_of("paper", robot)
    fine.reset(X_R)
    for _ in range(200):
        fine.update(X, X_R, 1e-3)
    assert not fine.status.stuck


@pytest.mark.parametrize("values", [(np.nan, 0.0), (1.0, (np.nan, 0, 0, 0, 0, 0))], ids=["h", "jacobian"])
def test_rows_that_are_no_numbers_are_refused(values, robot):
    governor = hp.ExplicitReferenceGovernor(StackedRows([ForceRows(mass=robot.mass, mu=0.8), Row(lambda x, w: values)]))
    governor.reset(X_R)
    with pytest.raises(hp.InputError, match="forward speed"):
        governor.update(X, X_R, 1e-3)
    np.testing.assert_array_equal(governor.applied, X_R)


def test_whole_body_controller_takes_no_governor(gait, robot):
    for governor in ("paper", "cone", "filter"):
        with pytest.raises(hp.InputError, match="no governor"):
            make_controller("wbc", gait, mu=0.3, governor=governor)
    make_controller("wbc", gait, mu=0.3, governor="none")
    with pytest.raises(hp.InputError, match="ContactForceFilter"):
        make_governor("filter", robot, mu=0.3)


@pytest.mark.parametrize("formulation", ["full", "input_space"])
@pytest.mark.parametrize("slack", [0.0, 100.0])
def test_changes_of_the_objective_do_not_pile_up(formulation, slack, gait, states):
    parameters = {"formulation": formulation, "limits": {"slack": slack}}
    controller = make_controller("wbc", gait, mu=0.3, parameters=parameters)
    for state in states[:3]:
        controller.prepare(state)
        program = controller.build(state).program
        expected = program.hessian.copy(), program.gradient.copy()
        program.hessian += np.eye(len(program.gradient)) + 1.0
        program.gradient += 1.0
        controller.build(state)
        np.testing.assert_array_equal(program.hessian, expected[0])
        np.testing.assert_array_equal(program.gradient, expected[1])


@pytest.mark.parametrize("names", [("none", "wbc"), ("filter", "none")])
def test_one_gait_serves_two_controllers(names, gait, states):
    """Their stages interleaved, and in two threads: commands as with a gait each."""
    first, second = (controller_of(name, gait) for name in names)
    alone = controller_of(names[0], hp.make_gait(gait.robot))
    assert first.target is not second.target
    for now, later in itertools.pairwise(states[:20]):
        stages = (first.plan, first.govern, first.actuate, first.hold)
        stages[0](now)
        second.step(later)
        gait.update(later.t + 0.1)
        for stage in stages[1:]:
            command = stage(now)
        assert equal(command, alone.step(now))


def test_one_gait_in_two_threads(gait, states):
    expected = {}
    for offset in (0, 1):
        controller = controller_of("none", hp.make_gait(gait.robot))
        expected[offset] = [copy(controller.step(s)) for s in states[offset:]]
    found = {0: [], 1: []}

    def work(offset):
        controller = controller_of("none", gait)
        for state in states[offset:]:
            found[offset].append(copy(controller.step(state)))

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work, args=(offset,)) for offset in (0, 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    for offset, commands in expected.items():
        assert all(equal(a, b) for a, b in zip(commands, found[offset], strict=True))


def test_a_gait_of_ones_own_is_used_as_it_is(robot):
    class Steered(hp.StraightGait):
        """Its speed may change during the walk."""

    own = Steered(robot)
    assert controller_of("none", own).gait is own
