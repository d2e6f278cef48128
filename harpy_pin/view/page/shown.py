"""A run as a page shows it: with its robot, its frames, a name and a colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view.palette import RUNS
from harpy_pin.view.scene.frames import Frames, finite_part, static_friction

__all__ = ["MAX_RUNS", "Shown", "line_up", "name_of"]

MAX_RUNS = len(RUNS)
"""Runs that one page plays side by side."""
_GOVERNORS = {"none": "No governor", "paper": "Paper's governor", "cone": "Cone governor", "filter": "Force governor"}
_CONTROLLERS = {"condensed": "Condensed controller", "wbc": "Whole-body QP"}


@dataclass(frozen=True, eq=False)
class Shown:
    """A run on a page.

    Attributes:
        name: told apart from those of the other runs of the page.
        colour: ``#rrggbb``.
        run: the rows of the log that are finite.
        robot: that was logged.
        frames: the rows that are drawn.
        complete: whether all rows of the log are finite.
    """

    name: str
    colour: str
    run: Run
    robot: Robot
    frames: Frames
    complete: bool


def name_of(run: Run) -> str:
    """What walks, in words: from the scenario where there is one, else the name of the controller's class."""
    scenario = run.metadata.get("scenario")
    own = run.metadata.get("own")
    if isinstance(scenario, dict) and not (isinstance(own, list) and "controller" in own):
        part = scenario.get("controller")
        said = part if isinstance(part, dict) else {"name": part, "governor": scenario.get("governor")}  # before 0.2
        controller, governor = said.get("name"), said.get("governor")
        if controller == "governed" and isinstance(governor, str) and governor in _GOVERNORS:
            return _GOVERNORS[governor]
        if isinstance(controller, str) and controller in _CONTROLLERS:
            return _CONTROLLERS[controller]
    return str(run.metadata.get("controller", "Run"))


def line_up(runs: Sequence[tuple[Run, Robot]], *, fps: float, names: Sequence[str] | None = None) -> list[Shown]:
    """Runs ready to be shown together.

    Args:
        runs: each with the robot that was logged.
        fps: frames per second of simulated time.
        names: of the runs; found in their logs by default.

    Raises:
        InputError: no run or too many, another number of names, or as :meth:`Frames.from_run`.
    """
    if any(not isinstance(entry, tuple) or len(entry) != 2 for entry in runs):
        raise InputError("runs must be pairs of a run and its robot", name="runs", value=runs)
    if not 1 <= len(runs) <= MAX_RUNS:
        raise InputError(f"a page shows 1 to {MAX_RUNS} runs, got {len(runs)}", name="runs")
    if names is None:
        names = _distinct([run for run, _ in runs])
    if len(names) != len(runs):
        raise InputError(f"{len(runs)} runs need as many names, got {len(names)}", name="names")
    shown = []
    for (run, robot), name, colour in zip(runs, names, RUNS, strict=False):
        frames = Frames.from_run(run, robot, fps=fps)
        finite = finite_part(run)
        shown.append(Shown(str(name), colour, finite, robot, frames, len(finite) == len(run)))
    return shown


def _distinct(runs: Sequence[Run]) -> list[str]:
    """Names of runs; with their friction, then numbers, where they would be the same."""
    names = [name_of(run) for run in runs]
    if len(set(names)) < len(names):
        marks = [static_friction(run) for run in runs]
        names = [name if mu is None else f"{name}, μ = {mu:g}" for name, mu in zip(names, marks, strict=True)]
    return [name if names.count(name) == 1 else f"{name} ({k + 1})" for k, name in enumerate(names)]
