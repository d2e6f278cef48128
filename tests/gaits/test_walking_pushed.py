"""Walking robots on soles that are pushed."""

from __future__ import annotations

import numpy as np
import pytest
from long import long_but
from needs import needs_robots

import harpy_pin as hp

pytestmark = needs_robots

SIDES = [45 * k for k in range(8)]


@pytest.mark.parametrize("degrees", long_but(SIDES, (90,)))
def test_a_push_from_any_side_does_not_fell_g1_in_mujoco(degrees):
    pytest.importorskip("mujoco")
    robot, angle = hp.load_robot("g1"), np.deg2rad(degrees)
    gait = hp.WalkingGait(robot, velocity=((0.3, 0.2, 0.0, 0.0),))
    impulse = 0.15 * robot.mass * np.array((np.cos(angle), np.sin(angle), 0.0))
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters=gait.parameters),
        ground=hp.Ground(mu_s=0.5, stiffness=robot.mass * 9.81 / 2e-3),
        disturbances=hp.Disturbances(pushes=(hp.Push(2.2, tuple(impulse)),)),
        duration=6.0,
        plant="mujoco",
    )
    run = hp.walk(scenario, gait=gait)
    assert run.ending == "completed"
    assert run["centre"][-1, 2] > 0.9 * run["centre"][0, 2]
