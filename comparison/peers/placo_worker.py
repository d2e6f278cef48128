"""Replays recorded states through placo's dynamics solver; runs in a virtual environment of its own.

    python placo_worker.py PROBLEM RESULT

The files are those of :mod:`comparison.peers.replaying`. Nothing of this library is imported here: placo needs another
version of Pinocchio.

placo's objective is ½ Σ weight ‖task‖², as ours is. Its regularisation and its torque cost, which our program does not
have, are set to zero: the weights of forces and posture make the optimum unique already. Its point contact knows the
friction pyramid and f_z ≥ 0, but no further range of the normal force; the expected solutions have none either.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import placo


class Tick:
    """placo's solver, with the tasks and contacts of the program.

    Args:
        problem: arrays and settings.
        variant: the thrusts are ``decided`` by the solver, as forces of contacts without friction (without limits), or
            ``given``, as a generalised force.
    """

    def __init__(self, problem: dict[str, Any], variant: str) -> None:
        s, decide_thrust = problem["settings"], variant == "decided"
        self.q, self.v = list(problem["q"]), list(problem["v"])
        self.body_target = list(problem["body"])
        self.foot_target = [list(row) for row in problem["feet"]]
        self.held = [[bool(h) for h in row] for row in problem["held"]]
        # tau = M a + n + extra_force − Jᵀ f: damping counts as it is, given thrusts against their sign.
        extra = problem["damping_force"] if decide_thrust else problem["damping_force"] - problem["thrust_force"]
        self.extra = list(extra)

        self.robot = robot = placo.RobotWrapper(s["urdf"], placo.Flags.ignore_collisions)
        robot.model.armature = np.array(s["armature"])
        self.solver = solver = placo.DynamicsSolver(robot)
        solver.torque_cost = 0.0
        solver.problem.regularization = 0.0
        for name, limit in zip(s["joints"], s["torque_limit"], strict=True):
            solver.set_torque_limit(name, limit)
        solver.enable_torque_limits(True)

        zero = np.zeros(3)
        self.body = solver.add_position_task(s["base"], zero)
        self.body.configure("body", "soft", s["weights"]["body"])
        self.body.kp, self.body.kd = 0.0, 0.0
        orientation = solver.add_orientation_task(s["base"], np.eye(3))
        orientation.configure("orientation", "soft", s["weights"]["orientation"])
        orientation.kp, orientation.kd = s["gains"]["orientation"]
        for weight in dict.fromkeys(s["posture_weights"]):
            rest = zip(s["joints"], s["posture"], s["posture_weights"], strict=True)
            posture = solver.add_joints_task()
            posture.set_joints({name: angle for name, angle, of_joint in rest if of_joint == weight})
            posture.configure(f"posture {weight}", "soft", weight)
            posture.kp, posture.kd = s["gains"]["posture"]
        self.swing_weight = s["weights"]["swing"]
        self.names = s["feet"]
        self.feet, self.contacts = [], []
        for name in self.names:
            foot = solver.add_position_task(name, zero)
            foot.kp, foot.kd = 0.0, 0.0
            contact = solver.add_unilateral_point_contact(foot)
            contact.mu = s["mu"]
            contact.weight_forces = s["weights"]["force"]
            self.feet.append(foot)
            self.contacts.append(contact)
        self.mounts = []
        for name in s["thrusters"] if decide_thrust else ():
            mount = solver.add_position_task(name, zero)  # gives the contact its Jacobian, and asks for nothing
            mount.configure(name, "soft", 0.0)
            contact = solver.add_point_contact(mount)
            contact.weight_forces = s["weights"]["thrust"]
            self.mounts.append(contact)
        self.now: list[bool] | None = None

    def switch(self, held: list[bool]) -> None:
        """A foot is held (hard task and contact), or swings (soft task, no contact)."""
        for k, on in enumerate(held):
            if on:
                self.feet[k].configure(self.names[k], "hard")
            else:
                self.feet[k].configure(self.names[k], "soft", self.swing_weight)
            self.contacts[k].active = on
        self.now = held

    def replay(self, clocked: str) -> np.ndarray:
        """See :class:`comparison.peers.replaying.Replay`."""
        n = len(self.q)
        laps = np.zeros(n, dtype=np.int64)
        self.timed_torque = torque = np.full((n, len(self.v[0]) - 6), np.nan)
        whole = clocked == "tick"
        robot, solver, state, body, clock = self.robot, self.solver, self.robot.state, self.body, perf_counter_ns
        feet = self.feet
        self.now = None
        for i in range(n):
            q, v, b, targets = self.q[i], self.v[i], self.body_target[i], self.foot_target[i]
            e, held = self.extra[i], self.held[i]
            t0 = clock()
            state.q = q
            state.qd = v
            robot.update_kinematics()
            if held != self.now:
                self.switch(held)
            body.ddtarget_world = b
            for foot, target in zip(feet, targets, strict=True):
                foot.ddtarget_world = target
            solver.extra_force = e
            t1 = clock()
            result = solver.solve()
            t2 = clock()
            tau = result.tau
            t3 = clock()
            laps[i] = t3 - t0 if whole else t2 - t1
            if result.success:
                torque[i] = tau[6:]
        return laps

    def solution(self, i: int) -> dict[str, Any] | None:
        """See :class:`comparison.peers.replaying.Replay`."""
        self.robot.state.q = self.q[i]
        self.robot.state.qd = self.v[i]
        self.robot.update_kinematics()
        self.switch(self.held[i])
        self.body.ddtarget_world = self.body_target[i]
        for foot, target in zip(self.feet, self.foot_target[i], strict=True):
            foot.ddtarget_world = target
        self.solver.extra_force = self.extra[i]
        result = self.solver.solve()
        if not result.success:
            return None
        held = zip(self.contacts, self.held[i], strict=True)
        found = {
            "acceleration": result.qdd,
            "torque": result.tau[6:],
            "force": [contact.wrench if on else np.zeros(3) for contact, on in held],
        }
        if self.mounts:
            found["thrust"] = [contact.wrench for contact in self.mounts]
        return found


if __name__ == "__main__":
    main = runpy.run_path(str(Path(__file__).with_name("replaying.py")))["main"]
    main(Tick, ("placo", "pin", "numpy"), ("given", "decided"), *sys.argv[1:])
