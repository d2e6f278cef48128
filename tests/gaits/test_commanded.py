"""The commanded gait: continuous targets, feet that stay, limits that the legs keep, and walks that
follow commands.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import places
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_mujoco
from walks import own_search, walked

import harpy_pin as hp
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.controllers.task_controller import tasks_record
from harpy_pin.controllers.tasks import measured_terms, set_tasks
from harpy_pin.gaits import CommandedGait, CommandedParameters
from harpy_pin.log.measures import body_angles
from harpy_pin.model.kinematics import leg_inverse

ROBOT = hp.load_harpy()
P = CommandedParameters()
entries = st.floats(-0.6, 0.6) | st.sampled_from((0.0, 3.0, -20.0, 1e5))
scripts = st.lists(
    st.tuples(st.floats(0.05, 1.5), entries, entries, entries), min_size=1, max_size=5
).map(lambda rows: [(sum(row[0] for row in rows[: i + 1]), *rows[i][1:]) for i in range(len(rows))])


def follow(gait, times):
    """Targets row by row: body (n, 3, 3), heading (n, 3), feet in the world (n, 3, feet, 3), stance
    (n, feet).
    """
    body, heading, feet, stance = [], [], [], []
    for t in times:
        target = gait.update(float(t))
        body.append(target.body.reshape(3, 3).copy())
        relative = (target.foot_position, target.foot_velocity, target.foot_acceleration)
        feet.append([body[-1][i] + relative[i] for i in range(3)])
        heading.append(target.heading.copy())
        stance.append(target.stance.copy())
    return np.array(body), np.array(heading), np.array(feet), np.array(stance) > 0.0


@given(scripts)
@settings(max_examples=6)
def test_targets_are_continuous_whatever_is_commanded(script):
    h = 4e-4
    gait = CommandedGait(ROBOT, script, CommandedParameters(penetration_offset=0.0))
    body, heading, feet, _ = follow(gait, np.arange(0.0, script[-1][0] + 2.0, h))
    # The command's limits, in the turning frame, and the sway with its growth and its end.
    rate = np.pi / P.step_duration
    most = (
        P.acceleration
        + 2.0 * P.max_turn * gait.most_speed
        + 3.0 * P.sway * (rate + P.max_turn) ** 2
        + 2.0
    )
    assert np.linalg.norm(body[:, 2], axis=1).max() < most
    for signal, bound in ((body, most), (heading, 1.01 * P.turn_acceleration)):
        place, velocity = signal[:, 0], signal[:, 1]
        np.testing.assert_allclose(
            np.diff(place, axis=0) / h, 0.5 * (velocity[1:] + velocity[:-1]), atol=bound * h
        )
        assert np.abs(np.diff(velocity, axis=0)).max() <= bound * h
    # A step of 1.5 m in one swing is 6 · 1.5 / 0.525² = 33 m/s²; a foothold that moves late asks
    # for more.
    place, velocity = feet[:, 0], feet[:, 1]
    np.testing.assert_allclose(
        np.diff(place, axis=0) / h, 0.5 * (velocity[1:] + velocity[:-1]), atol=80.0 * h
    )
    assert np.abs(np.diff(velocity, axis=0)).max() <= 80.0 * h


@given(scripts)
@settings(max_examples=10)
def test_a_stance_foot_stays_and_feet_never_meet(script):
    _, _, feet, stance = follow(
        CommandedGait(ROBOT, script), np.arange(0.0, script[-1][0] + 3.0, 4e-3)
    )
    kept = stance[1:] & stance[:-1]
    np.testing.assert_allclose(np.diff(feet[:, 0, :, :2], axis=0)[kept], 0.0, atol=1e-12)
    np.testing.assert_allclose(feet[:, 1, :, :2][stance], 0.0, atol=1e-12)
    np.testing.assert_allclose(feet[:, 2, :, :2][stance], 0.0, atol=1e-12)
    assert feet[:, 0, :, 2][stance].max() <= 1e-12
    assert stance.any(axis=1).all()
    apart = np.linalg.norm((feet[:, 0, 0] - feet[:, 0, 1])[:, :2], axis=1)
    landed = (stance[1:] & ~stance[:-1]).any(axis=1)
    assert apart[1:][landed].min(initial=1.0) >= P.feet_apart - 1e-3
    assert apart.min() >= 0.5 * P.feet_apart


@given(scripts)
@settings(max_examples=6)
def test_every_target_is_in_the_legs_reach(script):
    gait = CommandedGait(ROBOT, script)
    angles = np.empty(3)
    for t in np.arange(0.0, script[-1][0] + 3.0, 0.01):
        target = gait.update(float(t))
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, float(target.heading[0]))
        for k, geometry in enumerate(gait.geometry):
            excess = leg_inverse(geometry.record[0], turned.T @ target.foot_position[k], angles)
            joints = slice(3 * k, 3 * k + 3)
            assert excess <= 1e-12
            assert np.all(angles >= ROBOT.joint_lower[joints])
            assert np.all(angles <= ROBOT.joint_upper[joints])


def test_accelerations_are_those_of_the_velocities():
    script = [(0.1, 0.4, 0.05, 0.5), (1.3, -0.2, 0.1, -1.0), (2.9, 0.0, 0.0, 0.0)]
    h = 1e-4
    body, heading, feet, stance = follow(CommandedGait(ROBOT, script), np.arange(0.0, 6.0, h))
    for signal in (body, heading):
        slope = np.diff(signal[:, 1], axis=0) / h
        error = np.abs(slope - 0.5 * (signal[1:, 2] + signal[:-1, 2]))
        # Where the command or the acceleration's limit changes, the acceleration jumps: in few
        # rows.
        assert np.quantile(error.reshape(len(error), -1).max(axis=1), 0.998) < 0.01
    same = (stance[1:] == stance[:-1]).all(axis=1)
    slope = np.diff(feet[:, 1], axis=0) / h
    error = np.abs(slope - 0.5 * (feet[1:, 2] + feet[:-1, 2])).max(axis=(1, 2))[same]
    assert np.quantile(error, 0.97) < 0.05


@pytest.mark.parametrize("speed", [0.3, 0.15, -0.2])
def test_a_straight_command_becomes_the_straight_walk(speed):
    gait, straight = (
        CommandedGait(ROBOT, [(0.2, speed, 0.0, 0.0)]),
        hp.make_gait(ROBOT, speed=speed),
    )
    gait.update(6.0)
    x = gait.target.body[0]
    for t in np.arange(6.0, 9.0, 0.0137):
        target = gait.update(float(t))
        # It began to walk at 0.2 s, in the middle of a double support of the straight walk.
        own = straight.update(
            (t - 0.2 + 0.5 * P.double_support * P.step_duration) % (2.0 * P.step_duration)
        )
        np.testing.assert_array_equal(target.stance, own.stance)
        for name in (
            "foot_position",
            "foot_velocity",
            "foot_acceleration",
            "phase",
            "world_frame_blend",
        ):
            np.testing.assert_allclose(
                getattr(target, name), getattr(own, name), atol=1e-9, err_msg=name
            )
        np.testing.assert_allclose(target.body[1:], own.body[1:], atol=1e-9)
        assert target.body[0] - x == pytest.approx(speed * (t - 6.0), abs=1e-9)
        assert not target.heading.any()


def test_a_walk_goes_by_the_integral_of_its_command():
    """Speeding up and slowing down are mirror images, so what is commanded for a time is gone in
    full.
    """
    gait = CommandedGait(
        ROBOT,
        [(0.0, 0.4, 0.0, 0.0), (3.0, 0.0, 0.0, 0.5), (5.0, 0.0, 0.15, 0.0), (9.0, 0.0, 0.0, 0.0)],
    )
    gait.update(13.0)
    assert not gait.walking
    assert gait.target.heading[0] == pytest.approx(1.0, abs=1e-9)
    forward, left = np.array((1.0, 0.0)), np.array((-np.sin(1.0), np.cos(1.0)))
    # While it turns it still slows down, and begins to go sideways: that arc is short.
    np.testing.assert_allclose(gait.target.body[:2], 1.2 * forward + 0.6 * left, atol=0.1)


def test_at_zero_command_it_stands_with_its_feet_side_by_side():
    gait = CommandedGait(ROBOT, [(0.3, 0.4, -0.1, 0.7), (4.0, 0.0, 0.0, 0.0)])
    gait.update(0.29)
    assert not gait.walking
    gait.update(3.0)
    assert gait.walking
    # One step to slow down 0.4 m/s in a second, and one more for each foot, at most.
    gait.update(4.0 + 1.1 + 3.0 * P.step_duration + P.step_duration)
    assert not gait.walking
    before = gait.target.record.copy()
    target = gait.update(60.0)
    assert target.record == before
    assert target.stance.all()
    assert not target.body[3:].any()
    left = np.array((-np.sin(target.heading[0]), np.cos(target.heading[0])))
    for k, side in enumerate((1.0, -1.0)):
        np.testing.assert_allclose(target.foot_position[k, :2], side * P.width * left, atol=5e-3)


def test_the_time_between_updates_matters_little():
    script = [(0.1, 0.4, 0.0, 0.5), (2.0, -0.3, 0.2, 0.0), (3.5, 0.0, 0.0, 0.0)]
    fine = CommandedGait(ROBOT, script)
    for i in range(20001):
        fine.update(2.5e-4 * i)
    for period in (1e-3, 0.04, 5.0):
        gait = CommandedGait(ROBOT, script)
        for t in np.arange(0.0, 5.0 + 0.5 * period, period):
            gait.update(float(t))
        np.testing.assert_allclose(gait.target.body[:2], fine.target.body[:2], atol=1e-3)
        np.testing.assert_allclose(gait.target.foot_position, fine.target.foot_position, atol=3e-3)
        np.testing.assert_array_equal(gait.target.stance, fine.target.stance)


@pytest.mark.parametrize(
    "wild", [(3.0, 0.0, 0.0), (0.0, -3.0, 0.0), (0.0, 0.0, 20.0), (-50.0, 9.0, 3.0)]
)
def test_a_wild_command_is_scaled_down_as_a_whole(wild):
    gait = CommandedGait(ROBOT)
    gait.command[:] = wild
    for i in range(5000):
        gait.update(1e-3 * i)
    u = gait.applied
    np.testing.assert_allclose(u * (np.dot(wild, wild) / np.dot(u, wild)), wild, atol=1e-9)
    binding = (
        (np.hypot(u[0], u[1]) + abs(u[2]) * P.width) / gait.most_speed,
        abs(u[1]) / gait.most_sideways,
        abs(u[2]) / P.max_turn,
    )
    assert max(binding) == pytest.approx(1.0, abs=1e-12)
    assert 0.3 < gait.most_speed < 1.0
    assert 0.1 < gait.most_sideways < 0.5


def test_commands_that_are_not_finite_are_ignored():
    gait, clean = CommandedGait(ROBOT), CommandedGait(ROBOT)
    for i in range(3000):
        for one in (gait, clean):
            one.command[:] = (0.2, 0.0, 0.3)
        if 1000 <= i < 1500:
            gait.command[i % 3] = (np.nan, np.inf, -np.inf)[i // 3 % 3]
        assert gait.update(1e-3 * i).record == clean.update(1e-3 * i).record
    assert gait.refused == 500
    assert clean.refused == 0


def test_a_script_a_function_and_a_hand_are_the_same():
    script = CommandedGait(ROBOT, [(0.5, 0.3, 0.0, 0.2), (1.5, 0.0, 0.1, 0.0)])

    def of_time(t):
        return (0.0, 0.0, 0.0) if t < 0.5 else (0.3, 0.0, 0.2) if t < 1.5 else (0.0, 0.1, 0.0)

    function, hand = CommandedGait(ROBOT, of_time), CommandedGait(ROBOT)
    for i in range(0, 3000, 5):
        t = 1e-3 * i
        hand.command[:] = of_time(t)
        expected = hand.update(t).record
        assert function.update(t).record == expected
        # A row of the script is taken at its time, the others one update later.
        np.testing.assert_allclose(script.update(t).body[:2], hand.target.body[:2], atol=3e-3)


def test_a_time_before_the_last_begins_anew():
    gait = CommandedGait(ROBOT, [(0.0, 0.3, 0.0, 0.4)])
    first = [gait.update(0.01 * i).record.copy() for i in range(300)]
    again = [gait.update(0.01 * i).record.copy() for i in range(300)]
    assert first == again


def test_a_clock_that_jitters_changes_nothing():
    gait, steady = (CommandedGait(ROBOT, [(0.0, 0.3, 0.0, 0.4)]) for _ in range(2))
    for i in range(1, 300):
        expected = steady.update(0.01 * i).record
        assert gait.update(0.01 * i).record == expected
        assert gait.update(0.01 * i - 0.009).record == expected


def test_a_gait_out_of_reach_is_refused():
    with pytest.raises(hp.InputError, match="reach"):
        CommandedGait(ROBOT, parameters=CommandedParameters(height=0.79))


def test_it_starts_where_its_targets_are():
    gait = CommandedGait(ROBOT, [(0.0, 0.3, 0.0, 0.0)])
    for _ in range(2):
        q, v = gait.initial_state()
        feet = places(ROBOT, q)
        np.testing.assert_allclose(
            feet - q[:3], CommandedGait(ROBOT).update(0.0).foot_position, atol=1e-12
        )
        assert feet[:, 2].min() == pytest.approx(0.0, abs=1e-12)
        assert not v.any()
        before = gait.update(1.0).record.copy()
        assert gait.initial_state(penetration=1e-3)[0][2] == pytest.approx(q[2] - 1e-3)
        assert gait.update(1.0).record == before


def test_the_body_is_turned_to_the_heading(draw_state):
    """The orientation task against Pinocchio's logarithm."""
    gait = CommandedGait(ROBOT)
    parameters = WholeBodyParameters.for_gait(gait)
    record = tasks_record(gait, parameters)
    rng = np.random.default_rng(5)
    k, d = parameters.orientation
    for heading in (0.0, 0.7, -2.0, 3.0, 9.0):
        q, v = draw_state(rng)
        q[3:7] = pin.Quaternion(
            pin.rpy.rpyToMatrix(0.2, -0.3, heading + 0.4)
        ).coeffs() * rng.choice((-1.0, 1.0))
        target = gait.update(0.0)
        target.heading[:] = (heading, 0.6, -0.9)
        measured_terms(record, target.record, q, v, np.zeros((2, 3)))
        set_tasks(record, target.record, q, v, np.zeros((2, 3)))
        body = pin.Quaternion(*q[[6, 3, 4, 5]]).matrix()
        error = pin.log3(pin.rpy.rpyToMatrix(0.0, 0.0, heading).T @ body)
        up = body.T @ np.array((0.0, 0.0, 1.0))
        np.testing.assert_allclose(
            record["targets"]["orientation"][0],
            -k * error - d * (v[3:6] - 0.6 * up) - 0.9 * up,
            atol=1e-9,
        )


