"""Terms, forces and accelerations by Pinocchio's functions, and by the library's terms."""

import numpy as np
import pinocchio as pin

from harpy_pin.model.contact_map import (
    contact_gain,
    contact_terms,
    sticking_force,
    unconstrained_drive,
)
from harpy_pin.model.record import field
from harpy_pin.model.terms import read_thrusts
from harpy_pin.wbc.targets import note_centre_drift

WORLD = pin.LOCAL_WORLD_ALIGNED


def mass_matrix(model, q):
    """Pinocchio's, symmetric."""
    upper = np.triu(pin.crba(model, model.createData(), q))
    return upper + np.triu(upper, 1).T


def frame_terms(model, names, q, v):
    """(n, 3, nv) Jacobians and (n, 3) drifts of frames in world axes, by Pinocchio."""
    data = model.createData()
    pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    frames = [model.getFrameId(name) for name in names]
    jacobians = [pin.getFrameJacobian(model, data, frame, WORLD)[:3] for frame in frames]
    drifts = [
        pin.getFrameClassicalAcceleration(model, data, frame, WORLD).linear for frame in frames
    ]
    return np.array(jacobians), np.array(drifts)


def constrained_dynamics(robot, q, v, command, touching, *, damping=0.0, desired=0.0):
    """Contact forces (feet, 3) and acceleration of the robot whose feet in touch cannot slip, by
    Pinocchio.

    They accelerate as desired, and against their velocities times the damping.
    """
    model, data = robot.model, robot.model.createData()
    jacobian, drift = frame_terms(model, robot.feet, q, v)
    drive = -model.damping * v
    for mount, thrust in zip(
        frame_terms(model, robot.thrusters, q, v)[0], command.thrust, strict=True
    ):
        drive += mount.T @ thrust
    drive[6:] += command.torque
    feet, force = np.flatnonzero(touching), np.zeros((len(robot.feet), 3))
    settle = (drift + damping * jacobian @ v - desired)[feet].ravel()
    pin.computeAllTerms(model, data, q, v)
    acceleration = pin.forwardDynamics(
        model, data, drive, jacobian[feet].reshape(-1, model.nv), settle
    )
    force[feet] = np.reshape(data.lambda_c, (-1, 3))
    return force, np.array(acceleration)


def places(robot, q, names=None):
    """(frames, 3) places of frames in a configuration, m; those of the feet where none are
    named.
    """
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.closed(q))
    return np.array(
        [
            data.oMf[robot.frame_id(name)].translation
            for name in (robot.feet if names is None else names)
        ]
    )


def forward_dynamics(dynamics, q, v, force):
    """The acceleration under a generalised force."""
    return np.array(pin.aba(dynamics.model, dynamics.model.createData(), q, v, force))


def generalised_force(dynamics, torque, foot_force, thrust):
    """S τ + J_fᵀ f + J_tᵀ u_t at the state of the last update."""
    variables = np.zeros(dynamics.robot.n_thrust)
    read_thrusts(dynamics.record, thrust, variables)
    force = foot_force.ravel() @ dynamics.foot_jacobian + variables @ dynamics.thruster_jacobian
    force[len(force) - len(torque) :] += torque
    return force


def demand_of_centre(targets, dynamics):
    """Take the horizontal part of the body's target as the acceleration of the centre of mass, at
    one state.
    """
    targets._record_["centred"] = 1
    note_centre_drift(dynamics.record, targets.record)


class ContactForceMap:
    """Contact forces of feet that stick, and how thrusts and torques change them, by the kernels of
    the library.
    """

    def __init__(self, robot, *, damping=0.0):
        self.robot, self.damping, self.terms = robot, damping, contact_terms(robot)
        self.response, self.split = field(self.terms, "response"), robot.n_thrust

    def update(self, dynamics, v, command, touching):
        """(feet, 3) the force that sticking demands under a command; fills the gains of thrusts and
        torques.
        """
        feet = np.flatnonzero(touching)
        rows = (3 * feet[:, None] + np.arange(3)).ravel()
        count, variables, size = len(rows), np.zeros(self.split), 3 * len(self.robot.feet)
        settling = -dynamics.foot_drift - self.damping * dynamics.foot_velocity.ravel()
        field(self.terms, "rows")[:count], field(self.terms, "settling")[:count] = (
            rows,
            settling[rows],
        )
        read_thrusts(dynamics.record, command.thrust, variables)
        unconstrained_drive(
            dynamics.record, v, command.torque, variables, field(self.terms, "drive")
        )
        sticking_force(dynamics.record, self.terms, count)
        contact_gain(dynamics.record, self.terms, count)
        force, gain = np.zeros(size), np.zeros((size, self.split + len(command.torque)))
        force[rows], gain[rows] = (
            field(self.terms, "force")[:count],
            field(self.terms, "gain")[:count],
        )
        self.thrust_gain, self.torque_gain = gain[:, : self.split], gain[:, self.split :]
        return force.reshape(-1, 3)
