"""Runs as a page shows them: with names and colours, facts, and their measures side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harpy_pin.errors import InputError
from harpy_pin.log.measures import Measures, measure
from harpy_pin.log.optional import tick_times
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import MAX_NUMBER
from harpy_pin.model.robot import Robot
from harpy_pin.view.palette import RUNS
from harpy_pin.view.scene.frames import Frames, finite_part, friction_strips, is_per_axis, static_friction

__all__ = ["MAX_RUNS", "Score", "Shown", "headline", "line_up", "name_of", "scoreboard"]

MAX_RUNS = len(RUNS)
"""Runs that one page plays side by side."""
_GOVERNORS = {"none": "No governor", "paper": "Paper's governor", "filter": "Force governor"}
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
        said = part if isinstance(part, dict) else {}
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


def headline(shown: Shown) -> tuple[str, list[tuple[str, str]]]:
    """Title and facts of a run, from its metadata and measures; what the log does not say is left out."""
    run = shown.run
    parameters = run.metadata.get("parameters") or {}
    controller = str(run.metadata.get("controller", "unknown controller"))
    governor, mu = parameters.get("governor"), static_friction(run)
    facts = [("controller", controller)]
    title = f"{run.metadata.get('robot', 'robot')} – {controller}"
    if governor is not None:
        facts.append(("governor", str(governor)))
        title += f" ({governor})" if governor != "none" else " (no governor)"
    if mu is not None:
        facts.append(("friction", f"μ = {mu:g} ({'box' if is_per_axis(run) else 'disc'})"))
        title += f", μ = {mu:g}"
        for begin, end, strip_mu in friction_strips(run):
            facts.append((f"from {begin:g} to {end:g} m", f"μ = {strip_mu:g}"))
    speed = (parameters.get("gait") or {}).get("speed")
    if isinstance(speed, int | float) and abs(speed) < MAX_NUMBER:
        facts.append(("speed desired", f"{speed:g} m/s"))
    distance, duration = float(run["q"][-1, 0] - run["q"][0, 0]), float(run["t"][-1] - run["t"][0])
    facts.append(("walked", f"{distance:.2f} m in {duration:.2f} s"))
    if len(run) > 1 and run["foot_force"].shape[1]:
        facts.append(("slip", f"{measure(run).slip_mm_per_step:.1f} mm per step"))
    facts.append(("ending", run.ending if shown.complete else f"{run.ending} (drawn up to there)"))
    return f"{title}, {run.ending}", facts


@dataclass(frozen=True)
class Score:
    """One measure of all runs.

    Attributes:
        label: with its unit.
        values: of each run, as text.
        best: numbers of the runs that are best at it; none where all are alike, or no run walked to its end.
    """

    label: str
    values: tuple[str, ...]
    best: tuple[int, ...]


_ROWS = (
    ("slip, mm per step", "slip_mm_per_step", "{:.1f}"),
    ("contact time sliding, %", "sliding", "{:.1%}"),
    ("distance from the target, mm rms", "tracking_rms_mm", "{:.1f}"),
    ("thrust, N rms", "thrust_rms_n", "{:.1f}"),
    ("thrusters at 1 kW for 18 N, W", "thrust_power_w", "{:.0f}"),
    ("joints, W", "joint_power_w", "{:.0f}"),
    ("largest torque, N·m", "torque_max_nm", "{:.1f}"),
    ("largest tilt, rad", "tilt_max_rad", "{:.2f}"),
)


def scoreboard(runs: Sequence[Run]) -> list[Score]:
    """Measures of runs of finite rows, at least two of each; a run that fell or stumbled is best at none."""
    measures = [measure(run) for run in runs]
    walked = [not (m.fell or m.stumbled) and m.ending == "completed" for m in measures]
    endings = tuple(_ending(m) for m in measures)
    scores = [Score("ending", endings, tuple(k for k, on in enumerate(walked) if on) if not all(walked) else ())]
    for label, name, form in _ROWS:
        values = [float(getattr(m, name)) for m in measures]
        if not any(np.isfinite(values)):
            continue
        texts = tuple(form.format(value).rstrip("%") if np.isfinite(value) else "–" for value in values)
        scores.append(Score(label, texts, _best(values, texts, walked)))
    ticks = [_tick(run) for run in runs]
    if any(np.isfinite(ticks)):
        texts = tuple(f"{tick:.0f}" if np.isfinite(tick) else "–" for tick in ticks)
        scores.append(Score("tick, µs median", texts, _best(ticks, texts, walked)))
    return scores


def _best(values: Sequence[float], texts: Sequence[str], walked: Sequence[bool]) -> tuple[int, ...]:
    """Runs with the smallest value, as it is printed; none where all are alike."""
    able = [k for k, on in enumerate(walked) if on and np.isfinite(values[k])]
    if not able or len(set(texts)) == 1:
        return ()
    least = texts[min(able, key=lambda k: values[k])]
    return tuple(k for k in able if texts[k] == least)


def _ending(measures: Measures) -> str:
    """How a run ended, and when if it was early."""
    if measures.ending == "completed":
        return "stumbled" if measures.stumbled else "walked to the end"
    return f"{measures.ending} at {measures.duration_s:.2f} s"


def _tick(run: Run) -> float:
    """Median time of a tick, µs; NaN where it was not logged."""
    times = tick_times(run)
    return float("nan") if times is None else float(np.median(times))
