"""The rows of a run that are drawn, checked against its robot and thinned to a frame rate, and the
feet's contacts.

Forces and velocities of contacts are about the ground's normal: their third part is along it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.ground.contact_frame import in_contact_frames
from harpy_pin.ground.ground import Ground
from harpy_pin.ground.terrain import Terrain
from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

LARGEST = 1e9
"""Largest number that is drawn."""
MAX_FRAMES = 1_000_000
RANKS = {"t": 1, "q": 2, "v": 2, "torque": 2, "x_r": 2, "x_w": 2, "estimated_q": 2}
RANKS |= dict.fromkeys(("foot_position", "foot_velocity", "foot_force", "thrust"), 3)
"""Number of dimensions of the signals; those with three hold vectors."""
NEVER_EMPTY = ("q", "v", "x_r", "x_w", "estimated_q")
"""Every robot has some of it; not all have feet, thrusters or joints."""
KINDS: dict[str, Any] = {
    **dict.fromkeys(("ground", "parameters", "gait"), Mapping),
    **dict.fromkeys(("feet", "thrusters"), list | tuple),
    **dict.fromkeys(("control_period", "step_duration"), int | float),
}
DRAWN = ("t", "q", "foot_position", "foot_velocity", "foot_force", "thrust")
REFERENCES = {"target": "x_r", "applied": "x_w"}
PLACES = REFERENCES | {"estimate": "estimated_q"}
"""Places that are compared with the body's, and their signals."""


class Frames:
    """A run, and which of its rows are drawn; world axes. ``frames["q"]`` is a signal at the
    frames.

    Rows from the first one on that is not finite (a divergence) are left out. The last finite row
    is always drawn, so that the end of a fall is seen.

    Args:
        run: the log.
        robot: the robot that was logged.
        fps: frames per second of simulated time; a log with fewer rows gives fewer frames.

    Attributes:
        run: the rows of the log before the first one that is not finite.
        complete: whether these are all rows.
        ground: of the run; None where the log has none.
        surface: terrain of the ground; None where it is level.
        references: for each logged reference ("target", "applied") its (rows of the run, 3)
            positions, m.
        rows: (n,) numbers of the rows that are drawn.
        time: (n,) time since the first frame, s.
        joints: (n, model joints, 4, 4) placement of every joint frame of the model.
        mount: (n, thrusters, 3) position of the thruster mounts, m.

    Raises:
        InputError: the frame rate is not positive, the run holds no finite row, or it is of another
            robot.
    """

    @checked
    def __init__(self, run: Run, robot: Robot, *, fps: float = 30.0) -> None:
        self.fps, self.robot = checks.number("fps", fps, low=0.0, strict=True), robot
        _require_match(run, robot)
        self.run = finite = _finite_part(run)
        self.complete = len(finite) == len(run)
        self.ground = ground_of(finite)
        self.surface = surface_of(self.ground)
        logged = {label: finite[name] for label, name in PLACES.items() if name in finite}
        self.references = {
            label: place[:, :3] for label, place in logged.items() if place.shape[1] >= 3
        }
        self.rows = sample_rows(finite["t"], fps)
        self.time = finite["t"][self.rows] - finite["t"][0]
        self.joints, self.mount = _placements(robot, self["q"])

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, signal: str) -> Vector:
        return np.asarray(self.run[signal][self.rows])

    @cached_property
    def contacts(self) -> Contacts:
        """(rows of the run, feet)."""
        return Contacts.of(self.run, self.ground)


def ground_of(run: Run) -> Ground | None:
    """The ground of a run; None where the log holds no friction coefficient.

    Raises:
        InputError: the metadata hold a ground that is none.
    """
    given = run.metadata.get("ground")
    mu = given.get("mu_s") if isinstance(given, Mapping) else None
    if (
        not isinstance(given, Mapping)
        or not isinstance(mu, int | float)
        or not 0.0 <= mu <= checks.MAX_FRICTION
    ):
        return None
    named = {
        name: given[name] for name in ("friction_strips", "slope", "terrain") if given.get(name)
    }
    return Ground(
        mu_s=mu, cone="per_axis" if given.get("cone") == "per_axis" else "circular", **named
    )


def surface_of(ground: Ground | None) -> Terrain | None:
    """The terrain of a ground; None where it is level."""
    surface = None if ground is None else ground.surface
    return None if surface is None or surface.record["level"][0] else surface


