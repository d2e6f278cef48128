"""Reference results: what a timed replay has to reproduce, from further controllers that are not timed.

The program's solutions are checked against its own optimality conditions, so that no statement rests only on what the
solver reports.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from comparison.measure.replay import GovernorTrace, TickReplay, replay
from comparison.measure.walking import StateSequence, make_contender
from harpy_pin.governors import Governor
from harpy_pin.model.record import Record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc import QuadraticProgram

ACTIVE = 1e-3
"""Distance from its bound at which a constraint counts as active, in the constraint's unit."""


class RecordingGovernor:
    """Passes everything on to a governor, and keeps what went in and came out."""

    def __init__(self, inner: Governor) -> None:
        self.inner = inner
        self.applied: Vector = inner.applied
        self.status = inner.status
        self.start = inner.applied
        self.kept: list[tuple[Any, ...]] = []

    def reset(self, x_r: Vector) -> None:
        """See :class:`harpy_pin.governors.Governor`."""
        if not self.kept:
            self.start = x_r.copy()
        self.inner.reset(x_r)

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governors.Governor`."""
        inputs = x.copy(), x_r.copy()
        self.applied = self.inner.update(x, x_r, dt)
        self.status = self.inner.status
        active = bool(np.any(self.status.h_r < 0.0) or np.any(self.status.h_w < 0.0))
        self.kept.append((*inputs, self.applied.copy(), active, bool(self.status.infeasible)))
        return self.applied

    def trace(self) -> GovernorTrace:
        """What was kept, of one sequence."""
        measured, references, results, active, infeasible = (np.array(part) for part in zip(*self.kept, strict=True))
        return GovernorTrace(self.start, measured, references, results, float(active.mean()), float(infeasible.mean()))


@dataclass(frozen=True)
class ProgramTrace:
    """Quadratic programs over a sequence, and the results of solving them.

    Attributes:
        programs: records of the first of them.
        solutions: (kept, n) theirs; NaN where there was none to be used.
        iterations: (ticks,) of the solver.
        statuses: (ticks,) of the solver.
        usable: (ticks,) whether the solution was used.
        violation: largest violation of a constraint by a usable solution, in the constraint's unit.
        stationarity: (samples,) violation of stationarity by sampled solutions, in the unit of the gradient.
    """

    programs: Record
    solutions: Vector
    iterations: Vector
    statuses: Vector
    usable: NDArray[np.bool_]
    violation: float
    stationarity: Vector


@dataclass(frozen=True)
class ExpectedReplay:
    """What should come out of one sequence.

    Attributes:
        governor: inputs and outputs of the governor.
        strained: the same inputs and what a governor makes of them that assumes no friction, so that rows are violated
            throughout.
        program: the quadratic programs.
        commands: (ticks, size) of each contender.
    """

    governor: GovernorTrace
    strained: GovernorTrace
    program: ProgramTrace
    commands: dict[str, Vector]


def record_expected(
    robot: Robot, friction: float, sequence: StateSequence, *, keep: int, samples: int
) -> ExpectedReplay:
    """Replay a sequence through fresh controllers, untimed.

    Programs are kept from the first on; at most so many samples of solutions are checked for stationarity.
    """
    governed = make_contender("governed", robot, friction)
    governed.governor = recorder = RecordingGovernor(governed.governor)
    controllers = {name: make_contender(name, robot, friction) for name in ("ungoverned", "condensed")}
    commands = {
        name: replay(TickReplay(controller), sequence.states).commands
        for name, controller in {**controllers, "governed": governed}.items()
    }
    trace = recorder.trace()
    strained = RecordingGovernor(make_contender("governed", robot, 0.0).governor)
    strained.reset(trace.start)
    for x, x_r in zip(trace.measured, trace.references, strict=True):
        strained.update(x, x_r, governed.period)
    program, wbc = record_programs(robot, friction, sequence, keep=keep, samples=samples)
    return ExpectedReplay(trace, strained.trace(), program, commands | {"wbc": wbc})


def record_programs(
    robot: Robot, friction: float, sequence: StateSequence, *, keep: int, samples: int
) -> tuple[ProgramTrace, Vector]:
    """The QP controller's programs of an untimed replay, its solutions, and its commands.

    For arguments see :func:`record_expected`.
    """
    controller = make_contender("wbc", robot, friction)
    controller.reset()
    p, ticks = controller.problem.program, len(sequence)
    keep = min(keep, ticks)
    programs, solutions = np.zeros(keep, p.record.dtype), np.full((keep, p.shape[0]), np.nan)
    commands, reports, residuals = [], [], []
    every = max(ticks // samples, 1)
    violation = 0.0
    for i, state in enumerate(sequence.states):
        command = controller.step(state)
        commands.append(np.concatenate((command.torque, command.thrust.ravel())))
        solution = controller.solution
        reports.append((solution.iterations, int(solution.status), solution.usable))
        if i < keep:
            programs[i] = p.record[0]
            if solution.usable:
                solutions[i] = solution.z
        if solution.usable:
            violation = max(violation, p.violation(solution.z))
            if i % every == 0:
                residuals.append(stationarity(p, solution.z))
    iterations, statuses, usable = np.array(reports, dtype=float).T
    trace = ProgramTrace(programs, solutions, iterations, statuses, usable > 0.0, violation, np.array(residuals))
    return trace, np.array(commands)


def stationarity(program: QuadraticProgram, z: Vector) -> float:
    """How far z is from optimal: least ‖H z + g + Aᵀy + Cᵀλ‖∞ over multipliers of the right sign.

    The multipliers are found anew by non-negative least squares; those of the solver are not used. Multipliers of
    inequalities are zero away from their bounds.
    """
    p = program
    c = p.inequality @ z
    scale = np.maximum(1.0, np.abs(c))
    at_upper = p.inequality[(p.upper - c) < ACTIVE * scale]
    at_lower = p.inequality[(c - p.lower) < ACTIVE * scale]
    columns = np.vstack((p.equality, -p.equality, at_upper, -at_lower)).T
    slope = p.hessian @ z + p.gradient
    if columns.shape[1]:  # nnls aborts on a matrix without columns
        slope = slope + columns @ nnls(columns, -slope)[0]
    return float(np.abs(slope).max())
