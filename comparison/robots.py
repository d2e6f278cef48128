"""Well-known robots stand, shift their weight and are pushed, under the whole-body QP and the condensed controller.

A biped on point feet cannot stand: it steps in place.

Gains and weights are the library's; ranges of force and the weight on forces follow from the mass
(:attr:`harpy_pin.Standing.parameters`), and so do the ground's stiffness and the pushes. One setting was chosen here:
the damping of held soles, on G1 at rest on this ground, without a push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.thread_ticks import time_ticks
from comparison.measure.walking import Progress, Rows, tracked
from comparison.tables import Cell, Table, in_columns
from harpy_pin import (
    Disturbances,
    Dynamics,
    Ground,
    HarpyError,
    InputError,
    Push,
    Robot,
    Run,
    Scenario,
    Standing,
    Stepping,
    build,
    checks,
    load_robot,
    measure,
)
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.state import Vector

__all__ = ["RobotsSettings", "robot_tables", "stand_robots"]

GRAVITY = 9.81
SINK = 1e-3
"""How deep the feet sink in when the robot stands, m: it makes the ground's stiffness."""
LEAN = 0.3
"""Share of the way from above the middle to above the first foot, by which the weight is shifted."""
LEAN_AT, PUSH_AT = 0.3, 0.5
"""Times of shift and push, s."""
CONTROLLERS = {"QP": "wbc", "condensed": "condensed"}
SIDES = {"sideways": (0.0, 1.0, 0.0), "forward": (1.0, 0.0, 0.0)}
_ROBOT = {"mass_kg": ("mass", "kg"), "dof": ("DoF", ""), "feet": ("feet", ""), "terms_error": ("terms' error", "")}
_TICKS = {
    "slip_mm": ("slip, shift", "mm"),
    **{f"{side}_slip_mm": (f"slip, {side}", "mm") for side in SIDES},
    "friction_used": ("friction used", ""),
    "tick_us": ("tick", "µs"),
    "worst_us": ("worst", "µs"),
}
LOADED = 0.05
"""Normal force of a foot, as a share of the weight, from which on its friction counts."""


@dataclass(frozen=True, kw_only=True)
class RobotsSettings:
    """What is tried.

    Attributes:
        robots: names of robots of the catalogue.
        friction: of the ground, which the controllers know.
        duration: of a run, s.
        pushes: impulse over mass of pushes of 0.1 s on the base, m/s, in growing order: each is tried if the one before
            was stood.
        seed: of the states at which the terms are compared with Pinocchio's.
    """

    robots: tuple[str, ...] = tuple(CATALOGUE)
    friction: float = 0.5
    duration: float = 3.0
    pushes: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4)
    seed: int = 0

    def __post_init__(self) -> None:
        for name in self.robots:
            checks.one_of("robot", name, CATALOGUE)
        checks.number("duration", self.duration, low=2.0 * PUSH_AT)
        if not self.pushes or list(self.pushes) != sorted(self.pushes):
            raise InputError(f"pushes must grow, and there must be one, got {self.pushes}", name="pushes")

    @classmethod
    def quick(cls) -> RobotsSettings:
        """A quadruped and a humanoid, and the weakest push: to see whether it works."""
        return cls(robots=("solo12", "g1"), duration=1.5, pushes=(0.1,))


def stand_robots(settings: RobotsSettings, progress: Progress | None = None) -> Rows:
    """All robots under both controllers.

    Returns:
        A row for each robot: what it is, and what happened under each controller; with a reason where something did
        not.
    """
    return [_try(name, settings) for name in tracked(settings.robots, progress)]


def _try(name: str, settings: RobotsSettings) -> dict[str, Any]:
    """One robot."""
    try:
        robot = load_robot(name)
    except HarpyError as error:
        return {"robot": name, "loads": False, "reason": str(error).splitlines()[0], "controllers": {}}
    kind = "points" if not robot.flat_feet else "flat_feet"
    row: dict[str, Any] = {
        "robot": name,
        "loads": True,
        "mass_kg": robot.mass,
        "dof": int(robot.model.nv),
        "feet": f"{len(robot.corners)} {kind}",
        "terms_error": terms_error(robot, np.random.default_rng(settings.seed)),
        "controllers": {},
    }
    for label, controller in CONTROLLERS.items():
        try:
            row["controllers"][label] = _stand(robot, controller, settings)
        except HarpyError as error:
            row["controllers"][label] = {"stands": None, "reason": str(error).splitlines()[0]}
    return row


def terms_error(robot: Robot, rng: np.random.Generator, *, states: int = 10) -> float:
    """Largest difference of mass matrix and bias from Pinocchio's, relative to their largest entries."""
    model, dynamics = robot.model, Dynamics(robot)
    data, worst = model.createData(), 0.0
    for _ in range(states):
        q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
        v = rng.standard_normal(model.nv)
        dynamics.update(q, v)
        upper = np.triu(pin.crba(model, data, q))
        matrix, bias = upper + np.triu(upper, 1).T, pin.rnea(model, data, q, v, np.zeros(model.nv))
        for ours, theirs in ((dynamics.mass_matrix, matrix), (dynamics.bias, bias)):
            worst = max(worst, float(np.abs(ours - theirs).max() / np.abs(theirs).max()))
    return worst


