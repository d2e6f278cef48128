"""Physics steps of a control tick, in one compiled call."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.log.slip import note_slip, note_slip_along
from harpy_pin.model.dynamics import DynamicsRecord, update_terms
from harpy_pin.model.entry import all_finite, all_finite_rows
from harpy_pin.model.rotor import read_thrusts
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import integrate
from harpy_pin.simulation.actuators import drive_motors
from harpy_pin.simulation.battery import draw, share_of_thrust
from harpy_pin.simulation.step import MAX_SWEEPS, StepRecord, implicit_step
from harpy_pin.simulation.thrusters import drive_thrusters

if TYPE_CHECKING:
    from harpy_pin.ground.ground import GroundRecord

__all__ = ["MISFIT_COMMAND", "physics_steps"]

MISFIT_COMMAND = -1


@kernel
def physics_steps(
    d: DynamicsRecord,
    ground: GroundRecord,
    s: StepRecord,
    q: Vector,
    v: Vector,
    torque: Vector,
    thrust: Vector,
    push: Vector,
) -> int:
    """A physics step for each row of ``push``, the force on the body's origin; the command stays meanwhile.

    Returns:
        Sweeps of the last contact problem; ``MISFIT_COMMAND``, with nothing done, for a command of the wrong size or
        one that is no number.
    """
    thrusters = d.body.shape[0] - d.foot_position.shape[0]
    if torque.shape[0] != v.shape[0] - 6 or thrust.shape[0] != thrusters or thrust.shape[1] != 3:
        return MISFIT_COMMAND
    if not (all_finite(torque) and all_finite_rows(thrust)):
        return MISFIT_COMMAND
    sweeps = 0
    s.counts[2] += read_thrusts(d, thrust, s.thrust)
    for n in range(push.shape[0]):
        for i in range(3):
            for c in range(3):
                d.bias[i] -= d.tree.rotation[c, i] * push[n, c]
        drive_motors(s.motors, torque, v, s.dt)
        drive_thrusters(s.thrusters, d.tree.rotation, s.thrust)
        if s.battery.on:
            draw(s.battery, s.motors, s.thrusters, v, s.dt)
            s.thrusters.available = share_of_thrust(s.battery)
        sweeps = implicit_step(d, ground, s, v, s.motors.mean_torque, s.thrusters.mean_thrust)
        s.counts[0] = max(s.counts[0], sweeps)
        s.counts[1] += sweeps > MAX_SWEEPS
        integrate(d.tree, q, s.displacement)
        update_terms(d, q, v)
        if ground.terrain.level:
            note_slip(s.slip, d.foot_position, s.force, s.dt)
        else:
            note_slip_along(s.slip, s.frame, d.foot_position, s.force, s.dt)
    return sweeps
