"""The public robots of example-robot-data: each is read as Pinocchio reads it, or refused for a
stated reason.
"""

import re
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import mass_matrix, places
from needs import needs_robots
from random_trees import random_state

import harpy_pin as hp
from harpy_pin.cli.app import main
from harpy_pin.errors import install_line
from harpy_pin.model import catalogue
from harpy_pin.model.catalogue import CATALOGUE, installed_data, known_name

INSTALLED = installed_data() is not None
WITH_FEET = [name for name, entry in CATALOGUE.items() if entry.feet]
FOLDER = CATALOGUE["solo12"].path().parents[2] if INSTALLED else Path()
URDFS = (
    sorted(str(path.relative_to(FOLDER)) for path in FOLDER.rglob("*.urdf")) if INSTALLED else []
)
REFUSED = {
    "romeo_description/urdf/romeo.urdf": "singular: some joint moves no mass",
    "romeo_description/urdf/romeo_laas_small.urdf": "what joint 'root_joint' moves: of its "
    "principal moments -0.02",
    "ur_description/urdf/ur3.urdf": "it has no <robot> with links",
}
SRDFS = {
    **{
        x: (f"{x}_description/srdf/{x}.srdf", "standing")
        for x in ("bolt", "a1", "b1", "go1", "go2", "hyq")
    },
    **dict.fromkeys(("solo8", "solo12"), ("solo_description/srdf/solo.srdf", "standing")),
    **{
        f"anymal_{x}": (f"anymal_{x}_simple_description/srdf/anymal.srdf", "standing") for x in "bc"
    },
    "talos": ("talos_data/srdf/talos.srdf", "half_sitting"),
}


def in_plain_terms(plain, model, q):
    """The same configuration with cosine and sine of each continuous joint."""
    result = pin.neutral(plain)
    result[:7] = q[:7]
    for joint in list(plain.joints)[2:]:
        angle = q[model.joints[joint.id].idx_q]
        result[joint.idx_q : joint.idx_q + joint.nq] = (
            angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        )
    return result


def terms(model, q, v):
    """Symmetric mass matrix, and bias."""
    return mass_matrix(model, q), pin.rnea(model, model.createData(), q, v, np.zeros(model.nv))


@needs_robots
@pytest.mark.parametrize("file", [file for file in URDFS if file not in REFUSED])
def test_robot_is_pinocchios(file, capfd):
    robot, plain = (
        hp.load_robot(FOLDER / file, feet=()),
        pin.buildModelFromUrdf(str(FOLDER / file), pin.JointModelFreeFlyer()),
    )
    model = robot.model
    assert list(model.names) == list(plain.names)
    assert model.nv == plain.nv == model.nq - 1
    assert capfd.readouterr() == ("", "")
    plain.armature = model.armature
    plain.effortLimit = np.where(
        np.array(plain.effortLimit) == 0.0, np.inf, plain.effortLimit
    )  # unknown ones
    one_number = [joint.nq == 1 for joint in list(plain.joints)[2:]]
    for ends in (model.lowerPositionLimit, model.upperPositionLimit):
        np.testing.assert_array_equal(np.isfinite(ends[7:]), one_number)
    root = model.frames[model.getFrameId(plain.frames[2].name, pin.FrameType.BODY)].placement
    links = {frame.name for frame in plain.frames if frame.type == pin.FrameType.BODY}
    for frame in plain.frames:
        frame.name = (
            f"joint:{frame.name}"
            if frame.type != pin.FrameType.BODY and frame.name in links
            else frame.name
        )
    assert (model == plain) == (all(one_number) and root.isIdentity(0.0))
    change = np.eye(model.nv)
    change[:6, :6] = root.toActionMatrixInverse()  # tiago_pro's root is below its base
    for seed in range(5):
        q, v = random_state(model, np.random.default_rng(seed))
        its = in_plain_terms(plain, model, q)
        its[:7] = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(q[:7]) * root)
        matrix, bias = terms(plain, its, change @ v)
        for ours, theirs in zip(
            terms(model, q, v), (change.T @ matrix @ change, change.T @ bias), strict=True
        ):
            np.testing.assert_allclose(
                ours, theirs, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(theirs).max())
            )


@needs_robots
@pytest.mark.parametrize("file", REFUSED)
def test_refused_for_a_reason(file):
    with pytest.raises(hp.RobotError) as caught:
        hp.load_robot(FOLDER / file, feet=())
    assert REFUSED[file] in str(caught.value)


