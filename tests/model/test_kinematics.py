"""Closed-form leg kinematics and the iterative solver, against geometry, Pinocchio and brute
force.
"""

import re
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import places
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from needs import needs_robots
from scipy.optimize import least_squares, minimize_scalar

import harpy_pin as hp
from harpy_pin import InputError, RobotError
from harpy_pin.errors import OutOfReachError
from harpy_pin.model import LegGeometry, leg_inverse_kinematics, solve_ik
from harpy_pin.model.ik import IKStatus
from harpy_pin.model.kinematics import leg_jacobian

UPPER, LOWER = 0.5, 0.2
seeds = st.integers(0, 2**32 - 1)
sides = st.sampled_from([1, -1])
coordinate = st.floats(-1.0, 1.0)


def foot_of(side, angles):
    """The leg by hand: hip beam, then a frontal turn of a planar two-link chain. Accepts complex
    angles.
    """
    frontal, sagittal, knee = angles
    x = -UPPER * np.sin(sagittal) - LOWER * np.sin(sagittal + knee)
    z = -UPPER * np.cos(sagittal) - LOWER * np.cos(sagittal + knee)
    y = 0.05 * side
    c, s = np.cos(frontal), np.sin(frontal)
    return np.array([x, 0.1 * side + c * y - s * z, -0.1 + s * y + c * z])


def distance_to_workspace(side, foot):
    """Shortest way to a point of the leg, by search.

    Around the frontal axis everything is symmetric: a point is (x, ρ), ρ its distance from the
    axis. The leg reaches (x, √(d² + w²)) for all |upper − lower| ≤ √(x² + w²) ≤ upper + lower.
    """
    x, rho = foot[0], np.hypot(foot[1] - 0.1 * side, foot[2] + 0.1)
    offset = 0.05

    def gap(length, direction):
        return np.hypot(
            x - length * np.cos(direction), rho - np.hypot(offset, length * np.sin(direction))
        )

    length = np.hypot(x, np.sqrt(max(rho**2 - offset**2, 0.0)))
    if rho >= offset and UPPER - LOWER <= length <= UPPER + LOWER:
        return 0.0
    # Outside, the nearest point is on the border: one of the two circles, or w = 0 (the line ρ =
    # d).
    best = np.inf
    for radius in (UPPER - LOWER, UPPER + LOWER):
        directions = np.linspace(0.0, np.pi, 721)
        start = directions[np.argmin(gap(radius, directions))]
        step = directions[1]
        found = minimize_scalar(
            lambda a, radius=radius: gap(radius, a),
            bounds=(start - step, start + step),
            options={"xatol": 1e-12},
        )
        best = min(best, found.fun, gap(radius, start))
    nearest_x = np.sign(x if x else 1.0) * np.clip(abs(x), UPPER - LOWER, UPPER + LOWER)
    return min(best, np.hypot(x - nearest_x, rho - offset))


@pytest.fixture(scope="module")
def legs(robot):
    return {
        1: LegGeometry.from_robot(robot, "left_foot"),
        -1: LegGeometry.from_robot(robot, "right_foot"),
    }


def test_geometry_is_read_from_the_model(legs):
    for side, leg in legs.items():
        assert leg.hip == pytest.approx((0.0, 0.1 * side, -0.1), abs=1e-15)
        assert leg.offset == pytest.approx(0.05 * side, abs=1e-15)
        assert (leg.upper, leg.lower) == pytest.approx((UPPER, LOWER), abs=1e-15)


hanging = st.tuples(
    sides, st.floats(-1.5, 1.5), st.floats(-2.5, 2.5), st.floats(0.05, np.pi - 0.05)
)


@given(leg=hanging)
def test_leg_jacobian_against_complex_step(legs, leg):
    side, *angles = leg
    out = np.zeros((3, 3))
    leg_jacobian(legs[side].record[0], np.array(angles), out)
    h = 1e-30
    exact = np.array([foot_of(side, np.array(angles) + 1j * h * e).imag / h for e in np.eye(3)]).T
    np.testing.assert_allclose(out, exact, rtol=0, atol=1e-15)


@settings(max_examples=300)
@given(leg=hanging)
def test_round_trip(legs, leg):
    """Angles → foot → the same angles, where the foot hangs below its hip."""
    side, frontal, sagittal, knee = leg
    assume(UPPER * np.cos(sagittal) + LOWER * np.cos(sagittal + knee) > 0.02)
    foot = foot_of(side, (frontal, sagittal, knee))
    angles = leg_inverse_kinematics(legs[side], foot)
    np.testing.assert_allclose(foot_of(side, angles), foot, rtol=0, atol=1e-14)
    np.testing.assert_allclose(angles, (frontal, sagittal, knee), rtol=0, atol=2e-13)


