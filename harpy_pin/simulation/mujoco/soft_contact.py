"""MuJoCo's contact as its users set it: soft, relative to an inverse mass that MuJoCo estimates,
and with a creep.

**Source**: MuJoCo's documentation, chapters *Computation* (Constraint model, Parameters) and
*Modeling* (Solver parameters, Friction, Solver settings). With the impedance d(r), the inverse mass
A and the time constant τ, ratio ζ

    R = (1 − d) / d · A,   b = 2 / (d_w τ),   k = d / (d_w τ ζ)²

and a constraint that carries a force reads a + b v + k r + R f = 0, a friction constraint with k =
0 and R_t = R / impratio. **At rest** (a = v = 0) the ground is a spring f = −k r / R. **Creep**: a
foot inside the cone that does not accelerate moves with v = −R_t f_t / b, however small the
tangential force is.

**Pyramid**: the four edges n ± μ t have A (1 + μ²) in the place of A, and 2 μ² R_t each. They share
a load: f = −2 k r / (μ² R_t). Up to half of the friction, μ f_n / 2 along an axis, two edges across
creep as a cone does; beyond, one of them is free, and the foot moves with (R_t / b) (3 f_t − μ
f_n).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.model.state import Vector

LEAST, MOST = 1e-4, 0.9999  # impedances that MuJoCo takes
SMALLEST = 1e-15  # square of a friction coefficient
HALVINGS = 60
POSITIVE: dict[str, Any] = {"check": checks.fixed_vector, "low": 0.0, "strict": True}


@dataclass(frozen=True, kw_only=True)
class SoftContact(checks.Checked):
    """Settings of MuJoCo's contact by their names there; by default its own defaults.

    Attributes:
        solref: time constant, s, and damping ratio.
        solimp: impedance on touching and from ``width`` on, width in m, midpoint and power of the
            curve between.
        cone: ``pyramidal`` or ``elliptic``.
        impratio: of the regularisation of the normal force to that of friction.
        tolerance: of Newton's solver.
    """

    solref: tuple[float, float] = checks.setting((0.02, 1.0), **POSITIVE, size=2)
    solimp: tuple[float, float, float, float, float] = checks.setting(
        (0.9, 0.95, 0.001, 0.5, 2.0), **POSITIVE, size=5
    )
    cone: Literal["pyramidal", "elliptic"] = checks.setting(
        "pyramidal", checks.one_of, valid=("pyramidal", "elliptic")
    )
    impratio: float = checks.setting(1.0, low=0.0, strict=True)
    tolerance: float = checks.setting(1e-8, low=0.0)

    @checked
    def impedance(self, depth: ArrayLike) -> Vector:
        """The impedance d at depths in m, of any shape."""
        first, last = (min(max(end, LEAST), MOST) for end in self.solimp[:2])
        width, midpoint, power = self.solimp[2:]
        x = np.minimum(np.abs(checks.array("depth", depth, None)) / width, 1.0)
        low = x**power / midpoint ** (power - 1.0)
        high = 1.0 - (1.0 - x) ** power / (1.0 - midpoint) ** (power - 1.0)
        d: Vector = first + np.where(x <= midpoint, low, high) * (last - first)
        return d

    @property
    def damping_rate(self) -> float:
        """b, 1/s: a foot that lands with a tangential velocity loses it at this rate."""
        return 2.0 / (self._last * self.solref[0])

    @checked
    def normal_force(self, depth: float, *, inverse_mass: float, friction: float) -> float:
        """Normal force of a foot at rest, N.

        Args:
            depth: of the foot, m.
            inverse_mass: MuJoCo's own estimate for the foot's body, ``body_invweight0``, 1/kg.
            friction: coefficient of the contact.
        """
        depth, inverse_mass, friction = _checked(
            depth=depth, inverse_mass=inverse_mass, friction=friction
        )
        pull = (
            float(self.impedance(depth))
            * depth
            / (self._last * self.solref[0] * self.solref[1]) ** 2
        )
        return pull / self._held(depth, inverse_mass, friction)

    @checked
    def ground(self, load: float, *, inverse_mass: float, friction: float) -> tuple[float, float]:
        """Stiffness, N/m, of the depth at which a foot rests under a load, and damping there,
        N·s/m.

        Args:
            load: N.
            inverse_mass: MuJoCo's own estimate for the foot's body, ``body_invweight0``, 1/kg.
            friction: coefficient of the contact.
        """
        load, inverse_mass, friction = _checked(
            load=load, inverse_mass=inverse_mass, friction=friction
        )
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            depth = 0.5 * (low + high)
            if self.normal_force(depth, inverse_mass=inverse_mass, friction=friction) < load:
                low = depth
            else:
                high = depth
        return load / high, self.damping_rate / self._held(high, inverse_mass, friction)

    @property
    def _last(self) -> float:
        return min(max(self.solimp[1], LEAST), MOST)

    @checked
    def regularisation(self, depth: ArrayLike, inverse_mass: ArrayLike, friction: float) -> Vector:
        """R of the normal force of a cone, 1/kg; of a pyramid with the inverse mass of its
        edges.
        """
        friction = checks.number("friction", friction, low=0.0, high=checks.MAX_FRICTION)
        d = self.impedance(depth)
        edge = 1.0 if self.cone == "elliptic" else 1.0 + friction * friction
        r: Vector = (1.0 - d) / d * np.asarray(inverse_mass, dtype=np.float64) * edge
        return r

    def _held(self, depth: float, inverse_mass: float, friction: float) -> float:
        """R of a load, which the four edges of a pyramid share."""
        share = (
            1.0 if self.cone == "elliptic" else max(friction**2, SMALLEST) / (2.0 * self.impratio)
        )
        return float(self.regularisation(depth, inverse_mass, friction)) * share


def write_contact(contact: SoftContact, mujoco: Any, model: Any) -> None:
    """Set a model's contact pairs and options."""
    model.pair_solref[:], model.pair_solimp[:] = contact.solref, contact.solimp
    model.pair_solreffriction[:] = 0.0  # as the normal's
    elliptic = contact.cone == "elliptic"
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC if elliptic else mujoco.mjtCone.mjCONE_PYRAMIDAL
    model.opt.impratio, model.opt.tolerance = contact.impratio, contact.tolerance


