"""Joints known from a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.equations import Rows, in_the_air, joint_rows, payload
from harpy_pin.contrib.identify.joints import Joints
from harpy_pin.contrib.identify.regression import NUMBERS, POSITIVE, Solution, solve, unknown
from harpy_pin.contrib.identify.signals import Samples, read_samples
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

KNOWN = 0.2 / 3.0  # standard error over the number up to which it is told: within a fifth
EXCITED = 0.1 / 3.0  # the same up to which the log excites it: within a tenth
SURE = {"torque_scale": 0.02, "delay": 5e-4}
"""Standard errors of these up to which they are told."""
OFFSET = 0.02  # the same of a bias, as a share of the joint's rms torque
RIGHT = 0.05  # standard deviation of a scale about one before the log is seen
LATE, ALIKE = 5e-3, 2e-4
"""The same of a delay about zero, and about that of the other joints at least, s."""
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
    angles, moving = samples.halves[0].q[:, 7:], ~samples.still
    over = np.maximum(
        robot.joint_lower - angles.min(axis=0), angles.max(axis=0) - robot.joint_upper
    )
    cut = (samples.cut & moving).mean(axis=0) > CUT
    said += _named(robot, over > BEYOND, "angles beyond the joint's ends: another unit or order?")
    said += _named(robot, cut, "torque at its limit, rows left out")
    air = in_the_air(robot, samples)
    rows = joint_rows(robot, samples, air)
    few = np.array([len(one.sample) < MOVING for one in rows])
    what = "hardly moves" if samples.held else "hardly in the air"
    said += _named(robot, few & ~cut, what)
    prior, precision = np.zeros(len(NUMBERS)), np.zeros(len(NUMBERS))
    precision[[0, -1]] = RIGHT**-2, LATE**-2
    for _ in range(2):
        found = [
            unknown() if none else solve(samples, one, prior, precision)
            for one, none in zip(rows, few, strict=True)
        ]
        late = [one.values[-1] for one in found if one.error[-1] <= SURE["delay"]]
        if late:  # the others are likely as late
            prior[-1], precision[-1] = np.median(late), max(float(np.std(late)), ALIKE) ** -2
    bad, lines = _suspicious(robot, samples, rows, found)
    values, errors, negative = (
        np.array([getattr(one, name) for one in found]) for name in ("values", "error", "negative")
    )
    errors[bad] = np.inf
    known, error, excited = dict[str, Any](), dict[str, Vector](), dict[str, Any]()
    for k, name in enumerate(NUMBERS):
        value, error[name] = values[:, k], errors[:, k]
        share = error[name] / np.maximum(np.abs(value), 1e-12)
        sure = SURE.get(name, OFFSET * np.array([one.size for one in found]))
        positive = name in NUMBERS[POSITIVE]
        excited[name] = share <= EXCITED if positive else error[name] <= sure
        known[name] = np.where(share <= KNOWN if positive else excited[name], value, np.nan)
        below = positive & (negative[:, k] > NEGATIVE)
        lines += _named(robot, below, f"{name} came out negative, so it is not known")
    mass = not (samples.held or robot.thrusters or robot.rotors)
    at_joints = np.array([_at_joint(samples, j, *one.values) for j, one in enumerate(found)])
    return Joints(
        robot.joints,
        **known,
        error=error,
        excited=excited,
        left=np.array([one.left for one in found]),
        payload=payload(robot, samples, air, at_joints.T, RIGHT) if mass else None,
        status=(*said, *lines),
        rows=tuple(
            (samples.t[part.sample[: len(one.measured)]], one.measured, one.predicted)
            for part, one in zip(rows, found, strict=True)
        ),
    )


def _at_joint(samples: Samples, joint: int, *values: float) -> Vector:
    """(n,) torque at a joint, N·m; that of the log where nothing is known of the joint."""
    half = samples.halves[0]
    k, b, armature, damping, friction, late = np.where(np.isnan(values), np.eye(6)[0], values)
    torque, _ = half.torque(joint, late)
    lost = armature * half.a[:, 6 + joint] + damping * half.v[:, 6 + joint]
    return np.asarray(k * torque + b - lost - friction * half.sign[:, joint])


def _suspicious(
    robot: Robot, samples: Samples, rows: list[Rows], found: list[Solution]
) -> tuple[NDArray[np.bool_], list[str]]:
    """(joints,) whether torques are not the joint's: of the wrong sign, of another joint, or of
    nothing known; and lines of the status.
    """
    wrong = np.array([one.values[0] < 0.0 for one in found])
    odd = np.array([one.left > LEFT for one in found])
    said, rest = _named(robot, wrong, "torque of the wrong sign"), odd & ~wrong
    torques = np.transpose([_at_joint(samples, j, *unknown().values) for j in range(len(rows))])
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
