"""QP solvers of others on one program whose solution is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from comparison.measure.verification import one_sided
from comparison.peers.solvers import compare_solvers
from harpy_pin.wbc import QuadraticProgram


def known_program() -> QuadraticProgram:
    """Nearest point to (2, 3) on x + y = 1 with |x| ≤ 1 and y ≤ ∞: (0, 1)."""
    program = QuadraticProgram(2, equalities=1, inequalities=0, bounded=2)
    program.hessian[:], program.gradient[:] = np.eye(2), (-2.0, -3.0)
    program.equality[:], program.equality_value[:] = 1.0, 1.0
    program.lower[0], program.upper[0] = -1.0, 1.0
    return program


def test_program_knows_objective_violation_and_one_sided_form() -> None:
    program = known_program()
    assert program.objective(np.array([0.0, 1.0])) == pytest.approx(-2.5)
    assert program.violation(np.array([0.0, 1.0])) == 0.0
    assert program.violation(np.array([0.0, 1.5])) == pytest.approx(0.5)
    assert program.violation(np.array([-3.0, 4.0])) == pytest.approx(2.0)
    g, h = one_sided(program)
    np.testing.assert_array_equal(g, [[1.0, 0.0], [-1.0, 0.0]])
    np.testing.assert_array_equal(h, [1.0, 1.0])


def test_solvers_on_a_known_program() -> None:
    pytest.importorskip("qpsolvers")
    result = compare_solvers([known_program()] * 3)
    ran = {name: entry for name, entry in result.items() if "reason" not in entry}
    assert {"proxqp", "daqp", "quadprog", "osqp", "piqp", "clarabel"} == set(ran)
    for entry in ran.values():
        assert entry["solved"] == 1.0
        assert entry["violation_max"] < 1e-5
        assert abs(entry["excess_max"]) < 1e-5
        assert entry["samples"] == 6


def test_a_solver_that_is_wrong_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    qpsolvers = pytest.importorskip("qpsolvers")
    inner = qpsolvers.solve_problem
    points = {"proxqp": [0.25, 0.75], "osqp": [0.5, 1.0], "piqp": None}

    def solve(problem: Any, solver: str, **settings: Any) -> Any:
        solution = inner(problem, solver="daqp")
        if solver in points:
            solution.x = None if points[solver] is None else np.array(points[solver])
            solution.found = points[solver] is not None
        if solver == "clarabel":
            raise RuntimeError("first line\nlast line")
        return solution

    monkeypatch.setattr(qpsolvers, "solve_problem", solve)
    result = compare_solvers([known_program()], {name: {} for name in ("daqp", *points, "clarabel", "absent")})
    assert result["proxqp"]["excess_max"] == pytest.approx(0.0625 / 2.5)
    assert result["osqp"]["violation_max"] == pytest.approx(0.5)
    assert result["daqp"]["excess_max"] == pytest.approx(0.0, abs=1e-9), "an infeasible point is no best objective"
    assert result["piqp"]["solved"] == 0.0
    assert result["piqp"]["violation_max"] is None
    assert result["clarabel"]["reason"] == "RuntimeError: last line"
    assert result["absent"]["reason"] == "not installed"


def test_solvers_without_qpsolvers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("comparison.peers.solvers.find_spec", lambda name: None)
    result = compare_solvers([known_program()], {"daqp": {}})
    assert result == {"daqp": {"reason": "not installed: qpsolvers"}}
