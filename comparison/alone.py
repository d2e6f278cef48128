"""The hearts of the two controllers, timed alone on recorded inputs: a governor update, a solve of the program.

DAQP solves the same programs where it is installed: the library's solver is not the fastest there is for this size,
and a statement about "the QP" should not lean on that.
"""

from __future__ import annotations

from importlib.util import find_spec
from time import perf_counter_ns
from typing import Any

import numpy as np

from comparison.replay import Clock
from comparison.statistics import Laps
from comparison.truth import Truth
from harpy_pin.governor import Governor
from harpy_pin.state import Vector
from harpy_pin.wbc import WarmProxQP, WholeBodyProblem

__all__ = ["DaqpAlone", "GovernorAlone", "ProxqpAlone", "daqp_installed"]


def daqp_installed() -> bool:
    """Whether DAQP can be imported."""
    return find_spec("daqp") is not None


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


class ProxqpAlone:
    """Times the library's solver, each solve warm from the one before.

    Args:
        problem: its arrays are filled with the recorded ones, outside the timed span.
        clock: nanoseconds.

    Attributes:
        laps: (programs,) times, ns.
        difference: largest difference from the expected optima so far, in the unit of the objective.
    """

    def __init__(self, problem: WholeBodyProblem, clock: Clock = perf_counter_ns) -> None:
        self.problem, self.clock = problem, clock
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.difference = 0.0

    def start(self, truth: Truth) -> None:
        """Begin a sequence, with a solver that knows nothing."""
        self.trace = truth.program
        self.laps = np.zeros(len(self.trace.solutions), dtype=np.int64)
        self.solver = WarmProxQP(self.problem)

    def play(self, begin: int, end: int) -> None:
        """Time the solves from ``begin`` to before ``end``."""
        p, trace, clock, n_in = self.problem, self.trace, self.clock, self.trace.n_in
        for i in range(begin, min(end, len(self.laps))):
            p.hessian[:], p.gradient[:] = trace.hessian[i], trace.gradient[i]
            p.inequality[:], p.equality[:] = trace.constraints[i, :n_in], trace.constraints[i, n_in:]
            p.lower[:], p.upper[:] = trace.lower[i, :n_in], trace.upper[i, :n_in]
            p.equality_value[:] = trace.lower[i, n_in:]
            t0 = clock()
            solution = self.solver.solve(p)
            t1 = clock()
            self.laps[i] = t1 - t0
            if trace.usable[i]:
                change = trace.objective(i, solution.z) - trace.objective(i, trace.solutions[i])
                self.difference = max(self.difference, abs(change))


class DaqpAlone:
    """Times DAQP's persistent model, each solve warm from the one before, and compares its optima with ProxQP's.

    Its way of stacking the constraints costs it nothing: the recorded arrays have it already.

    Args:
        clock: nanoseconds.

    Attributes:
        laps: (programs,) times, ns.
        gaps: how far ProxQP's optimum lies above DAQP's, relative to its size, in the present sequence; NaN where one
            of them did not solve.
        failures: programs of the present sequence that DAQP did not solve.
    """

    def __init__(self, clock: Clock = perf_counter_ns) -> None:
        self.clock = clock
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.gaps: Vector = np.zeros(0)
        self.failures = 0

    def start(self, truth: Truth) -> None:
        """Begin a sequence, with a solver that knows nothing."""
        self.trace = t = truth.program
        self.laps = np.zeros(len(t.solutions), dtype=np.int64)
        self.gaps = np.full(len(t.solutions), np.nan)
        self.failures = 0
        self._sources = (t.hessian, t.gradient, t.constraints, t.upper, t.lower)
        self._arrays = tuple(source[0].copy() for source in self._sources)
        self._sense = np.full(len(t.lower[0]), 5, dtype=np.int32)  # 5: equality
        self._sense[: t.n_in] = 0
        self._model = self._new()

    def play(self, begin: int, end: int) -> None:
        """Time the solves from ``begin`` to before ``end``."""
        trace, clock, arrays = self.trace, self.clock, self._arrays
        for i in range(begin, min(end, len(self.laps))):
            for array, source in zip(arrays, self._sources, strict=True):
                array[:] = source[i]
            model = self._model
            t0 = clock()
            updated = model.update(*arrays)
            z, _, flag, _ = model.solve()
            t1 = clock()
            self.laps[i] = t1 - t0
            if updated < 0 or flag <= 0:
                self.failures += 1
                self._model = self._new()
            elif trace.usable[i]:
                best = trace.objective(i, z)
                self.gaps[i] = (trace.objective(i, trace.solutions[i]) - best) / max(abs(best), 1.0)

    def _new(self) -> Any:
        import daqp  # type: ignore[import-not-found,import-untyped,unused-ignore]

        model = daqp.Model()
        model.setup(*self._arrays, self._sense)
        return model
