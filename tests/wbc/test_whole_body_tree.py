"""The whole-body optimum in six unknowns: beside dense programs, at the edges of what robots can
do, and bounded.
"""

from contextlib import suppress
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from oracle import run_plain
from scipy.optimize import linprog
from tree_cases import random_tree

import harpy_pin as hp
from comparison.measure.optimum_cases import (
    CASES,
    LIMITS,
    Case,
    humanoid,
    legged,
    solve_proxqp,
    solve_quadprog,
    two_joints,
)
from harpy_pin.errors import InputError
from harpy_pin.wbc import MomentumTask
from harpy_pin.wbc.condensed import WholeBodySolver, WholeBodyStatus, whole_body
from harpy_pin.wbc.condensed.whole_body_solve import YIELDING, solve_whole_body
from harpy_pin.wbc.cones import on_piece, project
from harpy_pin.wbc.optimum import root_multiplier

ANGLES = 2.0 * np.pi * np.arange(8) / 8
FACES = np.column_stack((np.cos(ANGLES), np.sin(ANGLES), np.full(8, np.tan(np.pi / 8))))


def error(found, true):
    """Largest difference, relative to the largest entry."""
    return np.abs(found - true).max() / np.abs(true).max()


def compare(case, state, solvers, status=WholeBodyStatus.OPTIMAL):
    """The solver's answer has accelerations, forces and torques of the dense program."""
    solution = case.solver.solve(state)
    assert solution.status == status
    program, torques = case.dense(state)
    nv, found = len(state.v), case.answer(solution)
    for solve in solvers:
        best = solve(program)[: len(found)]
        assert error(found[:nv], best[:nv]) < 1e-6
        assert error(found[nv:], best[nv:]) < 1e-6 or np.abs(found[nv:] - best[nv:]).max() < 1e-6
        assert error(solution.torque, torques(best)) < 1e-6


@needs_robots
@pytest.mark.parametrize("name", CASES)
def test_the_optimum_is_that_of_the_dense_program(name, fuzz):
    """At random states and targets, many of which press forces against their cones."""
    case, rng = CASES[name](), np.random.default_rng(1)
    for _ in range(8 * fuzz):
        compare(case, case.draw(rng), (solve_proxqp, solve_quadprog))


@needs_robots
@pytest.mark.parametrize(
    "name", ["go2 stands", "go2 trots", "g1 stands", "g1 on one foot", "g1 with both hands"]
)
def test_torques_at_their_limits_are_those_of_the_dense_program(name, fuzz):
    """Where the optimum without limits violates them, with up to a dozen that bind at once."""
    case, rng, violating = CASES[name](), np.random.default_rng(8), 0
    limits = case.solver.torque_range.copy()
    for _ in range(15 * fuzz):
        state = case.draw(rng, size=10.0 ** rng.uniform(0.5, 1.5))
        case.solver.torque_range[:] = np.inf * limits
        free = case.solver.solve(state)
        assert free.status == WholeBodyStatus.OPTIMAL
        violating += not (np.abs(free.torque) <= limits[:, 1]).all()
        case.solver.torque_range[:] = limits
        compare(case, state, (solve_quadprog,))
    assert violating > 3 * fuzz


@needs_robots
@pytest.mark.parametrize("name", ["go2", "g1"])
def test_accelerations_leave_room_to_stop_before_the_ends(name, fuzz):
    """Near the ends of joints, some a little too fast to stop at the deceleration they are capable
    of.
    """
    case, rng = legged("go2") if name == "go2" else humanoid("g1"), np.random.default_rng(9)
    case = Case(case.robot, case.q, case.tasks, None, case.regularisation, period=2e-3)
    lower, upper = case.robot.model.lowerPositionLimit[7:], case.robot.model.upperPositionLimit[7:]
    for _ in range(10 * fuzz):
        state = case.draw(rng, spread=0.1)
        near = rng.random(len(lower)) < 0.2
        place = rng.choice((0.0, 0.002, 0.05, 0.95, 0.998, 1.0), len(lower))
        state.q[7:] = np.where(near, lower + place * (upper - lower), state.q[7:])
        room = np.minimum(state.q[7:] - lower, upper - state.q[7:]).clip(0.0)
        towards = np.where(place < 0.5, -1.0, 1.0) * rng.uniform(-1.0, 1.05, len(lower))
        state.v[6:] = np.where(near, towards * np.sqrt(2.0 * 100.0 * room), state.v[6:])
        compare(case, state, (solve_quadprog,))


