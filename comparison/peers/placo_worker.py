"""Replays recorded states through placo's dynamics solver; runs in a virtual environment of its own.

    python placo_worker.py PROBLEM RESULT

Both are ``.npz`` files, described in :mod:`comparison.peers.peer_problem` and :mod:`comparison.peers.check`. Nothing of
this library is imported here: placo needs another version of Pinocchio.

placo's objective is ½ Σ weight ‖task‖², as ours is. Its regularisation and its torque cost, which our program does not
have, are set to zero: the weights of forces and posture make the optimum unique already. Its point contact knows the
friction pyramid and f_z ≥ 0, but no further range of the normal force; the expected solutions have none either.
"""

from __future__ import annotations

import gc
import json
import sys
from importlib.metadata import version
from time import perf_counter_ns
from typing import Any

import numpy as np
import placo


class Tick:
    """placo's solver, with the tasks and contacts of the program.

    Args:
        problem: arrays and settings.
        decide_thrust: whether the thrusts are forces of contacts without friction, decided by the solver (without
            limits), or a given generalised force.
    """

    def __init__(self, problem: dict[str, Any], decide_thrust: bool) -> None:
        s = problem["settings"]
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
        posture = solver.add_joints_task()
        posture.set_joints(dict(zip(s["joints"], s["posture"], strict=True)))
        posture.configure("posture", "soft", s["weights"]["posture"])
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
        """Every state in the order of time.

        Timed is the ``tick``, from the state to the torques, or the ``solve``, the solver's call only.

        Returns:
            (ticks,) times, ns; the torques are kept in :attr:`timed_torque`.
        """
        n = len(self.q)
        laps = np.zeros(n, dtype=np.int64)
        self.timed_torque = torque = np.full((n, len(self.v[0]) - 6), np.nan)
        whole = clocked == "tick"
        robot, solver, state, body, clock = self.robot, self.solver, self.robot.state, self.body, perf_counter_ns
        left, right = self.feet
        left_target, right_target = zip(*self.foot_target, strict=True)
        self.now = None
        for i in range(n):
            q, v, b, x, y, e, held = (
                self.q[i],
                self.v[i],
                self.body_target[i],
                left_target[i],
                right_target[i],
                self.extra[i],
                self.held[i],
            )
            t0 = clock()
            state.q = q
            state.qd = v
            robot.update_kinematics()
            if held != self.now:
                self.switch(held)
            body.ddtarget_world = b
            left.ddtarget_world = x
            right.ddtarget_world = y
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

    def answers(self) -> dict[str, np.ndarray]:
        """Solutions of all states; NaN where the solver failed."""
        n, nv = len(self.q), len(self.v[0])
        found = {
            "acceleration": np.full((n, nv), np.nan),
            "torque": np.full((n, nv - 6), np.nan),
            "force": np.full((n, len(self.feet), 3), np.nan),
            "thrust": np.full((n, len(self.mounts), 3), np.nan),
        }
        self.now = None
        for i in range(n):
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
                continue
            found["acceleration"][i] = result.qdd
            found["torque"][i] = result.tau[6:]
            for k, contact in enumerate(self.contacts):
                found["force"][i, k] = contact.wrench if self.held[i][k] else 0.0
            for k, contact in enumerate(self.mounts):
                found["thrust"][i, k] = contact.wrench
        return found


def main(problem_file: str, result_file: str) -> None:
    """Solve, time and write."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    problem["settings"] = json.loads(str(problem["settings"]))
    out: dict[str, Any] = {"versions": json.dumps({name: version(name) for name in ("placo", "pin", "numpy")})}
    for variant in ("given", "decided"):
        tick = Tick(problem, variant == "decided")
        for key, values in tick.answers().items():
            out[f"{variant}_{key}"] = values
        repetitions = problem["settings"]["repetitions"]
        gc.collect()
        gc.disable()
        for clocked in ("tick", "solve"):
            out[f"{variant}_{clocked}_ns"] = np.array([tick.replay(clocked) for _ in range(repetitions)])
        gc.enable()
        out[f"{variant}_torque"] = tick.timed_torque  # what was timed is what is checked
    laps = np.zeros(20_000, dtype=np.int64)
    for i in range(len(laps)):
        begin = perf_counter_ns()
        laps[i] = perf_counter_ns() - begin
    out["overhead_ns"] = np.median(laps)
    np.savez(result_file, **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
