"""Talos by placo's plan: what placo is given, and the joint PD that follows the plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

from comparison.peers.environment import default_folder, interpreter
from comparison.peers.worker import WorkerError
from comparison.walkers.pattern import Follower, Pattern, named_feet, planned
from comparison.walkers.soles import PLANNED, SolesWalk, _steps, soles_walked, soles_walks
from harpy_pin import Ground, Scenario, Walking, load_robot, walk

pytestmark = needs_robots


def test_placo_gets_the_same_robot_with_names_for_trunk_and_soles():
    robot = load_robot("talos")
    text, places = named_feet(robot)
    named = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    assert pin.computeTotalMass(named) == pytest.approx(robot.mass)
    q, data, ours = pin.neutral(named), named.createData(), robot.model.createData()
    q[7:] = robot.posture
    pin.framesForwardKinematics(named, data, q)
    pin.framesForwardKinematics(robot.model, ours, q)
    corners = np.array([ours.oMf[robot.frame_id(name)].translation for name in robot.feet]).reshape(2, 4, 3)
    for name, place, sole in zip(("left_foot", "right_foot"), places, corners, strict=True):
        frame = data.oMf[named.getFrameId(name)]
        np.testing.assert_allclose(frame.translation, sole.mean(axis=0), atol=1e-9)
        np.testing.assert_allclose(frame.translation, place, atol=1e-9)
        np.testing.assert_allclose(frame.rotation, np.eye(3), atol=1e-9)  # upright where the sole is level
    np.testing.assert_allclose(data.oMf[named.getFrameId("trunk")].translation, 0.0, atol=1e-12)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_a_plan_that_stands_is_stood(plant):
    robot = load_robot("talos")
    if plant == "mujoco":
        pytest.importorskip("mujoco", reason="MuJoCo is an extra")
    ground = Ground(mu_s=0.6, stiffness=robot.mass * 9.81 / 2e-3)
    scenario = Scenario(robot="talos", controller="condensed", plant=plant, gait=Walking(), ground=ground, duration=0.4)
    q = pin.neutral(robot.model)
    q[7:] = robot.posture
    plan = {"q": np.tile(q, (50, 1)), "share": np.full(50, 0.5), "com": np.zeros((50, 3))}
    run = walk(scenario, controller=lambda gait: Follower(gait, plan, Pattern()))
    assert run.ending == "completed"
    assert np.abs(run["q"][:, 7:] - robot.posture).max() < 0.01
    assert run["foot_force"][-1, :, 2].sum() == pytest.approx(9.81 * robot.mass, rel=0.05)
    assert np.abs(run["v"][-1]).max() < 0.1


def test_both_walk_the_same():
    jobs = list(soles_walks(pushes=1, duration=6.0, seed=3))
    assert [replace(job, walker=PLANNED) for job in jobs if job.walker == "condensed"] == jobs[: len(jobs) // 2]
    pushes = np.array([job.push[1:] for job in jobs if job.what.endswith("pushed")])
    np.testing.assert_allclose(pushes.sum(axis=0), 0.0, atol=1e-9)


def test_steps_are_counted_by_the_foot_that_is_off_the_ground():
    assert _steps(np.array([0.5, 0.8, 1.0, 1.0, 1.0, 0.6, 0.2, 0.0, 0.0, 0.4, 0.9, 1.0, 0.7, 0.5])) == 3
    assert _steps(np.full(5, 0.5)) == 1


def test_without_placo_there_is_no_plan(tmp_path):
    with pytest.raises(WorkerError, match="peers --install"):
        planned(load_robot("talos"), tmp_path, Pattern(), speed=0.2, duration=2.0)


@pytest.mark.long
def test_placo_plans_a_walk():
    if not interpreter(default_folder(), "placo").exists():
        pytest.skip("placo is not installed")
    job = SolesWalk(what="look", walker=PLANNED, plant="compliant", friction=0.8, speed=0.2, duration=2.0)
    assert not soles_walked(job, default_folder())["fell"]
