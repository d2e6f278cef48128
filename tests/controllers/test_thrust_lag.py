"""Controllers that know that thrusts lag: the thrusts they count on, the forces that follow, law and QP."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from random_states import draw

import harpy_pin as hp
from harpy_pin.errors import InputError
from harpy_pin.simulation.actuators import Actuators

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)
LAG, MU = 0.1, 0.25


def walk(kind, *, duration=1.5, **parameters):
    """A walk with fans that lag."""
    controller = hp.make_controller(kind, GAIT, mu=MU, parameters=parameters)
    plant = hp.Simulator(ROBOT, hp.Ground(mu_s=MU), actuators=Actuators(thrusters={"lag": LAG}))
    plant.reset(*GAIT.initial_state(penetration=plant.static_penetration))
    return controller, plant, plant.run(controller, duration)


def test_thrusts_are_those_of_the_plant():
    """What the controller fixes in its program is the mean of the plant's thrust over the tick."""
    controller = hp.make_controller("condensed", GAIT, mu=MU, parameters={"thrust_lag": LAG})
    plant = hp.Simulator(ROBOT, hp.Ground(mu_s=MU), actuators=Actuators(thrusters={"lag": LAG}))
    plant.reset(*GAIT.initial_state(penetration=plant.static_penetration))
    for _ in range(300):
        command = controller.step(plant.state)
        means = []
        for _ in range(2):  # physics steps of a tick
            plant.advance(command)
            means.append(plant.step_record["thrusters"]["mean_thrust"][0].copy())
        np.testing.assert_allclose(np.mean(means, axis=0), controller.solver.inputs[:6], atol=1e-9)
    assert np.abs(command.thrust.ravel() - controller.solver.inputs[:6]).max() > 0.1  # the command is another


def test_legs_make_up_for_the_lag():
    """Feet slip less than where nothing is known of the lag, which is what the legs are for."""
    slips = [hp.measure(walk("condensed", duration=3.0, thrust_lag=lag)[2]).slip_mm_per_step for lag in (0.0, LAG)]
    assert slips[1] < 0.3 * slips[0]


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_condensed_is_the_quadratic_program(formulation, fuzz):
    """Commands of both, in states as they come, with thrusts that lag behind their own commands."""
    rng = np.random.default_rng(3)
    parameters = {"thrust_lag": LAG, "weights": {"posture": 1e-10}}
    law = hp.make_controller("condensed", GAIT, mu=MU, parameters=parameters)
    program = hp.make_controller("wbc", GAIT, mu=MU, parameters=parameters | {"formulation": formulation})
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


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_condensed_is_the_quadratic_program_on_a_walk(formulation):
    """Both answer every state of a pushed walk alike; the condensed controller walks."""
    parameters = {"thrust_lag": LAG, "weights": {"posture": 1e-10}}
    law = hp.make_controller("condensed", GAIT, mu=MU, parameters=parameters)
    program = hp.make_controller("wbc", GAIT, mu=MU, parameters=parameters | {"formulation": formulation})
    plant = hp.Simulator(ROBOT, hp.Ground(mu_s=MU), actuators=Actuators(thrusters={"lag": LAG}))
    plant.reset(*GAIT.initial_state(penetration=plant.static_penetration))
    for _ in range(1000):
        state = plant.state
        one, other = law.step(state), program.step(state)
        np.testing.assert_allclose(one.thrust, other.thrust, rtol=0, atol=1e-5)
        np.testing.assert_allclose(one.torque, other.torque, rtol=0, atol=2e-5)
        plant.advance(one, [hp.Push(time=0.5, impulse=(1.0, 2.0, 0.0))], steps=2)
    assert program.failures == 0


@pytest.mark.parametrize("kind", ["condensed", "wbc"])
def test_copies_and_reset(kind):
    controller, plant, _ = walk(kind, duration=0.2, thrust_lag=LAG)
    state = plant.state
    twin = deepcopy(controller)
    first = controller.step(state)
    wanted = (first.torque.copy(), first.thrust.copy())
    again = twin.step(state)
    assert (again.torque == wanted[0]).all()
    assert (again.thrust == wanted[1]).all()
    controller.reset()
    fresh = hp.make_controller(kind, GAIT, mu=MU, parameters={"thrust_lag": LAG})
    for one in (controller, fresh):
        one.step(state)
    assert np.allclose(controller._command.thrust, fresh._command.thrust, atol=1e-9)


@pytest.mark.parametrize("value", [-0.1, float("nan"), 1e9])
def test_bad_lags_are_refused(value):
    with pytest.raises(InputError, match="thrust_lag"):
        hp.make_controller("condensed", GAIT, mu=MU, parameters={"thrust_lag": value})
