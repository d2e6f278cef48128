"""Robots of the catalogue stand, shift their weight and take pushes, under the QP and the condensed controller alike.

``--long`` tries all that are required to; otherwise a quadruped and a humanoid, since kernels are compiled for each
size of robot. ``python -m comparison robots`` finds how far each of them can be pushed.
"""

from __future__ import annotations

import numpy as np
import pytest
from long import long_but
from needs import needs_robots

import harpy_pin as hp
from comparison.robots import (
    RobotsSettings,
    friction_used,
    robot_tables,
    run_standing,
    stand_robots,
    stood,
    terms_error,
)
from comparison.tables import to_csv

pytestmark = needs_robots
ALWAYS = ("solo12", "g1")
REQUIRED = (*ALWAYS, "go2", "anymal_b", "talos")


@pytest.mark.parametrize("name", long_but(REQUIRED, ALWAYS))
def test_stands_and_takes_a_push(name):
    """The weight shifted towards a foot, and a push on the base of 0.1 m/s times the mass; both controllers alike."""
    robot = hp.load_robot(name)
    assert terms_error(robot, np.random.default_rng(0), states=3) < 1e-9
    runs = {"shift": {"lean": 0.2}, "push": {"push": (0.06, 0.08, 0.0)}}
    for case, how in runs.items():
        ends = []
        for controller in ("wbc", "condensed"):
            run, _ = run_standing(robot, controller, duration=1.0, **how)
            assert stood(run)
            assert 1e3 * run["slip_path"][-1].mean() < 0.5
            assert friction_used(run, robot) < 0.5
            desired, held = run["desired_force"], run["held"] > 0.0
            outside = np.linalg.norm(desired[held][:, :2], axis=1) - 0.75 * 0.5 * desired[held][:, 2]
            assert outside.max() < 1e-6 * robot.mass
            moved = run["q"][-1, :2] - run["q"][0, :2]
            if case == "shift":
                assert np.linalg.norm(moved - 0.2 * hp.Standing(robot).over(0)[:2]) < 5e-3
            else:
                assert np.abs(run["q"][:, :2] - run["q"][0, :2]).max() > 5e-3  # it was pushed
            ends.append(run["q"][-1])
        np.testing.assert_allclose(ends[0][:7], ends[1][:7], rtol=0, atol=5e-3)


@pytest.mark.parametrize(("speed", "degrees"), [(0.1, 20.0), (0.17, 40.0)])
def test_a_push_askew_does_not_tip_the_soles(speed, degrees):
    """The centre of pressure stays inside the soles, so that they neither rock nor walk away."""
    robot, angle = hp.load_robot("g1"), np.deg2rad(degrees)
    run, _ = run_standing(robot, "condensed", duration=2.0, push=(speed * np.cos(angle), speed * np.sin(angle), 0.0))
    assert stood(run)
    places = run["foot_position"].reshape(len(run), 8, 3)
    assert 1e3 * np.linalg.norm(places[-1, :, :2] - places[0, :, :2], axis=1).max() < 2.0
    assert 1e3 * run["slip_path"][-1].mean() < 1.0
    force = run["desired_force"].reshape(len(run), 2, 4, 3)[..., 2]
    for foot in range(2):
        corners, load = places[0, 4 * foot : 4 * foot + 4, :2], force[:, foot].sum(axis=1)
        pressure = (force[:, foot] @ corners)[load > 0.0] / load[load > 0.0, None]
        inside = np.minimum(pressure - corners.min(axis=0), corners.max(axis=0) - pressure)
        assert len(inside) > 1000
        assert (inside > 0.02 * np.ptp(corners, axis=0)).all()


def test_the_table_says_what_happened():
    settings = RobotsSettings(robots=("solo12", "solo8"), duration=1.0, pushes=(0.1,))
    seen: list[tuple[int, int]] = []
    rows = stand_robots(settings, lambda done, total: seen.append((done, total)))
    assert seen == [(1, 2), (2, 2)]
    standing, times = robot_tables(rows)
    assert standing.number("solo12", "sideways, condensed") == standing.number("solo12", "forward, QP") == 0.1
    assert standing.number("solo12", "mass") == pytest.approx(2.5, abs=0.01)
    refused = standing.get("solo8", "stands, condensed")
    assert refused is not None
    assert "point foot must have 3 joints" in str(refused.value)
    assert times.rows[:2] == ["solo12, QP", "solo12, condensed"]
    assert to_csv([standing, times])