QUARTER = ((0.3, 0.3, 0.0, 0.0), (1.5, 0.2, 0.0, np.pi / 4), (3.5, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("controller", "plant"),
    [
        ("condensed", "compliant"),
        ("wbc", "compliant"),
        pytest.param("condensed", "mujoco", marks=needs_mujoco),
    ],
)
def test_a_walk_turns_by_a_quarter_and_stops(controller, plant):
    part = {"name": controller, "parameters": own_search(controller)}
    run = walked(
        controller=part, gait=hp.Commanded(velocity=QUARTER), mu_s=0.4, plant=plant, duration=6.5
    )
    measures = hp.measure(run)
    assert run.ending == "completed"
    assert body_angles(run["q"])[-1, 2] == pytest.approx(np.pi / 2, abs=0.01)
    assert measures.tracking_rms_mm < 10.0
    assert measures.slip_mm_per_step < 1.0
    assert measures.tilt_max_rad < 0.1
    assert np.abs(run["v"][-1]).max() < 0.02
    assert not run["applied_velocity"][-1].any()
    np.testing.assert_array_equal(run["command"][2000], QUARTER[1][1:])
    np.testing.assert_allclose(run["applied_velocity"][1499], QUARTER[0][1:], atol=1e-12)


def test_a_wild_script_does_not_make_it_fall():
    rng = np.random.default_rng(3)
    rows = tuple((0.5 + 0.6 * i, *(5.0 * rng.standard_normal(3)).tolist()) for i in range(8))
    run = walked(gait=hp.Commanded(velocity=rows), mu_s=0.3, duration=6.0)
    assert run.ending == "completed"
    assert hp.measure(run).tilt_max_rad < 0.1


def test_it_is_steered_live():
    gait = hp.make_commanded_gait(ROBOT)

    def steer(state):
        gait.command[:] = (0.3, 0.0, 0.0) if state.q[0] < 0.1 else (0.0, 0.0, 0.8)

    run = hp.walk(hp.Scenario(controller="condensed", duration=2.5), gait=gait, on_tick=steer)
    assert run.ending == "completed"
    ahead = run["q"][:, 0] < 0.1
    np.testing.assert_array_equal(run["command"][ahead], np.tile((0.3, 0.0, 0.0), (ahead.sum(), 1)))
    assert 0 < ahead.sum() < 2000
    assert body_angles(run["q"])[-1, 2] > 0.3


def test_limits_of_turning_and_of_the_distance_of_feet_are_parameters():
    wide = CommandedParameters(max_turn=0.5, feet_apart=0.2)
    gait, usual = (CommandedGait(ROBOT, (0.0, 0.0, 0.4), p) for p in (wide, P))
    assert gait.most_sideways == pytest.approx(usual.most_sideways - 0.1 / P.step_duration)
    gait.command[2] = 5.0
    for t in np.arange(0.0, 3.0, 0.05):
        gait.update(float(t))
    assert gait.applied[2] == pytest.approx(0.5)
