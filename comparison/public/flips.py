"""dfki-quad's backflip and salto: trajectories of the joints, replayed on its robot in our simulator.

The files have angles, speeds and torques of the joints, and no motion of the body. So two things are tried: the joints'
own springs and dampers with the torques of the file, as that project replays them, and the whole-body QP with the
joints' accelerations as its only task.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin

from comparison.measure.walking import Rows
from comparison.public.sources import reading
from comparison.tables import Cell, in_columns
from harpy_pin import Dynamics, Ground, Robot, Simulator, load_robot
from harpy_pin.model.state import Command, Vector
from harpy_pin.wbc import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights, make_problem, make_solver

__all__ = ["flip_columns", "replay_flips"]

URDF = "common/model/urdf/quad.urdf"
FILES = {
    "backflip": "backflip_contact_frameCorrected_ros2_interp500.csv",
    "salto": "planarProblemSaltoForward17032023_frameCorrected_interp.csv",
}
FEET = ("fl_contact", "fr_contact", "bl_contact", "br_contact")
JOINTS = {"abad": "1", "shoulder": "2", "knee": "3"}
SPRING, DAMPER = 100.0, 1.0
"""N·m/rad and N·m·s/rad. Of 12 pairs tried from 30 and 0.3 to 150 and 3, two let the backflip land."""
STIFFNESS, DAMPING = 400.0, 40.0
"""1/s² and 1/s of the QP's task on the joints. Of 12 pairs tried from 100 and 10 to 900 and 40, none lets it land."""
GROUND = Ground(stiffness=2e4, mu_s=1.0)
REST = 0.3
"""Time at rest before and after, s."""
PERIOD, STEPS = 1e-3, 4
_COLUMNS = {
    "peak_m": ("highest, m", ""),
    "turn_deg": ("turn, °", ""),
    "up": ("cosine to upright", ""),
    "error_rad": ("joints' error, rad", ""),
    "torque": ("largest torque, N·m", ""),
}


class _Motion:
    """Angles, speeds, torques and accelerations over time, in the robot's order of joints."""

    def __init__(self, path: Path, robot: Robot) -> None:
        with reading(path, "trajectory of dfki-quad"):
            table = pd.read_csv(path)
            columns = [f"{name[:2]}{JOINTS[name[3:]]}" for name in robot.joints]
            self.t = table["t[s]"].to_numpy()
            parts = [table[[f"{kind}_{c}" for c in columns]].to_numpy() for kind in ("q", "qd", "Tau")]
        self.parts = [*parts, np.gradient(parts[1], self.t, axis=0)]

    def at(self, time: float) -> list[Vector]:
        """Angles, speeds, torques and accelerations; at rest before and after."""
        moving = 0.0 < time < self.t[-1]
        values = [np.array([np.interp(time, self.t, column) for column in part.T]) for part in self.parts]
        return [values[0], *(value * moving for value in values[1:])]


def replay_flips(workspace: Path) -> Rows:
    """Both motions, under springs with the file's torques and under the QP.

    Returns:
        For each replay the greatest height of the base, m, how far it turned, °, and the cosine between its axis and
        the upright at the end, the root mean square error of the joints, rad, and the largest torque, N·m.
    """
    robot = load_robot(workspace / URDF, feet=FEET)
    motions = {name: _Motion(workspace / "controllers/trajectories" / file, robot) for name, file in FILES.items()}
    return [
        {"motion": name, "by": "QP" if by_qp else "springs", **_replay(robot, motion, by_qp)}
        for name, motion in motions.items()
        for by_qp in (False, True)
    ]


def flip_columns(row: dict[str, Any]) -> list[Cell]:
    """The cells of one replay."""
    return in_columns(f"{row['motion']}, {row['by']}", row, _COLUMNS)


def _start(robot: Robot, angles: Vector) -> Vector:
    """The first posture with all feet on the ground."""
    model, data = robot.model, robot.model.createData()
    q: Vector = pin.neutral(model)
    q[7:] = angles
    for _ in range(2):
        pin.framesForwardKinematics(model, data, q)
        feet = np.array([data.oMf[robot.frame_id(name)].translation for name in FEET])
        rise = feet[:2].mean(axis=0) - feet[2:].mean(axis=0)
        if q[4] == 0.0:
            q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, float(np.arctan2(rise[2], rise[0])), 0.0)).coeffs()
    q[2] = -feet[:, 2].min()
    return q


def _replay(robot: Robot, motion: _Motion, by_qp: bool) -> dict[str, float]:
    simulator, dynamics, targets = Simulator(robot, GROUND, dt=PERIOD / STEPS), Dynamics(robot), WholeBodyTargets(robot)
    weights = WholeBodyWeights(body=0.0, orientation=0.0, swing=0.0, posture=1.0)
    problem = make_problem("full", robot, weights, WholeBodyLimits(mu=GROUND.mu_s))
    solver = make_solver("proxqp", problem.program, reuse=True)
    simulator.reset(_start(robot, motion.at(0.0)[0]), np.zeros(robot.model.nv))
    command = Command(np.zeros(len(robot.joints)), np.zeros((0, 3)))
    turn, heights, errors, torques = 0.0, [], [], []
    for tick in range(int((motion.t[-1] + 2.0 * REST) / PERIOD)):
        time = tick * PERIOD - REST
        angles, speeds, torque, accelerations = motion.at(min(max(time, 0.0), float(motion.t[-1])))
        q, v = simulator.q.copy(), simulator.v.copy()
        error, lag = angles - q[7:], speeds - v[6:]
        command.torque[:] = torque + SPRING * error + DAMPER * lag
        if by_qp:
            dynamics.update(q, v)
            targets.joints[:] = accelerations + STIFFNESS * error + DAMPING * lag
            targets.held[:] = dynamics.foot_position[:, 2] < 0.0
            targets.feet[:] = -targets.held[:, None] * DAMPING * dynamics.foot_velocity
            problem.build(dynamics, v, dynamics.rotation, targets)
            solution = solver.solve(problem.program)
            if solution.usable:
                problem.inputs(solution.z, command.torque)
        np.clip(command.torque, -robot.torque_limit, robot.torque_limit, out=command.torque)
        simulator.advance(command, steps=STEPS)
        turn += float(np.degrees(v[4])) * PERIOD
        if 0.0 < time < motion.t[-1]:
            heights.append(q[2])
            errors.append(error)
            torques.append(np.abs(command.torque).max())
    up = pin.Quaternion(simulator.q[3:7]).matrix()[2, 2]
    return {
        "peak_m": float(max(heights)),
        "turn_deg": turn,
        "up": float(up),
        "error_rad": float(np.sqrt(np.mean(np.square(errors)))),
        "torque": float(max(torques)),
    }
