"""The cones of the forces: a pyramid inscribed in Coulomb's disc, or the disc itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.record import Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.active_set import search_active_set
from harpy_pin.wbc.condensed.disc import search_in_discs
from harpy_pin.wbc.problem import PyramidRecord, friction_limits
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyLimits

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.condensed_record import CondensedRecord, SearchRecord

__all__: list[str] = []


class ConesRecord(PyramidRecord):
    """The cones of all feet, with the directions and curvatures of the last tick.

    Attributes:
        disc: 1 for Coulomb's cone itself.
        direction: (feet,) angle of the face that touches the disc where the force is, rad.
        curvature: (feet,) of the disc there times its multiplier.
        block: (feet, 3) xx, xy, yy of the Hessian without curvature.
        least_share: (feet,) share of its least normal force that each foot has to carry.
        swing_share: (feet,) share of its weight that each swing foot has at the motors' limits.
    """

    disc: int
    direction: Vector = sized("feet")
    curvature: Vector = sized("feet")
    block: Vector = sized("feet", 3)
    least_share: Vector = sized("feet", fill=1.0)
    swing_share: Vector = sized("feet", fill=1.0)


def cones_record(limits: WholeBodyLimits, feet: int) -> Records[ConesRecord]:
    """A new :class:`ConesRecord`."""
    pyramid = limits.pyramid
    return make_record(
        ConesRecord,
        {"feet": feet},
        pyramid=np.tile(pyramid, (feet, 1, 1)),
        disc=limits.cone == "disc",
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
def search_in_cones(t: TargetsRecord, p: CondensedRecord, search: SearchRecord, z: Vector) -> None:
    """The optimum of a program whose last variables are the forces.

    Args:
        t: element of the targets' record.
        p: of the controller's record; its status is updated.
        search: the program, and what searches its optimum.
        z: out.
    """
    if p.cones.disc:
        search_in_discs(t, p, search, z)
    else:
        search_active_set(p, search, z)


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
        if c.disc:
            length, limit = np.hypot(f[0], f[1]), max(c.friction[k] * f[2], 0.0)
            if length > limit:
                share = limit / length
        else:
            for r in range(c.pyramid.shape[1]):
                outward = -(c.pyramid[k, r, 0] * f[0] + c.pyramid[k, r, 1] * f[1])
                inside = c.pyramid[k, r, 2] * f[2]
                if outward * share > inside:
                    share = max(inside, 0.0) / outward
        f[0] *= share
        f[1] *= share
