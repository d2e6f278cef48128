"""The hearts of the two controllers, timed alone on recorded inputs: a governor update, a solve of the program."""

from __future__ import annotations

from time import perf_counter_ns

import numpy as np

from comparison.replay import Clock
from comparison.statistics import Laps
from comparison.truth import Truth
from harpy_pin.governor import Governor
from harpy_pin.state import Vector
from harpy_pin.wbc import QuadraticProgram, make_solver

__all__ = ["GovernorAlone", "SolverAlone"]


class GovernorAlone:
    """Times one update of the governor after the other.

    Args:
        governor: as the controller uses it.
        dt: of the updates, s.
        strained: whether it is the governor that assumes no friction (see :class:`comparison.truth.Truth`).
        clock: nanoseconds.

    Attributes:
        laps: (ticks,) times, ns.
        difference: largest difference from the expected x_w so far (m, m/s).
    """

    def __init__(
        self, governor: Governor, dt: float, *, strained: bool = False, clock: Clock = perf_counter_ns
    ) -> None:
        self.governor, self.dt, self.strained, self.clock = governor, dt, strained, clock
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.difference = 0.0

    def start(self, truth: Truth) -> None:
        """Begin a sequence."""
        self.trace = truth.strained if self.strained else truth.governor
        self.laps = np.zeros(len(self.trace.measured), dtype=np.int64)
        self.governor.reset(self.trace.start)

    def play(self, begin: int, end: int) -> None:
        """Time the updates from ``begin`` to before ``end``."""
        trace, dt, clock, update = self.trace, self.dt, self.clock, self.governor.update
        for i in range(begin, min(end, len(self.laps))):
            x, x_r = trace.measured[i], trace.references[i]
            t0 = clock()
            x_w = update(x, x_r, dt)
            t1 = clock()
            self.laps[i] = t1 - t0
            self.difference = max(self.difference, float(np.abs(x_w - trace.results[i]).max()))


class SolverAlone:
    """Times one solver on recorded programs, one solve after the other as in a walk.

    Args:
        program: its arrays are filled with the recorded ones, outside the timed span.
        solver: one of :data:`harpy_pin.wbc.SOLVERS`.
        reuse: try the last active set first.
        clock: nanoseconds.

    Attributes:
        laps: (programs,) times, ns.
        gaps: how far the objective lies above the controller's own, relative to its size, in the present sequence; NaN
            where one of them did not solve.
        failures: programs of the present sequence that were not solved.
    """

    def __init__(
        self, program: QuadraticProgram, solver: str, *, reuse: bool = False, clock: Clock = perf_counter_ns
    ) -> None:
        self.program, self.clock = program, clock
        self.solver = make_solver(solver, program, reuse=reuse)
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.gaps: Vector = np.zeros(0)
        self.failures = 0

    def start(self, truth: Truth) -> None:
        """Begin a sequence, with a solver that knows nothing."""
        self.trace = truth.program
        self.laps = np.zeros(len(self.trace.solutions), dtype=np.int64)
        self.gaps = np.full(len(self.laps), np.nan)
        self.failures = 0
        self.solver.reset()

    def play(self, begin: int, end: int) -> None:
        """Time the solves from ``begin`` to before ``end``."""
        p, trace, clock, n_in = self.program, self.trace, self.clock, self.trace.n_in
        for i in range(begin, min(end, len(self.laps))):
            p.hessian[:], p.gradient[:] = trace.hessian[i], trace.gradient[i]
            p.inequality[:], p.equality[:] = trace.constraints[i, :n_in], trace.constraints[i, n_in:]
            p.lower[:], p.upper[:] = trace.lower[i, :n_in], trace.upper[i, :n_in]
            p.equality_value[:] = trace.lower[i, n_in:]
            t0 = clock()
            solution = self.solver.solve(p)
            t1 = clock()
            self.laps[i] = t1 - t0
            if not solution.usable:
                self.failures += 1
            elif trace.usable[i]:
                best = trace.objective(i, trace.solutions[i])
                self.gaps[i] = (trace.objective(i, solution.z) - best) / max(abs(best), 1.0)
