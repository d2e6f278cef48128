"""Forces and accelerations that follow from a command, by the library's terms and Pinocchio's forward dynamics."""

import numpy as np
import pinocchio as pin

from harpy_pin.model.contact_map import contact_gain, contact_terms, sticking_force, unconstrained_drive
from harpy_pin.model.record import field
from harpy_pin.model.rotor import read_thrusts
from harpy_pin.wbc.condensed.force_program import note_centre_drift


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
    """Take the horizontal part of the body's target as the acceleration of the centre of mass, at one state."""
    targets._record_["centred"] = 1
    note_centre_drift(dynamics.record, targets.record)


class ContactForceMap:
    """Contact forces of feet that stick, and how thrusts and torques change them, by the kernels of the library."""

    def __init__(self, robot, *, damping=0.0):
        self.robot, self.damping, self.terms = robot, damping, contact_terms(robot)
        self.response, self.split = field(self.terms, "response"), robot.n_thrust

    def update(self, dynamics, v, *, torque, thrust, touching):
        """(feet, 3) the force that sticking demands under a command; fills the gains of thrusts and torques."""
        feet = np.flatnonzero(touching)
        rows = (3 * feet[:, None] + np.arange(3)).ravel()
        count, variables, size = len(rows), np.zeros(self.split), 3 * len(self.robot.feet)
        settling = -dynamics.foot_drift - self.damping * dynamics.foot_velocity.ravel()
        field(self.terms, "rows")[:count], field(self.terms, "settling")[:count] = rows, settling[rows]
        read_thrusts(dynamics.record, thrust, variables)
        unconstrained_drive(dynamics.record, v, torque, variables, field(self.terms, "drive"))
        sticking_force(dynamics.record, self.terms, count)
        contact_gain(dynamics.record, self.terms, count)
        force, gain = np.zeros(size), np.zeros((size, self.split + len(torque)))
        force[rows], gain[rows] = field(self.terms, "force")[:count], field(self.terms, "gain")[:count]
        self.thrust_gain, self.torque_gain = gain[:, : self.split], gain[:, self.split :]
        return force.reshape(-1, 3)
