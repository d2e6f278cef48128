"""Measures of walks: what they cost, how they follow their command, and how far the centre of pressure keeps inside.

They are summed block by block, so that the memory this takes does not grow with the run.
"""

from __future__ import annotations

import math

import numpy as np

from harpy_pin.log import optional
from harpy_pin.log.power import PRESETS
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector

__all__ = ["WalkSums"]

GRAVITY = 9.81
"""m/s²."""
HEAVIEST, LONGEST = 1e9, 1e9
"""Of a robot, kg, and of a window, rows."""
SHORTEST = 0.1
"""Path below which a walk has no cost of transport, m."""
CORNERS = 4
"""Of a flat foot: front left, front right, rear left, rear right."""
CARRIES = 0.2
"""Share of the weight from which on the centre of pressure of a sole counts."""
QUANTILE = 0.05
"""Share of the time in which it may be nearer to the edge than the margin says."""
BIN, BINS = 1e-4, 2000
"""Width of a bin of margins, m, and how many there are."""


class WalkSums:
    """What a walk adds up to.

    Args:
        run: gives mass, names and signals.
        period: time between its rows, s.
        step_duration: time over which the velocity is averaged: two steps of this duration, s.
    """

    def __init__(self, run: Run, *, period: float, step_duration: float) -> None:
        self._period = period
        mass = run.metadata.get("mass", math.nan)
        self._weight = GRAVITY * float(mass) if isinstance(mass, int | float) and 0.0 < mass < HEAVIEST else math.nan
        self._window = max(round(min(2.0 * step_duration / period, LONGEST)), 1)
        self._soles = _soles(run)
        self._rest = np.zeros((0, 3))  # errors of velocity that do not fill a window yet
        self._rows, self._thrust_energy = 0, 0.0
        self._energy = self._path = self._windows = self._velocity = self._turning = 0.0
        self._margins = np.zeros(BINS, dtype=np.int64)
        self._commanded = _commanded(run)

    def add(self, run: Run, begin: int, end: int) -> None:
        """Add rows ``begin`` to ``end``, the last one not included."""
        q, v = run["q"][begin:end], run["v"][begin:end]
        joints = min(run["torque"].shape[1], v.shape[1] - 6)
        power = run["torque"][begin:end, :joints] * v[:, 6 : 6 + joints]
        self._energy += float(np.maximum(power, 0.0).sum()) * self._period
        self._rows += end - begin
        thrust = np.linalg.norm(optional.given_thrust(run)[begin:end], axis=2)
        self._thrust_energy += float(PRESETS["fan"].electrical(thrust).sum()) * self._period
        before = max(begin - 1, 0)
        self._path += float(np.linalg.norm(np.diff(run["q"][before:end, :2], axis=0), axis=1).sum())
        if self._commanded:
            self._add_velocity(run, begin, end, _world_velocity(q, v))
        for corners in self._soles:
            position, force = (run[name][begin:end, corners] for name in ("foot_position", "foot_force"))
            margin = _margins(position, force[:, :, 2], CARRIES * self._weight)
            places = np.clip(margin / BIN, 0, BINS - 1).astype(np.int64)
            self._margins += np.bincount(places, minlength=BINS)

    def _add_velocity(self, run: Run, begin: int, end: int, velocity: Vector) -> None:
        heading, applied = run["heading"][begin:end, 0], run["applied_velocity"][begin:end, :3]
        c, s = np.cos(heading), np.sin(heading)
        wanted = np.stack((c * applied[:, 0] - s * applied[:, 1], s * applied[:, 0] + c * applied[:, 1]), axis=1)
        error = np.column_stack((velocity[:, :2] - wanted, velocity[:, 2] - applied[:, 2]))
        error = np.concatenate((self._rest, error))
        whole = len(error) // self._window
        self._rest = error[whole * self._window :]
        means = error[: whole * self._window].reshape(whole, self._window, 3).mean(axis=1)
        self._windows += whole
        self._velocity += float(np.sum(means[:, :2] ** 2))
        self._turning += float(np.sum(means[:, 2] ** 2))

    @property
    def cost_of_transport(self) -> float:
        """Positive work of the joints over weight times path; NaN for a path under 0.1 m, or without a mass."""
        return self._energy / (self._weight * self._path) if self._path > SHORTEST else math.nan

    @property
    def joint_power(self) -> float:
        """Mean of the joints' positive power, W."""
        return self._energy / (self._rows * self._period)

    @property
    def thrust_power(self) -> float:
        """Mean power of the thrusters, were each a fan of 18 N from 1 kW, W."""
        return self._thrust_energy / (self._rows * self._period)

    @property
    def velocity_rms(self) -> float:
        """Horizontal velocity less the applied one, each averaged over two steps, root mean square, m/s."""
        return math.sqrt(self._velocity / self._windows) if self._windows else math.nan

    @property
    def turning_rms(self) -> float:
        """The same of the velocity about the vertical, rad/s."""
        return math.sqrt(self._turning / self._windows) if self._windows else math.nan

    @property
    def pressure_margin(self) -> float:
        """Distance to its edge that the centre of pressure of a loaded sole keeps 95 % of the time, m."""
        total = int(self._margins.sum())
        if not total:
            return math.nan
        place = int(np.searchsorted(np.cumsum(self._margins), QUANTILE * total, side="right"))
        return BIN * (place + 0.5) if place else 0.0


