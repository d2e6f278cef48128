"""Walks of any robot, part by part: pendulum and support beside closed forms and other algorithms,
targets beside their differences, touchdowns as they happen.
"""

import warnings
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from long import long_but
from needs import needs_robots
from scipy.integrate import solve_ivp
from scipy.optimize import nnls
from walks import made_state, states_of, walk, walked

import harpy_pin as hp
from harpy_pin.gaits.walking.footholds import widen_stance
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.pendulum import cyclic_offset, nearest_in_hull, predict, real_duration
from harpy_pin.gaits.walking.schedules import draw_together

small = st.floats(-1.0, 1.0)


@cache
def soles_of_talos():
    """A gait, and where the middles of its feet are when it stands."""
    gait = hp.WalkingGait(hp.load_robot("talos"))
    return gait, gait.record["footholds"]["middle"][0].copy()


@given(small, small, small, st.floats(3.0, 8.0), st.floats(0.0, 0.5))
@settings(max_examples=20)
def test_prediction_is_the_pendulums_motion(place, velocity, pressure, omega, time):
    found = predict(place, velocity, pressure, omega, time)
    if time > 0.0:
        motion = solve_ivp(
            lambda _, x: (x[1], omega**2 * (x[0] - pressure)),
            (0.0, time),
            (place, velocity),
            rtol=1e-10,
            atol=1e-12,
        )
        np.testing.assert_allclose(found, motion.y[:, -1], rtol=1e-6, atol=1e-8)
    else:
        np.testing.assert_allclose(
            found, (place, velocity), rtol=0.0, atol=1e-15
        )  # p + (c − p) may round


@given(small, small, st.floats(3.0, 8.0), st.floats(0.1, 0.6))
def test_footholds_at_the_cyclic_offset_repeat_for_ever(way, jump, omega, duration):
    """ξ behind a foot by its offset is behind the next foot by that foot's offset: the walk goes on
    as it is.
    """
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
        q = pin.integrate(
            robot.model, gait.initial_state()[0], 0.3 * rng.standard_normal(robot.model.nv)
        )
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
        # The angular momentum about the ground below the centre of mass is that of a pendulum of
        # this velocity.
        about_ground = data.hg.angular + np.cross((0.0, 0.0, centre[2]), robot.mass * data.vcom[0])
        pendulum = robot.mass * centre[2] * np.array((-m["drift"][1], m["drift"][0]))
        np.testing.assert_allclose(pendulum, about_ground[:2], atol=1e-11)


