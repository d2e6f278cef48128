"""The paper's figures, in its layout, from this reproduction's runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector
from harpy_pin.view.figures import grid, legend_above, styled
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, TARGET
from reproduction.chattering import Chattering
from reproduction.vlip_claims import polar_of
from reproduction.vlip_simulation import VlipRun
from reproduction.walk_claims import model_force, model_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ACTUAL = "#222222"
LIMIT: dict[str, Any] = {"color": "#444444", "linewidth": 0.9}
"""Line of a constraint's limit."""


@styled
def vlip_states(run: VlipRun) -> Figure:
    """Angle, heading and length: target, applied and actual."""
    figure, axes = grid(3, 1, width=6.0, height=5.0)
    target, applied, actual = (polar_of(p) for p in (run.x_r[:, :3], run.x_w[:, :3], run.position))
    labels = (("θ (deg)", np.rad2deg(1.0)), ("φ (deg)", np.rad2deg(1.0)), ("l (m)", 1.0))
    for i, (label, scale) in enumerate(labels):
        panel = axes[i][0]
        _references(panel, run.t, scale * target[:, i], scale * applied[:, i])
        panel.plot(run.t, scale * actual[:, i], color=ACTUAL, linewidth=0.9, label="model")
        panel.set_ylabel(label)
    return _over_time(figure, axes)


@styled
def vlip_forces(run: VlipRun) -> Figure:
    """Contact force with the applied reference, with its friction band; that of the target at the
    same states.
    """
    figure, axes = grid(3, 1, width=6.0, height=5.2)
    mu = run.parameters.mu
    normal = run.force[:, 2]
    for i, axis in enumerate("xyz"):
        panel = axes[i][0]
        if i < 2:
            panel.fill_between(
                run.t,
                -mu * normal,
                mu * normal,
                color=FRICTION,
                alpha=0.35,
                linewidth=0.0,
                label="±μ u$_{gz}$",
            )
        else:
            panel.axhline(run.parameters.min_normal_force, linestyle="--", label="20 N", **LIMIT)
        panel.plot(
            run.t,
            run.target_force[:, i],
            color=TARGET,
            linestyle="--",
            label="with target reference",
        )
        panel.plot(run.t, run.force[:, i], color=APPLIED, label="with applied reference")
        panel.set_ylabel(f"u$_{{g{axis}}}$ (N)")
    return _over_time(figure, axes)


@styled
def vlip_constraints(run: VlipRun, ungoverned: VlipRun) -> Figure:
    """The four constraints: of the governed run, and of the run whose reference is the target
    itself.
    """
    figure, axes = grid(4, 1, width=6.0, height=6.4)
    names = (
        "μ u$_{gz}$ − |u$_{gx}$| (N)",
        "μ u$_{gz}$ − |u$_{gy}$| (N)",
        "u$_{gz}$ − 20 N (N)",
        "θ − 5° (deg)",
    )
    least = run.parameters.min_angle

    def rows(of: VlipRun) -> Vector:
        angle = np.rad2deg(polar_of(of.x_w[:, :3])[:, :1] - least)
        return np.concatenate((of.margins(of.force), angle), axis=1)

    target, applied = rows(ungoverned), rows(run)
    for i, name in enumerate(names):
        panel = axes[i][0]
        panel.axhline(0.0, **LIMIT)
        panel.plot(
            ungoverned.t, target[:, i], color=TARGET, linestyle="--", label="target reference"
        )
        panel.plot(run.t, applied[:, i], color=APPLIED, label="applied reference")
        panel.set_ylabel(name)
    return _over_time(figure, axes)


@styled
def walk_states(run: Run) -> Figure:
    """Body position: target, applied and actual; x is shown relative to the target's steady
    advance.
    """
    figure, axes = grid(3, 1, width=6.0, height=5.0)
    t, target, applied, actual = run["t"], run["x_r"], run["x_w"], run["q"]
    for i, axis in enumerate("xyz"):
        panel = axes[i][0]
        base = target[:, 0] if i == 0 else np.zeros(len(t))
        _references(panel, t, 1e3 * (target[:, i] - base), 1e3 * (applied[:, i] - base))
        panel.plot(t, 1e3 * (actual[:, i] - base), color=ACTUAL, linewidth=0.9, label="body")
        panel.set_ylabel("x − x$_r$ (mm)" if i == 0 else f"{axis} (mm)")
    return _over_time(figure, axes)


