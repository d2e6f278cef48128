"""How long each controller takes for the same states, and whether what was timed is what should
have come out.

Complete ticks, phases, isolated governor updates and isolated solves are timed in separate replays,
so that clocks between the phases add nothing to the complete tick. All replays are interleaved.
Reference results come from further controllers that are not timed; the program's solutions are
checked against its own optimality conditions, so that no statement rests only on what the solver
reports.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

import harpy_pin as hp
from comparison.measure.replay import (
    WBC_PHASES,
    GovernorTrace,
    IsolatedGovernor,
    IsolatedSolver,
    TickReplay,
    WholeBodyChain,
    replay,
)
from comparison.measure.timing import Bench, Laps, Timed, ratio_of_medians, summarise
from comparison.measure.walking import TIMED, StateSequence, make_contender
from comparison.tables import Cell, Table, percentiles
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


TICK_RATIOS = (
    *((slow, "governed") for slow in ("wbc", "own search", "condensed")),
    *(("condensed", fast) for fast in ("wbc", "own search")),
)
"""Whose complete ticks are divided by whose, by names of :data:`TIMED`."""


@dataclass(frozen=True)
class ExpectedReplay:
    """What should come out of one sequence."""

    governor: GovernorTrace  # inputs and outputs of the governor
    # the same inputs and what a governor makes of them that assumes no friction, so that rows are
    # violated throughout
    strained: GovernorTrace
    program: RecordedPrograms  # the quadratic programs, and their solutions by our own search
    proxqp: RecordedPrograms  # what ProxQP says of them
    commands: dict[str, Vector]  # (ticks, size) of each contender

    @property
    def solved(self) -> dict[str, RecordedPrograms]:
        """Both solvers of the program in ticks, by name."""
        return {"proxqp": self.proxqp, "own": self.program}


def record_expected(
    robot: hp.Robot, friction: float, sequence: StateSequence, *, keep: int, samples: int
) -> ExpectedReplay:
    """Replay a sequence through fresh controllers, untimed.

    Programs are kept from the first on; at most so many samples of solutions are checked for
    stationarity.
    """
    controllers = {name: make_contender(name, robot, friction) for name in TIMED}
    controllers["governed"].governor = recorder = RecordingGovernor(
        controllers["governed"].governor
    )
    replays = {
        name: TickReplay(controllers[name]) for name in ("ungoverned", "governed", "condensed")
    }
    replays["own search"] = program = RecordedPrograms(
        controllers["own search"], keep=keep, samples=samples
    )
    replays["wbc"] = proxqp = RecordedPrograms(controllers["wbc"], keep=0, samples=samples)
    commands = {name: replay(timer, sequence.states).commands for name, timer in replays.items()}
    trace = recorder.trace()
    strained = RecordingGovernor(make_contender("governed", robot, 0.0).governor)
    strained.reset(trace.start)
    for x, x_r in zip(trace.measured, trace.references, strict=True):
        strained.update(x, x_r, controllers["governed"].period)
    return ExpectedReplay(trace, strained.trace(), program, proxqp, commands)


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


COMMAND_TOLERANCE = 1e-6
"""Largest accepted difference between a timed command and the expected one, N and N·m."""

PROXQP_SHARE = 0.05
"""Largest accepted share of the commands by ProxQP that differ; those of the others must not differ
at all.