@needs_robots
@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_a_task_beyond_the_ends_stops_before_them(g1, period):
    """G1 is asked for angles beyond the ranges of its arms, fast; it moves as it is told."""
    q, v = hp.gaits.Standing(g1).initial_state()
    lower, upper = g1.model.lowerPositionLimit[7:], g1.model.upperPositionLimit[7:]
    aim = np.where(np.arange(len(lower)) % 2 == 0, upper + 0.5, lower - 0.5)
    arms = tuple(name for name in g1.joints if "shoulder" in name or "elbow" in name)
    on_arms = np.array([name in arms for name in g1.joints])
    tasks = {
        hp.JointTask(arms, position=aim[on_arms], gains=(400.0, 20.0)): 1.0,
        hp.FrameTask(
            "pelvis", part="both", position=q[:3], rotation=np.eye(3), gains=(100.0, 20.0)
        ): 1.0,
    }
    solver = WholeBodySolver(g1, tasks, limits=LIMITS, period=period, deceleration=50.0)
    feet, fastest = np.zeros((len(g1.feet), 3)), np.zeros(len(lower))
    for n in range(round(1.5 / period)):
        solution = solver.solve(hp.State(n * period, q, v, feet, feet, feet))
        q = pin.integrate(g1.model, q, period * v + 0.5 * period**2 * solution.acceleration)
        v = v + period * solution.acceleration
        assert (q[7:] < upper + 1e-4)[on_arms].all()
        assert (q[7:] > lower - 1e-4)[on_arms].all()
        fastest = np.maximum(fastest, np.abs(v[6:]))
    end = np.where(aim > upper, upper, lower)
    np.testing.assert_allclose(q[7:][on_arms], end[on_arms], atol=5e-3)
    assert (fastest < g1.model.velocityLimit[6:] + 0.01).all()


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_any_tree_with_any_contacts(seed):
    """Feet anywhere, several on a limb, points and soles, most of them contradictory: soft, so all
    are possible.

    In Python, since every shape of tree would be compiled for itself.
    """
    case, rng = random_tree(seed)
    state = case.draw(rng, spread=1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole_body, "solve_whole_body", partial(run_plain, solve_whole_body))
        compare(case, state, (solve_quadprog,))


def feasible(program):
    """Whether any motion keeps equalities and ranges, by a linear program."""
    _, gradient, equality, value, rows, lower, upper = program
    matrix, most = np.vstack((rows, -rows)), np.concatenate((upper, -lower))
    known = most < 1e19
    return linprog(
        0.0 * gradient, matrix[known], most[known], equality, value, bounds=(None, None)
    ).success


def cost(program, x):
    """What a program minimises."""
    return x @ (0.5 * program[0] @ x + program[1])


def check_promise(case, state, solution):
    """Finite; forces in their cones and ranges; and motion, torques and forces satisfy the
    equations of motion.
    """
    assert np.isfinite(case.answer(solution)).all()
    assert np.isfinite(solution.torque).all()
    held = np.repeat(case.solver.held, case.robot.corners) > 0.0
    local = np.einsum("kij,ki->kj", case.solver.contact_frame, solution.force)
    assert (solution.force[~held] == 0.0).all()
    least, most = case.solver.force_range[held].T
    size = 1.0 + np.abs(local[held]).max(axis=1, initial=0.0)
    assert ((local[held, 2] >= least - 1e-9 * size) & (local[held, 2] <= most + 1e-9 * size)).all()
    assert ((local[held] @ LIMITS.pyramid.T).min(axis=1, initial=0.0) >= -1e-9 * size).all()
    (_, _, equality, value, *_), torques = case.dense(state)
    answer = case.answer(solution)
    scale = np.abs(equality[:6]) @ np.abs(answer) + np.abs(value[:6])
    assert (np.abs(equality[:6] @ answer - value[:6]) <= 1e-7 * scale.max()).all()
    true = np.clip(torques(answer), *case.solver.torque_range.T)
    np.testing.assert_allclose(
        solution.torque, true, rtol=0, atol=1e-9 * (1.0 + np.abs(answer).max() * 100)
    )


