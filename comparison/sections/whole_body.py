"""How long one whole-body optimum of G1 takes: two soles, two hands, torso, centre of mass.

    python -m comparison.sections.whole_body

The optimum in six unknowns (:class:`harpy_pin.WholeBodySolver`) beside a tick of the whole-body QP
to which the same tasks are added. Both solve the same states in turns, block by block.
"""

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.condensed.task_memory import AnyTask
from harpy_pin.wbc.condensed.whole_body_solve import solve_whole_body

STATES, BLOCKS = 200, 20
HANDS = ("left_wrist_yaw_link", "right_wrist_yaw_link")


def tasks_of(robot: hp.Robot, q: Vector) -> dict[AnyTask, float]:
    """Tasks that hold a posture, with weights."""
    data, gains = robot.model.createData(), (100.0, 20.0)
    pin.framesForwardKinematics(robot.model, data, q)
    places = {frame: data.oMf[robot.frame_id(frame)] for frame in ("torso_link", *HANDS)}
    centre = pin.centerOfMass(robot.model, data, q)
    tasks: dict[AnyTask, float] = {
        hp.CentreOfMassTask(position=centre, gains=gains): 10.0,
        hp.FrameTask(
            "torso_link", part="orientation", rotation=places["torso_link"].rotation, gains=gains
        ): 1.0,
        hp.JointTask(robot.joints, position=q[7:], gains=gains): 0.01,
    }
    for hand in HANDS:
        place = places[hand]
        task = hp.FrameTask(
            hand, part="both", position=place.translation, rotation=place.rotation, gains=gains
        )
        tasks[task] = 10.0
    return tasks


def main() -> None:
    """Time both, and print medians."""
    robot = hp.load_robot("g1")
    gait = hp.Standing(robot)
    q, v = gait.initial_state()
    controller = hp.make_controller("wbc", gait, mu=0.6)
    for task, weight in tasks_of(robot, q).items():
        controller.add(task, weight=weight)
    solver, dynamics = hp.WholeBodySolver(robot, tasks_of(robot, q)), hp.Dynamics(robot)
    share = np.tile((0.0, 0.0, robot.mass * 9.81 / len(robot.feet)), (len(robot.feet), 1))
    states = []
    for n in range(STATES):  # a smooth sway
        turn = 2e-3 * np.sin(2.0 * np.pi * n / STATES + np.arange(len(v)))
        moved = pin.integrate(robot.model, q, turn)
        dynamics.update(moved, 5.0 * turn)
        places = dynamics.foot_position.copy(), dynamics.foot_velocity.copy()
        states.append(hp.State(1e-3 * n, moved, 5.0 * turn, *places, share))
    record = solver.record
    rows: dict[str, Callable[[State], object]] = {
        "six unknowns, kernel": lambda state: solve_whole_body(record, state.q, state.v),
        "six unknowns, solver.solve": solver.solve,
        "whole-body QP with these tasks, controller.step": controller.step,
    }
    laps: dict[str, list[int]] = {name: [] for name in rows}
    for _ in range(BLOCKS):
        for name, solve in rows.items():
            for state in states:
                begin = perf_counter_ns()
                solve(state)
                laps[name].append(perf_counter_ns() - begin)
    for name, taken in laps.items():
        print(
            f"{name}: {np.median(taken[STATES:]) / 1e3:.2f} µs, 99 % "
            f"{np.percentile(taken[STATES:], 99) / 1e3:.2f} µs"
        )


if __name__ == "__main__":
    main()
