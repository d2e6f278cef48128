"""What a stride asks of the motors, beside closed forms and a walk."""

from functools import cache

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.contrib.preview import Preview
from harpy_pin.contrib.preview.pace import MOST, SAMPLES, Stride

pytestmark = needs_robots


@cache
def preview(name):
    return Preview(hp.load_robot(name))


def stride_of(name):
    robot = hp.load_robot(name)
    q, _ = hp.Standing(robot).initial_state()
    return Stride(robot, q, leg=0.42, clearance=0.03)


def test_foot_lands_and_leaves_with_the_ground():
    """Its way is closed, and its velocity that of the ground where it lands and where it leaves."""
    stride = stride_of("go2")
    way = stride.way(2.0, 0.12, 0.2)
    assert way[0, 0] == pytest.approx(0.12)
    assert way[SAMPLES, 0] == pytest.approx(-0.12)
    np.testing.assert_allclose(np.diff(way[:SAMPLES, 0]), -2.0 * 0.12 / SAMPLES)
    assert 0.0299 < way[:, 2].max() <= 0.03  # highest between two samples
    step, span = 0.2 / SAMPLES, 0.94 * 0.2  # it is above its foothold before it lands
    fine, s = np.diff(way[SAMPLES:, 0]) / step, step / span
    begun = 2.0 * 0.32 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # of a quintic
    assert fine[0] == pytest.approx(-2.0 + begun / step)
    assert 1.0 < fine.max() < 1.875 * 2.0 * 0.32 / span - 2.0 + 0.1  # at its middle


def test_standing_torques_are_those_of_the_weight():
    """At no speed a leg holds a quarter of the weight, and more the less time it stands."""
    stride = stride_of("go2")
    usual, brief = stride.pace(0.0, 0.2, 0.2), stride.pace(0.0, 0.1, 0.2)
    robot = stride.robot
    dynamics = hp.Dynamics(robot)
    dynamics.update(stride.q, np.zeros(robot.model.nv))
    jacobian = dynamics.foot_jacobian.reshape(4, 3, -1)[:, 2, 6:]
    bias = dynamics.bias[6:]
    for pace, times in ((usual, 2.0), (brief, 3.0)):
        load = times * 0.25 * robot.mass * 9.81
        held = np.abs(bias - load * jacobian.sum(axis=0)) / robot.torque_limit
        assert pace.torque >= held.max() - 1e-6
    assert brief.torque > 1.2 * usual.torque


def test_paces_ask_for_more_the_faster_it_goes():
    for name in ("go2", "anymal_c"):
        paces = preview(name).paces
        loads = [pace.load for pace in paces]
        assert loads[0] < 0.8
        assert loads[-1] > loads[0]
        for pace in paces:
            assert pace.stance * pace.speed < 0.4 if name == "go2" else 0.6


def test_bound_is_where_the_stride_asks_for_too_much():
    planner = preview("anymal_c")
    speeds = [pace.speed for pace in planner.paces]
    loads = np.maximum.accumulate([pace.load for pace in planner.paces])
    assert np.interp(planner.max_speed, speeds, loads) == pytest.approx(MOST)
    assert 1.5 < planner.max_speed < 2.5
    assert preview("go2").max_speed > 3.0  # whose motors are faster
