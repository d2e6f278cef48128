"""Feet on the ground of a run: forces and velocities about the ground's normal, and how much friction they use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.ground.contact_frame import in_contact_frames
from harpy_pin.ground.ground import Ground
from harpy_pin.ground.terrain import Terrain
from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector

__all__ = ["Contacts", "about_normals", "ground_of", "surface_of"]


def ground_of(run: Run) -> Ground | None:
    """The ground of a run; None where the log holds no friction coefficient.

    Raises:
        InputError: the metadata hold a ground that is none.
    """
    given = run.metadata.get("ground")
    mu = given.get("mu_s") if isinstance(given, Mapping) else None
    if not isinstance(given, Mapping) or not isinstance(mu, int | float) or not 0.0 <= mu <= checks.MAX_FRICTION:
        return None
    named = {name: given[name] for name in ("friction_strips", "slope", "terrain") if given.get(name)}
    return Ground(mu_s=mu, cone="per_axis" if given.get("cone") == "per_axis" else "circular", **named)


def surface_of(ground: Ground | None) -> Terrain | None:
    """The terrain of a ground; None where it is level."""
    surface = None if ground is None else ground.surface
    return None if surface is None or surface.record["level"][0] else surface


def about_normals(surface: Terrain | None, place: Vector, vectors: Vector) -> Vector:
    """Vectors at feet, of world axes, in the frames of the contacts: their third part is along the normal.

    Args:
        surface: of the ground; where it is None they stay as they are.
        place: (..., 3) of the feet, m.
        vectors: (..., 3).
    """
    if surface is None:
        return vectors
    normal = surface.normal(np.nan_to_num(place[..., 0]), np.nan_to_num(place[..., 1]))
    flat = np.ascontiguousarray(vectors, dtype=np.float64).reshape(-1, 3)
    return in_contact_frames(np.ascontiguousarray(normal).reshape(-1, 3), flat).reshape(vectors.shape)


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of feet with the ground, one for each entry of the arrays; forces and velocities about the normal.

    Attributes:
        position: (..., 3) of the feet, world, m.
        force: (..., 3) of the ground on the feet, N.
        velocity: (..., 3) of the feet, m/s.
        mu: (...,) static friction coefficient; None where it is not known.
        per_axis: whether friction bounds the two tangential forces apart, instead of their length.
    """

    position: Vector
    force: Vector
    velocity: Vector
    mu: Vector | None = None
    per_axis: bool = False

    @classmethod
    def of(cls, run: Run, ground: Ground | None) -> Contacts:
        """The (rows, feet) contacts of a run; where the ground changed, the signal ``foot_friction`` says how."""
        place, mu = run["foot_position"], None
        force, velocity = (about_normals(surface_of(ground), place, run[n]) for n in ("foot_force", "foot_velocity"))
        if ground is not None:
            logged = run.signals.get("foot_friction")
            usable = logged is not None and logged.dtype.kind == "f" and logged.shape == place.shape[:2]
            mu = np.maximum(logged, 0.0) if logged is not None and usable else ground.friction(place[..., 0])
        return cls(place, force, velocity, mu, ground is not None and ground.cone == "per_axis")

    def __getitem__(self, chosen: Any) -> Contacts:
        """Some of the contacts, by an index of the arrays."""
        mu = None if self.mu is None else self.mu[chosen]
        return Contacts(self.position[chosen], self.force[chosen], self.velocity[chosen], mu, self.per_axis)

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
        return np.asarray(self.touching & (np.hypot(self.velocity[..., 0], self.velocity[..., 1]) > SLIDING_SPEED))

    @property
    def tangential(self) -> Vector:
        """(...,) the force that friction bounds, N: the length of the tangential one, or its larger part."""
        return self.tangential_of(self.force)

    def tangential_of(self, force: Vector) -> Vector:
        """(...,) the same of other (..., 3) forces on this ground, N."""
        sides = np.abs(force[..., :2])
        return np.asarray(sides.max(axis=-1) if self.per_axis else np.hypot(sides[..., 0], sides[..., 1]))

    @property
    def used(self) -> Vector:
        """(...,) tangential force as a share of what friction allows: 1 on the cone, more outside.

        It is zero without contact, and infinite for any tangential force where there is no friction.
        """
        assert self.mu is not None
        bound, tangential = self.mu * self.normal, self.tangential
        share = np.divide(tangential, bound, out=np.full(bound.shape, np.inf), where=bound > 0.0)
        return np.where(self.touching & (tangential > 0.0), share, 0.0)
