"""One walk of a campaign."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from tempfile import NamedTemporaryFile
from typing import Any

import numpy as np

from comparison.campaign.plan import ENGINES, JOINT_DAMPING, Task
from comparison.contenders import controller_part
from comparison.measure.walking import walk_as_far_as_it_goes
from harpy_pin import Actuators, Disturbances, Ground, Scenario, Straight, load_harpy, make_gait, measure
from harpy_pin.gaits import StraightGait
from harpy_pin.model.robot import harpy_urdf
from harpy_pin.scenario import ControllerPart, Governed
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensors import Noise

MEASURES = (
    "fell",
    "duration_s",
    "distance_m",
    "slip_mm_per_step",
    "net_slip_mm_per_step",
    "late_slip_mm_per_step",
    "sliding",
    "low_force",
    "tracking_rms_mm",
    "thrust_rms_n",
    "solver_failures",
)
"""What is kept of :class:`harpy_pin.log.Measures`."""

ICE = (0.4, 0.7)
"""Where the strip of ice begins and ends, as shares of the way that the walk is to go: about two steps."""


def walk_task(task: Task) -> dict[str, Any]:
    """Walk the scenario of a task, and measure.

    Returns:
        The measures :data:`MEASURES`, ``fall_time_s`` (None without a fall) and ``ending``. A controller that fails
        counts as a fall at that moment.
    """
    run = walk_as_far_as_it_goes(scenario(task))
    measures = measure(run).as_dict()
    row: dict[str, Any] = {name: measures[name] for name in MEASURES}
    row["fell"] = run.ending != "completed"
    row["fall_time_s"] = measures["duration_s"] if row["fell"] else None
    row["ending"] = run.ending
    return row


def scenario(task: Task) -> Scenario:
    """The scenario of a task."""
    gait = _gait()
    rng = np.random.default_rng(task.seed)
    start = task.jitter * rng.standard_normal(2)
    push = draw_push(task, gait, rng)
    ground = Ground(mu_s=task.friction, stiffness=task.stiffness, friction_strips=_ice(task))
    assert ground.damping is not None
    return Scenario(
        ground=replace(ground, damping=task.damping * ground.damping),
        plant=ENGINES[task.plant],
        gait=Straight(speed=task.speed),
        controller=_controller(task),
        disturbances=Disturbances(
            mass_error=task.mass_error,
            start_velocity=(*start, 0.0, 0.0, 0.0, 0.0),
            pushes=(push,) if task.push > 0.0 else (),
            noise=Noise.typical(task.noise),
            delay=task.delay,
            seed=task.seed,
            actuators=Actuators(torque_share=task.torque_share or None, bandwidth=task.bandwidth or None),
        ),
        duration=task.duration,
        urdf=None if task.joint_damping == JOINT_DAMPING else damped_harpy(task.joint_damping),
    )


def _controller(task: Task) -> ControllerPart:
    """The controller of a task, which knows the torque limits where there are any."""
    part = controller_part(task.contender, mu=task.friction * (1.0 + task.friction_error))
    if task.torque_share == 0.0:
        return part
    if isinstance(part, Governed):
        return replace(part, limits=True)
    limits = {**part.parameters.get("limits", {}), "torque_scale": task.torque_share}
    return replace(part, parameters={**part.parameters, "limits": limits})


def damped_harpy(joint_damping: float) -> str:
    """Path of Harpy's URDF with this damping in every joint, N·m·s/rad; the file is deleted when the process ends."""
    return str(_damped(joint_damping).name)


@cache
def _damped(joint_damping: float) -> Any:
    text = re.sub(r'damping="[^"]*"', f'damping="{joint_damping:g}"', harpy_urdf().read_text(encoding="utf-8"))
    file = NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8")  # noqa: SIM115
    file.write(text)
    file.flush()
    return file


def _ice(task: Task) -> tuple[tuple[float, float, float], ...]:
    """The strip of ice of a task, where it has one; never less slippery than the ground beside it."""
    if task.ice == 0.0:
        return ()
    begin, end = (share * task.speed * task.duration for share in ICE)
    return ((begin, end, min(task.ice, task.friction)),)


def draw_push(task: Task, gait: StraightGait, rng: np.random.Generator) -> Push:
    """The lateral push of a task: its side and its step are drawn; its middle is the middle of single support.

    It is never in the first step, nor in the last two, so that the walk after the push is seen.
    """
    step, double = gait.step_duration, gait.double_support
    last = max(int(task.duration / step) - 2, 2)
    index, side = int(rng.integers(1, last)), float(rng.choice((-1.0, 1.0)))
    middle = step * (index + 0.5 * (1.0 + double))
    duration = 0.1
    return Push(middle - 0.5 * duration, (0.0, side * task.push, 0.0), duration)


@cache
def _gait() -> StraightGait:
    """A gait of the scenarios, for the times of its steps: they are the same at every speed."""
    return make_gait(load_harpy())
