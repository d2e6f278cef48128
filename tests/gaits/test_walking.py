"""Walks of any robot: pendulum and support beside closed forms and other algorithms, targets beside their differences,
touchdowns as they happen, and robots that walk where they are told, on slippery ground, pushed, delayed, and in MuJoCo.

``--long`` walks more robots: kernels are compiled for each size of robot.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from long import long_but
from needs import needs_robots
from scipy.integrate import solve_ivp
from scipy.optimize import nnls

import harpy_pin as hp
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.pendulum import cyclic_offset, predict
from harpy_pin.gaits.walking.quintic import toward
from harpy_pin.gaits.walking.settings import draw_together
from harpy_pin.gaits.walking.support import nearest_in_hull

small = st.floats(-1.0, 1.0)


def walk(
    gait, *, mu=0.6, duration=3.0, controller="condensed", plant="compliant", pushes=(), on_tick=None, **disturbances
):
    """A walk on ground into which the robot sinks by 2 mm; pushes are (time, velocity that they would give)."""
    mass, kind = gait.robot.mass, {"condensed": hp.Condensed, "wbc": hp.WholeBody}[controller]
    shoves = tuple(hp.Push(t, tuple(mass * np.array(velocity))) for t, velocity in pushes)
    scenario = hp.Scenario(
        controller=kind(parameters=gait.parameters),
        ground=hp.Ground(mu_s=mu, stiffness=mass * 9.81 / 2e-3),
        duration=duration,
        plant=plant,
        disturbances=hp.Disturbances(pushes=shoves, **disturbances),
    )
    return hp.walk(scenario, gait=gait, on_tick=on_tick)


def slip_per_step(run):
    """Path of all feet along the ground, mm per step."""
    return 1e3 * run["slip_path"][-1].sum() / max(run["steps"][-1], 1)


def path_error(run):
    """Root mean square distance of the centre of mass from the path, m."""
    return np.sqrt(np.mean(np.sum((run["centre"][:, :2] - run["path"][:, :2]) ** 2, axis=1)))


# --- Pendulum, support and momentum -----------------------------------------------------------------------------------


@given(small, small, small, st.floats(3.0, 8.0), st.floats(0.0, 0.5))
@settings(max_examples=20)
def test_prediction_is_the_pendulums_motion(place, velocity, pressure, omega, time):
    told = predict(place, velocity, pressure, omega, time)
    if time > 0.0:
        motion = solve_ivp(
            lambda _, x: (x[1], omega**2 * (x[0] - pressure)), (0.0, time), (place, velocity), rtol=1e-10, atol=1e-12
        )
        np.testing.assert_allclose(told, motion.y[:, -1], rtol=1e-6, atol=1e-8)
    else:
        assert told == (place, velocity)


@given(small, small, st.floats(3.0, 8.0), st.floats(0.1, 0.6))
def test_footholds_at_the_cyclic_offset_repeat_for_ever(way, jump, omega, duration):
    """ξ behind a foot by its offset is behind the next foot by that foot's offset: the walk goes on as it is."""
    growth, foot = np.exp(omega * duration), 0.0
    capture = foot + cyclic_offset(way, jump, growth)
    for _ in range(4):
        capture = foot + (capture - foot) * growth
        foot, jump = foot + way + jump, -jump
        assert abs(capture - foot - cyclic_offset(way, jump, growth)) < 1e-9 * growth


@given(st.lists(st.tuples(small, small), min_size=1, max_size=8), small, small)
@settings(max_examples=200)
def test_nearest_point_of_the_hull_is_that_of_least_squares(points, x, y):
    """Against non-negative least squares in the weights of the points, whose sum is one."""
    found = np.array(nearest_in_hull(np.array(points), len(points), x, y))
    heavy = 1e4
    rows = np.vstack((np.array(points).T, heavy * np.ones(len(points))))
    weights, _ = nnls(rows, np.array((x, y, heavy)))
    nearest = np.array(points).T @ weights
    assert abs(np.hypot(*(found - (x, y))) - np.hypot(*(nearest - (x, y)))) < 1e-5
    _, rest = nnls(rows, np.array((*found, heavy)))
    assert rest < 1e-5