@needs_robots
@given(
    st.lists(
        st.tuples(st.floats(-3.0, 3.0), small, st.floats(-4.0, 4.0), st.floats(-0.1, 0.1)),
        min_size=2,
    )
)
@settings(max_examples=4, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_targets_fit_their_differences_and_footholds_are_in_reach(solo12, commands):
    """Whatever is commanded, and however often: nothing jumps, and no foothold is out of reach or
    at another foot.
    """
    gait = hp.WalkingGait(solo12)
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
            if not p["steps"]["in_air"][k]:
                before.pop(k, None)
                continue
            place = o.body[:3] + o.foot_position[k]
            velocity = o.body[3:6] + o.foot_velocity[k]
            if k in before:
                np.testing.assert_allclose(
                    place - before[k][0], 0.5 * h * (velocity + before[k][1]), atol=4e-4
                )
                assert np.abs(velocity - before[k][1]).max() < 0.6
            before[k] = place, velocity
            left = max(1.0 - p["steps"]["phase"], 0.0) * gait.step_duration
            x, y = p["pace"]["nominal"][k]
            hip = m["centre"][:2] + left * m["drift"] + (c * x - s * y, s * x + c * y)
            assert np.hypot(*(p["footholds"]["place"][k, :2] - hip)) < p["build"]["reach"] + 0.03
            others = [j for j in range(4) if not p["steps"]["in_air"][j]]
            gaps = [np.hypot(*(p["footholds"]["place"][k, :2] - m["place"][j, :2])) for j in others]
            assert min(gaps) > 0.2 * np.ptp(p["pace"]["nominal"][:, 1])

    run = walk(gait, duration=2.0, on_tick=check)
    most = np.hypot(run["applied_velocity"][:, 0], run["applied_velocity"][:, 1])
    assert most.max() <= p["planned"]["max_speed"] + 1e-9


@needs_robots
@given(aside=st.floats(-0.4, 0.4), turn=st.floats(-2.0, 2.0), step=st.floats(0.2, 0.6))
@settings(max_examples=50, deadline=None)
def test_soles_are_planned_apart(aside, turn, step):
    """Where a step to the side has brought them together and a turn has turned them towards each
    other.
    """
    gait, places = soles_of_talos()
    p = gait._record_[0]
    p["planned"]["velocity"][1], p["planned"]["goal"][2], p["steps"]["duration"] = aside, turn, step
    widen_stance(gait._record_)
    apart, usual = (float(np.ptp(place[:, 1])) for place in (p["footholds"]["middle"], places))
    assert apart >= usual
    lasts = real_duration(gait._record_)
    (length, width), corner = (
        p["build"]["sole"],
        np.array(((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))),
    )

    def sole(side):
        c, s = np.cos(side * 0.5 * turn * lasts), np.sin(side * 0.5 * turn * lasts)
        own = 0.5 * corner * (length, width) @ ((c, s), (-s, c))
        return own[:, 1] + 0.5 * side * (apart - abs(aside) * lasts)

    gap = sole(1.0).min() - sole(-1.0).max()
    assert gap == pytest.approx(0.01) if apart > usual else gap > 0.01


@needs_robots
def test_feet_that_land_early_stay_and_late_ones_are_let_down():
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

    go(loaded, until=lambda: p["steps"]["in_air"].any())
    swing = gait.target.stance == 0.0
    assert swing.sum() == 2
    go(
        loaded, until=lambda: p["steps"]["phase"] > 0.5
    )  # a load in the first part of the swing is the foot's last touch
    assert p["steps"]["in_air"].sum() == 2
    go(free, until=lambda: p["steps"]["phase"] > 0.75)
    go(loaded, until=lambda: not p["steps"]["in_air"].any())  # early
    assert p["steps"]["phase"] < 0.8
    assert (gait.target.stance == 1.0).all()
    go(loaded, until=lambda: p["steps"]["in_air"].any())
    assert not (swing & (gait.target.stance == 0.0)).any()  # now the others
    go(free, until=lambda: p["steps"]["phase"] >= 1.0)
    heights = []
    for _ in range(40):  # late: down, at one velocity, while the other feet stay
        gait.observe(free)
        o = gait.update(t)
        t += h
        heights.append((o.body[2] + o.foot_position[o.stance == 0.0, 2]).max())
    np.testing.assert_allclose(np.diff(heights[1:]) / h, -0.3, atol=1e-6)
    assert p["steps"]["in_air"].sum() == 2
    go(free, until=lambda: p["steps"]["phase"] < 0.5)  # the walk does not wait for ever
    assert gait.walking


@needs_robots
def test_a_foot_that_was_just_lifted_has_not_landed_whatever_the_period():
    """Loads are averaged over ticks; those of the stance do not count in the swing."""
    for h in (1e-3, 5e-3, 0.02):
        gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.0))
        loaded, free, p = made_state(gait, force=30.0), made_state(gait, force=0.0), gait.record[0]
        for tick in range(round(1.0 / h)):
            gait.observe(free if p["steps"]["in_air"].any() else loaded)
            gait.update(tick * h)
            if p["steps"]["phase"] > 0.9:
                break
        assert p["steps"]["in_air"].sum() == 2


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "bolt"])
def test_an_acceleration_that_is_held_brings_a_swing_foot_to_its_next_velocity(name):
    gait, h, t, before, seen = (
        hp.WalkingGait(hp.load_robot(name), velocity=(0.3, 0.0, 0.0)),
        0.02,
        0.0,
        None,
        0,
    )
    state = made_state(gait, force=30.0)
    while seen < 5:
        gait.observe(state)
        o, swings = gait.update(t), gait.target.stance == 0.0
        velocity, acceleration = o.body[3:6] + o.foot_velocity, o.body[6:9] + o.foot_acceleration
        if (
            t > 1.5 * h and swings.any() and (swings == before[2]).all()
        ):  # the first update knows no period
            ahead = before[0] + h * before[1]
            np.testing.assert_allclose(
                velocity[swings, 2], ahead[swings, 2], atol=1e-9
            )  # heights do not change plans
            assert np.abs(before[1][swings, 2]).max() > 1.0
            seen += 1
        before, t = (velocity.copy(), acceleration.copy(), swings.copy()), t + h
        state = made_state(gait, force=0.0) if swings.any() else state


@needs_robots
def test_a_stance_foot_that_moves_is_at_rest_after_a_long_tick_and_too_few_ticks_are_said():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    state = made_state(gait, force=6.0)
    state.v[0] = 0.1
    for period, rate in (
        (1e-3, 200.0),
        (5e-3, 200.0),
        (0.02, 50.0),
    ):  # at most 1 / period: no foot turns back
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            controller = hp.make_controller("condensed", gait, mu=0.6, period=period)
        controller.step(state)
        np.testing.assert_allclose(
            controller.targets.feet, np.tile((-0.1 * rate, 0.0, 0.0), (4, 1)), atol=1e-9
        )
        assert [str(warning.message) for warning in said] == (
            [
                "'solo12' has 7.5 ticks of 0.02 s in a step and may fall: take a period of 0.019 s "
                "at most"
            ]
            if period == 0.02
            else []
        )


