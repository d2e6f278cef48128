"""URDFs from strangers: each is refused in one short line, in silence, or read as Pinocchio reads
it.
"""

import re
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from biped_urdf import biped_urdf
from entrances import CONTROLLERS, few_ticks
from hostile import outcome, spoil_urdf

import harpy_pin as hp
from harpy_pin import RobotError, load_harpy, load_robot
from harpy_pin.model.posture import find_posture
from harpy_pin.view.scene.visuals import load_visuals

ROOT = Path(__file__).resolve().parents[2]
HARPY = (ROOT / "urdf" / "harpy.urdf").read_text()
BALL = (
    '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
    'izz="1"/></inertial>'
)
BASE_INERTIA = HARPY[HARPY.index("<inertia ") :].partition("/>")[0] + "/>"
KNEE = '<joint name="left_knee" type="revolute">'


def link(name, content=BALL):
    return f'<link name="{name}">{content}</link>'


def joint(name, parent, child, kind="fixed"):
    limit = (
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        if kind != "fixed"
        else ""
    )
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child '
        f'link="{child}"/>{limit}</joint>'
    )


def chain(count, kind="revolute"):
    links = "".join(link(f"l{i}") for i in range(count))
    joints = "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", kind) for i in range(count - 1))
    return f'<robot name="chain">{links}{joints}</robot>'


def with_end(text):
    return HARPY.replace("</robot>", f"{text}</robot>")


def changed(old, new):
    assert old in HARPY
    return HARPY.replace(old, new, 1)


def inertia(xx, yy, zz, xy="0"):
    return changed(
        BASE_INERTIA, f'<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'
    )


