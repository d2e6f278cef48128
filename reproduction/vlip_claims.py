"""The first simulation, with the constraints evaluated at both states, and claims Q1 to Q3."""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from harpy_pin.governors.rows import EVALUATE_AT
from harpy_pin.model.state import Vector
from reproduction.chattering import Chattering, chattering
from reproduction.claims import CLAIMS, Finding, judge
from reproduction.vlip_simulation import (
    COORDINATES,
    STARTS,
    VlipParameters,
    VlipRun,
    simulate_vlip,
    vlip_governor,
    vlip_setting,
)

DIVISORS = (1, 2, 4)
"""Of the step, where chattering is measured."""


@dataclass(frozen=True)
class VlipCase:
    """One way to run the simulation."""

    evaluate_at: str | None  # of the force rows; none is without a governor
    coordinates: str = "polar"  # of the governed reference
    start: str = "paper"  # of body and reference

    @property
    def command(self) -> str:
        """The command that prints this case's numbers."""
        if self.evaluate_at is None:
            return f"python -m reproduction vlip --governor none --start {self.start}"
        options = (
            f"--evaluate-at {self.evaluate_at} --coordinates {self.coordinates} --start "
            f"{self.start}"
        )
        return f"python -m reproduction vlip {options}"

    def run(self, *, divide: int = 1) -> VlipRun:
        """Run it, with the step divided."""
        parameters = VlipParameters(
            coordinates=self.coordinates, start=self.start, dt=VlipParameters.dt / divide
        )
        governor = (
            None
            if self.evaluate_at is None
            else vlip_governor(parameters, evaluate_at=self.evaluate_at)
        )
        return simulate_vlip(governor, parameters)


@dataclass(frozen=True, eq=False)
class VlipStudy:
    """All runs of the first simulation."""

    runs: dict[VlipCase, VlipRun]  # by case
    # of the applied reference's position and of the normal force, by case and divisor of the step
    chattering: dict[tuple[VlipCase, int], tuple[Chattering, Chattering]]
    findings: tuple[Finding, ...]  # Q1, Q2, Q3
    inside: dict[str, dict[str, Any]]  # see :func:`study_inside`


def polar_of(position: Vector) -> Vector:
    """(n, 3) leg angle θ, heading φ (rad, continuous in time) and length l (m) of positions c − u.

    Args:
        position: (n, 3), m.
    """
    radial = np.hypot(position[:, 0], position[:, 1])
    theta = np.arctan2(radial, position[:, 2])
    phi = np.unwrap(np.arctan2(position[:, 1], position[:, 0]))
    return np.stack((theta, phi, np.linalg.norm(position, axis=1)), axis=1)


def study_vlip() -> VlipStudy:
    """Run every case, measure chattering at divided steps, and judge Q1 to Q3."""
    cases = [VlipCase(None, start=start) for start in STARTS]
    cases += [VlipCase(*case) for case in product(EVALUATE_AT, COORDINATES, STARTS)]
    runs = {case: case.run() for case in cases}
    measured: dict[tuple[VlipCase, int], tuple[Chattering, Chattering]] = {}
    for case in cases:
        if case.start == "inside":
            continue
        for divide in DIVISORS:
            run = runs[case] if divide == 1 else case.run(divide=divide)
            period = run.parameters.dt
            measured[case, divide] = (
                chattering(run.x_w[:, :3], period=period),
                chattering(run.force[:, 2], period=period),
            )
    return VlipStudy(runs, measured, (_q1(runs), _q2(runs), _q3(runs)), study_inside())


INSIDE = {
    "no governor": ("none", "measured"),
    "paper's, measured state": ("paper", "measured"),
    "paper's, tracked reference": ("paper", "tracked"),
    "margin": ("margin", "measured"),
}
"""Governors of runs that start inside the friction cone, and where the paper's evaluates its
constraints.
"""


def study_inside() -> dict[str, dict[str, Any]]:
    """Every governor from a start inside the cone, with Cartesian references.

    Returns:
        By governor the summary of its run, but ``reversals_per_s`` by divisor of the step.
    """
    return {name: _inside(*how) for name, how in INSIDE.items()}


