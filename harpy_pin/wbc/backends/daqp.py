"""DAQP: a dual active-set method."""

from __future__ import annotations

from typing import ClassVar

import daqp
import numpy as np

from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["DAQPSolver"]

_EQUALITY = 5
_ITERATION_LIMIT = -4
_ITERATIONS = 1000
"""Largest number in one solve; ticks of walks need tens."""


class DAQPSolver(QPSolver):
    """Cold at every tick: few constraints are active, and finding them is faster than a warm start."""

    name: ClassVar[str] = "daqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._sense = np.zeros(rows + n_eq, dtype=np.int32)
        self._sense[rows:] = _EQUALITY
        self._rows = np.zeros((rows - program.bounded + n_eq, n))
        self._lower, self._upper = np.zeros(rows + n_eq), np.zeros(rows + n_eq)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p = program
        if len(p.equality_value):
            rows, general = len(p.lower), len(p.lower) - p.bounded
            self._rows[:general], self._rows[general:] = p.inequality[p.bounded :], p.equality
            self._lower[:rows], self._lower[rows:] = p.lower, p.equality_value
            self._upper[:rows], self._upper[rows:] = p.upper, p.equality_value
            problem = (self._rows, self._upper, self._lower)
        else:
            problem = (p.inequality[p.bounded :], p.upper, p.lower)
        z, _, flag, info = daqp.solve(p.hessian, p.gradient, *problem, self._sense.copy(), iter_limit=_ITERATIONS)
        self.solution.z[:] = z
        self.solution.iterations = info["iterations"]
        if flag > 0:
            return QPStatus.SOLVED
        return QPStatus.MAX_ITERATIONS if flag == _ITERATION_LIMIT else QPStatus.INFEASIBLE