@styled
def walk_forces(run: Run, *, mu: float) -> Figure:
    """The simulated ground's total force, the model's estimate of it, and the band ±μ u_gz of
    each.
    """
    figure, axes = grid(3, 1, width=6.0, height=5.2)
    t, simulated, expected = run["t"], run["foot_force"].sum(axis=1), model_force(run)
    for i, axis in enumerate("xyz"):
        panel = axes[i][0]
        if i < 2:
            _band(panel, t, mu * simulated[:, 2], CONTACT, "±μ u$_{gz}$, simulated")
            for sign in (1.0, -1.0):
                panel.plot(
                    t, sign * mu * expected[:, 2], color=APPLIED, linestyle=":", linewidth=0.8
                )
        else:
            panel.axhline(20.0, linestyle="--", **LIMIT)
        panel.plot(t, simulated[:, i], color=CONTACT, linewidth=0.9, label="simulated, both feet")
        panel.plot(t, expected[:, i], color=APPLIED, label="model's estimate (dotted: its band)")
        panel.set_ylabel(f"u$_{{g{axis}}}$ (N)")
    return _over_time(figure, axes)


@styled
def walk_constraints(run: Run, *, mu: float) -> Figure:
    """The model's constraints at the target (h_r) and at the applied reference (h_w)."""
    figure, axes = grid(3, 1, width=6.0, height=5.2)
    target, applied = (
        model_rows(run, mu=mu, reference="x_r"),
        model_rows(run, mu=mu, reference="x_w"),
    )
    names = ("μ u$_{gz}$ − |u$_{gx}$| (N)", "μ u$_{gz}$ − |u$_{gy}$| (N)", "u$_{gz}$ − 20 N (N)")
    columns = (slice(0, 2), slice(2, 4), slice(4, 5))
    for i, (name, column) in enumerate(zip(names, columns, strict=True)):
        panel = axes[i][0]
        panel.axhline(0.0, **LIMIT)
        panel.plot(
            run["t"],
            target[:, column].min(axis=1),
            color=TARGET,
            linestyle="--",
            label="target, h$_r$",
        )
        panel.plot(run["t"], applied[:, column].min(axis=1), color=APPLIED, label="applied, h$_w$")
        panel.set_ylabel(name)
    return _over_time(figure, axes)


@styled
def chattering_figure(series: dict[str, dict[int, Chattering]]) -> Figure:
    """Reversals per second of applied references against the divisor of the step: level is smooth,
    rising chatters.

    Args:
        series: for each case, the chattering of its applied reference by divisor.
    """
    figure, axes = grid(1, 1, width=5.0, height=3.4)
    panel = axes[0][0]
    for name, by_divisor in series.items():
        divisors = sorted(by_divisor)
        rates = [max(by_divisor[d].reversals_per_s, 0.1) for d in divisors]
        panel.plot(divisors, rates, marker="o", markersize=3.5, label=name)
    panel.set_xscale("log", base=2)
    panel.set_yscale("log")
    panel.set_xticks(divisors, [f"dt/{d}" if d > 1 else "dt" for d in divisors])
    panel.set_ylabel("reversals of x$_w$ (1/s)")
    panel.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _references(panel: Axes, t: Vector, target: Vector, applied: Vector) -> None:
    panel.plot(t, target, color=TARGET, linestyle="--", label="target x$_r$")
    panel.plot(t, applied, color=APPLIED, label="applied x$_w$")


def _band(panel: Axes, t: Vector, half_width: Vector, colour: str, label: str) -> None:
    panel.fill_between(
        t, -half_width, half_width, color=colour, alpha=0.15, linewidth=0.0, label=label
    )


def _over_time(figure: Figure, axes: Any) -> Figure:
    axes[-1][0].set_xlabel("time (s)")
    legend_above(axes[0][0])
    return figure
