"""A robot of an MJCF file is what MuJoCo compiles, or refused in a sentence that names the
element.
"""

import copy
import json
import pickle
import subprocess
import sys
import warnings

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import mass_matrix

import harpy_pin as hp
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.source import plain_source, read_robot
from harpy_pin.view.scene.visuals import load_visuals

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra")
from random_mjcf import RandomFile  # noqa: E402

FILES = 60
EXACT = 1e-12


def assert_same(robot, model, seed=0):
    """Masses, limits, joints' numbers, mass matrix, bias forces and all placements in a random
    state are MuJoCo's.
    """
    built, rng, data = robot.model, np.random.default_rng(seed), mujoco.MjData(model)
    joints = [model.joint(name).id for name in robot.joints]
    root = model.body_rootid[model.jnt_bodyid[joints[0]]]
    free = model.body_jntadr[root]
    qpos, qvel = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    first, base = model.jnt_qposadr[free], model.jnt_dofadr[free]
    assert robot.mass == pytest.approx(model.body_subtreemass[root], rel=EXACT)
    limited = model.jnt_limited[joints].astype(bool)
    np.testing.assert_array_equal(
        robot.joint_lower, np.where(limited, model.jnt_range[joints, 0], -np.inf)
    )
    np.testing.assert_array_equal(
        robot.joint_upper, np.where(limited, model.jnt_range[joints, 1], np.inf)
    )
    np.testing.assert_array_equal(robot.dry_friction, model.dof_frictionloss[qvel])

    turn = pin.exp3(rng.normal(size=3))
    x, y, z, w = pin.Quaternion(turn).coeffs()
    q = np.array([*rng.normal(size=3), x, y, z, w, *rng.uniform(-1.0, 1.0, len(joints))])
    v = rng.normal(size=built.nv)
    data.qpos[first : first + 7] = (*q[:3], w, x, y, z)
    data.qpos[qpos], data.qvel[qvel] = q[7:], v[6:]
    data.qvel[base : base + 6] = (*(turn @ v[:3]), *v[3:6])
    mujoco.mj_forward(model, data)
    order = [*range(base, base + 6), *qvel]
    change = np.eye(built.nv)
    change[:3, :3] = turn  # MuJoCo's velocities from Pinocchio's
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    theirs = full[np.ix_(order, order)]
    drift = np.array([*(turn @ np.cross(v[3:6], v[:3])), *np.zeros(built.nv - 3)])
    linear = np.diag([*model.dof_armature[base : base + 3], *np.zeros(built.nv - 3)])
    bias = change.T @ (data.qfrc_bias[order] + (theirs - linear) @ drift)
    expected = change.T @ theirs @ change
    own = built.createData()
    np.testing.assert_allclose(
        mass_matrix(built, q), expected, rtol=0, atol=EXACT * np.abs(expected).max()
    )
    found = pin.nonLinearEffects(built, own, q, v)
    np.testing.assert_allclose(found, bias, rtol=0, atol=20 * EXACT * max(1.0, np.abs(bias).max()))

    pin.framesForwardKinematics(built, own, q)
    for kind in ("body", "site", "geom"):
        for number in range(getattr(model, f"n{kind}")):
            item = getattr(model, kind)(number)
            owner = number if kind == "body" else getattr(model, f"{kind}_bodyid")[number]
            if model.body_rootid[owner] == root and item.name:
                name = (
                    f"{kind}:{item.name}" if built.existFrame(f"{kind}:{item.name}") else item.name
                )
                place, prefix = (
                    own.oMf[robot.frame_id(name)],
                    "x" if kind == "body" else f"{kind}_x",
                )
                np.testing.assert_allclose(
                    place.translation, getattr(data, f"{prefix}pos")[number], rtol=0, atol=1e-11
                )
                axes = getattr(data, f"{prefix}mat")[number].reshape(3, 3)
                np.testing.assert_allclose(place.rotation, axes, rtol=0, atol=1e-12)


