"""One walk of a campaign."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.campaign.plan import Task, code_digest
from harpy_pin import checks
from harpy_pin.control import make_controller
from harpy_pin.errors import ControlError, InputError
from harpy_pin.gait import Gait, make_gait
from harpy_pin.model.robot import Robot, load_harpy
from harpy_pin.plant.ground import Ground
from harpy_pin.plant.measures import measure
from harpy_pin.plant.push import Push
from harpy_pin.plant.run import Run
from harpy_pin.plant.simulator import Simulator

__all__ = ["MEASURES", "do_task", "draw_push_of", "heavier", "simulate"]

MEASURES = (
    "fell",
    "duration_s",
    "distance_m",
    "slip_mm_per_step",
    "late_slip_mm_per_step",
    "sliding",
    "low_force",
    "tracking_rms_mm",
    "thrust_rms_n",
    "solver_failures",
)
"""What is kept of :class:`harpy_pin.Measures`."""


def do_task(task: Task, code: str) -> dict[str, Any]:
    """Walk, and measure.

    Args:
        task: the walk.
        code: :func:`~comparison.campaign.plan.code_digest` of whoever asks.

    Returns:
        The measures :data:`MEASURES`, ``fall_time_s`` (None without a fall) and ``ending``. A controller that fails
        counts as a fall at that moment.

    Raises:
        InputError: this process runs other code than whoever asks.
    """
    if code != code_digest():
        raise InputError("a worker runs other code or other versions than the campaign", name="code")
    try:
        run = simulate(task)
    except ControlError as error:
        if error.run is None or len(error.run) == 0:
            raise
        run = error.run
    measures = measure(run).as_dict()
    row: dict[str, Any] = {name: measures[name] for name in MEASURES}
    row["fell"] = run.ending != "completed"
    row["fall_time_s"] = measures["duration_s"] if row["fell"] else None
    row["ending"] = run.ending
    return row


def simulate(task: Task) -> Run:
    """The walk of a task.

    Raises:
        ControlError: the controller failed; ``error.run`` holds the log so far.
    """
    gait = make_gait(_nominal())
    controller = make_controller(
        task.controller, gait, mu=task.friction * (1.0 + task.friction_error), governor=task.governor or "none"
    )
    simulator = Simulator(heavier(_nominal(), task.mass_error), Ground(mu_s=task.friction))
    q, v = gait.initial_state(sink=simulator.static_sink)
    rng = np.random.default_rng(task.seed)
    v[:2] += task.jitter * rng.standard_normal(2)  # the body is upright and faces x: body and world axes agree
    push = draw_push_of(task, gait, rng)
    simulator.reset(q, v)
    return simulator.run(controller, task.duration, pushes=[push] if task.push > 0.0 else [])


def draw_push_of(task: Task, gait: Gait, rng: np.random.Generator) -> Push:
    """The lateral push of a task: its side and its step are drawn; its middle is the middle of single support.

    The first step is spared, and the last two, so that what follows the push is seen.
    """
    step, double = gait.step_duration, gait.double_support
    last = max(int(task.duration / step) - 2, 2)
    index, side = int(rng.integers(1, last)), float(rng.choice((-1.0, 1.0)))
    middle = step * (index + 0.5 * (1.0 + double))
    duration = 0.1
    return Push(middle - 0.5 * duration, (0.0, side * task.push, 0.0), duration)


def heavier(robot: Robot, error: float) -> Robot:
    """The robot with 1 + error times the mass and inertia of its body, the legs as they are.

    Args:
        robot: stays as it is.
        error: relative, above −1.
    """
    error = checks.number("mass error", error, low=-1.0, strict=True)
    model = robot.model.copy()
    body = model.inertias[1]
    model.inertias[1] = pin.Inertia(body.mass * (1.0 + error), body.lever, body.inertia * (1.0 + error))
    return replace(robot, model=model)


@cache
def _nominal() -> Robot:
    """The robot that the controllers believe in."""
    return load_harpy()
