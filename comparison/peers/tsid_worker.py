"""Replays recorded states through TSID; runs in a virtual environment of its own.

    python tsid_worker.py PROBLEM RESULT

The files are those of :mod:`comparison.peers.replaying`. Nothing of this library is imported here: TSID needs another
version of Pinocchio.

TSID's bindings of this version have no external wrench, so thrusts cannot be given. They can be decided: a thruster is
a point contact whose normal is the zero vector, which empties its friction rows and leaves a free force; its motion
task counts nothing. The solver adds 1e-8 to the Hessian's diagonal and has no switch for it; the weights of forces
and posture are lowered by as much, so that the sum is the program's.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin
from tsid import tsid_pywrap as tsid  # the wheel of this version lacks the package's __init__

REGULARISATION = 1e-8
"""TSID's DEFAULT_HESSIAN_REGULARIZATION."""

FREE = 1e4
"""A bound that no force reaches, N."""


class Formulation:
    """TSID's formulation and solver for one set of held feet."""

    def __init__(self, s: dict[str, Any], held: tuple[bool, ...]) -> None:
        model = pin.buildModelFromUrdf(s["urdf"], pin.JointModelFreeFlyer())
        model.armature = np.array(s["armature"])
        self.robot = robot = tsid.RobotWrapper(model, False)
        self.inverse = inverse = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        inverse.computeProblemData(0.0, pin.neutral(model), np.zeros(model.nv))  # data before the first task
        weights, gains = s["weights"], s["gains"]
        joints = len(s["joints"])
        self.keep: list[Any] = []  # TSID holds references only

        self.body = self._frame_task("body", s["base"], linear=True, gains=(0.0, 0.0))
        inverse.addMotionTask(self.body, weights["body"], 1, 0.0)
        orientation = self._frame_task("orientation", s["base"], linear=False, gains=gains["orientation"])
        orientation.setReference(_sample())
        inverse.addMotionTask(orientation, weights["orientation"], 1, 0.0)

        self.keep.append(orientation)

        rest = tsid.TrajectorySample(joints, joints)
        rest.value(np.array(s["posture"]))
        rest.derivative(np.zeros(joints))
        rest.second_derivative(np.zeros(joints))
        of_joint = np.array(s["posture_weights"])
        for full in dict.fromkeys(s["posture_weights"]):
            posture = tsid.TaskJointPosture(f"posture {full}", robot)
            weight = full - REGULARISATION
            # The regularisation pulls accelerations to zero: with gains raised as much, weight × target stays the same.
            posture.setMask((of_joint == full).astype(float))
            posture.setKp(np.full(joints, gains["posture"][0] * full / weight))
            posture.setKd(np.full(joints, gains["posture"][1] * full / weight))
            posture.setReference(rest)
            inverse.addMotionTask(posture, weight, 1, 0.0)
            self.keep.append(posture)

        self.bounds = tsid.TaskActuationBounds("torque", robot)
        limit = np.array(s["torque_limit"])
        self.bounds.setBounds(-limit, limit)
        inverse.addActuationTask(self.bounds, 1.0, 0, 0.0)

        up = np.array([0.0, 0.0, 1.0])
        self.swinging: list[tuple[int, Any]] = []
        for k, (name, on) in enumerate(zip(s["feet"], held, strict=True)):
            if on:
                self._contact(name, up, s["mu"], 0.0, weights["force"], hard=True, damping=s["gains"]["contact"])
            else:
                task = self._frame_task(name, name, linear=True, gains=(0.0, 0.0))
                inverse.addMotionTask(task, weights["swing"], 1, 0.0)
                self.swinging.append((k, task))
        for name in s["thrusters"]:
            self._contact(name, np.zeros(3), 1.0, -FREE, weights["thrust"], hard=False, damping=0.0)
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.solver.resize(inverse.nVar, inverse.nEq, inverse.nIn)

    def _frame_task(self, name: str, frame: str, *, linear: bool, gains: Any) -> Any:
        task = tsid.TaskSE3Equality(name, self.robot, frame)
        task.setKp(np.full(6, gains[0]))
        task.setKd(np.full(6, gains[1]))
        task.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0] if linear else [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
        task.useLocalFrame(False)
        return task

    def _contact(
        self, name: str, normal: np.ndarray, mu: float, least: float, weight: float, *, hard: bool, damping: float
    ) -> None:
        contact = tsid.ContactPoint(name, self.robot, name, normal, mu, least, FREE)
        contact.setKp(np.zeros(3))
        contact.setKd(np.full(3, damping))
        contact.setReference(pin.SE3.Identity())
        contact.useLocalFrame(False)
        contact.setRegularizationTaskWeightVector(np.ones(3))
        self.inverse.addRigidContact(contact, weight - REGULARISATION, 1.0 if hard else 0.0, 0 if hard else 1)
        self.keep.append(contact)


def _sample() -> Any:
    sample = tsid.TrajectorySample(12, 6)
    sample.value(np.concatenate((np.zeros(3), np.eye(3).ravel())))
    sample.derivative(np.zeros(6))
    sample.second_derivative(np.zeros(6))
    return sample


class Tick:
    """One formulation for each set of held feet that occurs: switching costs nothing."""

    def __init__(self, problem: dict[str, Any], variant: str = "decided") -> None:
        s = problem["settings"]
        none = np.zeros((len(problem["q"]), 3))
        self.q, self.v = list(problem["q"]), list(problem["v"])
        self.body = list(np.hstack((problem["body"], none)))
        self.feet = [list(row) for row in np.concatenate((problem["feet"], np.zeros_like(problem["feet"])), axis=2)]
        self.held = [tuple(bool(h) for h in row) for row in problem["held"]]
        self.damping = list(problem["damping_force"][:, 6:])
        limit = np.array(s["torque_limit"])
        self.lower = list(-limit - problem["damping_force"][:, 6:])
        self.upper = list(limit - problem["damping_force"][:, 6:])
        self.names, self.thrusters = s["feet"], s["thrusters"]
        self.formulations = {held: Formulation(s, held) for held in dict.fromkeys(self.held)}
        self.sample = _sample()

    def replay(self, clocked: str) -> np.ndarray:
        """See :class:`comparison.peers.replaying.Replay`."""
        n = len(self.q)
        laps = np.zeros(n, dtype=np.int64)
        self.timed_torque = torque = np.full((n, len(self.v[0]) - 6), np.nan)
        whole, sample, clock = clocked == "tick", self.sample, perf_counter_ns
        for i in range(n):
            q, v, body, feet = self.q[i], self.v[i], self.body[i], self.feet[i]
            lower, upper, damping = self.lower[i], self.upper[i], self.damping[i]
            held = self.held[i]
            t0 = clock()
            f = self.formulations[held]
            inverse = f.inverse
            sample.second_derivative(body)
            f.body.setReference(sample)
            for k, task in f.swinging:
                sample.second_derivative(feet[k])
                task.setReference(sample)
            f.bounds.setBounds(lower, upper)
            program = inverse.computeProblemData(0.0, q, v)
            t1 = clock()
            solution = f.solver.solve(program)
            t2 = clock()
            tau = inverse.getActuatorForces(solution) + damping
            t3 = clock()
            laps[i] = t3 - t0 if whole else t2 - t1
            if int(solution.status) == 0:
                torque[i] = tau
        return laps

    def solution(self, i: int) -> dict[str, Any] | None:
        """See :class:`comparison.peers.replaying.Replay`."""
        f = self.formulations[self.held[i]]
        self.sample.second_derivative(self.body[i])
        f.body.setReference(self.sample)
        for k, task in f.swinging:
            self.sample.second_derivative(self.feet[i][k])
            task.setReference(self.sample)
        f.bounds.setBounds(self.lower[i], self.upper[i])
        solution = f.solver.solve(f.inverse.computeProblemData(0.0, self.q[i], self.v[i]))
        if int(solution.status) != 0:
            return None
        force, held = f.inverse.getContactForce, zip(self.names, self.held[i], strict=True)
        return {
            "acceleration": f.inverse.getAccelerations(solution),
            "torque": f.inverse.getActuatorForces(solution) + self.damping[i],
            "force": [force(name, solution) if on else np.zeros(3) for name, on in held],
            "thrust": [force(name, solution) for name in self.thrusters],
        }


if __name__ == "__main__":
    main = runpy.run_path(str(Path(__file__).with_name("replaying.py")))["main"]
    main(Tick, ("tsid", "pin", "numpy"), ("decided",), *sys.argv[1:])
