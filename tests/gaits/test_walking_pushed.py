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
    """Nor do steps to the side launch it: a body in free fall has no force below it."""
    pytest.importorskip("mujoco")
    robot, angle = hp.load_robot("g1"), np.deg2rad(degrees)
    gait = hp.WalkingGait(robot, velocity=((0.3, 0.2, 0.0, 0.0),))
    impulse = 0.15 * robot.mass * np.array((np.cos(angle), np.sin(angle), 0.0))
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters=gait.parameters),
        ground=hp.Ground(mu_s=0.5, stiffness=robot.mass * 9.81 / 2e-3),
        disturbances=hp.Disturbances(pushes=(hp.Push(2.0, tuple(impulse)),)),
        duration=4.5,
        plant="mujoco",
    )
    run = hp.walk(scenario, gait=gait)
    assert run.ending == "completed"
    assert hp.measure(run).tilt_max_rad < 0.2
    carried = run["foot_force"].reshape(len(run), -1, 3)[:, :, 2].sum(axis=1)
    assert np.mean(carried < 0.1 * robot.mass * 9.81) < 0.02
