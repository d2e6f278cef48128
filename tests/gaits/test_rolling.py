"""Soles that roll over an edge before they are lifted: their targets, what controllers make of
them, and walks.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import frame_terms, mass_matrix, places
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_robots
from walks import own_search, slip_per_step, walk

import harpy_pin as hp
from harpy_pin.gaits.walking.rolling import soles_of
from harpy_pin.ground.terrain import Plane

H = 1e-3


def pitches(gait, q):
    """How far each sole is turned heel up, rad."""
    own, height = (
        gait.record[0]["build"]["own"][:, 0].reshape(2, -1),
        places(gait.robot, q)[:, 2].reshape(2, -1),
    )
    ahead = own - own.mean(axis=1, keepdims=True)
    rise = (ahead * height).sum(axis=1) / (ahead**2).sum(axis=1)  # of the line through the corners
    return -np.arcsin(np.clip(rise, -1.0, 1.0))


@given(st.floats(-0.7, 0.7), st.permutations(range(4)))
def test_soles_are_seen_in_their_own_axes(turned, order):
    """However they are turned, and in whichever order their corners are."""
    c, s = np.cos(turned), np.sin(turned)
    straight = np.array(((0.1, 0.03), (0.1, -0.03), (-0.1, 0.03), (-0.1, -0.03)))[list(order)]
    corner = np.concatenate((straight @ ((c, s), (-s, c)), straight, np.zeros((1, 2))))
    own, askew = soles_of(corner, np.repeat((0, 1, 2), (4, 4, 1)))
    np.testing.assert_allclose(
        own, np.concatenate((straight, straight, np.zeros((1, 2)))), atol=1e-12
    )
    np.testing.assert_allclose(askew, (turned, 0.0, 0.0), atol=1e-12)


@needs_robots
@pytest.mark.parametrize(
    ("name", "velocity"),
    [("g1", (0.6, 0.0, 0.4)), ("icub", (0.4, 0.05, 0.0)), ("talos", (-0.4, 0, 0))],
)
def test_targets_of_a_sole_are_those_of_a_rigid_body_in_one_motion(name, velocity):
    """From where it begins to roll until it lands: places, velocities and accelerations fit, and
    shape stays.
    """
    robot = hp.load_robot(name)
    gait = hp.WalkingGait(robot, velocity=velocity)
    p, o, points = gait.record[0], gait.target, int(robot.corners[0])
    shape = np.linalg.norm(
        p["build"]["corner"][:points, None] - p["build"]["corner"][None, :points], axis=2
    )
    before, rolled = {}, 0

    def check(state):
        nonlocal rolled
        if not p["measured"]["seen"] or state.t < 2.0:
            return
        for k in range(2):
            own = slice(points * k, points * (k + 1))
            lifted = o.load[own] == 0.0
            if p["steps"]["in_air"][k] == 0.0 and not lifted.any():
                before.pop(k, None)
                continue
            place = (o.body[:3] + o.foot_position)[own]
            velocity = (o.body[3:6] + o.foot_velocity)[own]
            acceleration = (o.body[6:] + o.foot_acceleration)[own]
            distance = np.linalg.norm(place[:, None] - place[None], axis=2)
            np.testing.assert_allclose(
                distance, shape, atol=1e-3 if p["steps"]["in_air"][k] == 0.0 else 1e-6
            )
            if p["steps"]["in_air"][k] == 0.0:
                rolled += 1
                assert (o.stance[own] == np.where(lifted, 0.0, 1.0)).all()
                velocity, acceleration, place = (
                    velocity[lifted],
                    acceleration[lifted],
                    place[lifted],
                )
            if k in before and before[k][0].shape == place.shape:
                np.testing.assert_allclose(
                    place - before[k][0], 0.5 * H * (velocity + before[k][1]), atol=3e-4
                )
                error = velocity - before[k][1] - 0.5 * H * (acceleration + before[k][2])
                assert np.abs(error).max() < 0.15
            before[k] = place, velocity, acceleration

    walk(gait, duration=3.0, on_tick=check)
    assert rolled > 50


@needs_robots
@pytest.mark.parametrize("name", ["g1", "talos"])
def test_torques_turn_a_rolling_sole_about_its_edge(name):
    """On rigid ground that holds only its edge, Pinocchio's accelerations are those that were asked
    for, as nearly as corners of a rigid body can follow; and the QP has the same torques.
    """
    robot = hp.load_robot(name)
    speed = 0.8 * hp.WalkingGait(robot).max_speed
    gaits = [hp.WalkingGait(robot, velocity=(speed, 0.0, 0.0)) for _ in range(3)]
    law, other = (
        hp.make_controller(kind, gait, mu=0.6, **own_search(kind))
        for kind, gait in zip(("condensed", "wbc"), gaits, strict=False)
    )
    errors, sizes = [], []

    def see(state):
        command, qp, targets = law.step(state), other.step(state), law.targets
        lifted = (targets.held != 0.0) & (law.gait.target.load == 0.0)
        if state.t < 1.5 or not lifted.any():
            return
        np.testing.assert_allclose(
            qp.torque, command.torque, atol=1e-3 * np.abs(command.torque).max()
        )
        touching, desired = (targets.held != 0.0) & ~lifted, targets.feet
        jacobian, drift = frame_terms(robot.model, robot.feet, state.q, state.v)
        held, nv = jacobian[touching].reshape(-1, robot.model.nv), robot.model.nv
        drive = np.array((*np.zeros(6), *command.torque)) - robot.model.damping * state.v
        drive -= pin.nonLinearEffects(robot.model, robot.model.createData(), state.q, state.v)
        whole = np.block(
            [[mass_matrix(robot.model, state.q), held.T], [held, np.zeros((len(held), len(held)))]]
        )
        right = np.concatenate((drive, (desired - drift)[touching].ravel()))
        acceleration = np.linalg.lstsq(whole, right)[0][:nv]
        errors.append(np.abs((jacobian @ acceleration + drift - desired)[lifted]).max())
        sizes.append(np.abs(desired[lifted]).max())

    walk(gaits[2], duration=2.1, on_tick=see)
    assert len(errors) > 30
    assert np.median(errors) < 0.08 * np.median(sizes)


@needs_robots
@pytest.mark.parametrize(
    ("name", "speed", "plant"),
    [
        ("g1", 0.75, "compliant"),
        ("talos", 0.9, "mujoco"),
        ("icub", 0.45, "compliant"),
        ("g1", -0.4, "mujoco"),
    ],
)
def test_a_walk_rolls_over_its_toes_and_hardly_slips(name, speed, plant):
    """Or over its heels, backward; while the other foot is down, and flat when it lands."""
    robot, seen = hp.load_robot(name), []
    gait = hp.WalkingGait(robot, velocity=((0.3, speed, 0.0, 0.0),))

    def see(state):
        if state.t <= 3.0:
            return
        p = gait.record[0]
        rolls = p["steps"]["in_air"].sum() == 0.0 and p["roll"]["pitch"][0] != 0.0
        seen.append((*np.sign(speed) * pitches(gait, state.q), rolls, gait.target.stance.sum()))

    run = walk(gait, duration=5.0, plant=plant, on_tick=see)
    one, two, rolls, touching = np.array(seen, dtype=float).T
    pitch = np.maximum(one, two)
    assert np.degrees(pitch[rolls == 1.0].max()) > 1.5
    assert np.degrees(pitch.max()) > 8.0
    assert np.degrees(np.minimum(one, two).min()) > -2.0
    assert set(touching[rolls == 1.0]) == {6.0}  # corners, of eight
    v = np.polyfit(run["t"][run["t"] > 3.0], run["centre"][run["t"] > 3.0, 0], 1)[0]
    assert v == pytest.approx(speed, rel=0.05)
    assert slip_per_step(run) < (1.5 if plant == "compliant" else 0.6)


@needs_robots
def test_soles_stay_flat_where_steps_have_no_length_and_on_slopes(g1):
    for velocity, terrain, most in (
        ((0.0, 0.0, 0.0), None, 0.02),
        ((0.2, 0.0, 0.0), Plane(slope=0.1), 0.0),
    ):
        gait, seen = hp.WalkingGait(g1, "step", velocity=velocity), []
        walk(
            gait,
            terrain=terrain,
            duration=2.0,
            on_tick=lambda _, g=gait, s=seen: s.append(abs(g.record[0]["roll"]["pitch"][0])),
        )
        assert max(seen) <= most


@needs_robots
def test_soles_that_point_outward_roll_about_their_own_edges():
    robot = hp.load_robot("talos")
    posture = hp.gaits.Standing(robot).initial_state()[0][7:].copy()
    for name, sign in (("leg_left_1_joint", 1.0), ("leg_right_1_joint", -1.0)):
        posture[robot.joints.index(name)] += sign * np.radians(8.0)
    gait, rolled = hp.WalkingGait(robot, posture=posture, velocity=(0.5, 0.0, 0.0)), []
    np.testing.assert_allclose(np.degrees(gait.record[0]["build"]["askew"]), (8.0, -8.0), atol=0.5)

    def see(state):
        lifted = gait.target.load == 0.0
        if lifted.any() and state.t > 1.5:
            place = gait.target.body[:3] + gait.target.foot_position
            rolled.append(np.abs(place - places(robot, state.q))[lifted].max())

    run = walk(gait, duration=3.0, on_tick=see)
    assert max(rolled) < 0.015
    assert slip_per_step(run) < 0.5


@needs_robots
def test_a_walk_that_begins_anew_stands_on_whole_soles():
    gait = hp.WalkingGait(hp.load_robot("g1"), velocity=(0.5, 0.0, 0.0))
    states = []
    walk(
        gait,
        duration=1.5,
        on_tick=lambda state: states.append(state) if gait.target.load.min() == 0.0 else None,
    )
    gait.observe(states[-1])
    gait.command[:] = 0.0
    gait.update(0.0)
    for tick in range(300):
        gait.update(1e-3 * tick)
    np.testing.assert_array_equal(gait.target.load, 1.0)
    np.testing.assert_array_equal(gait.target.stance, 1.0)


@needs_robots
def test_a_robot_without_limits_of_torque_has_a_pace(g1):
    speed = hp.WalkingGait(g1).max_speed
    limits = g1.model.effortLimit.copy()
    try:
        g1.model.effortLimit[6:] = np.inf
        assert hp.WalkingGait(g1).max_speed == pytest.approx(speed)
    finally:
        g1.model.effortLimit[:] = limits
