"""What the condensed solver knows, is given and works in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import ActiveSetRecord, WarmStartedActiveSet
from harpy_pin.wbc.condensed.condense import CondensationRecord, condensation_record, condensed_sizes
from harpy_pin.wbc.condensed.cones import ConesRecord, cones_record
from harpy_pin.wbc.dual import DualActiveSet, DualRecord
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram
from harpy_pin.wbc.weights import TaskWeightsRecord, WholeBodyLimits, WholeBodyWeights, thrust_box

__all__ = ["CondensedRecord", "SearchRecord", "condensed_record"]


class CondensedRecord(TaskWeightsRecord):
    """Settings and work space of :class:`CondensedSolver`.

    Attributes:
        root: the robot as six equations.
        cones: of the forces.
        free: program on the forces alone.
        limited: program on thrusts, free accelerations and forces, with rows for the torques.
        thrust_lower: (thrust variables,) N.
        thrust_upper: (thrust variables,) N.
        force: (3 feet,) contact forces, world axes, N; zero in swing.
        inputs: (thrust variables + joints,) [u; τ] of the last tick, N and N·m; see :mod:`harpy_pin.model.rotor`.
        last_inputs: (thrust variables + joints,) those of the tick before.
        response: (6, 3 feet) acceleration of the root per force.
        desired: (nv,) demanded generalised acceleration.
        unknowns: (thrust variables + others + 3 feet,) of the program with limits, N and rad/s².
        wide_response: (6, thrust variables + others + 3 feet) acceleration of the root per unknown.
        gain: (thrust variables + joints, thrust variables + others + 3 feet) [u; τ] per unknown.
        at_rest: (thrust variables + joints,) [u; τ] where the unknowns are zero.
        status_and_systems: (2,) status of the last tick, and systems that were solved in it.
        hold_ticks: ticks in a row for which the last inputs are held in the place of clipped ones.
        clipped: (2,) ticks with clipped torques: all, and in a row.
    """

    root: CondensationRecord
    cones: ConesRecord
    free: SearchRecord
    limited: SearchRecord
    thrust_lower: Vector
    thrust_upper: Vector
    force: Vector = sized("3 feet")
    inputs: Vector = sized("thrusts + joints")
    last_inputs: Vector = sized("thrusts + joints")
    response: Vector = sized(6, "3 feet")
    desired: Vector = sized("nv")
    unknowns: Vector = sized("thrusts + others + 3 feet")
    wide_response: Vector = sized(6, "thrusts + others + 3 feet")
    gain: Vector = sized("thrusts + joints", "thrusts + others + 3 feet")
    at_rest: Vector = sized("thrusts + joints")
    status_and_systems: NDArray[np.int64] = sized(2, whole=True)
    hold_ticks: int
    clipped: NDArray[np.int64] = sized(2, whole=True)


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
    feet, joints, sizes = len(robot.feet), len(robot.joints), condensed_sizes(robot)
    lower, upper = thrust_box(robot, limits)
    return make_record(
        CondensedRecord,
        sizes,
        root=condensation_record(robot),
        cones=cones_record(limits, feet),
        free=_search_record(limits.pyramid, feet, bounded=0, more=0),
        limited=_search_record(limits.pyramid, feet, bounded=sizes["thrusts"] + sizes["others"], more=joints),
        w_body=weights.body,
        w_orientation=weights.orientation,
        w_swing=weights.swing,
        w_arms=weights.arms,
        w_thrust=weights.thrust,
        w_force=weights.force,
        thrust_lower=lower,
        thrust_upper=upper,
        torque_limit=limits.torque_scale * robot.torque_limit,
        give_way=limits.give_way,
        hold_ticks=np.int64(hold_ticks),
    )


class SearchRecord(RecordOf):
    """A program, and what searches its optimum.

    Attributes:
        program: the quadratic program.
        exchange: the last active set and its exchange.
        dual: the dual method.
    """

    program: ProgramRecord
    exchange: ActiveSetRecord
    dual: DualRecord


def _search_record(pyramid: Vector, feet: int, *, bounded: int, more: int) -> Records[SearchRecord]:
    """A program in the forces, after variables with bounds and before more rows, and what searches its optimum."""
    rows = len(pyramid) + 1
    program = QuadraticProgram(bounded + 3 * feet, equalities=0, inequalities=rows * feet + more, bounded=bounded)
    for k in range(feet):
        first, column = bounded + rows * k, bounded + 3 * k
        program.inequality[first : first + rows - 1, column : column + 3] = pyramid
        program.inequality[first + rows - 1, column + 2] = 1.0
    search = WarmStartedActiveSet(program, DualActiveSet(program))
    return make_record(SearchRecord, program=program.record, exchange=search.record, dual=search.dual.record)