def assert_torques(robot, model):
    """Damping is what MuJoCo's passive forces say, and the limits what its motors give at most both
    ways.
    """
    model = copy.copy(model)
    joints = [model.joint(name).id for name in robot.joints]
    qvel = model.jnt_dofadr[joints]
    model.opt.gravity[:] = 0.0
    servo = model.actuator_biastype != 0  # whose controls are no torques
    model.actuator_ctrllimited[model.actuator_ctrladr[servo]] = 0
    data = mujoco.MjData(model)
    data.qvel[qvel] = 1.0 + np.arange(len(joints))
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(
        -data.qfrc_passive[qvel], robot.model.damping[6:] * data.qvel[qvel], rtol=1e-12
    )
    data, peak = mujoco.MjData(model), np.full(len(joints), np.inf)
    for sign in (1.0, -1.0):
        for number in range(model.nactuator):
            gear = model.actuator_gear[model.actuator_outadr[number], 0]
            data.ctrl[model.actuator_ctrladr[number]] = sign * np.sign(gear) * 1e9
        mujoco.mj_forward(model, data)
        peak = np.minimum(peak, sign * data.qfrc_actuator[qvel])
    driven = np.isin(joints, model.actuator_trnid[:, 0])
    ranges = np.where(
        model.jnt_actfrclimited[joints], np.abs(model.jnt_actfrcrange[joints]).min(axis=1), np.inf
    )
    np.testing.assert_allclose(
        robot.torque_limit, np.where(driven & (peak < 1e7), peak, ranges), rtol=1e-12
    )


def test_random_files_are_what_mujoco_compiles(tmp_path, fuzz):
    """Random trees, classes, frames, units and orders of sections: equal to rounding, or refused by
    name.
    """
    refused = 0
    for seed in range(FILES * fuzz):
        made = RandomFile(seed)
        file = tmp_path / f"{seed}.xml"
        file.write_text(made.text)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # gravity
            if made.refused:
                refused += 1
                with pytest.raises(RobotError, match=made.refused):
                    hp.load_robot(file, feet=made.feet, flat_feet={})
            elif made.joints:
                robot, model = (
                    hp.load_robot(file, feet=made.feet, flat_feet={}),
                    mujoco.MjModel.from_xml_path(str(file)),
                )
                assert_same(robot, model, seed)
                assert_torques(robot, model)
    assert 0 < refused < 0.3 * FILES * fuzz


def dog(*changes, body="", leg="", sections="", base="", feet=True):
    """A quadruped with sites at its feet; pairs of texts are replaced in it, and texts added."""
    text = f'<body name="base" pos="0 0 0.4"{base}><freejoint name="root"/>'
    text += f'<inertial pos="0 0 0" mass="7" diaginertia="0.02 0.06 0.07"/>{body}'
    for name, x, y in (("FL", 0.2, 0.1), ("FR", 0.2, -0.1), ("RL", -0.2, 0.1), ("RR", -0.2, -0.1)):
        foot = f'<geom name="{name}" size="0.02" pos="0 0 -0.21" density="0"/>'
        foot += f'<site name="{name}_foot" pos="0 0 -0.21"/>' if feet else ""
        text += f"""<body name="{name}_hip" pos="{x} {y} 0">
          <joint name="{name}_hip" axis="1 0 0" range="-40 40"/>
          <inertial pos="0 0 0" mass="0.7" diaginertia="0.001 0.001 0.001"/>
          <body name="{name}_thigh" pos="0 {0.8 * y} 0">
            <joint name="{name}_thigh" axis="0 1 0" range="-90 150"/>
            <inertial pos="0 0 -0.05" mass="1" diaginertia="0.005 0.005 0.001"/>
            <body name="{name}_calf" pos="0 0 -0.21">
              <joint name="{name}_calf" axis="0 1 0" range="-150 -20"{leg}/>
              <inertial pos="0 0 -0.1" mass="0.3" diaginertia="0.002 0.002 0.0001"/>{foot}
            </body></body></body>"""
    text = f"<mujoco><worldbody>{text}</body></worldbody>{sections}</mujoco>"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
JOINTS = tuple(
    f"{leg}_{part}" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")
)
PAYLOAD = '<inertial pos="0 0 0" mass="{}" diaginertia="0.01 0.01 0.01"/>'
BALL = '<body name="ball" pos="1 0 1"><freejoint/><geom size="0.1"/></body>'
CLOTH = (
    '<body name="sheet" pos="3 0 1"><flexcomp name="c" type="grid" count="3 3 1" spacing="0.1 '
    '0.1 0.1" dim="2">'
)
CLOTH += '<edge equality="true"/></flexcomp></body>'
HOME = (0.0, 0.8, -1.6) * 4
KEY = " ".join(str(x) for x in (0, 0, 0.3, 1, 0, 0, 0, *HOME))


