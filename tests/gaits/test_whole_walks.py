"""Walks of any robot, on slippery ground, pushed, delayed, and in MuJoCo.

``--long`` walks more robots: kernels are compiled for each size of robot.
"""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from long import long_but
from needs import QUICK_PLANTS, needs_robots
from walks import gap_of_soles, path_error, slip_per_step, walk

import harpy_pin as hp
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.ground.terrain import HeightField, Plane, Stairs

PUSHES = [((0.6, 0.0),), ((-0.6, 0.0),), ((0.0, 0.6),), ((0.0, -0.6),)]
"""Velocities that pushes would give, m/s."""
ON_SOLES = long_but(("talos", "icub", "g1"), ("talos",))


@needs_robots
@pytest.mark.parametrize(
    ("name", "speed"), [("solo12", 0.6), ("go2", 1.5), ("a1", 1.2), ("anymal_c", 0.8)]
)
def test_trots_as_commanded_and_hardly_slips(name, speed):
    gait = hp.WalkingGait(hp.load_robot(name), velocity=(speed, 0.0, 0.0), max_speed=2.0)
    run = walk(gait)
    assert (run["condensed_status"] == 0).mean() > 0.9
    assert slip_per_step(run) < 0.5 * 2.0  # of two feet
    assert hp.measure(run).tilt_max_rad < 0.01
    assert path_error(run) < 0.05
    start = gait.record["pace"]["start_time"][0] - gait.double_support * gait.step_duration
    moved = speed * (3.0 - start - 0.5 * speed)  # at 1 m/s²
    np.testing.assert_allclose(run["path"][-1, 0] - run["path"][0, 0], moved, rtol=0.05)
    settled = run["t"] > 2.0
    assert (
        abs(np.polyfit(run["t"][settled], run["centre"][settled, 0], 1)[0] - speed) < 0.05 * speed
    )


@needs_robots
@pytest.mark.parametrize(
    "held", [{}, hp.controllers.parameters.JOINT_TARGETS], ids=("torque", "targets")
)
@pytest.mark.parametrize(
    "name", long_but(("go2", "a1", "hyq", "anymal_b", "g1"), ("go2", "anymal_b"))
)
def test_walks_at_fifty_ticks_a_second(name, held):
    soles = name == "g1"
    gait = hp.Walking(
        velocity=((0.0, 0.2 if soles else 0.5, 0.0, 0.0), (3.0, 0.1 if soles else 0.25, 0.0, 0.4))
    )
    controller, ground = hp.Condensed(parameters=dict(held)), hp.Ground(mu_s=0.6)
    scenario = hp.Scenario(
        robot=name, gait=gait, controller=controller, ground=ground, duration=6.0, period=0.02
    )
    run = hp.walk(scenario)
    assert run.ending == "completed"
    assert hp.measure(run).slip_mm_per_step < 10.0


@needs_robots
def test_course_start_and_stop():
    """Forward, a turn, sideways, back, and standing at the end, with the feet where they stand."""
    quarter = np.pi / 2 / 0.6
    rows = (
        (0.5, 0.3, 0, 0),
        (2.5, 0.2, 0, 0.6),
        (2.5 + quarter, 0, 0.15, 0),
        (6.5, -0.15, 0, 0),
        (8, 0, 0, 0),
    )
    gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=rows)
    run = walk(gait, duration=9.5)
    assert path_error(run) < 0.03
    assert abs(run["path"][-1, 2] - np.pi / 2) < 0.02
    assert (run["stance"][run["t"] < 0.5] == 1.0).all()
    assert not gait.walking
    rest = run["t"] > 9.0
    assert (run["stance"][rest] == 1.0).all()
    assert np.abs(run["v"][-1]).max() < 0.02


@needs_robots
@pytest.mark.parametrize(
    ("name", "velocity", "mu"),
    [
        *(("go2", (0.4, 0.0, 0.0), mu) for mu in (0.3, 0.15)),
        *((name, (0.5, 0.0, 0.3), 0.6) for name in ("go1", "laikago", "anymal_b", "b1", "hyq")),
    ],
)
def test_trots_on_slippery_ground_and_turning(name, velocity, mu):
    run = walk(hp.WalkingGait(hp.load_robot(name), velocity=velocity), mu=mu)
    assert slip_per_step(run) < 1.0


