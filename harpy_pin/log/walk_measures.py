"""Measures of walks: what they cost, how they follow their command, and how far the centre of
pressure keeps inside.
"""

import math

import numpy as np

from harpy_pin.log import optional
from harpy_pin.log.power import PRESETS
from harpy_pin.log.run import Run
from harpy_pin.model.state import GRAVITY, Vector

HEAVIEST, LONGEST = 1e9, 1e9
"""Largest mass of a robot, kg, and longest window, rows."""
SHORTEST = 0.1
"""Path below which a walk has no cost of transport, m."""
CORNERS = 4
"""Corners of a flat foot: front left, front right, rear left, rear right."""
LOADED = 0.2
"""Share of the weight from which on the centre of pressure of a sole counts."""
QUANTILE = 0.05
"""Share of the time in which it may be nearer to the edge than the margin says."""
CLOSE = 1e-6
"""How close to its limit a torque is at it, as a share of the limit."""
BIN, BINS = 1e-4, 2000
"""Width of a bin of margins, m, and how many there are."""


def walk_measures(run: Run, *, period: float, step_duration: float) -> dict[str, float]:
    """What a walk costs, how it follows its command, and how far the centre of pressure keeps
    inside.

    These are measures by their names in :class:`harpy_pin.log.measures.Measures`. The period
    between rows is in s, and so is the step duration; the velocity is averaged over two steps.
    """
    q, v = run["q"], run["v"]
    mass = run.metadata.get("mass", math.nan)
    weight = (
        GRAVITY * float(mass)
        if isinstance(mass, int | float) and 0.0 < mass < HEAVIEST
        else math.nan
    )
    torque = optional.given_torque(run)
    joints = min(torque.shape[1], v.shape[1] - 6)
    work = float(np.maximum(torque[:, :joints] * v[:, 6 : 6 + joints], 0.0).sum()) * period
    thrust = np.linalg.norm(optional.given_thrust(run), axis=2)
    thrust_energy = float(PRESETS["fan"].electrical(thrust).sum()) * period
    path = float(np.linalg.norm(np.diff(q[:, :2], axis=0), axis=1).sum())
    window = max(round(min(2.0 * step_duration / period, LONGEST)), 1)
    velocity, turning = _velocity_errors(run, window) if _commanded(run) else (math.nan, math.nan)
    return {
        "cost_of_transport": work / (weight * path) if path > SHORTEST else math.nan,
        "joint_power_w": work / (len(run) * period),
        "thrust_power_w": thrust_energy / (len(run) * period) if thrust.size else math.nan,
        "velocity_rms_m_s": velocity,
        "turning_rms_rad_s": turning,
        "pressure_margin_mm": 1e3 * _pressure_margin(run, weight),
        **_causes(run, torque, weight),
    }


def _causes(run: Run, torque: Vector, weight: float) -> dict[str, float]:
    """How far joints and contact forces were from what was planned, and how often torques were at
    their limits.
    """
    law, planned = (
        optional.optional_signal(run, "motor_law"),
        optional.optional_signal(run, "desired_force"),
    )
    apart = mismatch = math.nan
    if law is not None and len(run) > 1:  # targets are for the middle of a tick
        joints = run["q"][:, -law.shape[2] :]
        apart = float(np.sqrt(np.mean((law[:-1, 0] - 0.5 * (joints[1:] + joints[:-1])) ** 2)))
    if planned is not None and len(run) > 1 and planned.shape[1]:
        off = np.sum((run["foot_force"][1:] - planned[:-1]) ** 2, axis=(1, 2))
        mismatch = float(np.sqrt(np.mean(off))) / weight
    given = run.metadata.get("torque_limit")
    given, clipped = given if isinstance(given, list) else [], math.nan
    limits = [
        float(one) if isinstance(one, int | float) and abs(one) < HEAVIEST else np.inf
        for one in given
    ]
    if len(limits) == torque.shape[1] and np.isfinite(limits).any():
        clipped = float((np.abs(torque) >= (1.0 - CLOSE) * np.array(limits)).any(axis=1).mean())
    return {"joint_tracking_rms_rad": apart, "force_mismatch": mismatch, "clipped": clipped}


