"""The quadratic program of the preview: contact forces that bring the body along its path.

With accelerations summed up, places and velocities are linear in the forces of the feet on the
ground, which are the only unknowns: some 60 for a horizon of twelve intervals. They are divided by
the mass, so that robots of all sizes have programs of one scale. Each force is within a friction
pyramid. ProxQP (dense) solves it.
"""

from typing import NamedTuple

import numpy as np
import proxsuite
from numpy.typing import NDArray

from harpy_pin.contrib.preview.model import sums
from harpy_pin.errors import HarpyError
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import UNBOUNDED

TOLERANCE = 1e-6
"""Of the optimality conditions, in the units of the program: some 0.02 m/s² in a force."""
MOST, MOST_INNER = 30, 30
"""Iterations of the solver, and of each of them, at most."""


class ForceProgram(NamedTuple):
    """Minimise ½ fᵀ H f + gᵀ f subject to l ≤ C f ≤ u, for the stacked forces per mass f, m/s².

    Attributes:
        hessian: H (3 n, 3 n).
        gradient: g (3 n,).
        rows: C (5 n, 3 n): four sides of each pyramid, and the normal force.
        lower: l (5 n,).
        upper: u (5 n,), m/s².
        effect: (2, N, 6, 3 n) places and velocities at the ends of the intervals, per force and
            mass.
    """

    hessian: Vector
    gradient: Vector
    rows: Vector
    lower: Vector
    upper: Vector
    effect: Vector


def force_program(
    gain: Vector,
    interval: NDArray[np.int64],
    times: Vector,
    missing: Vector,
    *,
    weights: Vector,
    force_weight: float,
    mu: float,
    most: float,
) -> ForceProgram:
    """The program of a horizon.

    Args:
        gain: (n, 6, 3) accelerations per force and mass.
        interval: (n,) in which interval each force acts.
        times: (N + 1,) at which the intervals begin and end, s.
        missing: (2, N, 6) places and velocities that are wanted, less those without forces.
        weights: (2, 6) of squared deviations in places and velocities, per time of the intervals.
        force_weight: of squared forces per mass.
        mu: friction coefficient.
        most: largest normal force per mass, m/s².
    """
    n, span = len(gain), np.diff(times)
    share = span / span.mean()
    effect = np.einsum("sif,fac->siafc", sums(times)[:, :, interval], gain)
    effect = effect.reshape(2, len(span), 6, 3 * n)
    # A product for each entry of the motion: one large one would wait for threads of BLAS
    rows = effect.transpose(0, 2, 3, 1)
    weighted = rows * weights[..., None, None] * share
    hessian = (weighted @ rows.transpose(0, 1, 3, 2)).sum(axis=(0, 1))
    hessian[np.diag_indices(3 * n)] += force_weight * np.repeat(share[interval], 3)
    gradient = -(weighted @ missing.transpose(0, 2, 1)[..., None]).sum(axis=(0, 1))[:, 0]
    sides = np.array(
        [[1.0, 0.0, -mu], [-1.0, 0.0, -mu], [0.0, 1.0, -mu], [0.0, -1.0, -mu], [0.0, 0.0, 1.0]]
    )
    lower, upper = np.tile((-UNBOUNDED,) * 4 + (0.0,), n), np.tile((0.0,) * 4 + (most,), n)
    return ForceProgram(hessian, gradient, np.kron(np.eye(n), sides), lower, upper, effect)


def solved(program: ForceProgram) -> Vector:
    """Forces per mass (n, 3), m/s², of the optimum.

    Raises:
        HarpyError: the solver has not found it in its iterations.
    """
    p = program
    n = len(p.gradient)
    if n == 0:
        return np.zeros((0, 3))
    proxqp, dense = proxsuite.proxqp, proxsuite.proxqp.dense
    qp = dense.QP(n, 0, len(p.lower))
    qp.settings.eps_abs, qp.settings.eps_rel = TOLERANCE, 0.0
    qp.settings.eps_primal_inf = qp.settings.eps_dual_inf = 0.0  # no force is always feasible
    qp.settings.max_iter, qp.settings.max_iter_in = MOST, MOST_INNER
    qp.init(p.hessian, p.gradient, None, None, p.rows, p.lower, p.upper)
    qp.solve()
    if qp.results.info.status != proxqp.PROXQP_SOLVED:
        raise HarpyError(f"the preview has no solution: {qp.results.info.status.name}")
    forces: Vector = np.array(qp.results.x).reshape(-1, 3)
    return forces
