"""Physics steps of a robot in contact, implicit in the contact forces, and whether it stands after
them.

A step solves (M + dt B)(v⁺ − v) = dt (S τ + J_tᵀ u_t − n − B v + J_fᵀ f) together with the ground's
equations for f at the end of the step (:func:`harpy_pin.simulation.contact_step`; of flat feet,
:mod:`harpy_pin.simulation.sole_contact`). B is the joint damping. Coulomb friction in the joints,
where there is any, is found with them (:mod:`harpy_pin.simulation.implicit_contact`). The velocity
of a foot includes ½ dt J̇ v, so that a foot at rest stays where it is to third order in dt.

On ground that is not flat motion and force of every foot are in the frame of its contact. There the
third axis is the normal, so that the equations hold unchanged: penetration and normal force along
the normal, friction in the tangent plane. A foot feels the tangent plane below it at the beginning
of the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.ground.contact_frame import contact_frame, to_contact, to_worlds
from harpy_pin.ground.ground import GroundRecord, local_friction, local_stiffness
from harpy_pin.ground.surface import TerrainRecord, surface_height, surface_normal
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.log.slip import SlipRecord, note_slip
from harpy_pin.model.cholesky import add_gram, factorise, mirror, solve_factor, solve_transposed
from harpy_pin.model.contact_map import unconstrained_drive
from harpy_pin.model.dynamics import DynamicsRecord, EquationsRecord
from harpy_pin.model.entry import all_finite
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import integrate, read_thrusts, update_terms
from harpy_pin.simulation.actuators import Actuators, MotorsRecord, drive_motors, motors_record
from harpy_pin.simulation.implicit_contact import (
    JointFrictionRecord,
    contact_forces,
    step_with_friction,
)
from harpy_pin.simulation.joint_ends import JointEndsRecord, hold_at_ends, joint_ends_record
from harpy_pin.simulation.sole_contact import SolesRecord, sole_columns, turn_modes
from harpy_pin.simulation.thrusters import ThrustersRecord, drive_thrusters, thrusters_record

MIN_MOBILITY = 1e-9
"""Least inverse mass of a foot in any direction, 1/kg: a planar model cannot move its feet sideways
at all.
"""
MAX_SWEEPS = 500  # limit of the contact solver's iteration
MISFIT_COMMAND = -1  # what :func:`physics_steps` returns for a command that it refuses
Kind = TypeVar("Kind", bound="PlantRecord")
VERDICTS = ("completed", "fell", "diverged")  # how a run ends, by what :func:`stands` returns


class PlantRecord(RecordOf):
    """What every plant keeps of contact and actuators."""

    force: Vector = sized(
        "3 feet"
    )  # (3 feet,) contact forces, world axes, N: guess in, forces of the step out
    # (3,) most sweeps of the contact solver in a step so far, steps in which they ran out, and
    # commands of one tick to
    # a rotor that it could not carry out as given
    counts: NDArray[np.int64] = sized(3, whole=True)
    slip: SlipRecord  # paths of the feet on the ground
    # (feet, 3, 3) of each contact, see :mod:`harpy_pin.ground.contact_frame`; unused on flat ground
    frame: Vector = sized("feet", 3, 3)
    thrust: Vector = sized("thrusts")  # (thrusts,) thrust variables of the command, N
    motors: MotorsRecord  # between command and torques
    thrusters: ThrustersRecord  # between command and thrusts


class StepRecord(PlantRecord):
    """What :func:`implicit_step` knows and works in."""

    dt: float  # step, s
    displacement: Vector = sized("nv")  # (nv,) out: dt v⁺
    # (contacts, contacts) change of foot velocity, or of a sole's modes, per newton over the step,
    # m/s/N
    mobility: Vector = sized("contacts", "contacts")
    free: Vector = sized("contacts")  # (contacts,) these velocities without contact forces, m/s
    load: Vector = sized(
        "contacts"
    )  # (contacts,) out: forces on the columns, N; of point feet the contact forces
    height: Vector = sized("feet")  # (feet,) of the feet at the start of the step, m
    # (feet, 3) static and sliding coefficient under them, then, and stiffness relative to the
    # ground's
    friction: Vector = sized("feet", 3)
    factor: Vector = sized("nv", "nv")  # (nv, nv) L of M + dt B = Lᵀ L
    columns: Vector = sized(
        "nv", "contacts + 1"
    )  # (nv, contacts + 1) L⁻ᵀ [J_fᵀ, dt (generalised force)]
    joints: JointFrictionRecord  # Coulomb friction of the joints
    soles: SolesRecord  # empty for point feet
    ends: JointEndsRecord  # of the joints


def plant_record(
    kind: type[Kind],
    sizes: Mapping[str, int],
    actuators: Actuators,
    step: float,
    motors: Mapping[str, Any],
    **own: ArrayLike,
) -> Records[Kind]:
    """A new record of a plant, with the sizes that a robot has and its motors, see
    :func:`motors_record`.

    A step is in s; ``own`` are the fields that a :class:`PlantRecord` does not have.
    """
    thrusters = {"count": sizes["thrusters"], "variables": sizes["thrusts"]}
    return make_record(
        kind,
        sizes,
        slip=make_record(SlipRecord, sizes),
        motors=motors_record(actuators, **motors),
        thrusters=thrusters_record(actuators.thrusters, **thrusters, dt=step),
        **own,
    )


def step_record(
    sizes: Mapping[str, int],
    *,
    dt: float,
    actuators: Actuators | None = None,
    motors: Mapping[str, Any] | None = None,
    friction: Vector | None = None,
    robot: Robot | None = None,
) -> Records[StepRecord]:
    """A new :class:`StepRecord`, see :func:`plant_record`; by default of a model without motors and
    thrusters.

    ``friction`` (joints,) is the Coulomb friction of each joint, N·m, with that of passive joints
    at the end. The joints of ``robot`` have
    ends.
    """
    sizes = {"thrusts": 0, "thrusters": 0, "soles": 0, **sizes}
    actuators, flat = Actuators() if actuators is None else actuators, sizes["soles"] > 0
    sizes |= {
        "contacts": 6 * sizes["soles"] if flat else 3 * sizes["feet"],
        "corners": sizes["feet"] if flat else 0,
    }
    limit = friction if friction is not None and friction.any() else np.zeros(0)
    joints = make_record(
        JointFrictionRecord,
        {**sizes, "joints": len(limit)},
        limit=limit,
        motion=np.eye(sizes["nv"], len(limit), -6),
    )
    motors = {"peak": np.zeros(0)} if motors is None else motors
    soles = make_record(SolesRecord, sizes)
    ends = joint_ends_record(robot, dt)
    return plant_record(
        StepRecord, sizes, actuators, dt, motors, dt=dt, joints=joints, soles=soles, ends=ends
    )


@kernel
def implicit_step(
    d: EquationsRecord,
    ground: GroundRecord,
    s: StepRecord,
    v: Vector,
    torque: Vector,
    thrust: Vector,
) -> int:
    """Contact forces, velocity v at the end of the step and displacement dt v⁺.

    Args:
        d: of :class:`~harpy_pin.model.dynamics.Dynamics`, at the start of the step.
        ground: of :class:`~harpy_pin.ground.ground.Ground`.
        s: see :func:`step_record`.
        v: (nv,) generalised velocity, in and out.
        torque: (joints,) N·m.
        thrust: (thrust variables,) see :mod:`harpy_pin.model.rotor`, N.

    Returns:
        Sweeps of the contact solver, ``MAX_SWEEPS + 1`` if they did not converge.
    """
    dt, nv, nc = s.dt, v.shape[0], s.free.shape[0]
    columns, mobility, free, force = s.columns, s.mobility, s.free, s.force
    change = s.displacement  # holds the generalised force, then v⁺ − v
    unconstrained_drive(d, v, torque, thrust, change)
    s.factor[:] = d.mass_matrix
    diagonal(s.factor)[:] += dt * d.damping
    columns[:, nc] = dt * change
    flat = ground.terrain.level
    if not flat:
        into_contact_frames(d, ground.terrain, s)
    if (
        s.soles.motion.shape[0] > 0
    ):  # known when compiling: of point feet and of soles there is one kernel each
        sole_columns(d, s, v)
        if not flat:
            turn_modes(s.frame, s.soles.mode)
    else:
        point_columns(d, s, v, flat)
    factorise(s.factor, s.factor)
    solve_transposed(s.factor, columns, nc + 1)
    # Velocity of the feet without contact forces, and its change per force.
    mobility[:] = 0.0
    add_gram(columns[:, :nc], columns[:, nc], mobility, free)
    diagonal(mobility)[:] = np.maximum(diagonal(mobility), MIN_MOBILITY)
    mobility *= dt
    mirror(mobility)
    if flat:
        s.height[:] = d.foot_position[:, 2]
    for k in range(s.height.shape[0]):
        x = d.foot_position[k, 0]
        s.friction[k] = *local_friction(x, ground), local_stiffness(x, ground)
    if (
        s.joints.limit.shape[0] > 0
    ):  # known when compiling: without friction the other kernel is not there
        sweeps = step_with_friction(s, ground, v, 1e-10, MAX_SWEEPS)
    else:
        sweeps = contact_forces(s, ground, free, 1e-10, MAX_SWEEPS)
    change[:] = columns[:, nc] + dt * (columns[:, :nc] @ s.load)
    if not flat:
        to_worlds(s.frame, force.reshape((s.height.shape[0], 3)))
    solve_factor(s.factor, change.reshape((nv, 1)), 1)
    v += change
    s.displacement[:] = dt * v
    return sweeps


@kernel
def into_contact_frames(d: EquationsRecord, t: TerrainRecord, s: StepRecord) -> None:
    """Contact frames, heights in them, and the forces guessed, from world axes into them."""
    for k in range(s.height.shape[0]):
        place, frame = d.foot_position[k], s.frame[k]
        nx, ny, nz = surface_normal(t, place[0], place[1])
        contact_frame(nx, ny, nz, frame)
        s.height[k] = (place[2] - surface_height(t, place[0], place[1])) * nz
        to_contact(frame, s.force[3 * k : 3 * k + 3])


@kernel
def point_columns(d: EquationsRecord, s: StepRecord, v: Vector, flat: bool) -> None:
    """Columns of the feet's Jacobian, and their velocities before any force, in the contact
    frames.
    """
    for k in range(s.height.shape[0]):
        x, jacobian = 3 * k, d.foot_jacobian[3 * k : 3 * k + 3]
        s.free[x : x + 3] = 0.5 * s.dt * d.foot_drift[x : x + 3] + jacobian @ v
        s.columns[:, x : x + 3] = jacobian.T
        if not flat:
            to_contact(s.frame[k], s.free[x : x + 3])
            s.columns[:, x : x + 3] = jacobian.T @ s.frame[k]


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
    """A physics step for each row of ``push``, the force on the body's origin; the command stays
    meanwhile.

    Returns:
        Sweeps of the last contact problem; ``MISFIT_COMMAND``, with nothing done, for a command of
        the wrong size or one whose numbers are not finite.
    """
    thrusters = d.body.shape[0] - d.foot_position.shape[0]
    if torque.shape[0] != v.shape[0] - 6 or thrust.shape[0] != thrusters or thrust.shape[1] != 3:
        return MISFIT_COMMAND
    if not (all_finite(torque) and all_finite(thrust.reshape((thrust.size,)))):
        return MISFIT_COMMAND
    sweeps = 0
    s.counts[2] += read_thrusts(d, thrust, s.thrust)
    for n in range(push.shape[0]):
        d.bias[:3] -= d.tree.rotation.T @ push[n]
        hold_at_ends(s.ends, q, v, d.bias)
        if d.tree.loops.start.shape[0] > 0 and s.joints.limit.shape[0] > 0:
            s.joints.motion[6:] = d.tree.loops.spread.T
        drive_motors(s.motors, torque, q, v, s.dt)
        drive_thrusters(s.thrusters, d.tree.rotation, s.thrust)
        sweeps = implicit_step(d, ground, s, v, s.motors.mean_torque, s.thrusters.mean_thrust)
        s.counts[0] = max(s.counts[0], sweeps)
        s.counts[1] += sweeps > MAX_SWEEPS
        integrate(d.tree, q, s.displacement)
        update_terms(d, q, v)
        note_slip(s.slip, ground.terrain.level, s.frame, d.foot_position, s.force, s.dt)
    return sweeps


@kernel
def stands(terrain: TerrainRecord, q: Vector, v: Vector, fall_height: float) -> int:
    """:func:`upright`, with the height above the ground below the body."""
    return upright(q, v, fall_height + surface_height(terrain, q[0], q[1]))


@kernel
def upright(q: Vector, v: Vector, fall_height: float) -> int:
    """0 for a body that stands, 1 for one that fell, 2 for one whose velocity is not finite or
    beyond reason.
    """
    if not np.sum(np.abs(v)) <= 1e4:
        return 2
    return 1 if q[2] < fall_height or 1.0 - 2.0 * (q[3] * q[3] + q[4] * q[4]) < 0.5 else 0