@needs_robots
@pytest.mark.parametrize(
    "name", ["go2 stands", "harpy on one foot", "g1 stands", "legs of two joints trot"]
)
def test_promise_for_every_state_and_target(name, fuzz):
    """Whatever is asked for, warm from an answer to something else; contacts on slopes, too."""
    case, rng, seen = CASES[name](), np.random.default_rng(2), [0, 0, 0]
    for _ in range(150 * fuzz):
        state = case.draw(
            rng, spread=10.0 ** rng.uniform(-2.0, 0.0), size=10.0 ** rng.uniform(-1.0, 2.0)
        )
        case.solver.held[:] = rng.integers(0, 2, len(case.solver.held))
        turn = pin.exp3(0.5 * rng.standard_normal(3))
        case.solver.contact_frame[:] = turn if rng.random() < 0.5 else np.eye(3)
        solution = case.solver.solve(state)
        seen[solution.status] += 1
        check_promise(case, state, solution)
    assert seen[WholeBodyStatus.OPTIMAL] >= 0.99 * sum(seen)
    assert seen[WholeBodyStatus.INVALID] == 0


@needs_robots
@pytest.mark.parametrize("name", ["go2 stands", "harpy on one foot", "g1 stands"])
def test_feet_give_way_where_no_motion_within_the_limits_keeps_them(name, fuzz):
    """Absurd states: where a linear program says that torques and contacts contradict each other,
    the answer is that of soft contacts, and keeps every limit. No feasible one costs less, as far
    as quadprog can tell, to which the heavy squares are hard.
    """
    case, rng, seen = CASES[name](), np.random.default_rng(3), [0, 0, 0, 0]
    for _ in range(60 * fuzz):
        state = case.draw(rng, spread=1.0, size=100.0)
        state.v[:] *= 30.0
        case.compliance = 0.0
        solution = case.solver.solve(state)
        seen[solution.status] += 1
        check_promise(case, state, solution)
        if solution.status == WholeBodyStatus.CONTACTS_YIELDED:
            assert not feasible(case.dense(state)[0])
            case.compliance = YIELDING
            program, torques = case.dense(state)
            answer = case.answer(solution)
            assert np.abs(solution.torque - torques(answer)).max() < 1e-4
            with suppress(ValueError):  # "inconsistent", which it cannot be
                best = solve_quadprog(program)
                assert cost(program, answer) < cost(program, best) + 1e-6 * abs(cost(program, best))
    assert seen[WholeBodyStatus.SUBOPTIMAL] <= 0.05 * sum(seen)
    assert seen[WholeBodyStatus.CONTACTS_YIELDED] > 0.3 * sum(seen)


@needs_robots
@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("name", ["go2", "g1"])
def test_straight_knees_are_no_special_case(name, bend):
    """A straight leg holds its foot all the same: contacts do not move, and the answer is that of
    the dense program.
    """
    case, rng = legged("go2") if name == "go2" else humanoid("g1"), np.random.default_rng(3)
    knees = [
        1 + 6 + n
        for n, joint in enumerate(case.robot.joints)
        if ("calf" if name == "go2" else "knee") in joint
    ]
    assert len(knees) in (2, 4)
    for _ in range(3):
        state = case.draw(rng, spread=0.1)
        state.q[knees[:1] if name == "go2" else knees] = bend
        case.solver.contact_acceleration[:] = 0.0
        state.v[:] = 0.0
        compare(case, state, (solve_quadprog,))
        check_promise(case, state, case.solver.solution)


