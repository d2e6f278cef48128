"""The URDF that peers read is the robot."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from comparison.peers.model_file import links_of, write_model


@pytest.mark.parametrize("name", ["harpy", "solo12", "g1", "talos", "icub"])
def test_written_model_is_the_robots(tmp_path: Path, name: str) -> None:
    """Inverse dynamics and frames by Pinocchio, of the file and of the model."""
    robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
    write_model(robot, tmp_path / "robot.urdf")
    text, own = (tmp_path / "robot.urdf").read_text(), robot.model
    assert "mesh" not in text
    model = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"), pin.JointModelFreeFlyer())
    model.armature = own.armature
    assert list(model.names)[2:] == list(own.names)[2:]
    rng, data, own_data = np.random.default_rng(1), model.createData(), own.createData()
    q = pin.integrate(own, pin.neutral(own), rng.standard_normal(own.nv))
    v, a = rng.standard_normal((2, own.nv))
    np.testing.assert_allclose(
        pin.rnea(model, data, q, v, a), pin.rnea(own, own_data, q, v, a), rtol=1e-11, atol=1e-11
    )
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(own, own_data, q)
    links = links_of(robot)
    for link, frame in zip(
        links.contacts + links.thrusters, robot.feet + robot.thrusters, strict=True
    ):
        place, expected = data.oMf[model.getFrameId(link)], own_data.oMf[own.getFrameId(frame)]
        np.testing.assert_allclose(place.homogeneous, expected.homogeneous, atol=1e-12)
    for n, link in enumerate(links.soles):
        corners = [
            own_data.oMf[own.getFrameId(frame)].translation
            for frame in robot.feet[4 * n : 4 * n + 4]
        ]
        middle = data.oMf[model.getFrameId(link)].translation
        np.testing.assert_allclose(middle, np.mean(corners, axis=0), atol=1e-12)
