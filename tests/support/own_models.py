"""MuJoCo models of the catalogue's robots as users have them: MuJoCo's own reading of the URDF."""

import xml.etree.ElementTree as ET

import pytest

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra")


def give(thing, **values):
    """Set several attributes."""
    for name, value in values.items():
        setattr(thing, name, value)


def described(robot, *, foot_radius=0.02, actuators="", joints=None):
    """A ``MjSpec`` of the URDF without shapes, with a free joint, a plane, and a sphere at every
    foot; with an actuator of a kind (``motor``, ``position`` or ``velocity``) in each joint, and
    attributes of all joints, if given.
    """
    root = ET.parse(robot.urdf).getroot()
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(
        options, "compiler", fusestatic="false", balanceinertia="true", discardvisual="true"
    )
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for number, body in enumerate(spec.worldbody.bodies):
        if number == 0:
            body.add_freejoint()
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), pos=(0, 0, -foot_radius)
    )
    for foot in robot.feet:
        spec.body(foot).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(foot_radius, 0, 0))
    for name in robot.joints:
        for attribute, value in (joints or {}).items():
            setattr(spec.joint(name), attribute, value)
        if actuators:
            actuator = spec.add_actuator(
                name=f"of {name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            actuator.gear[0] = 3.0
            gains = {"motor": {}, "position": {"kp": 40.0, "kv": 1.0}, "velocity": {"kv": 2.0}}[
                actuators
            ]
            getattr(actuator, f"set_to_{actuators}")(**gains)
    return spec


def own_model(robot, *, prefix="", foot_radius=0.02):
    """The same as a ``MjModel``, without actuators; ``prefix`` is before the names of the
    joints.
    """
    spec = described(robot, foot_radius=foot_radius)
    if prefix:
        for joint in spec.joints:
            joint.name = prefix + joint.name
    return spec.compile()
