"""A quadruped with closed loops in its legs."""

import numpy as np
import pytest
from looped_robots import quadruped

import harpy_pin as hp
from harpy_pin.contrib.preview import Preview
from harpy_pin.contrib.preview.pace import Stride
from harpy_pin.model.posed import Posed


def test_a_quadruped_with_linkages_in_its_knees_trots(tmp_path):
    """Its stride is followed through closed loops."""
    robot = quadruped(tmp_path)
    gait = hp.PlannedGait(robot, Preview(robot, (0.4, 0.0, 0.0)))
    run = hp.walk(hp.Scenario(ground=hp.Ground(mu_s=0.6), duration=3.0), gait=gait)
    assert run.ending == "completed"
    assert run["q"][-1, 0] == pytest.approx(1.2, abs=0.15)


def test_a_slow_stride_asks_of_motors_what_holds_the_robot(tmp_path):
    """At no speed they bear the weight, by the gradient of the potential energy."""
    robot = quadruped(tmp_path)
    q, _ = hp.Standing(robot).initial_state()
    stride = Stride(robot, q, leg=0.56, clearance=0.04)
    pace = stride.pace(0.0, 1e3, 1.0)
    posed, share = Posed(robot, q), 0.25 * robot.mass * 9.81
    torque = posed.holding.copy()
    for foot in robot.feet:
        torque[6:] -= share * posed.jacobian(foot)[2, 6:]
    assert pace.torque == pytest.approx(np.abs(torque[6:] / robot.torque_limit).max(), rel=0.01)
