"""Joints known from a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.equations import (
    PAYLOAD,
    Rows,
    in_the_air,
    joint_rows,
    standing_rows,
)
from harpy_pin.contrib.identify.joints import Joints
from harpy_pin.contrib.identify.regression import NUMBERS, POSITIVE, Solution, solve
from harpy_pin.contrib.identify.signals import Samples, read_samples
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

KNOWN = 0.2  # standard error over the number itself up to which it is told
EXCITED = 0.03  # the same up to which the log excites it
SURE = {"torque_scale": 0.02, "delay": 5e-4}
"""Standard errors of these up to which they are told."""
OFFSET = 0.02  # the same of a bias, as a share of the joint's rms torque
RIGHT = 0.05  # standard deviation of a scale about one before the log is seen
LATE = 5e-3  # the same of a delay about zero, s
ALIKE = 2e-4  # the same of a delay about that of the other joints, at least, s
LEFT = 0.3  # share of a joint's torque that may stay unexplained before the log is called wrong
NEGATIVE = 0.03  # share of a joint's torque from which on a number that came out negative is told
MOVING = 100  # samples in which a joint must move
CUT = 0.01  # share of samples at the peak torque from which on it is told
BEYOND = 0.2  # angle beyond a joint's ends from which on it is told, rad
BETTER = 0.8  # correlation with the torque of another joint from which on they may be swapped


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
            pose, ``v`` (n, nv) has its velocity; a foot that is neither fast nor lifted may be on
            the ground. Rows that are not finite are left out; gaps split the log.
            ``joint_position`` and ``joint_torque`` are read, too, as sensors name them; measured
            torques are left aside where there are gains. These may be a number, or (joints,), if
            they never change.

    Returns:
        The numbers. What is wrong with the log stands in ``status``, and nothing is known of a
        joint whose torques are not its own; armature, damping and friction are never negative.

    Raises:
        InputError: signals are missing or have other shapes, rows are too far apart, or no second
            is without a gap.
    """
    samples, said = read_samples(robot, log)
    angles, n = samples.halves[0].q[:, 7:], len(robot.joints)
    over = np.maximum(
        robot.joint_lower - angles.min(axis=0), angles.max(axis=0) - robot.joint_upper
    )
    moving = ~samples.still
    cut = (samples.cut & moving).mean(axis=0) > CUT
    said += _named(robot, over > BEYOND, "angles beyond the joint's ends: another unit or order?")
    said += _named(robot, cut, "torque at its limit, rows left out")
    said += _named(robot, moving.sum(axis=0) < MOVING, "hardly moves")
    air = in_the_air(robot, samples)
    rows = joint_rows(robot, samples, air)
    prior, precision = np.zeros(len(NUMBERS)), np.diag([RIGHT**-2, 0.0, 0.0, 0.0, 0.0, LATE**-2])
    found = [_solved(samples, one, prior, precision) for one in rows]
    late = [one.values[-1] for one in found if one.error[-1] <= SURE["delay"]]
    if late:  # the others are likely as late
        prior[-1] = np.median(late)
        precision[-1, -1] = max(float(np.std(late)), ALIKE) ** -2
        found = [_solved(samples, one, prior, precision) for one in rows]
    bad, lines = _suspicious(robot, samples, rows, found)
    said += lines
    values, left, size = (
        np.array([getattr(one, name) for one in found]) for name in ("values", "left", "size")
    )
    errors = np.array(
        [np.where(wrong, np.inf, one.error) for one, wrong in zip(found, bad, strict=True)]
    )
    negative = np.array([one.negative for one in found])
    more: dict[str, Any] = {
        "rows": tuple(
            (samples.t[part.sample[: len(one.measured)]], one.measured, one.predicted)
            for part, one in zip(rows, found, strict=True)
        )
    }
    if not samples.held:
        whole = _standing(robot, samples, air, rows, found, (prior, precision))
        many, ever = n * len(NUMBERS), np.array([len(one.measured) > 0 for one in found])[:, None]
        values, errors, negative = (
            np.where(ever, alone, x[:many].reshape(n, -1))
            for alone, x in (
                (values, whole.values),
                (errors, whole.error),
                (negative, whole.negative),
            )
        )
        left, size = (
            np.where(np.isnan(left), whole.left, left),
            np.where(np.isnan(size), whole.size, size),
        )
        more |= {"payload": whole.values[many:], "payload_error": whole.error[many:]}
        if whole.left > LEFT:
            said.append(f"{100.0 * whole.left:.0f} % of the forces are not explained")
    known: dict[str, Any] = {}
    error, excited = dict[str, Vector](), dict[str, Any]()
    for k, name in enumerate(NUMBERS):
        value, error[name] = values[:, k], errors[:, k]
        share = error[name] / np.maximum(np.abs(value), 1e-12)
        sure = SURE.get(name, OFFSET * size)
        excited[name] = share <= EXCITED if name in POSITIVE else error[name] <= sure
        told = excited[name] | ((share <= KNOWN) & (name in POSITIVE))
        known[name] = np.where(told, value, np.nan)
        if name in POSITIVE:
            below = negative[:, k] > NEGATIVE
            said += _named(robot, below, f"{name} came out negative, so it is not known")
    return Joints(
        robot.joints, **known, error=error, excited=excited, left=left, status=tuple(said), **more
    )


def _solved(samples: Samples, rows: Rows, prior: Vector, precision: Vector) -> Solution:
    """The numbers of a joint; nothing where it hardly moves."""
    if len(rows.sample) >= MOVING:
        return solve(samples, rows, prior, precision)
    unknown, none = np.full(len(prior), np.inf), np.zeros(0)
    return Solution(np.nan * unknown, np.diag(unknown), 0.0 * prior, none, none)


def _standing(
    robot: Robot,
    samples: Samples,
    air: NDArray[np.bool_],
    rows: list[Rows],
    found: list[Solution],
    before: tuple[Vector, Vector],
) -> Solution:
    """All numbers together, by what they are known to be in the air and by the forces on feet."""
    one, many = len(NUMBERS), len(NUMBERS) * len(found)
    prior, precision = np.zeros(many + PAYLOAD), np.zeros((many + PAYLOAD, many + PAYLOAD))
    for j, solution in enumerate(found):
        place = slice(one * j, one * (j + 1))
        prior[place], precision[place, place] = before
        if np.isfinite(solution.values).all():
            prior[place] = solution.values - np.eye(one)[0]
            size = np.sqrt(np.diag(solution.covariance))
            precision[place, place] = (
                np.linalg.inv(solution.covariance / size / size[:, None]) / size / size[:, None]
            )
    return solve(samples, standing_rows(robot, samples, air, rows), prior, precision)


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
