"""How fast a robot walks: torques of swinging legs beside statics, the pendulum's reaction beside momentum, and a trot
at two metres per second in both plants."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.gaits.walking.motors import fastest_speed, swing_load
from harpy_pin.gaits.walking.settings import build_of

pytestmark = needs_robots


def go2():
    robot = hp.load_robot("go2")
    q, _ = hp.Standing(robot).initial_state()
    return robot, q, build_of(robot, q)


def test_a_leg_that_does_not_move_needs_the_torque_of_its_weight():
    robot, q, build = go2()
    load = swing_load(robot, q, build, 0.0, 0.2, 0.1, 0.0)
    weight = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q)[6:]
    assert load == pytest.approx(np.max(np.abs(weight) / robot.model.effortLimit[6:]), rel=1e-6)


def test_torques_of_a_swing_without_weight_grow_with_the_square_of_its_rate():
    robot, q, build = go2()
    robot.model.gravity.linear = np.zeros(3)
    slow, fast = swing_load(robot, q, build, 1.0, 0.2, 0.1, 0.03), swing_load(robot, q, build, 2.0, 0.1, 0.1, 0.03)
    assert fast == pytest.approx(4.0 * slow, rel=1e-6)


@pytest.mark.parametrize(("most", "speed"), [(9.0, 3.0), (4.0, 2.0), (1e-9, 0.0)])
def test_fastest_speed_is_where_the_load_is_reached(most, speed):
    found = fastest_speed(lambda v: v * v, 3.0, most)
    assert found == pytest.approx(speed, abs=3.0 / 2**7)
    assert found**2 <= most


def test_reaction_is_the_momentum_that_a_moving_foot_gives_the_pendulum():
    robot, q, build = go2()
    model, data = robot.model, robot.model.createData()
    for k, name in enumerate(robot.feet):
        v = np.zeros(model.nv)
        v[6 + 3 * k : 9 + 3 * k] = 0.3, -0.7, 0.9
        foot = pin.computeFrameJacobian(model, data, q, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[:3] @ v
        momentum = pin.computeCentroidalMomentum(model, data, q, v).np / robot.mass
        wanted = (momentum[0] + momentum[4] / build.rise, momentum[1] - momentum[3] / build.rise)
        np.testing.assert_allclose(build.reaction[k] @ foot, wanted, atol=1e-12)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_go2_trots_at_two_metres_per_second_with_shorter_steps(plant):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    robot = hp.load_robot("go2")
    gait = hp.WalkingGait(robot, velocity=(2.0, 0.0, 0.0), max_speed=2.0)
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters=gait.parameters),
        ground=hp.Ground(mu_s=0.8, stiffness=robot.mass * 9.81 / 2e-3),
        duration=4.0,
        plant=plant,
    )
    run = hp.walk(scenario, gait=gait)
    last = run["t"] > 3.0
    assert run.ending == "completed"
    assert np.mean(run["centre"][last, 3]) == pytest.approx(2.0, abs=0.1)
    assert np.ptp(run["steps"][last]) > 1.3 * 1.0 / gait.step_duration


@pytest.mark.parametrize("name", ["anymal_b", "anymal_c", "solo12"])
def test_legs_of_a_bound_reach_their_feet_at_its_largest_speed(name):
    """By the leg's own geometry: from the hip of the posture to where the foot is when it leaves the ground."""
    robot = hp.load_robot(name)
    gait = hp.WalkingGait(robot, schedule="bound")
    build = build_of(robot, hp.Standing(robot).initial_state()[0])
    apart = build.place[:, :2] - build.place[:, :2].mean(axis=0)
    behind = 0.5 * gait.max_speed * (1.0 + gait.double_support) * gait.step_duration
    hip = build.reach**2 - (0.98 * build.leg) ** 2  # minus its squared height
    for drawn in np.linalg.norm(apart - gait.record["nominal"][0], axis=1):
        assert np.sqrt((drawn + behind) ** 2 - hip) < 0.97 * build.leg


def test_anymal_b_bounds_as_fast_as_its_legs_reach():
    robot = hp.load_robot("anymal_b")
    with pytest.warns(UserWarning, match="limited"):
        gait = hp.WalkingGait(robot, schedule="bound", velocity=((0.3, 0.45, 0.0, 0.0),))
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters=gait.parameters),
        ground=hp.Ground(mu_s=0.5, stiffness=robot.mass * 9.81 / 2e-3),
        duration=6.0,
    )
    run = hp.walk(scenario, gait=gait)
    assert run.ending == "completed"
    assert run["centre"][-1, 0] > 5.0 * 0.9 * gait.max_speed