def test_contradictory_feet_get_the_nearest_motion():
    """Four feet on legs of two joints cannot all follow: the answer is that of heavy squares."""
    case, rng = two_joints(compliance=1e-4), np.random.default_rng(4)
    for _ in range(10):
        state = case.draw(rng)
        compare(case, state, (solve_quadprog,))
    case.solver.record["contacts"]["compliance"] = 1e-9
    for _ in range(50):
        state = case.draw(rng, size=10.0)
        check_promise(case, state, case.solver.solve(state))


def test_forces_that_are_no_optimum_have_their_motion():
    """Where the search ends at its bound, λ = K⁻¹ (w − G f) gives the motion of whatever forces are
    at hand.
    """
    case, rng = CASES["legs of seven joints"](), np.random.default_rng(5)
    case.solver.solve(case.draw(rng))
    newton = case.solver._record_["newton"]
    newton["force"] += 50.0 * rng.standard_normal(newton["force"].shape)
    root_multiplier(newton, False)
    multiplier = newton["bare"][0, :6]
    wrench = newton["force_map"][0].T @ newton["force"][0]
    np.testing.assert_allclose(
        newton["compliance"][0, :6, :6] @ multiplier + wrench[:6],
        newton["demand"][0, :6],
        rtol=1e-9,
        atol=1e-8,
    )


numbers = st.floats(-50.0, 50.0, allow_subnormal=False)


@given(
    st.tuples(numbers, numbers, numbers),
    st.floats(0.05, 1.5),
    st.floats(0.0, 20.0),
    st.floats(0.0, 40.0),
)
@settings(max_examples=300, deadline=None)
def test_the_nearest_force_of_a_pyramid(g, friction, lower, more):
    """No force of the pyramid and range is nearer: (g − f) · (h − f) ≤ 0 for each of its corners
    h. On its piece it is a linear function of g.
    """
    g, force, upper = np.array(g), np.empty(3), lower + more
    piece = project(g, friction, lower, upper, FACES, force)
    assert lower <= force[2] <= upper
    assert (FACES[:, :2] @ force[:2] <= friction * force[2] + 1e-9).all()
    around = ANGLES + np.pi / 8
    edges = np.column_stack((np.cos(around), np.sin(around))) * friction / np.cos(np.pi / 8)
    corners = np.vstack(
        [np.column_stack((height * edges, np.full(8, height))) for height in (lower, upper)]
    )
    assert ((corners - force) @ (g - force) <= 1e-9 * (1.0 + np.abs(g).max() ** 2)).all()
    offset, derivative = np.empty(3), np.empty((3, 3))
    on_piece(piece, friction, lower, upper, FACES, offset, derivative)
    np.testing.assert_allclose(
        derivative @ g + offset, force, rtol=0, atol=1e-12 + 1e-13 * np.abs(g).max()
    )


def test_a_bad_state_keeps_the_last_answer():
    case, rng = CASES["legs of seven joints"](), np.random.default_rng(6)
    state = case.draw(rng)
    before = case.answer(case.solver.solve(state)).copy()
    bad = case.draw(rng)
    bad.q[9] = np.nan
    solution = case.solver.solve(bad)
    assert solution.status == WholeBodyStatus.INVALID
    np.testing.assert_array_equal(case.answer(solution), before)
    task = next(iter(case.tasks))
    good = task.acceleration.copy()
    task._acceleration_[0] = np.inf
    assert (
        case.solver.solve(case.draw(rng, size=0.0)).status == WholeBodyStatus.OPTIMAL
    )  # which draws it anew
    task._acceleration_[0] = np.inf
    assert case.solver.solve(state).status == WholeBodyStatus.INVALID
    task.acceleration = good
    assert case.solver.solve(state).status == WholeBodyStatus.OPTIMAL
    with pytest.raises(InputError):
        case.solver.solve(
            hp.State(
                0.0,
                state.q[1:],
                state.v,
                state.foot_position,
                state.foot_velocity,
                state.foot_force,
            )
        )


