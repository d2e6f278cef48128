"""Controllers that know that thrusts lag: the thrusts they count on, the forces that follow, law
and QP.
"""

from functools import cache

import numpy as np
import pytest
from needs import needs_mujoco, needs_robots
from random_states import draw
from walks import started, walked

import harpy_pin as hp
from comparison.studies.margins import pd_lag_margin
from harpy_pin.contrib.thrust_lag import (
    advance_thrusts,
    command_thrusts,
    keep_thrusts,
    thrust_lag_record,
)
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.simulation.actuators import Actuators

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)
LAG, MU = 0.1, 0.25


@pytest.mark.parametrize("turning_lag", [0.0, 0.05])
def test_thrusts_are_those_of_the_plant(turning_lag):
    """What the controller fixes in its program is the mean of the plant's thrust over the tick.

    Where directions turn, they are those at the end of the tick.
    """
    parameters = {"thrust_lag": LAG, "thrust_turning_lag": turning_lag}
    controller = hp.make_controller("condensed", GAIT, mu=MU, **parameters)
    actuators = Actuators(thrusters={"lag": LAG, "turning_lag": turning_lag})
    plant = started(hp.Simulator(ROBOT, hp.Ground(mu_s=MU), actuators=actuators), GAIT)
    for _ in range(300):
        command = controller.step(plant.state)
        means = []
        for _ in range(2):  # physics steps of a tick
            plant.advance(command)
            means.append(plant.record["thrusters"]["mean_thrust"][0].copy())
        end = plant.record["thrusters"]["direction"][0]
        error = np.abs(controller._record_["lag"]["direction"][0] - end).max()
        assert error < 2e-3  # the body turns in a tick, and with it the aim, which leads far
        had = np.linalg.norm(np.mean(means, axis=0).reshape(2, 3), axis=1)
        fixed = np.linalg.norm(controller.solver.inputs[:6].reshape(2, 3), axis=1)
        np.testing.assert_allclose(had, fixed, rtol=2e-3 if turning_lag else 1e-12, atol=1e-9)
        if turning_lag == 0.0:
            np.testing.assert_allclose(
                np.mean(means, axis=0), controller.solver.inputs[:6], atol=1e-9
            )
    assert (
        np.abs(command.thrust.ravel() - controller.solver.inputs[:6]).max() > 0.1
    )  # the command is another


@cache
def slip(plant, lag, turning_lag, known=True):
    fans = Actuators(torque_share=1.0, thrusters={"lag": lag, "turning_lag": turning_lag})
    part = hp.Condensed(
        parameters={"thrust_lag": lag, "thrust_turning_lag": turning_lag} if known else {}
    )
    return hp.measure(
        walked(controller=part, actuators=fans, plant=plant, mu_s=MU, duration=3.0)
    ).slip_mm_per_step


@pytest.mark.parametrize(
    ("plant", "lag", "turning_lag"),
    [
        *(("compliant", lag, 0.0) for lag in (0.1, 0.3)),
        ("compliant", 0.1, 0.05),
        pytest.param("mujoco", 0.1, 0.05, marks=needs_mujoco),
    ],
)
def test_slip_is_within_twice_that_without_lag(plant, lag, turning_lag):
    none = slip(plant, 0.0, 0.0)
    assert slip(plant, lag, turning_lag) < 2.0 * none < slip(plant, lag, turning_lag, known=False)


@pytest.mark.parametrize("values", [(3.0, -1.0, 4.0), (0.5, 0.0, 0.2), (0.0, 30.0, 40.0)])
def test_thrust_follows_the_program_as_if_it_had_a_short_lag(values):
    """By the exact solution of the lag, where the command has no limit; at a limit as near as it
    comes.
    """
    period, present = 1e-3, 5.0
    record = thrust_lag_record(
        ROBOT, WholeBodyParameters.for_gait(hp.make_gait(ROBOT), thrust_lag=LAG, period=period)
    )
    record["level"] = record["goal"] = present
    record["settled"] = 1
    advance_thrusts(record)
    variables, command = np.zeros(6), np.zeros((2, 3))
    dynamics = Dynamics(ROBOT)
    dynamics.update(*GAIT.initial_state())
    rotation = dynamics.rotation
    record["direction"][0] = np.array(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))) @ rotation
    keep_thrusts(record, rotation)
    variables[:3] = np.array(values) - record["kept"][0, :3]  # of the first thruster
    variables[3:] = -record["kept"][0, 3:]  # the other one lets go
    command_thrusts(record, dynamics.record, variables, command)
    goal, left = np.linalg.norm(command, axis=1), np.exp(-period / LAG)
    end = goal + left * (present - goal)
    reach = (left * present, left * present + (1.0 - left) * ROBOT.thrust_limit)
    followed = np.linalg.norm(values) + np.exp(-period / 0.01) * (present - np.linalg.norm(values))
    assert end[0] == pytest.approx(np.clip(followed, *reach), rel=1e-6)
    assert end[1] == pytest.approx(reach[0], rel=1e-6)
    np.testing.assert_allclose(np.cross(command[0], values), 0.0, atol=1e-9)
    np.testing.assert_allclose(command[1] / goal[1], (1.0, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("formulation", "turning_lag"), [("input_space", 0.0), ("full", 0.0), ("input_space", 0.05)]
)
def test_condensed_is_the_quadratic_program(formulation, turning_lag, fuzz):
    """Commands of both, in states as they come, with thrusts that lag behind their own commands."""
    rng = np.random.default_rng(3)
    parameters = {
        "thrust_lag": LAG,
        "thrust_turning_lag": turning_lag,
        "weights": {"posture": 1e-10},
    }
    law = hp.make_controller("condensed", GAIT, mu=MU, **parameters)
    program = hp.make_controller(
        "wbc", GAIT, mu=MU, **(parameters | {"formulation": formulation, "solver": "active_set"})
    )
    compared = 0
    for _ in range(300 * fuzz):
        state = draw(ROBOT, rng, legs="anyhow")
        one, other = law.step(state), program.step(state)
        if law.solver.status > 3 or not program.solution.usable:
            law.reset(), program.reset()
            continue
        compared += 1
        np.testing.assert_allclose(one.thrust, other.thrust, rtol=0, atol=2e-5 * 60.0)
        np.testing.assert_allclose(one.torque, other.torque, rtol=0, atol=2e-5 * 60.0)
    assert compared > 100 * fuzz


@needs_robots
@pytest.mark.parametrize("known", [False, True])
def test_rotorcraft_needs_to_know(known):
    """With a lag beyond the linear margin it falls, or holds its place where it knows the lag."""
    gait = hp.Hovering(hp.load_robot("iris"), shift=(0.3, 0.0, 0.2), shift_period=6.0)
    lag = 1.05 * pd_lag_margin(*gait.controller_parameters["orientation"], period=1e-3)
    part, late = (
        hp.Condensed(parameters={"thrust_lag": lag} if known else {}),
        Actuators(thrusters={"lag": lag}),
    )
    run = walked(gait, controller=part, actuators=late, duration=6.0)
    assert run.fell != known
    assert not known or np.abs(run["q"][:, :3] - run["x_r"][:, :3]).max() < 0.005
