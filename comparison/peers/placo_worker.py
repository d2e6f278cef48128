"""Replays recorded states through placo's dynamics solver; runs in a virtual environment of its own.

    python placo_worker.py PROBLEM RESULT

Both files are ``.npz``, described in :mod:`comparison.peers.peer_problem` and :mod:`comparison.peers.measure_peer`.
Nothing of this library is imported here: placo needs another version of Pinocchio.

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

    Thrusts are ``decided`` by the solver, as forces of contacts without friction (without limits), or ``given``, as a
    generalised force.
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
            self.feet[k].configure(self.names[k], *(("hard",) if on else ("soft", self.swing_weight)))
            self.contacts[k].active = on
        self.now = held

    def step(self, i: int) -> tuple[Any, Any, int, int]:
        """A tick: the result, its torques, and the times of the tick and of the solver's call alone, ns."""
        robot, solver, state, body, clock = self.robot, self.solver, self.robot.state, self.body, perf_counter_ns
        q, v, b, feet, targets = self.q[i], self.v[i], self.body_target[i], self.feet, self.foot_target[i]
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
        return result, tau[6:], t3 - t0, t2 - t1

    def solution(self, i: int) -> dict[str, Any]:
        """``acceleration``, ``force`` and ``thrust`` at a tick; nothing where the solver failed."""
        result, *_ = self.step(i)
        if not result.success:
            return {}
        force = [c.wrench if on else np.zeros(3) for c, on in zip(self.contacts, self.held[i], strict=True)]
        mounts = {"thrust": [contact.wrench for contact in self.mounts]} if self.mounts else {}
        return {"acceleration": result.qdd, "force": force, **mounts}


def answer(problem: dict[str, Any], variant: str) -> dict[str, Any]:
    """Solutions of all states, NaN where the solver failed, and the times of every repetition, torques with them."""
    (n, nv), s, peer = problem["v"].shape, problem["settings"], Tick(problem, variant)
    shapes = {"acceleration": (nv,), "force": (len(s["feet"]), 3), "thrust": (len(s["thrusters"]), 3)}
    found = {key: np.full((n, *shape), np.nan) for key, shape in shapes.items()}
    for i in range(n):
        for key, value in peer.solution(i).items():
            found[key][i] = np.reshape(value, found[key][i].shape)  # without thrusters a list is empty
    laps = np.zeros((2, s["repetitions"], n), dtype=np.int64)
    torque = np.full((n, nv - 6), np.nan)  # what was timed is what is checked
    gc.collect()
    gc.disable()
    for repetition in range(s["repetitions"]):
        peer.now = None
        for i in range(n):
            result, tau, *laps[:, repetition, i] = peer.step(i)
            torque[i] = tau if result.success else np.nan
    gc.enable()
    return {**found, "torque": torque, "tick_ns": laps[0], "solve_ns": laps[1]}


def main(problem_file: str, result_file: str) -> None:
    """Solve, time and write both variants."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    problem["settings"] = json.loads(str(problem["settings"]))
    out: dict[str, Any] = {"versions": json.dumps({name: version(name) for name in ("placo", "pin", "numpy")})}
    for variant in ("given", "decided"):
        out |= {f"{variant}_{key}": values for key, values in answer(problem, variant).items()}
    laps = np.zeros(20_000, dtype=np.int64)
    for i in range(len(laps)):
        begin = perf_counter_ns()
        laps[i] = perf_counter_ns() - begin
    np.savez(result_file, overhead_ns=np.median(laps), **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
