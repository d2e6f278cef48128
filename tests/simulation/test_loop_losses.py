"""Damping and dry friction of joints without a motor, in plants and under a controller."""

from __future__ import annotations

import numpy as np
import pytest
from looped_robots import frame, joint, link, rubbing, written

import harpy_pin as hp
from harpy_pin.simulation.mujoco import MujocoPlant

FRICTION = 0.2


@pytest.fixture
def linkage(tmp_path):
    """A parallelogram on a base, whose joints without a motor have dry friction: they turn by
    −1 and 1 times the angle of its motor.
    """
    parts = [
        link("base", 2.0),
        link("one", 0.2),
        joint("a", "base", "one", (0.1, 0.0, 0.0)),
        link("two", 0.2),
        joint("b", "one", "two", (0.0, 0.0, -0.2), effort=0.0),
        link("three", 0.2),
        joint("c", "base", "three", (-0.1, 0.0, 0.0), effort=0.0),
        frame("p", "two", (-0.2, 0.0, 0.0)),
        frame("r", "three", (0.0, 0.0, -0.2)),
    ]
    path = written(tmp_path, "linkage", parts)
    text, told = path.read_text(), 'damping="0" armature="0.0"'
    assert text.count(told) == 2
    path.write_text(text.replace(told, f'damping="0" friction="{FRICTION}"'))
    return hp.load_robot(path, feet=(), loops=[("p", "r", "point")])


def moved(plant, torque, duration):
    """Velocity of the motor after a torque from rest."""
    plant.reset(plant.robot.neutral, np.zeros(plant.robot.nv))
    command = hp.Command(np.array([torque]), np.zeros((0, 3)))
    plant.advance(command, steps=round(duration / plant.dt))
    return plant.v[6]


def test_dry_friction_of_passive_joints_holds_a_linkage(linkage):
    """Up to the sum of both, as they turn as fast as the motor; beyond, the rest accelerates it."""
    plant = hp.Simulator(linkage, dt=1e-4, gravity=(0.0, 0.0, 0.0))
    for torque in (-0.39, 0.2, 0.39):
        assert abs(moved(plant, torque, 0.05)) < 1e-12
    plant.reset(linkage.neutral, np.zeros(linkage.nv))
    inertia = 1.0 / np.linalg.inv(plant.dynamics.mass_matrix)[6, 6]
    for torque in (-0.6, 0.6):
        expected = (torque - np.sign(torque) * 2.0 * FRICTION) / inertia * 0.01
        assert moved(plant, torque, 0.01) == pytest.approx(expected, rel=1e-3)


def test_mujocos_plant_has_the_same_friction(linkage):
    """It creeps under a torque that it holds."""
    pytest.importorskip("mujoco")
    ours = hp.Simulator(linkage, dt=1e-4, gravity=(0.0, 0.0, 0.0))
    theirs = MujocoPlant(linkage, dt=1e-4, gravity=(0.0, 0.0, 0.0))
    assert abs(moved(theirs, 0.3, 0.02)) < 0.02 * abs(moved(theirs, 1.0, 0.02))
    for torque in (-0.8, 0.6):
        expected = moved(ours, torque, 0.02)
        assert moved(theirs, torque, 0.02) == pytest.approx(expected, rel=0.02)


def test_a_controller_knows_the_friction_of_passive_joints(tmp_path):
    """The torques of one state differ by the power that friction takes."""
    torque = {}
    for friction in (0.0, FRICTION):
        robot = rubbing(tmp_path, damping=0.0, friction=friction)
        gait = hp.Standing(robot)
        controller = hp.make_controller("condensed", gait, mu=0.6)
        q, v = gait.initial_state()
        v[6:] = 3.0 * np.resize([1.0, -1.0, 0.5], robot.nv - 6)  # as fast as friction is whole
        dynamics = hp.Dynamics(robot)
        dynamics.update(q, v)
        share = np.array([0.25 * robot.mass * 9.81 * np.eye(3)[2]] * 2)
        place, moving = dynamics.foot_position, dynamics.foot_velocity
        controller.step(hp.State(0.0, q, v, place, moving, share))
        torque[friction] = controller.dynamics.bias.copy()
    speed = robot.velocity_map(q) @ v
    passive = [robot.model.joints[j].idx_v for j in robot.loops.passive]
    power = FRICTION * np.abs(speed[passive] * np.tanh(speed[passive] / 0.3)).sum()
    assert (torque[FRICTION] - torque[0.0]) @ v == pytest.approx(power, rel=1e-9)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_a_biped_with_rubbing_linkages_walks(tmp_path, plant):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    robot = rubbing(tmp_path, damping=0.3, friction=FRICTION)
    gait = hp.WalkingGait(robot, velocity=(0.15, 0.0, 0.0))
    run = hp.walk(hp.Scenario(controller="condensed", plant=plant, duration=3.0), gait=gait)
    assert run.ending == "completed"
