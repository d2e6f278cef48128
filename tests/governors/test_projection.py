from __future__ import annotations

import numpy as np
import quadprog
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linprog

from harpy_pin.governors.reduced.projection import project

COUNT = 20_000
FAMILIES = ("general", "opposite", "duplicate", "inside", "coplanar", "parallel faces", "zero row", "tip")


def solve(rows, bounds, point):
    out = np.zeros(3)
    return out, project(rows, bounds, point, out, np.empty((3, len(rows))))


def problem(rng, family):
    """Unit rows, bounds and a point; about a third of the general ones are infeasible."""
    n = int(rng.integers(3, 12))
    rows = rng.normal(size=(n, 3))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    point, bounds = 3.0 * rng.normal(size=3), rng.normal(size=n) - 0.5
    if family == "opposite":
        rows[1] = -rows[0]
    elif family == "duplicate":
        rows[1], rows[2] = rows[0], rows[0]
    elif family == "inside":
        bounds = rows @ point - np.abs(rng.normal(size=n))
    elif family == "coplanar":
        rows[2] = 0.3 * rows[0] + 0.7 * rows[1]
        rows[2] /= max(np.linalg.norm(rows[2]), 1e-6)
    elif family == "parallel faces":
        rows[:] = rows[0]
    elif family == "zero row":
        rows[0], bounds[0] = 0.0, -abs(bounds[0])
    elif family == "tip":
        # A friction pyramid whose faces all meet in one point, and the point below it.
        mu = rng.uniform(0.1, 1.0)
        faces = np.array([[-1.0, 0.0, mu], [1.0, 0.0, mu], [0.0, -1.0, mu], [0.0, 1.0, mu]]) / np.hypot(1.0, mu)
        rows, bounds, point = faces, np.zeros(4), np.array([*0.1 * rng.normal(size=2), -rng.uniform(0.5, 3.0)])
    return rows, bounds, point


def reference(rows, bounds, point):
    """The same by Goldfarb and Idnani's method, zero rows left out; None where infeasible."""
    used = np.linalg.norm(rows, axis=1) > 0.0
    try:
        return quadprog.solve_qp(np.eye(3), point, rows[used].T.copy(), bounds[used])[0]
    except ValueError:
        return None


def test_equals_a_qp_solver_and_a_linear_program():
    """20,000 problems, degenerate families among them: the QP's point to 1e-9, the LP's least violation to 1e-9."""
    rng = np.random.default_rng(0)
    worst, feasible, infeasible = 0.0, 0, 0
    for i in range(COUNT):
        rows, bounds, point = problem(rng, FAMILIES[i % len(FAMILIES)])
        out, violation = solve(rows, bounds, point)
        assert np.isfinite(out).all()
        if violation == 0.0:
            feasible += 1
            expected = reference(rows, bounds, point)
            assert expected is not None
            worst = max(worst, float(np.abs(out - expected).max() / (1.0 + np.abs(expected).max())))
            continue
        infeasible += 1
        assert abs(max((bounds - rows @ out).max(), 0.0) - violation) < 1e-7
        if infeasible % 20 == 0:
            lp = linprog(
                [0.0, 0.0, 0.0, 1.0],
                A_ub=np.hstack((-rows, -np.ones((len(rows), 1)))),
                b_ub=-bounds,
                bounds=[(None, None)] * 3 + [(0.0, None)],
            )
            assert abs(lp.fun - violation) < 1e-9 * (1.0 + violation)
    assert feasible > 0.4 * COUNT
    assert infeasible > 0.1 * COUNT
    assert worst < 1e-9


@given(st.integers(0, 2**31), st.sampled_from(FAMILIES))
def test_optimality_conditions(seed, family):
    """The step is a non-negative combination of active rows, to 1e-9: no other solver asked."""
    rows, bounds, point = problem(np.random.default_rng(seed), family)
    out, violation = solve(rows, bounds, point)
    slack = rows @ out - bounds + violation
    scale = 1.0 + np.abs(point).max() + np.abs(bounds).max()
    assert slack.min() > -1e-7 * scale if violation > 0.0 else slack.min() > -1e-9 * scale
    if violation == 0.0:
        from scipy.optimize import nnls

        active = rows[slack < 1e-8 * scale]
        step = out - point
        residual = np.linalg.norm(step) if len(active) == 0 else nnls(active.T, step)[1]
        assert residual < 1e-9 * scale


@given(arrays(np.float64, (4, 3), elements=st.floats(-1, 1)), arrays(np.float64, 3, elements=st.floats(-5, 5)))
def test_never_expands(rows, point):
    """Projections on a convex set bring no two points further apart."""
    bounds = -np.ones(4)  # the origin is inside
    other = point + np.array([0.3, -0.2, 0.1])
    a, va = solve(rows, bounds, point)
    b, vb = solve(rows, bounds, other)
    assert va == vb == 0.0
    assert np.linalg.norm(a - b) <= np.linalg.norm(point - other) + 1e-7


def test_zero_row_that_cannot_hold():
    """A row that no point changes (equations.md W6): its violation is the least, and the rest still holds."""
    rows, bounds = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([2.0, 1.0])
    out, violation = solve(rows, bounds, np.zeros(3))
    assert violation == 2.0
    assert out[2] >= -1.0
    np.testing.assert_array_equal(out, 0.0)  # relaxed by two, the other row holds at the point itself
