"""The charts of a page: what is plotted over time, and in which words and colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.log.optional import control_period, given_thrust, optional_signal, tick_times
from harpy_pin.log.power import PRESETS
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector
from harpy_pin.view.page.shown import Shown
from harpy_pin.view.palette import APPLIED, CONTACT, FEET, FRICTION, SLIDING, TARGET
from harpy_pin.view.scene.forces import friction_used, tangential_force
from harpy_pin.view.scene.frames import is_per_axis, local_friction, normal_floor, signal_points
from harpy_pin.view.scene.ground import about_normals, surface_of

__all__ = ["Chart", "Clock", "Line", "charts_of", "compare_charts", "encode"]

DEMANDED = "#222222"
BODY_LINE = "#222222"
TAKERS = ("thrusters", "joints")
_DIGITS = 4
MAX_SPANS = 1500
"""Of one page: two points each, more than a screen has columns."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart.

    Attributes:
        label: in the chart's legend.
        colour: ``#rrggbb``.
        time: (n,) since the run's first row, s.
        values: (n,); NaN where there is none.
        dashed: whether it is drawn dashed.
        filled: whether the area down to zero is filled.
    """

    label: str
    colour: str
    time: Vector
    values: Vector
    dashed: bool = False
    filled: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines with one unit.

    Attributes:
        group: heading under which it stands.
        title: what is plotted.
        unit: of the values.
        lines: at least one.
        level: a value that is marked across the chart, and what it is.
        low: smallest value of the axis; from the lines where it is None.
        high: largest value of the axis; from the lines where it is None.
    """

    group: str
    title: str
    unit: str
    lines: Sequence[Line]
    level: tuple[float, str] | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, eq=False)
class _Feet:
    """Forces on the feet, ready to be plotted.

    Attributes:
        time: (n,) since the first row, s.
        names: of the feet, in words.
        touching: (n, feet).
        normal: (n, feet) N; NaN without contact.
        tangential: (n, feet) length, or the larger of x and y on a per-axis ground, N; NaN without contact.
        mu: (n, feet) friction coefficient; None where it was not logged.
        bound: (n, feet) μ times the normal force, N; None where μ was not logged.
        demanded: (n, feet, 3) force that the controller desired, N; None where it was not logged.
        per_axis: of the ground's friction.
    """

    time: Vector
    names: list[str]
    touching: NDArray[np.bool_]
    normal: Vector
    tangential: Vector
    mu: Vector | None
    bound: Vector | None
    demanded: Vector | None
    force: Vector
    per_axis: bool

    @classmethod
    def of(cls, shown: Shown) -> _Feet:
        run = shown.run
        surface, place = surface_of(run), run["foot_position"]
        force = about_normals(surface, place, run["foot_force"])
        touching = force[..., 2] > 0.0
        per_axis = is_per_axis(run)
        mu = local_friction(run, run["foot_position"], time=run["t"] - run["t"][0])
        demanded = next((run[n] for n in ("desired_force", "demanded_force") if n in run), None)
        if demanded is not None and (demanded.shape != force.shape or demanded.dtype.kind != "f"):
            demanded = None
        if demanded is not None:
            demanded = about_normals(surface, place, demanded)
        return cls(
            time=run["t"] - run["t"][0],
            names=[name.replace("_", " ") for name in shown.robot.feet],
            touching=touching,
            normal=np.where(touching, force[..., 2], np.nan),
            tangential=np.where(touching, tangential_force(force, per_axis=per_axis), np.nan),
            mu=mu,
            bound=None if mu is None else np.where(touching, mu * force[..., 2], np.nan),
            demanded=demanded,
            force=force,
            per_axis=per_axis,
        )


def charts_of(shown: Shown) -> list[Chart]:
    """The charts of one run; signals that were not logged have none."""
    feet = _Feet.of(shown)
    colours = [FEET[k % len(FEET)] for k in range(len(feet.names))]
    charts = []
    if feet.bound is not None:
        margin = feet.bound - feet.tangential
        lines = _per_foot(feet, colours, margin)
        charts.append(Chart("Feet", "friction margin μ·f_z − |f_t|", "N", lines, level=(0.0, "slides below")))
    charts += _friction_charts(feet, colours)
    charts.append(_normal_chart(shown, feet, colours))
    slip = _slip(shown)
    lines = _per_foot(feet, colours, slip)
    charts.append(Chart("Feet", "slip so far", "mm", lines, low=0.0))
    charts += _body_charts(shown, feet.time)
    charts += _effort_charts(shown, feet.time)
    return charts