@given(st.floats(0.02, 0.5), small, small, small)
def test_swing_ends_at_rest_at_its_goal_and_its_parts_are_one_motion(left, place, velocity, goal):
    ends = toward(place, velocity, 0.0, goal, left, left)
    assert ends == (goal, 0.0, 0.0)
    half = toward(place, velocity, 0.0, goal, left, 0.4 * left)
    np.testing.assert_allclose(
        toward(*half, goal, 0.6 * left, 0.3 * left), toward(place, velocity, 0.0, goal, left, 0.7 * left), atol=1e-7
    )


def test_groups_are_drawn_together_and_keep_their_shape():
    places = np.array([[0.2, 0.15], [0.2, -0.15], [-0.2, 0.15], [-0.2, -0.15]])
    group = np.array([0, 1, 0, 1])
    moved = places.copy()
    assert draw_together(moved, group, 0.1) == pytest.approx(0.1)
    assert moved[0, 1] - moved[1, 1] == pytest.approx(0.1)
    np.testing.assert_allclose(moved[0] - moved[2], places[0] - places[2])


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "g1"])
def test_what_is_measured_is_pinocchios(name):
    robot, rng = hp.load_robot(name), np.random.default_rng(0)
    gait, data = hp.WalkingGait(robot), robot.model.createData()
    for _ in range(5):
        q = pin.integrate(robot.model, gait.initial_state()[0], 0.3 * rng.standard_normal(robot.model.nv))
        v, force = rng.standard_normal(robot.model.nv), np.zeros((len(robot.feet), 3))
        assert measure(gait.record, q, v, force)
        m = gait.record["measured"][0]
        centre = pin.centerOfMass(robot.model, data, q, v)
        pin.computeCentroidalMomentum(robot.model, data, q, v)
        pin.updateFramePlacements(robot.model, data)
        np.testing.assert_allclose(m["centre"], np.concatenate((centre, data.vcom[0])), atol=1e-12)
        np.testing.assert_allclose(robot.mass * m["spin"], data.hg.angular, atol=1e-11)
        feet = [data.oMf[robot.frame_id(foot)].translation for foot in robot.feet]
        np.testing.assert_allclose(m["point"], feet, atol=1e-12)
        # The angular momentum about the ground below the centre of mass is that of a pendulum of this velocity.
        about_ground = data.hg.angular + np.cross((0.0, 0.0, centre[2]), robot.mass * data.vcom[0])
        told = robot.mass * centre[2] * np.array((-m["drift"][1], m["drift"][0]))
        np.testing.assert_allclose(told, about_ground[:2], atol=1e-11)


# --- Targets ----------------------------------------------------------------------------------------------------------


