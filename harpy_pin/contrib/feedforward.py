"""Feedforward torques for soft legs: the control law ``feedforward`` of the governed controller's
legs.

A joint PID holds the robot by its errors: the lower its stiffness, the deeper the legs sag, and the
more the feet slip. Measurement delay makes high stiffness and damping unstable (docs/delay.md).
Here most of the torque does not depend on errors,

    τ = τ_ff + K_p (q_t − q) + K_i ∫ + K_d (q̇_t − q̇)
    τ_ff = [ M a_t + n − J_fᵀ f_t ] of the joints,

with a_t the gait's acceleration of body and feet, and f_t the contact force that goes with it. The
ground exerts m (c̈_t − g) − Σ u_t in total, shared between the stance feet as in
:func:`harpy_pin.controllers.tasks.share_of_load`. The thrusts u_t are those of the thruster
feedback at the applied reference. The PID's part is small, so its gains may be as low as a delay
needs, separately in stance and swing.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from harpy_pin.controllers.governed_tick import ControlRecord, solve_three, thrusts, track_foot
from harpy_pin.controllers.parameters import FeedforwardGains, GovernedParameters
from harpy_pin.controllers.tasks import share_of_load
from harpy_pin.gaits.gait import Gait, GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.dynamics import DynamicsRecord, dynamics_record
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms


class ForwardRecord(RecordOf, FeedforwardGains):
    """Gains and work space of this control law, for kernels."""

    double_support: float  # share of a step with both feet on the ground
    mass: float  # of the robot, kg
    gravity: Vector  # (3,) m/s²
    force: Vector = sized("feet", 3)  # (feet, 3) f_t, world axes, N
    acceleration: Vector = sized("nv")  # (nv,) a_t
    dynamics: DynamicsRecord  # terms, see :class:`~harpy_pin.model.dynamics.Dynamics`


class ForwardTickRecord(ControlRecord):
    """The governed controller with this control law."""

    forward: ForwardRecord  # its settings and work space


def make_legs(
    gait: Gait, parameters: GovernedParameters
) -> tuple[Kernel[None], dict[str, Records[ForwardRecord]]]:
    """The kernel that writes the command of an applied reference, and what the controller's record
    has for it, by name.
    """
    robot = gait.robot
    record = make_record(
        ForwardRecord,
        robot.sizes,
        **asdict(parameters.feedforward),
        double_support=gait.double_support,
        mass=robot.mass,
        gravity=robot.model.gravity.linear,
        dynamics=dynamics_record(robot),
    )
    return actuate_forward, {"forward": record}


@kernel
def actuate_forward(
    p: ForwardTickRecord,
    goal: GaitTargetRecord,
    applied: Vector,
    q: Vector,
    v: Vector,
    foot_force: Vector,
) -> None:
    """The command: as :func:`harpy_pin.controllers.governed_tick.actuate`, with this control
    law.
    """
    w = p.forward
    update_terms(w.dynamics, q, v)
    thrusts(p, applied, v)
    _desired_forces(p, goal, w)
    _desired_acceleration(p, goal, w)
    for k in range(2):
        stance = goal.stance[k] != 0.0 and foot_force[k, 2] > w.contact_threshold
        p.joint_p[3 * k : 3 * k + 3] = w.stance_p if stance else w.swing_p
        p.joint_d[3 * k : 3 * k + 3] = w.stance_d if stance else w.swing_d
    track_foot(0, p, p.left, goal, q, v)
    track_foot(1, p, p.right, goal, q, v)
    _add_torques(p, w)


@kernel
def _desired_forces(p: ControlRecord, goal: GaitTargetRecord, w: ForwardRecord) -> None:
    """f_t of each foot."""
    share = np.empty(2)
    for k in range(2):
        share[k] = share_of_load(goal, k, w.double_support) if goal.stance[k] != 0.0 else 0.0
    ground = w.mass * (goal.body[6:] - w.gravity) - p.thrust[0] - p.thrust[1]
    w.force[:] = np.outer(np.where(share > 0.0, share / np.sum(share), 0.0), ground)


@kernel
def _desired_acceleration(p: ControlRecord, goal: GaitTargetRecord, w: ForwardRecord) -> None:
    """a_t: of the upright body from the gait, of the joints from the feet, without the bias J̇ v of
    their velocities.
    """
    w.acceleration[:3] = p.rotation.T @ goal.body[6:]
    w.acceleration[3:6] = 0.0
    for k in range(2):
        j = 6 + 3 * k
        jacobian = w.dynamics.foot_jacobian[3 * k : 3 * k + 3, j : j + 3]
        w.acceleration[j : j + 3] = solve_three(jacobian, goal.foot_acceleration[k])


@kernel
def _add_torques(p: ControlRecord, w: ForwardRecord) -> None:
    """τ_ff on top of the PID's torques, within the motors' limits."""
    d, force = w.dynamics, w.force.reshape(w.force.size)
    forward = d.mass_matrix[6:] @ w.acceleration + d.bias[6:] - d.foot_jacobian[:, 6:].T @ force
    p.torque[:] = np.clip(p.torque + forward, -p.torque_limit, p.torque_limit)