def compare_charts(shown: Sequence[Shown]) -> list[Chart]:
    """The charts of several runs: one line for each run, of the foot that is worst off."""
    used, slip, normal, away, thrust, tick = [], [], [], [], [], []
    for one in shown:
        feet, run = _Feet.of(one), one.run
        name, colour, time = one.name, one.colour, feet.time
        if feet.mu is not None:
            share = friction_used(feet.force, feet.mu, per_axis=feet.per_axis).max(axis=1)
            used.append(Line(name, colour, time, np.where(feet.touching.any(axis=1), 100.0 * share, np.nan)))
        slip.append(Line(name, colour, time, _slip(one).sum(axis=1)))
        normal.append(Line(name, colour, time, np.nansum(feet.normal, axis=1)))
        target = signal_points(run, "x_r")
        if target is not None:
            away.append(Line(name, colour, time, 1e3 * np.linalg.norm(run["q"][:, :3] - target, axis=1)))
        if run["thrust"].shape[1]:
            thrust.append(Line(name, colour, time, np.linalg.norm(run["thrust"], axis=2).sum(axis=1)))
        times = tick_times(run)
        if times is not None:
            tick.append(Line(name, colour, time, times))
    charts = [
        Chart("Feet", "slip so far, all feet", "mm", slip, low=0.0),
        Chart("Feet", "friction used, worst foot", "%", used, level=(100.0, "all of it"), low=0.0, high=130.0),
        Chart("Feet", "normal force, all feet", "N", normal, low=0.0),
        Chart("Body", "distance from the target", "mm", away, low=0.0),
        Chart("Effort", "thrust, all thrusters", "N", thrust, low=0.0),
        Chart("Effort", "time of a tick", "µs", tick, low=0.0, high=_ordinary(tick)),
    ]
    return [chart for chart in charts if chart.lines]


def encode(charts: Sequence[Chart], shown: Sequence[Shown]) -> dict[str, Any]:
    """Charts as the page reads them: one row of times for all lines, extremes over equal spans, null for no value."""
    clock = Clock.of([one.run["t"] - one.run["t"][0] for one in shown])
    return {
        "time": np.round(clock.points, 6).tolist(),
        "charts": [
            {
                **{name: getattr(chart, name) for name in ("group", "title", "unit", "low", "high")},
                "level": None if chart.level is None else {"value": chart.level[0], "label": chart.level[1]},
                "lines": [
                    {name: getattr(line, name) for name in ("label", "colour", "dashed", "filled")}
                    | {"values": _short(clock.thin(line.time, line.values))}
                    for line in chart.lines
                ],
            }
            for chart in charts
        ],
    }


def _friction_charts(feet: _Feet, colours: Sequence[str]) -> list[Chart]:
    """For each foot the tangential force against what the friction allows, given and demanded."""
    charts = []
    for k, (name, colour) in enumerate(zip(feet.names, colours, strict=True)):
        lines = []
        if feet.bound is not None:
            lines.append(_line(feet, "μ·f_z", FRICTION, feet.bound[:, k], filled=True))
        lines.append(_line(feet, "|f_t| given", colour, feet.tangential[:, k]))
        if feet.demanded is not None:
            desired = tangential_force(feet.demanded[:, k], per_axis=feet.per_axis)
            desired = np.where(feet.demanded[:, k, 2] > 0.0, desired, np.nan)
            lines.append(_line(feet, "demanded", DEMANDED, desired, dashed=True))
        charts.append(Chart("Feet", f"friction force, {name}", "N", lines, low=0.0))
    return charts


def _normal_chart(shown: Shown, feet: _Feet, colours: Sequence[str]) -> Chart:
    """Normal forces, given and demanded, with the floor that the controller keeps."""
    lines = []
    for k, (name, colour) in enumerate(zip(feet.names, colours, strict=True)):
        lines.append(_line(feet, name, colour, feet.normal[:, k]))
        if feet.demanded is not None:
            desired = feet.demanded[:, k, 2]
            label = f"{name} demanded"
            lines.append(_line(feet, label, colour, np.where(desired > 0.0, desired, np.nan), dashed=True))
    floor = normal_floor(shown.run)
    level = None if floor is None else (floor, "floor of the controller")
    return Chart("Feet", "normal force f_z", "N", lines, level=level, low=0.0)


def _body_charts(shown: Shown, time: Vector) -> list[Chart]:
    """Body, target x_r and applied reference x_w along each axis; forward as the distance from the target."""
    run = shown.run
    body, target, applied = run["q"][:, :3], signal_points(run, "x_r"), signal_points(run, "x_w")
    charts = []
    if target is not None:
        lines = [Line("body x − x_r", BODY_LINE, time, 1e3 * (body - target)[:, 0])]
        if applied is not None:
            lines.append(Line("applied x_w − x_r", APPLIED, time, 1e3 * (applied - target)[:, 0]))
        charts.append(Chart("Body", "forward, from the target", "mm", lines, level=(0.0, "target")))
    for axis, title in ((1, "sideways"), (2, "height")):
        lines = [Line("body x", BODY_LINE, time, 1e3 * body[:, axis])]
        if target is not None:
            lines.append(Line("target x_r", TARGET, time, 1e3 * target[:, axis], dashed=True))
        if applied is not None:
            lines.append(Line("applied x_w", APPLIED, time, 1e3 * applied[:, axis]))
        charts.append(Chart("Body", title, "mm", lines))
    return charts


