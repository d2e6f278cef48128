"""The charts of runs: what is plotted over time, in which words and colours, and how few points
show it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.log.optional import (
    control_period,
    given_thrust,
    given_torque,
    optional_signal,
    tick_times,
)
from harpy_pin.log.power import PRESETS
from harpy_pin.model.state import Vector
from harpy_pin.view.page.shown import Shown
from harpy_pin.view.palette import APPLIED, CONTACT, FEET, FRICTION, SLIDING, TARGET
from harpy_pin.view.scene.frames import Frames, about_normals, normal_floor

DARK = "#222222"
TAKERS = ("thrusters", "joints")
COMMANDS = (("forward", "m/s"), ("left", "m/s"), ("turning", "rad/s"))
MAX_COMMAND = 1e9
"""Largest applied velocity that scales an axis, m/s or rad/s."""
MAX_SPANS = 1500
"""Most spans of a page: two points each, more than a screen has columns."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart."""

    label: str  # in the chart's legend
    colour: str  # #rrggbb
    time: Vector  # (n,) since the run's first row, s
    values: Vector  # (n,); NaN where there is none
    dashed: bool = False  # whether it is drawn dashed
    filled: bool = False  # whether the area down to zero is filled


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines with one unit."""

    group: str  # heading under which it stands
    title: str  # what is plotted
    unit: str  # of the values
    lines: Sequence[Line] = ()  # of the chart; one without lines is not drawn
    # a value that is marked across the chart, and what it is
    level: tuple[float, str] | None = None
    low: float | None = None  # smallest value of the axis; from the lines where it is None
    high: float | None = None  # largest value of the axis; from the lines where it is None


def charts_of(shown: Sequence[Shown]) -> list[Chart]:
    """The charts of one run, or those that compare several; signals that were not logged have
    none.
    """
    if len(shown) == 1:
        charts = _Charts(shown[0].frames).all
    else:
        charts = [_compared(chart, values, shown) for chart, values in COMPARED]
    return [chart for chart in charts if chart.lines]


class _Charts:
    """The charts of one run."""

    def __init__(self, frames: Frames) -> None:
        self.frames, self.run, self.contacts = frames, frames.run, frames.contacts
        self.time = self.run["t"] - self.run["t"][0]
        self.feet = [name.replace("_", " ") for name in frames.robot.feet]
        self.demanded = self._demanded()

    @property
    def all(self) -> list[Chart]:
        """All charts, in the order of the page."""
        return [*self.of_feet(), *self.of_body(), *self.of_commands(), *self.of_effort()]

    def lines(self, names: Sequence[str], values: Vector) -> list[Line]:
        """A line for each foot (or thruster) from (n, feet) values."""
        return [self.line(n, FEET[k % len(FEET)], values[:, k]) for k, n in enumerate(names)]

    def line(self, label: str, colour: str, values: Vector, **style: bool) -> Line:
        return Line(label, colour, self.time, values, **style)

    def of_feet(self) -> Iterable[Chart]:
        """What friction allows and feet use of it, normal forces, and slip."""
        contacts, demanded, floor = self.contacts, self.demanded, normal_floor(self.run)
        normal = _where(contacts.touching, contacts.normal)
        tangential, bound = _where(contacts.touching, contacts.tangential), None
        if contacts.mu is not None:
            bound = contacts.mu * normal
            margin = self.lines(self.feet, _where(contacts.touching, contacts.margin))
            yield Chart(
                "Feet", "friction margin μ·f_z − |f_t|", "N", margin, level=(0.0, "none left")
            )
        for k, given in enumerate(self.lines(self.feet, tangential)):
            lines = (
                [] if bound is None else [self.line("μ·f_z", FRICTION, bound[:, k], filled=True)]
            )
            lines.append(replace(given, label="|f_t| given"))
            if demanded is not None:
                force = _where(demanded[:, k, 2] > 0.0, contacts.tangential_of(demanded[:, k]))
                lines.append(self.line("demanded", DARK, force, dashed=True))
            yield Chart("Feet", f"friction force, {given.label}", "N", lines, low=0.0)
        lines = []
        for k, given in enumerate(self.lines(self.feet, normal)):
            lines.append(given)
            if demanded is not None:
                force = _where(demanded[:, k, 2] > 0.0, demanded[:, k, 2])
                lines.append(self.line(f"{given.label} demanded", given.colour, force, dashed=True))
        level = None if floor is None else (floor, "floor of the controller")
        yield Chart("Feet", "normal force f_z", "N", lines, level=level, low=0.0)
        yield Chart("Feet", "slip so far", "mm", self.lines(self.feet, _slip(self.frames)), low=0.0)

    def of_body(self) -> Iterable[Chart]:
        """Body, target x_r and applied reference x_w along each axis; forward as the distance from
        the target.
        """
        body, references = 1e3 * self.run["q"][:, :3], self.frames.references
        places = [("body x", DARK, body, False)]
        for label, text, colour in (
            ("target", "target x_r", TARGET),
            ("applied", "applied x_w", APPLIED),
        ):
            if label in references:
                places.append((text, colour, 1e3 * references[label], label == "target"))
        if "estimate" in references:
            off = 1e3 * references["estimate"] - body
            lines = [
                self.line(axis, c, off[:, n])
                for n, (axis, c) in enumerate(zip("xyz", FEET, strict=False))
            ]
            yield Chart("Body", "estimate less the true place", "mm", lines)
        if "target" in references:
            target = 1e3 * references["target"][:, 0]
            away = [
                self.line(f"{n} − x_r", c, p[:, 0] - target)
                for n, c, p, dashed in places
                if not dashed
            ]
            yield Chart("Body", "forward, from the target", "mm", away, level=(0.0, "target"))
        for axis, title in ((1, "sideways"), (2, "height")):
            lines = [
                self.line(name, colour, place[:, axis], dashed=dashed)
                for name, colour, place, dashed in places
            ]
            yield Chart("Body", title, "mm", lines)

    def of_commands(self) -> Iterable[Chart]:
        """The command of a commanded gait, and the velocity that is applied of it."""
        command, applied = (self.run.signals.get(name) for name in ("command", "applied_velocity"))
        if command is None or applied is None or not all(map(_is_velocity, (command, applied))):
            return
        for axis, (title, unit) in enumerate(COMMANDS):
            given, size = applied[:, axis], np.abs(applied[:, axis])
            reach = 1.5 * float(
                np.max(size, initial=0.1, where=size < MAX_COMMAND)
            )  # what is beyond leaves the chart
            lines = [
                self.line("command", TARGET, command[:, axis], dashed=True),
                self.line("applied", APPLIED, given),
            ]
            yield Chart("Command", title, unit, lines, low=-reach, high=reach)

    def of_effort(self) -> Iterable[Chart]:
        """Thrusts, power and the time of a tick."""
        run = self.run
        thrusters = [name.replace("_", " ") for name in self.frames.robot.thrusters]
        yield Chart(
            "Effort",
            "thrust",
            "N",
            self.lines(thrusters, np.linalg.norm(run["thrust"], axis=2)),
            low=0.0,
        )
        yield Chart("Effort", "power", "W", self._power())
        times = tick_times(run)
        if times is not None:
            tick = [self.line("one tick of the controller", CONTACT, times)]
            yield Chart("Effort", "time of a tick", "µs", tick, low=0.0, high=_ordinary(tick))
        if (
            "infeasible" in run
            and run["infeasible"].ndim == 1
            and run["infeasible"].dtype.kind in "biuf"
        ):
            without = self.line(
                "constraints that no reference meets", SLIDING, run["infeasible"] * 1.0, filled=True
            )
            yield Chart(
                "Effort", "governor without a way out", "0 or 1", [without], low=0.0, high=1.2
            )

    def _power(self) -> list[Line]:
        """What a battery gives, and who takes it; without one what joints do, and what fans of 18 N
        from 1 kW take.
        """
        run, energy = self.run, optional_signal(self.run, "battery_energy")
        if energy is not None:
            if len(run) < 2:
                return []
            power = np.gradient(energy, control_period(run), axis=0)
            taken = np.stack((power[:, 3:5].sum(axis=1), power[:, 5:7].sum(axis=1)), axis=1)
            return [self.line("battery", DARK, power[:, 0]), *self.lines(TAKERS, taken)]
        torque, thrust = given_torque(run), given_thrust(run)
        joints = (torque * run["v"][:, run["v"].shape[1] - torque.shape[1] :]).sum(axis=1)
        lines = [self.line("joints", FEET[1], joints)]
        if thrust.shape[1]:
            fans = PRESETS["fan"].electrical(np.linalg.norm(thrust, axis=2)).sum(axis=1)
            lines.insert(0, self.line("thrusters at 1 kW for 18 N", FEET[0], fans))
        return lines

    def _demanded(self) -> Vector | None:
        """(n, feet, 3) force that the controller desired, about the normals, N; None where it was
        not logged.
        """
        force = next(
            (self.run[name] for name in ("desired_force", "demanded_force") if name in self.run),
            None,
        )
        if force is None or force.shape != self.contacts.force.shape or force.dtype.kind != "f":
            return None
        return about_normals(self.frames.surface, self.contacts.position, force)


def _is_velocity(signal: Vector) -> bool:
    """Whether a signal has forward, sideways and turning velocity in its first columns."""
    return signal.dtype.kind == "f" and signal.ndim == 2 and signal.shape[1] >= len(COMMANDS)


def _compared(
    chart: Chart, values_of: Callable[[Frames], Vector | None], shown: Sequence[Shown]
) -> Chart:
    """A chart with one line for each run."""
    lines = []
    for one in shown:
        values, time = values_of(one.frames), one.frames.run["t"]
        if values is not None:
            lines.append(Line(one.name, one.colour, time - time[0], values))
    return replace(chart, lines=lines, high=_ordinary(lines) if chart.unit == "µs" else chart.high)


def _slip(frames: Frames) -> Vector:
    """(n, feet) path of each foot along the ground while it touches it, mm."""
    logged = optional_signal(frames.run, "slip_path")
    if logged is not None:
        return np.asarray(1e3 * (logged - logged[0]), dtype=np.float64)
    touching = frames.contacts.touching
    steps = np.linalg.norm(np.diff(frames.contacts.position[..., :2], axis=0), axis=2)
    path = np.cumsum(steps * (touching[1:] | touching[:-1]), axis=0)
    return np.asarray(1e3 * np.vstack((np.zeros((1, touching.shape[1])), path)))


def _worst_used(frames: Frames) -> Vector | None:
    """(n,) share of its friction that the foot uses which uses most, %."""
    if frames.contacts.mu is None or not frames.robot.feet:
        return None
    return _where(frames.contacts.touching.any(axis=1), 100.0 * frames.contacts.used.max(axis=1))


def _distance(frames: Frames) -> Vector | None:
    """(n,) distance of the body from its target, mm."""
    target = frames.references.get("target")
    return None if target is None else 1e3 * np.linalg.norm(frames.run["q"][:, :3] - target, axis=1)


def _thrust(frames: Frames) -> Vector | None:
    """(n,) sum of all thrusts, N."""
    thrust = frames.run["thrust"]
    return np.linalg.norm(thrust, axis=2).sum(axis=1) if thrust.shape[1] else None


COMPARED: tuple[tuple[Chart, Callable[[Frames], Vector | None]], ...] = (
    (
        Chart("Feet", "slip so far, all feet", "mm", low=0.0),
        lambda frames: _slip(frames).sum(axis=1),
    ),
    (
        Chart(
            "Feet",
            "friction used, worst foot",
            "%",
            level=(100.0, "all of it"),
            low=0.0,
            high=130.0,
        ),
        _worst_used,
    ),
    (
        Chart("Feet", "normal force, all feet", "N", low=0.0),
        lambda frames: frames.contacts.normal.sum(axis=1),
    ),
    (Chart("Body", "distance from the target", "mm", low=0.0), _distance),
    (Chart("Effort", "thrust, all thrusters", "N", low=0.0), _thrust),
    (Chart("Effort", "time of a tick", "µs", low=0.0), lambda frames: tick_times(frames.run)),
)
"""Charts of several runs, and their line of each run."""


def _ordinary(lines: Sequence[Line]) -> float | None:
    """An axis on which the first tick, which loads what is compiled, does not flatten all
    others.
    """
    finite = [line.values[np.isfinite(line.values)] for line in lines if len(line.values) > 1]
    values = [np.quantile(part, 0.995) for part in finite if len(part)]
    return float(1.5 * max(values)) if values else None


def _where(known: ArrayLike, values: Vector) -> Vector:
    """Values, and NaN where they are not known."""
    return np.where(np.asarray(known), values, np.nan)


@dataclass(frozen=True)
class Clock:
    """Equal spans of time from 0 on."""

    width: float  # of a span, s
    count: int  # of spans
    period: float  # between two rows, of the run with the longest one, s

    @classmethod
    def of(cls, times: Sequence[Vector], *, most: int = MAX_SPANS) -> Clock:
        """The clock of runs, from the times of their rows, s, with so many spans at most."""
        period = max((float(t[-1]) / (len(t) - 1) for t in times if len(t) > 1), default=1.0)
        rows = round(max(float(t[-1]) for t in times) / period) + 1
        share = -(-rows // most)
        return cls(width=share * period, count=-(-rows // share), period=period)

    @property
    def points(self) -> Vector:
        """(2 count,) times of the points of thinned signals, s."""
        begin = self.width * np.arange(self.count)
        return np.stack((begin, begin + 0.5 * self.width), axis=1).ravel()

    def thin(self, time: Vector, signal: Vector) -> Vector:
        """(2 count,) smallest and largest value of each span, as they come; NaN where it has
        none.
        """
        span = np.minimum(((time + 0.5 * self.period) / self.width).astype(np.intp), self.count - 1)
        known = np.isfinite(signal)
        rows, span, signal = np.flatnonzero(known), span[known], signal[known]
        result = np.full((self.count, 2), np.nan)
        if len(rows) == 0:
            return result.ravel()
        # Sorted by value within each span: its first and its last row are the extremes.
        order = np.lexsort((signal, span))
        first = np.flatnonzero(np.diff(span[order], prepend=-1))
        last = np.append(first[1:], len(order)) - 1
        low, high = order[first], order[last]
        early, late = np.minimum(low, high), np.maximum(low, high)
        result[span[early], 0], result[span[early], 1] = signal[early], signal[late]
        return result.ravel()
