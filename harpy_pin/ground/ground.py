"""Compliant ground with Stribeck friction (equations.md E1, E2), and where along the way it
changes.

**Normal force**: −k p_z − d ṗ_z where p_z ≤ 0, with d = 0 for ṗ_z > 0, and never below zero (E1).
**Friction** at rest is any force inside the cone; of a sliding foot it is against the motion, by
:func:`stribeck` (E2). :func:`harpy_pin.simulation.implicit_contact.contact_step` finds both at the
end of a step.

Friction and stiffness may change along x, on strips such as ice or foam. A foot feels those of its
place at the beginning of a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.ground.surface import TerrainRecord, flat_terrain
from harpy_pin.ground.terrain import STEEPEST, Plane, Terrain, read_terrain
from harpy_pin.kernels import kernel
from harpy_pin.model.catalogue import HARPY_FEET, HARPY_THRUSTERS
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

CONES = ("circular", "per_axis")
MAX_STIFFNESS = 1e9
"""N/m: a robot of 4 kg sinks by 40 nm."""
MAX_STRIPS = 16
"""Most strips of friction or of stiffness: kernels are compiled once for all grounds."""
_RATIO = 0.9
"""The paper's μ_c / μ_s."""
_STIFFNESS, _DAMPING = 8000.0, 268.3
"""Stiffness and damping of the paper's ground, N/m and N·s/m: a damping ratio of 0.71 under 4.5
kg.
"""
DEPTH, WALKING_DEPTH = 0.005, 0.002
"""How deep a robot at rest is in its ground, and how deep one point is that bears a walking robot
alone, m.
"""


class Unset(float):
    """A number that nobody has given: another robot's ground has its own."""


class GroundRecord(RecordOf):
    """Parameters of :class:`Ground`, and:"""

    stiffness: float
    damping: float
    mu_s: float
    mu_c: float
    mu_v: float
    stribeck_velocity: float
    per_axis: int  # 1 for that cone
    strips: int  # how many strips there are
    strip: Vector  # (16, 4) from and to, m, static and sliding coefficient of each
    soft_strips: int  # how many strips of another stiffness there are
    soft_strip: Vector  # (16, 3) from and to, m, and stiffness relative to the ground's
    terrain: TerrainRecord  # its surface


def _read_strips(
    name: str, strips: Any, *, of: str, most: float
) -> tuple[tuple[float, float, float], ...]:
    """Strips as plain numbers; see :class:`Ground` for what they must be."""

    def refuse(message: str, value: Any) -> InputError:
        return InputError(message, name=name, value=value)

    if not isinstance(strips, list | tuple):
        raise refuse(f"{name} must be a tuple of strips, got {shown(strips)}", strips)
    if len(strips) > MAX_STRIPS:
        raise refuse(f"a ground has at most {MAX_STRIPS} {name}, got {len(strips)}", strips)
    checked: list[tuple[float, float, float]] = []
    for strip in strips:
        if not isinstance(strip, list | tuple) or len(strip) != 3:
            raise refuse(f"a strip must be (from x, to x, {of}), got {shown(strip)}", strip)
        begin, end = (
            checks.number("from of a strip", strip[0]),
            checks.number("to of a strip", strip[1]),
        )
        value = checks.number(
            f"{of} of a strip", strip[2], low=0.0, high=most, strict=of == "stiffness"
        )
        if end <= begin:
            raise refuse(
                f"a strip must end behind its beginning, got {begin:g} to {end:g} m", strip
            )
        if checked and begin < checked[-1][1]:
            order = f"{begin:g} m lies before {checked[-1][1]:g} m"
            raise refuse(f"{name} must be in the order of x and apart: {order}", strip)
        checked.append((begin, end, value))
    return tuple(checked)


