"""Runs as a page shows them: names and colours, facts, the moment at which it opens, and measures
side by side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import InputError
from harpy_pin.log.measures import STUMBLE, Measures, measure
from harpy_pin.log.optional import tick_times
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import MAX_NUMBER
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.identity import name_of, robot_of
from harpy_pin.view.palette import RUNS
from harpy_pin.view.scene.frames import Frames, ground_of

MAX_RUNS = len(RUNS)
"""Runs that one page plays side by side."""
Runs: TypeAlias = Run | Sequence[Run | tuple[Run, Robot]]
"""A run, or several, each with its robot where the log does not lead to it."""
LOADED = 0.2
"""A foot is loaded above this share of the mean normal force of all feet."""
START = 0.5
"""A longer run has begun by then, s: before, the feet settle on the ground."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A run on a page."""

    name: str  # different from those of the other runs of the page
    colour: str  # #rrggbb
    frames: Frames  # its rows, and those that are drawn


def line_up(runs: Runs, *, fps: float = 30.0, names: Sequence[str] | None = None) -> list[Shown]:
    """Runs ready to be shown together.

    Args:
        runs: one to four.
        fps: frames per second of simulated time.
        names: of the runs; found in their logs by default.

    Raises:
        InputError: no run or too many, another number of names, or as :class:`Frames`.
    """
    given = [runs] if isinstance(runs, Run) else list(runs)
    if any(
        not isinstance(entry, Run | tuple) or (isinstance(entry, tuple) and len(entry) != 2)
        for entry in given
    ):
        raise InputError(
            "runs must be runs, or pairs of a run and its robot", name="runs", value=runs
        )
    if not 1 <= len(given) <= MAX_RUNS:
        raise InputError(f"a page shows 1 to {MAX_RUNS} runs, got {len(given)}", name="runs")
    pairs = [entry if isinstance(entry, tuple) else (entry, robot_of(entry)) for entry in given]
    names = _distinct([run for run, _ in pairs]) if names is None else names
    if len(names) != len(pairs):
        raise InputError(f"{len(pairs)} runs need as many names, got {len(names)}", name="names")
    frames = [Frames(run, robot, fps=fps) for run, robot in pairs]
    return [
        Shown(str(name), colour, one)
        for name, colour, one in zip(names, RUNS, frames, strict=False)
    ]


def _distinct(runs: Sequence[Run]) -> list[str]:
    """Names of runs; with their friction, then numbers, where they would be the same."""
    names = [name_of(run) for run in runs]
    if len(set(names)) < len(names):
        grounds = [ground_of(run) for run in runs]
        names = [
            n if g is None else f"{n}, μ = {g.mu_s:g}" for n, g in zip(names, grounds, strict=True)
        ]
    return [name if names.count(name) == 1 else f"{name} ({k + 1})" for k, name in enumerate(names)]


def headline(shown: Shown) -> tuple[str, list[tuple[str, str]]]:
    """Title and facts of a run, from its metadata and measures; what the log does not say is left
    out.
    """
    run, ground = shown.frames.run, shown.frames.ground
    parameters = run.metadata.get("parameters") or {}
    controller = str(run.metadata.get("controller", "unknown controller"))
    governor = parameters.get("governor")
    facts = [("controller", controller)]
    title = f"{run.metadata.get('robot', 'robot')} – {controller}"
    if governor is not None:
        facts.append(("governor", str(governor)))
        title += f" ({governor})" if governor != "none" else " (no governor)"
    if ground is not None:
        facts.append(
            ("friction", f"μ = {ground.mu_s:g} ({'box' if ground.cone == 'per_axis' else 'disc'})")
        )
        title += f", μ = {ground.mu_s:g}"
        facts += [
            (f"from {begin:g} to {end:g} m", f"μ = {mu:g}")
            for begin, end, mu in ground.friction_strips
        ]
    speed = (parameters.get("gait") or {}).get("speed")
    if isinstance(speed, int | float) and abs(speed) < MAX_NUMBER:
        facts.append(("speed desired", f"{speed:g} m/s"))
    distance, duration = float(run["q"][-1, 0] - run["q"][0, 0]), float(run["t"][-1] - run["t"][0])
    facts.append(("walked", f"{distance:.2f} m in {duration:.2f} s"))
    if len(run) > 1 and run["foot_force"].shape[1]:
        facts.append(("slip", f"{measure(run).slip_mm_per_step:.1f} mm per step"))
    facts.append(
        ("ending", run.ending if shown.frames.complete else f"{run.ending} (drawn up to there)")
    )
    if run.fell:
        facts.append(("why", measure(run).causes))
    return f"{title}, {run.ending}", facts


class Moment(NamedTuple):
    """A moment of a run."""

    time: float  # since the run began, s
    reason: str  # what happens, in a few words
    power: float  # that friction takes from the robot there, W; zero where no foot slides