def motors(text):
    each = [f'<motor name="{joint}" joint="{joint}" {text}/>' for joint in JOINTS]
    return f"<actuator>{''.join(each)}</actuator>"


def tendon(text):
    inner = '<joint joint="FL_thigh" coef="1"/><joint joint="FL_calf" coef="-1"/>'
    return f'<tendon><fixed name="strap" {text}>{inner}</fixed></tendon>'


LIKE_MUJOCO = {
    "plain": dog(),
    "armature of actuators": dog(sections=motors('armature="0.01" gear="2"')),
    "damping of actuators": dog(sections=motors('damping="0.5" gear="3"')),
    "a wide actuator first": dog(
        (
            "</worldbody>",
            '<body name="gimbal"><joint name="b" type="ball"/><geom '
            'size="0.1"/></body></worldbody>',
        ),
        sections=motors('ctrlrange="-3 3"').replace(
            "<actuator>", '<actuator><orientation joint="b" kp="3"/>'
        ),
    ),
    "unequal joint ranges": dog(leg=' actuatorfrcrange="-3 23"'),
    "unequal motor ranges": dog(sections=motors('ctrlrange="-10 4"')),
    "range of a servo": dog(
        sections=motors('kp="40" ctrlrange="-1 1" forcerange="-12 12"').replace(
            "<motor", "<position"
        )
    ),
    "base turned": dog(base=' euler="0 0 90"'),
    "compiler last": dog(("-150 -20", "-2.6 -0.35"), sections='<compiler angle="radian"/>'),
    "defaults last": dog(
        sections='<default><joint armature="0.01" damping="0.3" frictionloss="0.2"/></default>'
    ),
    "a frame": dog(body=f'<frame pos="0 0 0.1"><body>{PAYLOAD.format(1.5)}</body></frame>'),
    "copies": dog(
        body=f'<replicate count="3" offset="0.1 0 0"><body '
        f'name="n">{PAYLOAD.format(0.2)}</body></replicate>'
    ),
    "bodies without names": dog(
        body=f"<body>{PAYLOAD.format(1.5)}</body><body>{PAYLOAD.format(0.5)}</body>"
    ),
    "place by class": dog(
        ('_foot" pos="0 0 -0.21"', '_foot" class="tip"'),
        body='<geom class="tip" type="box" size="0.2 0.1 0.05"/>',
        sections='<default><default class="tip"><site pos="0 0 -0.2"/><geom pos="0.1 0 '
        '0.05"/></default></default>',
    ),
    "mesh": dog(
        (
            '<inertial pos="0 0 0" mass="7" diaginertia="0.02 0.06 0.07"/>',
            '<geom type="mesh" mesh="m" mass="6"/>',
        ),
        sections='<asset><mesh name="m" vertex="0 0 0 0.2 0 0 0 0.3 0 0 0 0.1"/></asset>',
    ),
    "no limits": dog(leg=' limited="false"'),
    "reference": dog(leg=' ref="-60"'),
    "slides": dog(('axis="0 1 0" range="-150 -20"', 'type="slide" axis="0 0 1" range="-0.1 0.1"')),
    "total mass": dog(sections='<compiler settotalmass="30"/>'),
    "two sections": dog(
        ("</worldbody>", '</worldbody><worldbody><geom type="plane" size="5 5 1"/></worldbody>')
    ),
    "inactive weld": dog(sections='<equality><weld body1="base" active="false"/></equality>'),
    "disabled weld": dog(
        sections='<equality><weld body1="base"/></equality><option><flag equality="disable" '
        'limit="disable"/></option>'
    ),
    "tied elsewhere": dog(
        ("</worldbody>", f"{BALL}</worldbody>"),
        sections='<equality><weld body1="ball"/></equality>',
    ),
    "tendon that measures": dog(sections=tendon("")),
    "a tendon elsewhere": dog(
        (
            "</worldbody>",
            '<body name="door"><joint name="d"/><geom size="0.1"/></body></worldbody>',
        ),
        sections='<tendon><fixed name="t" stiffness="3"><joint joint="d" '
        'coef="1"/></fixed></tendon>'
        '<equality><tendon tendon1="t"/></equality>',
    ),
    "a cloth elsewhere": dog(("</worldbody>", f"{CLOTH}</worldbody>")),
}


