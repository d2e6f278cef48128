"""A plan of an MPC: motion of the body, contacts, footholds and forces over some time."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector


class PlannedMoment(NamedTuple):
    """What a plan says of one time, in world axes.

    Attributes:
        position: (3,) of the body's origin or the centre of mass, m.
        velocity: (3,) of it, m/s.
        acceleration: (3,) of it, m/s².
        rotation: (3, 3) from body axes to world axes.
        angular_velocity: (3,) of the body, rad/s.
        angular_acceleration: (3,) of the body, rad/s².
        contact: (feet,) whether each foot is on the ground.
        foothold: (feet, 3) where each foot stands or, in the air, lands next, m.
        landing: (feet,) when a foot in the air lands, s.
        force: (feet, 3) contact forces, N; zero where none are planned.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector
    rotation: Vector
    angular_velocity: Vector
    angular_acceleration: Vector
    contact: NDArray[np.bool_]
    foothold: Vector
    landing: Vector
    force: Vector


class Plan:
    """Motion of the body, contacts and footholds at N times, in world axes.

    Positions, orientations and their velocities are states at the times. Between them positions
    follow cubic polynomials with these velocities, orientations the shortest rotation, velocities a
    straight line. All else holds from its time to the next one, like the inputs of an MPC: it may
    have N − 1 rows as well as N. What has one row without the first axis is the same at all times.

    Feet are the robot's contact points, in the order of :attr:`~harpy_pin.model.robot.Robot.feet`.
    A foot in the air lands at the next row that has it in contact, on the foothold of that row;
    where there is none, with the end of the plan on the last foothold. Other footholds of feet in
    the air do not count.

    Args:
        times: (N,) on the clock of ``State.t``, s, increasing, N ≥ 2. The first one should be that
            of the state from which the plan was made: the plan's age counts from it.
        position: (N, 3) of the body's origin, m.
        contact: (N, feet) whether each foot is on the ground.
        foothold: (N, feet, 3) where it stands, m.
        velocity: (N, 3) of ``position``, m/s; by default finite differences.
        acceleration: (N, 3) of ``position``, m/s²; by default the slope of the velocities.
        orientation: (N, 3) roll, pitch, yaw of the body, R = Rz(yaw) Ry(pitch) Rx(roll), rad; or
            (N, 4) quaternions in the order x, y, z, w.
        angular_velocity: (N, 3) of the body, rad/s; by default that of the shortest rotations.
        angular_acceleration: (N, 3) of the body, rad/s²; by default the slope of the angular
            velocities, or zero where those are not given.
        force: (N, feet, 3) of the ground on each foot, N. Controllers choose forces near to it
            where their tasks leave a choice.
        centre_of_mass: whether ``position`` is that of the robot's centre of mass instead.

    What is given is kept in attributes of these names, with all its rows, and besides:

    Arrays are read only.

    Attributes:
        feet: how many.
        rotation: (N, 3, 3) from body axes to world axes.
        landing: (N, feet) when a foot in the air lands, s.

    Raises:
        InputError: an array has the wrong shape or is not finite, or the times do not increase.
    """

    @checked
    def __init__(
        self,
        *,
        times: ArrayLike,
        position: ArrayLike,
        contact: ArrayLike,
        foothold: ArrayLike,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        orientation: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike | None = None,
        angular_acceleration: ArrayLike | None = None,
        force: ArrayLike | None = None,
        centre_of_mass: bool = False,
    ) -> None:
        n = np.size(checks.array("times", times, None))
        self.times = checks.vector("times", times, max(n, 2))
        self.centre_of_mass = centre_of_mass
        span = np.diff(self.times)[:, None]
        if not (span > 0.0).all():
            raise InputError("the times of a plan must increase", name="times", value=times)
        self.feet = feet = (np.shape(contact) or (0,))[-1]
        held = _rows("contact", contact, n, (feet,), held=True)
        if not ((held == 0.0) | (held == 1.0)).all():
            raise InputError("contact must be 0 or 1 of each foot", name="contact", value=contact)
        self.contact = held == 1.0
        self.force = _rows("force", np.zeros((feet, 3)) if force is None else force, n, (feet, 3))
        self.position = _rows("position", position, n, (3,), held=False)
        if velocity is None:
            velocity = np.gradient(self.position, self.times, axis=0)
        self.velocity = _rows("velocity", velocity, n, (3,), held=False)
        self._slope = np.diff(self.velocity, axis=0) / span
        given = self._slope if acceleration is None else acceleration
        self.acceleration = _rows("acceleration", given, n, (3,))
        self.rotation = _rotations(orientation, n)
        self._turn = np.array(
            [pin.log3(a.T @ b) for a, b in zip(self.rotation, self.rotation[1:], strict=False)]
        )
        if angular_velocity is None:
            self.angular_velocity = np.einsum("nij,nj->ni", self.rotation[:-1], self._turn) / span
            self._bend = np.zeros((n - 1, 3))
        else:
            self.angular_velocity = _rows("angular_velocity", angular_velocity, n, (3,), held=False)
            self._bend = np.diff(self.angular_velocity, axis=0) / span
        given = self._bend if angular_acceleration is None else angular_acceleration
        self.angular_acceleration = _rows("angular_acceleration", given, n, (3,))
        self.foothold = _rows("foothold", foothold, n, (feet, 3))
        self.landing = np.tile(self.times[-1], (n, feet))
        for i in range(n - 2, -1, -1):
            flies = ~self.contact[i]
            later = np.where(self.contact[i + 1], self.times[i + 1], self.landing[i + 1])
            self.landing[i, flies] = later[flies]
            self.foothold[i, flies] = self.foothold[i + 1, flies]
        self._grid = self.times.tolist()
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __repr__(self) -> str:
        begin, end = self.times[[0, -1]]
        return f"Plan({begin:.3f} to {end:.3f} s, {len(self.times)} times, {self.feet} feet)"

    def at(self, t: float) -> PlannedMoment:
        """What it says of a time.

        Args:
            t: time, s; before the plan begins its first state, after its end the last.

        Raises:
            InputError: t is not finite.
        """
        t = min(max(checks.number("t", t), self._grid[0]), self._grid[-1])
        i = min(bisect_right(self._grid, t), len(self._grid) - 1) - 1
        since, span = t - self._grid[i], self._grid[i + 1] - self._grid[i]
        s = since / span
        way = self.position[i + 1] - self.position[i]
        begin, end = span * self.velocity[i], span * self.velocity[i + 1]
        cubic = begin + s * (3.0 * way - 2.0 * begin - end + s * (begin + end - 2.0 * way))
        return PlannedMoment(
            self.position[i] + s * cubic,
            self.velocity[i] + since * self._slope[i],
            self.acceleration[i],
            self.rotation[i] @ pin.exp3(s * self._turn[i]),
            self.angular_velocity[i] + since * self._bend[i],
            self.angular_acceleration[i],
            self.contact[i],
            self.foothold[i],
            self.landing[i],
            self.force[i],
        )


def _rows(
    name: str, value: ArrayLike, n: int, shape: tuple[int, ...], *, held: bool = True
) -> Vector:
    """Rows (n, *shape) of what was given with as many, one, or, where it is ``held``, n − 1."""
    given = checks.array(name, value, None)
    if given.shape == shape:
        given = np.tile(given, (n,) + (1,) * len(shape))
    elif held and given.shape == (n - 1, *shape):
        given = np.concatenate((given, given[-1:]))
    return checks.vector(name, given, (n, *shape))


def _rotations(orientation: ArrayLike, n: int) -> Vector:
    """Rotation matrices (n, 3, 3) of what was given."""
    size = 4 if np.shape(orientation)[-1:] == (4,) else 3
    rows = _rows("orientation", orientation, n, (size,), held=False)
    if size == 3:
        return np.array([pin.rpy.rpyToMatrix(*row) for row in rows])
    lengths = np.linalg.norm(rows, axis=1)
    if not ((lengths > 0.7) & (lengths < 1.4)).all():
        raise InputError("quaternions must be of length one", name="orientation", value=orientation)
    return np.array([pin.Quaternion(row).normalized().matrix() for row in rows])