def _inside(governor: str, evaluate_at: str) -> dict[str, Any]:
    summaries = {}
    for divide in DIVISORS:
        given = VlipParameters(
            coordinates="cartesian", start="inside", dt=VlipParameters.dt / divide
        )
        parameters = vlip_setting(governor, given)
        made = vlip_governor(parameters, name=governor, evaluate_at=evaluate_at)
        summaries[divide] = simulate_vlip(made, parameters).summary()
    reversals = {str(divide): summary.reversals_per_s for divide, summary in summaries.items()}
    return vars(summaries[1]) | {"reversals_per_s": reversals}


def _kinds(run: VlipRun, force: Vector, reference: Vector) -> Vector:
    """(n, 4) friction x, friction y, normal force (N) and angle (rad) constraints."""
    theta = polar_of(reference[:, :3])[:, :1] - run.parameters.min_angle
    return np.concatenate((run.margins(force), theta), axis=1)


def _q1(runs: dict[VlipCase, VlipRun]) -> Finding:
    case = VlipCase(None)
    run = runs[case]
    margins = _kinds(run, run.force, run.x_r)
    shares = np.mean(margins < 0.0, axis=0)
    some = float(np.mean(margins.min(axis=1) < 0.0))
    kinds = int((shares > 0.0).sum())
    names = ("friction x", "friction y", "normal force", "angle")
    return Finding(
        CLAIMS["Q1"],
        judge(kinds == 4 and some > 0.5, kinds >= 2),
        f"{kinds} of 4 kinds violated at some time, one of them at {100 * some:.1f} % of the ticks",
        case.command,
        {"kinds": float(kinds), "share": some, **dict(zip(names, shares.tolist(), strict=True))},
    )


def _q2(runs: dict[VlipCase, VlipRun]) -> Finding:
    """Judged on the reading that does best, so that the paper gets its best case."""
    ungoverned = runs[VlipCase(None)].summary().violation_share
    governed = {
        case: run
        for case, run in runs.items()
        if case.evaluate_at is not None and case.start == "paper"
    }
    case = min(governed, key=lambda c: governed[c].summary().violation_share)
    run = governed[case]
    summary = run.summary()
    worst = run.margins(run.force).min(axis=1)
    later = run.t > 0.2  # the start violates whatever a governor does
    when = float(run.t[later][int(worst[later].argmin())])
    holds = (
        summary.violation_share <= 0.05 and summary.worst_violation_n <= 1.0 and 1.2 <= when <= 1.6
    )
    return Finding(
        CLAIMS["Q2"],
        judge(holds, summary.violation_share <= 0.5 * ungoverned),
        f"at best {100 * summary.violation_share:.1f} % of the ticks violate ({case.evaluate_at}, "
        f"{case.coordinates}), "
        f"by up to {summary.worst_violation_n:.2f} N, after 0.2 s worst at t = {when:.2f} s; "
        f"ungoverned {100 * ungoverned:.1f} %",
        case.command,
        {
            "violation_share": summary.violation_share,
            "worst_violation_n": summary.worst_violation_n,
            "worst_time_s": when,
            "ungoverned_share": ungoverned,
        },
    )


def _q3(runs: dict[VlipCase, VlipRun]) -> Finding:
    case = VlipCase("tracked", "polar")
    run = runs[case]
    first = run.t < 1.0
    difference = np.abs(polar_of(run.x_w[first, :3]) - polar_of(run.x_r[first, :3]))
    angle_time, length_time = (float(run.t[first][int(difference[:, i].argmax())]) for i in (0, 2))
    close = [abs(time - 0.5) <= 0.15 for time in (angle_time, length_time)]
    return Finding(
        CLAIMS["Q3"],
        judge(all(close), any(close)),
        f"in the first second the angle differs most at {angle_time:.2f} s "
        f"({np.rad2deg(difference[:, 0].max()):.1f}°), the length at {length_time:.2f} s "
        f"({1e3 * difference[:, 2].max():.0f} mm)",
        case.command,
        {
            "angle_time_s": angle_time,
            "length_time_s": length_time,
            "angle_rad": float(difference[:, 0].max()),
            "length_m": float(difference[:, 2].max()),
        },
    )
