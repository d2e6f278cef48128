"""How long an update of the paper's governor takes, and a solve of the program, each alone; and
whether what was timed is right.

Inputs and references come from controllers that are not timed; solutions are checked against the
program's own optimality conditions, so that no statement rests only on what the solver reports.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

import harpy_pin as hp
from comparison.contenders import OWN
from comparison.measure.replay import (
    GovernorTrace,
    IsolatedGovernor,
    IsolatedSolver,
    TickReplay,
    replay,
)
from comparison.measure.timing import Bench, Timed, summarise
from comparison.measure.walking import StateSequence, make_contender
from comparison.tables import Table, percentiles
from harpy_pin.model.state import Command, State, Vector

ACTIVE = 1e-3
"""Distance from its bound at which a constraint counts as active, in the constraint's unit."""


class RecordingGovernor:
    """Passes everything on to a governor, and keeps what went in and came out."""

    def __init__(self, inner: hp.governors.Governor) -> None:
        self.inner, self.start = inner, inner.applied
        self.kept: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def reset(self, x_r: Vector) -> None:
        """See :class:`harpy_pin.governors.Governor`."""
        if not self.kept:
            self.start = x_r.copy()
        self.inner.reset(x_r)

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governors.Governor`."""
        inputs = x.copy(), x_r.copy()
        applied, status = self.inner.update(x, x_r, dt), self.inner.status
        active = bool(np.any(status.h_r < 0.0) or np.any(status.h_w < 0.0))
        self.kept.append((*inputs, applied.copy(), active, bool(status.infeasible)))
        return applied

    def trace(self) -> GovernorTrace:
        """What was kept, of one sequence."""
        measured, references, results, active, infeasible = (
            np.array(part) for part in zip(*self.kept, strict=True)
        )
        return GovernorTrace(
            self.start,
            measured,
            references,
            results,
            float(active.mean()),
            float(infeasible.mean()),
        )


class RecordedPrograms(TickReplay):
    """A QP controller's ticks, not timed, with its programs, their solutions, and what its solver
    says.

    Attributes:
        programs: records of the first of them.
        solutions: (kept, n) theirs; NaN where there was none to be used.
        reports: of each tick the solver's iterations and status, and whether the solution was used.
        violation: largest violation of a constraint by a usable solution, in the constraint's unit.
        stationarity: violation of stationarity by sampled solutions, in the unit of the gradient.
    """

    def __init__(self, controller: Any, *, keep: int, samples: int) -> None:
        self._most, self._samples = keep, samples
        super().__init__(controller)

    def start(self, states: Sequence[State]) -> None:
        """See :meth:`TickReplay.start`."""
        super().start(states)
        program, kept = self.controller.problem.program, min(self._most, len(states))
        self.programs, self.solutions = (
            np.zeros(kept, program.record.dtype),
            np.full((kept, program.shape[0]), np.nan),
        )
        self.reports: list[tuple[int, int, bool]] = []
        self.violation, self.stationarity = 0.0, list[float]()

    def _keep(self, i: int, command: Command) -> None:
        super()._keep(i, command)
        program, solution = self.controller.problem.program, self.controller.solution
        self.reports.append((solution.iterations, int(solution.status), solution.usable))
        kept = i < len(self.programs)
        if kept:
            self.programs[i] = program.record[0]
        if kept and solution.usable:
            self.solutions[i] = solution.z
        if solution.usable:
            self.violation = max(self.violation, program.violation(solution.z))
            if i % max(len(self.states) // self._samples, 1) == 0:
                self.stationarity.append(stationarity(program, solution.z))


@dataclass(frozen=True)
class ExpectedReplay:
    """What should come out of one sequence."""

    governor: GovernorTrace  # inputs and outputs of the governor
    # the same inputs and what a governor makes of them that assumes no friction, so that rows are
    # violated throughout
    strained: GovernorTrace
    # the quadratic programs, their solutions by our own search, and what that says of them; then
    # what ProxQP says of them
    solved: Mapping[str, RecordedPrograms]


def record_expected(
    robot: hp.Robot, friction: float, sequence: StateSequence, *, keep: int, samples: int
) -> ExpectedReplay:
    """Replay a sequence through fresh controllers, untimed.

    Programs are kept from the first on; at most so many samples of solutions are checked for
    stationarity.
    """
    governed = make_contender(GOVERNED, robot, friction)
    governed.governor = recorder = RecordingGovernor(governed.governor)
    replay(TickReplay(governed), sequence.states)
    solved = {}
    for name, contender, kept in (("own", OWN, keep), ("proxqp", "wbc", 0)):
        qp = make_contender(contender, robot, friction)
        solved[name] = RecordedPrograms(qp, keep=kept, samples=samples)
        replay(solved[name], sequence.states)
    trace = recorder.trace()
    strained = RecordingGovernor(make_contender(GOVERNED, robot, 0.0).governor)
    strained.reset(trace.start)
    for x, x_r in zip(trace.measured, trace.references, strict=True):
        strained.update(x, x_r, governed.period)
    return ExpectedReplay(trace, strained.trace(), solved)


def stationarity(program: hp.wbc.QuadraticProgram, z: Vector) -> float:
    """How far z is from optimal: least ‖H z + g + Aᵀy + Cᵀλ‖∞ over multipliers of the right sign.

    The multipliers are found anew by non-negative least squares; those of the solver are not used.
    Multipliers of inequalities are zero away from their bounds.
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


GOVERNED = "governed/paper"
"""Whose governor is timed."""

GOVERNOR_TOLERANCE = 1e-6
"""Largest accepted difference between a timed reference and the expected one, m and m/s."""

OPTIMAL = 1e-6
"""Residual of stationarity, or relative gap of the objective, up to which a solution counts as
optimal.
"""

ROWS = {
    "governor_alone": "governed: governor update, isolated",
    "governor_alone_violated": "governed: the same, rows violated",
    "solve_alone": "wbc: solve, isolated, own search",
    "solve_alone_proxqp": "wbc: solve, isolated, ProxQP, warm",
    "solve_alone_daqp": "wbc: solve, isolated, DAQP",
}
"""What is timed, as readers see it."""

_SOLVERS = {"solve_alone": "active_set", "solve_alone_proxqp": "proxqp", "solve_alone_daqp": "daqp"}


def time_parts(bench: Bench, sequences: Sequence[StateSequence]) -> dict[str, dict[str, Any]]:
    """Time governor and solvers on all sequences.

    Returns:
        ``timing``: a summary of each of :data:`ROWS`; ``checks``: what was checked, and whether it
        held (``passed``); ``activity``: share of ticks with violated rows, and the solvers'
        iterations.
    """
    robot, friction, settings = bench.robot, bench.friction, bench.settings
    digests, expectations = [sequence.digest() for sequence in sequences], []
    for sequence in sequences:
        if len(sequence) <= settings.warm_up:
            raise hp.InputError(
                f"{len(sequence)} states are too few for a warm-up of {settings.warm_up}",
                name="states",
            )
        kept = {"keep": settings.programs, "samples": settings.samples}
        expectations.append(record_expected(robot, friction, sequence, **kept))
        bench.on_pass()
    governor, strained = (
        IsolatedGovernor(governed.governor, governed.period)
        for governed in (make_contender(GOVERNED, robot, mu) for mu in (friction, 0.0))
    )
    solvers = {
        phase: IsolatedSolver(make_contender("wbc", robot, friction).problem.program, name)
        for phase, name in _SOLVERS.items()
    }
    timed: dict[str, Timed] = {
        "governor_alone": governor,
        "governor_alone_violated": strained,
        **solvers,
    }
    gaps: dict[str, list[Vector]] = {phase: [] for phase in solvers}
    failures = dict.fromkeys(solvers, 0)

    def start(k: int) -> dict[str, Timed]:
        expected = expectations[k]
        governor.start(expected.governor)
        strained.start(expected.strained)
        for solver in solvers.values():
            solver.start(expected.solved["own"].programs, expected.solved["own"].solutions)
        return timed

    def end(repetition: int, k: int) -> None:
        for phase, solver in solvers.items() if repetition == 0 else ():
            gaps[phase].append(solver.gaps[np.isfinite(solver.gaps)])
            failures[phase] += solver.failures
        bench.on_pass()

    quiet = replace(bench, on_pass=lambda: None)  # a pass is one sequence here
    laps, overhead = quiet.repeat(start, [len(s) for s in sequences], block=settings.block, end=end)
    by_name = dict(zip([sequence.name for sequence in sequences], expectations, strict=True))
    activity = {
        name: {
            "ticks": len(expected.governor.measured),
            "governor_rows_violated": expected.governor.active,
            "governor_infeasible": expected.governor.infeasible,
            "strained_rows_violated": expected.strained.active,
            **{
                f"{solver}_iterations_{what}": float(of([report[0] for report in programs.reports]))
                for solver, programs in expected.solved.items()
                for what, of in (("mean", np.mean), ("max", max))
            },
        }
        for name, expected in by_name.items()
    }
    checks: dict[str, Any] = {
        "states_unchanged": digests == [sequence.digest() for sequence in sequences],
        "governor_difference_max": max(governor.difference, strained.difference),
    }
    for solver in ("proxqp", "own"):
        programs = {name: expected.solved[solver] for name, expected in by_name.items()}
        checks |= {f"{solver}_{what}": value for what, value in _checks_of(programs).items()}
    for phase, parts in gaps.items():
        gap, name = np.concatenate(parts), phase.removeprefix("solve_")
        checks[f"{name}_failures"] = failures[phase]
        checks[f"{name}_compared"] = len(gap)
        checks[f"{name}_better"] = int(np.count_nonzero(gap < -OPTIMAL))
        checks[f"{name}_worse"] = int(np.count_nonzero(gap > OPTIMAL))
        checks[f"{name}_gap_max"] = float(np.abs(gap).max()) if len(gap) else None
    checks["passed"] = bool(
        checks["states_unchanged"] and checks["governor_difference_max"] <= GOVERNOR_TOLERANCE
    )
    timing = {phase: summarise(parts, overhead) for phase, parts in laps.items()}
    return {
        "timing": timing | {"timer_overhead_ns": overhead},
        "checks": checks,
        "activity": activity,
    }


def _checks_of(programs: Mapping[str, RecordedPrograms]) -> dict[str, Any]:
    """How good the solutions of one solver are, by the name of the states."""
    residuals = np.concatenate([one.stationarity for one in programs.values()])
    failures = {
        name: sum(not usable for *_, usable in one.reports) for name, one in programs.items()
    }
    return {
        "solves": sum(len(one.reports) for one in programs.values()),
        "failures": sum(failures.values()),
        "failures_by_states": failures,
        "fallbacks": sum(one.controller.fallbacks for one in programs.values()),
        "inaccurate": sum(status == 1 for one in programs.values() for _, status, _ in one.reports),
        "violation_max": max(one.violation for one in programs.values()),
        "sampled": len(residuals),
        "stationarity_max": float(residuals.max()) if len(residuals) else None,
        "not_optimal": int(np.count_nonzero(residuals > OPTIMAL)),
    }


def timing_table(timing: Mapping[str, Any], friction: float) -> Table:
    """The times of :func:`time_parts`."""
    cells = [cell for phase, row in ROWS.items() for cell in percentiles(row, timing[phase])]
    note = f"The timer's own {timing['timer_overhead_ns']:.0f} ns are subtracted from every time."
    return Table(
        "timing", f"Time of each part alone, µs, friction {friction:g}", tuple(cells), note
    )
