"""Fast feet stop before they land, legs are not stretched, late feet that rest have landed, turns bend no faster than
velocities change, and Solo12 walks fast on slippery ground in MuJoCo."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from long import long_but
from needs import needs_robots
from scipy.optimize import brentq

import harpy_pin as hp
from harpy_pin.gaits.walking.footholds import _keep_in_reach
from harpy_pin.gaits.walking.swinging import CREEP, NEAR, SETTLE, STRAIGHT_NEAR, UPRIGHT_END, upright_end
from harpy_pin.gaits.walking.walking_gait import LOW


@pytest.mark.parametrize(("near", "low", "height"), [(NEAR, LOW, 0.053), (STRAIGHT_NEAR, 0.0, 0.04)])
@pytest.mark.parametrize("speed", [0.0, 0.1, 0.3, 0.6, 1.0])
def test_a_foot_is_slow_when_it_is_near_the_ground(speed, near, low, height):
    # A trot with steps of 1 s: a foot goes two steps' way in a swing of 0.95 s, by the motion of least jerk.
    end, swing = upright_end(speed, 1.0, near), 0.95
    assert end >= UPRIGHT_END
    glide = low * SETTLE / (1.0 - SETTLE)  # the height there falls at the rate at which it goes on to the ground

    def above(w):  # at the share w before it begins to go down slowly
        return 64.0 * (w * (1.0 - w)) ** 3 + low + glide * w - height

    before = brentq(above, 0.0, 0.5)
    assert 1.0 - SETTLE * (1.0 - before) == pytest.approx(near, abs=0.004)
    s = min(SETTLE * (1.0 - before) / (1.0 - end), 1.0)
    velocity = 2.0 * speed / ((1.0 - end) * swing) * 30.0 * (s * (1.0 - s)) ** 2
    assert velocity <= 1.2 * CREEP


@needs_robots
@pytest.mark.parametrize("name", ["go2", "anymal_c"])
@pytest.mark.parametrize("higher", [0.0, 0.03])
def test_no_foothold_stretches_a_leg(name, higher):
    robot = hp.load_robot(name)
    gait = hp.WalkingGait(robot)
    q, v = gait.initial_state()
    p, build, model = gait.record[0], gait._build, robot.model
    q[2] = build.height + higher
    feet = np.zeros((4, 3))
    gait.observe(hp.State(0.0, q, v, feet, feet, feet))
    gait.update(0.0)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    for k, foot in enumerate(robot.feet):
        knee = model.frames[robot.frame_id(foot)].parentJoint
        axis = data.oMi[model.parents[model.parents[knee]]].translation  # about which the leg swings sideways
        for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
            p["foothold"][k, :2] = p["measured"]["centre"][:2] + 5.0 * np.array((np.cos(angle), np.sin(angle)))
            _keep_in_reach(gait.record[0], k, 0.0)
            place = np.array((*p["foothold"][k, :2], 0.0))
            # Beside the axis by d, a leg of length l reaches to √(l² + d²) from a point of it.
            thigh = data.oMi[model.parents[knee]].translation
            along = place - np.array((thigh[0], axis[1], thigh[2]))
            length = np.sqrt(along @ along - build.beside[k] ** 2)
            assert length < 0.99 * build.leg


@needs_robots
def test_a_late_foot_that_rests_has_landed_though_it_hardly_pushes():
    gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.0))
    p, (q, v), feet = gait.record[0], gait.initial_state(), np.zeros((4, 3))

    def state(force):
        load = feet.copy()
        load[:, 2] = force
        return hp.State(0.0, q, v, feet, feet, load)

    rests, free, t = state(0.5 * float(p["touch_force"])), state(0.0), 0.0

    def late_after(given):
        nonlocal t
        t = 0.0
        while not (p["in_air"].any() and p["phase"] >= 1.0):
            gait.observe(free)
            gait.update(t)
            t += 1e-3
        ticks = 0
        while p["in_air"].any() and p["phase"] >= 1.0:
            gait.observe(given)
            gait.update(t)
            t, ticks = t + 1e-3, ticks + 1
        return 1e-3 * ticks

    wait = 0.5 * gait.step_duration
    assert late_after(free) == pytest.approx(wait, abs=3e-3)
    assert late_after(rests) < 0.2 * wait


@needs_robots
def test_turns_bend_the_way_by_the_acceleration_at_most():
    gait = hp.WalkingGait(hp.load_robot("go2"))
    gait.observe(hp.State(0.0, *gait.initial_state(), *np.zeros((3, 4, 3))))
    for command in np.random.default_rng(3).uniform(-1.5, 1.5, (50, 3)):
        gait.command[:3] = command
        gait.update(0.0)
        goal = gait.record[0]["goal"][:3]
        assert np.hypot(goal[0], goal[1]) * abs(goal[2]) <= 1.0 + 1e-9
        np.testing.assert_allclose(np.cross(goal, command), 0.0, atol=1e-12)
    with pytest.warns(UserWarning, match="limited to"):
        hp.WalkingGait(gait.robot, velocity=(0.9, 0.0, 1.4))


@needs_robots
@pytest.mark.parametrize("start", long_but(range(4), (3,)))
def test_solo12_walks_fast_at_friction_three_tenths_in_mujoco(start):
    pytest.importorskip("mujoco")
    robot = hp.load_robot("solo12")
    speed = hp.WalkingGait(robot).max_speed
    velocity = np.random.default_rng([101, start]).normal(0.0, 0.02, 3)
    run = hp.walk(
        hp.Scenario(
            robot="solo12",
            plant="mujoco",
            gait=hp.Walking(velocity=((0.5, 0.99 * speed, 0.0, 0.0),)),
            ground=hp.Ground(mu_s=0.3, stiffness=robot.mass * 9.81 / 2e-3),
            disturbances=hp.Disturbances(start_velocity=(*velocity.tolist(), 0.0, 0.0, 0.0)),
            duration=5.0,
        )
    )
    assert run.ending == "completed"
    assert 1e3 * run["slip_path"][-1].sum() / run["steps"][-1] < 0.5