@needs_robots
@pytest.mark.parametrize("push", [push for (push,) in PUSHES])
def test_a_pushed_trot_goes_on(push):
    run = walk(
        hp.WalkingGait(hp.load_robot("go2"), velocity=(0.4, 0.0, 0.0)),
        pushes=((1.5, (*push, 0.0)),),
    )
    assert hp.measure(run).tilt_max_rad < 0.1
    along = np.abs(run["v"][:, 0 if push[0] else 1] - (0.4 if push[0] else 0.0))
    assert along[np.abs(run["t"] - 1.6) < 0.1].max() > 0.2  # it was pushed
    assert along[run["t"] > 2.7].max() < 0.12


@needs_robots
def test_standing_robot_steps_when_it_is_pushed_and_stands_again():
    gait = hp.WalkingGait(hp.load_robot("solo12"))
    run = walk(gait, duration=4.0, pushes=((0.5, (0.0, 0.9, 0.0)),))
    assert run["steps"][-1] > 1
    assert not gait.walking


@needs_robots
def test_delay_noise_and_another_plant():
    pytest.importorskip("mujoco")
    for more in ({"delay": 2e-3}, {"noise": hp.Noise.typical()}, {"plant": "mujoco"}):
        run = walk(hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.1)), **more)
        assert slip_per_step(run) < 2.0
        assert path_error(run) < 0.03


@needs_robots
@pytest.mark.parametrize(("schedule", "speed"), [("crawl", 0.15), ("pace", 0.2), ("bound", 0.1)])
@pytest.mark.parametrize("name", long_but(("solo12", "go2", "anymal_c"), ("solo12",)))
def test_other_schedules(name, schedule, speed):
    run = walk(hp.WalkingGait(hp.load_robot(name), schedule, velocity=(speed, 0.0, 0.0)))
    feet_down = run["stance"].sum(axis=1)
    assert feet_down.min() == (3.0 if schedule == "crawl" else 2.0)
    assert run["centre"][-1, 0] - run["centre"][0, 0] > 0.6 * speed * 2.5


@needs_robots
def test_bolt_walks_forward_and_sideways():
    for velocity in ((0.2, 0.0, 0.0), (0.0, 0.1, 0.0)):
        run = walk(hp.WalkingGait(hp.load_robot("bolt"), velocity=velocity), duration=4.0)
        assert hp.measure(run).tilt_max_rad < 0.02
        moved = run["centre"][-1, :2] - run["centre"][0, :2]
        assert np.abs(moved - 3.9 * np.array(velocity[:2])).max() < 0.1


@needs_robots
@pytest.mark.parametrize("push", [(0.0, 0.0), (0.0, 0.1), (0.1, 0.0)])
def test_bolt_steps_in_place_and_takes_a_push(push):
    pushes = ((0.5, (*push, 0.0)),) if any(push) else ()
    gait = hp.WalkingGait(hp.load_robot("bolt"), "step", (0.0, 0.0, 0.0))
    run = walk(gait, mu=0.5, duration=4.0, pushes=pushes)
    assert hp.measure(run).tilt_max_rad < 0.05
    assert np.abs(run["v"][-1000:, :2].mean(axis=0)).max() < 0.05  # it has caught itself


@needs_robots
def test_feet_of_a_biped_do_not_cross_and_land_before_it_leans_too_far():
    """Sideways and pushed: the left foot stays on the left, and the step hastens where the pendulum
    runs away.
    """
    gait = hp.WalkingGait(hp.load_robot("bolt"), velocity=(0.5, 0.3, 0.0))
    p, hastes, sides = gait.record[0], [], []

    def see(state):
        m = p["measured"]
        hastes.append(float(p["steps"]["haste"]))
        side = np.array((-np.sin(m["heading"]), np.cos(m["heading"])))
        sides.append(side @ (m["place"][0, :2] - m["place"][1, :2]))

    run = walk(gait, mu=0.5, duration=4.0, pushes=((2.0, (0.8, 0.0, 0.0)),), on_tick=see)
    assert min(sides[1:]) > 0.0  # the first one is before anything is measured
    apart = p["pace"]["nominal"][0, 1] - p["pace"]["nominal"][1, 1]
    assert np.abs(run["applied_velocity"][:, 1]).max() * p["pace"]["usual_step"] < apart
    hastes, pushed = np.array(hastes), run["t"] > 2.0
    assert (hastes[~pushed] == 1.0).mean() > 0.9
    assert hastes[pushed].max() > 1.05


