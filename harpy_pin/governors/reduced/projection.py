"""Exact Euclidean projection on a handful of half-spaces in R³, in finitely many steps.

The projection of y₀ on {y : aₖᵀ y ≥ bₖ} is y₀ + Σ λₖ aₖ with λ ≥ 0 on active rows, and by Carathéodory's theorem for
cones linearly independent rows suffice: at most three. So every set of up to three rows is a candidate, and the first
whose multipliers are not negative and whose point satisfies all rows is the answer, duplicate and parallel rows
included. Where no point satisfies all rows, the least t with aₖᵀ y ≥ bₖ − t follows from the dual vertices, which have
at most four rows, and the projection is then on the set so relaxed.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

__all__ = ["project"]

FEASIBLE = 1e-10
"""Violation, relative to the numbers in a row, that counts as rounding."""
PARALLEL = 1e-22
"""Squared sine under which rows count as parallel, or as lying in one plane."""


@kernel(rows=("n", 3), bounds=("n",), point=(3,), out=(3,), work=(3, "n"))
def project(rows: Vector, bounds: Vector, point: Vector, out: Vector, work: Vector) -> float:
    """Project a point on {y : rows y ≥ bounds}.

    Args:
        rows: (n, 3) aₖ; of unit length where the violation is to be a distance.
        bounds: (n,) bₖ.
        point: (3,) y₀.
        out: (3,) the projection.
        work: (3, n) work space.

    Returns:
        Zero, or where the set is empty the least t ≥ 0 with rows y ≥ bounds − t for some y: ``out`` is then the point
        with that violation that is closest to y₀.
    """
    n = rows.shape[0]
    slack, tolerance, squared = work[0], work[1], work[2]
    inside = True
    for k in range(n):
        along = rows[k, 0] * point[0] + rows[k, 1] * point[1] + rows[k, 2] * point[2]
        squared[k] = rows[k, 0] ** 2 + rows[k, 1] ** 2 + rows[k, 2] ** 2
        size = abs(rows[k, 0] * point[0]) + abs(rows[k, 1] * point[1]) + abs(rows[k, 2] * point[2])
        slack[k] = along - bounds[k]
        tolerance[k] = FEASIBLE * (1.0 + size + abs(bounds[k]))
        if slack[k] < -tolerance[k]:
            inside = False
    for i in range(3):
        out[i] = point[i]
    if inside:
        return 0.0
    if _search(rows, slack, tolerance, squared, point, out):
        return 0.0
    excess = _least_violation(rows, bounds)
    for k in range(n):
        slack[k] += excess
        tolerance[k] += FEASIBLE * excess
    # The set may be a single point, met only to rounding that grows with the angles between the rows.
    for _ in range(6):
        if _search(rows, slack, tolerance, squared, point, out):
            break
        for k in range(n):
            tolerance[k] *= 10.0
    return excess


@kernel
def _satisfies(rows: Vector, slack: Vector, tolerance: Vector, dx: float, dy: float, dz: float) -> bool:
    for k in range(rows.shape[0]):
        if slack[k] + rows[k, 0] * dx + rows[k, 1] * dy + rows[k, 2] * dz < -tolerance[k]:
            return False
    return True


@kernel
def _moved(
    rows: Vector, slack: Vector, tolerance: Vector, point: Vector, dx: float, dy: float, dz: float, out: Vector
) -> bool:
    """Whether the point satisfies all rows once moved; if so, ``out`` is where it then is."""
    if not _satisfies(rows, slack, tolerance, dx, dy, dz):
        return False
    out[0], out[1], out[2] = point[0] + dx, point[1] + dy, point[2] + dz
    return True


@kernel
def _search(rows: Vector, slack: Vector, tolerance: Vector, squared: Vector, point: Vector, out: Vector) -> bool:
    """First set of up to three independent rows that is the support of the projection."""
    return (
        _moved(rows, slack, tolerance, point, 0.0, 0.0, 0.0, out)
        or _on_one_row(rows, slack, tolerance, squared, point, out)
        or _on_two_rows(rows, slack, tolerance, squared, point, out)
        or _on_three_rows(rows, slack, tolerance, squared, point, out)
    )


@kernel
def _on_one_row(rows: Vector, slack: Vector, tolerance: Vector, squared: Vector, point: Vector, out: Vector) -> bool:
    for i in range(rows.shape[0]):
        if slack[i] < 0.0 and squared[i] > 0.0:
            step = -slack[i] / squared[i]
            dx, dy, dz = step * rows[i, 0], step * rows[i, 1], step * rows[i, 2]
            if _moved(rows, slack, tolerance, point, dx, dy, dz, out):
                return True
    return False


@kernel
def _on_two_rows(rows: Vector, slack: Vector, tolerance: Vector, squared: Vector, point: Vector, out: Vector) -> bool:
    n = rows.shape[0]
    for i in range(n):
        if squared[i] == 0.0:
            continue
        for j in range(i + 1, n):
            # A support holds a row that the point itself violates.
            if squared[j] == 0.0 or (slack[i] >= 0.0 and slack[j] >= 0.0):
                continue
            dot = rows[i, 0] * rows[j, 0] + rows[i, 1] * rows[j, 1] + rows[i, 2] * rows[j, 2]
            det = squared[i] * squared[j] - dot * dot
            if det <= PARALLEL * squared[i] * squared[j]:
                continue
            p = (-slack[i] * squared[j] + slack[j] * dot) / det
            q = (-slack[j] * squared[i] + slack[i] * dot) / det
            if p < 0.0 or q < 0.0:
                continue
            dx = p * rows[i, 0] + q * rows[j, 0]
            dy = p * rows[i, 1] + q * rows[j, 1]
            dz = p * rows[i, 2] + q * rows[j, 2]
            if _moved(rows, slack, tolerance, point, dx, dy, dz, out):
                return True
    return False


@kernel
def _on_three_rows(rows: Vector, slack: Vector, tolerance: Vector, squared: Vector, point: Vector, out: Vector) -> bool:
    n = rows.shape[0]
    for i in range(n):
        for j in range(i + 1, n):
            cx = rows[i, 1] * rows[j, 2] - rows[i, 2] * rows[j, 1]
            cy = rows[i, 2] * rows[j, 0] - rows[i, 0] * rows[j, 2]
            cz = rows[i, 0] * rows[j, 1] - rows[i, 1] * rows[j, 0]
            if cx * cx + cy * cy + cz * cz <= PARALLEL * squared[i] * squared[j]:
                continue
            for k in range(j + 1, n):
                if slack[i] >= 0.0 and slack[j] >= 0.0 and slack[k] >= 0.0:
                    continue
                det = cx * rows[k, 0] + cy * rows[k, 1] + cz * rows[k, 2]
                if det * det <= PARALLEL * squared[i] * squared[j] * squared[k]:
                    continue
                # Where the three planes meet: d = −(sᵢ aⱼ×aₖ + sⱼ aₖ×aᵢ + sₖ aᵢ×aⱼ) / det.
                ux = rows[j, 1] * rows[k, 2] - rows[j, 2] * rows[k, 1]
                uy = rows[j, 2] * rows[k, 0] - rows[j, 0] * rows[k, 2]
                uz = rows[j, 0] * rows[k, 1] - rows[j, 1] * rows[k, 0]
                vx = rows[k, 1] * rows[i, 2] - rows[k, 2] * rows[i, 1]
                vy = rows[k, 2] * rows[i, 0] - rows[k, 0] * rows[i, 2]
                vz = rows[k, 0] * rows[i, 1] - rows[k, 1] * rows[i, 0]
                dx = -(slack[i] * ux + slack[j] * vx + slack[k] * cx) / det
                dy = -(slack[i] * uy + slack[j] * vy + slack[k] * cy) / det
                dz = -(slack[i] * uz + slack[j] * vz + slack[k] * cz) / det
                # Multipliers: d = p aᵢ + q aⱼ + r aₖ.
                p = (dx * ux + dy * uy + dz * uz) / det
                q = (dx * vx + dy * vy + dz * vz) / det
                r = (dx * cx + dy * cy + dz * cz) / det
                if p < 0.0 or q < 0.0 or r < 0.0:
                    continue
                if _moved(rows, slack, tolerance, point, dx, dy, dz, out):
                    return True
    return False


@kernel
def _det(rows: Vector, i: int, j: int, k: int) -> float:
    return float(
        rows[i, 0] * (rows[j, 1] * rows[k, 2] - rows[j, 2] * rows[k, 1])
        + rows[i, 1] * (rows[j, 2] * rows[k, 0] - rows[j, 0] * rows[k, 2])
        + rows[i, 2] * (rows[j, 0] * rows[k, 1] - rows[j, 1] * rows[k, 0])
    )


@kernel
def _least_violation(rows: Vector, bounds: Vector) -> float:
    """max λᵀb over λ ≥ 0, Σλ = 1, Σ λₖ aₖ = 0, over the vertices of that set."""
    n = rows.shape[0]
    best = 0.0
    for i in range(n):
        si = np.sqrt(rows[i, 0] ** 2 + rows[i, 1] ** 2 + rows[i, 2] ** 2)
        if si == 0.0:
            best = max(best, bounds[i])
            continue
        for j in range(i + 1, n):
            sj = np.sqrt(rows[j, 0] ** 2 + rows[j, 1] ** 2 + rows[j, 2] ** 2)
            if sj == 0.0:
                continue
            cx = rows[i, 1] * rows[j, 2] - rows[i, 2] * rows[j, 1]
            cy = rows[i, 2] * rows[j, 0] - rows[i, 0] * rows[j, 2]
            cz = rows[i, 0] * rows[j, 1] - rows[i, 1] * rows[j, 0]
            normal = cx * cx + cy * cy + cz * cz
            if normal <= PARALLEL * si * si * sj * sj:
                dot = rows[i, 0] * rows[j, 0] + rows[i, 1] * rows[j, 1] + rows[i, 2] * rows[j, 2]
                if dot < 0.0:
                    best = max(best, (sj * bounds[i] + si * bounds[j]) / (si + sj))
                continue
            for k in range(j + 1, n):
                sk = np.sqrt(rows[k, 0] ** 2 + rows[k, 1] ** 2 + rows[k, 2] ** 2)
                det = cx * rows[k, 0] + cy * rows[k, 1] + cz * rows[k, 2]
                if det * det <= PARALLEL * normal * sk * sk:
                    # In one plane: areas in that plane.
                    p = (rows[j, 1] * rows[k, 2] - rows[j, 2] * rows[k, 1]) * cx
                    p += (rows[j, 2] * rows[k, 0] - rows[j, 0] * rows[k, 2]) * cy
                    p += (rows[j, 0] * rows[k, 1] - rows[j, 1] * rows[k, 0]) * cz
                    q = (rows[k, 1] * rows[i, 2] - rows[k, 2] * rows[i, 1]) * cx
                    q += (rows[k, 2] * rows[i, 0] - rows[k, 0] * rows[i, 2]) * cy
                    q += (rows[k, 0] * rows[i, 1] - rows[k, 1] * rows[i, 0]) * cz
                    if p >= 0.0 and q >= 0.0:
                        value = (p * bounds[i] + q * bounds[j] + normal * bounds[k]) / (p + q + normal)
                        best = max(best, value)
                    continue
                sign = 1.0 if det > 0.0 else -1.0
                for m in range(k + 1, n):
                    # Σ λ a = 0 with the signed volumes for λ, which must agree in sign.
                    w = sign * det
                    x = -sign * _det(rows, j, k, m)
                    y = sign * _det(rows, i, k, m)
                    z = -sign * _det(rows, i, j, m)
                    if x >= 0.0 and y >= 0.0 and z >= 0.0:
                        total = x + y + z + w
                        value = (x * bounds[i] + y * bounds[j] + z * bounds[k] + w * bounds[m]) / total
                        best = max(best, value)
    return best
