"""Figures of a run: contact forces against their friction bounds, references, thrusts, commands.

They are plain ``matplotlib.figure.Figure`` objects, tied to no window: save them with ``figure.savefig("forces.pdf")``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.log.measures import MIN_NORMAL_FORCE
from harpy_pin.log.optional import optional_signal
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector
from harpy_pin.view.figures.style import grid, legend_above, styled
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, RIGHT, TARGET, THRUST
from harpy_pin.view.scene.frames import finite_part, local_friction, signal_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["command_figure", "forces_figure", "reference_figure", "thrust_figure"]

_AXES = ("x", "y", "z")
LARGEST = 1e9
"""Of an applied velocity that scales a panel, m/s or rad/s; what is beyond leaves the picture."""


@styled
@checked
def forces_figure(run: Run, *, min_normal_force: float = MIN_NORMAL_FORCE) -> Figure:
    """Normal force of each foot with its lower bound, and both tangential forces inside the band ±μ u_gz.

    Args:
        run: the log.
        min_normal_force: where to draw the bound, N.

    Raises:
        InputError: the run holds nothing to draw, or the robot has no feet.
    """
    run = _drawable(run)
    if run["foot_force"].shape[1] == 0:
        raise InputError("the robot of this run has no feet", name="run")
    t, force = run["t"], run["foot_force"]
    mu = local_friction(run, run["foot_position"], time=run["t"] - run["t"][0])
    names = _names(run, "feet", force.shape[1])
    figure, axes = grid(2, len(names), width=3.6 * len(names), height=4.4, sharey="row")
    for k, name in enumerate(names):
        upper, lower = axes[0][k], axes[1][k]
        normal = force[:, k, 2]
        upper.plot(t, normal, color=CONTACT, label="normal force u$_{gz}$")
        upper.axhline(min_normal_force, color="#444444", linestyle="--", linewidth=0.9, label=f"{min_normal_force:g} N")
        upper.set_title(name, loc="right")
        if mu is not None:
            limit, values = mu[:, k] * normal, ", ".join(f"{value:g}" for value in np.unique(mu))
            band = f"±μ u$_{{gz}}$, μ = {values}"
            lower.fill_between(t, -limit, limit, color=FRICTION, alpha=0.35, linewidth=0.0, label=band)
        lower.plot(t, force[:, k, 0], color=RIGHT, label="u$_{gx}$")
        lower.plot(t, force[:, k, 1], color=TARGET, label="u$_{gy}$")
        lower.set_xlabel("time (s)")
    axes[0][0].set_ylabel("normal force (N)")
    axes[1][0].set_ylabel("tangential force (N)")
    for row in axes:
        legend_above(row[0])
    return figure


@styled
@checked
def reference_figure(run: Run) -> Figure:
    """Target x_r, applied reference x_w and the body itself, per axis; beside it their distance from the target.

    References that were not logged are left out; without a target the second column is.

    Args:
        run: the log.

    Raises:
        InputError: the run holds nothing to draw.
    """
    run = _drawable(run)
    t = run["t"]
    target, applied = signal_points(run, "x_r"), signal_points(run, "x_w")
    lines: list[tuple[Vector, str, str, str]] = []
    if target is not None:
        lines.append((target, TARGET, "target x$_r$", "--"))
    if applied is not None:
        lines.append((applied, APPLIED, "applied x$_w$", "-"))
    lines.append((run["q"][:, :3], "#222222", "body", "-"))
    columns = 2 if target is not None else 1
    figure, axes = grid(3, columns, width=3.8 * columns, height=5.2)
    for i, axis in enumerate(_AXES):
        for values, colour, label, dashes in lines:
            axes[i][0].plot(t, values[:, i], color=colour, label=label, linestyle=dashes)
            if target is not None and values is not target:
                axes[i][1].plot(t, 1e3 * (values[:, i] - target[:, i]), color=colour, label=label)
        axes[i][0].set_ylabel(f"{axis} (m)")
        if target is not None:
            axes[i][1].set_ylabel(f"{axis} − target (mm)")
    for column in range(columns):
        axes[-1][column].set_xlabel("time (s)")
    legend_above(axes[0][0])
    return figure


@styled
@checked
def thrust_figure(run: Run) -> Figure:
    """Components (world axes) and magnitude of each thruster's force on the robot.

    Args:
        run: the log.

    Raises:
        InputError: the run holds nothing to draw, or the robot has no thrusters.
    """
    run = _drawable(run)
    t, thrust = run["t"], run["thrust"]
    if thrust.shape[1] == 0:
        raise InputError("the robot of this run has no thrusters", name="run")
    names = _names(run, "thrusters", thrust.shape[1])
    figure, axes = grid(1, len(names), width=3.6 * len(names), height=2.7, sharey="row")
    for k, name in enumerate(names):
        panel = axes[0][k]
        panel.plot(t, np.linalg.norm(thrust[:, k], axis=1), color="#222222", linewidth=1.4, label="magnitude")
        for i, (axis, colour) in enumerate(zip(_AXES, (CONTACT, TARGET, THRUST), strict=True)):
            panel.plot(t, thrust[:, k, i], color=colour, label=axis)
        panel.set_title(name, loc="right")
        panel.set_xlabel("time (s)")
    axes[0][0].set_ylabel("thrust (N)")
    legend_above(axes[0][0])
    return figure


@styled
@checked
def command_figure(run: Run) -> Figure:
    """The command of a commanded gait and the velocity that is applied of it; below, what the governor holds back.

    Args:
        run: the log of a walk with the gait ``commanded``.

    Raises:
        InputError: the run holds nothing to draw, or no command.
    """
    run = _drawable(run)
    command, velocity = optional_signal(run, "command"), optional_signal(run, "applied_velocity")
    if command is None or velocity is None:
        raise InputError("the run holds no command: its gait was not a commanded one", name="run")
    t = run["t"]
    figure, axes = grid(3, 1, width=6.4, height=4.8)
    for i, name in enumerate(("forward (m/s)", "left (m/s)", "turning (rad/s)")):
        panel, applied = axes[i][0], velocity[:, i]
        panel.plot(t, command[:, i], color=TARGET, linestyle="--", label="command")
        panel.plot(t, applied, color=APPLIED, label="applied")
        size = np.abs(applied)
        reach = 1.5 * float(np.max(size, initial=0.1, where=size < LARGEST))
        panel.set_ylim(-reach, reach)  # a command beyond all limits leaves the picture
        panel.set_ylabel(name)
    axes[-1][0].set_xlabel("time (s)")
    legend_above(axes[0][0])
    return figure


def _drawable(run: Run) -> Run:
    """The finite rows of a run."""
    if not run.signals or len(run) == 0:
        raise InputError(f"the run holds no tick (it ended: {shown(run.ending, 200)})", name="run")
    return finite_part(run)


def _names(run: Run, kind: str, count: int) -> list[str]:
    """Names of feet or thrusters, in words."""
    names = run.metadata.get(kind)
    if not isinstance(names, list) or len(names) != count:
        return [f"{kind[:-1] if kind != 'feet' else 'foot'} {k + 1}" for k in range(count)]
    return [str(name).replace("_", " ") for name in names]