Where a program is hard (the robot falls, say), the point at which an iterative solver stops depends
on rounding, and that on where its memory lies. Such ticks are counted and shown.
"""

OPTIMAL = 1e-6
"""Residual of stationarity, or relative gap of the objective, up to which a solution counts as
optimal.
"""

PHASES = {
    "tick": "complete tick",
    "kinematics": "gait, rigid-body terms",
    "build": "build: tasks, program",
    "solve": "solve",
    "finish": "torques, thrusts",
    "chain": "phases together",
    "governor_alone": "governor update, isolated",
    "governor_alone_violated": "the same, rows violated",
    "solve_alone": "solve, isolated, own search",
    "solve_alone_proxqp": "solve, isolated, ProxQP, warm",
    "solve_alone_daqp": "solve, isolated, DAQP",
}
"""What is timed, as readers see it."""

_CHAINS = {"own search/chain": WBC_PHASES, "wbc/chain": WBC_PHASES}


def time_contenders(bench: Bench, sequences: Sequence[StateSequence]) -> dict[str, dict[str, Any]]:
    """Time all contenders on all sequences.

    Returns:
        ``timing``: summaries of each contender's tick and phases, and the ratios; ``checks``: what
            was checked, and
        whether it held (``passed``); ``activity``: share of ticks with violated rows, and the
        solver's iterations.
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
    run = _TimingRun(robot, friction)

    def start(k: int) -> dict[str, Timed]:
        run.start(sequences[k], expectations[k])
        return run.timed

    def end(repetition: int, k: int) -> None:
        run.compare(expectations[k], judge=repetition == 0)
        bench.on_pass()

    quiet = replace(bench, on_pass=lambda: None)  # a pass is one sequence here
    laps, overhead = quiet.repeat(start, [len(s) for s in sequences], block=settings.block, end=end)
    unchanged = digests == [sequence.digest() for sequence in sequences]
    activity = {
        sequence.name: {
            "ticks": len(sequence),
            "governor_rows_violated": expected.governor.active,
            "governor_infeasible": expected.governor.infeasible,
            "strained_rows_violated": expected.strained.active,
            **{
                f"{solver}_iterations_{what}": float(of([report[0] for report in programs.reports]))
                for solver, programs in expected.solved.items()
                for what, of in (("mean", np.mean), ("max", max))
            },
        }
        for sequence, expected in zip(sequences, expectations, strict=True)
    }
    checks = run.checks([sequence.name for sequence in sequences], expectations, unchanged)
    return {"timing": _summary(laps, overhead), "checks": checks, "activity": activity}


class _TimingRun:
    """The controllers that are timed, and their results so far."""

    def __init__(self, robot: hp.Robot, friction: float) -> None:
        self.compared = dict.fromkeys(TIMED, 0)
        self.differing = dict.fromkeys(TIMED, 0)
        self.command_difference = 0.0
        governed = make_contender("governed", robot, friction)
        self.replays: dict[str, TickReplay] = {
            **{f"{name}/tick": TickReplay(make_contender(name, robot, friction)) for name in TIMED},
            **{
                key: WholeBodyChain(make_contender(key.partition("/")[0], robot, friction))
                for key in _CHAINS
            },
        }
        self.governor, self.strained = (
            IsolatedGovernor(make_contender("governed", robot, mu).governor, governed.period)
            for mu in (friction, 0.0)
        )
        solvers = {"solve_alone": "active_set"}
        solvers |= {f"solve_alone_{name}": name for name in ("proxqp", "daqp")}
        self.solvers = {
            phase: IsolatedSolver(make_contender("wbc", robot, friction).problem.program, name)
            for phase, name in solvers.items()
        }
        self.gaps: dict[str, list[Any]] = {phase: [] for phase in solvers}
        self.failures = dict.fromkeys(solvers, 0)
        self.timed: dict[str, Timed] = {
            **self.replays,
            "governed/governor_alone": self.governor,
            "governed/governor_alone_violated": self.strained,
            **{f"wbc/{phase}": solver for phase, solver in self.solvers.items()},
        }

    def start(self, sequence: StateSequence, expected: ExpectedReplay) -> None:
        """Begin a sequence with every timer."""
        for timer in self.replays.values():
            timer.start(sequence.states)
        self.governor.start(expected.governor)
        self.strained.start(expected.strained)
        for solver in self.solvers.values():
            solver.start(expected.program.programs, expected.program.solutions)

    def compare(self, expected: ExpectedReplay, *, judge: bool) -> None:
        """Compare the commands of a finished sequence with the expected ones, and judge the
        isolated solutions.
        """
        for key, timer in self.replays.items():
            name = key.partition("/")[0]
            difference = np.abs(timer.commands - expected.commands[name]).max(axis=1)
            self.compared[name] += len(difference)
            self.differing[name] += len(difference) - int(
                np.count_nonzero(difference <= COMMAND_TOLERANCE)
            )
            self.command_difference = max(self.command_difference, float(difference.max()))
        for phase, solver in self.solvers.items() if judge else ():
            self.gaps[phase].append(solver.gaps[np.isfinite(solver.gaps)])
            self.failures[phase] += solver.failures

    def checks(
        self, names: Sequence[str], expectations: Sequence[ExpectedReplay], unchanged: bool
    ) -> dict[str, Any]:
        """What was compared, what differed, and how good the solutions are."""
        governor_difference = max(self.governor.difference, self.strained.difference)
        checks: dict[str, Any] = {
            "states_unchanged": unchanged,
            "commands_compared": sum(self.compared.values()),
            "commands_differing": sum(self.differing.values()),
            "commands_differing_by_controller": dict(self.differing),
            "command_difference_max": self.command_difference,
            "governor_difference_max": governor_difference,
        }
        for solver in expectations[0].solved:
            programs = {
                name: expected.solved[solver]
                for name, expected in zip(names, expectations, strict=True)
            }
            checks |= {f"{solver}_{what}": value for what, value in _checks_of(programs).items()}
        for phase, parts in self.gaps.items():
            gaps, name = np.concatenate(parts), phase.removeprefix("solve_")
            checks[f"{name}_failures"] = self.failures[phase]
            checks[f"{name}_compared"] = len(gaps)
            checks[f"{name}_better"] = int(np.count_nonzero(gaps < -OPTIMAL))
            checks[f"{name}_worse"] = int(np.count_nonzero(gaps > OPTIMAL))
            checks[f"{name}_gap_max"] = float(np.abs(gaps).max()) if len(gaps) else None
        checks["passed"] = bool(
            unchanged
            and not any(differing for name, differing in self.differing.items() if name != "wbc")
            and self.differing["wbc"] <= PROXQP_SHARE * self.compared["wbc"]
            and governor_difference <= COMMAND_TOLERANCE
            and all(
                np.isfinite(expected.commands[name]).all()
                for expected in expectations
                for name in TIMED
            )
        )
        return checks


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


