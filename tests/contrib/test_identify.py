"""Joints identified from logs that MuJoCo made, and what is said of logs that are wrong."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from comparison.worlds.hung import PERIOD, Hidden, hang, hidden, logged
from harpy_pin.contrib.identify import equations, excitation, identify
from harpy_pin.contrib.identify.signals import Half, Samples
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.known_joints import KnownJoints
from harpy_pin.model.robot import harpy_urdf

mujoco = pytest.importorskip("mujoco")
SECONDS = 16.0
NUMBERS = ("torque_scale", "armature", "damping", "friction")


@pytest.fixture(scope="module")
def robot() -> hp.Robot:
    return hp.load_harpy()


@pytest.fixture(scope="module")
def plan(robot):
    return excitation(robot, duration=SECONDS)


@pytest.fixture(scope="module")
def truth(robot, plan) -> Hidden:
    return hidden(robot, np.random.default_rng(3), np.abs(plan.torque).max(axis=0))


@pytest.fixture(scope="module")
def log(robot, plan, truth):
    """MuJoCo reads the URDF itself, with the base fixed to the world."""
    model = hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot)
    return logged(model, truth, plan, np.random.default_rng(4))


@pytest.fixture
def copy(log):
    return {name: part.copy() for name, part in log.items()}


def test_joints_are_found(robot, log, truth):
    found = identify(robot, log)
    assert found.status == ()
    assert sum(found.excited[name].sum() for name in NUMBERS) > 0.5 * len(NUMBERS) * len(
        robot.joints
    )
    for name in NUMBERS:
        known = found.excited[name]
        assert getattr(found, name)[known] == pytest.approx(getattr(truth, name)[known], rel=0.1)
    assert found.delay == pytest.approx(truth.delay + 0.5 * PERIOD, abs=5e-4)
    assert np.all(found.left < 0.2)


def test_commands_and_gains_alone(robot, plan, truth):
    model = hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot)
    found = identify(robot, logged(model, truth, plan, np.random.default_rng(5), law=True))
    for name in NUMBERS:
        known = found.excited[name]
        assert getattr(found, name)[known] == pytest.approx(getattr(truth, name)[known], rel=0.1)
    assert found.delay == pytest.approx(truth.delay + 0.5 * PERIOD, abs=1e-3)


def test_the_plan_keeps_the_limits(robot, plan):
    assert np.all(plan.q > robot.joint_lower)
    assert np.all(plan.q < robot.joint_upper)
    assert np.gradient(plan.q, plan.t, axis=0)[1:-1] == pytest.approx(plan.v[1:-1], abs=0.02)
    assert plan.condition < 100.0
    assert plan.command(5).law[0] == pytest.approx(plan.q[5])


def test_a_joint_at_rest_is_not_known(robot, copy):
    copy["q"][:, 2] = copy["q"][0, 2]
    found = identify(robot, copy)
    assert np.isnan(found.armature[2])
    assert not found.excited["armature"][2]
    assert any(robot.joints[2] in line and "hardly moves" in line for line in found.status)


@pytest.mark.parametrize("what", ["sign", "swapped", "degrees", "saturated", "gaps", "nonsense"])
def test_a_wrong_log_is_named(robot, copy, what):
    """And no inertia or friction is ever negative."""
    torque, said = (
        copy["torque"],
        {"sign": "wrong sign", "swapped": "of another joint", "degrees": "another unit"},
    )
    if what == "sign":
        torque[:, 1] *= -1.0
    elif what == "swapped":
        torque[:, [1, 2]] = torque[:, [2, 1]]
    elif what == "degrees":
        copy["q"] = np.rad2deg(copy["q"])
    elif what == "saturated":
        size = 0.6 * np.abs(torque).max(axis=0)
        copy["torque"] = np.clip(torque, -size, size)
    elif what == "gaps":
        kept = np.ones(len(copy["t"]), bool)
        kept[1000:1300] = False
        copy = {name: part[kept] for name, part in copy.items()}
        copy["q"][50, 1] = np.nan
    else:
        copy["torque"] = np.random.default_rng(0).standard_normal(torque.shape)
    found = identify(robot, copy)
    line = {**said, "saturated": "at its limit", "gaps": "gaps", "nonsense": "does not explain"}[
        what
    ]
    assert any(line in one for one in found.status), found.status
    for name in ("armature", "damping", "friction"):
        assert not np.any(getattr(found, name) < 0.0)


def test_found_joints_go_into_the_robot(robot, log, tmp_path):
    found = identify(robot, log)
    file = tmp_path / "joints.json"
    found.save(file)
    known, read = (
        robot.with_joints(found),
        hp.load_robot(harpy_urdf(), feet=robot.feet, thrusters=robot.thrusters, joints=file),
    )
    for name in ("armature", "damping"):
        value = getattr(found, name)
        expected = np.where(np.isnan(value), getattr(robot.model, name)[6:], value)
        assert getattr(known.model, name)[6:] == pytest.approx(expected)
        assert getattr(read.model, name) == pytest.approx(getattr(known.model, name))
    assert read.dry_friction == pytest.approx(known.dry_friction)
    (tmp_path / "bad.json").write_text(json.dumps({"joints": 3}))
    with pytest.raises(RobotError, match="no joints in"):
        hp.load_robot(harpy_urdf(), feet=robot.feet, joints=tmp_path / "bad.json")
    with pytest.raises(InputError, match="another robot"):
        hp.load_robot(harpy_urdf(), feet=()).with_joints(KnownJoints(("a",), *np.full((3, 1), 0.1)))


def test_what_is_missing_is_said(robot, log):
    with pytest.raises(InputError, match="torque"):
        identify(robot, {"t": log["t"], "q": log["q"]})
    with pytest.raises(InputError, match="apart"):
        identify(robot, {name: part[::50] for name, part in log.items()})
    with pytest.raises(InputError, match="q must have"):
        identify(robot, {**log, "q": log["q"][:, 1:]})


def test_forces_of_feet_drop_out(robot):
    """Rows of a standing robot: any forces at the stance feet leave select · τ as it is."""
    rng, model = np.random.default_rng(0), equations.rigid(robot)
    data, q = (
        model.createData(),
        pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)),
    )
    v, a = rng.standard_normal((2, model.nv))
    # Any forces; the base's acceleration is the one that goes with them.
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    stack = [
        pin.getFrameJacobian(model, data, robot.frame_id(f), pin.LOCAL_WORLD_ALIGNED)[:3]
        for f in robot.feet
    ]
    pushed = np.concatenate(stack).T @ rng.standard_normal(3 * len(robot.feet))
    inertia = pin.crba(model, data, q)[:6, :6]
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    a[:6] += np.linalg.solve(inertia, (pushed - pin.rnea(model, data, q, v, a))[:6])
    rest = pin.rnea(model, data, q, v, a) - pushed
    assert rest[:6] == pytest.approx(0.0, abs=1e-9)
    none, on = np.zeros((1, 6)), np.ones((1, 2), bool)
    base = q[None, :7], v[None, :6], a[None, :6]
    half = Half(np.zeros(1), q[None, 7:], v[None, 6:], a[None, 6:], none, none, base, ())
    samples = Samples(half.t, (half, half), none > 0.0, none > 0.0, on, np.ones(1, bool))
    rows = equations.standing_rows(robot, samples)
    assert rows.select @ rest[6:] == pytest.approx(rows.known[0], abs=1e-9)
    assert rows.payload.shape == (2, len(rows.sample), 4)
