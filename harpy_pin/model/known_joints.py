"""What is known of a robot's joints beyond its URDF."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import RobotError, reason, shown
from harpy_pin.model.state import Vector

NAMES = ("armature", "damping", "friction")


@dataclass(frozen=True, eq=False, repr=False)
class KnownJoints:
    """Armature, damping and dry friction of joints; NaN where they are not known.

    Attributes:
        names: of the joints.
        armature: (joints,) inertia of the motors' rotors at the joints, kg·m².
        damping: (joints,) viscous friction, N·m·s/rad.
        friction: (joints,) dry friction, N·m. Arrays are read only.
    """

    names: tuple[str, ...]
    armature: Vector
    damping: Vector
    friction: Vector

    def __post_init__(self) -> None:
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.flags.writeable = False


def read_joints(path: str | Path) -> KnownJoints:
    """The joints in a file of ``harpy identify``: ``{"joints": {NAME: {"armature": 0.01, ...}}}``,
    null where a number is not known.

    Raises:
        RobotError: there are none in it.
    """
    path = checks.path("joints", path)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["joints"]
        columns = {
            name: np.array([joint[name] for joint in found.values()], dtype=np.float64)
            for name in NAMES
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RobotError(
            f"no joints in {shown(str(path), 300)}: {reason(error)}", path=path
        ) from error
    return KnownJoints(tuple(found), **columns)