def _checked(**values: float) -> tuple[float, ...]:
    """Numbers that are not negative, by their names."""
    return tuple(checks.number(name, value, low=0.0) for name, value in values.items())


CONTACTS = {
    "default": SoftContact(),
    "elliptic": SoftContact(cone="elliptic", impratio=100.0, tolerance=1e-10),
    "menagerie": SoftContact(solimp=(0.015, 1.0, 0.031, 0.5, 2.0), cone="elliptic", impratio=100.0),
}
"""``default``: MuJoCo's own settings, untouched (*Modeling*, Solver parameters: solref 0.02 1,
solimp 0.9 0.95 0.001 0.5 2; pyramid and impratio 1 of ``<option>``). ``elliptic``: those, with what
*Modeling* (Solver settings) advises where slip is a problem: elliptic cones, a large impratio, a
very small tolerance. ``menagerie``: the feet of Go2, A1 and ANYmal C in MuJoCo Menagerie
(``solimp="0.015 1 0.031"``, ``cone="elliptic" impratio="100"``), without their friction against
turning and rolling; their spheres have 20 to 30 mm.
"""


PRESETS = {
    "soft": (1.0, 1.0),
    "overdamped": (1.0, 2.0 * math.sqrt(2.0)),
    "stiff": (10.0, math.sqrt(10.0)),
}
"""Factors on the stiffness and the damping of a ground.

``soft``: the ground's own, by default 8 kN/m and 268 N·s/m. ``overdamped``: a damping ratio of 2 in
the place of 0.71, 759 N·s/m. ``stiff``: ten times as stiff with the same damping ratio, 80 kN/m and
848 N·s/m.
"""
DEFAULT_PRESET = "soft"


@checked
def preset_ground(ground: Ground, name: str | None = None) -> Ground:
    """The ground with the stiffness and damping of a preset.

    Args:
        ground: that the factors apply to.
        name: one of :data:`PRESETS`, :data:`DEFAULT_PRESET` by default; one of
            :data:`harpy_pin.simulation.mujoco.CONTACTS`, whose stiffness is not the ground's,
            leaves it as it is.

    Raises:
        InputError: unknown name, or a friction cone that MuJoCo does not have.
    """
    name = DEFAULT_PRESET if name is None else name
    checks.one_of("plant preset", name, (*PRESETS, *CONTACTS))
    if ground.cone != "circular":
        raise InputError(
            "MuJoCo's friction cone is circular, not per_axis",
            name="friction cone",
            value=ground.cone,
        )
    if name in CONTACTS:
        return ground
    stiffness, damping = PRESETS[name]
    assert ground.damping is not None
    strips = tuple((begin, end, stiffness * value) for begin, end, value in ground.stiffness_strips)
    return replace(
        ground,
        stiffness=stiffness * ground.stiffness,
        damping=damping * ground.damping,
        stiffness_strips=strips,
    )
