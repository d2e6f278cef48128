"""The bridge into a MuJoCo simulation of one's own: forces, torques, laws, differences, and other
robots' models.
"""

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots
from own_models import described, give, mujoco, own_model

import harpy_pin as hp
from harpy_pin import InputError, MujocoBridge

pytestmark = needs_robots
FEET = np.zeros((4, 3))
JOINTS = {"armature": 0.02, "damping": [0.3, 0.0, 0.0], "frictionloss": 0.4}
BOX, SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE


def moving(bridge, data, *, height=0.0, seed=0):
    """Put the robot near standing, its joints moving."""
    q, v = hp.Standing(bridge.robot).initial_state(penetration=-height)
    v[6:] = np.random.default_rng(seed).normal(size=len(v) - 6)
    bridge.place(hp.State(0.2, q, v, FEET, FEET, FEET), data)
    mujoco.mj_forward(bridge.model, data)


def random_state(robot, seed):
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, pin.neutral(robot.model), rng.normal(size=robot.model.nv))
    return hp.State(0.7, q, rng.normal(size=robot.model.nv), FEET, FEET, FEET)


@pytest.mark.parametrize("cone", [mujoco.mjtCone.mjCONE_PYRAMIDAL, mujoco.mjtCone.mjCONE_ELLIPTIC])
def test_at_rest_the_feet_carry_the_weight(go2, cone):
    spec = described(go2, actuators="motor")
    spec.option.cone = cone
    bridge = MujocoBridge(spec.compile(), go2)
    data, gait = mujoco.MjData(bridge.model), hp.Standing(go2)
    controller = hp.make_controller("condensed", gait, mu=0.6, period=0.002)
    bridge.place(hp.State(0.0, *gait.initial_state(), FEET, FEET, FEET), data)
    for _ in range(500):
        mujoco.mj_step1(bridge.model, data)
        bridge.write(controller.step(bridge.read(data)), data)
        mujoco.mj_step2(bridge.model, data)
    state = bridge.read(data)
    np.testing.assert_allclose(bridge.foot_radius, 0.02)
    np.testing.assert_allclose(state.foot_force.sum(axis=0), data.qfrc_constraint[:3], atol=1e-9)
    np.testing.assert_allclose(state.foot_force.sum(axis=0), [0.0, 0.0, 9.81 * go2.mass], atol=1.5)
    assert state.foot_force[:, 2].min() > 0.15 * 9.81 * go2.mass


def test_a_shank_near_the_foot_is_the_foot_and_a_knee_is_not(go2):
    spec = described(go2, actuators="motor")
    for leg in ("FL", "FR", "RL", "RR"):  # a second contact under each foot
        spec.body(f"{leg}_calf").add_geom(type=SPHERE, size=(0.0199, 0, 0), pos=(0, 0, -0.213))
    spec.body("FL_calf").add_geom(name="knee", type=SPHERE, size=(0.03, 0, 0))
    spec.worldbody.add_geom(name="ledge", type=BOX, size=(0.05, 0.05, 0.01), pos=(5, 0, 2))
    model = spec.compile()
    bridge, data = MujocoBridge(model, go2), mujoco.MjData(model)
    moving(bridge, data, height=-0.005)
    assert data.ncon == 8
    np.testing.assert_allclose(
        bridge.read(data).foot_force.sum(axis=0), data.qfrc_constraint[:3], atol=1e-9
    )
    moving(bridge, data, height=0.5)
    data.qpos[:3] += [5.0, 0.0, 2.035] - data.geom("knee").xpos
    mujoco.mj_forward(model, data)
    assert data.ncon == 1
    assert data.qfrc_constraint[2] > 10.0
    np.testing.assert_array_equal(bridge.read(data).foot_force, 0.0)


@pytest.mark.parametrize("name", ["go2", "solo12"])
def test_feet_are_where_mujoco_has_them(name):
    robot = hp.load_robot(name)
    model = own_model(robot)
    data = mujoco.MjData(model)
    state = random_state(robot, 0)
    MujocoBridge(model, robot).place(state, data)
    mujoco.mj_forward(model, data)
    back = MujocoBridge(model, robot).read(data)
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