@needs_robots
@pytest.mark.parametrize("push", long_but(PUSHES, PUSHES[1:3]))
@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_a_pushed_biped_on_points_goes_on(plant, push):
    gait = hp.WalkingGait(hp.load_robot("bolt"), velocity=(0.2, 0.0, 0.0))
    run = walk(gait, mu=0.5, duration=4.0, pushes=((1.6, (*push, 0.0)),), plant=plant)
    assert abs(run["v"][-300:, 1].mean()) < 0.1  # it has caught itself


@needs_robots
@pytest.mark.parametrize("time", long_but((2.24, 2.28, 2.32, 2.36), (2.24, 2.36)))
def test_a_biped_on_points_that_is_pushed_askew_is_not_lifted(time):
    """Its one force holds the body upright against the swinging leg only by pushing it aside and
    up.
    """
    gait = hp.WalkingGait(hp.load_robot("bolt"), velocity=(0.5, 0.0, 0.0))
    run = walk(gait, duration=3.5, pushes=((time, (0.55, 0.55, 0.0)),))
    assert run["centre"][:, 2].max() < 1.15 * run["centre"][0, 2]


@needs_robots
@pytest.mark.parametrize("rise", [0.02, -0.02])
@pytest.mark.parametrize("name", ["solo12", "bolt"])
def test_a_step_of_two_centimetres_that_it_does_not_know(name, rise):
    """Up: a foot that meets the ground early has landed. Down: a late one is let down, and the
    others stay loaded.
    """
    log = []

    def see(state):
        p = gait.record[0]
        log.append(
            (
                p["steps"]["in_air"].copy(),
                p["steps"]["felt"].copy(),
                p["steps"]["phase"].item(),
                state.foot_force[:, 2].copy(),
            )
        )

    robot = hp.load_robot(name)
    blind = OnTerrain(hp.WalkingGait(robot, velocity=(0.3, 0.0, 0.0)), Plane(slope=0.0))
    gait, stairs = blind.gait, Stairs(rise=rise, steps=1, depth=5.0, start=0.5, edge=0.002)
    run = walk(blind, terrain=stairs, duration=3.5, on_tick=see)
    assert hp.measure(run).tilt_max_rad < 0.1
    unknown = 0.03 * gait.record["build"]["height"][0]
    assert np.abs(gait.record["steps"]["felt"][0] - rise).min() < unknown
    assert (gait.record["steps"]["felt"][0] * np.sign(rise) > 0.0).all()
    on_both = run["q"][0, 2] + rise
    assert abs(run["q"][-1, 2] - on_both) < 0.01  # the body goes with the ground
    in_air, felt, phase, load = (np.array(column) for column in zip(*log, strict=True))
    if rise < 0.0:
        late = (phase > 1.0) & in_air.any(axis=1) & ~in_air.all(axis=1) & (felt == 0.0).any(axis=1)
        assert late.any()
        carried = np.where(in_air[late] == 0.0, load[late], 0.0).sum(axis=1)
        assert np.median(carried) > 0.7 * robot.mass * 9.81
    else:
        early = (np.diff(felt, axis=0) > 0.01).any(axis=1)
        assert early.any()
        assert phase[1:][early].min() < 0.95


@needs_robots
@pytest.mark.parametrize("rise", [0.02, -0.02])
@pytest.mark.parametrize("name", ON_SOLES)
def test_soles_feel_two_centimetres_that_they_do_not_know(name, rise):
    """The body goes with the ground, so that no step is late; soles stand across the edge, which is
    a short ramp.
    """
    gait = hp.WalkingGait(hp.load_robot(name), velocity=(0.25, 0.0, 0.0))
    stairs = Stairs(rise=rise, steps=1, depth=5.0, start=0.4, edge=0.05)
    run = walk(OnTerrain(gait, Plane(slope=0.0)), terrain=stairs, duration=5.0)
    assert hp.measure(run).tilt_max_rad < 0.1
    np.testing.assert_allclose(gait.record["steps"]["felt"][0], rise, atol=0.008)
    assert run["centre"][-1, 0] > 0.9
    assert path_error(run) < 0.06
    late = run["phase"][run["t"] > 4.0].max()
    assert late < 1.1


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "bolt"])
@pytest.mark.parametrize("seed", [0, 1])
def test_bumps_of_one_centimetre_that_it_does_not_know(name, seed):
    heights = np.random.default_rng(seed).uniform(-0.01, 0.01, (30, 30))
    heights[:9] = 0.0  # where it stands at first
    gait = hp.WalkingGait(hp.load_robot(name), velocity=(0.3, 0.0, 0.0))
    bumps = HeightField(heights=heights.tolist(), resolution=0.1, corner=(-0.5, -1.5))
    run = walk(gait, terrain=bumps, duration=3.5)
    assert hp.measure(run).tilt_max_rad < 0.05
    assert run["centre"][-1, 0] > 0.6


