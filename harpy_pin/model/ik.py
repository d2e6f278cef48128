"""Iterative inverse kinematics on Pinocchio, for any robot and frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Vector

STALLED = 1e12  # damping from which on steps are none


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
    problem = Problem(robot, targets)
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


class Problem:
    """Errors, Jacobian and limits of one inverse kinematics.

    Attributes:
        lower: of the configuration's joints, within which they stay.
        upper: likewise.
    """

    def __init__(self, robot: Robot, targets: Mapping[str, pin.SE3 | ArrayLike]) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self.lower, self.upper = robot.joint_lower, robot.joint_upper
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
        clipped[7:] = np.clip(clipped[7:], self.lower, self.upper)
        return clipped

    @property
    def ranges(self) -> tuple[Vector, Vector]:
        """Least and largest angles that are drawn: of ±π those within the limits, or the next turn
        where the limits are beyond it.
        """
        lower, upper, turn = self.lower, self.upper, 2.0 * np.pi
        low = np.where(upper < -np.pi, np.maximum(lower, upper - turn), np.maximum(lower, -np.pi))
        high = np.where(lower > np.pi, np.minimum(upper, lower + turn), np.minimum(upper, np.pi))
        return low, high

    def draw(self, q: Vector, rng: np.random.Generator) -> Vector:
        """A configuration with the joints that move a target drawn from :attr:`ranges`."""
        drawn = q.copy()
        joints = rng.uniform(*self.ranges)
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
            held = ((joints <= self.lower) & (slope > 0.0)) | (
                (joints >= self.upper) & (slope < 0.0)
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