def _soles(run: Run) -> list[list[int]]:
    """Contact points of each flat foot: four, named like it with ``_0`` to ``_3`` behind."""
    names = run.metadata.get("feet", ())
    if not isinstance(names, list | tuple) or len(names) != run["foot_force"].shape[1]:
        return []
    order = {str(name): number for number, name in enumerate(names)}
    bases = [name[: -len("_0")] for name in order if name.endswith("_0")]
    corners = [[f"{base}_{k}" for k in range(CORNERS)] for base in bases]
    return [[order[name] for name in four] for four in corners if all(name in order for name in four)]


def _commanded(run: Run) -> bool:
    """Whether the log holds a velocity that a gait applied, and its heading."""
    shapes = [run[name].shape[1:] if name in run else () for name in ("applied_velocity", "heading")]
    known = shapes[0] in ((3,), (4,)) and shapes[1] in ((3,), (2,))
    return known and optional.is_float(run, "applied_velocity") and optional.is_float(run, "heading")


def _world_velocity(q: Vector, v: Vector) -> Vector:
    """(n, 3) velocity of the body along x and y, m/s, and about z, rad/s, in the world."""
    x, y, z, w = q[:, 3], q[:, 4], q[:, 5], q[:, 6]
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    parts = (v[:, :3], v[:, :3], v[:, 3:6])
    velocity = [np.einsum("kn,nk->n", np.stack(row), part) for row, part in zip(rows, parts, strict=True)]
    return np.stack(velocity, axis=1)


def _margins(position: Vector, normal: Vector, least: float) -> Vector:
    """Distances of the centre of pressure to the edge of a sole, in the rows in which it carries, m.

    Args:
        position: (n, 4, 3) of the corners, m.
        normal: (n, 4) forces, N.
        least: load from which on it counts, N.
    """
    load = normal.sum(axis=1)
    rows = load > max(least, 1e-9) if math.isfinite(least) else load > 1e-9
    position, share = position[rows], normal[rows] / load[rows, None]
    centre = (share[:, :, None] * position).sum(axis=1)
    rear = position[:, 2]
    margin: Vector = np.full(len(position), math.inf)
    for end in (position[:, 0], position[:, 3]):  # along the sole, and across it
        side = end - rear
        length = np.maximum(np.linalg.norm(side, axis=1), 1e-9)
        along = np.einsum("ij,ij->i", centre - rear, side) / length
        margin = np.minimum(margin, np.minimum(along, length - along))
    return np.maximum(margin, 0.0)