@needs_robots
def test_a_stance_foot_that_does_not_touch_is_let_down():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    gait.observe(made_state(gait, height=0.01))
    o = gait.update(0.0)
    assert (o.stance == 1.0).all()
    np.testing.assert_allclose(
        o.body[3:6] + o.foot_velocity, np.tile((0.0, 0.0, -0.3), (4, 1)), atol=1e-12
    )


@needs_robots
def test_commands_that_are_not_finite_are_ignored_and_scripts_are_followed(solo12):
    gait = hp.WalkingGait(solo12, velocity=((0.1, 0.2, 0.0, 0.0), (0.5, 0.0, 0.0, 0.5, 0.01)))
    state = made_state(gait)
    with pytest.raises(hp.InputError, match="observe"):
        gait.update(0.0)
    for t in np.arange(0.0, 1.0, 1e-3):
        gait.observe(state)
        gait.update(float(t))
        expected = (
            (0.0, 0.0, 0.0, 0.0)
            if t < 0.1
            else (0.2, 0.0, 0.0, 0.0)
            if t < 0.5
            else (0.0, 0.0, 0.5, 0.01)
        )
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
    wave = hp.WalkingGait(solo12, velocity=lambda t: (0.1 * t, 0.0, 0.0))
    wave.observe(state)
    wave.update(0.0)
    wave.update(2.0)
    assert wave.command[0] == 0.2


@needs_robots
def test_what_it_cannot_do_is_refused(solo12):
    with pytest.raises(hp.InputError, match="trot"):
        hp.WalkingGait(solo12, "gallop")
    with pytest.raises(hp.InputError, match="walk"):
        hp.WalkingGait(hp.load_robot("bolt"), "trot")
    with pytest.raises(hp.InputError, match="two, four or six"):
        hp.WalkingGait(hp.load_robot("iris"))
    gait = hp.WalkingGait(solo12)
    gait.observe(made_state(gait))
    with pytest.raises(hp.InputError, match="finite"):
        gait.update(np.inf)


SIDES = [45 * k for k in range(8)]


@needs_robots
@pytest.mark.parametrize(
    ("name", "slope", "centred"), [("g1", 0.0, 1.0), ("g1", 0.1, 0.0), ("go2", 0.0, 0.0)]
)
def test_on_level_soles_the_demand_is_of_the_centre_of_mass(name, slope, centred):
    gait = hp.WalkingGait(hp.load_robot(name))
    if slope:
        gait = hp.OnTerrain(gait, hp.ground.Plane(slope=slope))
    gait.observe(made_state(gait))
    assert gait.update(0.0).centre_of_mass == centred


@needs_robots
@pytest.mark.parametrize("degrees", long_but(SIDES, (0, 135)))
def test_icub_that_stands_takes_a_push_without_a_step(degrees):
    gait, angle = hp.WalkingGait(hp.load_robot("icub")), np.deg2rad(degrees)
    push = (0.15 * np.cos(angle), 0.15 * np.sin(angle), 0.0)
    run = walk(gait, pushes=((1.0, push),), duration=2.5)
    assert int(run["steps"][-1]) == 0
    assert hp.measure(run).tilt_max_rad < 0.15
    assert abs(run["v"][-1]).max() < 0.1


@pytest.mark.parametrize("ticks", [500, 1500, 1777])
@needs_robots
def test_a_walk_that_begins_anew_is_that_of_a_new_gait(solo12, ticks):
    # With two feet in the air before, or all down: nothing of it is left.
    used, new = (hp.WalkingGait(solo12, velocity=(0.4, 0.0, 0.0)) for _ in range(2))
    states = states_of(walked(used, controller="condensed", duration=2.0))
    for state in states[:ticks]:
        used.observe(state)
        used.update(state.t)
    for state in states[:1200]:
        targets = []
        for gait in (used, new):
            gait.observe(state)
            targets.append(gait.update(state.t))
        for name in ("body", "foot_position", "stance"):
            np.testing.assert_array_equal(*(getattr(target, name) for target in targets))


@needs_robots
def test_a_script_begins_anew_with_the_clock_under_a_controller(solo12):
    gait = hp.WalkingGait(solo12, velocity=((0.0, 0.3, 0.0, 0.0), (0.0495, 0.0, 0.0, 0.0)))
    controller, state = hp.make_controller("condensed", gait, mu=0.6), made_state(gait, force=6.0)
    for tick in [*range(100), *range(100)]:
        state.t = 1e-3 * tick
        controller.step(state)
        assert gait.command[0] == (0.3 if tick < 50 else 0.0)


@needs_robots
def test_only_a_script_has_to_begin_anew_in_python(solo12):
    for velocity, alone in (((0.3, 0.0, 0.0), True), ([(0.0, 0.3, 0.0, 0.0)], False)):
        gait = hp.WalkingGait(solo12, velocity=velocity)
        gait.observe(made_state(gait, force=6.0))
        gait.update(0.0)
        assert gait._advance(0.0, gait._record_, gait.target._record_) is alone