@settings(max_examples=500)
@given(side=sides, foot=st.tuples(coordinate, coordinate, coordinate))
@example(side=1, foot=(0.3, 0.15, -0.95))
@example(side=1, foot=(0.0, 0.12, -0.11))
@example(side=1, foot=(0.05, 0.16, -0.2))
@example(side=-1, foot=(0.0, -0.1, -0.1))
@example(side=-1, foot=(0.4, -0.1, -0.1))
def test_reached_or_refused_with_the_nearest_point(legs, side, foot):
    """Any point at all: either the foot is put there exactly, or the error says by how much it is
    out of reach.
    """
    exact = distance_to_workspace(side, foot)
    refusal = None
    try:
        angles = leg_inverse_kinematics(legs[side], foot)
    except OutOfReachError as error:
        refusal = error
    if refusal is None:
        assert exact < 1e-7
        assert np.all(np.isfinite(angles))
        assert 0.0 <= angles[2] <= np.pi
        np.testing.assert_allclose(foot_of(side, angles), foot, rtol=0, atol=1e-9)
    else:
        assert exact > 1e-13
        np.testing.assert_array_equal(refusal.target, foot)
        put = foot_of(side, refusal.nearest)
        assert np.linalg.norm(put - foot) == pytest.approx(refusal.excess, abs=1e-9)
        assert refusal.excess == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("bad", [[0, 0], [0, 0, np.nan], [0, 0, np.inf], "abc", None, [[0, 0, 0]]])
def test_bad_foot(legs, bad):
    with pytest.raises(InputError):
        leg_inverse_kinematics(legs[1], bad)


@pytest.mark.parametrize("end", ['0.01 0 -0.5"', '0 0 -0.5" rpy="0 0 0.1"'])
@needs_robots
def test_other_legs_are_refused_by_the_closed_form(urdf_with, end):
    strange = hp.load_harpy(urdf_with('<origin xyz="0 0 -0.5"/>', f'<origin xyz="{end}/>'))
    for robot, foot in ((named("g1"), "left_sole_0"), (strange, "left_foot")):
        with pytest.raises(RobotError, match="solve_ik"):
            LegGeometry.from_robot(robot, foot)
    LegGeometry.from_robot(strange, "right_foot")


named = cache(hp.load_robot)


def placement(robot, q, name):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.frame_id(name)].copy()


def middle(robot):
    q = pin.neutral(robot.model)
    q[7:] = 0.5 * (robot.joint_lower + robot.joint_upper)
    return q


def within_limits(robot, q):
    return np.all(q[7:] >= robot.joint_lower) and np.all(q[7:] <= robot.joint_upper)


@given(seed=seeds)
def test_feet_of_harpy(robot, draw_state, seed):
    desired, _ = draw_state(np.random.default_rng(seed))
    start = middle(robot)
    start[:7] = desired[:7]
    targets = {foot: placement(robot, desired, foot).translation for foot in robot.feet}
    result = solve_ik(robot, targets, start)
    assert result.converged
    assert result.status is IKStatus.CONVERGED
    assert within_limits(robot, result.q)
    np.testing.assert_allclose(result.q[:7], start[:7], rtol=0, atol=1e-15)  # normalised, not moved
    for foot, target in targets.items():
        assert np.linalg.norm(placement(robot, result.q, foot).translation - target) <= 1e-10
    assert result.error <= 1e-10


@needs_robots
@given(seed=seeds)
def test_four_legs(seed):
    robot, desired = named("go2"), middle(named("go2"))
    desired[7:] += (
        0.3
        * np.random.default_rng(seed).uniform(-1.0, 1.0, 12)
        * (robot.joint_upper - robot.joint_lower)
    )
    targets = dict(zip(robot.feet, places(robot, desired), strict=True))
    result = solve_ik(robot, targets, middle(robot))
    assert within_limits(robot, result.q)
    error = np.linalg.norm(places(robot, result.q) - places(robot, desired))
    assert error == pytest.approx(result.error, abs=1e-12)
    # A limit can end the descent early; then the status must say so and the joint must be named.
    assert result.converged == (error <= 1e-10)
    assert result.converged or result.status is IKStatus.STALLED


