"""Flat feet: the corners of a sole as contact points of one rigid body.

The ground exerts one wrench on a flat foot, bounded in friction, in the centre of pressure, and in the moment about the
normal. A wrench is within these bounds exactly if forces at the corners make it, each in its own friction cone (Caron,
Pham and Nakamura, ICRA 2015). So the corners are contact points like all others, and their friction cones together
*are* the cone of the wrench.

Four corners have twelve accelerations, of which six are independent, because a sole is rigid. What holds a flat foot
holds those six (:func:`flat_foot_rows`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import Vector

LARGEST = 10.0  # longest side of a flat foot, m
MIN_SPREAD = 1e-3
"""Least spread of the corners in their narrower direction, root mean square, m: less is a line, which turns freely."""

SOLE_JOINTS = 5
"""Least number of joints of a leg whose foot is found to be flat: fewer cannot keep it level."""
UPRIGHT = 0.99
"""Least cosine of the angle between the z axis of a sole's frame and the vertical."""
SOLE_DEPTH, SOLE_SIDE = 5e-3, 1e-2
"""How far above the lowest end of a foot's shapes an end of a sole is, m, and the least side of a sole, m."""


@dataclass(frozen=True, kw_only=True)
class FlatFoot:
    """A rectangle on a link, with which the robot stands on flat ground.

    Its corners are feet of the robot, named like its frame with ``_0`` to ``_3`` behind: front left, front right, rear
    left and rear right, if x of the frame points to the front and y to the left.

    Attributes:
        length: along x of the frame, m.
        width: along y of the frame, m.
        centre: (3,) of the middle, in the frame, m.
    """

    length: float
    width: float
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("length", "width"):
            least = 2.0 * MIN_SPREAD
            value = checks.number(f"{name} of a flat foot", getattr(self, name), low=least, high=LARGEST)
            checks.keep(self, **{name: value})
        checks.keep(self, centre=tuple(checks.vector("centre of a flat foot", self.centre, 3).tolist()))

    @property
    def corners(self) -> list[tuple[float, float, float]]:
        """Places of the corners in the frame, in the order of their names, m."""
        x, y, z = self.centre
        return [(x + 0.5 * a * self.length, y + 0.5 * b * self.width, z) for a in (1, -1) for b in (1, -1)]


def may_be_flat(model: pin.Model, q: Vector, names: Sequence[str]) -> list[str]:
    """Those of these frames whose leg can hold a sole level, and which point up in the configuration q (nq,)."""
    data, found = model.createData(), []
    pin.framesForwardKinematics(model, data, q)
    for name in names:
        number = model.getFrameId(name)
        joints = len(model.supports[model.frames[number].parentJoint]) - 2
        if joints >= SOLE_JOINTS and data.oMf[number].rotation[2, 2] > UPRIGHT:
            found.append(name)
    return found


def ends_of(place: pin.SE3, reach: ArrayLike, radius: float = 0.0) -> list[Vector]:
    """Ends of a shape in the frame of a foot, m, each as low as the shape is there.

    Args:
        place: of the shape in that frame.
        reach: (3,) half sides of a box, or half the axis of a capsule, (0, 0, l), m; zero of a sphere.
        radius: of a capsule or sphere, m.
    """
    return [place.act(np.multiply(reach, sign)) - (0.0, 0.0, radius) for sign in product((-1.0, 1.0), repeat=3)]


def sole_around(ends: Sequence[Vector]) -> FlatFoot | None:
    """The rectangle around the lowest ends of a foot's shapes, each (3,), in its frame; None for a point or a line."""
    points = np.array(ends).reshape(-1, 3)
    points = points[points[:, 2] < points[:, 2].min(initial=np.inf) + SOLE_DEPTH]
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    if min(high[:2] - low[:2]) < SOLE_SIDE:
        return None
    x, y, _ = 0.5 * (low + high)
    return FlatFoot(length=high[0] - low[0], width=high[1] - low[1], centre=(x, y, low[2]))


def add_flat_feet(
    model: pin.Model, feet: Sequence[str], flat_feet: Mapping[str, FlatFoot]
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Add the corners of flat feet to a model, which has the frames of the feet already, as frames.

    Returns the names of the contact points in the order of the feet, and how many of them each foot has.
    """
    for name, foot in checks.mapping("flat_feet", flat_feet).items():
        if name not in feet:
            raise InputError.unknown("flat foot", name, feet)
        if not isinstance(foot, FlatFoot):
            raise InputError(f"the flat foot '{name}' must be a FlatFoot, got {shown(foot)}", name="flat_feet")
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
            if model.existFrame(f"{name}_{i}"):
                raise InputError(f"there is a frame '{name}_{i}' already: '{name}' cannot be made flat")
            place = frame.placement * pin.SE3(np.eye(3), np.array(corner))
            model.addFrame(pin.Frame(f"{name}_{i}", frame.parentJoint, number, place, pin.FrameType.OP_FRAME))
            points.append(f"{name}_{i}")
        counts.append(len(flat_feet[name].corners))
    return tuple(points), tuple(counts)


@kernel
def flat_foot_rows(
    jacobian: Vector, drift: Vector, desired: Vector, position: Vector, rows: Vector, value: Vector
) -> None:
    """Six rows that hold a flat foot as a rigid body: ``rows`` (6, nv) a = ``value`` (6,), both out.

    Of the accelerations α (n, 3) desired of its corners they are the rigid motion nearest to them: mean and first
    moment about the middle of the corners, Σ (J_i a + J̇_i v − α_i) = 0 and Σ ρ_i × (J_i a + J̇_i v − α_i) / s = 0.
    Jacobian, drift J̇ v and positions are those of the corners, in world axes.
    """
    n, nv = position.shape[0], jacobian.shape[1]
    rows[:6] = 0.0
    value[:6] = 0.0
    middle, arm = np.zeros(3), np.zeros(3)
    for i in range(n):
        for c in range(3):
            middle[c] += position[i, c] / n
    size = 0.0
    for i in range(n):
        for c in range(3):
            size += (position[i, c] - middle[c]) ** 2
    whole, turn = 1.0 / np.sqrt(n), 1.0 / np.sqrt(size)
    for i in range(n):
        for c in range(3):
            arm[c] = turn * (position[i, c] - middle[c])
        for c in range(3):
            a, b = (c + 1) % 3, (c + 2) % 3
            ja, jb, jc = jacobian[3 * i + a], jacobian[3 * i + b], jacobian[3 * i + c]
            for j in range(nv):
                rows[c, j] += whole * jc[j]
                rows[3 + c, j] += arm[a] * jb[j] - arm[b] * ja[j]
            value[c] += whole * (desired[i, c] - drift[3 * i + c])
            value[3 + c] += arm[a] * (desired[i, b] - drift[3 * i + b]) - arm[b] * (desired[i, a] - drift[3 * i + a])