def _velocity_errors(run: Run, window: int) -> tuple[float, float]:
    """Velocity less the applied one, m/s, and about the vertical, rad/s; means over windows, root
    mean square.
    """
    heading, applied = run["heading"][:, 0], run["applied_velocity"][:, :3]
    if "path" in run and run["path"].shape[1:] == (3,) and run["path"].dtype.kind == "f":
        heading = run["path"][:, 2]  # the body itself may face elsewhere
    velocity = _world_velocity(run["q"], run["v"])
    c, s = np.cos(heading), np.sin(heading)
    desired = np.stack(
        (c * applied[:, 0] - s * applied[:, 1], s * applied[:, 0] + c * applied[:, 1]), axis=1
    )
    error = np.column_stack((velocity[:, :2] - desired, velocity[:, 2] - applied[:, 2]))
    windows = len(error) // window
    if not windows:
        return math.nan, math.nan
    means = error[: windows * window].reshape(windows, window, 3).mean(axis=1)
    linear, turning = float(np.sum(means[:, :2] ** 2)), float(np.sum(means[:, 2] ** 2))
    return math.sqrt(linear / windows), math.sqrt(turning / windows)


def _pressure_margin(run: Run, weight: float) -> float:
    """Distance to its edge that the centre of pressure of a loaded sole keeps 95 % of the time,
    m.
    """
    counts = np.zeros(BINS, dtype=np.int64)
    for corners in _soles(run):
        flat = run["stance"][:, corners].all(axis=1) if "stance" in run else slice(None)
        place, force = (
            run["foot_position"][flat][:, corners],
            run["foot_force"][flat][:, corners, 2],
        )
        margin = _margins(place, force, LOADED * weight)
        counts += np.bincount(np.clip(margin / BIN, 0, BINS - 1).astype(np.int64), minlength=BINS)
    total = int(counts.sum())
    if not total:
        return math.nan
    number = int(np.searchsorted(np.cumsum(counts), QUANTILE * total, side="right"))
    return BIN * (number + 0.5) if number else 0.0


def _soles(run: Run) -> list[list[int]]:
    """Contact points of each flat foot: four, named like it with ``_0`` to ``_3`` behind."""
    names = run.metadata.get("feet", ())
    if not isinstance(names, list | tuple) or len(names) != run["foot_force"].shape[1]:
        return []
    order = {str(name): number for number, name in enumerate(names)}
    bases = [name[: -len("_0")] for name in order if name.endswith("_0")]
    corners = [[f"{base}_{k}" for k in range(CORNERS)] for base in bases]
    return [
        [order[name] for name in four] for four in corners if all(name in order for name in four)
    ]


def _commanded(run: Run) -> bool:
    """Whether the log holds a velocity that a gait applied, and its heading."""
    shapes = [
        run[name].shape[1:] if name in run else () for name in ("applied_velocity", "heading")
    ]
    known = shapes[0] in ((3,), (4,)) and shapes[1] in ((3,), (2,))
    return known and all(run[name].dtype.kind == "f" for name in ("applied_velocity", "heading"))


def _world_velocity(q: Vector, v: Vector) -> Vector:
    """(n, 3) velocity of the body along x and y, m/s, and about z, rad/s, in the world."""
    x, y, z, w = q[:, 3], q[:, 4], q[:, 5], q[:, 6]
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    parts = (v[:, :3], v[:, :3], v[:, 3:6])
    velocity = [
        np.einsum("kn,nk->n", np.stack(row), part) for row, part in zip(rows, parts, strict=True)
    ]
    return np.stack(velocity, axis=1)


def _margins(position: Vector, normal: Vector, least: float) -> Vector:
    """Distances of the centre of pressure to the edge of a sole, in the rows in which it carries
    ``least``, N, m.

    ``position`` (n, 4, 3) is that of the corners, m, and ``normal`` (n, 4) their forces, N.
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
