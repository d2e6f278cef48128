"""States to and from MuJoCo's own model of a robot's URDF: places and velocities of bodies, forces of contacts."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra")

from needs import needs_robots  # noqa: E402

import harpy_pin as hp  # noqa: E402
from harpy_pin.simulation.mujoco import Conventions  # noqa: E402

pytestmark = needs_robots


def own_model(robot, *, prefix="", foot_radius=0.02):
    """MuJoCo's reading of the URDF without shapes, with a free joint, a plane, and a sphere at every foot."""
    root = ET.parse(robot.urdf).getroot()
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(options, "compiler", fusestatic="false", balanceinertia="true", discardvisual="true")
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for number, body in enumerate(spec.worldbody.bodies):
        if number == 0:
            body.add_freejoint()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), pos=(0, 0, -foot_radius))
    for foot in robot.feet:
        spec.body(foot).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(foot_radius, 0, 0))
    if prefix:
        for joint in spec.joints:
            joint.name = prefix + joint.name
    return spec.compile()


def random_state(robot, seed):
    rng = np.random.default_rng(seed)
    q = pin.neutral(robot.model)
    q[:3] = rng.normal(size=3)
    q[3:7] = rng.normal(size=4)
    q[3:7] /= np.linalg.norm(q[3:7])
    q[7:] = rng.uniform(-1.0, 1.0, robot.model.nq - 7)
    v = rng.normal(size=robot.model.nv)
    feet = np.zeros((len(robot.feet), 3))
    return hp.State(0.7, q, v, feet, feet.copy(), feet.copy())


@pytest.mark.parametrize("name", ["go2", "solo12"])
@pytest.mark.parametrize("seed", [0])
def test_feet_are_where_mujoco_has_them(name, seed):
    robot = hp.load_robot(name)
    model = own_model(robot)
    data = mujoco.MjData(model)
    state = random_state(robot, seed)
    Conventions(model, robot).write(state, data)
    mujoco.mj_forward(model, data)
    back = Conventions(model, robot).read(data)
    assert back.t == 0.7
    np.testing.assert_allclose(back.q[:3], state.q[:3])
    sign = np.sign(back.q[3:7] @ state.q[3:7])
    np.testing.assert_allclose(sign * back.q[3:7], state.q[3:7], atol=1e-12)
    np.testing.assert_allclose(back.q[7:], state.q[7:])
    np.testing.assert_allclose(back.v, state.v, atol=1e-12)
    velocity = np.zeros(6)
    for k, foot in enumerate(robot.feet):
        body = model.body(foot).id
        np.testing.assert_allclose(back.foot_position[k], data.xpos[body], atol=1e-6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
        np.testing.assert_allclose(back.foot_velocity[k], velocity[3:], atol=1e-6)


def test_contacts_are_forces_of_the_feet():
    """After some steps on the plane, they add up to what MuJoCo's constraints do to the base."""
    robot = hp.load_robot("go2")
    model = own_model(robot)
    data = mujoco.MjData(model)
    q, v = hp.Standing(robot).initial_state(penetration=0.003)
    feet = np.zeros((4, 3))
    Conventions(model, robot).write(hp.State(0.0, q, v, feet, feet.copy(), feet.copy()), data)
    for _ in range(20):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    state = Conventions(model, robot).read(data)
    assert np.all(state.foot_force[:, 2] > 1.0)
    np.testing.assert_allclose(state.foot_force.sum(axis=0), data.qfrc_constraint[:3], atol=1e-6)


def test_a_controller_of_ours_holds_a_robot_in_ones_own_simulation():
    """The loop of the documentation: MuJoCo's model of the user's own, and the condensed controller."""
    robot = hp.load_robot("go2")
    model = own_model(robot)
    model.opt.timestep = 1e-3
    data = mujoco.MjData(model)
    gait = hp.Standing(robot)
    controller = hp.make_controller("condensed", gait, mu=0.6)
    q, v = gait.initial_state()
    feet = np.zeros((4, 3))
    Conventions(model, robot).write(hp.State(0.0, q, v, feet, feet.copy(), feet.copy()), data)
    places = [int(model.joint(name).dofadr[0]) for name in robot.joints]
    for _ in range(500):
        mujoco.mj_forward(model, data)
        command = controller.step(Conventions(model, robot).read(data))
        data.qfrc_applied[places] = command.torque
        mujoco.mj_step(model, data)
    assert data.qpos[2] == pytest.approx(q[2], abs=0.02)


def test_prefixes_do_not_count_and_what_is_missing_is_said():
    robot, other = hp.load_robot("go2"), hp.load_robot("solo12")
    model = own_model(robot, prefix="dog/")
    data = mujoco.MjData(model)
    state = random_state(robot, 0)
    Conventions(model, robot).write(state, data)
    np.testing.assert_allclose(Conventions(model, robot).read(data).q[7:], state.q[7:])
    with pytest.raises(hp.InputError, match="joint of the MuJoCo model"):
        Conventions(model, other).read(data)
    fixed = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    with pytest.raises(hp.InputError, match="free joint"):
        Conventions(fixed, robot)