@needs_robots
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), small, st.floats(-4.0, 4.0), st.floats(-0.1, 0.1)), min_size=2))
@settings(max_examples=4, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_targets_fit_their_differences_and_footholds_are_in_reach(commands):
    """Whatever is commanded, and however often: nothing jumps, and no foothold is out of reach or at another foot."""
    robot = hp.load_robot("solo12")
    gait = hp.WalkingGait(robot)
    p, h = gait.record[0], 1e-3
    before: dict[int, tuple] = {}
    last = np.zeros(3)

    def check(state):
        nonlocal last
        o, m = gait.target, p["measured"]
        gait.command[:] = commands[int(state.t / 0.3) % len(commands)]
        applied = gait.applied.copy()
        assert np.hypot(*(applied - np.array([*last, 0.0]))[:2]) < 1.01 * h
        assert abs(applied[2] - last[2]) < 3.01 * h
        last = applied[:3]
        if not m["seen"]:
            return
        c, s = np.cos(m["heading"]), np.sin(m["heading"])
        for k in range(4):
            if not p["in_air"][k]:
                before.pop(k, None)
                continue
            place = o.body[:3] + o.foot_position[k]
            velocity = o.body[3:6] + o.foot_velocity[k]
            if k in before:
                np.testing.assert_allclose(place - before[k][0], 0.5 * h * (velocity + before[k][1]), atol=4e-4)
                assert np.abs(velocity - before[k][1]).max() < 0.6
            before[k] = place, velocity
            left = max(1.0 - p["phase"], 0.0) * gait.step_duration
            x, y = p["nominal"][k]
            hip = m["centre"][:2] + left * m["drift"] + (c * x - s * y, s * x + c * y)
            assert np.hypot(*(p["foothold"][k, :2] - hip)) < p["reach"] + 0.03
            others = [j for j in range(4) if not p["in_air"][j]]
            gaps = [np.hypot(*(p["foothold"][k, :2] - m["place"][j, :2])) for j in others]
            assert min(gaps) > 0.2 * np.ptp(p["nominal"][:, 1])

    run = walk(gait, duration=2.0, on_tick=check)
    assert run.ending == "completed"
    most = np.hypot(run["applied_velocity"][:, 0], run["applied_velocity"][:, 1])
    assert most.max() <= p["max_speed"] + 1e-9


def made_state(gait, *, force=0.0, height=0.0):
    """The posture with a force on every foot, N, and the body higher than it stands, m."""
    q, v = gait.initial_state()
    q[2] += height
    feet = np.zeros((len(gait.robot.feet), 3))
    load = feet.copy()
    load[:, 2] = force
    return hp.State(0.0, q, v, feet, feet, load)


@needs_robots
def test_feet_that_land_early_carry_and_late_ones_are_searched_for():
    gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.0))
    p, loaded, free = gait.record[0], made_state(gait, force=6.0), made_state(gait, force=0.0)
    t, h = 0.0, 1e-3

    def go(state, *, until):
        nonlocal t
        for _ in range(2000):
            if until():
                return
            gait.observe(state)
            gait.update(t)
            t += h
        raise AssertionError("it never happens")

    go(loaded, until=lambda: p["in_air"].any())
    swing = gait.target.stance == 0.0
    assert swing.sum() == 2
    go(loaded, until=lambda: p["phase"] > 0.5)  # a load in the first part of the swing is the foot's last touch
    assert p["in_air"].sum() == 2
    go(free, until=lambda: p["phase"] > 0.75)
    go(loaded, until=lambda: not p["in_air"].any())  # early
    assert p["phase"] < 0.8
    assert (gait.target.stance == 1.0).all()
    go(loaded, until=lambda: p["in_air"].any())
    assert not (swing & (gait.target.stance == 0.0)).any()  # now the others
    go(free, until=lambda: p["phase"] >= 1.0)
    heights = []
    for _ in range(40):  # late: down, at one velocity, while the other feet stay
        gait.observe(free)
        o = gait.update(t)
        t += h
        heights.append((o.body[2] + o.foot_position[o.stance == 0.0, 2]).max())
    np.testing.assert_allclose(np.diff(heights[1:]) / h, -0.3, atol=1e-6)
    assert p["in_air"].sum() == 2
    go(free, until=lambda: p["phase"] < 0.5)  # the walk does not wait for ever
    assert gait.walking


@needs_robots
def test_a_foot_that_carries_and_does_not_touch_is_let_down():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    gait.observe(made_state(gait, height=0.01))
    o = gait.update(0.0)
    assert (o.stance == 1.0).all()
    np.testing.assert_allclose(o.body[3:6] + o.foot_velocity, np.tile((0.0, 0.0, -0.3), (4, 1)), atol=1e-12)


@needs_robots
def test_commands_that_are_not_finite_are_ignored_and_scripts_are_followed():
    robot = hp.load_robot("solo12")
    gait = hp.WalkingGait(robot, velocity=((0.1, 0.2, 0.0, 0.0), (0.5, 0.0, 0.0, 0.5, 0.01)))
    q, v = gait.initial_state()
    feet = np.zeros((4, 3))
    state = hp.State(0.0, q, v, feet, feet, feet)
    with pytest.raises(hp.InputError, match="observe"):
        gait.update(0.0)
    for t in np.arange(0.0, 1.0, 1e-3):
        gait.observe(state)
        gait.update(float(t))
        expected = (0.0, 0.0, 0.0, 0.0) if t < 0.1 else (0.2, 0.0, 0.0, 0.0) if t < 0.5 else (0.0, 0.0, 0.5, 0.01)
        assert gait.command.tolist() == list(expected)
    gait.command[0] = np.nan
    gait.update(1.0)
    assert gait.refused == 1
    assert np.isfinite(gait.target.body).all()
    bad = state.copy()
    bad.q[0] = np.nan
    gait.observe(bad)
    gait.update(1.001)
    assert np.isfinite(gait.target.body).all()
    wave = hp.WalkingGait(robot, velocity=lambda t: (0.1 * t, 0.0, 0.0))
    wave.observe(state)
    wave.update(0.0)
    wave.update(2.0)
    assert wave.command[0] == 0.2


