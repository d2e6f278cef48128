"""How fast a robot walks: torques of swinging legs beside statics, the pendulum's reaction beside
momentum, and a trot at two metres per second in both plants.
"""

import warnings

import numpy as np
import pinocchio as pin
import pytest
from long import long_but
from needs import QUICK_PLANTS, needs_robots
from scipy.optimize import brentq
from walks import made_state, slip_per_step, walk

import harpy_pin as hp
from harpy_pin.gaits.velocity import largest
from harpy_pin.gaits.walking import WalkingParameters
from harpy_pin.gaits.walking.build import build_of
from harpy_pin.gaits.walking.footholds import _keep_in_reach
from harpy_pin.gaits.walking.pendulum import upright_share
from harpy_pin.gaits.walking.swing_load import swing_load

TUNED = WalkingParameters()


def go2():
    robot = hp.load_robot("go2")
    q, _ = hp.Standing(robot).initial_state()
    return robot, q, build_of(robot, q, TUNED)


@needs_robots
def test_a_leg_that_does_not_move_needs_the_torque_of_its_weight():
    robot, q, build = go2()
    load = swing_load(robot, q, build, 0.0, 0.2, 0.1, 0.0, TUNED.upright_end)
    weight = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q)[6:]
    assert load == pytest.approx(np.max(np.abs(weight) / robot.model.effortLimit[6:]), rel=1e-6)


@needs_robots
def test_torques_of_a_swing_without_weight_grow_with_the_square_of_its_rate():
    robot, q, build = go2()
    robot.model.gravity.linear = np.zeros(3)
    slow, fast = (
        swing_load(robot, q, build, 1.0, 0.2, 0.1, 0.03, TUNED.upright_end),
        swing_load(robot, q, build, 2.0, 0.1, 0.1, 0.03, TUNED.upright_end),
    )
    assert fast == pytest.approx(4.0 * slow, rel=1e-6)


@needs_robots
@pytest.mark.parametrize(("most", "speed"), [(9.0, 3.0), (4.0, 2.0), (1e-9, 0.0)])
def test_largest_speed_is_where_the_load_is_reached(most, speed):
    found = largest(lambda v: v * v <= most, 3.0, halvings=7)
    assert found == pytest.approx(speed, abs=3.0 / 2**7)
    assert found**2 <= most


