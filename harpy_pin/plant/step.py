"""One time step of a robot in contact, implicit in the contact forces.

Solves (M + dt B)(v⁺ − v) = dt (S τ + J_tᵀ u_t − n − B v + J_fᵀ f) together with the ground's law for f at the end of
the step (:func:`harpy_pin.plant.ground.contact_step`). B is the joint damping. The velocity of a foot includes
½ dt J̇ v, so that a foot at rest stays where it is to third order in dt.
"""

from __future__ import annotations

from numba import njit

from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.contact_map import unconstrained_drive
from harpy_pin.plant.ground import contact_step

__all__ = ["MAX_SWEEPS", "implicit_step"]

LEAST_MOBILITY = 1e-9
"""Least inverse mass of a foot in any direction, 1/kg: a planar model cannot move its feet sideways at all."""
MAX_SWEEPS = 500
"""Limit of the contact solver's Gauss–Seidel iteration."""


@njit(cache=True)
def implicit_step(  # type: ignore[no-untyped-def]
    mass_matrix,
    bias,
    damping,
    v,
    torque,
    thrust,
    foot_jacobian,
    thruster_jacobian,
    foot_drift,
    foot_position,
    dt,
    ground,
    force,
    mobility,
    work,
    displacement,
):
    """Contact forces, velocity v at the end of the step and displacement dt v; returns the contact solver's sweeps."""
    nv = v.shape[0]
    nc = force.shape[0]
    factor = work[:nv, :nv]
    columns = work[nv : 2 * nv]  # L⁻ᵀ [J_fᵀ, dt·(generalised force)], M + dt B = Lᵀ L
    height = work[2 * nv, : nc // 3]
    free = work[2 * nv + 1, :nc]
    change = displacement  # holds the generalised force, then v⁺ − v
    unconstrained_drive(bias, damping, v, thruster_jacobian, torque, thrust, change)
    for i in range(nv):
        for j in range(i + 1):
            factor[i, j] = mass_matrix[i, j]
        factor[i, i] += dt * damping[i]
        for c in range(nc):
            columns[i, c] = foot_jacobian[c, i]
        columns[i, nc] = dt * change[i]
    factorise(factor, factor)
    solve_transposed(factor, columns, nc + 1)
    # Velocity of the feet without contact forces, and its change per force.
    for a in range(nc):
        free[a] = 0.5 * dt * foot_drift[a]
        for i in range(nv):
            free[a] += foot_jacobian[a, i] * v[i]
        for b in range(a + 1):
            mobility[a, b] = 0.0
    for i in range(nv):
        for a in range(nc):
            x = columns[i, a]
            if x != 0.0:
                free[a] += x * columns[i, nc]
                for b in range(a + 1):
                    mobility[a, b] += x * columns[i, b]
    for a in range(nc):
        mobility[a, a] = max(mobility[a, a], LEAST_MOBILITY)
        for b in range(a + 1):
            mobility[a, b] *= dt
            mobility[b, a] = mobility[a, b]
    for k in range(nc // 3):
        height[k] = foot_position[k, 2]
    sweeps = contact_step(mobility, free, height, dt, ground, force, 1e-10, MAX_SWEEPS)
    for i in range(nv):
        change[i] = columns[i, nc]
        for c in range(nc):
            change[i] += dt * columns[i, c] * force[c]
    solve_factor(factor, change.reshape((nv, 1)), 1)
    for i in range(nv):
        v[i] += change[i]
        displacement[i] = dt * v[i]
    return sweeps
