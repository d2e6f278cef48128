"""Plans a straight walk with placo's walk pattern generator; runs in placo's virtual environment.

    python pattern_worker.py PROBLEM RESULT

PROBLEM holds ``settings``, JSON. RESULT holds, for every ``dt``: ``q``, the configuration by placo's inverse
kinematics; ``com``, the centre of mass; ``share``, of the load on the left foot. ``joints`` are names, in the order of
``q``.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import placo


def main(problem_file: str, result_file: str) -> None:
    """Plan, and write every sample."""
    with np.load(problem_file) as file:
        s: dict[str, Any] = json.loads(str(file["settings"]))
    robot = placo.HumanoidRobot(s["urdf"], placo.Flags.ignore_collisions)
    for joint, angle in s["posture"].items():
        robot.set_joint(joint, angle)
    robot.update_kinematics()
    parameters = placo.HumanoidParameters()
    for name, value in s["parameters"].items():
        setattr(parameters, name, value)
    solver = placo.KinematicsSolver(robot)
    solver.dt = s["dt"]
    tasks = placo.WalkTasks()
    tasks.initialize_tasks(solver, robot)
    upper = solver.add_joints_task()
    upper.set_joints(s["upper"])
    upper.configure("upper", "soft", 1.0)
    solver.add_regularization_task(1e-6)
    tasks.reach_initial_pose(np.eye(4), parameters.feet_spacing, parameters.walk_com_height, 0.0)

    planner = placo.FootstepsPlannerRepetitive(parameters)
    planner.configure(s["length"], 0.0, 0.0, s["steps"])
    feet = [placo.flatten_on_floor(pose) for pose in (robot.get_T_world_left(), robot.get_T_world_right())]
    footsteps = planner.plan(placo.HumanoidRobot_Side.left, *feet)
    supports = placo.FootstepsPlanner.make_supports(footsteps, 0.0, True, parameters.has_double_support(), True)
    path = placo.WalkPatternGenerator(robot, parameters).plan(supports, robot.com_world(), 0.0)

    omega = placo.LIPM.compute_omega(parameters.walk_com_height)
    q, com, share = [], [], []
    for t in np.arange(0.0, path.t_end, s["dt"]):
        tasks.update_tasks_from_trajectory(path, t)
        robot.update_kinematics()
        solver.solve(True)
        robot.update_kinematics()
        q.append(np.array(robot.state.q))
        com.append(path.get_p_world_CoM(t))
        if path.support_is_both(t):
            left, right = path.get_T_world_left(t)[:2, 3], path.get_T_world_right(t)[:2, 3]
            apart = left - right
            share.append(np.clip((path.get_p_world_ZMP(t, omega) - right) @ apart / (apart @ apart), 0.0, 1.0))
        else:
            share.append(float(path.support_side(t) == placo.HumanoidRobot_Side.left))
    np.savez(result_file, q=q, com=com, share=share, joints=list(robot.joint_names()))


if __name__ == "__main__":
    main(*sys.argv[1:])