@pytest.mark.parametrize("case", LIKE_MUJOCO)
def test_what_a_file_says_is_mujocos(tmp_path, case):
    file = tmp_path / "dog.xml"
    file.write_text(LIKE_MUJOCO[case])
    model = mujoco.MjModel.from_xml_path(str(file))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = hp.load_robot(file, feet=FEET)
    if "limit=" in LIKE_MUJOCO[case]:
        assert np.isinf(robot.joint_upper).all()
        model.jnt_limited[:] = 0
    assert robot.joints == JOINTS
    assert_same(robot, model)
    assert_torques(robot, model)
    if case == "unequal motor ranges":
        np.testing.assert_array_equal(robot.torque_limit, 4.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            dog(leg=' stiffness="20" springref="10"'),
            r"springs of joint 'FL_calf' \(20 N·m/rad\) and 3 more",
        ),
        (
            dog(leg=' damping="0.1 0.02"'),
            r"damping that is not linear of joint 'FL_calf' \(0.02 N.* and 3 more",
        ),
        (
            dog(sections=motors('damping="0.1 0.02"')),
            r"damping that is not linear of joint 'FL_hip' \(0.02 N.*11 more",
        ),
        (
            dog(sections=motors('delay="0.02" nsample="20"')),
            r"delay of actuator 'FL_hip' \(0.02 s\) and 11 more",
        ),
        (
            dog(sections=motors('dyntype="filter" dynprm="0.1"').replace("<motor", "<general")),
            "a state of its own of",
        ),
        (dog(sections=tendon('stiffness="3"')), "tendon 'strap'"),
        (dog(sections=tendon('range="-1 1"')), "tendon 'strap'"),
        (
            dog(sections=tendon("") + '<actuator><motor tendon="strap"/></actuator>'),
            "tendon 'strap'",
        ),
        (dog(('name="FL_hip" pos', 'gravcomp="1" name="FL_hip" pos')), "gravcomp of body 'FL_hip'"),
        (dog(sections='<option gravity="0 0 -3.71"/>'), r"gravity \[.* -3.71\] m/s²"),
        (
            dog(sections='<option gravity="0 0 -9.81"><flag gravity="disable"/></option>'),
            r"gravity \[0. 0. 0.\] m/s²",
        ),
        (dog(sections='<option density="1.2"/>'), "air of density 1.2 kg/m³ and viscosity 0 Pa·s"),
        (
            dog(sections='<actuator><motor joint="FL_hip"/></actuator>'),
            "no actuator of joint 'FL_thigh' and 10 more",
        ),
        (
            dog(
                ('<freejoint name="root"/>', '<joint name="root" type="free"/>'),
                sections='<default><joint armature="0.01" damping="0.5"/></default>',
            ),
            "damping of the free joint of body 'base'",
        ),
    ],
)
def test_what_no_rigid_tree_has_is_said(tmp_path, text, words):
    """The rest of the robot is MuJoCo's."""
    file = tmp_path / "dog.xml"
    file.write_text(text)
    with pytest.warns(
        UserWarning, match=f"dog.xml' has what a tree of rigid bodies has not: {words}"
    ):
        robot = hp.load_robot(file, feet=FEET)
    model = mujoco.MjModel.from_xml_path(str(file))
    if "gravity" in words:
        model.opt.gravity[:] = robot.model.gravity.linear
    assert_same(robot, model)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (dog(('<freejoint name="root"/>', "")), "no free joint: its base is fixed"),
        (
            dog(('name="FL_calf" axis="0 1 0" range="-150 -20"', 'name="FL_calf" type="ball"')),
            "'FL_calf' is a ball",
        ),
        (
            dog(sections=tendon("") + '<equality><tendon tendon1="strap"/></equality>'),
            "<tendon> of the .* holds the robot",
        ),
        (
            dog(sections='<equality><weld name="w" body1="FL_calf"/></equality>'),
            "constraint <weld> 'w'",
        ),
        (
            dog(sections='<equality><connect site1="FL_foot" site2="FR_foot"/></equality>'),
            "no loop of 'dog' holds joint",
        ),
        (
            dog(sections='<equality><joint joint1="FL_calf" joint2="FR_calf"/></equality>'),
            "no loop of 'dog' holds joint",
        ),
        (dog(sections=motors('ctrlrange="0 4"')), "'FL_hip' can be pushed one way only"),
        (
            dog(('mass="7"', 'mass="heavy"')),
            "not an MJCF file that MuJoCo can read: .*bad format in attribute 'mass'",
        ),
        (dog(('mass="7"', 'mass="nan"')), "that MuJoCo can read: Error: mass"),
        (dog(leg=' armature="-1"'), "armature of joints must not be negative"),
        (dog(("0 1 0", "0 0 0")), "that MuJoCo can read: Error: axis too small"),
        ("<mujoco/>", "no free joint"),
        (dog(body='<include file="absent.xml"/>'), "that MuJoCo can read: .*absent.xml"),
        (
            dog(
                ('<site name="RR_foot" pos="0 0 -0.21"/>', ""),
                ("</worldbody>", BALL.replace('name="ball"', 'name="RR_foot"') + "</worldbody>"),
            ),
            "feet are on two free bodies, 'base' and 'RR_foot'",
        ),
    ],
)
def test_what_changes_how_it_moves_is_refused(tmp_path, text, words):
    file = tmp_path / "dog.xml"
    file.write_text(text)
    with pytest.raises(RobotError, match=words) as error:
        hp.load_robot(file, feet=FEET)
    assert "\n" not in str(error.value)