@needs_robots
@pytest.mark.parametrize("name", WITH_FEET)
def test_catalogue_stands(name):
    robot, entry = hp.load_robot(name), CATALOGUE[name]
    assert robot.corners == tuple(4 if foot in entry.flat_feet else 1 for foot in entry.feet)
    corners = [
        [f"{foot}_{i}" for i in range(4)] if foot in entry.flat_feet else [foot]
        for foot in entry.feet
    ]
    assert robot.feet == tuple(name for names in corners for name in names)
    assert set(entry.angles) <= set(robot.joints)
    assert (robot.posture >= robot.joint_lower).all()
    assert (robot.posture <= robot.joint_upper).all()
    q, v = hp.Standing(robot).initial_state()
    np.testing.assert_array_equal(q[7:], robot.posture)
    assert not v.any()
    feet = places(robot, q)
    assert feet[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(feet[:, 2]) <= (3e-4 if robot.flat_feet else 1e-5)  # Standing allows 2e-3
    centre = pin.centerOfMass(robot.model, robot.model.createData(), robot.closed(q))
    if len(feet) == 4:
        assert (feet[:, :2].min(axis=0) < centre[:2]).all()
        assert (feet[:, :2].max(axis=0) > centre[:2]).all()
    else:  # between the soles, or a sole's length
        np.testing.assert_allclose(centre[:2], feet[:, :2].mean(axis=0), atol=0.05)
        if robot.flat_feet:
            assert (feet[:, :2].min(axis=0) < centre[:2] - 0.02).all()
            assert (feet[:, :2].max(axis=0) > centre[:2] + 0.02).all()


@needs_robots
@pytest.mark.parametrize("name", SRDFS)
def test_posture_is_that_of_the_srdf(name):
    robot, (file, configuration) = hp.load_robot(name), SRDFS[name]
    pin.loadReferenceConfigurations(robot.model, str(FOLDER / file), False)
    np.testing.assert_array_equal(
        robot.posture, robot.model.referenceConfigurations[configuration][7:]
    )


@needs_robots
def test_icub_stands_on_level_soles_with_its_centre_of_mass_above_their_middle():
    """Apart from the legs its posture is that of the SRDF, in which it leans on the front edge of
    tilted soles.
    """
    robot = hp.load_robot("icub")
    model, data = robot.model, robot.model.createData()
    pin.loadReferenceConfigurations(model, str(FOLDER / "icub_description/srdf/icub.srdf"), False)
    sagittal = [f"{side}_{name}" for side in "lr" for name in ("hip_pitch", "knee", "ankle_pitch")]
    different = np.flatnonzero(robot.posture != model.referenceConfigurations["half_sitting"][7:])
    assert sorted(robot.joints[j] for j in different) == sorted(sagittal)
    q = np.concatenate((np.zeros(6), [1.0], robot.posture))
    centre = pin.centerOfMass(model, data, q)
    corners = places(robot, q)
    assert np.ptp(corners[:, 2]) < 1e-3
    assert abs(centre[0] - corners[:, 0].mean()) < 0.01


@needs_robots
def test_a_name_takes_other_feet_and_thrusters():
    robot = hp.load_robot("solo12", feet=("FL_FOOT",), thrusters=("base_link",), thrust_limit=10.0)
    assert (robot.feet, robot.thrusters, robot.thrust_limit) == (("FL_FOOT",), ("base_link",), 10.0)


@needs_robots
def test_a_gait_for_two_legs_says_what_other_robots_take():
    with pytest.raises(
        hp.InputError, match=r"needs two feet, 'go2' has 4; use hp\.WalkingGait or hp\.Standing"
    ):
        hp.make_gait(hp.load_robot("go2"))
    with pytest.raises(hp.InputError, match=r"use hp\.Hovering"):
        hp.make_gait(hp.load_robot("iris"))


def test_names_and_paths(robot, tmp_path, monkeypatch):
    with pytest.raises(
        hp.InputError, match=r"unknown robot 'solo13'; valid names: a1, .*, solo12, "
    ):
        hp.load_robot("solo13")
    with pytest.raises(hp.InputError, match="unknown robot ''"):
        hp.load_robot("")
    with pytest.raises(hp.InputError, match="needs feet"):
        hp.load_robot(robot.urdf)
    with pytest.raises(
        hp.RobotError, match=r"no URDF at ./no/such\.urdf.: the file does not exist"
    ):
        hp.load_robot("/no/such.urdf")
    monkeypatch.chdir(tmp_path)
    Path("solo12").write_text("<robot/>")
    for path in (Path("solo12"), "./solo12", "solo12.urdf", str(tmp_path / "solo12"), "."):
        with pytest.raises(hp.RobotError):
            hp.load_robot(path, feet=())
    with pytest.raises(hp.RobotError, match="no <robot>"):
        hp.load_harpy("solo12")


def absent(name):
    raise PackageNotFoundError(name)


def test_without_the_extra(monkeypatch, capsys):
    monkeypatch.setattr(catalogue, "distribution", absent)
    with pytest.raises(
        hp.RobotError, match=r'solo12.urdf. is in example-robot-data: pip install -e ".*\[robots\]"'
    ):
        hp.load_robot("solo12")
    listed = robots_command(monkeypatch, capsys)
    assert f"is not installed: {install_line('robots')}" in listed
    assert all(name in listed for name in CATALOGUE)


@needs_robots
def test_command_and_page_list_the_same(monkeypatch, capsys):
    listed = robots_command(monkeypatch, capsys)
    assert installed_data() in listed
    page = (Path(__file__).resolve().parents[2] / "docs" / "robots.md").read_text()
    rows = [line.split("│")[1:-1] for line in listed.splitlines() if line.startswith("│")]
    assert [row[0].strip() for row in rows] == ["harpy", *CATALOGUE]
    for row in rows:
        assert re.search(rf"\b{row[0].strip()}\b", page), row[0]
        name = row[0].strip()
        robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
        assert float(row[1]) == pytest.approx(robot.mass, abs=0.005)
        assert int(row[2]) == len(robot.joints)


def robots_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["harpy", "robots"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    return capsys.readouterr().out


@needs_robots
def test_all_robots_at_a_glance():
    known = hp.robots()
    assert list(known) == ["harpy", *CATALOGUE]
    assert known["harpy"].mass == pytest.approx(4.02)
    go2, g1, iris = known["go2"], known["g1"], known["iris"]
    assert go2.feet == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    assert (go2.joints, go2.flat, g1.flat, iris.feet, iris.rotors) == (12, False, True, (), 4)
    assert go2.mass == pytest.approx(hp.load_robot("go2").mass)
    assert (go2.licence, g1.licence) == ("MPL-2.0", "BSD-3-Clause")


def test_without_their_files_names_are_known(monkeypatch):
    monkeypatch.setattr("harpy_pin.model.loading.installed_data", lambda: None)
    go2 = hp.robots()["go2"]
    assert (go2.mass, go2.joints, go2.licence) == (None, None, None)
    assert len(go2.feet) == 4


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("go2", "go2"),
        ("Go2", "go2"),
        ("unitree_g1", "g1"),
        ("ANYmal-C", "anymal_c"),
        ("anymal", "anymal_c"),
        ("solo", "solo12"),
        ("Solo 12", "solo_12"),
        ("Harpy", "harpy"),
    ],
)
def test_other_spellings(said, meant):
    expected = meant if meant in (*CATALOGUE, "harpy") else said
    assert known_name(said) == expected


@needs_robots
def test_they_are_understood_everywhere():
    assert hp.load_robot("Solo").name == "solo12"
    assert hp.Scenario(robot="ANYmal-C").robot == "anymal_c"
    assert hp.load_robot("go2").name == "go2"


@pytest.mark.parametrize(
    ("said", "meant"), [("goo2", "go2"), ("laikag", "laikago"), ("anymal_d", "anymal_")]
)
def test_typing_errors_get_a_suggestion(said, meant):
    for make in (hp.load_robot, lambda name: hp.Scenario(robot=name)):
        with pytest.raises(hp.InputError, match=f"did you mean '{meant}"):
            make(said)
    with pytest.raises(hp.InputError) as caught:
        hp.Scenario(robot="xyzzyx")
    assert "did you mean" not in str(caught.value)
    with pytest.raises(hp.InputError, match="did you mean 'FL_rod_end'"):
        raise hp.InputError.unknown("frame", "FL_rod_ed", ("RR_rod_end", "FL_rod_end"))
    with pytest.raises(hp.InputError, match="did you mean 'condensed'"):
        hp.Scenario(controller="condenced")
