"""The study of the optimum in six unknowns: what it compares, and what it counts."""

from __future__ import annotations

from comparison.studies import optima
from harpy_pin.wbc import WholeBodySolver

CASE = "legs of two joints trot"


def test_an_optimum_is_that_of_the_dense_program():
    row = optima._measured({"kind": "exact", "case": CASE, "states": 5, "seed": 0})
    assert row["optimal"] == 5
    assert all(0.0 < row[name] < 1e-6 for name in ("motion", "force", "torque"))


def test_a_force_beyond_its_range_is_counted(monkeypatch):
    job = {"kind": "admissible", "case": CASE, "states": 3, "seed": 0}
    assert optima._measured(job)["outside"] == 0
    solve = WholeBodySolver.solve

    def wrong(self, state):
        solution = solve(self, state)
        solution.force[:] = -1.0
        return solution

    monkeypatch.setattr(WholeBodySolver, "solve", wrong)
    assert optima._measured(job)["outside"] == 3