@needs_robots
def test_reaction_is_the_momentum_that_a_moving_foot_gives_the_pendulum():
    robot, q, build = go2()
    model, data = robot.model, robot.model.createData()
    for k, name in enumerate(robot.feet):
        v = np.zeros(model.nv)
        v[6 + 3 * k : 9 + 3 * k] = 0.3, -0.7, 0.9
        foot = (
            pin.computeFrameJacobian(model, data, q, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[
                :3
            ]
            @ v
        )
        momentum = pin.computeCentroidalMomentum(model, data, q, v).np / robot.mass
        desired = (momentum[0] + momentum[4] / build.rise, momentum[1] - momentum[3] / build.rise)
        np.testing.assert_allclose(build.reaction[k] @ foot, desired, atol=1e-12)
        np.testing.assert_allclose(
            (build.reaction[k] - build.turning[k]) @ foot, momentum[:2], atol=1e-12
        )


@needs_robots
@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_go2_trots_at_two_metres_per_second_with_shorter_steps(plant):
    gait = hp.WalkingGait(hp.load_robot("go2"), velocity=(2.0, 0.0, 0.0), max_speed=2.0)
    run = walk(gait, mu=0.8, duration=4.0, plant=plant)
    last = run["t"] > 3.0
    assert np.mean(run["centre"][last, 3]) == pytest.approx(2.0, abs=0.1)
    assert np.ptp(run["steps"][last]) > 1.3 * 1.0 / gait.step_duration


@needs_robots
@pytest.mark.parametrize("name", ["anymal_b", "anymal_c", "solo12"])
def test_legs_of_a_bound_reach_their_feet_at_its_largest_speed(name):
    """By the leg's own geometry: from the hip of the posture to where the foot is when it leaves
    the ground.
    """
    robot = hp.load_robot(name)
    gait = hp.WalkingGait(robot, schedule="bound")
    build = build_of(robot, hp.Standing(robot).initial_state()[0], TUNED)
    apart = build.around()
    behind = 0.5 * gait.max_speed * (1.0 + gait.double_support) * gait.step_duration
    hip = build.reach**2 - (0.98 * build.leg) ** 2  # minus its squared height
    for drawn in np.linalg.norm(apart - gait.record["pace"]["nominal"][0], axis=1):
        assert np.sqrt((drawn + behind) ** 2 - hip) < 0.97 * build.leg


@needs_robots
def test_anymal_b_bounds_as_fast_as_its_legs_reach():
    robot = hp.load_robot("anymal_b")
    with pytest.warns(UserWarning, match="limited"):
        gait = hp.WalkingGait(robot, schedule="bound", velocity=((0.3, 0.45, 0.0, 0.0),))
    run = walk(gait, mu=0.5, duration=6.0)
    assert run["centre"][-1, 0] > 5.0 * 0.9 * gait.max_speed


@pytest.mark.parametrize(
    ("near", "low", "height"), [(TUNED.near, TUNED.low, 0.053), (TUNED.straight_near, 0.0, 0.04)]
)
@pytest.mark.parametrize("speed", [0.0, 0.1, 0.3, 0.6, 1.0])
def test_a_foot_is_slow_when_it_is_near_the_ground(speed, near, low, height):
    # A trot with steps of 1 s: a foot goes two steps' way in a swing of 0.95 s, by the motion of
    # least jerk.
    end, swing = upright_share(speed, TUNED.creep, near, TUNED.upright_end), 0.95
    assert end >= TUNED.upright_end
    settle = TUNED.settle
    # the height there falls at the rate at which it goes on to the ground
    glide = low * settle / (1.0 - settle)

    def above(w):  # at the share w before it begins to go down slowly
        return 64.0 * (w * (1.0 - w)) ** 3 + low + glide * w - height

    before = brentq(above, 0.0, 0.5)
    assert 1.0 - settle * (1.0 - before) == pytest.approx(near, abs=0.004)
    s = min(settle * (1.0 - before) / (1.0 - end), 1.0)
    velocity = 2.0 * speed / ((1.0 - end) * swing) * 30.0 * (s * (1.0 - s)) ** 2
    assert velocity <= 1.2 * TUNED.creep


@needs_robots
@pytest.mark.parametrize("name", ["go2", "anymal_c"])
@pytest.mark.parametrize("higher", [0.0, 0.03])
def test_no_foothold_stretches_a_leg(name, higher):
    robot = hp.load_robot(name)
    gait = hp.WalkingGait(robot)
    q, v = gait.initial_state()
    p, build, model = gait._record_[0], gait._build, robot.model
    q[2] = build.height + higher
    feet = np.zeros((4, 3))
    gait.observe(hp.State(0.0, q, v, feet, feet, feet))
    gait.update(0.0)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    for k, foot in enumerate(robot.feet):
        knee = model.frames[robot.frame_id(foot)].parentJoint
        axis = data.oMi[
            model.parents[model.parents[knee]]
        ].translation  # about which the leg swings sideways
        for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
            p["footholds"]["place"][k, :2] = p["measured"]["centre"][:2] + 5.0 * np.array(
                (np.cos(angle), np.sin(angle))
            )
            _keep_in_reach(gait._record_[0], k, 0.0)
            place = np.array((*p["footholds"]["place"][k, :2], 0.0))
            # Beside the axis by d, a leg of length l reaches to √(l² + d²) from a point of it.
            thigh = data.oMi[model.parents[knee]].translation
            along = place - np.array((thigh[0], axis[1], thigh[2]))
            length = np.sqrt(along @ along - build.beside[k] ** 2)
            assert length < 0.99 * build.leg


@needs_robots
def test_a_late_foot_that_rests_has_landed_though_it_hardly_pushes():
    gait = hp.WalkingGait(hp.load_robot("solo12"), velocity=(0.3, 0.0, 0.0))
    p, t = gait.record[0], 0.0
    rests, free = made_state(gait, force=0.5 * float(p["pace"]["touch_force"])), made_state(gait)

    def late_after(given):
        nonlocal t
        t = 0.0
        while not (p["steps"]["in_air"].any() and p["steps"]["phase"] >= 1.0):
            gait.observe(free)
            gait.update(t)
            t += 1e-3
        ticks = 0
        while p["steps"]["in_air"].any() and p["steps"]["phase"] >= 1.0:
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
    gait.observe(made_state(gait))
    for command in np.random.default_rng(3).uniform(-1.5, 1.5, (50, 3)):
        gait.command[:3] = command
        gait.update(0.0)
        goal = gait.record[0]["planned"]["goal"][:3]
        assert np.hypot(goal[0], goal[1]) * abs(goal[2]) <= 1.0 + 1e-9
        np.testing.assert_allclose(np.cross(goal, command), 0.0, atol=1e-12)
    with pytest.warns(UserWarning, match="limited to"):
        hp.WalkingGait(gait.robot, velocity=(0.9, 0.0, 1.4))


@needs_robots
@pytest.mark.parametrize("start", long_but(range(4), (3,)))
def test_solo12_walks_fast_at_friction_three_tenths_in_mujoco(solo12, start):
    pytest.importorskip("mujoco")
    speed = hp.WalkingGait(solo12).max_speed
    velocity = np.random.default_rng([101, start]).normal(0.0, 0.02, 3)
    gait = hp.WalkingGait(solo12, velocity=((0.5, 0.99 * speed, 0.0, 0.0),))
    start = (*velocity.tolist(), 0.0, 0.0, 0.0)
    run = walk(gait, mu=0.3, plant="mujoco", start_velocity=start, duration=5.0)
    assert slip_per_step(run) < 0.5


@needs_robots
def test_a_walking_gait_says_to_what_it_limits_the_velocity(go2: hp.Robot) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        most = hp.WalkingGait(go2).max_speed
        hp.WalkingGait(go2, velocity=(most, 0.0, 0.0))
    for velocity in ((9.0, 0.0, 0.0), ((0.0, 0.1, 0.0, 0.0), (1.0, 9.0, 0.0, 0.0))):
        with pytest.warns(
            UserWarning, match=rf"velocity \(9, 0, 0\) .* limited to \({most:.3g}, 0, 0\)"
        ) as said:
            gait = hp.WalkingGait(go2, velocity=velocity)
        assert [warning.filename for warning in said] == [__file__]
        assert gait.max_speed == most


@needs_robots
def test_the_limit_in_the_warning_is_the_one_that_is_walked() -> None:
    gait = hp.Walking(velocity=(9.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="limited to") as said:
        run = hp.walk(hp.Scenario(robot="go2", gait=gait, duration=4.0))
    limited = float(str(said[0].message).partition("limited to (")[2].partition(",")[0])
    assert run["applied_velocity"][:, 0].max() == pytest.approx(limited, abs=0.005)


def test_commanded_harpy_says_so_too() -> None:
    with pytest.warns(UserWarning, match=r"velocity \(0, 3, 0\) .* limited to \(0, 0.2, 0\)"):
        hp.gaits.CommandedGait(hp.load_harpy(), ((0.0, 0.0, 3.0, 0.0),))


@needs_robots
def test_on_soles_the_largest_speed_falls_with_the_friction(g1):
    """Of a controller that assumes it; a speed that was given stays, and so does that of point
    feet.
    """
    fastest, aside = hp.WalkingGait(g1).max_speed, hp.WalkingGait(g1).max_aside
    for mu, share in ((0.9, 1.0), (0.6, 1.0), (0.3, 0.5), (0.1, 1.0 / 6.0)):
        controller = hp.make_controller("condensed", hp.WalkingGait(g1), mu=mu)
        assert controller.gait.max_speed == pytest.approx(
            max(share * fastest, 0.07 * np.sqrt(9.81 * controller.gait._build.leg))
        )
        assert controller.gait.max_aside == pytest.approx(share * aside)
        assert controller.gait.record["planned"]["max_turn"] == pytest.approx(2.0 * share)
    for given in (hp.WalkingGait(g1, max_speed=0.4), hp.WalkingGait(hp.load_robot("solo12"))):
        speed = given.max_speed
        given.expect_friction(0.3)
        assert given.max_speed == speed


@needs_robots
@pytest.mark.parametrize("name", ["g1", "talos", "icub"])
def test_on_slippery_ground_soles_stand_closer_and_hand_over_faster(name):
    """Bit by bit, never so close that they touch, and as before where the ground is firm again."""
    robot, gaits = hp.load_robot(name), [hp.WalkingGait(hp.load_robot(name)) for _ in range(2)]
    gaits[1].expect_friction(0.05)
    widths = [float(np.ptp(gaits[0]._build.point[gaits[0]._build.foot == k, 1])) for k in range(2)]
    apart, support = [], []
    for mu in (0.05, 0.1, 0.12, 0.15, 0.2, 0.6):
        for gait in gaits:
            gait.expect_friction(mu)
        np.testing.assert_array_equal(
            gaits[0]._record_["pace"]["nominal"], gaits[1]._record_["pace"]["nominal"]
        )
        apart.append(float(np.ptp(gaits[0]._record_["pace"]["nominal"][0][:, 1])))
        support.append(float(gaits[0]._record_["pace"]["slow_double_support"][0]))
    fresh = hp.WalkingGait(robot)._record_
    assert apart == sorted(apart)
    assert support == sorted(support)
    assert min(apart) > max(widths)
    assert apart[0] == apart[1] < apart[2] < apart[4]
    np.testing.assert_array_equal(gaits[0]._record_["pace"]["nominal"], fresh["pace"]["nominal"])
    assert support[-1] == fresh["pace"]["slow_double_support"][0]
