"""Public benchmarks: read from small clones that the tests make in their formats, and solved like
everybody's.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
from qpsolvers import Problem, Solution
from scipy.io import savemat
from scipy.sparse import csc_matrix

from comparison.cli import app
from comparison.public import solvers
from comparison.public.solvers import KEYS, solve_with_dual, time_solvers
from comparison.public.study import SOURCES, is_convex, mat_problems, measure_public, npz_problems
from harpy_pin.errors import InputError

MPC = Problem(
    np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, 1.0]), -np.eye(2), np.array([0.0, -0.2])
)
"""Its second row is active: x = (0, 0.2) would need a positive slope along x₁, so x₁ = −0.55 is cut
at 0.
"""


def arrays(problem: Problem) -> dict[str, object]:
    return {key: getattr(problem, key) for key in KEYS}


def drawn(rng: np.random.Generator, n: int = 6) -> Problem:
    """A feasible convex program with everything that a program can have; one equality is there
    twice.
    """
    root, inside = rng.standard_normal((n, n)), rng.standard_normal(n)
    rows, equal = rng.standard_normal((2 * n, n)), rng.standard_normal((2, n))
    equal = np.vstack((equal, equal[:1]))
    lower = np.where(rng.random(n) < 0.5, -np.inf, inside - 0.3)
    upper = np.where(rng.random(n) < 0.5, np.inf, inside + 0.3)
    margin = np.where(rng.random(2 * n) < 0.5, 0.0, 0.2)
    hessian = root @ root.T + 0.1 * np.eye(n)
    q = 3.0 * rng.standard_normal(n)
    return Problem(hessian, q, rows, rows @ inside + margin, equal, equal @ inside, lower, upper)


def clone(folder: Path, name: str) -> Path:
    """The folder that is read of a repository."""
    path = folder / Path(SOURCES[name]).name / "data"
    path.mkdir(parents=True)
    return path


def test_dual_method_solves_whatever_is_strictly_convex():
    rng = np.random.default_rng(3)
    for _ in range(60):
        problem = drawn(rng, int(rng.integers(3, 9)))
        solution = solve_with_dual(problem)
        assert solution.is_optimal(1e-8)
        again = qpsolvers.solve_problem(problem, solver="daqp")
        assert solution.x == pytest.approx(again.x, abs=1e-5)


def test_contradicting_constraints_have_no_answer():
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    assert not solve_with_dual(Problem(np.eye(2), np.zeros(2), rows, np.array([-1.0, -1.0]))).found


def test_every_solver_is_judged_alike():
    problems = [("LIPMWALK0", MPC), ("drawn", drawn(np.random.default_rng(5)))]
    told = []
    found = time_solvers(problems, 1, lambda done, total: told.append((done, total)))
    assert told == [(1, 2), (2, 2)]
    for name, levels in found.items():
        claimed = (
            50.0 if name == "quadprog" else 100.0
        )  # it refuses the equality that is there twice
        assert all(level["claimed_percent"] == claimed for level in levels.values()), name
    for name in ("dual (ours)", "dual (ours), memory kept", "daqp", "daqp, without qpsolvers"):
        assert found[name]["high"]["solved_percent"] == 100.0


def test_a_solver_that_raises_or_errs_has_not_solved(monkeypatch):
    def raising(p, eps):
        def solve():
            raise ValueError("no")

        return solve, lambda result: result

    def wrong(p, eps):
        return lambda: None, lambda _: Solution(p, found=True, x=np.ones(2), z=np.zeros(2))

    monkeypatch.setattr(solvers, "SOLVERS", {"raising": raising, "wrong": wrong})
    found = time_solvers([("LIPMWALK0", MPC)], 1)
    raised, erred = found["raising"]["low"], found["wrong"]["low"]
    assert (raised["claimed_percent"], raised["solved_percent"], raised["median_us"]) == (
        0.0,
        0.0,
        None,
    )
    assert raised["shifted_mean_us"] == pytest.approx(10e6)
    assert (erred["claimed_percent"], erred["solved_percent"]) == (100.0, 0.0)


def test_programs_of_numpy_are_read_and_nothing_is_unpickled(tmp_path):
    folder = clone(tmp_path, "mpc")
    MPC.save(str(folder / "LIPMWALK0.npz"))
    ((name, problem),) = npz_problems(folder)
    assert name == "LIPMWALK0"
    for key, value in arrays(MPC).items():
        assert (
            np.array_equal(getattr(problem, key), value)
            if value is not None
            else getattr(problem, key) is None
        )

    class Trap:
        def __reduce__(self):
            return Path.touch, (tmp_path / "sprung",)

    empty = np.array(None)
    np.savez(
        folder / "LIPMWALK1.npz",
        **{**arrays(MPC), "A": np.array(Trap()), "b": empty, "lb": empty, "ub": empty},
    )
    assert len(list(npz_problems(folder))) == 2
    assert not (tmp_path / "sprung").exists()
    (folder / "WHLIPBAL0.npz").write_text("no file of NumPy")
    with pytest.raises(InputError, match="WHLIPBAL0"):
        list(npz_problems(folder))


def test_programs_of_matlab_are_those_with_one_side(tmp_path):
    folder = clone(tmp_path, "maros")
    rows = np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    lower, upper = np.array([1.0, -1e20, 0.0, -1e20]), np.array([1.0, 0.2, 1e20, 0.3])
    parts = {"P": csc_matrix(np.diag([2.0, 4.0])), "q": np.zeros((2, 1)), "A": csc_matrix(rows)}
    savemat(
        folder / "SMALL.mat", {**parts, "l": lower[:, None], "u": upper[:, None], "n": 2, "m": 4}
    )
    savemat(
        folder / "FLAT.mat",
        {**parts, "P": csc_matrix((2, 2)), "l": lower, "u": upper, "n": 2, "m": 4},
    )
    flat, (name, small) = mat_problems(folder)
    assert is_convex((name, small))
    assert not is_convex(flat)
    assert small.A.tolist() == [[1.0, 1.0]]
    assert small.G.tolist() == [[1.0, -1.0]]
    assert (small.h.tolist(), small.b.tolist()) == ([0.2], [1.0])
    assert (small.lb.tolist(), small.ub.tolist()) == ([0.0, -np.inf], [np.inf, 0.3])
    # On x₁ + x₂ = 1 with x₂ ≤ 0.3 and x₁ − x₂ ≤ 0.2 nothing is left.
    assert not solve_with_dual(small).found
    (folder / "SMALL.mat").write_bytes(b"")
    with pytest.raises(InputError, match="SMALL"):
        list(mat_problems(folder))


def test_command_measures_what_is_there(tmp_path, capsys):
    MPC.save(str(clone(tmp_path, "mpc") / "LIPMWALK0.npz"))
    app(
        ["public", "--data", str(tmp_path), "--quick", "--json", str(tmp_path / "a.json")],
        standalone_mode=False,
    )
    told = capsys.readouterr().out
    assert "1 dense programs of mpc_qpbenchmark" in told
    assert "no evidence" in told.splitlines()[-1]
    assert "git clone https://github.com/qpsolvers/maros" in told.replace("\n", " ")
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["mpc"]["problems"] == 1
    assert found["mpc"]["solvers"]["dual (ours)"]["high"]["solved_percent"] == 100.0
    assert "maros" not in found


def test_a_folder_without_repositories_is_refused(tmp_path):
    with pytest.raises(InputError) as error:
        measure_public(tmp_path / "nothing")
    for repository in SOURCES.values():
        assert f"git clone https://github.com/{repository} " in str(error.value)
