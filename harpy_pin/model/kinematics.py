"""Kinematics of Harpy's legs in closed form; :mod:`harpy_pin.model.ik` solves for any robot and
frames.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, OutOfReachError, RobotError
from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

PARALLEL = 5e-3
"""Difference of the velocities of ankle and knee up to which a tarsus stays parallel."""


@dataclass(frozen=True, kw_only=True)
class LegGeometry(checks.Checked):
    """One leg of Harpy's kind: hip frontal (x), hip sagittal (y), knee (y), point foot.

    A parallelogram that holds the tarsus parallel to the thigh is such a leg, too.

    Attributes:
        hip: (3,) body centre to the hip frontal axis, m.
        offset: hip frontal to hip sagittal axis along y, m (positive to the left).
        upper: thigh + tarsus, m.
        lower: shin, m.
        zero: (3,) angles of the straight leg that the joints have at zero, rad.

    Raises:
        InputError: a number is not finite, or a link has no length.
    """

    hip: tuple[float, float, float] = field(metadata=checks.rule(checks.fixed_vector))
    offset: float = field(metadata=checks.rule(called="offset of the hip"))
    upper: float = field(metadata=checks.rule(low=0.0, strict=True, called="upper link"))
    lower: float = field(metadata=checks.rule(low=0.0, strict=True, called="lower link"))
    zero: tuple[float, float, float] = checks.setting(
        (0.0, 0.0, 0.0), checks.fixed_vector, called="zero of the leg"
    )

    @cached_property
    def record(self) -> Records[LegRecord]:
        """The lengths, for kernels."""
        return make_record(LegRecord, **asdict(self))

    @classmethod
    @checked
    def from_robot(cls, robot: Robot, foot: str) -> LegGeometry:
        """Read the leg that ends in a foot from the model.

        Args:
            robot: gives the lengths.
            foot: frame name of the foot at the leg's end.

        Raises:
            InputError: no such frame.
            RobotError: the leg is not a hip x, hip y, knee y chain with straight links of some
                length.
        """
        model = robot.model
        frame = model.frames[robot.frame_id(foot)]
        chain = list(model.supports[frame.parentJoint])[2:]
        if (folded := _parallelogram(robot, foot, chain)) is not None:
            return folded
        passive = () if robot.loops is None else robot.loops.passive
        names = [model.joints[j].shortname() if j not in passive else "passive" for j in chain]
        if names != ["JointModelRX", "JointModelRY", "JointModelRY"]:
            raise RobotError(
                f"the leg of '{foot}' is {names}, not hip x, hip y, knee y; use "
                f"harpy_pin.model.solve_ik"
            )
        frontal, sagittal, knee = (model.jointPlacements[j] for j in chain)
        points = [sagittal.translation, knee.translation, frame.placement.translation]
        straight = all(np.allclose(p.rotation, np.eye(3)) for p in (frontal, sagittal, knee))
        if not straight or any(
            np.any(np.abs(np.delete(p, k)) > 1e-12) for p, k in zip(points, (1, 2, 2), strict=True)
        ):
            raise RobotError(
                f"the leg of '{foot}' has offset or turned links; use harpy_pin.model.solve_ik"
            )
        x, y, z = (float(c) for c in frontal.translation)
        try:
            return cls(
                hip=(x, y, z),
                offset=float(points[0][1]),
                upper=float(-points[1][2]),
                lower=float(-points[2][2]),
            )
        except InputError as error:
            raise RobotError(f"the leg of '{foot}': {error}", path=robot.urdf) from error

    def prepare(self) -> None:
        """Begin to compile the kernels of legs of this kind."""
        for function, shape in ((leg_inverse, 3), (leg_jacobian, (3, 3))):
            function.prepare(self.record, np.zeros(3), np.zeros(shape))


def _parallelogram(robot: Robot, foot: str, chain: list[int]) -> LegGeometry | None:
    """The leg whose passive ankle keeps the tarsus parallel to the thigh, which makes it a chain of
    two links: the one of thigh and tarsus, and the shin. None where it is no such leg.
    """
    model, kinds = robot.model, [robot.model.joints[j].shortname() for j in chain]
    if robot.loops is None or kinds != ["JointModelRX", *["JointModelRY"] * 3]:
        return None
    frontal, sagittal, knee, ankle = (model.jointPlacements[j] for j in chain)
    end = model.frames[robot.frame_id(foot)].placement.translation
    spread = robot.velocity_map(robot.reference)[model.joints[chain[3]].idx_v]
    spread[robot.nv - len(robot.joints) + robot.driven.index(chain[2])] += 1.0
    if chain[3] not in robot.loops.passive or np.abs(spread).max() > PARALLEL:
        return None
    upper, lower = knee.translation + end, ankle.translation
    x, y, z = (float(c) for c in frontal.translation)
    first = float(np.arctan2(-upper[0], -upper[2]))
    second = float(np.arctan2(-lower[0], -lower[2]))
    return LegGeometry(
        hip=(x + float(sagittal.translation[0]), y, z),
        offset=float(sagittal.translation[1] + upper[1] + lower[1]),
        upper=float(np.hypot(upper[0], upper[2])),
        lower=float(np.hypot(lower[0], lower[2])),
        zero=(0.0, first, second - first),
    )


class LegRecord(RecordOf):
    """Lengths of a leg: the attributes of :class:`LegGeometry`."""

    hip: Vector
    offset: float
    upper: float
    lower: float
    zero: Vector


@kernel(angles=(3,), out=(3, 3))
def leg_jacobian(leg: LegRecord, angles: Vector, out: Vector) -> None:
    """Derivative of the foot position by these joint angles, body axes, m/rad."""
    upper, lower, bent = leg.upper, leg.lower, angles + leg.zero
    s1, c1 = np.sin(bent[1]), np.cos(bent[1])
    s12, c12 = np.sin(bent[1] + bent[2]), np.cos(bent[1] + bent[2])
    c, s = np.cos(bent[0]), np.sin(bent[0])
    z = -upper * c1 - lower * c12
    dz1, dz2 = upper * s1 + lower * s12, lower * s12
    out[0] = 0.0, z, -lower * c12
    out[1] = -s * leg.offset - c * z, -s * dz1, -s * dz2
    out[2] = c * leg.offset - s * z, c * dz1, c * dz2


@kernel(foot=(3,), out=(3,))
def leg_inverse(leg: LegRecord, foot: Vector, out: Vector) -> float:
    """Joint angles that put the foot at a point, knee angle in [0, π].

    Args:
        leg: element of :attr:`LegGeometry.record`.
        foot: (3,) foot position relative to the body, body axes, m; the leg hangs below its hip.
        out: (3,) hip frontal, hip sagittal, knee, rad.

    Returns:
        0 where the point is reached. Otherwise how far away it is, m, and ``out`` is the nearest
        point of the
        workspace: never a silent clip.
    """
    d, upper, lower = leg.offset, leg.upper, leg.lower
    x, y, z = foot - leg.hip
    # In the half-plane (x, ρ) through the hip frontal axis the workspace is ρ ≥ |d| between two
    # circles about the hip.
    radial = np.hypot(y, z)
    outer, inner = np.sqrt((upper + lower) ** 2 + d * d), np.sqrt((upper - lower) ** 2 + d * d)
    distance = np.hypot(x, radial)
    near_x, near_radial, excess = x, radial, 0.0
    if radial < abs(d) or distance > outer or distance < inner:
        excess = np.inf
        for limit in (outer, inner):
            # Radially onto a circle; where that is under the line ρ = |d|, its corner.
            px = x * limit / distance if distance > 0.0 else 0.0
            pr = radial * limit / distance if distance > 0.0 else limit
            if pr < abs(d):
                px, pr = np.copysign(np.sqrt(limit * limit - d * d), x), abs(d)
            gap = np.hypot(px - x, pr - radial)
            if gap < excess:
                near_x, near_radial, excess = px, pr, gap
        if abs(upper - lower) <= abs(x) <= upper + lower and abs(abs(d) - radial) < excess:
            near_x, near_radial, excess = x, abs(d), abs(abs(d) - radial)
    drop = np.sqrt(max(near_radial * near_radial - d * d, 0.0))
    gamma = np.arctan2(z, y) - np.arctan2(-drop, d)
    if gamma > np.pi:
        gamma -= 2.0 * np.pi
    elif gamma < -np.pi:
        gamma += 2.0 * np.pi
    cosine = (near_x * near_x + drop * drop - upper * upper - lower * lower) / (2.0 * upper * lower)
    knee = np.arccos(min(max(cosine, -1.0), 1.0))
    hip = np.arctan2(-near_x, drop) - np.arctan2(lower * np.sin(knee), upper + lower * np.cos(knee))
    out[:] = np.array((gamma, hip, knee)) - leg.zero
    return float(excess)


@checked
def leg_inverse_kinematics(geometry: LegGeometry, foot: ArrayLike) -> Vector:
    """Joint angles that put the foot at a point (closed form; equations.md §3, equivalent serial
    chain).

    Args:
        geometry: the leg.
        foot: (3,) foot position relative to the body, body axes, m.

    Returns:
        (3,) hip frontal, hip sagittal, knee, rad, with the knee in [0, π].

    Raises:
        OutOfReachError: the leg is too short, or too long, to reach the point; the error has the
            nearest solution.
        InputError: the point is not a finite 3-vector.
    """
    target = checks.vector("foot", foot, 3)
    angles = np.empty(3)
    excess = leg_inverse(geometry.record, target, angles)
    if excess > 1e-12:
        raise OutOfReachError(
            f"foot target {np.round(target, 4).tolist()} m is {excess:.4g} m out of reach",
            target=target,
            nearest=angles,
            excess=excess,
        )
    return angles
