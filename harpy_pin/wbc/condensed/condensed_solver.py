"""The whole-body optimum as a program in the contact forces alone, solved in a bounded number of operations.

A tick eliminates the limbs (:mod:`harpy_pin.wbc.condensed.condense`), fills in the program in the contact forces
(:mod:`harpy_pin.wbc.condensed.force_program`), finds its optimum, and recovers thrusts and torques.
The last tick's active set is tried, then exchanged; then follows the dual
active-set method. At the end every force is put into its pyramid.

Where thrusts or torques of that optimum exceed their limits, which is rare, the program is solved again with thrusts
and free accelerations as unknowns (:mod:`harpy_pin.wbc.condensed.limits`), so that the result is the whole-body optimum
in this case, too. What gives way there is said in :mod:`harpy_pin.wbc.giving_way`.

For the rigid robot with regular limbs, at every state and for every target: with the torques and thrusts returned, the
force on each stance foot is f, and f is in its pyramid and range. The exception is reported in the status: torques that
were clipped, because the search found no force in the pyramids that the motors can reach.
"""

from __future__ import annotations

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Record, RecordOf, Records, field, make_record, same_layout, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import ActiveSetRecord, WarmStartedActiveSet
from harpy_pin.wbc.condensed.condense import (
    CondensationRecord,
    condensation_record,
    condensed_sizes,
    eliminate_limbs,
    joint_torques,
    recover,
    root_factor,
)
from harpy_pin.wbc.condensed.force_program import force_objective, into_cones, search_active_set
from harpy_pin.wbc.condensed.limits import limited_program
from harpy_pin.wbc.dual import DualActiveSet, DualRecord
from harpy_pin.wbc.giving_way import beyond_torque_limit, share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    ProblemRecord,
    desired_acceleration,
    enter_pyramids,
    force_bounds,
    friction_limits,
    friction_rows,
    problem_values,
)
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyLimits, WholeBodyTargets, WholeBodyWeights, check_terms

__all__ = ["CondensedSolver", "CondensedStatus", "condensed_record"]

AT_LIMIT = 1e-9
"""Distance below its limit, as a share of it, at which a torque counts as limited."""
BEYOND = 1e-6
"""Excess over its limit, as a share of it, that counts as rounding and not as clipped."""
SINGLE = {"AT_LIMIT": 1e-6, "BEYOND": 1e-3}
"""Constants that differ in single precision."""


class CondensedStatus(IntFlag):
    """How a tick ended; up to three it is the optimum."""

    OPTIMAL = 0
    THRUST_LIMITED = 1
    """A thrust is at its limit."""
    TORQUE_LIMITED = 2
    """A torque is at its limit."""
    SUBOPTIMAL = 4
    """The search for the active set ended at its bound; the forces were moved into their pyramids."""
    TORQUE_CLIPPED = 8
    """Torques were clipped: the forces that follow are not the ones intended."""


CLIPPED = int(CondensedStatus.TORQUE_CLIPPED)


class SearchRecord(RecordOf):
    """A program, and what searches its optimum."""

    program: ProgramRecord  # the quadratic program
    exchange: ActiveSetRecord  # the last active set and its exchange
    dual: DualRecord  # the dual method


class CondensedRecord(ProblemRecord):
    """Settings and work space of :class:`CondensedSolver`."""

    root: CondensationRecord  # the robot as six equations
    free: SearchRecord  # program on the forces alone
    limited: SearchRecord  # program on thrusts, free accelerations and forces, with rows for the torques
    least_share: Vector = sized("feet", fill=1.0)  # share of its least normal force that each foot has to bear
    swing_share: Vector = sized("feet", fill=1.0)  # share of its weight that each swing foot has at the motors' limits
    force: Vector = sized("3 feet")  # contact forces, world axes, N; zero in swing
    inputs: Vector = sized("thrusts + joints")  # [u; τ] of the last tick, N and N·m
    last_inputs: Vector = sized("thrusts + joints")  # those of the tick before
    response: Vector = sized(6, "3 feet")  # acceleration of the root per force
    desired: Vector = sized("nv")  # demanded generalised acceleration
    unknowns: Vector = sized("thrusts + others + 3 feet")  # of the program with limits, N and rad/s²
    wide_response: Vector = sized(6, "thrusts + others + 3 feet")  # acceleration of the root per unknown
    gain: Vector = sized("thrusts + joints", "thrusts + others + 3 feet")  # [u; τ] per unknown
    at_rest: Vector = sized("thrusts + joints")  # [u; τ] where the unknowns are zero
    # status of the last tick, and systems that were solved in it
    status_and_systems: NDArray[np.int64] = sized(2, whole=True)
    hold_ticks: int  # ticks in a row for which the last inputs are held in the place of clipped ones
    clipped: NDArray[np.int64] = sized(2, whole=True)  # ticks with clipped torques: all, and in a row