@needs_robots
def test_what_it_cannot_do_is_refused():
    robot = hp.load_robot("solo12")
    with pytest.raises(hp.InputError, match="trot"):
        hp.WalkingGait(robot, "gallop")
    with pytest.raises(hp.InputError, match="walk"):
        hp.WalkingGait(hp.load_robot("bolt"), "trot")
    with pytest.raises(hp.InputError, match="two or four"):
        hp.WalkingGait(hp.load_robot("iris"))
    for velocity in ((0.1, 0.2), (0.1, np.nan, 0.0), "fast", ((1.0, 0, 0, 0), (0.5, 0, 0, 0))):
        with pytest.raises(hp.InputError):
            hp.WalkingGait(robot, velocity=velocity)
    for bad in ({"step_duration": 0.0}, {"clearance": -0.1}, {"height": 1.0}, {"double_support": 1.0}):
        with pytest.raises(hp.InputError):
            hp.WalkingGait(robot, **bad)
    gait = hp.WalkingGait(robot)
    gait.observe(made_state(gait))
    with pytest.raises(hp.InputError, match="finite"):
        gait.update(np.inf)


# --- Walks ------------------------------------------------------------------------------------------------------------


@needs_robots
@pytest.mark.parametrize(("name", "speed"), [("solo12", 0.6), ("go2", 1.5), ("a1", 1.2), ("anymal_c", 0.8)])
def test_trots_where_it_is_told_and_hardly_slips(name, speed):
    gait = hp.WalkingGait(hp.load_robot(name), velocity=(speed, 0.0, 0.0), max_speed=2.0)
    run = walk(gait)
    assert run.ending == "completed"
    assert (run["condensed_status"] == 0).mean() > 0.9
    assert slip_per_step(run) < 0.5 * 2.0  # of two feet
    assert hp.measure(run).tilt_max_rad < 0.01
    assert path_error(run) < 0.05
    start = gait.record["start_time"][0] - gait.double_support * gait.step_duration
    moved = speed * (3.0 - start - 0.5 * speed)  # at 1 m/s²
    np.testing.assert_allclose(run["path"][-1, 0] - run["path"][0, 0], moved, rtol=0.05)
    settled = run["t"] > 2.0
    assert abs(np.polyfit(run["t"][settled], run["centre"][settled, 0], 1)[0] - speed) < 0.05 * speed


@needs_robots
def test_course_start_and_stop():
    """Forward, a turn, sideways, back, and standing at the end, with the feet where they stand."""
    quarter = np.pi / 2 / 0.6
    rows = ((0.5, 0.3, 0, 0), (2.5, 0.2, 0, 0.6), (2.5 + quarter, 0, 0.15, 0), (6.5, -0.15, 0, 0), (8, 0, 0, 0))
    gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=rows)
    run = walk(gait, duration=9.5)
    assert run.ending == "completed"
    assert path_error(run) < 0.03
    assert abs(run["path"][-1, 2] - np.pi / 2) < 0.02
    assert (run["stance"][run["t"] < 0.5] == 1.0).all()
    assert not gait.walking
    rest = run["t"] > 9.0
    assert (run["stance"][rest] == 1.0).all()
    assert np.abs(run["v"][-1]).max() < 0.02


@needs_robots
def test_loop_in_c_and_loop_in_python_give_the_same_bits():
    runs = []
    for on_tick in (None, lambda state: None):
        gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=((0.0, 0.3, 0.1, 0.3), (1.0, 0.0, 0.1, 0.0)))
        runs.append(walk(gait, duration=2.0, on_tick=on_tick))
    for name in ("q", "v", "torque", "path", "foothold", "pressure", "steps", "command"):
        np.testing.assert_array_equal(runs[0][name], runs[1][name])


@needs_robots
@pytest.mark.parametrize("mu", [0.3, 0.15])
def test_walks_on_slippery_ground(mu):
    run = walk(hp.WalkingGait(hp.load_robot("go2"), velocity=(0.4, 0.0, 0.0)), mu=mu)
    assert run.ending == "completed"
    assert slip_per_step(run) < 1.0