@needs_robots
def test_a_tick_without_an_answer_spoils_none_after_it():
    """Torques of zero for a tick: what follows is what a new solver finds."""
    case, new, rng = CASES["go2 stands"](), CASES["go2 stands"](), np.random.default_rng(11)
    case.solver.solve(case.draw(rng))
    limits = case.solver.torque_range.copy()
    case.solver.torque_range[:] = 0.0
    state = case.draw(rng)
    check_promise(case, state, case.solver.solve(state))
    case.solver.torque_range[:] = limits
    state = case.draw(rng)
    found = case.solver.solve(state)
    assert found.status == WholeBodyStatus.OPTIMAL
    for task, other in zip(case.tasks, new.tasks, strict=True):
        other.acceleration[:] = task.acceleration
    new.solver.contact_acceleration[:] = case.solver.contact_acceleration
    new.solver.reference_force[:] = case.solver.reference_force
    np.testing.assert_allclose(case.answer(found), new.answer(new.solver.solve(state)), atol=1e-5)


@needs_robots
def test_optimal_keeps_every_limit(fuzz):
    """Of fast states near the ends, more limits than there is room for: none is dropped without a
    word.
    """
    case, rng = legged("harpy", regularisation=1e-6), np.random.default_rng(1)
    case = Case(case.robot, case.q, case.tasks, None, case.regularisation, period=2e-3)
    record = case.solver._record_["limits"]
    for _ in range(200 * fuzz):
        state = case.draw(rng, spread=0.3, size=3.0)
        state.v[6:] *= 10.0
        solution = case.solver.solve(state)
        assert np.isfinite(case.answer(solution)).all()
        assert (np.abs(solution.torque) <= case.solver.torque_range[:, 1]).all()
        lower, upper = record["acceleration_range"][0].T
        # ranges of accelerations yield by 1e-6 times their multiplier
        if solution.status == WholeBodyStatus.OPTIMAL:
            assert (solution.acceleration[6:] >= lower - 1.0 - 1e-3 * np.abs(lower)).all()
            assert (solution.acceleration[6:] <= upper + 1.0 + 1e-3 * np.abs(upper)).all()


def test_references_are_followed():
    """Positions, rotations and gains: the desired accelerations are those of the tasks' own rows,
    in every axes.
    """
    case, rng = CASES["legs of seven joints"](), np.random.default_rng(7)
    robot, gains = case.robot, (100.0, 20.0)
    for axes in ("world", "local"):
        place, turn = rng.normal(size=3), pin.exp3(rng.normal(size=3))
        tasks = {
            hp.FrameTask(
                "foot0_0", part="both", axes=axes, position=place, rotation=turn, gains=gains
            ): 1.0,
            hp.FrameTask("root", part="orientation", axes=axes, rotation=turn, gains=gains): 1.0,
            hp.FrameTask(
                "foot0_0",
                part="both",
                root="foot1_0",
                axes=axes,
                position=place,
                rotation=turn,
                gains=gains,
            ): 1.0,
            hp.CentreOfMassTask(position=place, gains=gains): 1.0,
            hp.JointTask(robot.joints[3], position=0.5, gains=gains): 1.0,
            MomentumTask(gain=5.0): 0.1,
        }
        case = Case(robot, case.q, tasks, None, 1e-2)
        compare(case, case.draw(rng), (solve_quadprog,))
        next(iter(tasks)).position[:] = 0.0  # written in place, for the next solve
        compare(case, case.draw(rng), (solve_quadprog,))


def test_what_is_refused():
    robot = CASES["legs of seven joints"]().robot
    for tasks in (
        {MomentumTask(part="both"): 1.0},
        {hp.CentreOfMassTask(): 1.0, hp.CentreOfMassTask(): 2.0},
        {hp.FrameTask("nowhere"): 1.0},
        {hp.JointTask("nothing"): 1.0},
        {hp.CentreOfMassTask(): -1.0},
        {hp.FootForceTask("foot0_0"): 1.0},
    ):
        with pytest.raises(InputError):
            WholeBodySolver(robot, tasks)
    case = CASES["legs of seven joints"]()
    state = case.draw(np.random.default_rng(0))
    for held in (0.5, 2.0, np.nan):
        case.solver.held[0] = held
        with pytest.raises(InputError, match="held must be 0 or 1"):
            case.solver.solve(state)