def test_prefixes_do_not_count_and_what_is_missing_is_said():
    robot, other = hp.load_robot("go2"), hp.load_robot("solo12")
    model = own_model(robot, prefix="dog/")
    data = mujoco.MjData(model)
    state = random_state(robot, 0)
    MujocoBridge(model, robot).place(state, data)
    np.testing.assert_allclose(MujocoBridge(model, robot).read(data).q[7:], state.q[7:])
    with pytest.raises(hp.InputError, match="joint of the MuJoCo model"):
        MujocoBridge(model, other).read(data)


@pytest.mark.parametrize("actuators", ["motor", "position", "velocity", ""])
@pytest.mark.parametrize("law", [False, True])
def test_joints_accelerate_as_under_the_torques(go2, actuators, law):
    model = described(go2, actuators=actuators, joints=JOINTS).compile()
    bridge = MujocoBridge(model, go2)
    data, other = mujoco.MjData(model), mujoco.MjData(model)
    rng = np.random.default_rng(2)
    torque, given = rng.normal(size=12) * 5.0, {}
    if law:
        given = {
            "q": rng.normal(size=12),
            "v": rng.normal(size=12),
            "k_p": 20.0,
            "k_d": rng.uniform(0.5, 2.0, 12),
        }
    command = hp.Command(torque, **given)
    for one in (data, other):
        moving(bridge, one, height=1.0)
    state = bridge.read(data)
    if law:
        torque = (
            torque + 20.0 * (given["q"] - state.q[7:]) + given["k_d"] * (given["v"] - state.v[6:])
        )
        torque = np.clip(torque, -go2.torque_limit, go2.torque_limit)
        assert (abs(torque) == go2.torque_limit).any()
    bridge.write(command, data)
    mujoco.mj_forward(model, data)
    for number, name in enumerate(go2.joints):
        other.qfrc_applied[model.joint(name).dofadr[0]] = torque[number]
    if actuators:  # servos push where their control is zero
        model.actuator_gainprm[:, 0] = model.actuator_biasprm[:, :3] = 0.0
    mujoco.mj_forward(model, other)
    np.testing.assert_allclose(data.qacc, other.qacc, rtol=1e-9, atol=1e-7)


def test_commands_that_do_not_fit_are_refused(go2):
    bridge = MujocoBridge(described(go2, actuators="motor").compile(), go2)
    data = mujoco.MjData(bridge.model)
    for bad in (
        hp.Command(np.zeros(6)),
        hp.Command(np.full(12, np.nan)),
        hp.Command(np.zeros(12), FEET[:2] + 1),
        None,
    ):
        with pytest.raises(InputError):
            bridge.write(bad, data)
    for bad in (None, "data", bridge.model):
        with pytest.raises(InputError, match="MjData"):
            bridge.read(bad)
        with pytest.raises(InputError, match="MjData"):
            bridge.write(hp.Command(np.zeros(12)), bad)


def test_a_file_of_mujoco_is_that_robot(go2, tmp_path):
    spec = described(go2, actuators="motor", joints=JOINTS)
    for actuator in spec.actuators:
        actuator.forcerange, actuator.forcelimited = (-8.0, 8.0), True
    model = spec.compile()
    file = tmp_path / "go2.xml"
    home = (0, 0, 0.3, 1, 0, 0, 0, *go2.posture)
    spec.add_key(name="home", qpos=home)
    file.write_text(spec.to_xml())
    robot = hp.load_robot(file, feet=go2.feet)
    assert robot.joints == go2.joints
    np.testing.assert_allclose(robot.posture, go2.posture)
    for read in (robot, go2.with_mujoco(model)):
        np.testing.assert_allclose(read.model.armature, [*[0.0] * 6, *[0.02] * 12])
        np.testing.assert_allclose(read.model.damping[6:], 0.3)
        np.testing.assert_allclose(read.dry_friction, 0.4)
    robot = robot.with_mujoco(model)
    np.testing.assert_allclose(
        robot.torque_limit, np.minimum(go2.torque_limit, 24.0)
    )  # 8 N·m times the gear, 3
    bridge, data, full = MujocoBridge(model, robot), mujoco.MjData(model), np.zeros((18, 18))
    assert bridge.differences == ""
    calf = "largest torque of FL_calf_joint: 24 N·m in the model, 45.43 in the robot; and 3 more"
    assert calf in MujocoBridge(model, go2).differences
    moving(bridge, data)
    mujoco.mj_fullM(model, data, full)
    dynamics, state = hp.Dynamics(robot), bridge.read(data)
    dynamics.update(state.q, state.v)
    order = [*range(6), *bridge.velocity]
    base, joints = full[np.ix_(order, order)][3:, 3:], dynamics.mass_matrix[3:, 3:]
    np.testing.assert_allclose(base, joints, atol=1e-6)  # files have six digits


