"""The cones of the forces: a pyramid inscribed in Coulomb's disc for each foot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.record import Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.problem import PyramidRecord, friction_limits
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyLimits

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.condensed_record import CondensedRecord

__all__: list[str] = []


class ConesRecord(PyramidRecord):
    """The cones of all feet.

    Attributes:
        least_share: (feet,) share of its least normal force that each foot has to carry.
        swing_share: (feet,) share of its weight that each swing foot has at the motors' limits.
    """

    least_share: Vector = sized("feet", fill=1.0)
    swing_share: Vector = sized("feet", fill=1.0)


def cones_record(limits: WholeBodyLimits, feet: int) -> Records[ConesRecord]:
    """A new :class:`ConesRecord`."""
    pyramid = limits.pyramid
    return make_record(
        ConesRecord,
        {"feet": feet},
        pyramid=np.tile(pyramid, (feet, 1, 1)),
        mu=limits.mu,
        friction_share=limits.friction_share,
        inscribed=limits.inscribed,
        friction=np.full(feet, limits.friction_share * limits.mu),
    )


@kernel
def fit_cones(t: TargetsRecord, p: CondensedRecord) -> None:
    """The cones of this tick from each foot's friction, and their rows in the program on forces alone."""
    c, qp = p.cones, p.free.program
    friction_limits(t, c)
    faces = c.pyramid.shape[1]
    for k in range(c.friction.shape[0]):
        up = c.friction[k] * c.inscribed
        c.least_share[k] = 1.0
        for r in range(faces):
            c.pyramid[k, r, 2] = qp.inequality[(faces + 1) * k + r, 3 * k + 2] = up


@kernel
def into_cones(t: TargetsRecord, p: CondensedRecord) -> None:
    """Put every force into its range and cone: it changes only what is outside, and little after a good search."""
    c = p.cones
    for k in range(t.held.shape[0]):
        f = p.force[3 * k : 3 * k + 3]
        if t.held[k] == 0.0:
            f[:] = 0.0
            continue
        f[2] = min(max(f[2], c.least_share[k] * t.force_range[k, 0]), t.force_range[k, 1])
        share = 1.0
        for r in range(c.pyramid.shape[1]):
            outward = -(c.pyramid[k, r, 0] * f[0] + c.pyramid[k, r, 1] * f[1])
            inside = c.pyramid[k, r, 2] * f[2]
            if outward * share > inside:
                share = max(inside, 0.0) / outward
        f[0] *= share
        f[1] *= share
