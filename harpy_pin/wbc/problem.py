"""The whole-body quadratic program.

Decides z = [a; f; u]: generalised accelerations (nv), contact forces of the feet (3 each) and forces of the thrusters
(3 each).

    minimise    Σ w ‖task(z) − desired‖²
    subject to  M_b a + n_b = J_f,bᵀ f + J_t,bᵀ u             floating-base rows of the dynamics
                J_f a + J̇ v = a_foot  or  f = 0                a foot that is held, or in the air
                μ' f_z ∓ f_x ≥ 0, μ' f_z ∓ f_y ≥ 0            friction pyramid
                f_min ≤ f_z ≤ f_max
                −τ_max ≤ M_j a + n_j + B v − J_f,jᵀ f − J_t,jᵀ u ≤ τ_max
                |u| ≤ box inside the thrusters' limit

The sizes never change: the row block of a foot switches between holding it and taking its force away, so one solver
keeps its memory and its warm start through touchdown and lift-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.dynamics import Dynamics
from harpy_pin.errors import InputError
from harpy_pin.robot import Robot
from harpy_pin.state import Vector

__all__ = ["WholeBodyLimits", "WholeBodyProblem", "WholeBodyTargets", "WholeBodyWeights"]


@dataclass(frozen=True, kw_only=True)
class WholeBodyWeights:
    """Weights of the tasks, on squared accelerations (m/s², rad/s²) and forces (N).

    Attributes:
        body: linear acceleration of the body.
        orientation: angular acceleration of the body.
        swing: acceleration of a foot in the air.
        posture: joint accelerations.
        thrust: thruster forces.
        force: contact forces.
    """

    body: float = 1.0
    orientation: float = 0.1
    swing: float = 0.1
    posture: float = 1e-6
    thrust: float = 1e-3
    force: float = 1e-5

    def __post_init__(self) -> None:
        for name in ("body", "orientation", "swing", "posture", "thrust", "force"):
            checks.number(f"weight {name}", getattr(self, name), low=0.0)
        if min(self.posture, self.thrust, self.force) <= 0.0:
            raise InputError("the weights of posture, thrust and force must be positive: they make the optimum unique")

    @property
    def packed(self) -> Vector:
        """(6,) in the order of the attributes."""
        return np.array([self.body, self.orientation, self.swing, self.posture, self.thrust, self.force])


@dataclass(frozen=True, kw_only=True)
class WholeBodyLimits:
    """Constraints of the problem.

    Attributes:
        mu: friction coefficient of the ground.
        pyramid: half-width of the pyramid's section relative to μ f_z; 1/√2 inscribes it in Coulomb's disc.
        lateral_thrust: share of the thrust limit allowed along world x and y each; the rest of the box goes to z, so
            that every point of it is within the limit.
        torque_scale: share of the motors' peak torque used.
    """

    mu: float = 0.25
    pyramid: float = float(np.sqrt(0.5))
    lateral_thrust: float = 0.4
    torque_scale: float = 1.0

    def __post_init__(self) -> None:
        checks.number("mu", self.mu, low=0.0)
        checks.number("pyramid", self.pyramid, low=0.0, high=1.0, strict=True)
        checks.number("lateral_thrust", self.lateral_thrust, low=0.0, high=0.7)
        checks.number("torque_scale", self.torque_scale, low=0.0, strict=True)


@dataclass(slots=True)
class WholeBodyTargets:
    """What the tasks ask for, and which feet are held.

    Attributes:
        body: (3,) acceleration of the body's origin, world axes, m/s².
        orientation: (3,) angular acceleration of the body, body axes, rad/s².
        feet: (feet, 3) accelerations of the feet, world axes, m/s²: a task in the air, a constraint when held.
        joints: (joints,) accelerations of the posture task, rad/s².
        held: (feet,) 1 where a foot is held on the ground, else 0.
        force_range: (feet, 2) f_min and f_max of each foot that is held, N.
    """

    body: Vector
    orientation: Vector
    feet: Vector
    joints: Vector
    held: Vector
    force_range: Vector

    @classmethod
    def zeros(cls, robot: Robot) -> WholeBodyTargets:
        """No motion, every foot held with any force."""
        feet = len(robot.feet)
        return cls(
            np.zeros(3),
            np.zeros(3),
            np.zeros((feet, 3)),
            np.zeros(len(robot.joints)),
            np.ones(feet),
            np.tile([0.0, 1e4], (feet, 1)),
        )


class WholeBodyProblem:
    """Arrays of the program, filled by :meth:`build`: ½ zᵀH z + gᵀz, A z = b, l ≤ C z ≤ u.

    Args:
        robot: any robot with feet; thrusters may be absent.
        weights: of the tasks.
        limits: of the constraints.

    Attributes:
        hessian: (n, n) H.
        gradient: (n,) g.
        equality: (n_eq, n) A.
        equality_value: (n_eq,) b.
        inequality: (n_in, n) C.
        lower: (n_in,) l.
        upper: (n_in,) u.
    """

    def __init__(
        self, robot: Robot, weights: WholeBodyWeights | None = None, limits: WholeBodyLimits | None = None
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights()
        self.limits = limits if limits is not None else WholeBodyLimits()
        self.nv, feet, thrusters, joints = (
            robot.model.nv,
            len(robot.feet),
            len(robot.thrusters),
            len(robot.joints),
        )
        self.n_force, self.n_thrust = 3 * feet, 3 * thrusters
        n = self.nv + self.n_force + self.n_thrust
        n_eq = 6 + self.n_force
        n_in = 5 * feet + joints + self.n_thrust
        self.hessian: Vector = np.zeros((n, n))
        self.gradient: Vector = np.zeros(n)
        self.equality: Vector = np.zeros((n_eq, n))
        self.equality_value: Vector = np.zeros(n_eq)
        self.inequality: Vector = np.zeros((n_in, n))
        self.lower: Vector = np.zeros(n_in)
        self.upper: Vector = np.zeros(n_in)
        self.damping: Vector = np.array(robot.model.damping, dtype=np.float64)
        self._weights = self.weights.packed
        self._torque_limit = self.limits.torque_scale * robot.torque_limit
        if thrusters:
            side = self.limits.lateral_thrust * robot.thrust_limit
            up = robot.thrust_limit * np.sqrt(1.0 - 2.0 * self.limits.lateral_thrust**2)
            box = np.tile([side, side, up], thrusters)
            self.lower[-self.n_thrust :] = -box
            self.upper[-self.n_thrust :] = box
            self.inequality[-self.n_thrust :, -self.n_thrust :] = np.eye(self.n_thrust)
        mu = self.limits.mu * self.limits.pyramid
        for k in range(feet):
            x = self.nv + 3 * k
            for row, (axis, sign) in enumerate(((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0))):
                self.inequality[5 * k + row, x + axis] = sign
                self.inequality[5 * k + row, x + 2] = mu
            self.inequality[5 * k + 4, x + 2] = 1.0
            self.upper[5 * k : 5 * k + 4] = 1e20

    def build(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """Fill in the arrays.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.
        """
        _build(
            dynamics.mass_matrix,
            dynamics.bias,
            self.damping,
            dynamics.foot_jacobian,
            dynamics.foot_drift,
            dynamics.thruster_jacobian,
            v,
            rotation,
            targets.body,
            targets.orientation,
            targets.feet,
            targets.joints,
            targets.held,
            targets.force_range,
            self._weights,
            self._torque_limit,
            self.hessian,
            self.gradient,
            self.equality,
            self.equality_value,
            self.inequality,
            self.lower,
            self.upper,
        )

    def torque(self, dynamics: Dynamics, v: Vector, z: Vector, out: Vector) -> None:
        """Joint torques of a solution, N·m: τ = M_j a + n_j + B v − J_f,jᵀ f − J_t,jᵀ u.

        Args:
            dynamics: terms the problem was built with.
            v: (nv,) generalised velocity.
            z: (n,) solution.
            out: (joints,) torques.
        """
        _torque(self.inequality, dynamics.bias, self.damping, v, z, 5 * (self.n_force // 3), out)


@njit(cache=True)
def _build(  # type: ignore[no-untyped-def]
    mass_matrix,
    bias,
    damping,
    foot_jacobian,
    foot_drift,
    thruster_jacobian,
    v,
    rotation,
    body,
    orientation,
    feet,
    joints,
    held,
    force_range,
    weights,
    torque_limit,
    hessian,
    gradient,
    equality,
    equality_value,
    inequality,
    lower,
    upper,
):
    nv = v.shape[0]
    nf = foot_drift.shape[0]
    nt = thruster_jacobian.shape[0]
    nj = nv - 6

    # Objective.
    hessian[:nv, :nv] = 0.0
    for i in range(nv):
        gradient[i] = 0.0
        hessian[i, i] = weights[3] if i >= 6 else 0.0
    for j in range(nj):
        gradient[6 + j] = -weights[3] * joints[j]
    # Body: world acceleration R (a_v + ω × v); in body axes the task is a_v = Rᵀ c̈ − ω × v, with the same norm.
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        wanted = -(v[3 + a] * v[b] - v[3 + b] * v[a])
        for k in range(3):
            wanted += rotation[k, i] * body[k]
        hessian[i, i] += weights[0]
        gradient[i] -= weights[0] * wanted
        hessian[3 + i, 3 + i] += weights[1]
        gradient[3 + i] -= weights[1] * orientation[i]
    for c in range(nf):
        hessian[nv + c, nv + c] = weights[5]
    for c in range(nt):
        hessian[nv + nf + c, nv + nf + c] = weights[4]
    for k in range(nf // 3):
        if held[k] == 0.0:
            for c in range(3 * k, 3 * k + 3):
                wanted = feet[k, c - 3 * k] - foot_drift[c]
                for i in range(nv):
                    scaled = weights[2] * foot_jacobian[c, i]
                    if scaled != 0.0:
                        gradient[i] -= scaled * wanted
                        for j in range(nv):
                            hessian[i, j] += scaled * foot_jacobian[c, j]

    # Floating-base rows of the dynamics.
    for i in range(6):
        for j in range(nv):
            equality[i, j] = mass_matrix[i, j]
        for c in range(nf):
            equality[i, nv + c] = -foot_jacobian[c, i]
        for c in range(nt):
            equality[i, nv + nf + c] = -thruster_jacobian[c, i]
        equality_value[i] = -bias[i]

    # Feet: held, or without force.
    for k in range(nf // 3):
        on = held[k] != 0.0
        for c in range(3 * k, 3 * k + 3):
            for j in range(nv):
                equality[6 + c, j] = foot_jacobian[c, j] if on else 0.0
            equality[6 + c, nv + c] = 0.0 if on else 1.0
            equality_value[6 + c] = feet[k, c - 3 * k] - foot_drift[c] if on else 0.0
        lower[5 * k + 4] = force_range[k, 0] if on else -1.0
        upper[5 * k + 4] = force_range[k, 1] if on else 1.0
        for row in range(5 * k, 5 * k + 4):
            lower[row] = 0.0 if on else -1.0  # never active in the air, where f = 0 already

    # Joint torques.
    start = 5 * (nf // 3)
    for j in range(nj):
        row = start + j
        for i in range(nv):
            inequality[row, i] = mass_matrix[6 + j, i]
        for c in range(nf):
            inequality[row, nv + c] = -foot_jacobian[c, 6 + j]
        for c in range(nt):
            inequality[row, nv + nf + c] = -thruster_jacobian[c, 6 + j]
        offset = bias[6 + j] + damping[6 + j] * v[6 + j]
        lower[row] = -torque_limit[j] - offset
        upper[row] = torque_limit[j] - offset


@njit(cache=True)
def _torque(inequality, bias, damping, v, z, start, out):  # type: ignore[no-untyped-def]
    for j in range(out.shape[0]):
        s = bias[6 + j] + damping[6 + j] * v[6 + j]
        for i in range(z.shape[0]):
            s += inequality[start + j, i] * z[i]
        out[j] = s