def about_normals(surface: Terrain | None, place: Vector, vectors: Vector) -> Vector:
    """Vectors at feet, of world axes, in the frames of the contacts: their third part is along the
    normal.

    Args:
        surface: of the ground; where it is None they stay as they are.
        place: (..., 3) of the feet, m.
        vectors: (..., 3).
    """
    if surface is None:
        return vectors
    normal = surface.normal(np.nan_to_num(place[..., 0]), np.nan_to_num(place[..., 1]))
    flat = np.ascontiguousarray(vectors, dtype=np.float64).reshape(-1, 3)
    return in_contact_frames(np.ascontiguousarray(normal).reshape(-1, 3), flat).reshape(
        vectors.shape
    )


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of feet with the ground, one for each entry of the arrays; forces and velocities
    about the normal.
    """

    position: Vector  # (..., 3) of the feet, world, m
    force: Vector  # (..., 3) of the ground on the feet, N
    velocity: Vector  # (..., 3) of the feet, m/s
    mu: Vector | None = None  # (...,) static friction coefficient; None where it is not known
    # whether friction bounds the two tangential forces apart, instead of their length
    per_axis: bool = False

    @classmethod
    def of(cls, run: Run, ground: Ground | None) -> Contacts:
        """The (rows, feet) contacts of a run; where the ground changed, the signal
        ``foot_friction`` says how.
        """
        place, mu = run["foot_position"], None
        force, velocity = (
            about_normals(surface_of(ground), place, run[n])
            for n in ("foot_force", "foot_velocity")
        )
        if ground is not None:
            logged = run.signals.get("foot_friction")
            usable = (
                logged is not None and logged.dtype.kind == "f" and logged.shape == place.shape[:2]
            )
            mu = (
                np.maximum(logged, 0.0)
                if logged is not None and usable
                else ground.friction(place[..., 0])
            )
        return cls(place, force, velocity, mu, ground is not None and ground.cone == "per_axis")

    def __getitem__(self, chosen: Any) -> Contacts:
        """Some of the contacts, by an index of the arrays."""
        mu = None if self.mu is None else self.mu[chosen]
        return Contacts(
            self.position[chosen], self.force[chosen], self.velocity[chosen], mu, self.per_axis
        )

    @property
    def normal(self) -> Vector:
        """(...,) normal force, N; zero without contact."""
        return np.maximum(self.force[..., 2], 0.0)

    @property
    def touching(self) -> NDArray[np.bool_]:
        """(...,) whether the foot is on the ground."""
        return np.asarray(self.force[..., 2] > 0.0)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """(...,) whether the foot slides: in contact, and faster along the ground than 10 mm/s."""
        return np.asarray(
            self.touching & (np.hypot(self.velocity[..., 0], self.velocity[..., 1]) > SLIDING_SPEED)
        )

    @property
    def tangential(self) -> Vector:
        """(...,) the force that friction bounds, N: the length of the tangential one, or its larger
        part.
        """
        return self.tangential_of(self.force)

    def tangential_of(self, force: Vector) -> Vector:
        """(...,) the same of other (..., 3) forces on this ground, N."""
        sides = np.abs(force[..., :2])
        return np.asarray(
            sides.max(axis=-1) if self.per_axis else np.hypot(sides[..., 0], sides[..., 1])
        )

    @property
    def used(self) -> Vector:
        """(...,) tangential force as a share of what friction allows: 1 on the cone, more outside.

        It is zero without contact, and infinite for any tangential force where there is no
        friction. A foot that slides uses all that there is, which is less than static friction.
        """
        assert self.mu is not None
        bound, tangential = self.mu * self.normal, self.tangential
        share = np.divide(tangential, bound, out=np.full(bound.shape, np.inf), where=bound > 0.0)
        return np.where(self.touching & (tangential > 0.0), np.maximum(share, self.slides), 0.0)

    @property
    def margin(self) -> Vector:
        """(...,) the tangential force that friction has left, N; none while a foot slides."""
        assert self.mu is not None
        margin = self.mu * self.normal - self.tangential
        return np.where(self.slides, np.minimum(margin, 0.0), margin)


def _require_match(run: Run, robot: Robot) -> None:
    """Make sure that a run is of a robot."""
    if not run.signals or len(run) == 0:
        raise InputError(f"the run holds no tick (it ended: {shown(run.ending, 200)})", name="run")
    _check_metadata(run.metadata)
    missing = [name for name in DRAWN if name not in run]
    if missing:
        raise InputError(f"the run lacks the signals {', '.join(missing)}", name="run")
    feet = dict.fromkeys(("foot_position", "foot_velocity", "foot_force"), (len(robot.feet), 3))
    for name, shape in {"q": (robot.nq,), **feet, "thrust": (len(robot.thrusters), 3)}.items():
        if run[name].shape[1:] != shape:
            found = f"{name} has rows of shape {run[name].shape[1:]}, the robot needs {shape}"
            raise InputError(
                f"the run is not of robot '{robot.name}': {found}", name="robot", value=robot.name
            )
    for kind, names in (("feet", robot.feet), ("thrusters", robot.thrusters)):
        logged = run.metadata.get(kind)
        if logged is not None and list(logged) != list(names):
            found = (
                f"it was logged with {kind} {shown(list(logged), 200)}, the robot has {list(names)}"
            )
            raise InputError(
                f"the run is not of robot '{robot.name}': {found}", name="robot", value=robot.name
            )


def _finite_part(run: Run) -> Run:
    """The rows before the first one whose motion or forces are not finite, beyond all measure, or
    of no rotation.
    """
    run = Run({name: _plain(run, name) for name in run.signals}, run.metadata)
    finite = np.ones(len(run), dtype=bool)
    for name in DRAWN:
        finite &= (np.abs(run[name]) < LARGEST).reshape(len(run), -1).all(axis=1)
    length = np.linalg.norm(run["q"].reshape(len(run), -1)[:, 3:7], axis=1)
    finite &= (length > 0.7) & (length < 1.4)
    rows = len(run) if finite.all() else int(np.argmin(finite))
    if rows == 0:
        raise InputError("the run holds no finite row: there is nothing to draw", name="run")
    return Run({name: signal[:rows] for name, signal in run.signals.items()}, run.metadata)


def _check_metadata(metadata: Mapping[str, Any]) -> None:
    """What is read of the metadata is there as it should be, or not at all."""
    places = dict(metadata)
    for outer, inner in (("parameters", "gait"), ("gait", "step_duration")):
        if isinstance(places.get(outer), Mapping) and inner in places[outer]:
            places[inner] = places[outer][inner]
    for name, kind in KINDS.items():
        if name in places and (
            not isinstance(places[name], kind) or isinstance(places[name], bool)
        ):
            raise InputError(f"the run's metadata holds no {name} as it should be", name="run")


def _plain(run: Run, name: str) -> Vector:
    """A signal as plain numbers, of the shape that its name asks for."""
    signal, rank = run[name], RANKS.get(name)
    if rank is None:
        return signal
    vectors = rank == 3 and signal.shape[2:] != (3,)
    empty = name in NEVER_EMPTY and 0 in signal.shape[1:2]
    if signal.dtype.kind not in "biuf" or signal.ndim != rank or vectors or empty:
        raise InputError(
            f"the signal {name} of the run is not made of numbers as it should be", name="run"
        )
    return signal.astype(np.float64)


def sample_rows(t: Vector, fps: float) -> NDArray[np.intp]:
    """Indices of the rows nearest to a regular frame clock, without repetition, the last row
    included.

    Args:
        t: (n,) increasing times, s.
        fps: frames per second.

    Raises:
        InputError: the times do not increase, or the pages of a film so long would not fit into
            memory.
    """
    if np.any(np.diff(t) <= 0.0) or (t[-1] - t[0]) * fps > MAX_FRAMES:
        raise InputError(
            f"the times of the run must increase, and give at most {MAX_FRAMES} frames", name="run"
        )
    count = int(np.floor((t[-1] - t[0]) * fps + 1e-6)) + 1
    clock = t[0] + np.arange(count) / fps
    right = np.clip(np.searchsorted(t, clock), 1, max(len(t) - 1, 1))
    nearest = right - (clock - t[right - 1] < t[np.minimum(right, len(t) - 1)] - clock)
    return np.unique(np.append(np.minimum(nearest, len(t) - 1), len(t) - 1))


def normal_floor(run: Run) -> float | None:
    """Smallest normal force that the controller of a run asks of a stance foot, N; None where the
    log has none.
    """
    place: Any = run.metadata
    for name in ("parameters", "control", "min_normal_force"):
        place = place.get(name) if isinstance(place, Mapping) else None
    number = isinstance(place, int | float) and not isinstance(place, bool)
    return float(place) if number and 0.0 < place < LARGEST else None


def _placements(robot: Robot, q: Vector) -> tuple[Vector, Vector]:
    """(n, joints, 4, 4) joint placements and (n, thrusters, 3) mount positions."""
    model = robot.model
    data = model.createData()
    ids = [robot.frame_id(name) for name in robot.thrusters]
    joints = np.empty((len(q), model.njoints, 4, 4))
    mount = np.empty((len(q), len(ids), 3))
    for row, configuration in enumerate(q):
        pin.framesForwardKinematics(model, data, robot.closed(configuration))
        joints[row] = [placement.homogeneous for placement in data.oMi]
        mount[row] = np.reshape([data.oMf[frame].translation for frame in ids], (-1, 3))
    return joints, mount