def test_feet_are_sites_geoms_or_bodies(tmp_path):
    """Of several things with one name the body has it; the others have their kind before it."""
    model = mujoco.MjModel.from_xml_string(dog(('geom name="FL"', 'geom name="FL_calf"')))
    robot = hp.load_robot(model, feet=("geom:FL_calf", "FR", "RL_foot", "RR_calf"))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    heights = [data.oMf[robot.frame_id(foot)].translation[2] for foot in robot.feet]
    np.testing.assert_allclose(heights, [-0.42, -0.42, -0.42, -0.21])
    with pytest.raises(RobotError, match="the MuJoCo model has no foot frame 'toe'; its links"):
        hp.load_robot(model, feet=("toe",))
    with pytest.raises(InputError, match=r"needs feet: .* FL_calf"):
        hp.load_robot(model)
    with pytest.raises(InputError, match="the MuJoCo model: it has no free joint"):
        hp.load_robot(mujoco.MjModel.from_xml_string("<mujoco/>"), feet=())


def test_of_several_robots_the_feet_choose_one():
    """Also with the prefixes of attached models; the keyframe is that of all."""
    world = mujoco.MjSpec()
    for prefix in ("a/", "b/"):
        key = f'<keyframe><key name="home" qpos="{KEY}"/></keyframe>'
        frame = world.worldbody.add_frame(pos=(0, 0, 0))
        world.attach(mujoco.MjSpec.from_string(dog(sections=key)), prefix=prefix, frame=frame)
    model = world.compile()
    for prefix in ("a/", "b/"):
        robot = hp.load_robot(model, feet=[prefix + foot for foot in FEET])
        assert robot.joints == tuple(prefix + joint for joint in JOINTS)
        assert_same(robot, model)
        np.testing.assert_allclose(robot.posture, HOME)


def test_a_joint_without_a_name_has_that_of_its_body():
    model = mujoco.MjModel.from_xml_string(dog(('<joint name="FL_thigh"', "<joint")))
    robot = hp.load_robot(model, feet=FEET)
    assert robot.joints[:3] == ("FL_hip", "FL_thigh_joint", "FL_calf")
    assert hp.MujocoBridge(model, robot).differences == ""


RELOAD = """
import json, sys, harpy_pin as hp
from harpy_pin.model.source import read_robot
robot = read_robot(json.loads(sys.argv[1]))
print(robot, robot.urdf, *robot.posture)
"""