def condensed_record(
    robot: Robot, weights: WholeBodyWeights, limits: WholeBodyLimits, *, hold_ticks: float = 0
) -> Records[CondensedRecord]:
    """A new :class:`CondensedRecord`; arguments and errors as of :class:`CondensedSolver`.

    Args:
        robot: see there.
        weights: see there.
        limits: see there.
        hold_ticks: ticks in a row for which :func:`hold_last` gives the last inputs in the place of clipped ones.
    """
    feet, sizes = len(robot.feet), condensed_sizes(robot)
    return make_record(
        CondensedRecord,
        sizes,
        root=condensation_record(robot),
        free=_search_record(limits.pyramid, feet, bounded=0, more=0),
        limited=_search_record(
            limits.pyramid, feet, bounded=sizes["thrusts"] + sizes["others"], more=len(robot.joints)
        ),
        hold_ticks=np.int64(hold_ticks),
        **problem_values(robot, weights, limits),
    )


def _search_record(pyramid: Vector, feet: int, *, bounded: int, more: int) -> Records[SearchRecord]:
    """A program in the forces, after variables with bounds and before more rows, and what searches its optimum."""
    rows = len(pyramid) + 1
    program = QuadraticProgram(bounded + 3 * feet, equalities=0, inequalities=rows * feet + more, bounded=bounded)
    enter_pyramids(program, pyramid, feet, force=bounded)
    search = WarmStartedActiveSet(program, DualActiveSet(program))
    return make_record(SearchRecord, program=program.record, exchange=search.record, dual=search.dual.record)