def _summary(laps: Mapping[str, list[Laps]], overhead: float) -> dict[str, Any]:
    timing: dict[str, Any] = {name: {} for name in TIMED}
    for key, parts in laps.items():
        name, what = key.split("/")
        phases = _CHAINS.get(key, ("tick",))
        if key in _CHAINS:
            timing[name] |= {
                p: summarise([part[:, k] for part in parts], overhead) for k, p in enumerate(phases)
            }
        each = [part.reshape(len(part), -1).sum(axis=1) for part in parts]
        timing[name][what] = summarise(each, overhead * len(phases))
    timing["ratios"] = {
        f"{slow} / {fast}": ratio_of_medians(laps[f"{slow}/tick"], laps[f"{fast}/tick"], overhead)
        for slow, fast in TICK_RATIOS
    }
    timing["solve_ratios"] = {
        phase: ratio_of_medians(laps[f"wbc/{phase}"], laps["governed/governor_alone"], overhead)
        for phase in timing["wbc"]
        if phase.startswith("solve_alone")
    }
    timing["timer_overhead_ns"] = overhead
    return timing


def timing_tables(timing: Mapping[str, Any], friction: float) -> list[Table]:
    """Times of ticks and phases, and their ratios."""
    cells = [
        cell
        for contender in TIMED
        for phase in PHASES
        if phase in timing[contender]
        for cell in percentiles(f"{contender}: {PHASES[phase]}", timing[contender][phase])
    ]
    note = f"The timer's own {timing['timer_overhead_ns']:.0f} ns are subtracted from every time."
    rows = {f"complete tick, {name}": ratio for name, ratio in timing["ratios"].items()}
    rows |= {
        f"{PHASES[phase]} / governor update": ratio
        for phase, ratio in timing["solve_ratios"].items()
    }
    ratios = tuple(Cell(row, "ratio", r["p50"], "", r["min"], r["max"]) for row, r in rows.items())
    of_ratios = "Ratio of medians; in brackets the least and largest of the repetitions."
    return [
        Table("timing", f"Time per tick and phase, µs, friction {friction:g}", tuple(cells), note),
        Table("ratios", f"Ratios, friction {friction:g}", ratios, of_ratios),
    ]