def test_it_is_made_again_elsewhere(tmp_path):
    """By another process, from a log, and from a pickle; a model in memory has no file, and the
    message says so.
    """
    file = tmp_path / "dog.xml"
    file.write_text(dog(sections=f'<keyframe><key name="home" qpos="{KEY}"/></keyframe>'))
    robot = hp.load_robot(file, feet=FEET)
    source = json.dumps(plain_source(robot.source))
    made = subprocess.run(
        [sys.executable, "-c", RELOAD, source], capture_output=True, text=True, check=True
    )
    assert made.stdout.split() == f"{robot} {file} {' '.join(str(x) for x in HOME)}".split()
    again = pickle.loads(pickle.dumps(robot))
    assert (again.model, again.feet) == (robot.model, robot.feet)
    assert (
        hp.Scenario.from_dict(
            json.loads(json.dumps(hp.Scenario(robot=robot).to_dict()))
        ).robot.model
        == robot.model
    )
    loaded = hp.load_robot(mujoco.MjModel.from_xml_path(str(file)), feet=FEET)
    loaded.model.name = robot.model.name
    assert loaded.model == robot.model
    assert loaded.urdf is None
    with pytest.raises(InputError, match="no scenario can write down"):
        hp.Scenario(robot=loaded)
    with pytest.raises(
        InputError, match="was read from a MuJoCo model, not from a file: give the file"
    ):
        read_robot(loaded.source)
    assert read_robot({**loaded.source, "file": str(file)}).model == robot.model


def test_its_shapes_are_those_of_mujocos_viewer(tmp_path):
    file = tmp_path / "dog.xml"
    mesh = '<asset><mesh name="m" vertex="0 0 0 0.2 0 0 0 0.3 0 0 0 0.1"/></asset>'
    body = (
        '<geom type="mesh" mesh="m" rgba="1 0 0 1" pos="0 0 1"/><geom type="box" size="1 1 1" '
        'group="3"/>'
    )
    file.write_text(dog(body=body, sections=mesh))
    model = mujoco.MjModel.from_xml_path(str(file))
    robot, data = hp.load_robot(file, feet=FEET), mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    shapes = load_visuals(robot)
    assert len(shapes) == 5
    np.testing.assert_allclose(shapes[0].meshColor, (1, 0, 0, 1))
    place = robot.model.createData()
    pin.forwardKinematics(robot.model, place, np.array([0, 0, 0.4, 0, 0, 0, 1, *np.zeros(12)]))
    corners = np.asarray(shapes[0].geometry.vertices()) @ shapes[0].placement.rotation.T
    corners += shapes[0].placement.translation
    np.testing.assert_allclose(corners.min(axis=0), (0, 0, 1), atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), (0.2, 0.3, 1.1), atol=1e-6)
    found = [place.oMi[shape.parentJoint].act(shape.placement.translation) for shape in shapes[1:]]
    np.testing.assert_allclose(found, data.geom_xpos[2:], atol=1e-12)


def test_without_mujoco_the_extra_is_said(tmp_path, monkeypatch):
    file = tmp_path / "dog.xml"
    file.write_text(dog())
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(RobotError, match=r"dog.xml': no MuJoCo .*pip install .*\[mujoco\]"):
        hp.load_robot(file, feet=FEET)


def leg(foot, joints=6, assets=""):
    """A base on one leg of some joints, whose last body has these shapes and the frame ``sole``."""
    inertia, axes = PAYLOAD.format(1), ("1 0 0", "0 1 0", "0 0 1")
    bodies = "".join(
        f'<body name="link{k}" pos="0 0 -0.1"><joint name="joint{k}" '
        f'axis="{axes[k % 3]}"/>{inertia}'
        for k in range(joints)
    )
    leg = f"{bodies}{foot}{'</body>' * joints}"
    base = f'<body name="base"><freejoint/>{PAYLOAD.format(5)}{leg}</body>'
    text = f"<mujoco><asset>{assets}</asset><worldbody>{base}</worldbody></mujoco>"
    return mujoco.MjModel.from_xml_string(text)