@fixed_arrays("acceleration", "force", "inputs", "record")
class CondensedSolver(KeepsViews):
    """Contact forces, torques and thrusts of one tick in one call.

    Args:
        robot: with a limb of its own for each foot.
        weights: of the tasks; the posture's is not used: limbs have no free posture.
        limits: of the constraints; ``slack`` is not used.
        record: where everything is kept, a part of a larger record, made by :func:`condensed_record`.

    Attributes:
        force: (feet, 3) contact forces of the last tick, world axes, N; zero in swing.
        inputs: (thrust variables + joints,) [u; τ] of the last tick, N and N·m; see :mod:`harpy_pin.model.rotor`.
        acceleration: (nv,) generalised acceleration that follows.
        status: of the last tick.
        systems: linear systems solved in the last tick's search.

    Raises:
        InputError: another kind of robot.
    """

    _record_: Records[CondensedRecord]
    _inputs_: Vector

    @checked
    def __init__(
        self,
        robot: Robot,
        weights: WholeBodyWeights | None = None,
        limits: WholeBodyLimits | None = None,
        *,
        record: Record | None = None,
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights()
        self.limits = limits if limits is not None else WholeBodyLimits()
        own = condensed_record(robot, self.weights, self.limits)
        self.record = own if record is None else same_layout(record, own)
        self.force: Vector = field(self.record, "force").reshape(-1, 3)
        self.inputs: Vector = field(self.record, "inputs")
        self.acceleration: Vector = field(self.record["root"], "acceleration")
        self._outcome: NDArray[np.int64] = field(self.record, "status_and_systems")

    def reset(self) -> None:
        """Forget the active sets."""
        for search in ("free", "limited"):
            self.record[search]["exchange"]["active"] = 0

    @property
    def status(self) -> CondensedStatus:
        """Status of the last tick."""
        return CondensedStatus(int(self._outcome[0]))

    @property
    def systems(self) -> int:
        """Linear systems of the last tick's search."""
        return int(self._outcome[1])

    def solve(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> Vector:
        """One tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.

        Returns:
            (thrust variables + joints,) [u; τ]: the array :attr:`inputs` itself.

        Raises:
            InputError: terms or targets of another robot, or an array of another shape.
        """
        check_terms(self.robot, dynamics, targets)
        v = as_array("v", v, (self.robot.model.nv,))
        rotation = as_array("rotation", rotation, (3, 3))
        solve_condensed(dynamics._record_, targets._record_, self._record_, v, rotation)
        return self._inputs_


@kernel
def solve_condensed(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector, rotation: Vector) -> None:
    """One tick, on elements of the records; see :class:`CondensedSolver`."""
    e, qp = p.root, p.free.program
    p.status_and_systems[:] = 0
    for c in range(p.inputs.shape[0]):
        p.last_inputs[c] = p.inputs[c]
    desired_acceleration(v, rotation, t, p.desired)
    for i in range(6):
        e.desired[i] = p.desired[i]
    eliminate_limbs(d, t, p, e, v)
    root_factor(e)
    p.least_share[:] = 1.0
    if p.force.shape[0] > 0:
        force_bounds(t, p.pyramid.shape[0], qp.lower, qp.upper)
        force_objective(t, p, e, p.response, qp)
        friction_limits(t, p)
        friction_rows(p, qp, 0)
        search_active_set(p, p.free, p.force)
        into_cones(t, p)
    recover(e, p.force)
    thrusts = d.thruster_jacobian.shape[0]
    thrust, torque = e.free_acceleration[:thrusts], p.inputs[thrusts:]
    joint_torques(d, e, v, p.force, torque)
    if _outside(thrust, p.input_lower, p.input_upper) or beyond_torque_limit(torque, p.torque_limit):
        _within_limits(d, t, p, v)
    for c in range(thrusts):
        p.inputs[c] = thrust[c]


@kernel
def _outside(values: Vector, lower: Vector, upper: Vector) -> bool:
    """Whether one of the values is out of its range, or not finite."""
    found = False
    for c in range(values.shape[0]):
        found = found or not lower[c] <= values[c] <= upper[c]
    return found


@kernel
def _within_limits(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector) -> None:
    """The optimum with bounds on the thrusts and rows of the torques."""
    e, qp, y, thrusts = p.root, p.limited.program, p.unknowns, d.thruster_jacobian.shape[0]
    first, torque = thrusts + e.others.shape[0], p.inputs[thrusts:]
    p.swing_share[:] = 1.0
    if p.give_way < 1.0 and beyond_torque_limit(torque, p.torque_limit):
        for k in range(t.held.shape[0]):
            p.least_share[k] = share_of_least_force(d, torque, p.torque_limit, k)
            p.swing_share[k] = share_of_swing(d, torque, p.torque_limit, p.give_way, k)
    limited_program(d, t, p, v)
    search_active_set(p, p.limited, y)
    for c in range(thrusts):
        y[c] = min(max(y[c], qp.lower[c]), qp.upper[c])
        if y[c] <= p.input_lower[c] or y[c] >= p.input_upper[c]:
            p.status_and_systems[0] |= 1
    for c in range(p.force.shape[0]):
        p.force[c] = y[first + c]
    into_cones(t, p)
    for c in range(y.shape[0]):
        if c < first or t.held[(c - first) // 3] == 0.0:
            e.free_acceleration[c] = y[c]
            for i in range(6):
                e.right_hand_side[i] -= e.free_map[i, c] * y[c]
    recover(e, p.force)
    joint_torques(d, e, v, p.force, torque)
    _clip_torques(p, torque)


@kernel
def _clip_torques(p: CondensedRecord, torque: Vector) -> None:
    """Clip the torques; says in the status which limits are reached, and whether more than rounding was clipped."""
    for j in range(torque.shape[0]):
        limit = p.torque_limit[j]
        if not abs(torque[j]) <= limit * (1.0 - AT_LIMIT):
            p.status_and_systems[0] |= 2
        if not abs(torque[j]) <= limit:
            if not abs(torque[j]) <= limit * (1.0 + BEYOND):
                p.status_and_systems[0] |= 8
            torque[j] = min(max(torque[j], -limit), limit) if np.isfinite(torque[j]) else 0.0


@kernel
def hold_last(p: CondensedRecord) -> None:
    """The last inputs in the place of clipped torques, for a while."""
    if p.status_and_systems[0] & CLIPPED:
        p.clipped[0] += 1
        p.clipped[1] += 1
        if p.clipped[1] <= p.hold_ticks:
            p.inputs[:] = p.last_inputs
    else:
        p.clipped[1] = 0
