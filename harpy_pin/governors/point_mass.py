"""Reduced-order model: a point mass on a massless leg of variable length (paper, section ROM).

r = c − u runs from the centre of pressure u to the body c; L = |r|, r̂ = r/L; e = c_w − c, ė = ċ_w
− ċ. The contact force is along the leg, u_g = N r̂ (equations.md E3, E4, §2), and affine in the
applied reference w = [c_w; ċ_w].
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from harpy_pin import checks
from harpy_pin.governors.thrust import CentreGains, CentreGainsRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.record import Records, fields, make_record
from harpy_pin.model.state import Vector


class Law(IntEnum):
    """Which control law closes the loop around the model."""

    PROJECTED = 0
    """VLIP run: thrust tangential to the leg (Y = r̂ r̂ᵀ), leg force from u_r."""
    FULL = 1
    """3D run: Y = 0, u_r unused; the thrust also acts along the leg."""


class PointMassRecord(CentreGainsRecord):
    """The model and the control law that closes its loop."""

    mass: float  # m, kg
    g: float  # magnitude of gravity, m/s²
    law: int  # :class:`Law`


def model_record(
    *, mass: float, g: float, gains: CentreGains | None, law: Law
) -> Records[PointMassRecord]:
    """A new :class:`PointMassRecord`.

    Raises:
        InputError: mass or gravity is not positive.
    """
    return make_record(
        PointMassRecord,
        mass=checks.number("mass", mass, low=0.0, strict=True),
        g=checks.number("g", g, low=0.0, strict=True),
        law=np.int64(law),
        **fields((gains if gains is not None else CentreGains()).record),
    )


@kernel(r=(3,), c=(3,), c_dot=(3,), jacobian=(6,))
def axial_force(
    r: Vector, c: Vector, c_dot: Vector, model: PointMassRecord, jacobian: Vector
) -> float:
    """Axial contact force as an affine map of the reference, N(w) = J w + d (equations.md §2).

    Projected law: N = m (g r̂_z + k_pr r̂ᵀe + k_dr r̂ᵀė). Full law: N = m g r̂_z − r̂ᵀ(K_pt e +
    K_dt ė). J goes into ``jacobian``, N/m and N·s/m; d, N, is returned.
    """
    direction = r / np.maximum(np.sqrt(r @ r), 1e-12)  # a body on the foot has none
    if model.law == 0:
        jacobian[:3] = model.mass * model.k_pr * direction
        jacobian[3:] = model.mass * model.k_dr * direction
    else:
        jacobian[:3] = -model.k_pt * direction
        jacobian[3:] = -model.k_dt * direction
    return float(model.mass * model.g * direction[2] - jacobian[:3] @ c - jacobian[3:] @ c_dot)