@needs_robots
@pytest.mark.parametrize("name", ON_SOLES)
def test_humanoids_walk_on_their_soles_and_stop(name):
    """As fast as commanded and where commanded, with joints in their ranges; a step ends when its
    foot lands.

    At 0.4 m/s ankles of iCub go 0.06 rad beyond their range.
    """
    robot, speed, hastes = hp.load_robot(name), 0.3 if name == "icub" else 0.4, []
    gait = hp.WalkingGait(robot, velocity=((0.3, speed, 0.0, 0.0), (5.0, 0.0, 0.0, 0.0)))
    run = walk(
        gait, duration=7.0, on_tick=lambda _: hastes.append(gait.record["steps"]["haste"][0])
    )
    assert hp.measure(run).tilt_max_rad < 0.05
    assert path_error(run) < 0.03
    t = run["t"]
    steady = (t > 2.5) & (t < 5.0)
    assert np.polyfit(t[steady], run["centre"][steady, 0], 1)[0] == pytest.approx(speed, rel=0.03)
    lengths = np.diff(t[np.flatnonzero(np.diff(run["steps"])) + 1])[3:8]
    by_the_clock = min(gait.step_duration, gait.record["pace"]["stride"][0] / speed) / np.mean(
        hastes
    )
    assert np.mean(lengths) == pytest.approx(
        (1.0 - 0.1 * (1.0 - gait.double_support)) * by_the_clock, rel=0.08
    )
    beyond = np.maximum(
        robot.model.lowerPositionLimit - run["q"], run["q"] - robot.model.upperPositionLimit
    )
    assert beyond[:, 7:].max() < 0.05
    assert not gait.walking


@needs_robots
@pytest.mark.parametrize("name", ON_SOLES)
def test_soles_stay_apart_in_turns_and_steps_to_the_side(name):
    """Forward in a turn, sideways, back the other way at once, turning alone, and standing at the
    end.
    """
    robot, gait = hp.load_robot(name), hp.WalkingGait(hp.load_robot(name))
    speed, aside = 0.5 * gait.max_speed, gait.max_aside
    rows = (
        (0.3, speed, 0, 0.5),
        (2.0, 0, aside, 0),
        (3.5, 0, -aside, 0.3),
        (5.0, 0, 0, -1.0),
        (6.0, 0, 0, 0),
    )
    gait = hp.WalkingGait(robot, velocity=rows)
    run = walk(gait, duration=8.0)
    assert gap_of_soles(run, robot) > 0.009
    assert slip_per_step(run) < 2.0
    assert path_error(run) < 0.05
    assert not gait.walking


@needs_robots
@pytest.mark.parametrize("name", ON_SOLES)
def test_steps_to_the_side_are_as_wide_as_planned(name):
    """Nothing has to hold the soles apart, and no step hastens once its foot is in the air."""
    robot, seen = hp.load_robot(name), []
    gait = hp.WalkingGait(robot, velocity=(0.0, 0.8 * hp.WalkingGait(robot).max_aside, 0.0))
    p = gait.record[0]

    def see(_):
        swings = p["steps"]["in_air"].any() and p["steps"]["phase"] > 0.25
        seen.append(
            (
                p["steps"]["haste"],
                np.ptp(p["footholds"]["middle"][:, 1]),
                np.ptp(p["measured"]["place"][:, 1]),
                swings,
            )
        )

    run = walk(gait, duration=5.0, on_tick=see)
    haste, planned, apart, swings = np.array(seen, dtype=float)[2500:].T
    assert haste[swings == 1.0].max() == 1.0
    down = (run["stance"][2500:] == 1.0).all(axis=1)
    assert planned.mean() < 0.5 * (apart[down].min() + apart[down].max()) < planned.mean() + 0.03
    assert np.ptp(apart[down]) > 1.5 * gait.step_duration * run["applied_velocity"][-1, 1]


