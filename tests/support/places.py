"""Where frames of a robot are."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

import harpy_pin as hp


def places(robot: hp.Robot, q: np.ndarray, names: Iterable[str] | None = None) -> np.ndarray:
    """(frames, 3) places of frames in a configuration, m; those of the feet where none are named."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return np.array([data.oMf[robot.frame_id(name)].translation for name in (robot.feet if names is None else names)])
