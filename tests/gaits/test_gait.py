"""Bezier curves against Bernstein's sum, and the walk: support, hand-over, feet at rest on the
ground.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import frame_terms, places
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import BPoly

import harpy_pin as hp
from harpy_pin import InputError, make_gait
from harpy_pin.gaits import GaitParameters, StraightGait
from harpy_pin.gaits.straight import bezier

coordinates = arrays(float, (5, 3), elements=st.floats(-2, 2))
times = st.floats(0.0, 12.0)

WALKS = {
    "paper": {},
    "no double support": {"double_support": 0.0},
    "long double support": {"double_support": 0.6},
    "slow": {"speed": 0.05},
    "backwards": {"speed": -0.2},
    "quick steps": {"step_duration": 0.3, "speed": 0.5},
    "no sway": {"sway": 0.0},
    "no offset": {"penetration_offset": 0.0},
}


@pytest.fixture(scope="module", params=WALKS, ids=str)
def gait(robot, request):
    return StraightGait(robot, GaitParameters(**WALKS[request.param]))


def targets(gait, times):
    """Records of the targets, one for each time."""
    return np.concatenate([gait.update(float(t)).record.copy() for t in np.atleast_1d(times)])


def world(rows):
    """Feet in the world: position, velocity, acceleration; (times, 3, feet, 3)."""
    relative = np.stack(
        (rows["foot_position"], rows["foot_velocity"], rows["foot_acceleration"]), axis=1
    )
    return rows["body"].reshape(-1, 3, 1, 3) + relative


def grid(gait, periods=2, rows=1501):
    """Times over some cycles that avoid the hand-overs themselves."""
    p = gait.parameters
    t = np.linspace(0.0, 2 * periods * p.step_duration, rows)[:-1] + 1e-5
    phase = np.mod(t, p.step_duration)
    return t[(np.abs(phase - p.double_support * p.step_duration) > 2e-6) & (phase > 2e-6)]


@given(points=coordinates, s=st.floats(0, 1), duration=st.floats(0.1, 3.0))
def test_bezier_against_bernstein(points, s, duration):
    polynomial = BPoly(points[:, None, :], [0.0, duration])
    t = s * duration
    position, velocity, acceleration = out = np.zeros((3, 3))
    bezier(points, s, duration, *out)
    np.testing.assert_allclose(position, polynomial(t), rtol=0, atol=1e-13)
    np.testing.assert_allclose(velocity, polynomial.derivative(1)(t), rtol=0, atol=1e-11 / duration)
    np.testing.assert_allclose(
        acceleration, polynomial.derivative(2)(t), rtol=0, atol=1e-10 / duration**2
    )


def test_feet_stand_in_turns_with_double_support_between(gait):
    p, t = gait.parameters, grid(gait)
    stance, (step, phase) = targets(gait, t)["stance"], np.divmod(t, p.step_duration)
    left = step % 2 == 0  # the left foot stands in the even steps
    np.testing.assert_array_equal(np.where(left, stance[:, 0], stance[:, 1]), 1.0)
    np.testing.assert_array_equal(
        np.where(left, stance[:, 1], stance[:, 0]), phase < p.double_support * p.step_duration
    )


def test_a_stance_foot_stands_still_in_the_world(gait):
    """Body target + relative target: no motion in x and y for the whole of a stance, footholds one
    step apart.
    """
    p, t = gait.parameters, grid(gait, periods=3, rows=1801)
    rows, footholds = targets(gait, t), {}
    feet, stance = world(rows), rows["stance"] == 1.0
    np.testing.assert_allclose(feet[:, 1, :, :2][stance], 0.0, atol=1e-12)
    np.testing.assert_allclose(feet[:, 2, :, :2][stance], 0.0, atol=1e-10)
    begun = np.round(t[:, None] / p.step_duration - rows["phase"] * (1 + p.double_support))
    for k in range(2):
        for step in np.unique(begun[stance[:, k], k]):
            places = feet[stance[:, k] & (begun[:, k] == step), 0, k, :2]
            footholds[k, step] = places[0]
            np.testing.assert_allclose(places - places[0], 0.0, atol=1e-12)
    for (k, step), place in footholds.items():
        assert place[1] == pytest.approx(p.width * (1 - 2 * k), abs=1e-12)
        if (1 - k, step + 1) in footholds:
            ahead = footholds[1 - k, step + 1][0] - place[0]
            assert ahead == pytest.approx(p.speed * p.step_duration, abs=1e-12)
    assert len(footholds) >= 6


def test_a_stance_foot_aims_no_deeper_than_its_offset(gait):
    """Its target in the world is between −offset and the surface, that of a swing foot at or above
    the surface.
    """
    p, rows = gait.parameters, targets(gait, grid(gait))
    height, stance = world(rows)[:, 0, :, 2], rows["stance"] == 1.0
    assert height[stance].min() >= -p.penetration_offset - 1e-12
    assert height[stance].max() <= 1e-12
    assert height[~stance].min() >= -1e-12
    assert height[~stance].max() == pytest.approx(p.clearance, rel=1e-3)


def test_lift_off_and_touchdown_at_rest(gait):
    """At both ends of a swing the foot has the velocity of the ground, and no vertical speed."""
    p = gait.parameters
    for step in range(1, 5):
        swing, end = step % 2, step * p.step_duration
        begin = (step - 1 + p.double_support) * p.step_duration
        rows = targets(gait, (begin + 1e-9, end - 1e-8, 0.5 * (begin + end)))
        assert not rows["stance"][:, swing].any()
        velocity = world(rows)[:, 1, swing]
        np.testing.assert_allclose(velocity[:2], 0.0, atol=1e-5)
        assert abs(velocity[2, 0]) > abs(p.speed)  # it overtakes the body in between


def test_targets_are_continuous(gait):
    """Positions of body and feet never jump; nor does the velocity along the ground."""
    p, h = gait.parameters, 1e-7
    events = [i * p.step_duration for i in range(1, 6)]
    events += [(i + p.double_support) * p.step_duration for i in range(6)]
    t = np.array([*events, *np.linspace(0.01, 4 * p.step_duration, 97)])
    before, after = targets(gait, t - h), targets(gait, t + h)
    for name in ("body", "foot_position"):
        np.testing.assert_allclose(before[name], after[name], atol=1e-5)
    jump = np.abs(before["foot_velocity"] - after["foot_velocity"])
    assert jump[..., :2].max() <= 1e-4
    # The only jump: the stance goes into the ground at once, 4 offset / stance time.
    assert (
        jump[..., 2].max()
        <= 4 * p.penetration_offset / (p.step_duration * (1 + p.double_support)) + 1e-4
    )


@settings(max_examples=60)
@given(t=times)
def test_targets_at_the_very_hand_over(robot, t):
    """No instant, however rounded, has no support, a phase outside [0, 1] or anything not
    finite.
    """
    step = 0.75 * round(t / 0.75)
    rows = targets(make_gait(robot), np.maximum((t, step, step + 0.15, np.nextafter(step, 0)), 0.0))
    assert (rows["stance"].sum(axis=1) >= 1).all()
    assert rows["phase"].min() >= -1e-8
    assert rows["phase"].max() <= 1 + 1e-8
    assert rows["world_frame_blend"].min() >= 0
    assert rows["world_frame_blend"].max() <= 1
    assert all(np.isfinite(rows[name]).all() for name in rows.dtype.names)


def test_velocities_and_accelerations_are_derivatives(gait):
    p, h = gait.parameters, 1e-6
    t = np.linspace(0.013, 4 * p.step_duration, 83)
    phase = np.mod(t, p.step_duration)
    events = (np.abs(phase - p.double_support * p.step_duration), phase, p.step_duration - phase)
    t = t[np.min(events, axis=0) > 2 * h]
    here, ahead, behind = (targets(gait, t + shift) for shift in (0.0, h, -h))
    for value, slope in (
        ("foot_position", "foot_velocity"),
        ("foot_velocity", "foot_acceleration"),
    ):
        np.testing.assert_allclose(
            here[slope], (ahead[value] - behind[value]) / (2 * h), atol=1e-6, rtol=1e-7
        )
    body = (ahead["body"] - behind["body"]) / (2 * h)
    np.testing.assert_allclose(here["body"][:, 3:], body[:, :6], atol=1e-7)


def test_steps_are_mirror_images(gait):
    """One step later the right foot does what the left did, seen in the mirror."""
    p = gait.parameters
    t = np.linspace(0.011, 2 * p.step_duration, 41)
    first, second = targets(gait, t), targets(gait, t + p.step_duration)
    for name in ("foot_position", "foot_velocity", "foot_acceleration"):
        np.testing.assert_allclose(
            second[name][:, ::-1], first[name] * (1, -1, 1), atol=1e-9, err_msg=name
        )
    np.testing.assert_allclose(second["stance"][:, ::-1], first["stance"])
    np.testing.assert_allclose(second["body"][:, 1::3], -first["body"][:, 1::3], atol=1e-9)


def test_body_moves_as_asked(gait):
    p = gait.parameters
    body = targets(gait, np.linspace(0, 2 * p.step_duration, 401))["body"]
    np.testing.assert_allclose(body[:, 2], p.height)
    np.testing.assert_allclose(body[:, 3], p.speed)
    np.testing.assert_allclose(np.abs(body[:, 1]).max(), p.sway, atol=1e-5)
    # It sways to the side of the stance foot: left (y > 0) during the first step.
    assert np.all(body[1:200, 1] >= 0.0)
    assert np.all(body[201:400, 1] <= 0.0)


def test_every_target_is_within_reach_of_the_leg(robot, gait):
    """Between the moments that the constructor checks, too; the next cycle is the same."""
    for row in targets(gait, grid(gait, periods=1, rows=751)):
        for k, geometry in enumerate(gait.geometry):
            angles = hp.model.leg_inverse_kinematics(geometry, row["foot_position"][k])
            assert np.all(angles >= robot.joint_lower[3 * k : 3 * k + 3])
            assert np.all(angles <= robot.joint_upper[3 * k : 3 * k + 3])


def test_paper_numbers(robot):
    """equations.md §3: one step of 0.225 m in 0.75 s, height 0.6 m, ±0.025 m sideways with period
    1.5 s.
    """
    gait = make_gait(robot)
    assert (gait.parameters.speed, gait.parameters.step_duration, gait.parameters.height) == (
        0.3,
        0.75,
        0.6,
    )
    feet = world(targets(gait, (0.3, 0.3 + 0.75, 0.3 + 1.5)))[:, 0, :, 0]
    np.testing.assert_allclose(np.diff((feet[0, 0], feet[1, 1], feet[2, 0])), 0.225, atol=1e-12)
    np.testing.assert_allclose(
        targets(gait, (0.375, 1.125))["body"][:, 1], (0.025, -0.025), atol=1e-12
    )


@pytest.mark.parametrize("depth", [0.0, 0.0025])
def test_initial_state_matches_the_targets(robot, gait, depth):
    q, v = gait.initial_state(penetration=depth)
    target = targets(gait, 0.0)[0]
    feet, (jacobian, _) = places(robot, q), frame_terms(robot.model, robot.feet, q, v)
    np.testing.assert_array_equal(q[3:7], [0, 0, 0, 1])
    np.testing.assert_allclose(v[:3], target["body"][3:6], atol=1e-15)
    np.testing.assert_array_equal(v[3:6], 0.0)
    np.testing.assert_allclose(q[:2], target["body"][:2], atol=1e-15)
    np.testing.assert_allclose(feet - q[:3], target["foot_position"], atol=1e-12)
    np.testing.assert_allclose(
        jacobian @ v, target["body"][3:6] + target["foot_velocity"], atol=1e-12
    )
    assert feet[:, 2].min() == pytest.approx(-depth, abs=1e-12)
    assert np.all(q[7:] >= robot.joint_lower)
    assert np.all(q[7:] <= robot.joint_upper)


def test_standing(robot):
    gait = make_gait(robot, speed=0.0)
    assert gait.standing
    rows = targets(gait, (0.0, 0.1, 0.75, 3.3, 100.0))
    first = rows[0]
    assert (rows == first).all()
    np.testing.assert_array_equal(first["stance"], [1, 1])
    np.testing.assert_array_equal(first["body"], [0, 0, 0.6, 0, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(first["foot_velocity"], 0.0)
    np.testing.assert_allclose(
        first["foot_position"][:, 1], gait.parameters.width * np.array([1, -1])
    )
    q, v = gait.initial_state()
    np.testing.assert_array_equal(v, 0.0)
    np.testing.assert_allclose(q[7:10] * [-1, 1, 1], q[10:13], atol=1e-15)


@pytest.mark.parametrize(
    "parameters",
    [
        {"height": 0.85},
        {"height": 0.35, "clearance": 0.0},
        {"speed": 2.0},
        {"clearance": 0.4},
        {"width": 0.6},
    ],
    ids=str,
)
def test_out_of_reach(robot, parameters):
    with pytest.raises(InputError, match=r"reach|limits of joint"):
        StraightGait(robot, GaitParameters(**parameters))


def test_joint_limits_count_as_reach(urdf_with):
    stiff = hp.load_harpy(urdf_with('lower="0.2" upper="2.9"', 'lower="0.2" upper="0.5"'))
    with pytest.raises(InputError, match=r"limits of joint 'left_knee'"):
        make_gait(stiff)


def test_the_offset_is_the_depth_of_one_foot_under_the_weight(robot):
    """The tuned 5 mm to the last bit on the ground it was tuned on; elsewhere in proportion to load
    and softness.
    """
    assert make_gait(robot).parameters.penetration_offset == 0.005
    for stiffness in (4e3, 4e4, 8e4):
        offset = make_gait(robot, stiffness=stiffness).parameters.penetration_offset
        on_both = hp.Simulator(robot, hp.Ground(stiffness=stiffness)).static_penetration
        assert offset == pytest.approx(2.0 * on_both, rel=0.015)
        assert offset * stiffness == pytest.approx(40.0)
    twice = replace(robot, model=robot.model.copy())
    for i in range(1, 8):
        body = robot.model.inertias[i]
        twice.model.inertias[i] = pin.Inertia(2.0 * body.mass, body.lever, 2.0 * body.inertia)
    assert make_gait(twice, stiffness=4e4).parameters.penetration_offset == pytest.approx(0.002)
    with pytest.raises(InputError, match="too soft"):
        make_gait(robot, stiffness=300.0)


def test_one_legged_robot(robot):
    with pytest.raises(InputError, match="two feet"):
        make_gait(hp.load_robot(robot.urdf, feet=("left_foot",)))
