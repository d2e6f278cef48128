"""Replays recorded states through placo's dynamics solver; runs in a virtual environment of its
own.

    python placo_worker.py PROBLEM RESULT

Both files are ``.npz``, described in :mod:`comparison.peers.peer_problem` and
:mod:`comparison.peers.measure_peer`. Nothing of this library is imported here: placo needs another
version of Pinocchio.

placo's objective is ½ Σ weight ‖task‖², as ours is. Its regularisation and its torque cost, which
the common program does not have, are set to zero: the weights of forces and joints make the optimum
unique already. There is a solver for each set of held feet and loaded corners, made beforehand, so
that switching costs nothing.

A sole is held by a hard frame task, and bears at its corners: unilateral points, each with its
friction pyramid. A point needs a position task for its Jacobian, which has the weight zero. With
``planar`` it is placo's planar contact, which poses another program: the moment about the normal
has no bound, and all three moments have one weight.
"""

import gc
import json
import sys
from importlib.metadata import version
from time import perf_counter_ns
from typing import Any

import numpy as np
import placo


class Formulation:
    """placo's solver, with the tasks and contacts of one set of feet."""

    def __init__(self, robot: Any, problem: dict[str, Any], held: Any, loaded: Any) -> None:
        self.settings = s = problem["settings"]
        self.solver = solver = placo.DynamicsSolver(robot)
        solver.torque_cost = 0.0
        solver.problem.regularization = 0.0
        solver.problem.rewrite_equalities = s["rewrite_equalities"]
        for name, limit in zip(s["joints"], s["torque_limit"], strict=True):
            solver.set_torque_limit(name, limit)
        solver.enable_torque_limits(True)
        weights = s["weights"]
        self.body = self._position(s["base"], weights["body"])
        self.centre = None
        if s["centred"]:
            self.body.mask.set_axises("z", "task")
            self.centre = solver.add_com_task(np.zeros(3))
            self.centre.mask.set_axises("xy", "task")
            self._configure(self.centre, "centre", weights["body"])
        self.orientation = solver.add_orientation_task(s["base"], np.eye(3))
        self._configure(self.orientation, "orientation", weights["orientation"])
        self.postures = []
        for weight in dict.fromkeys(s["joint_weights"]):
            of_weight = [j for j, other in enumerate(s["joint_weights"]) if other == weight]
            self.postures.append((self._joints(f"posture {weight}", weight), of_weight))
        self.brakes = [
            (self._joints(f"brake {j}", 0.0), j)
            for j in range(len(s["joints"]))
            if problem["brake"][:, j].any()
        ]
        self.contacts: dict[int, Any] = {}
        self.feet, self.frames = [], []
        for n, name in enumerate(s["soles"]):
            if held[4 * n]:
                frame = solver.add_frame_task(name, np.eye(4))
                position, orientation = frame.position(), frame.orientation()
                for part in (position, orientation):
                    self._configure(part, f"{name} {part is position}")
                self.frames.append((position, orientation, n))
                if "planar" in s:
                    self._planar(frame, n)
        for k, name in enumerate(s["contacts"]):
            if not held[k]:
                self.feet.append((self._position(name, weights["swing"]), k))
            elif not s["soles"]:
                foot = self._position(name)
                self.feet.append((foot, k))
                self.contacts[k] = self._contact(solver.add_unilateral_point_contact(foot), "force")
            elif loaded[k] and "planar" not in s:
                self.contacts[k] = self._contact(
                    solver.add_unilateral_point_contact(self._position(name, 0.0)), "force"
                )
        self.mounts = [
            self._contact(solver.add_point_contact(self._position(name, 0.0)), "thrust")
            for name in s["thrusters"]
        ]

    def _configure(self, task: Any, name: str, weight: float | None = None) -> None:
        """Hard without a weight; accelerations are given."""
        task.kp, task.kd = 0.0, 0.0
        if weight is None:
            task.configure(name, "hard")
        else:
            task.configure(name, "soft", weight)

    def _position(self, name: str, weight: float | None = None) -> Any:
        task = self.solver.add_position_task(name, np.zeros(3))
        self._configure(task, name, weight)
        return task

    def _joints(self, name: str, weight: float) -> Any:
        task = self.solver.add_joints_task()
        self._configure(task, name, weight)
        return task

    def _planar(self, frame: Any, n: int) -> None:
        how, contact = self.settings["planar"], self.solver.add_planar_contact(frame)
        contact.length, contact.width = how["sides"][n]
        contact.mu = self.settings["mu"]
        contact.weight_forces, contact.weight_moments = how["force"], how["moment"][n]

    def _contact(self, contact: Any, weight: str) -> Any:
        contact.weight_forces = self.settings["weights"][weight]
        contact.mu = self.settings["mu"]
        return contact