def telling_moment(frames: Frames) -> Moment:
    """Where a loaded foot loses most to friction while it slides; else where one that holds uses
    most of its friction.

    A foot that slides fast under a small force, as at touchdown, tells less than one that slides
    under load: what counts is speed times tangential force. A body that has tilted as far as in a
    stumble is falling already; what happens after that does not count, nor does a slip in a single
    frame, a touchdown.
    """
    feet, time = [name.replace("_", " ") for name in frames.robot.feet], frames.time
    if not feet:
        return Moment(0.0, "the start: this robot has no feet", 0.0)
    contacts = frames.contacts[frames.rows]
    loaded = contacts.force[..., 2] > LOADED * float(contacts.normal.sum(axis=1).mean()) / len(feet)
    loaded &= _upright(frames["q"])[:, None]
    speed, tangential = (
        np.hypot(v[..., 0], v[..., 1]) for v in (contacts.velocity, contacts.force)
    )
    slides = np.pad(contacts.slides, ((1, 1), (0, 0)))
    lasting = slides[1:-1] & (slides[:-2] | slides[2:])
    row, foot, power = _largest(np.where(lasting & loaded, speed * tangential, 0.0))
    if power > 0.0:
        how = (
            f"slides at {1e3 * speed[row, foot]:.0f} mm/s under "
            f"{contacts.force[row, foot, 2]:.0f} N"
        )
        return Moment(float(time[row]), f"{feet[foot]} {how}", power)
    if contacts.mu is not None:
        settled = time >= (START if time[-1] > 4.0 * START else 0.0)
        used = np.where(
            loaded & ~contacts.slides & settled[:, None] & np.isfinite(contacts.used),
            contacts.used,
            0.0,
        )
        row, foot, share = _largest(used)
        if share > 0.0:
            return Moment(
                float(time[row]), f"{feet[foot]} uses {100.0 * share:.0f} % of its friction", 0.0
            )
    return Moment(float(time[_largest(tangential)[0]]), "largest tangential force", 0.0)


def _largest(values: Vector) -> tuple[int, int, float]:
    """Row and column of the largest value, and the value."""
    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    return int(row), int(column), float(values[row, column])


def _upright(q: Vector) -> NDArray[np.bool_]:
    """(n,) whether no row so far has a body that tilts by more than a stumble does."""
    tilt = np.arccos(np.clip(1.0 - 2.0 * (q[:, 3] ** 2 + q[:, 4] ** 2), -1.0, 1.0))
    return np.asarray(np.logical_and.accumulate(tilt <= STUMBLE))


@dataclass(frozen=True)
class Score:
    """One measure of all runs."""

    label: str  # with its unit
    values: tuple[str, ...]  # of each run, as text
    # numbers of the runs that are best at it; none where all are alike, or no run walked to its end
    best: tuple[int, ...]


ROWS = (
    ("slip, mm per step", "slip_mm_per_step", "{:.1f}"),
    ("contact time sliding, %", "sliding", "{:.1%}"),
    ("distance from the target, mm rms", "tracking_rms_mm", "{:.1f}"),
    ("thrust, N rms", "thrust_rms_n", "{:.1f}"),
    ("thrusters at 1 kW for 18 N, W", "thrust_power_w", "{:.0f}"),
    ("joints, W", "joint_power_w", "{:.0f}"),
    ("largest torque, N·m", "torque_max_nm", "{:.1f}"),
    ("largest tilt, rad", "tilt_max_rad", "{:.2f}"),
    ("joints less their targets, rad rms", "joint_tracking_rms_rad", "{:.3f}"),
    ("contact forces less those planned, % of the weight rms", "force_mismatch", "{:.1%}"),
    ("ticks with a torque at its limit, %", "clipped", "{:.1%}"),
)
"""Label, name in :class:`harpy_pin.log.measures.Measures`, and form of the numbers."""


def scoreboard(runs: Sequence[Run]) -> list[Score]:
    """Measures of runs of finite rows, at least two of each; a run that fell or stumbled is best at
    none.
    """
    measures = [measure(run) for run in runs]
    walked = [not (m.fell or m.stumbled) and m.ending == "completed" for m in measures]
    best = () if all(walked) else tuple(k for k, on in enumerate(walked) if on)
    scores = [Score("ending", tuple(_ending(m) for m in measures), best)]
    ticks = [tick_times(run) for run in runs]
    rows = [
        (label, [float(getattr(m, name)) for m in measures], form) for label, name, form in ROWS
    ]
    rows.append(
        ("tick, µs median", [np.nan if t is None else float(np.median(t)) for t in ticks], "{:.0f}")
    )
    for label, values, form in rows:
        if any(np.isfinite(values)):
            texts = tuple(
                form.format(value).rstrip("%") if np.isfinite(value) else "–" for value in values
            )
            scores.append(Score(label, texts, _best(values, texts, walked)))
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
