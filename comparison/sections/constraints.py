"""Equal work: the cost of holding the constraints and nothing else, for the governors and for quadratic programs.

The same projection of a desired contact force on the cone's rows (three unknowns) is done by the library's closed form
and by QP solvers; beside them stand the governors' whole updates and the solves of the whole-body program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter_ns
from typing import Any

import numpy as np

from comparison.measure.controllers import make_contender, make_whole_body
from comparison.measure.interleave import Bench
from comparison.measure.isolated import IsolatedGovernor, IsolatedSolver
from comparison.measure.states import StateSequence
from comparison.measure.statistics import Laps, summarise
from comparison.measure.tick_replay import TickReplay, replay
from comparison.measure.verification import RecordingGovernor, record_programs
from comparison.tables import Cell, Table, percentiles
from harpy_pin.controllers import GovernedController
from harpy_pin.controllers.named_controllers import REFERENCE_GOVERNORS, make_governor
from harpy_pin.errors import InputError
from harpy_pin.governors import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.reduced.cone import ROWS, cone_record, cone_rows
from harpy_pin.governors.reduced.feedback import direction, feedback
from harpy_pin.governors.reduced.projection import project
from harpy_pin.model.record import Record
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.wbc import QuadraticProgram, installed_solvers

__all__ = ["constraints_table", "time_constraints"]

DISTURBANCE = 0.15
"""Standard deviation of what is added to the references' horizontal position, m, to have rows violated."""

PROJECTORS = ("daqp", "quadprog", "proxqp")
"""Solvers of the projection."""


class _ForceUpdates:
    """Times updates of the governor of the true contact force, behind recorded commands."""

    def __init__(self, governor: ContactForceFilter, states: Sequence[State], commands: Vector) -> None:
        self.governor, self.states, self.commands = governor, states, commands
        self.laps: Laps = np.zeros(len(states), dtype=np.int64)
        self.active = np.zeros(len(states), dtype=np.bool_)
        self.joints = len(governor.robot.joints)
        governor.reset()

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        governor = self.governor
        for i in range(begin, min(end, len(self.laps))):
            row = self.commands[i]
            state, command = (
                self.states[i],
                Command(row[: self.joints].copy(), row[self.joints :].reshape(-1, 3).copy()),
            )
            t0 = perf_counter_ns()
            governor.update(state, command)
            t1 = perf_counter_ns()
            self.laps[i] = t1 - t0
            self.active[i] = bool((governor.status.h_r < 0.0).any())


class _BareDaqp:
    """Times DAQP's own function on arrays that are ready: what the solvers' common interface adds is left out."""

    def __init__(self, rows: Vector, bounds: Vector, points: Vector) -> None:
        import daqp

        self.solve = daqp.solve
        self.rows, self.bounds, self.points = rows, bounds, points
        self.laps: Laps = np.zeros(len(points), dtype=np.int64)

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        hessian, upper = np.eye(3), np.full(self.rows.shape[1], 1e20)
        for i in range(begin, min(end, len(self.laps))):
            gradient, rows, lower = -self.points[i], self.rows[i], self.bounds[i]
            sense = np.zeros(len(upper), dtype=np.int32)
            t0 = perf_counter_ns()
            self.solve(hessian, gradient, rows, upper, lower, sense)
            t1 = perf_counter_ns()
            self.laps[i] = t1 - t0


class _Projections:
    """Times the closed form."""

    def __init__(self, rows: Vector, bounds: Vector, points: Vector) -> None:
        self.rows, self.bounds, self.points = rows, bounds, points
        self.laps: Laps = np.zeros(len(points), dtype=np.int64)
        self.results: Vector = np.zeros(points.shape)
        self.violation: Vector = np.zeros(len(points))
        self.work: Vector = np.zeros((3, rows.shape[1]))

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        for i in range(begin, min(end, len(self.laps))):
            rows, bounds, point, out = self.rows[i], self.bounds[i], self.points[i], self.results[i]
            t0 = perf_counter_ns()
            violation = project(rows, bounds, point, out, self.work)
            t1 = perf_counter_ns()
            self.laps[i] = t1 - t0
            self.violation[i] = violation


def _projection_problems(mass: float, mu: float, measured: Vector, references: Vector) -> tuple[Vector, ...]:
    """Rows, bounds and points of the ``cone`` governor's projections: (N, n, 3), (N, n), (N, 3)."""
    p = cone_record(mass=mass, mu=mu)[0]
    count = len(measured)
    rows, bounds, points = np.zeros((count, len(ROWS), 3)), np.zeros((count, len(ROWS))), np.zeros((count, 3))
    r_hat = np.zeros(3)
    for i in range(count):
        length = direction(measured[i], r_hat)
        feedback(measured[i], references[i], r_hat, p, points[i])
        cone_rows(measured[i], r_hat, length, p, rows[i], bounds[i])
    return rows, bounds, points


