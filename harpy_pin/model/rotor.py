"""Rotors: thrust along an axis that is fixed to a link, with the moment of the rotor's drag about
that axis.

A free thruster has a force of three components; a rotor has one number, u. On its link it exerts
the force u z and the moment d u z, with z its axis and d the drag, in metres. Commands and logs
hold a force in world axes for every thruster and rotor alike; programs and laws hold the *thrust
variables*: three numbers for each free thruster, then one for each rotor.
:func:`harpy_pin.model.terms.read_thrusts` and :func:`harpy_pin.model.terms.write_thrusts` lead from
one to the other.
"""

from dataclasses import dataclass

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError


@dataclass(frozen=True)
class Rotor:
    """A rotor whose axis is fixed to a link. It has no inertia of its own and no delay: its thrust
    is the command's.

    Attributes:
        frame: of the robot, at the rotor's centre.
        axis: (3,) direction of the force on the robot, in the frame's axes; its length does not
            matter.
        limit: least and largest thrust, N; the least is negative for a rotor that can be reversed.
        drag: moment on the robot about the axis per thrust, m: positive for a rotor that turns
            clockwise when one looks against the axis (from above, where it points up), negative for
            one that turns counterclockwise.

    Raises:
        InputError: the axis is zero, the limits are not in order, or a number is not finite (the
            largest thrust may be infinite).
    """

    frame: str
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limit: tuple[float, float] = (0.0, np.inf)
    drag: float = 0.0

    def __post_init__(self) -> None:
        checks.names("frame", (self.frame,))
        what = f"of rotor '{self.frame}'"
        axis = checks.vector(f"axis {what}", self.axis, 3)
        length = float(np.linalg.norm(axis))
        if length < 1e-9:
            raise InputError(f"axis {what} is zero", name="axis", value=self.axis)
        low, high = checks.array(f"limit {what}", self.limit, 2).tolist()
        low = checks.number(f"least thrust {what}", low)
        if high != np.inf:
            high = checks.number(f"largest thrust {what}", high, low=low, strict=True)
        x, y, z = (axis / length).tolist()
        checks.keep(
            self, axis=(x, y, z), limit=(low, high), drag=checks.number(f"drag {what}", self.drag)
        )
