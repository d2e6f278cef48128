"""The rows of a run that are drawn: cut where the numbers end, checked against the robot, thinned to a frame rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.ground.ground import Ground
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = [
    "Frames",
    "finite_part",
    "friction_strips",
    "is_per_axis",
    "local_friction",
    "normal_floor",
    "require_match",
    "sample_rows",
    "signal_points",
    "static_friction",
]

_LARGEST = 1e9
_MAX_FRAMES = 1_000_000
_RANKS = {"t": 1, "q": 2, "v": 2, "torque": 2, "x_r": 2, "x_w": 2}
_RANKS |= dict.fromkeys(("foot_position", "foot_velocity", "foot_force", "thrust"), 3)
_NEVER_EMPTY = ("q", "v", "x_r", "x_w")
"""Every robot has some of it; not all have feet, thrusters or joints."""
_KINDS: dict[str, Any] = {
    **dict.fromkeys(("ground", "parameters", "gait"), Mapping),
    **dict.fromkeys(("feet", "thrusters"), list | tuple),
    **dict.fromkeys(("control_period", "step_duration"), int | float),
}
_DRAWN = ("t", "q", "foot_position", "foot_velocity", "foot_force", "thrust")


@dataclass(frozen=True, eq=False)
class Frames:
    """What is drawn, one row per frame; world axes.

    Attributes:
        fps: frames per second.
        time: (n,) time since the first frame, s.
        q: (n, nq) configurations.
        joints: (n, model joints, 4, 4) placement of every joint frame of the model.
        foot_position: (n, feet, 3), m.
        foot_velocity: (n, feet, 3), m/s.
        foot_force: (n, feet, 3) force of the ground on the feet, N.
        mount: (n, thrusters, 3) position of the thruster mounts, m.
        thrust: (n, thrusters, 3) forces of the thrusters on the robot, N.
        references: for each logged reference ("target", "applied") its (n, 3) positions, m; NaN where there is none.
    """

    fps: float
    time: Vector
    q: Vector
    joints: Vector
    foot_position: Vector
    foot_velocity: Vector
    foot_force: Vector
    mount: Vector
    thrust: Vector
    references: dict[str, Vector]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    @checked
    def from_run(cls, run: Run, robot: Robot, *, fps: float = 30.0) -> Frames:
        """Thin a run to a frame rate.

        Rows from the first one on that is not finite (a divergence) are left out. The last finite row is always
        drawn, so that the end of a fall is seen.

        Args:
            run: the log.
            robot: the robot that was logged.
            fps: frames per second of simulated time; a log with fewer rows gives fewer frames.

        Raises:
            InputError: the frame rate is not positive, the run holds no finite row, or it is of another robot.
        """
        fps = checks.number("fps", fps, low=0.0, strict=True)
        require_match(run, robot)
        run = finite_part(run)
        rows = sample_rows(run["t"], fps)
        q = run["q"][rows]
        joints, mount = _placements(robot, q)
        references = {}
        for label, name in (("target", "x_r"), ("applied", "x_w")):
            points = signal_points(run, name)
            if points is not None:
                references[label] = points[rows]
        return cls(
            fps=fps,
            time=run["t"][rows] - run["t"][0],
            q=q,
            joints=joints,
            foot_position=run["foot_position"][rows],
            foot_velocity=run["foot_velocity"][rows],
            foot_force=run["foot_force"][rows],
            mount=mount,
            thrust=run["thrust"][rows],
            references=references,
        )


def require_match(run: Run, robot: Robot) -> None:
    """Make sure that a run is of a robot.

    Raises:
        InputError: it holds no tick, or its signals or names do not fit the robot.
    """
    if not run.signals or len(run) == 0:
        raise InputError(f"the run holds no tick (it ended: {shown(run.ending, 200)})", name="run")
    _check_metadata(run.metadata)
    missing = [name for name in _DRAWN if name not in run]
    if missing:
        raise InputError(f"the run lacks the signals {', '.join(missing)}", name="run")
    rows = len(run)
    desired = {
        "q": (rows, robot.model.nq),
        "foot_position": (rows, len(robot.feet), 3),
        "foot_velocity": (rows, len(robot.feet), 3),
        "foot_force": (rows, len(robot.feet), 3),
        "thrust": (rows, len(robot.thrusters), 3),
    }
    for name, shape in desired.items():
        if run[name].shape != shape:
            raise InputError(
                f"the run is not of robot '{robot.name}': {name} has shape {run[name].shape}, the robot needs {shape}",
                name="robot",
                value=robot.name,
            )
    for kind, names in (("feet", robot.feet), ("thrusters", robot.thrusters)):
        logged = run.metadata.get(kind)
        if logged is not None and list(logged) != list(names):
            raise InputError(
                f"the run is not of robot '{robot.name}': it was logged with {kind} {shown(list(logged), 200)}, "
                f"the robot has {list(names)}",
                name="robot",
                value=robot.name,
            )


def finite_part(run: Run) -> Run:
    """The rows before the first one whose motion or forces are not finite, beyond all measure, or of no rotation.

    Raises:
        InputError: there is none, or a signal is not what its name says.
    """
    _check_metadata(run.metadata)
    run = Run({name: _plain(run, name) for name in run.signals}, run.metadata)
    finite = np.ones(len(run), dtype=bool)
    for name in _DRAWN:
        finite &= (np.abs(run[name]) < _LARGEST).reshape(len(run), -1).all(axis=1)
    length = np.linalg.norm(run["q"].reshape(len(run), -1)[:, 3:7], axis=1)
    finite &= (length > 0.7) & (length < 1.4)
    rows = len(run) if finite.all() else int(np.argmin(finite))
    if rows == 0:
        raise InputError("the run holds no finite row: there is nothing to draw", name="run")
    return run if rows == len(run) else Run({name: a[:rows] for name, a in run.signals.items()}, run.metadata)


def _check_metadata(metadata: Mapping[str, Any]) -> None:
    """What is read of the metadata is there as it should be, or not at all."""
    places = dict(metadata)
    for outer, inner in (("parameters", "gait"), ("gait", "step_duration")):
        if isinstance(places.get(outer), Mapping) and inner in places[outer]:
            places[inner] = places[outer][inner]
    for name, kind in _KINDS.items():
        if name in places and (not isinstance(places[name], kind) or isinstance(places[name], bool)):
            raise InputError(f"the run's metadata holds no {name} as it should be", name="run")


def _plain(run: Run, name: str) -> Vector:
    """A signal as plain numbers, of the shape that its name asks for."""
    signal, rank = run[name], _RANKS.get(name)
    if rank is None:
        return signal
    vectors = rank == 3 and signal.shape[2:] != (3,)
    if (
        signal.dtype.kind not in "biuf"
        or signal.ndim != rank
        or vectors
        or (name in _NEVER_EMPTY and 0 in signal.shape[1:2])
    ):
        raise InputError(f"the signal {name} of the run is not made of numbers as it should be", name="run")
    return signal.astype(np.float64)


def sample_rows(t: Vector, fps: float) -> NDArray[np.intp]:
    """Indices of the rows nearest to a regular frame clock, without repetition, the last row included.

    Args:
        t: (n,) increasing times, s.
        fps: frames per second.

    Raises:
        InputError: the times do not increase, or the pages of a film so long would not fit into memory.
    """
    if np.any(np.diff(t) <= 0.0) or (t[-1] - t[0]) * fps > _MAX_FRAMES:
        raise InputError(f"the times of the run must increase, and give at most {_MAX_FRAMES} frames", name="run")
    count = int(np.floor((t[-1] - t[0]) * fps + 1e-6)) + 1
    clock = t[0] + np.arange(count) / fps
    right = np.clip(np.searchsorted(t, clock), 1, max(len(t) - 1, 1))
    nearest = right - (clock - t[right - 1] < t[np.minimum(right, len(t) - 1)] - clock)
    return np.unique(np.append(np.minimum(nearest, len(t) - 1), len(t) - 1))


def signal_points(run: Run, name: str) -> Vector | None:
    """The positions in an optional reference signal, [position; velocity] or the position alone.

    Returns:
        (rows, 3), m; None where the run has no such signal.
    """
    if name not in run or run[name].ndim != 2 or run[name].shape[1] < 3:
        return None
    return np.asarray(run[name][:, :3], dtype=np.float64)


def normal_floor(run: Run) -> float | None:
    """Smallest normal force that the controller of a run asks of a stance foot, N; None where the log has none."""
    parameters = run.metadata.get("parameters")
    control = parameters.get("control") if isinstance(parameters, Mapping) else None
    floor = control.get("min_normal_force") if isinstance(control, Mapping) else None
    if not isinstance(floor, int | float) or isinstance(floor, bool) or not 0.0 < floor < _LARGEST:
        return None
    return float(floor)


def static_friction(run: Run) -> float | None:
    """Static friction coefficient of the ground of a run, outside its friction_strips; None where the log has none."""
    ground = run.metadata.get("ground")
    mu = ground.get("mu_s") if isinstance(ground, dict) else None
    return float(mu) if isinstance(mu, int | float) and 0.0 <= mu < _LARGEST else None


def is_per_axis(run: Run) -> bool:
    """Whether the ground of a run bounds the friction for x and y apart."""
    return (run.metadata.get("ground") or {}).get("cone") == "per_axis"


def friction_strips(run: Run) -> tuple[tuple[float, float, float], ...]:
    """Strips of another friction in the ground of a run: from x, to x, m, and static coefficient of each.

    Raises:
        InputError: the metadata hold friction_strips that are none.
    """
    ground = run.metadata.get("ground")
    strips = ground.get("friction_strips") if isinstance(ground, dict) else None
    return Ground(friction_strips=strips).friction_strips if strips else ()


def local_friction(run: Run, foot_position: Vector, *, time: Vector | None = None) -> Vector | None:
    """Static friction coefficient under feet.

    Args:
        run: its metadata hold the ground; where the ground changed, the signal ``foot_friction`` says how.
        foot_position: (..., 3), m.
        time: of the first axis, since the run began, s; without it the ground is that of the metadata.

    Returns:
        (...,) coefficients; None where the log has none.

    Raises:
        InputError: the metadata hold friction_strips of the ground that are none.
    """
    mu = static_friction(run)
    if mu is None:
        return None
    if time is not None and "foot_friction" in run and run["foot_friction"].shape == (len(run), foot_position.shape[1]):
        rows = np.searchsorted(run["t"] - run["t"][0], time - 1e-9)
        return np.asarray(np.maximum(run["foot_friction"][np.clip(rows, 0, len(run) - 1)], 0.0))
    strips, x = friction_strips(run), foot_position[..., 0]
    return Ground(mu_s=mu, friction_strips=strips).friction(x) if strips else np.full(x.shape, mu)


def _placements(robot: Robot, q: Vector) -> tuple[Vector, Vector]:
    """(n, joints, 4, 4) joint placements and (n, thrusters, 3) mount positions."""
    model = robot.model
    data = model.createData()
    ids = [robot.frame_id(name) for name in robot.thrusters]
    joints = np.empty((len(q), model.njoints, 4, 4))
    mount = np.empty((len(q), len(ids), 3))
    for row, configuration in enumerate(q):
        pin.framesForwardKinematics(model, data, configuration)
        for j in range(model.njoints):
            joints[row, j] = data.oMi[j].homogeneous
        for k, frame in enumerate(ids):
            mount[row, k] = data.oMf[frame].translation
    return joints, mount