BOMB = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
BOMB = (
    f'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY l0 "lol">{BOMB}]><robot name="r"><link '
    f'name="&l9;"/></robot>'
)
FILE = (
    '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/hostname">]><robot name="r">&a;<link '
    'name="b"/></robot>'
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (chain(5000), "5000 links; at most 500"),
        (chain(5000, "fixed"), "5000 links; at most 500"),
        (
            f'<robot name="r">{"".join(link(f"l{i}", "") for i in range(20_000))}</robot>',
            "20000 links",
        ),
        (f'<robot name="r">{" " * 5_000_000}<link name="l"/></robot>', "too large"),
        (
            f'<robot name="r"><link name="l"/>{"<a>" * 100_000}{"</a>" * 100_000}</robot>',
            "nested too deeply",
        ),
        (BOMB, "declares entities"),
        (FILE, "declares entities"),
        (
            changed('<mass value="2.0"/>', '<mass value="-2"/>'),
            "mass value of link 'base' must be finite and ≥ 0",
        ),
        (changed('<mass value="2.0"/>', '<mass value="nan"/>'), "must be finite"),
        (changed('<mass value="2.0"/>', '<mass value="1e400"/>'), "must be finite"),
        (changed('<mass value="2.0"/>', '<mass value="1e308"/>'), "≤ 1e+06"),
        (changed('<mass value="2.0"/>', '<mass value="1_0"/>'), "must be a number, got '1_0'"),
        (changed('<mass value="2.0"/>', '<mass value="٢"/>'), "must be a number"),
        (changed('<mass value="2.0"/>', "<mass/>"), "must be 1 number"),
        (changed('<mass value="2.0"/>', ""), "the inertial of link 'base' has no <mass>"),
        (changed(BASE_INERTIA, ""), "the inertial of link 'base' has no <inertia>"),
        *(
            (changed('armature="0.005"', f'armature="{bad}"'), "armature of joint")
            for bad in ("abc", "-1", "nan")
        ),
        (inertia(-1, 1, 1), "inertia ixx of link 'base'"),
        (inertia(1, "inf", 1), "inertia iyy of link 'base'"),
        (inertia(1, 1, 1, xy=5), "principal moments -4, 1, 6"),
        (changed('<origin xyz="', '<origin rpy="0 inf 0" xyz="'), "origin rpy"),
        (changed('<origin xyz="', '<origin rpy="1e300 0 0" xyz="'), "origin rpy"),
        (changed("<box size=", '<box size="a b c" old='), "box size of link 'base'"),
        (changed('effort="8.5"', 'effort="nan"'), "limit effort of joint 'left_hip_frontal'"),
        (changed('effort="8.5"', ""), "limit effort of joint 'left_hip_frontal'"),
        (changed('friction="0"', 'friction="nan"'), "dynamics friction"),
        (
            with_end('<material name="m"><color rgba="nan"/></material>'),
            "color rgba of material 'm'",
        ),
        (with_end(link("left_hip")), "two links are named 'left_hip'"),
        (changed('name="left_knee"', 'name="right_knee"'), "two joints are named 'right_knee'"),
        (with_end(joint("back", "left_foot", "base")), "go round in a circle"),
        (
            with_end(link("a") + link("b") + joint("1", "a", "b") + joint("2", "b", "a")),
            "go round in a circle",
        ),
        (with_end(link("a") + joint("1", "a", "a")), "go round in a circle"),
        (with_end(joint("1", "base", "left_foot")), "'left_foot' is the child of two joints"),
        ('<robot name="ghost"><link name="base"/></robot>', "total mass is 0"),
        (with_end(link("alone")), "'base' and 'alone' are both without a parent"),
        (
            changed('<child link="left_hip"/>', '<child link="nothing"/>'),
            "the child of joint 'left_hip_frontal'",
        ),
        (changed('<parent link="base"/>', ""), "the parent of joint 'left_hip_frontal'"),
        (changed(KNEE, '<joint type="revolute">'), "name of a joint"),
        (HARPY.replace("left_hip", "left&#10;hip"), r"got 'left\nhip"),
        (HARPY.replace("left_hip", "left\u202ehip"), "got 'left\\u202ehip"),
        (HARPY.replace('"left_hip"', f'"{"x" * 100_000}"'), "1 to 200 printable characters"),
        *(
            (
                changed(KNEE, KNEE.replace("revolute", kind)),
                f"joint 'left_knee' is of type '{kind}'",
            )
            for kind in ("planar", "floating", "spiral")
        ),
        (changed(KNEE, '<joint name="left_knee">'), "joint 'left_knee' is of type None"),
        (changed('<axis xyz="1 0 0"/>', '<axis xyz="1 0"/>'), "must be 3 numbers"),
        (
            changed('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'),
            "axis of joint 'left_hip_frontal' is zero",
        ),
        (
            HARPY.replace("left_foot", "[/red]&lt;b"),
            "no foot frame 'left_foot'; its links, ends of limbs first: ",
        ),
        (chain(60), "first: l59, l0, l1"),
        (
            f'<robot name="r">{link("a")}{link("b", "")}{joint("j", "a", "b", "revolute")}</robot>',
            "singular: some joint moves no mass and has no armature, most likely 'j'",
        ),
    ],
    ids=lambda value: value[:40] if len(value) < 70 else "",
)
def test_is_refused_in_one_line(tmp_path, capfd, text, says):
    path = tmp_path / "strange.urdf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotError) as caught:
        load_harpy(path)
    message = str(caught.value)
    assert says in message
    assert "strange.urdf" in message
    assert message.isprintable()
    assert len(message) < 700
    assert caught.value.path == path
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "content",
    [
        *(
            b"",
            b"   \n",
            b"not xml at all",
            b"<robot/>",
            b"<robot name='a'></robot>",
            b"<html><link/></html>",
        ),
        *(b"<?xml version='1.0'?>", b"\x00\x01\x02\xff\xfe", bytes(range(256)) * 8),
        *(
            b"<?xml version='1.0' encoding='%s'?><robot name='a'><link name='b'/></robot>" % e
            for e in (b"no", b"gbk")
        ),
    ],
    ids=lambda content: repr(content[:50]),
)
def test_what_is_no_urdf_is_refused(tmp_path, content):
    path = tmp_path / "bad.urdf"
    path.write_bytes(content)
    with pytest.raises(RobotError, match=r"bad\.urdf"):
        load_harpy(path)