MOTOR = {"gainprm": [2.0, *[0.0] * 9]}
SERVO = {"gainprm": [50.0, *[0.0] * 9], "biastype": 1, "biasprm": [0.0, -50.0, *[0.0] * 8]}
DAMPER = {"gaintype": 1, "gainprm": [0.0, 0.0, -1.0, *[0.0] * 7]}


@pytest.mark.parametrize(
    ("actuators", "joint", "urdf", "expected"),
    [
        ([{**MOTOR, "ctrlrange": (-3.0, 5.0)}], None, None, 18.0),
        ([{**MOTOR, "ctrlrange": (-3.0, 5.0), "forcerange": (-6.0, 4.0)}], None, 23.7, 12.0),
        ([{**MOTOR, "ctrlrange": (-3.0, 5.0)}], 7.0, None, 7.0),
        ([MOTOR], 50.0, 23.7, 23.7),
        ([MOTOR], None, None, np.inf),
        ([{**SERVO, "ctrlrange": (-1e-3, 1e-3)}], None, 23.7, 23.7),
        ([{**SERVO, "forcerange": (-1.0, 1.0)}], None, 23.7, 3.0),
        ([{**DAMPER, "ctrlrange": (0.0, 1.0)}], None, 23.7, 23.7),
        (
            [{**MOTOR, "ctrlrange": (-1.0, 1.0)}, {**MOTOR, "forcerange": (-1.0, 1.0)}],
            None,
            23.7,
            9.0,
        ),
        ([], None, 23.7, 23.7),
        ([], 5.0, 23.7, 5.0),
    ],
)
def test_torque_limits_are_the_smaller_of_model_and_robot(go2, actuators, joint, urdf, expected):
    """Of actuators with a gear of 3; where the robot has no limit (None), the model's."""
    spec, name = described(go2, joints=JOINTS), "FL_hip_joint"
    give(
        spec.joint(name),
        actfrclimited=joint is not None,
        actfrcrange=(-(joint or 0.0), joint or 0.0),
    )
    for values in actuators:
        limited = {
            key: key[:-5] + "limited" for key in ("ctrlrange", "forcerange") if key in values
        }
        more = {**values, **dict.fromkeys(limited.values(), 1)}
        spec.add_actuator(
            target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=[3.0, *[0.0] * 5], **more
        )
    limit = np.array(go2.model.effortLimit)
    limit[6] = urdf or np.inf
    known = go2.with_arrays({"effortLimit": limit}).with_mujoco(spec.compile())
    assert known.torque_limit[0] == pytest.approx(expected)


def test_differences_are_said(go2):
    spec = described(go2, actuators="motor", joints=JOINTS)
    spec.body("base").mass += 1.0
    spec.joint("FL_calf_joint").axis = (0.05, 1.0, 0.0)
    spec.body("RR_thigh").pos[1] += 0.01
    said = MujocoBridge(spec.compile(), go2).differences
    lines = said.splitlines()
    assert any(
        line.startswith("mass of the base: ")
        and "8.277 kg in the model, 7.277 in the robot" in line
        for line in lines
    )
    assert any(line.startswith("axis of joint of FL_calf_joint: [") for line in lines)
    assert any(
        line.startswith("place of joint of RR_thigh_joint: ") and line.endswith("and 1 more")
        for line in lines
    )
    assert "armature of FL_hip_joint: 0.02 kg·m² in the model, 0 in the robot; and 11 more" in lines
    assert any("damping" in line for line in lines)
    assert any("friction" in line for line in lines)