FOUR = "".join(
    f'<geom size="0.01" pos="{x} {y} -0.05"/>' for x in (-0.05, 0.12) for y in (-0.03, 0.03)
)
TWO = "".join(
    f'<geom type="capsule" size="0.01" fromto="-0.05 {y} -0.05 0.12 {y} -0.05"/>'
    for y in (-0.03, 0.03)
)
BOX = '<geom name="box" type="box" size="0.085 0.03 0.02" pos="0.035 0 -0.04"/>'


@pytest.mark.parametrize("shapes", [FOUR, TWO, BOX])
@pytest.mark.parametrize("sole", ["", '<site name="sole" pos="0.035 0 -0.06"/>'])
def test_soles_are_found(shapes, sole):
    """Of four spheres, two capsules, or a box, which all reach from x = −0.05 to 0.12 m, y = ±0.03
    m, z = −0.06 m.
    """
    shank = '<geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.1"/>'
    robot = hp.load_robot(leg(shank + shapes + sole), feet=("sole" if sole else "link5",))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    corners = [data.oMf[robot.frame_id(name)].translation for name in robot.feet]
    expected = [(x, y, -0.66) for x in (0.12, -0.05) for y in (0.03, -0.03)]
    np.testing.assert_allclose(corners, expected, atol=1e-12)
    assert robot.flat_feet == (4,)
    assert hp.load_robot(leg(shapes), feet=("link5",), flat_feet={}).flat_feet == ()
    own = hp.FlatFoot(length=0.1, width=0.1)
    assert hp.load_robot(leg(shapes), feet=("link5",), flat_feet={"link5": own}).flat_feet == (4,)


@pytest.mark.parametrize("turn", ["0 0 0", "0 0 25", "90 0 0"])
def test_the_sole_of_a_mesh_is_the_rectangle_around_its_lowest_vertices(turn):
    """A frustum with its small face below, whose axes the geom turns, and a box of the same
    size.
    """
    frame = pin.rpy.rpyToMatrix(*np.radians(np.array(turn.split(), float)))
    low = [(x, y, -0.06) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    vertices = np.array([*low, *((2.0 * x, 2.0 * y, 0.0) for x, y, _ in low)])
    text = " ".join(map(str, (vertices @ frame).ravel()))
    foot = f'<geom type="mesh" mesh="foot" euler="{turn}"/>'
    models = (leg(foot, assets=f'<mesh name="foot" vertex="{text}"/>'), leg(BOX))
    found = []
    for robot in (hp.load_robot(model, feet=("link5",)) for model in models):
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
        found.append([data.oMf[robot.frame_id(name)].homogeneous for name in robot.feet])
    np.testing.assert_allclose(found[0], found[1], atol=1e-7)


@pytest.mark.parametrize(
    ("foot", "joints", "name"),
    [
        ('<geom size="0.02" pos="0 0 -0.05"/>', 6, "link5"),
        ('<geom type="capsule" size="0.02" fromto="-0.1 0 -0.05 0.1 0 0"/>', 6, "link5"),
        ('<geom type="capsule" size="0.02" fromto="0 0 -0.1 0 0 0"/>', 6, "link5"),
        (FOUR.replace("<geom", '<geom contype="0" conaffinity="0"'), 6, "link5"),
        (BOX, 3, "link2"),
        (
            BOX.replace("box", "b")
            .replace("/>", ' euler="0 20 0"/>', 1)
            .replace('type="b"', 'type="box"'),
            6,
            "link5",
        ),
        ("", 6, "link5"),
    ],
)
def test_points_lines_that_are_not_level_and_short_legs_have_no_sole(foot, joints, name):
    assert hp.load_robot(leg(foot, joints), feet=(name,)).feet == (name,)


@pytest.mark.parametrize("frame", ["0 0 0", "90 0 0", "20 40 60"])
@pytest.mark.parametrize(
    "ends", ["-0.06 0.01 -0.05 0.1 0.01 -0.05", "0.1 0.01 -0.05 -0.06 0.01 -0.05"]
)
def test_a_level_capsule_is_a_line(frame, ends):
    """Its contact points are below its ends, the front one first, seen from any frame."""
    foot = f'<geom type="capsule" size="0.02" fromto="{ends}"/><site name="sole" euler="{frame}"/>'
    robot = hp.load_robot(leg(foot), feet=("sole",))
    assert (robot.feet, robot.corners, robot.on_soles) == (("sole_0", "sole_1"), (2,), False)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    link, *points = (data.oMf[robot.frame_id(name)] for name in ("link5", *robot.feet))
    places = [link.actInv(point.translation) for point in points]
    np.testing.assert_allclose(places, [(0.1, 0.01, -0.07), (-0.06, 0.01, -0.07)], atol=1e-9)


@pytest.mark.parametrize("frame", ["0 0 0", "90 0 0", "180 0 0", "0 90 0", "0 -90 30", "20 40 60"])
@pytest.mark.parametrize(
    "box",
    [
        "0.085 0.03 0.02 : 0 0 0",
        "0.02 0.03 0.085 : 0 90 0",
        "0.085 0.02 0.03 : 90 0 0",
        "0.03 0.085 0.02 : 0 0 90",
    ],
)
@pytest.mark.parametrize("yaw", [0, 25])
def test_turned_boxes_and_frames_have_turned_soles(frame, box, yaw):
    """A box that is given by other axes, seen from a frame that is turned, is the same rectangle in
    the same order.
    """
    size, turn = box.split(" : ")
    shapes = f'<geom type="box" size="{size}" euler="{turn}" pos="0 0 -0.04"/>'
    site = f'<site name="sole" pos="0.01 0.02 -0.03" euler="{frame}"/>'
    foot = f'<frame pos="0.035 0 0" euler="0 0 {yaw}">{shapes}</frame>{site}'
    robot = hp.load_robot(leg(foot), feet=("sole",))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    corners = [data.oMf[robot.frame_id(name)] for name in robot.feet]
    around = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(yaw)), np.array((0.035, 0.0, -0.66)))
    expected = [around.act(np.array((x, y, 0.0))) for x in (0.085, -0.085) for y in (0.03, -0.03)]
    np.testing.assert_allclose([corner.translation for corner in corners], expected, atol=1e-9)
    np.testing.assert_allclose(
        [corner.rotation for corner in corners], [around.rotation] * 4, atol=1e-9
    )


