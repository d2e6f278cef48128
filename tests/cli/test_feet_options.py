"""Feet of a file on the command line: by pattern, flat, and what is said of wheels and of legs with
an ankle.
"""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.cli.walk_options import read_robot_options
from harpy_pin.model.catalogue import CATALOGUE

pytestmark = needs_robots
SOLE = hp.FlatFoot(length=0.2, width=0.12, centre=(0.01, 0.0, -0.02))


@pytest.fixture(scope="module")
def talos():
    return str(CATALOGUE["talos"].path())


def test_a_humanoid_from_a_file_walks(talos, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    robot = ("--robot", talos, "--feet", "*_sole_link", "--flat-feet", "0.2x0.12")
    code, out, err = command(
        "walk", *robot, "--duration", 0.3, "--friction", 0.6, "--save", "humanoid.npz"
    )
    assert (code, err) == (0, "")
    assert "walking gait" in " ".join(out.split())
    feet = [f"{side}_sole_link_{k}" for side in ("left", "right") for k in range(4)]
    assert hp.Run.load("humanoid.npz").metadata["feet"] == feet


def test_soles_and_patterns_are_those_of_python(talos):
    feet = ("left_sole_link", "right_sole_link")
    read = read_robot_options(talos, "*_sole_link", None, "0.2x0.12@0.01,0,-0.02")
    expected = hp.load_robot(talos, feet=feet, flat_feet=dict.fromkeys(feet, SOLE))
    assert (read.feet, read.flat_feet) == (expected.feet, expected.flat_feet)
    assert read.model == expected.model
    turned = read_robot_options(talos, "*_sole_link", None, "0.2x0.12@0.01,0,-0.02,0,0.1,0")
    sole = replace(SOLE, orientation=(0.0, 0.1, 0.0))
    assert (
        turned.model == hp.load_robot(talos, feet=feet, flat_feet=dict.fromkeys(feet, sole)).model
    )
    dog = read_robot_options(str(CATALOGUE["go2"].path()), "F?_foot,R*_foot", None)
    assert dog.feet == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


SHAPES = {
    "as it is": (None, (0.17, 0.06), (0.035, 0.0, -0.035)),  # spheres of radius 5 mm
    "a box that is turned": ('<box size="0.08 0.2 0.02"/>', (0.2, 0.08), (0.035, 0.01, -0.04)),
    "a cylinder that lies, and a capsule": (
        '<cylinder radius="0.01" length="0.2"/>,<capsule radius="0.01" length="0.2"/>',
        (0.2, 0.06),
        (0.035, 0.0, -0.04),
    ),
}
"""Shapes of a foot at (35, 10, −30) mm, or at ±30 mm to the side if there are two, and the sole
that they are.
"""


@pytest.mark.parametrize("shapes", SHAPES)
def test_soles_are_found_in_the_file(shapes, tmp_path):
    given, sides, centre = SHAPES[shapes]
    tree = ElementTree.parse(CATALOGUE["g1"].path())
    for link in tree.getroot().findall("link"):
        if given is not None and link.get("name").endswith("_ankle_roll_link"):
            for collision in link.findall("collision"):
                link.remove(collision)
            texts = given.split(",")
            for text, y in zip(texts, (0.01,) if len(texts) == 1 else (0.03, -0.03), strict=True):
                turn = "0 0 1.5707963267948966" if "box" in text else "0 1.5707963267948966 0"
                collision = ElementTree.SubElement(link, "collision")
                ElementTree.SubElement(collision, "origin", xyz=f"0.035 {y} -0.03", rpy=turn)
                ElementTree.SubElement(collision, "geometry").append(ElementTree.fromstring(text))
    tree.write(tmp_path / "robot.urdf")
    robot = read_robot_options(str(tmp_path / "robot.urdf"), "*_ankle_roll_link", None)
    length, width = sides
    for k, (a, b) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        place = robot.model.frames[
            robot.frame_id(f"left_ankle_roll_link_{k}")
        ].placement.translation
        np.testing.assert_allclose(
            place - centre, (0.5 * a * length, 0.5 * b * width, 0.0), atol=1e-9
        )
    assert robot.flat_feet == (4, 4)


def test_soles_of_an_mjcf_are_its_own(tmp_path):
    pytest.importorskip("mujoco")
    leg = "".join(
        f'<body><inertial pos="0 0 -0.05" mass="0.5" diaginertia="0.01 0.01 0.01"/><joint '
        f'axis="{axis}"/>'
        for axis in ("0 0 1", "1 0 0", "0 1 0", "0 1 0", "0 1 0")
    )
    foot = (
        '<body name="{0}" pos="0 0 -0.4"><joint axis="1 0 0"/><geom type="box" size="0.1 0.04 '
        '0.01"/></body>'
    )
    legs = [
        f'<body pos="0 {y} 0">{leg}{foot.format(name)}{5 * "</body>"}</body>'
        for name, y in (("l", 0.1), ("r", -0.1))
    ]
    body = '<body pos="0 0 0.5"><freejoint/><geom size="0.1" mass="5"/>' + "".join(legs) + "</body>"
    path = tmp_path / "biped.xml"
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    found = read_robot_options(str(path), "l,r", None)
    assert found.model == hp.load_robot(path, feet=("l", "r")).model
    assert found.flat_feet == (4, 4)


def test_a_leg_of_six_joints_with_a_point_is_told_of_soles(talos, capsys):
    read_robot_options(talos, "*_sole_link", None)
    said = capsys.readouterr().err
    assert (
        "left_sole_link, right_sole_link behind six joints, taken as points: for soles give "
        "--flat-feet" in said
    )
    read_robot_options(talos, "*_sole_link", None, "0.2x0.12")
    read_robot_options("go2", "*_foot", None)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
def test_wheels_are_said_not_to_roll(tmp_path, capsys, kind):
    """Their joints turn without end, or so far that no leg's joint does."""
    root = ElementTree.parse(CATALOGUE["go2"].path()).getroot()
    for joint in root.findall("joint"):
        if joint.get("name").endswith("_foot_joint"):
            joint.set("type", kind)
            joint.find("axis").set("xyz", "0 1 0")
            ElementTree.SubElement(
                joint, "limit", lower="-1e6", upper="1e6", effort="10", velocity="30"
            )
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    ElementTree.ElementTree(root).write(tmp_path / "wheeled.urdf")
    read_robot_options(str(tmp_path / "wheeled.urdf"), "*_foot", None)
    assert (
        "FL_foot, FR_foot, RL_foot, RR_foot on joints that turn without end: wheels do not"
        in capsys.readouterr().err
    )


def test_wheels_of_an_mjcf_are_said_not_to_roll_either(tmp_path, capsys):
    pytest.importorskip("mujoco")
    wheel = '<body name="{0}" pos="{1} 0.2 -0.3"><joint axis="0 1 0"/><geom size="0.05"/></body>'
    leg = (
        '<body pos="{1} 0.2 0"><joint axis="0 1 0"/><geom size="0.02"/>'
        + wheel.format("{0}", 0)
        + "</body>"
    )
    text = "".join(leg.format(name, x) for name, x in (("a", 0.2), ("b", -0.2)))
    text = f'<body><freejoint/><geom size="0.1"/>{text}</body>'
    (tmp_path / "wheels.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    read_robot_options(str(tmp_path / "wheels.xml"), "a,b", None)
    assert (
        "a, b on joints that turn without end: wheels do not roll here" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "flat",
    [
        "0.2",
        "0.2x",
        "axb",
        "0.2x0.1@1,2",
        "0.2x0.1@0,0,0,1",
        "0.2x0.1x0.1",
        "0x0.1",
        "0.2x0.1@a,b,c",
    ],
)
def test_soles_that_are_none(talos, flat):
    with pytest.raises(
        hp.InputError, match=r"--flat-feet must look like 0\.2x0\.09|length of a flat foot must be"
    ):
        read_robot_options(talos, "*_sole_link", None, flat)


def test_a_pattern_that_fits_nothing_lists_the_links(talos):
    with pytest.raises(
        hp.RobotError, match=r"no foot frame '\*_paw'; its links, ends of limbs first: "
    ):
        read_robot_options(talos, "*_paw", None)
