"""The URDF against the pantograph it stands for, in three readers; loading, and refusing to
load.
"""

import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin import RobotError

JOINTS = tuple(
    f"{side}_{joint}"
    for side in ("left", "right")
    for joint in ("hip_frontal", "hip_sagittal", "knee")
)
angle = st.floats(-np.pi, np.pi)
leg_angles = st.tuples(angle, angle, angle)
seeds = st.integers(0, 2**32 - 1)


def rot_x(a):
    return np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])


def rot_y(a):
    return np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])


def pantograph(side, angles):
    """Hip motor, knee motor and foot in the body frame; side is +1 on the left."""
    frontal, sagittal, knee = angles
    down = np.array([0.0, 0.0, -1.0])
    thigh = rot_y(sagittal) @ (0.3 * down)
    shin = rot_y(sagittal) @ rot_y(knee) @ (0.2 * down)
    tarsus = rot_y(sagittal) @ (0.2 * down)  # held parallel to the thigh
    hip = np.array([0.0, 0.1 * side, -0.1])
    hip_motor = np.array([0.0, 0.05 * side, 0.0])
    place = rot_x(frontal)
    knee_motor = hip_motor + thigh
    foot = knee_motor + shin + tarsus
    return [hip + place @ p for p in (hip_motor, knee_motor, foot)]


def configuration(left, right):
    q = np.zeros(13)
    q[6] = 1.0
    q[7:10], q[10:13] = left, right
    return q


def mirrored_q(q):
    """The configuration seen in the mirror y → −y."""
    x, y, z, qx, qy, qz, qw = q[:7]
    left, right = q[7:10], q[10:13]
    flip = np.array([-1.0, 1.0, 1.0])
    return np.concatenate(([x, -y, z, -qx, qy, -qz, qw], flip * right, flip * left))


def mirror_velocity():
    """Matrix of the mirror y → −y on generalised velocities (a reflected angular velocity is a
    pseudovector).
    """
    matrix = np.zeros((12, 12))
    matrix[:6, :6] = np.diag([1, -1, 1, -1, 1, -1])
    swap = np.diag([-1.0, 1.0, 1.0])
    matrix[6:9, 9:12] = swap
    matrix[9:12, 6:9] = swap
    return matrix


def test_pinocchio_reads_it(robot):
    assert (robot.model.nq, robot.model.nv) == (13, 12)
    assert robot.name == "harpy"
    assert robot.joints == JOINTS
    assert robot.feet == ("left_foot", "right_foot")
    assert robot.thrusters == ("left_thruster", "right_thruster")
    assert robot.thrust_limit == 53.0
    assert robot.mass == pytest.approx(4.0 + 2 * 0.01, abs=1e-12)


def test_masses_are_where_the_paper_has_them(robot):
    mass = {
        name: inertia.mass
        for name, inertia in zip(robot.model.names, robot.model.inertias, strict=True)
    }
    assert mass["root_joint"] == 2.0
    for side in ("left", "right"):
        assert mass[f"{side}_hip_frontal"] == 0.5
        assert mass[f"{side}_hip_sagittal"] == 0.5
        assert mass[f"{side}_knee"] == 0.01


def test_thrusters_are_mounted_as_in_the_paper(robot):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    for side, name in ((1, "left_thruster"), (-1, "right_thruster")):
        np.testing.assert_allclose(
            data.oMf[robot.frame_id(name)].translation, [0, 0.1 * side, 0], atol=1e-15
        )


def test_limits_and_armature_are_those_of_the_file(robot):
    root = ElementTree.parse(robot.urdf).getroot()
    for i, name in enumerate(robot.joints):
        joint = root.find(f"joint[@name='{name}']")
        limit, dynamics = joint.find("limit").attrib, joint.find("dynamics").attrib
        assert robot.joint_lower[i] == float(limit["lower"])
        assert robot.joint_upper[i] == float(limit["upper"])
        assert robot.torque_limit[i] == float(limit["effort"]) == 8.5
        assert robot.model.armature[6 + i] == float(dynamics["armature"]) > 0.0
        assert robot.model.damping[6 + i] == float(dynamics["damping"])
    np.testing.assert_array_equal(robot.model.armature[:6], 0.0)


@pytest.mark.parametrize(("given", "first"), [(' armature="0.125"', 0.125), ("", 0.0)])
def test_armature_follows_the_name_and_is_zero_where_it_is_missing(urdf_with, given, first):
    path = urdf_with(' armature="0.005"', given)
    np.testing.assert_array_equal(hp.load_harpy(path).model.armature[6:], [first, *[0.005] * 5])


