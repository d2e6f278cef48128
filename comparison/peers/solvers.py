"""Other libraries' QP solvers on our recorded programs, all through qpsolvers."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from copy import deepcopy
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from time import perf_counter_ns
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from comparison.measure.controllers import make_whole_body
from comparison.measure.states import StateSequence
from comparison.measure.statistics import summarise
from comparison.measure.tick_replay import timer_overhead, without_gc
from comparison.measure.verification import one_sided
from comparison.peers.environment import last_line
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc import QuadraticProgram

__all__ = ["SOLVERS", "compare_solvers", "record_programs"]

SOLVERS: dict[str, dict[str, Any]] = {
    "proxqp": {"eps_abs": 1e-6, "eps_rel": 0.0},
    "daqp": {},
    "piqp": {"eps_abs": 1e-6, "eps_rel": 0.0},
    "osqp": {"eps_abs": 1e-6, "eps_rel": 0.0, "max_iter": 20_000},
    "clarabel": {"tol_gap_abs": 1e-6, "tol_gap_rel": 0.0, "tol_feas": 1e-6},
    "quadprog": {},
}
"""Solvers by their name in qpsolvers, with settings of nearly equal meaning; the active-set solvers are exact."""

_SPARSE = ("osqp", "clarabel")
"""Those that take sparse matrices only; the conversion is not timed."""

_FEASIBLE = 1e-6
"""Violation up to which a solution may define the best objective."""


def record_programs(
    robot: Robot, sequences: Sequence[StateSequence], *, friction: float, warm_up: int, most: int
) -> list[QuadraticProgram]:
    """Programs of our controller, evenly spread over the recorded states.

    There are ``most`` of them in all; the warm-up of each sequence is left out.
    """
    controller = make_whole_body(robot, friction)
    programs = []
    each = max(most // max(len(sequences), 1), 1)
    for sequence in sequences:
        states = sequence.states[min(warm_up, len(sequence) - 1) :]
        for i in np.unique(np.linspace(0, len(states) - 1, min(each, len(states))).astype(int)):
            controller.prepare(states[i])
            programs.append(deepcopy(controller.build(states[i]).program))
    return programs


def compare_solvers(
    programs: Sequence[QuadraticProgram], names: Mapping[str, Mapping[str, Any]] | None = None, repetitions: int = 2
) -> dict[str, Any]:
    """Solve all programs with all solvers, each from scratch.

    Returns:
        For each solver its version, the share of programs it says it solved, the largest violation of a constraint
        and the largest excess of the objective over the best one found (relative) by these solutions, and times,
        µs; or a ``reason`` why it has none.
    """
    names = SOLVERS if names is None else names
    if find_spec("qpsolvers") is None:
        return {name: {"reason": "not installed: qpsolvers"} for name in names}
    import qpsolvers

    result: dict[str, Any] = {}
    solutions: dict[str, list[Vector | None]] = {}
    for name, settings in names.items():
        if name not in qpsolvers.available_solvers:
            result[name] = {"reason": "not installed"}
            continue
        problems = [_problem(program, name in _SPARSE) for program in programs]
        found: list[Vector | None] = []
        laps = np.zeros((repetitions, len(problems)), dtype=np.int64)
        try:
            with warnings.catch_warnings(), without_gc():
                warnings.simplefilter("ignore")
                overhead = timer_overhead()
                qpsolvers.solve_problem(problems[0], solver=name, **settings)
                for k in range(repetitions):
                    for i, problem in enumerate(problems):
                        t0 = perf_counter_ns()
                        solution = qpsolvers.solve_problem(problem, solver=name, **settings)
                        laps[k, i] = perf_counter_ns() - t0
                        if k == 0:
                            z = solution.x if solution.found else None
                            found.append(None if z is None else np.asarray(z, dtype=np.float64))
        except Exception as error:
            result[name] = {"reason": f"{type(error).__name__}: {last_line(str(error))}"}
            continue
        solutions[name] = found
        result[name] = {"version": _version(name), **summarise(list(laps), overhead)}
    best = _best(programs, list(solutions.values()))
    for name, found in solutions.items():
        pairs = [(i, z) for i, z in enumerate(found) if z is not None]
        violations = [programs[i].violation(z) for i, z in pairs]
        excesses = [(programs[i].objective(z) - best[i]) / max(abs(best[i]), 1.0) for i, z in pairs]
        result[name] |= {
            "solved": len(pairs) / len(programs),
            "violation_max": max(violations, default=None),
            "excess_max": max((e for e in excesses if np.isfinite(e)), default=None),
        }
    return result


def _problem(program: QuadraticProgram, sparse: bool) -> Any:
    import qpsolvers

    g, h = one_sided(program)
    convert: Any = csc_matrix if sparse else np.ascontiguousarray
    return qpsolvers.Problem(
        convert(program.hessian), program.gradient, convert(g), h, convert(program.equality), program.equality_value
    )


def _best(programs: Sequence[QuadraticProgram], solutions: Sequence[Sequence[Vector | None]]) -> list[float]:
    """Least objective of the feasible solutions of each program; NaN where there is none."""
    best = []
    for program, found in zip(programs, zip(*solutions, strict=True), strict=bool(solutions)):
        feasible = [z for z in found if z is not None and program.violation(z) <= _FEASIBLE]
        best.append(min(map(program.objective, feasible), default=float("nan")))
    return best


def _version(name: str) -> str:
    try:
        return version({"proxqp": "proxsuite"}.get(name, name))
    except PackageNotFoundError:
        return "unknown"