def test_what_is_no_file_is_refused(tmp_path):
    for path in (Path("/dev/zero"), tmp_path, tmp_path / "nowhere.urdf"):
        with pytest.raises(RobotError, match="no URDF") as caught:
            load_harpy(path)
        assert caught.value.path == path


def test_what_is_checked_is_what_is_read(tmp_path):
    """Blanks, other encodings and an axis of a fixed joint mean the same to us and to Pinocchio."""
    desired = pin.buildModelFromUrdf(str(ROOT / "urdf" / "harpy.urdf"), pin.JointModelFreeFlyer())
    path = tmp_path / "same.urdf"
    blanks = changed('<mass value="2.0"/>', '<mass value=" 2.0\t"/>').replace(
        'xyz="1 0 0"', 'xyz="1\n0  0 "'
    )
    fixed = HARPY.replace('type="fixed">', 'type="fixed"><axis xyz="0 0 0"/>')
    assert fixed != HARPY
    for content in (HARPY.encode(), HARPY.encode("utf-16"), blanks.encode(), fixed.encode()):
        path.write_bytes(content)
        model = load_harpy(path).model
        np.testing.assert_array_equal(model.armature[6:], 0.005)
        model.armature = desired.armature
        assert model == desired


def test_continuous_joints_are_revolute_without_limits(tmp_path):
    knee = KNEE.replace("revolute", "continuous")
    path = tmp_path / "continuous.urdf"
    path.write_text(changed(KNEE, knee))
    robot, desired = load_harpy(path), load_harpy()
    place = robot.joints.index("left_knee")
    assert (robot.joint_lower[place], robot.joint_upper[place]) == (-np.inf, np.inf)
    assert robot.torque_limit[place] == desired.torque_limit[place] > 0.0
    robot.model.lowerPositionLimit, robot.model.upperPositionLimit = (
        desired.model.lowerPositionLimit,
        desired.model.upperPositionLimit,
    )
    assert robot.model == desired.model
    head, _, tail = changed(KNEE, knee).partition(knee)
    limit = tail[tail.index("<limit") :].partition("/>")[0] + "/>"
    path.write_text(head + knee + tail.replace(limit, "", 1))
    robot = load_harpy(path)
    assert robot.torque_limit[place] == robot.model.velocityLimit[6 + place] == np.inf
    np.testing.assert_array_equal(
        np.delete(robot.torque_limit, place), np.delete(desired.torque_limit, place)
    )


def test_joints_that_mimic_follow(tmp_path):
    path = tmp_path / "mimic.urdf"
    path.write_text(changed(KNEE, f'{KNEE}<mimic joint="right_knee" multiplier="x"/>'))
    with pytest.raises(RobotError, match="multiplier of joint 'left_knee'"):
        load_harpy(path)
    path.write_text(changed(KNEE, f'{KNEE}<mimic joint="right_knee"/>'))
    assert load_harpy(path).joints == tuple(n for n in load_harpy().joints if n != "left_knee")
    path.write_text(changed(KNEE, f'{KNEE}<mimic joint="no_knee"/>'))
    with pytest.warns(UserWarning, match="mimic none that moves.*'left_knee'"):
        assert load_harpy(path).model == load_harpy().model


def test_what_a_fixed_joint_cannot_use_is_ignored(tmp_path):
    path = tmp_path / "fixed.urdf"
    rest = (
        '<limit lower="1" upper="-1"/><dynamics damping="nan"/><axis xyz="a"/><mimic '
        'joint="left_knee"/>'
    )
    path.write_text(HARPY.replace('type="fixed">', f'type="fixed">{rest}'))
    assert rest in path.read_text()
    assert load_harpy(path).model == load_harpy().model