def _as_programs(rows: Vector, bounds: Vector, points: Vector) -> tuple[QuadraticProgram, Record]:
    """The projections as quadratic programs: ½ ‖F − F₀‖² under rows F ≥ bounds."""
    program = QuadraticProgram(3, equalities=0, inequalities=rows.shape[1], bounded=0)
    program.hessian[:] = np.eye(3)
    programs = np.zeros(len(points), program.record.dtype)
    for i in range(len(points)):
        program.gradient[:] = -points[i]
        program.inequality[:], program.lower[:] = rows[i], bounds[i]
        programs[i] = program.record[0]
    return program, programs


def time_constraints(bench: Bench, sequence: StateSequence) -> dict[str, Any]:
    """Time the constraint handling, without the rest of the tick.

    The bench's random numbers draw the references' disturbance, too.

    Returns:
        For each piece of work percentiles, µs, and the share of its pieces in which a row was violated before it acted
        (null for the whole-body program); for solvers the largest difference of the solution from the expected one.

    Raises:
        InputError: the walk is too short.
    """
    robot, friction, settings, states = bench.robot, bench.friction, bench.settings, sequence.states
    if len(states) <= settings.warm_up:
        raise InputError(f"{len(states)} states are too few for a warm-up of {settings.warm_up}", name="states")
    governed = make_contender("governed", robot, friction)
    assert isinstance(governed, GovernedController)
    assert governed.governor is not None
    recorder = RecordingGovernor(governed.governor)
    governed.governor = recorder
    replay(TickReplay(governed), states)
    trace = recorder.trace()
    period = governed.period
    disturbed = trace.references.copy()
    disturbed[:, :2] += DISTURBANCE * bench.rng.standard_normal((len(disturbed), 2))
    commands = replay(TickReplay(make_contender("ungoverned", robot, friction)), states).commands
    problems = _projection_problems(robot.mass, friction, trace.measured, disturbed)
    small, small_programs = _as_programs(*problems)
    whole = make_whole_body(robot, friction).problem.program
    recorded, _ = record_programs(robot, friction, sequence, keep=len(states), samples=1)
    exact = _Projections(*problems)
    exact.time_block(0, len(states))
    expected = np.where(exact.violation[:, None] == 0.0, exact.results, np.nan)
    violated = float(np.mean((np.einsum("ijk,ik->ij", problems[0], problems[2]) < problems[1]).any(axis=1)))

    timed: dict[str, Any] = {}

    def start(_: int) -> dict[str, Any]:
        timed.clear()
        for name in (name for name in REFERENCE_GOVERNORS if name != "none"):
            for inputs, references in (("as walked", trace.references), ("disturbed", disturbed)):
                governor = make_governor(name, robot, mu=friction)
                assert governor is not None
                timed[f"update: {name}, {inputs}"] = update = IsolatedGovernor(governor, period)
                update.start(replace(trace, start=references[0], references=references))
        force_filter = ContactForceFilter(robot, ContactForceFilterParameters(mu=friction), period=period)
        timed["update: contact, as walked"] = _ForceUpdates(force_filter, states, commands)
        timed["projection: closed form"] = _Projections(*problems)
        for solver in (name for name in PROJECTORS if name in installed_solvers()):
            timer = IsolatedSolver(small, solver)
            timer.start(small_programs, expected)
            timed[f"projection: {solver}"] = timer
        if "daqp" in installed_solvers():
            timed["projection: daqp, bare call"] = _BareDaqp(*problems)
        for name, solver, reuse in (
            ("active set, else proxqp", "proxqp", True),
            ("proxqp", "proxqp", False),
            ("daqp", "daqp", False),
        ):
            if solver in installed_solvers():
                timer = IsolatedSolver(whole, solver, reuse=reuse)
                timer.start(recorded.programs, recorded.solutions)
                timed[f"whole-body program: {name}"] = timer
        return timed

    laps, overhead = bench.repeat(start, [len(states)], block=settings.block)
    result: dict[str, Any] = {}
    for name, timer in timed.items():
        row: dict[str, Any] = summarise(laps[name], overhead)
        if name.startswith("projection"):
            row["violated"] = violated
        elif name.startswith("update"):
            row["violated"] = float(np.mean(timer.active))
        else:
            row["violated"] = None
        row["gap_max"] = None
        if isinstance(timer, IsolatedSolver):
            gaps = np.abs(timer.gaps[np.isfinite(timer.gaps)])
            row["gap_max"] = float(gaps.max()) if len(gaps) else None
        result[name] = row
    return result


def constraints_table(entry: dict[str, Any], friction: float) -> Table:
    """The table of :func:`time_constraints`."""
    cells: list[Cell] = []
    for name, row in entry.items():
        cells += percentiles(name, row)
        cells.append(Cell(name, "rows violated", row["violated"]))
        cells.append(Cell(name, "gap, largest", row["gap_max"]))
    return Table(
        "constraints",
        f"Cost of holding the constraints, µs, friction {friction:g}",
        tuple(cells),
        "States of the pushed walk of the contact-force filter. Disturbed: noise is added to the "
        "references, so that rows are violated; the share of calls with a violated row has its own column. Gap: of the "
        "optimum, relative. All projections are the same: "
        "the desired contact force of the reduced-order model on the cone governor's rows, three unknowns; solvers "
        "are called through the library's common interface, except for the bare call.",
    )
