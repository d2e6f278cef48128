"""Joints known from a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.equations import Rows, hung_rows, standing_rows
from harpy_pin.contrib.identify.joints import Joints
from harpy_pin.contrib.identify.regression import NUMBERS, POSITIVE, Solution, solve
from harpy_pin.contrib.identify.signals import Piece, read_pieces
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

KNOWN, EXCITED = 0.5, 0.03
"""Standard error over the number itself up to which it is told, and up to which the log excites it."""
SURE = {"torque_scale": 0.02, "delay": 5e-4}
"""The same of these, as it is; else the scale is one, and the delay zero s."""
OFFSET = 0.02
"""The same of a bias, as a share of the joint's rms torque."""
LEFT = 0.3
"""Share of a joint's torque that may stay unexplained before the log is called wrong."""
NEGATIVE = 0.03
"""Share of a joint's torque from which on a number that came out negative is told."""
MOVING = 100
"""Samples in which a joint must move."""
CUT, BEYOND, BETTER = 0.01, 0.2, 0.8
"""Share of samples at the peak torque; rad beyond a joint's ends; and correlation of torques from which on joints
may be swapped."""


@checked
def identify(robot: Robot, log: Run | Mapping[str, Vector]) -> Joints:
    """Armature, damping, dry friction, bias and delay of every joint, scale of its torque, and what is on the base.

    Args:
        robot: its masses and inertias are taken as they are; what its joints have is not looked at.
        log: signals of n rows, at least 100 a second: ``t`` (n,), s; ``q``, either (n, joints) angles of a robot that
            hangs, its base held level, or (n, nq) with the base's pose, rad; and ``torque`` (n, joints), measured or
            commanded, N·m. Motors with a law of their own (:class:`harpy_pin.Command`) have ``k_p``, ``k_d``,
            ``target_q`` and ``target_v`` (n, joints) too, and ``torque`` is what is fed forward; gains change slowly.
            With the base's pose, ``v`` (n, nv) has its velocity (zero by default), and ``stance`` (n, feet), or
            ``foot_force``, says which feet are on the ground: the base is held where none ever is. Rows that are not
            finite are left out; gaps split the log.

    Returns:
        The numbers. What is wrong with the log stands in ``status``; armature, damping and friction are never negative.

    Raises:
        InputError: signals are missing or have other shapes, rows are too far apart, or no second is without a gap.
    """
    pieces, said = read_pieces(robot, log)
    angles = np.concatenate([piece.halves[0].q for piece in pieces])
    beyond = np.maximum(
        robot.joint_lower - angles.min(axis=0), angles.max(axis=0) - robot.joint_upper
    )
    said += _named(
        robot, beyond > BEYOND, "angles beyond the joint's ends: another unit, zero or order?"
    )
    cut = np.concatenate([piece.cut for piece in pieces]).mean(axis=0)
    said += _named(robot, cut > CUT, "torque at its limit, rows left out")
    if any(piece.stance.any() for piece in pieces):
        return _standing(robot, pieces, said)
    rows = hung_rows(robot, pieces)
    still = np.array([len(part.sample) < MOVING for part in rows])
    said += _named(robot, still, "hardly moves: nothing is known")
    found = [None if bad else _solved(pieces, part) for bad, part in zip(still, rows, strict=True)]
    said += _suspicious(robot, pieces, rows, found)
    t = np.concatenate([piece.t for piece in pieces])
    shown = [
        (np.zeros(0),) * 3 if one is None else (t[part.sample], one.measured, one.predicted)
        for part, one in zip(rows, found, strict=True)
    ]
    values, errors, negative = (
        np.array(
            [np.full(len(NUMBERS), empty) if one is None else getattr(one, name) for one in found]
        )
        for name, empty in (("values", np.nan), ("error", np.inf), ("negative", 0.0))
    )
    left = np.array([np.nan if one is None else one.left for one in found])
    size = np.array([1.0 if one is None else np.sqrt(np.mean(one.measured**2)) for one in found])
    return _joints(robot, values, errors, negative, size, left, said, rows=tuple(shown))


def _standing(robot: Robot, pieces: list[Piece], said: list[str]) -> Joints:
    """The same of a robot on its feet, whose joints share equations."""
    rows = standing_rows(robot, pieces)
    solution, many = _solved(pieces, rows), len(NUMBERS) * len(robot.joints)
    values, errors, negative = (
        getattr(solution, name)[:many].reshape(-1, len(NUMBERS))
        for name in ("values", "error", "negative")
    )
    size, left = np.full(len(robot.joints), np.sqrt(np.mean(solution.measured**2))), solution.left
    said += [f"{100.0 * left:.0f} % of the forces are not explained"] if left > LEFT else []
    payload, error = solution.values[many:], solution.error[many:]
    more: dict[str, Any] = {"payload": payload, "payload_error": error}
    return _joints(
        robot, values, errors, negative, size, np.full(len(robot.joints), left), said, **more
    )


def _solved(pieces: list[Piece], rows: Rows) -> Solution:
    """The numbers of rows; a scale or a delay of which they say too little is one, or zero."""
    given = np.full(len(NUMBERS) * len(rows.joints) + rows.payload.shape[2], np.nan)
    for name, default in (("delay", 0.0), ("torque_scale", 1.0)):
        solution, place = (
            solve(pieces, rows, given),
            np.arange(len(rows.joints)) * len(NUMBERS) + NUMBERS.index(name),
        )
        given[place[~(solution.error[place] <= SURE[name])]] = default
    return solve(pieces, rows, given)


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
    robot: Robot, pieces: list[Piece], rows: list[Rows], found: list[Solution | None]
) -> list[str]:
    """Joints whose torques are not theirs: of the wrong sign, of another joint, or of nothing known."""
    said, torques = (
        [],
        [np.concatenate([p.torque(0, j, 0.0)[0] for p in pieces]) for j in range(len(rows))],
    )
    wrong = [one is not None and one.values[0] < 0.0 for one in found]
    said += _named(robot, np.array(wrong), "torque of the wrong sign")
    odd = [
        one is not None and not bad and one.left > LEFT
        for one, bad in zip(found, wrong, strict=True)
    ]
    rest = []
    for j in np.flatnonzero(odd):
        part = rows[j]
        match = [
            np.corrcoef(part.known.mean(axis=0), torque[part.sample])[0, 1] for torque in torques
        ]
        best = int(np.nanargmax(match))
        if best != j and match[best] > BETTER:
            said.append(f"{robot.joints[j]}: torque of another joint, {robot.joints[best]}?")
        else:
            rest.append(j)
    return said + _named(
        robot, np.isin(np.arange(len(rows)), rest), "torque does not explain the motion"
    )


def _named(robot: Robot, which: Any, what: str) -> list[str]:
    """A line of the status, if any joint is meant."""
    names = [name for name, one in zip(robot.joints, which, strict=True) if one]
    return [f"{', '.join(names)}: {what}"] if names else []
