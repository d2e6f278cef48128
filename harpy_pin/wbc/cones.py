"""Projection of a force onto its friction pyramid and range of normal force, in closed form, with
its derivative.

The pyramid has n faces, f_t · u_i ≤ μ f_z. Mirrors at the middle of every face and at every edge
map it onto itself, so the nearest point of the pyramid lies between the same two mirrors as the
force: at one face, with outward direction u, and one edge. With coordinates a along u, t ≥ 0 across
it and z upwards, the edge is the line (μ, κ μ, 1), κ = tan(π / n), and the nearest point is

    inside      the force itself                                      a ≤ μ z
    on a face   z' = (z + μ a) / (1 + μ²), a' = μ z', t' = t          t ≤ κ a'
    on an edge  z' = (z + μ (a + κ t)) / (1 + μ² (1 + κ²))            else

Squared distance as a function of z' alone is convex, so a range of z' clips it, and a' = min(a, μ
z'), t' = min(t, κ μ z') is then the nearest point at that height.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector


@kernel(g=(3,), faces=("n", 3), force=(3,))
def project(
    g: Vector, friction: float, lower: float, upper: float, faces: Vector, force: Vector
) -> int:
    """The nearest force to g in a pyramid and range.

    Args:
        g: (3,) any force, N; the third axis is the normal.
        friction: μ of the faces.
        lower: least normal force, not negative, N.
        upper: largest normal force, N.
        faces: (n, 3) outward directions u of the faces, n ≥ 3, with κ behind.
        force: (3,) the nearest force, out, N.

    Returns:
        A number of the piece of the pyramid's surface, on which the nearest force is a linear
        function of g (:func:`on_piece`).
    """
    face, outward = 0, faces[0, :2] @ g[:2]
    for i in range(1, faces.shape[0]):
        there = faces[i, :2] @ g[:2]
        if there > outward:
            face, outward = i, there
    ux, uy, kappa = faces[face, 0], faces[face, 1], faces[face, 2]
    across = ux * g[1] - uy * g[0]
    side = 1.0 if across > 0.0 else -1.0
    a, t, height = outward, abs(across), g[2]
    if a > friction * height:
        height = (g[2] + friction * a) / (1.0 + friction**2)
        if t > kappa * friction * height:
            height = (g[2] + friction * (a + kappa * t)) / (1.0 + friction**2 * (1.0 + kappa**2))
    end = 1 if height < lower else 2 if height > upper else 0
    height = min(max(height, lower), upper)
    on_face = a > friction * height
    on_edge = on_face and t > kappa * friction * height
    a, t = min(a, friction * height), side * min(t, kappa * friction * height)
    force[:] = a * ux - t * uy, a * uy + t * ux, height
    if not on_face:
        return end
    return end + 3 * (1 + face + (faces.shape[0] * (2 if side > 0.0 else 1) if on_edge else 0))


@kernel(faces=("n", 3), offset=(3,), derivative=(3, 3))
def on_piece(
    piece: int,
    friction: float,
    lower: float,
    upper: float,
    faces: Vector,
    offset: Vector,
    derivative: Vector,
) -> None:
    """The nearest force on a piece, as a linear function of the force: derivative · g + offset.

    Args:
        piece: as :func:`project` returns it.
        friction: μ of the faces.
        lower: least normal force, N.
        upper: largest normal force, N.
        faces: (n, 3), see :func:`project`.
        offset: (3,) out, N.
        derivative: (3, 3) out, symmetric.
    """
    end, place = piece % 3, piece // 3 - 1
    free, height = 1.0 if end == 0 else 0.0, lower if end == 1 else upper if end == 2 else 0.0
    if place < 0:
        derivative[:] = np.eye(3)
        derivative[2, 2] = free
        offset[:] = 0.0, 0.0, height
        return
    edge = place // faces.shape[0]
    ux, uy, kappa = faces[place % faces.shape[0]]
    slope = 0.0 if edge == 0 else kappa * friction if edge == 2 else -kappa * friction
    rise = np.array([friction * ux - slope * uy, friction * uy + slope * ux, 1.0])
    derivative[:] = np.outer(rise, rise) * (free / (rise @ rise))
    if edge == 0:
        level = np.array([-uy, ux, 0.0])
        derivative += np.outer(level, level)
    offset[:] = height * rise