def rename(spec):
    spec.joint("FL_calf_joint").name = spec.actuators[2].target = "other"


def drive_a_foot(spec):
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    spec.add_actuator(target="FL_foot", trntype=mujoco.mjtTrn.mjTRN_BODY)


def tie(spec, kind, *names):
    objects = (
        mujoco.mjtObj.mjOBJ_JOINT if kind == mujoco.mjtEq.mjEQ_JOINT else mujoco.mjtObj.mjOBJ_BODY
    )
    spec.add_equality(type=kind, name1=names[0], name2=names[1], objtype=objects)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda spec: spec.delete(spec.joints[0]), "no free joint"),
        (rename, "joint of the MuJoCo model 'FL_calf_joint'"),
        (
            lambda spec: spec.body("FL_foot").add_joint(name="toe"),
            "joints that the robot has not: toe",
        ),
        (lambda spec: give(spec.joint("FL_calf_joint"), type=2), "calf_joint' of .* not turn"),
        (
            lambda spec: give(spec.joint("FL_calf_joint"), type=1, range=(0, 3)),
            "calf_joint' of .* not turn about one axis",
        ),
        (
            lambda spec: give(spec.joint("FL_calf_joint"), axis=(0, -1, 0)),
            "direction of joint of FL_calf_joint",
        ),
        (
            lambda spec: give(spec.joint("FL_hip_joint"), axis=(0, 1, 0)),
            "axis or direction of joint of FL_hip_joint",
        ),
        (
            lambda spec: give(spec.joint("FL_thigh_joint"), ref=0.5),
            "place of joint of FL_calf_joint",
        ),
        (
            lambda spec: give(spec.joint("FL_calf_joint"), ref=1.0),
            "place of the link of FL_calf_joint",
        ),
        (lambda spec: spec.delete(spec.actuators[3]), "'FR_hip_joint' has no actuators"),
        (
            lambda spec: spec.add_actuator(target="FL_calf_joint", trntype=0),
            "'FL_calf_joint' has 2 actuators",
        ),
        (
            lambda spec: give(spec.actuators[3], gaintype=mujoco.mjtGain.mjGAIN_AFFINE),
            "neither motor nor servo",
        ),
        (
            lambda spec: give(spec.actuators[3], dyntype=mujoco.mjtDyn.mjDYN_FILTER),
            "neither motor nor servo",
        ),
        (drive_a_foot, "no actuator of the MuJoCo model drives"),
        (
            lambda spec: tie(spec, mujoco.mjtEq.mjEQ_CONNECT, "FL_foot", "FR_foot"),
            "other closed loops than the robot",
        ),
        (
            lambda spec: tie(spec, mujoco.mjtEq.mjEQ_JOINT, "FL_calf_joint", "FR_calf_joint"),
            "are coupled and both have a motor",
        ),
    ],
)
def test_models_of_something_else_are_refused(go2, change, words):
    spec = described(go2, actuators="motor")
    change(spec)
    model = spec.compile()
    with pytest.raises(InputError, match=words):
        MujocoBridge(model, go2)


def test_what_is_no_model_is_refused(go2):
    for bad in (None, "go2.xml", go2.model):
        for function in (go2.with_mujoco, lambda model: MujocoBridge(model, go2)):
            with pytest.raises(InputError, match="MjModel"):
                function(bad)
    with pytest.raises(InputError, match="robot"):
        MujocoBridge(described(go2).compile(), "go2")


@pytest.mark.parametrize("kind", ["condensed", "wbc"])
def test_motors_hold_joint_targets_unless_torques_alone_are_asked_for(go2, kind):
    """Armature that the controller does not know: with its default behind a bridge it walks, with
    torques alone not.
    """
    model = described(go2, actuators="motor", joints={"armature": 0.03}).compile()
    bridge, alone, heights = (
        MujocoBridge(model, go2),
        {"joint_stiffness": 0.0, "joint_damping": 0.0},
        [],
    )
    for how in ({}, {**alone, "contact_damping": 200.0}):
        data, gait = mujoco.MjData(model), hp.WalkingGait(go2, velocity=(0.4, 0.0, 0.0))
        controller = hp.make_controller(kind, gait, mu=0.6, bridge=bridge, **how)
        bridge.place(hp.State(0.0, *gait.initial_state(), FEET, FEET, FEET), data)
        while data.time < 1.6:
            command = controller.step(bridge.read(data))
            assert (command.law is None) == bool(how)
            bridge.write(command, data)
            mujoco.mj_step(model, data)
        heights.append(data.qpos[2] / gait.initial_state()[0][2])
    assert heights[0] > 0.95
    assert heights[1] < 0.8
    assert controller.period == model.opt.timestep