@dataclass(frozen=True, kw_only=True)
class Ground(checks.Checked):
    """Parameters of the ground, z = 0 where nothing else is said; defaults are equations.md §3.

    Attributes:
        stiffness: normal stiffness k, N/m, at most 1e9; the paper's by default, for Harpy's 4.5 kg,
            which scenarios of other robots replace by one that fits (:meth:`fitted`).
        damping: normal damping d while the foot goes down, N·s/m (undamped rebound). When not
            given, that of the paper's damping ratio: 268.3 √(k / 8000 N/m).
        mu_s: static friction coefficient, at most 10; the paper's 0.25 by default.
        mu_c: Coulomb (sliding) friction coefficient; 0.9 mu_s, the paper's ratio, when not given.
        mu_v: viscous friction, N·s/m.
        stribeck_velocity: σ of the transition from mu_s to mu_c, m/s.
        cone: ``circular`` (Coulomb's disc) or ``per_axis`` (x and y apart: a box, the paper's
            form).
        friction_strips: (from x, to x, static coefficient) of strips with another friction, m, in
            the order of x and apart from each other, at most 16. A strip holds its first x and not
            its last. Its sliding coefficient has the ground's ratio mu_c / mu_s (0.9 where mu_s is
            zero).
        stiffness_strips: (from x, to x, stiffness) of strips with another stiffness, N/m, at most
            16; they have the ground's damping ratio.
        slope: angle by which the ground rises along x, rad, at most 1.2: short for
            ``terrain=Plane(slope=...)``.
        terrain: its surface: one of :data:`harpy_pin.ground.terrain.TERRAINS`; flat where there is
            none.
    """

    stiffness: float = Unset(_STIFFNESS)
    damping: float | None = None
    mu_s: float = checks.setting(0.25, low=0.0, high=checks.MAX_FRICTION, called="friction mu_s")
    mu_c: float | None = checks.setting(None, called="friction mu_c")
    mu_v: float = checks.setting(0.85, low=0.0, called="viscous friction mu_v")
    stribeck_velocity: float = checks.setting(0.01, low=0.0, strict=True)
    cone: Literal["circular", "per_axis"] = checks.setting(
        "circular", checks.one_of, valid=CONES, called="friction cone"
    )
    friction_strips: tuple[tuple[float, float, float], ...] = checks.setting(
        (), _read_strips, of="friction", most=checks.MAX_FRICTION
    )
    stiffness_strips: tuple[tuple[float, float, float], ...] = checks.setting(
        (), _read_strips, of="stiffness", most=MAX_STIFFNESS
    )
    slope: float = checks.setting(0.0, low=-STEEPEST, high=STEEPEST)
    terrain: Terrain | None = checks.setting(None, lambda _, given: read_terrain(given))

    def __post_init__(self) -> None:
        super().__post_init__()
        stiffness = checks.number(
            "ground stiffness", self.stiffness, low=0.0, high=MAX_STIFFNESS, strict=True
        )
        if isinstance(self.stiffness, Unset):
            stiffness = self.stiffness
        damping = self.damping
        if damping is None:
            damping = type(stiffness)(_DAMPING * math.sqrt(stiffness / _STIFFNESS))
        elif not isinstance(damping, Unset):
            damping = checks.number("ground damping", damping, low=0.0)
        mu_c = _RATIO * self.mu_s if self.mu_c is None else self.mu_c
        checks.number("friction mu_c", mu_c, low=0.0, high=self.mu_s)
        checks.keep(self, stiffness=stiffness, damping=damping, mu_c=mu_c)
        if self.terrain is not None and self.slope != 0.0:
            raise InputError(
                "a ground has a slope or a terrain, not both: terrain=Plane(slope=...)",
                name="slope",
                value=self.slope,
            )

    @checked
    def fitted(self, robot: Robot, *, walks: bool) -> Ground:
        """The ground with stiffness and damping that fit a robot's weight, where none were given.

        Args:
            robot: that stands on it.
            walks: whether it walks. One that does not, on points, is 5 mm deep in the ground; on
                soles it would rock.
        """
        if not isinstance(self.stiffness, Unset) or (robot.feet, robot.thrusters) == (
            HARPY_FEET,
            HARPY_THRUSTERS,
        ):
            return self
        stiffness = robot.mass * GRAVITY / (max(len(robot.feet), 1) * DEPTH)
        if walks or robot.flat_feet:
            stiffness = walking_stiffness(robot)
        return replace(
            self,
            stiffness=stiffness,
            damping=None if isinstance(self.damping, Unset) else self.damping,
        )

    @property
    def surface(self) -> Terrain | None:
        """Its terrain, also where it was given as a slope; None for flat ground."""
        return Plane(slope=self.slope) if self.slope != 0.0 else self.terrain

    @property
    def record(self) -> Records[GroundRecord]:
        """The parameters, for kernels."""
        names = ("stiffness", "damping", "mu_s", "mu_c", "mu_v", "stribeck_velocity")
        numbers = {name: getattr(self, name) for name in names}
        surface = self.surface
        assert self.mu_c is not None
        ratio = self.mu_c / self.mu_s if self.mu_s > 0.0 else _RATIO
        strip, soft = np.zeros((MAX_STRIPS, 4)), np.zeros((MAX_STRIPS, 3))
        for row, (begin, end, mu) in zip(strip, self.friction_strips, strict=False):
            row[:] = begin, end, mu, ratio * mu
        for row, (begin, end, stiffness) in zip(soft, self.stiffness_strips, strict=False):
            row[:] = begin, end, stiffness / self.stiffness
        return make_record(
            GroundRecord,
            **numbers,
            per_axis=self.cone == "per_axis",
            strips=np.int64(len(self.friction_strips)),
            strip=strip,
            soft_strips=np.int64(len(self.stiffness_strips)),
            soft_strip=soft,
            terrain=flat_terrain() if surface is None else surface.record,
        )

    def to_dict(self) -> dict[str, Any]:
        """Names and values, the terrain's inside it, ready for JSON and exact."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        for name in ("friction_strips", "stiffness_strips"):
            values[name] = [list(strip) for strip in values[name]]
        if self.terrain is not None:
            values["terrain"] = self.terrain.to_dict()
        return values

    @checked
    def friction(self, x: ArrayLike) -> Vector:
        """Static friction coefficient of places on the ground.

        Args:
            x: of the places, m, of any shape.

        Returns:
            The coefficients, in that shape.
        """
        return _at_places(x, self.mu_s, self.friction_strips)

    @checked
    def stiffness_at(self, x: ArrayLike) -> Vector:
        """Stiffness of places on the ground, N/m.

        Args:
            x: of the places, m, of any shape.

        Returns:
            The stiffnesses, in that shape.
        """
        return _at_places(x, self.stiffness, self.stiffness_strips)


def _at_places(
    x: ArrayLike, usual: float, strips: tuple[tuple[float, float, float], ...]
) -> Vector:
    places = np.asarray(x, dtype=np.float64)
    found = np.full(places.shape, usual)
    for begin, end, value in strips:
        found[(begin <= places) & (places < end)] = value
    return found


@kernel
def local_friction(x: float, ground: GroundRecord) -> tuple[float, float]:
    """Static and sliding coefficient at a place x, m, for the element of :attr:`Ground.record`."""
    mu_s, mu_c = ground.mu_s, ground.mu_c
    for i in range(ground.strips):
        if ground.strip[i, 0] <= x < ground.strip[i, 1]:
            mu_s, mu_c = ground.strip[i, 2], ground.strip[i, 3]
    return mu_s, mu_c


@kernel
def local_stiffness(x: float, ground: GroundRecord) -> float:
    """Stiffness at a place x, m, relative to the ground's, for the element of
    :attr:`Ground.record`.
    """
    for i in range(ground.soft_strips):
        if ground.soft_strip[i, 0] <= x < ground.soft_strip[i, 1]:
            share: float = ground.soft_strip[i, 2]
            return share
    return 1.0


@kernel
def stribeck(speed: float, normal: float, mu_s: float, mu_c: float, ground: GroundRecord) -> float:
    """Magnitude of the friction on a foot sliding at ``speed``, N (equations.md E2)."""
    ratio = speed / ground.stribeck_velocity
    mu = mu_c + (mu_s - mu_c) * np.exp(-ratio * ratio)
    return float(mu * normal + ground.mu_v * speed)


def walking_stiffness(robot: Robot) -> float:
    """Stiffness of the ground on which a robot walks, N/m: a point that bears all of it is 2 mm
    deep.

    On softer ground soles rock at touchdown, and slip.

    Args:
        robot: any.
    """
    return robot.mass * GRAVITY / WALKING_DEPTH