@needs_robots
@given(seed=seeds)
def test_pose_of_a_sole_nearby(seed):
    """From a start within reach of Newton's method, a pose (position and orientation) is met by a
    leg of six joints.
    """
    robot, rng = named("g1"), np.random.default_rng(seed)
    leg = 7 + np.array(
        [j for j, name in enumerate(robot.joints) if re.match("left_(hip|knee|ankle)", name)]
    )
    desired = pin.neutral(robot.model)
    desired[leg] = np.array([-0.4, 0.0, 0.0, 0.8, -0.4, 0.0]) + 0.2 * rng.uniform(-1.0, 1.0, 6)
    start = desired.copy()
    start[leg] += rng.uniform(-0.1, 0.1, 6)
    target = placement(robot, desired, "left_sole")
    result = solve_ik(robot, {"left_sole": target}, start)
    assert result.converged
    found = placement(robot, result.q, "left_sole")
    np.testing.assert_allclose(found.homogeneous, target.homogeneous, rtol=0, atol=1e-9)
    assert within_limits(robot, result.q)
    assert result.iterations < 30


@settings(max_examples=15)
@given(seed=seeds)
def test_unreachable_foot_stalls_at_the_nearest_point(robot, seed):
    """Straight below and ahead of the hip, out of reach: the distance left is the least there is,
    limits included.
    """
    rng = np.random.default_rng(seed)
    start = middle(robot)
    target = np.array([rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.3), rng.uniform(-1.5, -0.9)])
    # Far out of reach the descent is slow: it takes more than the default 200 steps to come to a
    # stop.
    result = solve_ik(robot, {"left_foot": target}, start, max_iterations=20_000)
    assert result.status is IKStatus.STALLED
    assert not result.converged
    assert within_limits(robot, result.q)
    best = least_squares(
        lambda angles: foot_of(1, angles) - target,
        start[7:10],
        bounds=(robot.joint_lower[:3], robot.joint_upper[:3]),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    assert result.error == pytest.approx(np.sqrt(2 * best.cost), abs=1e-7)
    np.testing.assert_array_equal(result.q[10:], start[10:])


def test_start_outside_the_limits_is_brought_inside(robot):
    start = middle(robot)
    start[9] = -1.0  # knee bent backwards
    foot = placement(robot, middle(robot), "left_foot").translation
    result = solve_ik(robot, {"left_foot": foot}, start)
    assert result.converged
    assert within_limits(robot, result.q)


def test_solved_start_takes_no_step(robot):
    start = middle(robot)
    result = solve_ik(robot, {"left_foot": placement(robot, start, "left_foot").translation}, start)
    assert result.converged
    assert result.iterations == 0
    np.testing.assert_array_equal(result.q, start)


def test_iteration_limit_is_reported(robot):
    foot = placement(robot, middle(robot), "left_foot").translation + np.array([0.1, 0.02, 0.1])
    result = solve_ik(robot, {"left_foot": foot}, middle(robot), max_iterations=2)
    assert result.status is IKStatus.MAX_ITERATIONS
    assert result.iterations == 2
    assert 0.0 < result.error < np.linalg.norm([0.1, 0.02, 0.1])


def test_inputs_of_solve_ik_are_left_alone(robot):
    start, target = middle(robot), np.array([0.05, 0.15, -0.55])
    before = start.copy()
    solve_ik(robot, {"left_foot": target}, start)
    np.testing.assert_array_equal(start, before)
    np.testing.assert_array_equal(target, [0.05, 0.15, -0.55])


def test_bad_input_of_solve_ik(robot):
    start = middle(robot)
    with pytest.raises(InputError, match="at least one target"):
        solve_ik(robot, {}, start)
    with pytest.raises(InputError, match=r"'tail'.*left_foot"):
        solve_ik(robot, {"tail": np.zeros(3)}, start)
    pose = pin.SE3(np.eye(3), np.array([0.0, np.nan, 0.0]))
    for bad in ([0, 0], [0, 0, np.nan], "abc", np.zeros((3, 1)), pose):
        with pytest.raises(InputError):
            solve_ik(robot, {"left_foot": bad}, start)
    for bad in (
        start[:-1],
        np.full(13, np.nan),
        np.zeros(13),
    ):  # the last one without an orientation
        with pytest.raises(InputError):
            solve_ik(robot, {"left_foot": np.zeros(3)}, bad)
