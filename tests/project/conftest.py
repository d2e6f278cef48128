"""The gait, states of a walk, and the robot at the start of the gait."""

import pytest
import wheel_alone
from walks import started, states_of

import harpy_pin as hp


@pytest.fixture(scope="module")
def gait(robot):
    return hp.make_gait(robot)


@pytest.fixture(scope="session")
def installed(wheel, tmp_path_factory):
    """Python of an environment that has the wheel, and everything else from the environment of the
    tests.
    """
    return wheel_alone.install(
        wheel, tmp_path_factory.mktemp("installed") / "environment", shared=True, ziglang=True
    )


@pytest.fixture(scope="module")
def states():
    """States of a walk, every twentieth tick."""
    run = hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=1.5))
    return [state.copy() for state in states_of(run)[::20]]


@pytest.fixture
def simulator(robot, gait):
    """The robot at the start of the gait."""
    return started(hp.Simulator(robot, hp.Ground(mu_s=0.8)), gait)
