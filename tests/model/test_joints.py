"""Armature, damping and dry friction of joints as they are known: in the model, in torques, and in
both plants.
"""

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots
from walks import own_search, started

import harpy_pin as hp
from harpy_pin.simulation import PinocchioPlant
from harpy_pin.simulation.mujoco import MujocoPlant

WITHOUT = {"armature": 0.0, "damping": 0.0, "friction": 0.0}
KNOWN = {"armature": 0.02, "damping": 0.3, "friction": 0.4}
KNEE = 0.3


def moving(robot, seed=0):
    """A state near standing, with all joints moving."""
    rng = np.random.default_rng(seed)
    q, v = hp.Standing(robot).initial_state(penetration=0.003)
    v[:] = 0.3 * rng.normal(size=len(v))
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    force = np.tile((0.0, 0.0, 9.81 * robot.mass / len(robot.feet)), (len(robot.feet), 1))
    return hp.State(0.0, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force)


def controller(name, robot, **more):
    gait = hp.Standing(robot)
    return hp.make_controller(name, gait, mu=0.6, **own_search(name), **more)


@needs_robots
def test_the_armature_is_that_of_a_copy():
    plain, rng = hp.load_robot("go2"), np.random.default_rng(1)
    armature = rng.uniform(0.0, 0.1, 12)
    robot = plain.with_joints(armature=armature)
    np.testing.assert_array_equal(plain.model.armature, 0.0)
    np.testing.assert_array_equal(robot.model.armature, [*[0.0] * 6, *armature])


@needs_robots
@pytest.mark.parametrize("name", ["condensed", "wbc"])
@pytest.mark.parametrize("which", ["go2", "solo12"])
def test_torques_overcome_the_friction_and_nothing_else_changes(name, which):
    robot = hp.load_robot(which).with_joints(**WITHOUT)
    size = len(robot.joints)
    damping, friction = np.linspace(0.1, 0.5, size), np.linspace(0.6, 0.2, size)
    state = moving(robot)
    plain = controller(name, robot).step(state)
    known = controller(name, robot.with_joints(damping=damping, friction=friction)).step(state)
    speed = state.v[6:]
    more = damping * speed + friction * np.tanh(speed / KNEE)
    np.testing.assert_allclose(
        known.torque - plain.torque, more, atol=1e-6 * abs(plain.torque).max()
    )
    assert abs(more).max() > 0.1


@needs_robots
@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_torque_limits_hold_with_friction(name):
    robot = hp.load_robot("go2").with_joints(friction=3.0)
    free = abs(controller(name, robot).step(moving(robot)).torque).max()
    robot.model.effortLimit = np.full(18, 0.8 * free)
    limited = abs(controller(name, robot).step(moving(robot)).torque).max()
    assert limited == pytest.approx(0.8 * free, rel=1e-6)


@pytest.mark.parametrize("plant", [hp.Simulator, PinocchioPlant, MujocoPlant])
def test_plants_have_these_joints(plant):
    """A joint with dry friction holds under a smaller torque; one without does not."""
    if plant is MujocoPlant:
        pytest.importorskip("mujoco")
    friction = np.array([0.0, 0.5, 0.5, 0.0, 0.0, 0.0])
    robot = hp.load_harpy().with_joints(friction=friction)
    place = plant(robot, gravity=(0.0, 0.0, 0.0))
    q = pin.neutral(robot.model)
    q[2] = 2.0
    q[7:] = 0.5 * (robot.model.lowerPositionLimit + robot.model.upperPositionLimit)[7:]
    place.reset(q, np.zeros(12))
    place.advance(hp.Command(np.full(6, 0.1), np.zeros((2, 3))), steps=100)
    moved = abs(place.q[7:] - q[7:])
    assert moved[friction == 0.0].min() > 3e-3
    assert moved[friction > 0.0].max() < (
        1e-9 if plant is hp.Simulator else 1e-3
    )  # that of the others creeps


@needs_robots
@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_a_walk_with_known_joints_slips_less(go2, name):
    slip = []
    for believed in (go2.with_joints(**KNOWN), go2):
        gait = hp.WalkingGait(believed, velocity=[(0.0, 0.4, 0.0, 0.2)])
        plant = started(MujocoPlant(go2.with_joints(**KNOWN), hp.Ground(mu_s=0.5)), gait)
        slip.append(
            hp.measure(
                plant.run(hp.make_controller(name, gait, mu=0.45, **own_search(name)), 2.0)
            ).slip_mm_per_step
        )
    assert slip[0] < 0.5
    assert slip[1] > 4.0 * slip[0]


@needs_robots
def test_friction_of_a_file_is_read_and_that_of_the_catalogue_is_not():
    go1 = hp.load_robot("go1")
    np.testing.assert_array_equal(go1.dry_friction, 0.0)
    np.testing.assert_array_equal(hp.load_robot(go1.urdf, feet=go1.feet).dry_friction, 0.2)
