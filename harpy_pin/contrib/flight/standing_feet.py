"""Feet between two flights: where they stand, what they carry, the ground below them, and their
targets.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from harpy_pin.contrib.flight.flyer import TOUCHDOWN
from harpy_pin.gaits.gait import Gait, GaitTarget
from harpy_pin.ground.terrain import Terrain
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector

LOADED, MIN_LOADED = 0.1, 3.5
"""Normal force from which on a foot has landed, as a share of the weight, and least, N: seven times
the noise of a typical sensor.
"""
LEAST_SHARE = 0.05  # share of the largest normal force that a foot may take when it lets go


class StandingFeet:
    """The feet of a robot that stands, lets go of the ground, or lands; without a terrain the
    ground is flat.

    Their ``middle``, (3,), is about the body's target in standing; ``place``, (feet, 3), as
    measured; ``home``, (3,), the middle where they have settled, all in m. ``grounded``, (feet,),
    says whether each has landed.
    """

    def __init__(self, robot: Robot, begin: GaitTarget, terrain: Terrain | None) -> None:
        self._terrain = terrain
        self._loaded = max(LOADED * robot.mass * GRAVITY, MIN_LOADED)
        self.middle: Vector = begin.foot_position.mean(axis=0)
        # how much deeper than the ground feet aim
        self._deep: Vector = -begin.body[2] - begin.foot_position[:, 2]

    def begin(self, place: Vector) -> None:
        """Stand at places (feet, 3), m, without load."""
        self.place, self._load = place.copy(), np.zeros(len(place))
        self.settle()

    def measure(self, state: State) -> None:
        """Places and loads of the present tick."""
        self.place = state.foot_position.copy()
        self._load = np.einsum("ki,ki->k", self._normals(), state.foot_force)

    def settle(self) -> None:
        """Stand where the feet are."""
        self._at, self.home = self.place.copy(), self.place.mean(axis=0)
        self.grounded = np.ones(len(self._at), dtype=bool)

    @property
    def touching(self) -> Any:
        """(feet,) whether each foot is loaded."""
        return self._load > self._loaded

    def sink(self, span: float) -> None:
        """Feet that have not landed go down for so long, s."""
        self.grounded |= self.touching
        self._at[~self.grounded, 2] -= span * TOUCHDOWN

    def highest(self, places: Vector) -> float:
        """Highest ground below any of the places (n, 2), or where the feet stand on flat ground,
        m.
        """
        return float(self.home[2] if self._terrain is None else self._heights(places).max())

    def ask_for(self, o: GaitTarget, body: Vector, share: float, double_support: float) -> None:
        """Write the targets ``o``, where a foot may take a share of its largest normal force.

        The body (3, 3) has place, velocity and acceleration; the double support is that of the
        gait.
        """
        o.body[:] = body.ravel()
        o.heading[:] = 0.0
        o.up[:] = (0.0, 0.0, 1.0)
        o.foot_position[:] = self._at - body[0]
        o.foot_position[:, 2] -= self._deep
        o.foot_velocity[:] = -body[1]
        o.foot_velocity[~self.grounded, 2] -= TOUCHDOWN
        o.foot_acceleration[:] = -body[2]
        o.stance[:] = self.grounded
        loading = max(share, LEAST_SHARE) * double_support / (1.0 + double_support)
        o.phase[:] = np.where(
            self.grounded, loading, 0.6
        )  # a foot that meets the ground is held at once
        o.normal[:] = self._normals()
        o.ground_height[:] = (
            self._at[:, 2] if self._terrain is None else self._heights(self._at[:, :2])
        )

    def _normals(self) -> Vector:
        """(feet, 3) of the ground below the feet."""
        if self._terrain is None:
            return np.tile((0.0, 0.0, 1.0), (len(self.place), 1))
        x, y = np.ascontiguousarray(self.place[:, :2].T)
        return self._terrain.normal(x, y)

    def _heights(self, places: Vector) -> Vector:
        """Heights of the ground at some places, m."""
        assert self._terrain is not None
        x, y = np.ascontiguousarray(places.T)
        return self._terrain.height(x, y)


class LandedGait(Gait):
    """The targets of a gait, moved over the ground; ``target`` is that of the last update."""

    def __init__(self, gait: Gait) -> None:
        super().__init__(gait.robot)
        self.gait = gait
        self.step_duration, self.double_support = gait.step_duration, gait.double_support
        begin = gait.update(0.0)
        self._middle: Vector = (begin.body[:3] + begin.foot_position.mean(axis=0))[:2]
        self._shift = np.zeros(2)

    def move_to(self, feet: Vector) -> None:
        """Begin with the middle of the feet at a place (3,), m."""
        self._shift = feet[:2] - self._middle

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`."""
        self.target._record_[:] = self.gait.update(t)._record_
        self.target.body[:2] += self._shift
        return self.target

    def observe(self, state: State) -> None:
        """Hand the measured state, moved back, to the gait."""
        moved = state.copy()
        moved.q[:2] -= self._shift
        moved.foot_position[:, :2] -= self._shift
        self.gait.observe(moved)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`."""
        return self.gait.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """The gait's parameters."""
        return self.gait.describe()