def test_a_bridge_of_another_robot_makes_no_controller(go2):
    bridge = MujocoBridge(described(go2).compile(), go2)
    gait, period = hp.Standing(hp.load_robot("solo12")), 0.004
    with pytest.raises(InputError, match="the gait is of 'solo12', the bridge of 'go2'"):
        hp.make_controller("condensed", gait, mu=0.5, bridge=bridge)
    made = hp.make_controller(
        "condensed", hp.Standing(go2), mu=0.5, bridge=bridge, period=period, joint_damping=0.5
    )
    assert (made.period, made.parameters.joint_damping, made.parameters.joint_stiffness) == (
        period,
        0.5,
        1.0,
    )


def test_small_feet_that_sink_bear_the_weight(go2):
    """Our own plant's feet are points that sink by millimetres: their contacts are theirs."""
    model = hp.simulation.mujoco.MujocoPlant(go2, hp.Ground(mu_s=0.6)).model
    bridge, data, gait = MujocoBridge(model, go2), mujoco.MjData(model), hp.Standing(go2)
    controller = hp.make_controller("condensed", gait, mu=0.6, bridge=bridge)
    bridge.place(hp.State(0.0, *gait.initial_state(), FEET, FEET, FEET), data)
    while data.time < 0.5:
        bridge.write(controller.step(bridge.read(data)), data)
        mujoco.mj_step(model, data)
    assert data.contact.dist.min() < -2e-3
    assert bridge.read(data).foot_force[:, 2].sum() == pytest.approx(9.81 * go2.mass, rel=0.05)


def test_geoms_of_the_robot_that_push_each_other_are_found_and_said(go2):
    """The hip's torque is the moment of the force that is told; the ground is no part of the
    robot.
    """
    spec, gait = described(go2), hp.Standing(go2)
    q = gait.initial_state(penetration=0.01)[0]
    assert not MujocoBridge(described(go2).compile(), go2).self_contacts(q)
    spec.body("base").add_geom(name="trunk", type=SPHERE, size=(0.05, 0, 0), condim=1)
    thigh = spec.body("FL_thigh").add_geom(name="thigh", type=SPHERE, size=(0.05, 0, 0), condim=1)
    bridge = MujocoBridge(spec.compile(), go2)
    data = mujoco.MjData(bridge.model)
    bridge.place((q, np.zeros(18)), data)
    mujoco.mj_forward(bridge.model, data)
    axes, place = data.body("FL_thigh").xmat.reshape(3, 3), data.body("FL_thigh").xpos
    thigh.pos = axes.T @ (
        data.body("base").xpos + np.array((0.06, 0.07, 0.03)) - place
    )  # 3 mm deep
    bridge = MujocoBridge(spec.compile(), go2)
    ((pair, force),) = bridge.self_contacts(q).items()
    assert pair == ("trunk", "thigh")
    data = mujoco.MjData(bridge.model)
    lifted = q + 5.0 * np.eye(len(q))[2]
    bridge.place((lifted, np.zeros(18)), data)
    mujoco.mj_forward(bridge.model, data)
    joint = bridge.model.joint("FL_thigh_joint")
    moment = np.cross(data.contact[0].pos - data.xanchor[joint.id], data.contact[0].frame[:3])
    expected = data.qfrc_constraint[joint.dofadr[0]] / (data.xaxis[joint.id] @ moment)
    assert force == pytest.approx(expected, rel=1e-3)
    assert force > 1.0
    with pytest.warns(
        UserWarning,
        match=f"'trunk' and 'thigh' push each other apart in the MuJoCo model, with {force:.0f} N",
    ):
        hp.make_controller("condensed", gait, mu=0.6, bridge=bridge)