@given(left=leg_angles, right=leg_angles)
def test_foot_is_the_pantographs_in_pinocchio(robot, left, right):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, configuration(left, right))
    for side, foot, angles in ((1, "left_foot", left), (-1, "right_foot", right)):
        np.testing.assert_allclose(
            data.oMf[robot.frame_id(foot)].translation,
            pantograph(side, angles)[2],
            rtol=0,
            atol=1e-12,
        )


@given(seed=seeds)
def test_kinetic_energy_is_that_of_the_pantographs_masses(robot, draw_state, seed):
    """With a massless lower leg, only body and motors move mass, and no foot enters: pantograph =
    serial chain.
    """
    q, v = draw_state(np.random.default_rng(seed))
    model = robot.model.copy()
    model.armature = np.zeros(12)
    for side in ("left", "right"):
        model.inertias[model.getJointId(f"{side}_knee")] = pin.Inertia.Zero()
    mass_matrix = pin.crba(model, model.createData(), q)

    linear, angular = v[:3], v[3:6]  # body axes: all of the energy can be written there
    motor = np.diag([0.000257, 0.000306, 0.000257])
    energy = 0.5 * 2.0 * linear @ linear + 0.5 * 0.2**2 / 6.0 * 2.0 * angular @ angular
    for side, at in ((1, 0), (-1, 3)):
        angles, rates = q[7 + at : 10 + at], v[6 + at : 9 + at]
        h = 1e-30
        for k in range(2):
            point = pantograph(side, angles)[k]
            relative = pantograph(side, angles + 1j * h * rates)[k].imag / h
            velocity = linear + np.cross(angular, point) + relative
            energy += 0.5 * 0.5 * velocity @ velocity
        hip_frame = rot_x(angles[0])
        thigh_frame = hip_frame @ rot_y(angles[1])
        hip_spin = angular + np.array([rates[0], 0.0, 0.0])
        thigh_spin = hip_spin + hip_frame @ np.array([0.0, rates[1], 0.0])
        for frame, spin in ((hip_frame, hip_spin), (thigh_frame, thigh_spin)):
            energy += 0.5 * spin @ frame @ motor @ frame.T @ spin
    assert 0.5 * v @ mass_matrix @ v == pytest.approx(energy, rel=1e-12)


@given(seed=seeds)
def test_left_and_right_are_mirror_images(robot, draw_state, seed):
    q, v = draw_state(np.random.default_rng(seed))
    model, mirror = robot.model, mirror_velocity()
    one, two = model.createData(), model.createData()
    m_one, m_two = pin.crba(model, one, q), pin.crba(model, two, mirrored_q(q))
    np.testing.assert_allclose(m_two, mirror @ m_one @ mirror.T, atol=1e-13)
    np.testing.assert_allclose(
        pin.nonLinearEffects(model, two, mirrored_q(q), mirror @ v),
        mirror @ pin.nonLinearEffects(model, one, q, v),
        atol=1e-11,
    )
    pin.framesForwardKinematics(model, one, q)
    pin.framesForwardKinematics(model, two, mirrored_q(q))
    for name, other in (("left_foot", "right_foot"), ("right_thruster", "left_thruster")):
        here, there = (
            one.oMf[robot.frame_id(name)].translation,
            two.oMf[robot.frame_id(other)].translation,
        )
        np.testing.assert_allclose(there, here * [1, -1, 1], atol=1e-14)


def test_left_and_right_have_the_same_limits(robot):
    assert robot.joint_lower[0] == -robot.joint_upper[3]
    assert robot.joint_upper[0] == -robot.joint_lower[3]
    np.testing.assert_array_equal(robot.joint_lower[1:3], robot.joint_lower[4:6])
    np.testing.assert_array_equal(robot.joint_upper[1:3], robot.joint_upper[4:6])
    np.testing.assert_array_equal(robot.torque_limit[:3], robot.torque_limit[3:])


def test_truncations_are_refused_in_silence(robot, tmp_path, capfd):
    content = robot.urdf.read_bytes()
    path = tmp_path / "cut.urdf"
    whole = len(content.rstrip())
    path.write_bytes(content)
    for length in range(whole - 1, -1, -3):
        os.truncate(path, length)
        with pytest.raises(RobotError):
            hp.load_harpy(path)
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err == ""