class Replay:
    """All ticks: which formulation each has, and what it is given, as Python's lists where placo
    takes those.
    """

    def __init__(self, problem: dict[str, Any]) -> None:
        s = self.settings = problem["settings"]
        self.problem = problem
        self.robot = placo.RobotWrapper(s["urdf"], placo.Flags.ignore_collisions)
        self.robot.model.armature = np.array(s["armature"])
        self.formulations: dict[bytes, Formulation] = {}
        self.at = []
        for held, loaded in zip(problem["held"], problem["loaded"], strict=True):
            key = held.tobytes() + loaded.tobytes()
            if key not in self.formulations:
                self.formulations[key] = Formulation(self.robot, problem, held, loaded)
            self.at.append(self.formulations[key])
        self.rows = {
            name: list(problem[name]) for name in ("q", "v", "body", "orientation", "resistance")
        }
        self.rows |= {name: [list(row) for row in problem[name]] for name in ("feet", "sole")}
        self.rows |= {name: problem[name].tolist() for name in ("joints", "brake")}

    def step(self, i: int) -> tuple[Any, Any, int, int]:
        """A tick: the result, its torques, and the times of the tick and of its two calls of C++,
        ns.
        """
        f, rows, clock, joints = self.at[i], self.rows, perf_counter_ns, self.settings["joints"]
        begin = clock()
        state, target = self.robot.state, rows["joints"][i]
        state.q = rows["q"][i]
        state.qd = rows["v"][i]
        t0 = clock()
        self.robot.update_kinematics()
        t1 = clock()
        f.body.ddtarget_world = rows["body"][i]
        if f.centre is not None:
            f.centre.ddtarget_world = rows["body"][i]
        f.orientation.domega_world = rows["orientation"][i]
        for task, numbers in f.postures:
            for j in numbers:
                task.set_joint(joints[j], 0.0, 0.0, target[j])
        for task, j in f.brakes:
            task.set_joint(joints[j], 0.0, 0.0, target[j])
            task.configure(f"brake {j}", "soft", rows["brake"][i][j])
        for foot, k in f.feet:
            foot.ddtarget_world = rows["feet"][i][k]
        for position, orientation, n in f.frames:
            sole = rows["sole"][i][n]
            position.ddtarget_world = sole[:3]
            orientation.domega_world = sole[3:]
        f.solver.extra_force = rows["resistance"][i]
        t2 = clock()
        result = f.solver.solve()
        t3 = clock()
        tau = result.tau
        return result, tau[6:], clock() - begin, t3 - t2 + t1 - t0

    def solution(self, i: int) -> dict[str, Any]:
        """``acceleration``, ``force`` and ``thrust`` at a tick; nothing where the solver failed."""
        result, *_ = self.step(i)
        if not result.success:
            return {}
        force, f = np.zeros((len(self.settings["contacts"]), 3)), self.at[i]
        for k, contact in f.contacts.items():
            force[k] = contact.wrench
        return {
            "acceleration": result.qdd,
            "force": force,
            "thrust": [contact.wrench for contact in f.mounts],
        }


def answer(problem: dict[str, Any]) -> dict[str, Any]:
    """Solutions of all states, NaN where the solver failed, and the times of every repetition,
    torques with them.
    """
    (n, nv), s, peer = problem["v"].shape, problem["settings"], Replay(problem)
    shapes = {
        "acceleration": (nv,),
        "force": (len(s["contacts"]), 3),
        "thrust": (len(s["thrusters"]), 3),
    }
    found = {key: np.full((n, *shape), np.nan) for key, shape in shapes.items()}
    for i in range(n):
        for key, value in peer.solution(i).items():
            found[key][i] = np.reshape(
                value, found[key][i].shape
            )  # without thrusters a list is empty
    laps = np.zeros((2, s["repetitions"], n), dtype=np.int64)
    torque = np.full((n, nv - 6), np.nan)  # what was timed is what is checked
    gc.collect()
    gc.disable()
    for repetition in range(s["repetitions"]):
        for i in range(n):
            result, tau, *laps[:, repetition, i] = peer.step(i)
            torque[i] = tau if result.success else np.nan
    gc.enable()
    return {**found, "torque": torque, "tick_ns": laps[0], "inside_ns": laps[1]}


def main(problem_file: str, result_file: str) -> None:
    """Solve, time and write."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    problem["settings"] = json.loads(str(problem["settings"]))
    out = answer(problem)
    laps = np.zeros(20_000, dtype=np.int64)
    for i in range(len(laps)):
        begin = perf_counter_ns()
        laps[i] = perf_counter_ns() - begin
    versions = json.dumps({name: version(name) for name in ("placo", "pin", "numpy")})
    np.savez(result_file, versions=versions, overhead_ns=np.median(laps), **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
