"""The gait, states of a walk, and the robot at the start of the gait."""

import pytest

import harpy_pin as hp


@pytest.fixture(scope="module")
def gait(robot):
    return hp.make_gait(robot)


@pytest.fixture(scope="module")
def states():
    """States of a walk, every twentieth tick."""
    run = hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=1.5))
    columns = [run[name] for name in ("t", "q", "v", "foot_position", "foot_velocity", "foot_force")]
    return [hp.State(float(t), *(a.copy() for a in rest)) for t, *rest in zip(*columns, strict=True)][::20]


@pytest.fixture
def simulator(robot, gait):
    """The robot at the start of the gait."""
    simulator = hp.Simulator(robot, hp.Ground(mu_s=0.8))
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    return simulator
