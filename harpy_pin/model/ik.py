"""Iterative inverse kinematics on Pinocchio, for any robot and frames, and standing postures by it.

A posture is found for robots whose files have none: legs bent, every foot below its hip, all feet
on one level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.legs import Leg, legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Vector

BENT, SOLE_BENT = (0.75, 0.85, 0.65, 0.92), (0.92, 0.85, 0.75)
"""Heights of the hips above point feet and soles that are tried one after the other, in lengths of
the leg.
"""
STARTS, ITERATIONS, CLOSE = 12, 60, 1e-6
"""Configurations from which each leg's inverse kinematics begins, its steps from each, at most, and
its error, m.
"""
STALLED = 1e12  # damping from which on steps are none
UPRIGHT = 0.7
"""Cosine of the angle between the normal of a sole and the vertical, below which a message says
it.
"""
LEVEL = 2e-3  # largest difference between the heights of the feet in a posture, m
BACKWARD = 0.1
"""Of postures alike in their angles the one with the knees further back is taken, in rad² per
metre.
"""


class IKStatus(Enum):
    """How an iterative inverse kinematics ended."""

    CONVERGED = "converged"
    STALLED = "stalled"
    """No step reduces the error: out of reach, against a joint limit, or a local minimum."""
    MAX_ITERATIONS = "max_iterations"


@dataclass(frozen=True)
class IKResult:
    """Outcome of :func:`solve_ik`.

    Attributes:
        q: (nq,) best configuration found.
        status: how it ended.
        error: norm of the stacked task error at ``q`` (m, and rad for orientations).
        iterations: steps tried, over all starts.
    """

    q: Vector
    status: IKStatus
    error: float
    iterations: int

    @property
    def converged(self) -> bool:
        """Whether every target is met to the tolerance."""
        return self.status is IKStatus.CONVERGED


@checked
def solve_ik(
    robot: Robot,
    targets: Mapping[str, pin.SE3 | ArrayLike],
    q: ArrayLike,
    *,
    tolerance: float = 1e-10,
    max_iterations: int = 200,
    restarts: int = 5,
    seed: int = 0,
) -> IKResult:
    """Configuration that puts frames at targets, by Levenberg–Marquardt with joint limits; the base
    stays.

    Args:
        robot: any robot.
        targets: for each frame name a (3,) position, world, m, or a ``pinocchio.SE3`` pose.
        q: (nq,) starting configuration; joints outside their limits are first moved onto them.
        tolerance: norm of the stacked error at which the problem counts as solved, m and rad.
        max_iterations: limit of steps tried from each start.
        restarts: how often to start again, joints drawn within their limits, when the descent from
            ``q`` ends in a local minimum or against a limit.
        seed: of the restarts.

    Returns:
        The best configuration with its status; never raises for targets that cannot be met.

    Raises:
        InputError: unknown frame, wrong shapes, no target.
    """
    if not targets:
        raise InputError("solve_ik needs at least one target", name="targets")
    problem = _Problem(robot, targets)
    start = problem.bounded(configuration(robot, q))
    best = problem.descend(start, tolerance=tolerance, max_iterations=max_iterations)
    rng, tried = np.random.default_rng(checks.whole("seed", seed)), best.iterations
    for _ in range(restarts):
        if best.status is not IKStatus.STALLED:
            break
        drawn = problem.draw(start, rng)
        other = problem.descend(drawn, tolerance=tolerance, max_iterations=max_iterations)
        tried += other.iterations
        if other.converged or other.error < best.error:
            best = other
    return IKResult(best.q, best.status, best.error, tried)


class _Problem:
    """Errors, Jacobian and limits of one inverse kinematics."""

    def __init__(self, robot: Robot, targets: Mapping[str, pin.SE3 | ArrayLike]) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self._lower, self._upper = robot.joint_lower, robot.joint_upper
        self._tasks: list[tuple[str, pin.SE3 | None, Vector]] = []
        for name, target in targets.items():
            pose = target if isinstance(target, pin.SE3) else None
            point = checks.vector(
                f"target of '{name}'", pose.translation if pose is not None else target, 3
            )
            robot.frame_id(name)
            self._tasks.append((name, pose, point))
        chains = {j for name in targets for j in robot.carriers(name)}
        # Of each number of the configuration, since a joint without bounds has two.
        counts = [robot.model.joints[j].nq for j in robot.driven]
        moving = np.array([j in chains for j in robot.driven], dtype=bool)
        self._moving = np.repeat(moving, counts)

    def bounded(self, q: Vector) -> Vector:
        """A configuration with its joints moved within their limits."""
        clipped = q.copy()
        clipped[7:] = np.clip(clipped[7:], self._lower, self._upper)
        return clipped

    def draw(self, q: Vector, rng: np.random.Generator) -> Vector:
        """A configuration with the joints that move a target drawn within their limits (±π where
        there are none).
        """
        drawn = q.copy()
        joints = rng.uniform(*_drawn(self._lower, self._upper))
        drawn[7:][self._moving] = joints[self._moving]
        return self.bounded(drawn)

    def errors(self, q: Vector) -> Vector:
        """Stacked position and orientation errors, world axes; infinite where loops do not
        close.
        """
        model, rows = self.robot.model, []
        try:
            pin.framesForwardKinematics(model, self.data, self.robot.closed(q))
        except InputError:
            return np.full(3 * len(self._tasks), np.inf)
        for name, pose, point in self._tasks:
            placement = self.data.oMf[self.robot.frame_id(name)]
            rows.append(placement.translation - point)
            if pose is not None:
                rows.append(placement.rotation @ pin.log3(pose.rotation.T @ placement.rotation))
        return np.concatenate(rows)

    def jacobian(self, q: Vector) -> Vector:
        """Derivative of the errors by the generalised velocity."""
        posed, rows = Posed(self.robot, q), []
        for name, pose, _ in self._tasks:
            full = posed.jacobian(name)
            rows.append(full[:3])
            if pose is not None:
                placement = posed.frame(name).rotation
                correction = pin.Jlog3(pose.rotation.T @ placement)
                rows.append(placement @ correction @ placement.T @ full[3:])
        return np.concatenate(rows)

    def descend(self, q: Vector, *, tolerance: float, max_iterations: int) -> IKResult:
        """Levenberg–Marquardt from one start; a joint at a limit that the descent pushes further is
        held.
        """
        current, residual, damping, iterations = q, self.errors(q), 1e-3, 0
        norm = float(np.linalg.norm(residual))
        if norm == np.inf:
            return IKResult(current, IKStatus.STALLED, norm, iterations)
        while (norm := float(np.linalg.norm(residual))) > tolerance and iterations < max_iterations:
            full = self.jacobian(current)
            slope, joints = (full.T @ residual)[6:], current[7:]
            held = ((joints <= self._lower) & (slope > 0.0)) | (
                (joints >= self._upper) & (slope < 0.0)
            )
            active = np.append(np.zeros(6, dtype=bool), ~held)
            reduced, improved = full[:, active], False
            while not improved and iterations < max_iterations and damping < STALLED:
                iterations += 1
                normal = reduced.T @ reduced + damping * np.eye(reduced.shape[1])
                step = np.zeros(self.robot.nv)
                step[active] = -np.linalg.solve(normal, reduced.T @ residual)
                candidate = self.bounded(self.robot.integrate(current, step))
                trial = self.errors(candidate)
                improved = bool(np.linalg.norm(trial) < norm * (1.0 - 1e-12))
                damping = max(damping * 0.1, 1e-14) if improved else damping * 10.0
            if not improved and damping >= STALLED:
                return IKResult(current, IKStatus.STALLED, norm, iterations)
            if improved:
                current, residual = candidate, trial
        status = IKStatus.CONVERGED if norm <= tolerance else IKStatus.MAX_ITERATIONS
        return IKResult(current, status, norm, iterations)


def _drawn(lower: Vector, upper: Vector) -> tuple[Vector, Vector]:
    """Ranges within limits from which angles are drawn: of ±π, or the next turn where the limits
    are beyond it.
    """
    turn = 2.0 * np.pi
    low = np.where(upper < -np.pi, np.maximum(lower, upper - turn), np.maximum(lower, -np.pi))
    return low, np.where(lower > np.pi, np.minimum(upper, lower + turn), np.minimum(upper, np.pi))


@checked
def find_posture(robot: Robot) -> Vector:
    """(joints,) angles in which a robot with feet stands, rad.

    They are those that were given; its file's, if its feet are on one level. Otherwise feet are
    below the hips, of sprawling legs below the knees as these are at zero; soles are level, and
    joints of no leg at zero or the next limit. An :class:`InputError` says that no such posture was
    found, and why it may be.
    """
    model, q = robot.model, robot.neutral
    if robot.posture is not None:
        q[7:] = robot.posture
        posed = Posed(robot, q)
        heights = [posed.frame(name).translation[2] for name in robot.feet]
        if np.ptp(heights) < LEVEL or "posture" in robot.source:
            return robot.posture
    q[7:] = np.clip(robot.reference[7:], robot.joint_lower, robot.joint_upper)
    posed, found = Posed(robot, q), legs(robot)
    hip, length, target = np.empty((len(found), 3)), np.empty(len(found)), []
    for k, leg in enumerate(found):
        corners = [posed.frame(name) for name in leg.points]
        middle = np.mean([corner.translation for corner in corners], axis=0)
        below = leg.joints[leg.knee :] if leg.sprawls else leg.way
        points = [*(posed.joint(j) for j in below), middle]
        hip[k], length[k] = (
            points[0],
            sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points)),
        )
        turn = pin.Quaternion.FromTwoVectors(
            corners[0].rotation[:, 2], np.array((0.0, 0.0, 1.0))
        ).matrix()
        aside = hip[k, 1] if leg.sprawls else middle[1]
        place = np.array((hip[k, 0], aside, 0.0)) + turn @ (corners[0].translation - middle)
        target.append(pin.SE3(turn @ corners[0].rotation, place))
    for bent in SOLE_BENT if robot.flat_feet else BENT:
        posture, down = (
            q.copy(),
            pin.SE3(np.eye(3), np.array((0.0, 0.0, (hip[:, 2] - bent * length).max()))),
        )
        pairs = zip(found, target, strict=True)
        if all(leg.joints and _bend(robot, q, leg, down * end, posture) for leg, end in pairs):
            return np.array(posture[7:])
    message = (
        f"no standing posture of '{robot.name}' was found: give one, of {len(robot.joints)} angles"
    )
    message = f"{message} in the order of robot.joints"
    up = [posed.frame(leg.points[0]).rotation[2, 2] for leg in found if len(leg.points) > 1]
    if min(up, default=1.0) < UPRIGHT:
        message += "; its soles do not face the ground at zero: a FlatFoot has an orientation"
    lame = [leg.points[0] for leg in found if not leg.joints]
    if lame:
        message += f"; no joint moves '{lame[0]}' alone"
    hub = next((leg for leg in found if leg.hub), None)
    if hub is not None:
        message += (
            f"; '{hub.points[0]}' is on the axis of '{model.names[hub.joints[-1]]}', which "
            f"cannot move it: "
        )
        message += "a foot is at the end of its leg"
    still = np.flatnonzero(robot.joint_lower == robot.joint_upper)
    fixed = [robot.joints[k - 6] for leg in found for k in leg.columns if k - 6 in still]
    if fixed:
        message += f"; {len(fixed)} joints of its legs have no range, such as '{fixed[0]}'"
    raise InputError(message, name="posture")


def _bend(robot: Robot, q: Vector, leg: Leg, end: pin.SE3, posture: Vector) -> bool:
    """Set the angles of a leg in a posture so that its first contact point is at a place, that of a
    sole turned as it is there; whether that is in reach. Joints of no leg stay as in q.
    """
    model, places = robot.model.copy(), robot.places
    rng, least, own = np.random.default_rng(0), np.inf, [k - 6 for k in leg.columns]
    columns = [int(place) for place in robot.layout[0][own]]
    others = np.setdiff1d(np.arange(len(places)), own)
    model.lowerPositionLimit[places[others]] = q[robot.layout[0][others]]
    model.upperPositionLimit[places[others]] = q[robot.layout[0][others]]
    robot, targets = (
        replace(robot, model=model),
        {leg.points[0]: end if len(leg.points) > 1 else end.translation},
    )
    low, high = (np.append(np.zeros(7), x) for x in _drawn(robot.joint_lower, robot.joint_upper))
    for _ in range(STARTS):
        start = q.copy()
        start[columns] = rng.uniform(low[columns], high[columns])
        found = solve_ik(
            robot, targets, start, tolerance=CLOSE, max_iterations=ITERATIONS, restarts=0
        )
        if not found.converged:
            continue
        knee = Posed(robot, found.q).joint(leg.way[-1])
        cost = float(np.sum(found.q[columns] ** 2)) + BACKWARD * float(knee[0])
        if cost < least:
            least, posture[columns] = cost, found.q[columns]
    if least < np.inf and len(columns) > (6 if len(leg.points) > 1 else 3):
        _straighten(_Problem(robot, targets), posture, columns, list(leg.columns))
    return least < np.inf


def _straighten(problem: _Problem, posture: Vector, columns: list[int], moving: list[int]) -> None:
    """Of a leg with more joints than its foot needs, move them to the least angles that leave the
    foot where it is.

    So legs that mirror each other have postures that do: of all that reach, drawn configurations
    find any.
    """
    for _ in range(ITERATIONS):
        jacobian, angles = problem.jacobian(posture)[:, moving], posture[columns]
        nearer = posture.copy()
        nearer[columns] = np.linalg.pinv(jacobian) @ (jacobian @ angles)
        found = problem.descend(problem.bounded(nearer), tolerance=CLOSE, max_iterations=ITERATIONS)
        less = np.linalg.norm(found.q[columns]) < np.linalg.norm(angles)
        if not (found.converged and less):
            return
        posture[columns] = found.q[columns]
