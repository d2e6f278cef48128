"""The robot in the plane, its terms by Pinocchio: what holds the planar kernels to account."""

import numpy as np
import pinocchio as pin

from harpy_pin.model.record import field, make_record
from harpy_pin.model.state import State
from harpy_pin.simulation.step import implicit_step, step_record

WORLD = pin.LOCAL_WORLD_ALIGNED


class PinocchioPlane:
    """A simulator of the planar robot: the library's contact step on Pinocchio's terms."""

    def __init__(self, model, ground, *, dt=5e-4):
        self.robot, self.model, self.dt, self.t = model.planar, model.planar.model, dt, 0.0
        self.data = self.model.createData()
        nv, feet, thrusters = self.model.nv, len(self.robot.feet), len(self.robot.thrusters)
        self._terms = make_record(
            mass_matrix=np.zeros((nv, nv)),
            bias=np.zeros(nv),
            damping=self.model.damping,
            foot_jacobian=np.zeros((3 * feet, nv)),
            foot_drift=np.zeros(3 * feet),
            foot_position=np.zeros((feet, 3)),
            foot_velocity=np.zeros((feet, 3)),
            thruster_jacobian=np.zeros((3 * thrusters, nv)),
        )
        self._ground, self._step = ground.record, step_record({"nv": nv, "feet": feet}, dt=dt)

    def reset(self, q, v):
        self.q, self.v = q.copy(), v.copy()
        self.evaluate()

    def evaluate(self):
        model, data, robot = self.model, self.data, self.robot
        mass_matrix = pin.crba(model, data, self.q)
        field(self._terms, "mass_matrix")[:] = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
        field(self._terms, "bias")[:] = pin.nonLinearEffects(model, data, self.q, self.v)
        pin.forwardKinematics(model, data, self.q, self.v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, self.q)
        pin.updateFramePlacements(model, data)
        for k, name in enumerate(robot.feet):
            i, rows = robot.frame_id(name), slice(3 * k, 3 * k + 3)
            field(self._terms, "foot_position")[k] = data.oMf[i].translation
            field(self._terms, "foot_velocity")[k] = pin.getFrameVelocity(model, data, i, WORLD).linear
            field(self._terms, "foot_drift")[rows] = pin.getFrameClassicalAcceleration(model, data, i, WORLD).linear
            field(self._terms, "foot_jacobian")[rows] = pin.getFrameJacobian(model, data, i, WORLD)[:3]
        for k, name in enumerate(robot.thrusters):
            jacobian = pin.getFrameJacobian(model, data, robot.frame_id(name), WORLD)[:3]
            field(self._terms, "thruster_jacobian")[3 * k : 3 * k + 3] = jacobian

    @property
    def foot_force(self):
        return field(self._step, "force").copy()

    def advance(self, command):
        implicit_step(self._terms, self._ground, self._step, self.v, command.torque, command.thrust.ravel())
        self.q = pin.integrate(self.model, self.q, field(self._step, "displacement"))
        self.t += self.dt
        self.evaluate()

    def run(self, controller, duration):
        """Configurations and torques at each tick of 1 ms."""
        rows, torques = [], []
        for tick in range(round(duration / 1e-3)):
            self.t = tick * 1e-3
            place, motion = (field(self._terms, name).copy() for name in ("foot_position", "foot_velocity"))
            command = controller.step(State(self.t, self.q, self.v, place, motion, self.foot_force.reshape(-1, 3)))
            rows.append(self.q.copy())
            torques.append(command.torque.copy())
            for _ in range(round(1e-3 / self.dt)):
                self.advance(command)
        return np.array(rows), np.array(torques)