def run_standing(
    robot: Robot,
    controller: str,
    *,
    friction: float = 0.5,
    duration: float = 3.0,
    lean: float = 0.0,
    push: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[Run, Vector]:
    """Stand, or step in place on two points, on compliant ground, with the weight shifted or with a push.

    Args:
        robot: with a standing posture.
        controller: ``wbc`` or ``condensed``.
        friction: of the ground.
        duration: s.
        lean: share of the way over the first foot; a robot that steps does not shift its weight besides.
        push: (3,) impulse over mass, m/s; zero for none.

    Returns:
        The run, and the ticks' times, µs of this thread.

    Raises:
        InputError: the controller does not take the robot.
    """
    gait = Stepping(robot) if robot.corners == (1, 1) else Standing(robot)
    mass = robot.mass
    scenario = Scenario(
        controller={"name": controller, "parameters": gait.parameters},
        ground=Ground(mu_s=friction, stiffness=mass * GRAVITY / (len(robot.feet) * SINK)),
        disturbances=Disturbances(
            pushes=(Push(PUSH_AT, (mass * push[0], mass * push[1], mass * push[2])),) if any(push) else ()
        ),
        duration=duration,
    )
    built = build(scenario, gait=gait)
    if lean and isinstance(gait, Standing):
        gait.move(lean * gait.over(0), t=LEAN_AT, duration=min(1.0, duration - LEAN_AT))
    return time_ticks(built)


def _stand(robot: Robot, controller: str, settings: RobotsSettings) -> dict[str, Any]:
    """What one controller does with a robot."""
    result: dict[str, Any] = {}
    common: dict[str, Any] = {"friction": settings.friction, "duration": settings.duration}
    shifted, all_ticks = run_standing(robot, controller, lean=LEAN, **common)
    result.update(stands=stood(shifted), slip_mm=_slip(shifted), friction_used=friction_used(shifted, robot))
    for side, direction in SIDES.items():
        largest = 0.0
        for speed in settings.pushes:
            run, ticks = run_standing(robot, controller, push=[speed * part for part in direction], **common)
            if not stood(run):
                break
            if speed == settings.pushes[0]:
                result[f"{side}_slip_mm"] = _slip(run)
                all_ticks = np.append(all_ticks, ticks)
            largest = speed
        result[side] = largest
    result.update(tick_us=float(np.median(all_ticks)), worst_us=float(all_ticks.max()))
    if not result["stands"]:
        result["reason"] = f"{shifted.ending} at {shifted['t'][-1]:.2f} s"
    return result


def stood(run: Run) -> bool:
    """Whether the robot came through: no fall, and never a tilt of more than 0.5 rad."""
    return run.ending == "completed" and not measure(run).stumbled


def _slip(run: Run) -> float:
    """Way along the ground in the whole run, mean of all contact points, mm."""
    return float(1e3 * run["slip_path"][-1].mean())


def friction_used(run: Run, robot: Robot) -> float:
    """Largest horizontal over normal force of a foot, all its corners together, while it carries."""
    starts = np.cumsum((0, *robot.corners))[:-1]
    force = np.add.reduceat(run["foot_force"], starts, axis=1)
    carries = force[..., 2] > LOADED * robot.mass * GRAVITY
    ratio = np.linalg.norm(force[..., :2], axis=-1)[carries] / force[..., 2][carries]
    return float(ratio.max(initial=0.0))


def robot_tables(rows: Rows) -> list[Table]:
    """What loads and stands; then slip and times."""
    standing: list[Cell] = []
    times: list[Cell] = []
    for row in rows:
        name = row["robot"]
        standing.append(Cell(name, "loads", "yes" if row["loads"] else f"no: {row['reason']}"))
        if not row["loads"]:
            continue
        standing += in_columns(name, row, _ROBOT)
        for label, found in row["controllers"].items():
            standing.append(Cell(name, f"stands, {label}", "yes" if found["stands"] else f"no: {found['reason']}"))
            if found["stands"] is not None:
                standing += [Cell(name, f"{side}, {label}", found[side], "m/s") for side in SIDES]
                times += in_columns(f"{name}, {label}", found, _TICKS)
    note = (
        "Standing on all feet with the weight shifted by 30 % of the way over the first foot; on two points, stepping "
        "in place. Sideways and forward: "
        "the largest push on the base that was stood, impulse over mass; 0 where the weakest was not. Terms' error: "
        "mass matrix and bias beside Pinocchio's, relative."
    )
    slip = (
        "Slip: mean way of the contact points along the ground in the run, with the weight shifted and with the "
        "weakest push. Friction used: largest horizontal over normal force of a foot while the weight is shifted. "
        "Ticks in time of the thread, over the same three runs."
    )
    return [
        Table("robots", "Robots that stand and take pushes", tuple(standing), note),
        Table("robots_ticks", "Their slip and their ticks", tuple(times), slip),
    ]