def test_names_with_markup_are_names(tmp_path):
    path = tmp_path / "markup.urdf"
    path.write_text(
        HARPY.replace('name="harpy"', 'name="[/red]&lt;script&gt;"').replace(
            "left_knee", "[b]&amp;left"
        )
    )
    robot = load_harpy(path)
    assert robot.name == "[/red]<script>"
    assert robot.joints[2] == "[b]&left"


def test_inertia_is_judged_by_what_moves_together(tmp_path):
    """A camera of impossible inertia, fixed to a body that outweighs it, is found in the files of
    real robots.
    """
    camera = BALL.replace('izz="1"', 'izz="2.5"')
    base = (
        BALL.replace('value="1"', 'value="10"')
        .replace('"1" ixy', '"10" ixy')
        .replace('iyy="1"', 'iyy="10"')
    )
    path = tmp_path / "camera.urdf"
    both = link("base", base) + link("camera", camera) + joint("j", "base", "camera")
    path.write_text(f'<robot name="r">{both}</robot>')
    assert load_robot(path, feet=()).mass == 11.0
    path.write_text(f'<robot name="r">{link("camera", camera)}</robot>')
    with pytest.warns(UserWarning, match="larger than the sum"):
        assert load_robot(path, feet=()).mass == 1.0


def test_joints_without_torque_are_warned_of(tmp_path: Path) -> None:
    text = load_harpy().urdf.read_text()
    limp = tmp_path / "limp.urdf"
    limp.write_text(text.replace('effort="8.5"', 'effort="0"', 2))
    with pytest.warns(
        UserWarning, match=r"limp.urdf': joints of effort 0, .* 'left_hip_frontal' and 1 more"
    ) as said:
        robot = load_robot(limp, feet=("left_foot", "right_foot"))
    assert sorted(robot.torque_limit) == [8.5] * 4 + [np.inf] * 2
    assert [warning.filename for warning in said] == [__file__]


FILES = 100


def test_hostile_files(robot, tmp_path, capfd, fuzz):
    rng = np.random.default_rng(1)
    text, path = robot.urdf.read_text(), tmp_path / "hostile.urdf"
    read = 0
    for k in range(FILES * fuzz):
        path.write_bytes(spoil_urdf(rng, text))
        made, _ = outcome(hp.load_harpy, path)
        assert capfd.readouterr() == ("", "")
        if made is None:
            continue
        read += 1
        if k % 4 == 0:
            outcome(few_ticks, path, CONTROLLERS[k % 3])
            capfd.readouterr()
    assert 0.1 * FILES * fuzz < read < 0.9 * FILES * fuzz


SHAPES = (
    "<visual/>",
    "<collision/>",
    "<visual><geometry/></visual>",
    "<visual><geometry><capsule radius='1' length='1'/></geometry></visual>",
    "<visual><geometry><box size='1 1 1'/></geometry><material/></visual>",
    "<visual><geometry><mesh/></geometry></visual>",
)


def test_shapes_that_no_reader_knows_are_read_over_in_silence(robot, tmp_path, capfd):
    """They are no part of the model: Pinocchio's reader tells of each on standard error."""
    path = tmp_path / "shapes.urdf"
    for shape in SHAPES:
        path.write_text(
            robot.urdf.read_text().replace('<link name="base">', f'<link name="base">{shape}', 1)
        )
        assert hp.load_harpy(path).model == robot.model
        assert capfd.readouterr() == ("", "")
    path.write_text(
        robot.urdf.read_text().replace("</robot>", "<material/><material name='a'/></robot>")
    )
    assert hp.load_harpy(path).model == robot.model
    assert capfd.readouterr() == ("", "")


def own(robot, tmp_path, *changes):
    """Harpy's file with pairs of texts replaced."""
    text = robot.urdf.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "own.urdf"
    path.write_text(text)
    return path


