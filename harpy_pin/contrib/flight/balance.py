"""Balance in the air: accelerations that thrusts and joints together can give, and that lead back to a reference.

Thrusters do not push the body every way: Harpy's two have no moment about the line between them, and parallel rotors no
force across their axes. What they lack, legs and leaning have to do. So the gains are those of the linear-quadratic
regulator of the whole robot as it hovers: body and joints are its states, thrusts and torques its inputs.

Its feedback asks for generalised accelerations a at the measured state. What no thrust can give of the wrench on the
body that a needs,

    F = M a + n,    F_body ← F_body − Z Zᵀ F_body,    Z: the wrenches that no thrust has,

is taken out before it is asked for: the program of a whole-body controller finds exactly these accelerations.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg import solve_continuous_are

from harpy_pin.errors import InputError
from harpy_pin.gaits.standing import GRAVITY
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__: list[str] = []

PLACE, TURN, JOINT = 0.05, 0.05, 0.3
"""Errors that weigh as much as each other: of the body, m and rad, and of a joint, rad."""
SPEED, SPIN, RATE = 0.3, 1.0, 2.0
"""Errors of the velocities that weigh as much as each other: m/s, rad/s, and rad/s of a joint."""
THRUST, TORQUE = 1.0, 0.25
"""Inputs that weigh as much: as a share of the weight on each thruster, and of a motor's limit."""
STEP = 1e-5
"""Size of the differences by which the equations of motion become linear, m and rad."""
NONE = 1e-6
"""Singular value, as a share of the largest, below which there is no thrust in a direction."""
LIGHTEST = 5e-4
"""Least inertia of a joint that the feedback reckons with, kg·m² per N·m of its motor: lighter ones would be moved
faster than a controller ticks."""
HELD = 0.02
"""Largest part of the weight that thrusts and torques may leave in hovering."""


class Balance:
    """Feedback of a robot in the air.

    Args:
        robot: with thrusters or rotors.
        q: (nq,) configuration in which it hovers.
        weight: how many weights the thrusters carry there.

    Attributes:
        dynamics: terms at the state of the last :meth:`reachable`.
        gain: (nv, 2 nv) acceleration per error of configuration and velocity.

    Raises:
        InputError: the robot cannot hover so.
    """

    def __init__(self, robot: Robot, q: Vector, *, weight: float = 1.0) -> None:
        self.robot, self.dynamics = robot, Dynamics(robot)
        model, nv = Dynamics(robot, gravity=np.array((0.0, 0.0, -weight * GRAVITY))), robot.model.nv
        rest, joints = np.zeros(nv), nv - 6
        model.update(q, rest)
        drive, mass = _inputs(model), model.mass_matrix.copy()
        light = np.zeros(nv)
        light[6:] = np.maximum(LIGHTEST * robot.torque_limit - np.diag(mass)[6:], 0.0)
        mass += np.diag(light)
        held, *_ = np.linalg.lstsq(drive, model.bias, rcond=NONE)
        if np.linalg.norm(drive @ held - model.bias) > HELD * robot.mass * GRAVITY:
            raise InputError(f"'{robot.name}' cannot hover in this posture", name="robot", value=robot)
        slope = np.zeros((nv, nv))
        for k in range(nv):
            for sign in (1.0, -1.0):
                change = np.zeros(nv)
                change[k] = sign * STEP
                model.update(pin.integrate(robot.model, q, change), rest)
                given = np.linalg.solve(model.mass_matrix + np.diag(light), _inputs(model) @ held - model.bias)
                slope[:, k] += sign * given / (2.0 * STEP)
        state = np.zeros((2 * nv, 2 * nv))
        state[:nv, nv:], state[nv:, :nv] = np.eye(nv), slope
        state[nv:, nv:] = -np.linalg.solve(mass, np.diag(robot.model.damping))
        acts = np.vstack((np.zeros((nv, drive.shape[1])), np.linalg.solve(mass, drive)))
        errors = np.repeat((PLACE, TURN, JOINT, SPEED, SPIN, RATE), (3, 3, joints, 3, 3, joints))
        share = robot.mass * GRAVITY / len(robot.thrusters)
        inputs = np.concatenate((np.full(robot.n_thrust, THRUST * share), TORQUE * robot.torque_limit))
        cost = solve_continuous_are(state, acts, np.diag(errors**-2.0), np.diag(inputs**-2.0))
        self.gain: Vector = -acts[nv:] @ np.diag(inputs**2.0) @ acts.T @ cost

    def reachable(self, q: Vector, v: Vector, a: Vector) -> Vector:
        """(nv,) The acceleration without what no thrust can give; the terms stay at this state.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
            a: (nv,) acceleration.
        """
        d = self.dynamics
        d.update(q, v)
        other = d.bias + self.robot.model.damping * v
        force = d.mass_matrix @ a + other
        lacking = lacking_wrenches(d)
        force[:6] -= lacking @ (lacking.T @ force[:6])
        found: Vector = np.linalg.solve(d.mass_matrix, force - other)
        return found


def _inputs(d: Dynamics) -> Vector:
    """(nv, thrust variables + joints) generalised force of each input."""
    return np.hstack((d.thruster_jacobian.T, np.eye(len(d.bias))[:, 6:]))


def lacking_wrenches(d: Dynamics) -> Vector:
    """(6, n) orthonormal wrenches on the body, body axes, that no thrust has any part of."""
    left, values, _ = np.linalg.svd(d.thruster_jacobian[:, :6].T)
    rank = int((values > NONE * values[0]).sum())
    return np.asarray(left[:, rank:])


def lacking_moments(d: Dynamics) -> Vector:
    """(6, n) those of :func:`lacking_wrenches` that are mostly moments."""
    wrenches = lacking_wrenches(d)
    return wrenches[:, np.linalg.norm(wrenches[:3], axis=0) < 0.5]
