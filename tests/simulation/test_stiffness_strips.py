"""Strips of ground with another stiffness: depth at rest, damping, and walks over them, in both plants."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin import Command, Ground, InputError, Scenario, Simulator
from harpy_pin.simulation.mujoco import MujocoPlant

G = 9.81
SOFT = Ground(mu_s=0.5, stiffness_strips=((0.5, 1.0, 2000.0), (1.0, 2.0, 32000.0)))
NOTHING = Command(np.zeros(0), np.zeros((0, 3)))


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
@pytest.mark.parametrize(("x", "stiffness"), [(0.0, 8000.0), (0.7, 2000.0), (1.0, 32000.0), (2.0, 8000.0)])
def test_it_rests_as_deep_as_the_place_is_soft(sled, kind, x, stiffness):
    assert float(SOFT.stiffness_at(x)) == stiffness
    plant = kind(sled, SOFT)
    q = pin.neutral(sled.model)
    q[0] = x
    plant.reset(q, np.zeros(6))
    plant.advance(NOTHING, steps=2000)
    assert -plant.q[2] == pytest.approx(sled.mass * G / stiffness, rel=1e-3)


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_a_strip_is_a_ground_of_its_stiffness(sled, kind):
    """A mass that drops onto it moves as on a ground with that stiffness, whose damping has the usual ratio."""
    paths = []
    for ground in (SOFT, Ground(mu_s=0.5, stiffness=2000.0)):
        plant = kind(sled, ground)
        q = pin.neutral(sled.model)
        q[0], q[2] = 0.7, 0.02
        plant.reset(q, np.zeros(6))
        path = []
        for _ in range(400):
            plant.advance(NOTHING)
            path.append(plant.q[2])
        paths.append(path)
    np.testing.assert_allclose(*paths, atol=1e-9)
    assert min(paths[0]) < -sled.mass * G / 2000.0


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_harpy_walks_over_a_strip_of_half_the_stiffness(plant):
    ground = Ground(mu_s=0.8, stiffness_strips=((0.1, 0.35, 4000.0),))
    run = hp.walk(Scenario(ground=ground, plant=plant, duration=2.5))
    assert run.ending == "completed"
    x, depth, force = run["foot_position"][..., 0], -run["foot_position"][..., 2], run["foot_force"][..., 2]
    still = (np.abs(run["foot_velocity"][..., 2]) < 5e-3) & (force > 10.0)
    for on, stiffness in (((x > 0.1) & (x < 0.35), 4000.0), (x > 0.35, 8000.0)):
        assert (still & on).sum() > 50
        assert np.median(force[still & on] / depth[still & on]) == pytest.approx(stiffness, rel=0.1)


def test_a_scenario_keeps_them():
    scenario = Scenario(ground=SOFT)
    assert Scenario.from_dict(scenario.to_dict()).ground == SOFT


@pytest.mark.parametrize("strips", [((0.0, 1.0, 0.0),), ((1.0, 0.0, 10.0),), ((0.0, 1.0),), 3])
def test_what_is_no_strip_is_refused(strips):
    with pytest.raises(InputError, match=r"strip"):
        Ground(stiffness_strips=strips)