@needs_robots
@pytest.mark.parametrize("push", [(0.6, 0.0), (-0.6, 0.0), (0.0, 0.6), (0.0, -0.6)])
def test_a_pushed_trot_goes_on(push):
    run = walk(hp.WalkingGait(hp.load_robot("go2"), velocity=(0.4, 0.0, 0.0)), pushes=((1.5, (*push, 0.0)),))
    assert run.ending == "completed"
    assert hp.measure(run).tilt_max_rad < 0.1
    along = np.abs(run["v"][:, 0 if push[0] else 1] - (0.4 if push[0] else 0.0))
    assert along[np.abs(run["t"] - 1.6) < 0.1].max() > 0.2  # it was pushed
    assert along[run["t"] > 2.7].max() < 0.12


@needs_robots
def test_standing_robot_steps_when_it_is_pushed_and_stands_again():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    run = walk(gait, duration=4.0, pushes=((0.5, (1.0, 0.0, 0.0)),))
    assert run.ending == "completed"
    assert run["steps"][-1] > 1
    assert not gait.walking


@needs_robots
def test_delay_noise_and_another_plant():
    pytest.importorskip("mujoco")
    for more in ({"delay": 2e-3}, {"noise": hp.Noise.typical()}, {"plant": "mujoco"}):
        run = walk(hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.1)), **more)
        assert run.ending == "completed"
        assert slip_per_step(run) < 2.0
        assert path_error(run) < 0.03


@needs_robots
@pytest.mark.parametrize(("schedule", "speed"), [("crawl", 0.15), ("pace", 0.2), ("bound", 0.1)])
@pytest.mark.parametrize("name", long_but(("solo12", "go2", "anymal_c"), ("solo12",)))
def test_other_schedules(name, schedule, speed):
    run = walk(hp.WalkingGait(hp.load_robot(name), schedule, velocity=(speed, 0.0, 0.0)))
    assert run.ending == "completed"
    feet_down = run["stance"].sum(axis=1)
    assert feet_down.min() == (3.0 if schedule == "crawl" else 2.0)
    assert run["centre"][-1, 0] - run["centre"][0, 0] > 0.6 * speed * 2.5


@needs_robots
def test_bolt_walks_forward_and_sideways():
    for velocity in ((0.2, 0.0, 0.0), (0.0, 0.1, 0.0)):
        run = walk(hp.WalkingGait(hp.load_robot("bolt"), velocity=velocity), duration=4.0)
        assert run.ending == "completed"
        assert hp.measure(run).tilt_max_rad < 0.02
        moved = run["centre"][-1, :2] - run["centre"][0, :2]
        assert np.abs(moved - 3.9 * np.array(velocity[:2])).max() < 0.1


@needs_robots
@pytest.mark.parametrize("name", long_but(("talos", "icub", "g1"), ("talos",)))
def test_humanoids_walk_on_their_soles_and_stop(name):
    gait = hp.WalkingGait(hp.load_robot(name), velocity=((0.3, 0.2, 0.0, 0.0), (3.0, 0.0, 0.0, 0.0)))
    run = walk(gait, duration=5.0)
    assert run.ending == "completed"
    assert hp.measure(run).tilt_max_rad < 0.05
    assert path_error(run) < 0.1
    assert run["path"][-1, 0] - run["path"][0, 0] > 0.45
    assert not gait.walking


@needs_robots
@pytest.mark.parametrize("name", ["go1", "laikago", "anymal_b", "b1", "hyq"])
def test_other_quadrupeds_trot(name):
    run = walk(hp.WalkingGait(hp.load_robot(name), velocity=(0.5, 0.0, 0.3)))
    assert run.ending == "completed"
    assert slip_per_step(run) < 1.0


@needs_robots
@given(st.lists(st.tuples(st.floats(-1.0, 1.5), st.floats(-0.5, 0.5), st.floats(-1.5, 1.5)), min_size=3, max_size=6))
@settings(max_examples=5, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_random_commands_do_not_fell_it(commands):
    rows = tuple((0.3 + 0.7 * n, *command) for n, command in enumerate(commands))
    run = walk(hp.WalkingGait(hp.load_robot("go2"), velocity=rows), duration=0.7 * len(rows) + 1.0)
    assert run.ending == "completed"


@needs_robots
def test_a_copy_walks_alone():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    other = deepcopy(gait)
    other.command = (0.2, 0.0, 0.0, 0.0)
    state = made_state(gait, force=6.0)
    for each in (gait, other):
        for t in np.arange(0.0, 0.6, 1e-3):
            each.observe(state)
            each.update(float(t))
    assert other.walking
    assert not gait.walking
    assert not np.shares_memory(gait.record, other.command)
