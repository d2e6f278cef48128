"""Flat feet: the corners of a sole as contact points of one rigid body.

The ground exerts one wrench on a flat foot, bounded in friction, in the centre of pressure, and in
the moment about the normal. A wrench is within these bounds exactly if forces at the corners make
it, each in its own friction cone (Caron, Pham and Nakamura, ICRA 2015). So the corners are contact
points like all others, and their friction cones together *are* the cone of the wrench.

Four corners have twelve accelerations, of which six are independent, because a sole is rigid. What
holds a flat foot holds those six (:func:`harpy_pin.model.terms.flat_foot_rows`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import Vector

LARGEST = 10.0  # longest side of a flat foot, m
MIN_SPREAD = 1e-3
"""Least spread of the corners in their narrower direction, root mean square, m: less is a line,
which turns freely.
"""
SIDE: dict[str, Any] = {"low": 2.0 * MIN_SPREAD, "high": LARGEST}
"""What a side of a flat foot may be, m."""

UPRIGHT = 0.99
"""Least cosine of the angle between the normal of a sole and the vertical in the standing
posture.
"""
SOLE_DEPTH, SOLE_SIDE = 5e-3, 1e-2
"""How far above the lowest end of a foot's shapes an end of a sole is, m, and the least side of a
sole, m.
"""


def _read_width(name: str, value: float) -> float:
    return checks.number(name, value, **SIDE) if value != 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class FlatFoot(checks.Checked):
    """A rectangle on a link, with which the robot stands on flat ground.

    Its corners are feet of the robot, named like its frame with ``_0`` to ``_3`` behind: front
    left, front right, rear left and rear right, if x of the sole points to the front, y to the left
    and z up, away from the ground. Where the model has a frame of such a name, the corner's is
    ``corner:`` with that behind.

    Attributes:
        length: along x of the sole, m.
        width: along y of the sole, m; 0 of a line, whose ends ``_0`` and ``_1`` are front and rear.
        centre: (3,) of the middle, in the frame, m.
        orientation: (3,) of the sole in the frame: roll, pitch and yaw as in a URDF, rad.
    """

    length: float = field(metadata=checks.rule(called="length of a flat foot", **SIDE))
    width: float = field(metadata=checks.rule(_read_width, called="width of a flat foot"))
    centre: tuple[float, float, float] = checks.setting(
        (0.0, 0.0, 0.0), checks.fixed_vector, called="centre of a flat foot"
    )
    orientation: tuple[float, float, float] = checks.setting(
        (0.0, 0.0, 0.0), checks.fixed_vector, called="orientation of a flat foot"
    )

    @property
    def placement(self) -> pin.SE3:
        """Of the sole in the frame: its middle, with x along its length and z up."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.orientation), np.array(self.centre))

    @property
    def corners(self) -> Vector:
        """(4, 3) places of the corners in the frame, in the order of their names, m; (2, 3) of a
        line.
        """
        half, place = 0.5 * np.array((self.length, self.width, 0.0)), self.placement
        sides = (1, -1) if self.width else (0,)
        return np.array([place.act(half * (a, b, 0.0)) for a in (1, -1) for b in sides])


def find_sole(shapes: Sequence[tuple[pin.SE3, Vector, float]], upright: Vector) -> FlatFoot | None:
    """The rectangle around the lowest ends of a foot's shapes, where it is level, or the line along
    the lowest of them; None for a point.

    Of the axes of the lowest shape, if it is a box, else of the frame, the one that is up while the
    robot stands is the sole's normal, and the one that is to the front its x axis.

    Args:
        shapes: place of each in the frame, half of its sides (3,), m, and the radius of the ball at
            each of its corners, m; zero of a box.
        upright: (3, 3) the frame's axes while the robot stands, in the world.
    """
    ends, lowest, axes, line = [], np.inf, upright, None
    for place, half, radius in shapes:
        own = [
            (*(upright @ place.act(half * sign)), radius) for sign in product((-1.0, 1.0), repeat=3)
        ]
        height = min(end[2] - end[3] for end in own)
        if height < lowest:
            lowest, axes = height, upright @ place.rotation if radius == 0.0 else upright
            line = (place, half, radius)
        ends += own
    signed = np.hstack((axes, -axes))
    up, ahead = (signed[:, np.argmax(signed[k])] for k in (2, 0))
    sole = np.column_stack((ahead, np.cross(up, ahead), up))
    points = np.array(ends).reshape(-1, 4)
    points = points[:, :3] @ sole - points[:, 3:] * (0.0, 0.0, 1.0)
    points = points[points[:, 2] < points[:, 2].min(initial=np.inf) + SOLE_DEPTH]
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    if up[2] < UPRIGHT or min(high[:2] - low[:2]) < SOLE_SIDE:
        return None if line is None else _line(*line, upright)
    turn, middle = upright.T @ sole, (*(0.5 * (low + high))[:2], low[2])
    length, width, _ = high - low
    return FlatFoot(
        length=length, width=width, centre=turn @ middle, orientation=pin.rpy.matrixToRpy(turn)
    )


def _line(place: pin.SE3, half: Vector, radius: float, upright: Vector) -> FlatFoot | None:
    """The lower side of a bar with round ends, where it is level; None of another shape."""
    length = 2.0 * float(np.linalg.norm(half))
    if radius == 0.0 or np.count_nonzero(half) != 1 or length < SOLE_SIDE:
        return None
    ahead = 2.0 / length * upright @ place.rotation @ half
    if 1.0 - ahead[2] ** 2 < UPRIGHT**2:
        return None
    ahead *= np.sign(ahead[np.argmax(np.abs(ahead[:2]))])
    aside = np.cross((0.0, 0.0, 1.0), ahead) / np.hypot(*ahead[:2])
    turn = upright.T @ np.column_stack((ahead, aside, np.cross(ahead, aside)))
    middle, angles = place.translation - radius * turn[:, 2], pin.rpy.matrixToRpy(turn)
    return FlatFoot(length=length, width=0.0, centre=middle, orientation=angles)


def add_flat_feet(
    model: pin.Model, feet: Sequence[str], flat_feet: Mapping[str, FlatFoot]
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Add the corners of flat feet to a model, which has the frames of the feet already, as frames.

    Returns the names of the contact points in the order of the feet, and how many of them each foot
    has.
    """
    for name, foot in checks.mapping("flat_feet", flat_feet).items():
        if name not in feet:
            raise InputError.unknown("flat foot", name, feet)
        if not isinstance(foot, FlatFoot):
            raise InputError(
                f"the flat foot '{name}' must be a FlatFoot, got {shown(foot)}", name="flat_feet"
            )
    points: list[str] = []
    counts: list[int] = []
    for name in feet:
        if name not in flat_feet:
            points.append(name)
            counts.append(1)
            continue
        number = model.getFrameId(name)
        frame = model.frames[number]
        for i, corner in enumerate(flat_feet[name].corners):
            place = frame.placement * pin.SE3(flat_feet[name].placement.rotation, corner)
            points.append(f"{name}_{i}")
            while model.existFrame(points[-1]):
                points[-1] = f"corner:{points[-1]}"
            model.addFrame(
                pin.Frame(points[-1], frame.parentJoint, number, place, pin.FrameType.OP_FRAME)
            )
        counts.append(len(flat_feet[name].corners))
    return tuple(points), tuple(counts)