@needs_robots
@pytest.mark.parametrize("name", ON_SOLES)
def test_a_pushed_humanoid_hardly_steps_on_its_own_foot(name):
    """Pushed to the side of the foot on which it stands, where the other one cannot go."""
    robot = hp.load_robot(name)
    for quarter in range(4):
        gait = hp.WalkingGait(robot, "step")
        time = round(1.0 + 0.25 * quarter * gait.step_duration, 3)
        run = walk(gait, pushes=((time, (0.0, -0.4, 0.0)),), duration=time + 2.0)
        assert gap_of_soles(run, robot) > -0.02


@needs_robots
@given(
    st.lists(
        st.tuples(st.floats(-1.0, 1.5), st.floats(-0.5, 0.5), st.floats(-1.5, 1.5)),
        min_size=3,
        max_size=6,
    )
)
@settings(max_examples=5, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_random_commands_do_not_fell_it(commands):
    rows = tuple((0.3 + 0.7 * n, *command) for n, command in enumerate(commands))
    walk(hp.WalkingGait(hp.load_robot("go2"), velocity=rows), duration=0.7 * len(rows) + 1.0)


SIDES = [45 * k for k in range(8)]
KNEES = {"leg_left_4_joint", "leg_right_4_joint", "l_knee", "r_knee"}


@needs_robots
@pytest.mark.parametrize("quarter", [1, 2])
@pytest.mark.parametrize("degrees", long_but(SIDES, (90,)))
def test_a_push_from_any_side_does_not_fell_g1_in_mujoco(degrees, quarter):
    """Pushed to the side of the stance foot, too, where the other foot cannot follow: it has to
    land earlier.
    """
    pytest.importorskip("mujoco")
    gait, angle = hp.WalkingGait(hp.load_robot("g1"), "step"), np.deg2rad(degrees)
    push = (0.4 * np.cos(angle), 0.4 * np.sin(angle), 0.0)
    time = round(2.0 + 0.25 * quarter * gait.step_duration, 3)
    run = walk(gait, mu=0.6, pushes=((time, push),), duration=time + 2.5, plant="mujoco")
    assert run["centre"][-1, 2] > 0.9 * run["centre"][0, 2]


@needs_robots
@pytest.mark.parametrize(
    ("name", "time"), long_but((("talos", 2.0), ("icub", 2.188)), (("talos", 2.0),))
)
def test_a_pushed_humanoid_turns_and_keeps_its_knees_bent(name, time):
    """Pushed to the right, so that it has to step far: body and arms turn and come back, and no leg
    is stretched.
    """
    robot = hp.load_robot(name)
    run = walk(
        hp.WalkingGait(robot, "step"),
        mu=0.6,
        pushes=((time, (0.0, -0.4, 0.0)),),
        duration=time + 2.5,
    )
    tilt = np.arccos(1.0 - 2.0 * (run["q"][:, 3] ** 2 + run["q"][:, 4] ** 2))
    assert tilt.max() > 0.02
    assert tilt[-1] < 0.02
    knees = [n for n, joint in enumerate(robot.joints) if joint in KNEES]
    assert len(knees) == 2
    beyond = np.maximum(
        robot.model.lowerPositionLimit - run["q"], run["q"] - robot.model.upperPositionLimit
    )
    assert beyond[:, 7:][:, knees].max() < 0.05


@needs_robots
def test_a_robot_walks_where_it_faces():
    """iCub's base has its x axis to the back; its soles reach further ahead of the ankles than
    behind.
    """
    robot = hp.load_robot("icub")
    gait, ground = hp.Walking(velocity=(0.2, 0.0, 0.0)), hp.Ground(mu_s=0.6)
    run = hp.walk(
        hp.Scenario(robot="icub", gait=gait, ground=ground, state="estimated", duration=3.0)
    )
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, run["q"][0])
    ankles = {robot.model.frames[robot.frame_id(name)].parentJoint for name in robot.feet}
    ahead = run["foot_position"][0, :, 0].mean() - np.mean(
        [data.oMi[joint].translation[0] for joint in ankles]
    )
    assert ahead > 0.01
    seen = hp.measure(run)
    assert seen.distance_m > 0.3
    assert seen.yaw_max_rad < 0.2
    assert seen.velocity_rms_m_s < 0.1
    np.testing.assert_allclose(
        seen.estimate_off_m, np.linalg.norm((run["estimated_q"] - run["q"])[-1, :3])
    )
    assert 0.0 < seen.estimate_off_m < 0.05
