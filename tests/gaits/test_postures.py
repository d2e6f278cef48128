"""Postures: no gait takes one that the robot's joints cannot have."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.model import CATALOGUE


@needs_robots
@pytest.mark.parametrize("kind", [hp.Standing, hp.WalkingGait])
def test_an_angle_beyond_its_limits_is_refused_by_name(kind: type) -> None:
    robot = hp.load_robot("go2")
    bent_the_wrong_way = np.tile((0.0, -0.7, 1.4), 4)
    with pytest.raises(hp.InputError, match=r"'FL_calf_joint' is at 1\.4 rad, .* -2\.7227 to -0\.83776 rad"):
        kind(robot, posture=bent_the_wrong_way)


@needs_robots
def test_hovering_refuses_it_too() -> None:
    robot = hp.load_robot("borinot")
    with pytest.raises(hp.InputError, match="beyond its limits"):
        hp.Hovering(robot, posture=robot.joint_upper + 0.1)


@needs_robots
@pytest.mark.parametrize("name", CATALOGUE)
def test_postures_of_the_catalogue_are_within_the_limits(name: str) -> None:
    robot = hp.load_robot(name)
    posture = np.zeros(len(robot.joints)) if robot.posture is None else robot.posture
    assert np.all((robot.joint_lower <= posture) & (posture <= robot.joint_upper))
    (hp.Standing if robot.feet else hp.Hovering)(robot)


def test_joints_without_limits_are_free(tmp_path: Path) -> None:
    text = hp.load_harpy().urdf.read_text()
    free = tmp_path / "free.urdf"
    free.write_text(re.sub(r'lower="[^"]*" upper="[^"]*"', "", text))
    robot = hp.load_harpy(free)
    assert not np.any([robot.joint_lower, robot.joint_upper])
    hp.Standing(robot, [0.0, 0.7, -1.4] * 2)