def test_a_box_is_a_sole_by_its_own_name():
    robot = hp.load_robot(leg(BOX), feet=("box",))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    corner = data.oMf[robot.frame_id("box_0")].translation
    np.testing.assert_allclose(corner, (0.12, 0.03, -0.66), atol=1e-12)


def test_radii_of_spheres_are_the_robots():
    """Around sites, geoms and bodies, also on a link above; none where a foot is flat, or a box, or
    touches nothing.
    """
    two = (
        f'<geom size="0.03" contype="0" conaffinity="0"/><geom size="0.01"/>{BOX}<site '
        f'name="sole" pos="0 0 -0.005"/>'
    )
    for shapes, feet, radii in (
        (
            '<geom size="0.02" pos="0 0 -0.05"/><site name="sole" pos="0 0 -0.05"/>',
            ("sole", "link2"),
            (0.02, 0.0),
        ),
        (
            '<body name="tip" pos="0 0 -0.1"><geom name="ball" size="0.04"/></body>',
            ("tip", "ball"),
            (0.04, 0.04),
        ),
        (two, ("sole", "box"), (0.01, 0.0)),
        (BOX, ("link5",), (0.0,) * 4),
    ):
        robot = hp.load_robot(leg(shapes, joints=4 if "sole" in feet else 6), feet=feet)
        assert robot.foot_radius == radii
    dogs = hp.load_robot(mujoco.MjModel.from_xml_string(dog()), feet=FEET)
    assert dogs.foot_radius == (0.02,) * 4
    model = mujoco.MjModel.from_xml_string(dog(sections=motors("")))
    np.testing.assert_array_equal(hp.MujocoBridge(model, dogs).foot_radius, dogs.foot_radius)
    assert pickle.loads(pickle.dumps(dogs)).foot_radius == dogs.foot_radius
    assert hp.load_harpy().foot_radius == (0.0, 0.0)
    np.testing.assert_array_equal(hp.Estimator(dogs).record["foot_radius"][0], 0.02)
    np.testing.assert_array_equal(hp.Estimator(dogs, foot_radius=0.0).record["foot_radius"][0], 0.0)