def test_of_a_link_and_a_joint_with_one_name_the_link_is_the_frame(robot, tmp_path):
    """Also of feet, in flat ones and in a drawing."""
    path = own(robot, tmp_path, ('<joint name="left_foot_fixed"', '<joint name="left_foot"'))
    same = hp.load_robot(
        path, feet=robot.feet, flat_feet={"left_foot": hp.FlatFoot(length=0.1, width=0.1)}
    )
    assert same.model.frames[same.frame_id("left_foot")].type == pin.FrameType.BODY
    assert same.model.frames[same.frame_id("joint:left_foot")].type == pin.FrameType.FIXED_JOINT
    assert load_visuals(same)


def test_the_base_is_the_first_link_that_is_something(robot, tmp_path):
    """``base_footprint`` and another link are frames below it, and a posture of the robot is as
    without them.
    """
    name = '<robot name="harpy">'
    roots = """<link name="base_footprint"/><link name="stand"/>
      <joint name="a" type="fixed"><parent link="base_footprint"/><child link="stand"/>
        <origin xyz="0 0 0.2"/></joint>
      <joint name="b" type="fixed"><parent link="stand"/><child link="base"/>
        <origin xyz="0 0.1 0.3" rpy="0 0 0.5"/></joint>"""
    path = own(robot, tmp_path, (name, name + roots))
    with_roots = hp.load_robot(path, feet=robot.feet, thrusters=robot.thrusters)
    for i, body in enumerate(robot.model.inertias):
        assert with_roots.model.inertias[i].isApprox(body, 1e-14)
        assert with_roots.model.jointPlacements[i].isApprox(robot.model.jointPlacements[i], 1e-14)
    place = with_roots.model.frames[with_roots.frame_id("base_footprint")].placement
    turn, up = pin.rpy.rpyToMatrix(0.0, 0.0, 0.5), np.array((0.0, 0.1, 0.5))
    expected = pin.SE3(turn, up).inverse()
    np.testing.assert_allclose(place.homogeneous, expected.homogeneous, atol=1e-15)
    assert len(load_visuals(with_roots)) == len(load_visuals(robot))


def test_infinite_limits_are_limits(robot, tmp_path):
    effort = re.search(r'effort="[^"]*"', robot.urdf.read_text())[0]
    own_robot = hp.load_robot(own(robot, tmp_path, (effort, 'effort="inf"')), feet=robot.feet)
    assert np.isinf(own_robot.torque_limit).sum() == 1
    assert np.isinf(robot.torque_limit).sum() == 0


@pytest.mark.parametrize(("low", "high"), [(3.6, 5.9), (-150.0, -20.0), (-90.0, 90.0)])
def test_ranges_far_from_zero_are_said(robot, tmp_path, low, high):
    limits = re.search(r'lower="[^"]*" upper="[^"]*"', robot.urdf.read_text())[0]
    path = own(robot, tmp_path, (limits, f'lower="{low}" upper="{high}"'))
    with pytest.warns(
        UserWarning, match=rf"range of joint '.*' \({low:g} to {high:g} rad\) is far from zero"
    ):
        hp.load_robot(path, feet=robot.feet)


