"""The estimator on the log of others, from files of the same format: read, estimated, and what is
missing said.
"""

from pathlib import Path

import h5py
import numpy as np
import pytest

from comparison.cli.program import app
from comparison.studies import recorded as cassie
from harpy_pin.errors import InputError

SAMPLES = cassie.BEGIN + 400
FALL = 9.81
_INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
_LINK = '<link name="{0}"><inertial><mass value="{1}"/>' + _INERTIA + "</inertial></link>"
_JOINT = (
    '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><origin '
    'xyz="{3}"/><axis xyz="{4}"/>'
)
_LIMIT = '<limit effort="10" velocity="10"/></joint>'


def urdf() -> str:
    """A pelvis with two straight legs of seven joints, whose toes are where Cassie's are called."""
    text = '<robot name="cassie">' + _LINK.format("pelvis", 10)
    for side, y in (("left", 0.1), ("right", -0.1)):
        parent, links = "pelvis", [*(f"{side}_link_{n}" for n in range(6)), f"{side}_toe"]
        for n, (joint, link) in enumerate(zip(cassie.JOINTS, links, strict=True)):
            place, axis = (
                f"0 {y if n == 0 else 0} -0.1",
                "1 0 0" if n == 0 else "0 0 1" if n == 1 else "0 1 0",
            )
            text += (
                _LINK.format(link, 1)
                + _JOINT.format(f"{joint}_{side}", parent, link, place, axis)
                + _LIMIT
            )
            parent = link
    return text + "</robot>"


@pytest.fixture
def clones(tmp_path: Path) -> Path:
    """A robot that stands, its inertial unit upside down."""
    file = tmp_path / cassie.SOURCES[1] / "urdf" / "cassie.urdf"
    file.parent.mkdir(parents=True)
    file.write_text(urdf())
    still, down = np.zeros((SAMPLES, 3)), np.diag([1.0, -1.0, -1.0])
    log = dict.fromkeys(("gyroscope", "velocity"), still)
    log["accelerometer"] = np.tile([0.0, 0.0, -FALL], (SAMPLES, 1))
    log["position"] = np.tile([0.3, 0.2, 0.7 + cassie.PLACE[2]], (SAMPLES, 1))
    log |= {"encoders": np.zeros((SAMPLES, 14)), "contact": np.ones((SAMPLES, 2))}
    log["rotation"] = np.tile(down, (SAMPLES, 1, 1))
    for name, place in cassie.SIGNALS.items():
        path = tmp_path / cassie.SOURCES[0] / cassie.LOG / f"{place}.mat"
        path.parent.mkdir(parents=True, exist_ok=True)
        values = log[name]
        with h5py.File(path, "w") as content:
            content["#refs#/x"] = values.transpose(0, 2, 1) if values.ndim == 3 else values.T
            content["#refs#/period"] = np.array([cassie.PERIOD])
    return tmp_path


def test_the_log_is_read_and_estimated(clones: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = cassie.estimate_log(clones)
    assert found["status"] == "good"
    assert found["velocity_cm_s"] < 1.0
    assert found["tilt_deg"] < 0.2
    assert found["trajectory_mm"] < 1.0
    app(
        ["recorded", "--data", str(clones), "--json", str(clones / "a.json")], standalone_mode=False
    )
    assert "Cassie" in capsys.readouterr().out


def test_springs_and_toes_are_joints_and_feet(clones: Path) -> None:
    robot = cassie.load_cassie(clones)
    assert robot.feet == ("left_foot", "right_foot")
    assert len(robot.joints) == 14


@pytest.mark.parametrize("name", ["urdf/cassie.urdf", f"{cassie.LOG}/measurements/contact.mat"])
def test_what_is_missing_is_said(clones: Path, name: str) -> None:
    source = cassie.SOURCES["urdf" in name]
    (clones / source / name).unlink()
    with pytest.raises(InputError, match=f"git clone https://github.com/UMich-BipedLab/{source}"):
        cassie.estimate_log(clones)


def test_a_robot_with_other_joints_is_refused(clones: Path) -> None:
    file = clones / cassie.SOURCES[1] / "urdf" / "cassie.urdf"
    file.write_text(urdf().replace("toe_joint_left", "toe"))
    with pytest.raises(InputError, match=r"other joints: .*toe"):
        cassie.estimate_log(clones)


def test_a_damaged_file_is_no_file_of_the_log(clones: Path) -> None:
    (clones / cassie.SOURCES[0] / cassie.LOG / "measurements/contact.mat").write_bytes(b"no matlab")
    with pytest.raises(InputError, match="is no file of the log"):
        cassie.estimate_log(clones)
