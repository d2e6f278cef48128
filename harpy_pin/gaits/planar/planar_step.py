"""One time step of the robot in the plane, for the many walks that a search needs.

The step of :mod:`harpy_pin.simulation.step` on the terms of :mod:`harpy_pin.gaits.planar.planar_model`, about ten times
as fast as
the simulator: no call leaves compiled code.
"""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.gaits.planar.planar_model import NV, PlanarModelRecord, planar_terms
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector
from harpy_pin.simulation.ground import GroundRecord
from harpy_pin.simulation.step import StepRecord, implicit_step

__all__ = ["planar_step"]


@kernel(q=(7,), v=(7,), torque=(4,), thrust=(3,))
def planar_step(
    q: Vector,
    v: Vector,
    torque: Vector,
    thrust: Vector,
    model: Records[PlanarModelRecord],
    ground: Records[GroundRecord],
    step: Records[StepRecord],
) -> int:
    """One time step, implicit in the contact, in place.

    Args:
        q: (7,) configuration, in and out.
        v: (7,) velocity, in and out.
        torque: (4,) joint torques, N·m.
        thrust: (3,) sum of the thrusts, world axes, N.
        model: a copy of :attr:`~harpy_pin.gaits.planar.planar_model.PlanarModel.record`; out: terms at the start of the
            step.
        ground: :attr:`harpy_pin.simulation.ground.Ground.record`.
        step: see :func:`harpy_pin.simulation.step.step_record`.

    Returns:
        Sweeps of the contact solver, see :func:`harpy_pin.simulation.step.implicit_step`.
    """
    planar_terms(q, v, model[0])
    sweeps = implicit_step(model, ground, step, v, torque, thrust)
    for i in range(NV):
        q[i] += step[0].displacement[i]
    return int(sweeps)