def _effort_charts(shown: Shown, time: Vector) -> list[Chart]:
    """Thrusts and the time of a tick."""
    run, charts = shown.run, []
    if run["thrust"].shape[1]:
        size = np.linalg.norm(run["thrust"], axis=2)
        names = [name.replace("_", " ") for name in shown.robot.thrusters]
        lines = [Line(name, FEET[k % len(FEET)], time, size[:, k]) for k, name in enumerate(names)]
        charts.append(Chart("Effort", "thrust", "N", lines, low=0.0))
    energy = optional_signal(run, "battery_energy")
    if energy is not None and len(run) > 1:
        charts.append(_power_chart(energy, time, control_period(run)))
    elif energy is None:
        charts.append(_assumed_power_chart(run, time))
    times = tick_times(run)
    if times is not None:
        tick = Line("one tick of the controller", CONTACT, time, times)
        charts.append(Chart("Effort", "time of a tick", "µs", [tick], low=0.0, high=_ordinary([tick])))
    if "infeasible" in run and run["infeasible"].ndim == 1 and run["infeasible"].dtype.kind in "biuf":
        line = Line("constraints that no reference meets", SLIDING, time, run["infeasible"].astype(float), filled=True)
        charts.append(Chart("Effort", "governor without a way out", "0 or 1", [line], low=0.0, high=1.2))
    return charts


def _power_chart(energy: Vector, time: Vector, period: float) -> Chart:
    """What the battery gives, and who takes it."""
    power = np.gradient(energy, period, axis=0)
    given, taken = power[:, 0], (power[:, 3:5].sum(axis=1), power[:, 5:7].sum(axis=1))
    lines = [Line("battery", BODY_LINE, time, given)]
    lines += [Line(name, FEET[k], time, values) for k, (name, values) in enumerate(zip(TAKERS, taken, strict=True))]
    return Chart("Effort", "power", "W", lines)


def _assumed_power_chart(run: Run, time: Vector) -> Chart:
    """Without a battery: what the joints do, and what thrusters take if each is a fan of 18 N from 1 kW."""
    torque, thrust = run["torque"], given_thrust(run)
    joints = (torque * run["v"][:, run["v"].shape[1] - torque.shape[1] :]).sum(axis=1)
    lines = [Line("joints", FEET[1], time, joints)]
    if thrust.shape[1]:
        fans = PRESETS["fan"].electrical(np.linalg.norm(thrust, axis=2)).sum(axis=1)
        lines.insert(0, Line("thrusters at 1 kW for 18 N", FEET[0], time, fans))
    return Chart("Effort", "power", "W", lines)


def _slip(shown: Shown) -> Vector:
    """(n, feet) path of each foot along the ground while it touches it, mm."""
    run = shown.run
    logged = optional_signal(run, "slip_path")
    if logged is not None:
        return np.asarray(1e3 * (logged - logged[0]), dtype=np.float64)
    touching = run["foot_force"][..., 2] > 0.0
    steps = np.linalg.norm(np.diff(run["foot_position"][..., :2], axis=0), axis=2) * (touching[1:] | touching[:-1])
    return np.asarray(1e3 * np.vstack((np.zeros((1, touching.shape[1])), np.cumsum(steps, axis=0))))


def _ordinary(lines: Sequence[Line]) -> float | None:
    """An axis on which the first tick, which loads what is compiled, does not flatten all others."""
    finite = [line.values[np.isfinite(line.values)] for line in lines if len(line.values) > 1]
    values = [np.quantile(part, 0.995) for part in finite if len(part)]
    return float(1.5 * max(values)) if values else None


def _per_foot(feet: _Feet, colours: Sequence[str], values: Vector) -> list[Line]:
    """A line for each foot from (n, feet) values."""
    named = zip(feet.names, colours, values.T, strict=True)
    return [_line(feet, name, colour, column) for name, colour, column in named]


def _line(feet: _Feet, label: str, colour: str, values: Vector, **style: bool) -> Line:
    return Line(label, colour, feet.time, values, **style)


def _short(values: Vector) -> list[float | None]:
    """Numbers with few digits; null where there is none."""
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()]


@dataclass(frozen=True)
class Clock:
    """Equal spans of time from 0 on.

    Attributes:
        width: of a span, s.
        count: of spans.
        period: the longest time between two rows of any run, s: no span misses a row of it.
    """

    width: float
    count: int
    period: float

    @classmethod
    def of(cls, times: Sequence[Vector], *, most: int = MAX_SPANS) -> Clock:
        """The clock of runs, from the evenly spaced times of their rows, s, with so many spans at most."""
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
        """(2 count,) smallest and largest value of each span, as they come; NaN where it has none."""
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
