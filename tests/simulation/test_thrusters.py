"""Thrusters with lag, limits and gimbals: closed forms, MuJoCo."""

import math

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_mujoco
from walks import started, walked

import harpy_pin as hp
from harpy_pin.errors import InputError
from harpy_pin.simulation.actuators import Actuators
from harpy_pin.simulation.thrusters import Thrusters, drive_thrusters, thrusters_record

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)
DT = 5e-4
LEVEL = np.eye(3)


def responses(thrusters, commands, *, rotation=LEVEL, count=1):
    """Mean thrust in each step under commands of all thrust variables."""
    record = thrusters_record(thrusters, count=count, variables=len(commands[0]), dt=DT)
    found = []
    for command in commands:
        drive_thrusters(record, rotation, np.asarray(command, float))
        found.append(record["mean_thrust"][0].copy())
    return np.array(found)


def upward(values):
    """Commands of one free thruster."""
    return [(0.0, 0.0, value) for value in values]


@pytest.mark.parametrize("lag", [1e-4, 0.02, 0.3])
def test_step_response_of_first_order(lag):
    found = responses(Thrusters(lag=lag), upward([5.0] + 400 * [20.0]))[1:, 2]
    t = DT * np.arange(401)
    exact = 20.0 * np.diff(t) + 15.0 * lag * np.diff(
        np.exp(-t / lag)
    )  # integral of 20 − 15 e^(−t/T) over each step
    np.testing.assert_allclose(found, exact / DT, rtol=1e-9)


def test_rate_limits_what_is_followed():
    found = responses(Thrusters(rate=100.0), upward([5.0] + 400 * [20.0]))[1:, 2]
    np.testing.assert_allclose(
        found, np.minimum(5.0 + 100.0 * DT * np.arange(1, 401), 20.0), rtol=1e-12
    )


def test_least_and_largest():
    """An idling thruster pushes on in its last direction."""
    found = responses(
        Thrusters(least=3.0, largest=9.0), [(0.0, 6.0, 8.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    )
    np.testing.assert_allclose(
        found, [(0.0, 5.4, 7.2), (0.0, 1.8, 2.4), (3.0, 0.0, 0.0)], atol=1e-12
    )


@pytest.mark.parametrize("yaw", [0.0, 1.0])
def test_direction_turns_in_the_body(yaw):
    """The angle to the command decays by the gimbal's lag, in the plane of both, at a constant
    magnitude.
    """
    rotation = pin.rpy.rpyToMatrix(0.2, -0.3, yaw)
    start, goal = rotation @ (0.0, 0.0, 10.0), rotation @ (6.0, 0.0, 8.0)
    found = responses(Thrusters(turning_lag=0.05), [start] + 200 * [goal], rotation=rotation)[1:]
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 10.0, rtol=1e-12)
    angle = np.arccos(np.clip(found @ goal / 100.0, -1.0, 1.0))
    np.testing.assert_allclose(
        angle, math.acos(0.8) * np.exp(-DT / 0.05 * np.arange(1, 201)), atol=1e-6
    )
    np.testing.assert_allclose(found @ np.cross(start, goal), 0.0, atol=1e-9)


def test_thrust_turns_with_the_body():
    """A gimbal that cannot follow at all keeps its direction in body axes."""
    thrusters = thrusters_record(Thrusters(turning_lag=1e3), count=1, variables=3, dt=DT)
    command, turned = np.array((0.0, 0.0, 10.0)), pin.rpy.rpyToMatrix(0.3, 0.0, 0.0)
    for rotation in (LEVEL, turned):
        drive_thrusters(thrusters, rotation, command)
    np.testing.assert_allclose(thrusters["mean_thrust"][0], turned @ command, atol=1e-5)


def test_rotors_lag_and_keep_their_signs():
    """Two free thrusters, then two rotors: each follows by itself."""
    first, then = np.zeros(8), np.array([3.0, 0.0, 4.0, 0.0, 0.0, 2.0, -6.0, 1.0])
    found = responses(Thrusters(lag=0.1), [first] + 50 * [then], count=4)[-1]
    risen = 1.0 - (math.exp(-49 * DT / 0.1) - math.exp(-50 * DT / 0.1)) * 0.1 / DT
    np.testing.assert_allclose(found, risen * then, rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_a_failing_thruster_loses_its_share(share):
    """From its time on, and no other; also a rotor."""
    commands = [(0.0, 0.0, 4.0, 0.0, 3.0, 0.0, 2.0)] * 10
    for index, mine in ((1, slice(3, 6)), (2, slice(6, 7))):
        found = responses(Thrusters(failing=(index, 4 * DT, share)), commands, count=3)
        np.testing.assert_allclose(found[:4], commands[:4], rtol=1e-12)
        left = np.array(commands[4:])
        left[:, mine] *= share
        np.testing.assert_allclose(found[4:], left, rtol=1e-12)


@needs_mujoco
def test_a_thruster_fails_alike_in_both_engines():
    failing = Actuators(thrusters={"failing": (0, 0.5, 0.0)})
    for run in (
        walked(plant=plant, actuators=failing, duration=1.0) for plant in ("compliant", "mujoco")
    ):
        had, asked = (
            np.linalg.norm(run[name][:, 0], axis=1) for name in ("applied_thrust", "thrust")
        )
        assert (had[502:] == 0.0).all()
        assert np.abs(had[1:500] - asked[:499]).max() < 1e-9


def test_a_thruster_that_is_not_there_cannot_fail():
    with pytest.raises(InputError, match="fails"):
        hp.Simulator(ROBOT, actuators=Actuators(thrusters={"failing": (2, 1.0, 0.5)}))


def test_nothing_changes_by_default():
    """Thrusters whose limits are never reached are the ideal ones to rounding, and none in every
    bit.
    """
    ends = []
    for actuators in (None, Actuators(), Actuators(thrusters=Thrusters(largest=1e5))):
        simulator = started(hp.Simulator(ROBOT, hp.Ground(mu_s=0.25), actuators=actuators), GAIT)
        ends.append(simulator.run(hp.make_controller("condensed", GAIT, mu=0.25), 0.5)["q"][-1])
    assert (ends[0] == ends[1]).all()
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-7)
