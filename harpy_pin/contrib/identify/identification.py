"""Joints known from a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.equations import Rows, hung_rows, standing_rows
from harpy_pin.contrib.identify.joints import Joints
from harpy_pin.contrib.identify.regression import NUMBERS, POSITIVE, Solution, solve
from harpy_pin.contrib.identify.signals import Samples, read_samples
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

KNOWN = 0.2  # standard error over the number itself up to which it is told
EXCITED = 0.03  # the same up to which the log excites it
SURE = {"torque_scale": 0.02, "delay": 5e-4}
"""The same of these, as it is; else the scale is one, and the delay zero s."""
OFFSET = 0.02  # the same of a bias, as a share of the joint's rms torque
LEFT = 0.3  # share of a joint's torque that may stay unexplained before the log is called wrong
NEGATIVE = 0.03  # share of a joint's torque from which on a number that came out negative is told
MOVING = 100  # samples in which a joint must move
CUT = 0.01  # share of samples at the peak torque from which on it is told
BEYOND = 0.2  # angle beyond a joint's ends from which on it is told, rad
BETTER = 0.8  # correlation with the torque of another joint from which on they may be swapped
UNKNOWN = Solution(
    values=np.full(len(NUMBERS), np.nan),
    error=np.full(len(NUMBERS), np.inf),
    free=np.zeros(len(NUMBERS), bool),
    negative=np.zeros(len(NUMBERS)),
    measured=np.zeros(0),
    predicted=np.zeros(0),
)
"""Of a joint that stands still."""


@checked
def identify(robot: Robot, log: Run | Mapping[str, Vector]) -> Joints:
    """Armature, damping, dry friction, bias and delay of every joint, scale of its torque, and what
    is on the base.

    Args:
        robot: its masses and inertias are taken as they are; what its joints have is not looked at.
        log: signals of n rows, at least 100 a second: ``t`` (n,), s; ``q``, either (n, joints)
            angles of a robot that hangs, its base held level, or (n, nq) with the base's pose, rad;
            and ``torque`` (n, joints), measured or commanded, N·m. Motors with a law of their own
            (:class:`harpy_pin.Command`) have ``k_p``, ``k_d``, ``target_q`` and ``target_v`` (n,
            joints) too, and ``torque`` is what is fed forward; gains change slowly. With the base's
            pose, ``v`` (n, nv) has its velocity (zero by default), and ``stance`` (n, feet), or
            ``foot_force``, says which feet are on the ground: the base is held where none ever is.
            Rows that are not finite are left out; gaps split the log. ``joint_position`` and
            ``joint_torque`` are read, too, as sensors name them; measured torques are left aside
            where there are gains. These may be a number, or (joints,), if they never change.

    Returns:
        The numbers. What is wrong with the log stands in ``status``, and nothing is known of a
        joint whose torques are not its own; armature, damping and friction are never negative.

    Raises:
        InputError: signals are missing or have other shapes, rows are too far apart, or no second
            is without a gap.
    """
    samples, said = read_samples(robot, log)
    angles = samples.halves[0].q
    over = np.maximum(
        robot.joint_lower - angles.min(axis=0), angles.max(axis=0) - robot.joint_upper
    )
    said += _named(robot, over > BEYOND, "angles beyond the joint's ends: another unit or order?")
    moving = ~samples.still
    cut = (samples.cut & moving).mean(axis=0) > CUT
    said += _named(robot, cut, "torque at its limit, rows left out")
    said += _named(robot, moving.sum(axis=0) < MOVING, "hardly moves")
    if samples.stance.any():
        return _standing(robot, samples, said)
    rows = hung_rows(robot, samples)
    found = [UNKNOWN if len(one.sample) < MOVING else _solved(samples, one) for one in rows]
    bad, lines = _suspicious(robot, samples, rows, found)
    said += lines
    shown = tuple(
        (samples.t[part.sample[: len(one.measured)]], one.measured, one.predicted)
        for part, one in zip(rows, found, strict=True)
    )
    values, errors, negative = (
        np.array([getattr(one, name) for one in found]) for name in ("values", "error", "negative")
    )
    errors[bad] = np.inf
    size = np.array([one.size for one in found])
    left = np.array([one.left for one in found])
    return _joints(robot, values, errors, negative, size, left, said, rows=shown)


def _standing(robot: Robot, samples: Samples, said: list[str]) -> Joints:
    """The same of a robot on its feet, whose joints share equations."""
    solution = _solved(samples, standing_rows(robot, samples))
    n, many = len(robot.joints), len(NUMBERS) * len(robot.joints)
    values, errors, negative = (
        getattr(solution, name)[:many].reshape(n, -1) for name in ("values", "error", "negative")
    )
    size, left = np.full(n, solution.size), np.full(n, solution.left)
    if solution.left > LEFT:
        said.append(f"{100.0 * solution.left:.0f} % of the forces are not explained")
    return _joints(
        robot,
        values,
        errors,
        negative,
        size,
        left,
        said,
        payload=solution.values[many:],
        payload_error=solution.error[many:],
    )


def _solved(samples: Samples, rows: Rows) -> Solution:
    """The numbers of rows; a scale or a delay of which they say too little is one, or zero."""
    given = np.full(len(NUMBERS) * len(rows.joints) + rows.payload.shape[2], np.nan)
    for name, default in (("delay", 0.0), ("torque_scale", 1.0)):
        solution = solve(samples, rows, given)
        place = np.arange(len(rows.joints)) * len(NUMBERS) + NUMBERS.index(name)
        given[place[~(solution.error[place] <= SURE[name])]] = default
    return solve(samples, rows, given)


def _joints(
    robot: Robot,
    values: Vector,
    errors: Vector,
    negative: Vector,
    size: Vector,
    left: Vector,
    said: list[str],
    **more: Any,
) -> Joints:
    """The result of (joints, numbers) values, standard errors, and what came out negative."""
    known: dict[str, Any] = {}
    error, excited = dict[str, Vector](), dict[str, Any]()
    for k, name in enumerate(NUMBERS):
        value, error[name] = values[:, k], errors[:, k]
        share = error[name] / np.maximum(np.abs(value), 1e-12)
        if name == "bias":
            excited[name] = error[name] <= OFFSET * size
        else:
            excited[name] = error[name] <= SURE[name] if name in SURE else share <= EXCITED
        told = excited[name] | (share <= KNOWN) if name in POSITIVE else excited[name]
        known[name] = np.where(told, value, np.nan)
        if name in POSITIVE:
            below = negative[:, k] > NEGATIVE
            said = said + _named(robot, below, f"{name} came out negative, so it is not known")
    return Joints(
        robot.joints, **known, error=error, excited=excited, left=left, status=tuple(said), **more
    )


def _suspicious(
    robot: Robot, samples: Samples, rows: list[Rows], found: list[Solution]
) -> tuple[NDArray[np.bool_], list[str]]:
    """(joints,) whether torques are not the joint's: of the wrong sign, of another joint, or of
    nothing known; and lines of the status.
    """
    wrong = np.array([one.values[0] < 0.0 for one in found])
    odd = np.array([one.left > LEFT for one in found])
    said, rest = _named(robot, wrong, "torque of the wrong sign"), odd & ~wrong
    torques = np.transpose([samples.halves[0].torque(j, 0.0)[0] for j in range(len(rows))])
    for j in np.flatnonzero(rest):
        needed, sample = rows[j].known.mean(axis=0), rows[j].sample
        match = np.corrcoef(needed, torques[sample], rowvar=False)[0, 1:]
        best = int(np.nanargmax(match))
        if best != j and match[best] > BETTER:
            said.append(f"{robot.joints[j]}: torque of another joint, {robot.joints[best]}?")
            rest[j] = False
    return wrong | odd, said + _named(robot, rest, "torque does not explain the motion")


def _named(robot: Robot, which: Any, what: str) -> list[str]:
    """A line of the status, if any joint is meant."""
    names = [name for name, one in zip(robot.joints, which, strict=True) if one]
    return [f"{', '.join(names)}: {what}"] if names else []
