"""Feet of a file on the command line: by pattern, flat, and what is said of wheels and of legs with an ankle."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

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
    code, out, err = command("walk", *robot, "--duration", 0.3, "--friction", 0.6, "--save", "humanoid.npz")
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
    assert turned.model == hp.load_robot(talos, feet=feet, flat_feet=dict.fromkeys(feet, sole)).model
    dog = read_robot_options(str(CATALOGUE["go2"].path()), "F?_foot,R*_foot", None)
    assert dog.feet == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


def test_a_leg_of_six_joints_with_a_point_is_told_of_soles(talos, capsys):
    read_robot_options(talos, "*_sole_link", None)
    said = capsys.readouterr().err
    assert "left_sole_link, right_sole_link behind six joints, taken as points: for soles give --flat-feet" in said
    read_robot_options(talos, "*_sole_link", None, "0.2x0.12")
    read_robot_options("go2", "*_foot", None)
    assert capsys.readouterr().err == ""


def test_wheels_are_said_not_to_roll(tmp_path, capsys):
    root = ElementTree.parse(CATALOGUE["go2"].path()).getroot()
    for joint in root.findall("joint"):
        if joint.get("name").endswith("_foot_joint"):
            joint.set("type", "continuous")
            joint.find("axis").set("xyz", "0 1 0")
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    ElementTree.ElementTree(root).write(tmp_path / "wheeled.urdf")
    read_robot_options(str(tmp_path / "wheeled.urdf"), "*_foot", None)
    assert (
        "FL_foot, FR_foot, RL_foot, RR_foot on joints that turn without end: wheels do not" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "flat", ["0.2", "0.2x", "axb", "0.2x0.1@1,2", "0.2x0.1@0,0,0,1", "0.2x0.1x0.1", "0x0.1", "0.2x0.1@a,b,c"]
)
def test_soles_that_are_none(talos, flat):
    with pytest.raises(hp.InputError, match=r"--flat-feet must look like 0\.2x0\.09|length of a flat foot must be"):
        read_robot_options(talos, "*_sole_link", None, flat)


def test_a_pattern_that_fits_nothing_lists_the_links(talos):
    with pytest.raises(hp.RobotError, match=r"no foot frame '\*_paw'; its links, ends of limbs first: "):
        read_robot_options(talos, "*_paw", None)
