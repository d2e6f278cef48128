"""What peers are given is the program that our controllers solve."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peer_cases import CASES, Make, elbow_case

from comparison.peers.cases import is_lifted
from comparison.peers.dense_program import DenseProgram, read_model
from comparison.peers.our_replay import contenders
from comparison.peers.peer_problem import ARRAYS, PeerProblem, make_problem

DENSE = {
    "harpy, walks": 43,
    "solo12, walks": 43,
    "go2, stands": 89,
    "go2, walks": 43,
    "g1 on points, stands": 89,
} | {f"{name} on soles, {what}": 67 for name in ("g1", "talos") for what in ("stands", "walks")}
"""Every so many ticks of each case are solved once more."""


@pytest.mark.parametrize("name", DENSE)
def test_what_peers_are_given_is_what_our_controllers_solve(made: Make, name: str) -> None:
    """A dense program of the handed-over numbers, built by Pinocchio and NumPy and solved by
    quadprog.
    """
    case, problem = made(name)
    ticks = range(5, len(case.sequences[0]), DENSE[name])
    model, states, joints = (
        read_model(problem),
        case.sequences[0].states,
        len(case.gait.robot.joints),
    )
    ours = {own: make() for own, make in contenders(case).items() if "ProxQP" not in own}
    commands: dict[str, dict[int, np.ndarray]] = {own: {} for own in ours}
    for own, controller in ours.items():
        for i, state in enumerate(states):
            torque = controller.step(state).torque
            if i in ticks:
                commands[own][i] = torque.copy()
    for i in ticks:
        program = DenseProgram(problem, model, i)
        x = program.solve()
        torque, e = program.torque(x), problem.expected
        np.testing.assert_allclose(e.torque[i], torque, atol=1e-6)
        np.testing.assert_allclose(e.acceleration[i], x[: model.nv], atol=1e-5)
        force = np.zeros((len(case.gait.robot.feet), 3))
        force[program.points] = x[model.nv : model.nv + 3 * len(program.points)].reshape(-1, 3)
        np.testing.assert_allclose(e.force[i], force, atol=1e-5)
        # the search leaves multipliers of the wrong sign up to PULL, which forces of small weight
        # feel
        np.testing.assert_allclose(commands["whole-body QP, own search"][i], torque, atol=2e-4)
        np.testing.assert_allclose(commands["condensed WBC"][i], torque, atol=2e-4)
    assert joints == len(problem.settings["joint_weights"])


@pytest.mark.parametrize("name", CASES)
def test_states_are_those_of_a_robot_that_stands_or_walks(made: Make, name: str) -> None:
    case, problem = made(name)
    robot, e, counts = case.gait.robot, problem.expected, problem.counted > 0.0
    assert e.solved.all()
    weight = robot.mass * 9.81
    measured = (
        np.concatenate([[s.foot_force[:, 2].sum() for s in q.states] for q in case.sequences])[
            counts
        ]
        / weight
    )
    assert 0.9 < np.median(measured) < 1.1
    if name == "harpy, walks":  # thrusters bear a part
        return
    assert measured.min() > 0.6
    assert e.force[counts][..., 2].sum(axis=1).min() > 0.6 * weight
    lifted = [is_lifted(robot, state) for q in case.sequences for state in q.states]
    at_limit = np.abs(e.torque) > np.array(problem.settings["torque_limit"]) - 1e-6
    assert not at_limit.any()
    changes = np.abs(np.diff(problem.held[counts], axis=0)).any(axis=1).sum()
    if "stands" in name:
        assert changes == 0
        assert not any(lifted[case.first :])
    else:
        assert changes >= 2


def test_braking_friction_and_damping_are_handed_over(tmp_path: Path) -> None:
    case = elbow_case()
    robot, states = case.gait.robot, case.sequences[0].states
    elbow = robot.joints.index("left_elbow_joint")
    problem = make_problem(case, tmp_path / "robot.urdf")
    assert (problem.brake[:, elbow] > 0.0).all()
    np.testing.assert_array_less(0.2, np.abs(problem.resistance[:, 6:]).max(axis=1))
    model, controllers = (
        read_model(problem),
        {name: make() for name, make in contenders(case).items()},
    )
    idle = {"brake": 0.0, "resistance": 0.0}  # what a program without it differs by, N·m
    for i, state in enumerate(states):
        program = DenseProgram(problem, model, i)
        torque = program.torque(program.solve())
        for controller in controllers.values():
            np.testing.assert_allclose(controller.step(state).torque, torque, atol=1e-3)
        for name in idle:
            less = replace(problem, **{name: np.zeros_like(getattr(problem, name))})
            other = DenseProgram(less, model, i)
            idle[name] = max(idle[name], float(np.abs(other.torque(other.solve()) - torque).max()))
    assert idle["brake"] > 0.01
    assert idle["resistance"] > 0.1


def test_problem_file_holds_what_was_saved(problem: PeerProblem, tmp_path: Path) -> None:
    problem.save(tmp_path / "problem.npz", 3, {"colour": "green"})
    with np.load(tmp_path / "problem.npz") as file:
        for name in ARRAYS:
            np.testing.assert_array_equal(file[name], getattr(problem, name))
        settings = json.loads(str(file["settings"]))
    assert (settings["repetitions"], settings["colour"]) == (3, "green")
    assert len(settings["contacts"]) == len(settings["thrusters"]) == 2
    assert Path(settings["urdf"]).is_file()