def test_a_posture_is_found_within_the_next_turn():
    """A dog whose knees have their zero one turn away bends them by an angle of that range."""
    model = pin.Model()
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.appendBodyToJoint(
        parent, pin.Inertia(8.0, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity()
    )
    feet = []
    for k, (x, y) in enumerate(((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))):
        joint, place = 1, np.array((x, y, 0.0))
        for part, kind, low, high in (
            ("a", "X", -0.8, 0.8),
            ("b", "Y", -1.5, 3.4),
            ("c", "Y", 3.6, 5.9),
        ):
            limits = [np.array([value]) for value in (10.0, 10.0, low, high)]
            joint = model.addJoint(
                joint,
                getattr(pin, f"JointModelR{kind}")(),
                pin.SE3(np.eye(3), place),
                f"{part}{k}",
                *limits,
            )
            model.appendBodyToJoint(
                joint, pin.Inertia(0.5, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity()
            )
            place = np.array((0.0, 0.0, 0.0 if part == "a" else -0.2))
        feet.append(f"foot{k}")
        model.addFrame(
            pin.Frame(feet[-1], joint, 0, pin.SE3(np.eye(3), place), pin.FrameType.OP_FRAME)
        )
    dog = hp.Robot(model, None, tuple(feet), (), np.inf)
    angles = find_posture(dog)
    assert ((angles >= dog.joint_lower) & (angles <= dog.joint_upper)).all()


def test_a_moving_mass_without_inertia_is_said(robot, tmp_path):
    none = '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    text = re.sub(r"<inertia [^>]*/>", none, robot.urdf.read_text())
    path = tmp_path / "points.urdf"
    path.write_text(text)
    with pytest.warns(
        UserWarning, match=r"points.urdf': joints whose body has a mass, no inertia: "
    ):
        hp.load_robot(path, feet=robot.feet)


XACRO = """<robot name="harpy" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="half" value="{half}"/>
  <xacro:macro name="body" params="name">
    <link name="${{name}}"><inertial><mass value="${{2 * half}}"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></xacro:macro>
  <xacro:body name="base"/></robot>"""


@pytest.mark.needs("xacrodoc")
def test_a_xacro_file_is_expanded(tmp_path):
    path = tmp_path / "robot.urdf.xacro"
    path.write_text(XACRO.format(half=1.5))
    assert hp.load_robot(path, feet=()).mass == 3.0
    (tmp_path / "shapes.xacro").write_text(XACRO.format(half=2.5))
    include = (
        '<robot name="harpy" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include '
        'filename="shapes.xacro"/>'
    )
    path.write_text(f"{include}</robot>")
    assert hp.load_robot(path, feet=()).mass == 5.0  # whatever the working directory is
    path.write_text(XACRO.format(half="${nothing}"))
    with pytest.raises(RobotError, match=r"xacro cannot expand it: .*nothing"):
        hp.load_robot(path, feet=())


def test_without_xacrodoc_a_xacro_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    path = tmp_path / "robot.xacro"
    path.write_text(XACRO.format(half=1.5))
    with pytest.raises(
        RobotError, match=r"robot.xacro': it is a xacro file: pip install xacrodoc, or"
    ):
        hp.load_robot(path, feet=())


@pytest.mark.parametrize("frame", ["0 0 0", "0 -1.5707963267948966 0", "0.3 0.7 -2.0"])
@pytest.mark.parametrize(
    ("size", "axes"), [("0.2 0.08 0.04", [0, 1, 2]), ("0.04 0.2 0.08", [2, 0, 1])]
)
def test_soles_are_the_boxes_of_links_that_move_with_the_foot(tmp_path, frame, size, axes):
    """Whichever axes box and frame, a link of its own, have: the sole is level, and its x axis to
    the front.
    """
    roll, pitch, yaw = pin.rpy.matrixToRpy(np.eye(3)[:, axes])
    box = (
        f'<collision><origin xyz="0.03 0 -0.04" rpy="{roll} {pitch} {yaw}"/><geometry><box '
        f'size="{size}"/></geometry>'
    )
    text = biped_urdf(sole=frame)
    for side in "LR":
        text = text.replace(
            f'<link name="{side}_tilt">', f'<link name="{side}_tilt">{box}</collision>'
        )
    (tmp_path / "biped.urdf").write_text(text)
    feet = ("L_sole", "R_sole")
    robot = hp.load_robot(tmp_path / "biped.urdf", feet=feet)
    assert robot.flat_feet == (4, 4)
    foot = robot.model.frames[robot.frame_id("L_tilt")].placement
    corners = [
        foot.actInv(robot.model.frames[robot.frame_id(name)].placement) for name in robot.feet[:4]
    ]
    expected = [(0.03 + x, y, -0.06) for x in (0.1, -0.1) for y in (0.04, -0.04)]
    np.testing.assert_allclose([corner.translation for corner in corners], expected, atol=1e-9)
    np.testing.assert_allclose([corner.rotation for corner in corners], [np.eye(3)] * 4, atol=1e-9)
    assert hp.load_robot(tmp_path / "biped.urdf", feet=feet, flat_feet={}).feet == feet
