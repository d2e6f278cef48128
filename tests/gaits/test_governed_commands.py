"""The commanded gait behind its governor: what is held back, given back, and promised whatever the gaps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from commands import CONTROLLERS, ROBOT, P, scripts, settings_of
from hypothesis import given, settings
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin import CommandedGait
from harpy_pin.gaits import FootholdGovernorParameters, GovernedGait
from harpy_pin.model.kinematics import leg_inverse


def upset(gait, rng, size=40.0):
    """Tell a governed gait a gap of any size and direction, now and then none."""
    if rng.random() < 0.8:
        gait.gap[:3], gait.gap[3] = size * rng.standard_normal() * rng.standard_normal(3), 1.0


@given(scripts, st.integers(0, 10**6))
@settings(max_examples=5)
def test_a_governed_command_keeps_what_the_gait_promises(script, seed):
    """Whatever the gaps: between zero and the command, continuous, feet that stay, and in the legs' reach."""
    rng, h = np.random.default_rng(seed), 1e-3
    bent = GovernedGait(CommandedGait(ROBOT, script))
    most = FootholdGovernorParameters()
    least = 1.0 / (1.0 + most.response * most.recovery * most.heard)
    angles, before, velocity = np.empty(3), None, np.zeros(3)
    for t in np.arange(0.0, script[-1][0] + 2.0, h):
        target = bent.update(float(t))
        upset(bent, rng)
        assert least - 1e-12 <= 1.0 - bent.held_back <= 1.0
        assert abs(bent.shift) <= most.shift_limit
        applied = np.array(bent.gait.applied)
        assert np.linalg.norm(applied[:2] - velocity[:2]) <= P.acceleration * h + 1e-12
        assert abs(applied[2] - velocity[2]) <= P.turn_acceleration * h + 1e-12
        velocity = applied
        feet = target.body[:3] + target.foot_position
        if before is not None:
            kept = (target.stance > 0.0) & (before[1] > 0.0)
            np.testing.assert_allclose((feet - before[0])[kept, :2], 0.0, atol=1e-12)
            assert np.abs(feet - before[0])[:, :2].max() < 6.0 * h
        before = feet, target.stance.copy()
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, float(target.heading[0]))
        for k, geometry in enumerate(bent.gait.geometry):
            assert leg_inverse(geometry.record[0], turned.T @ target.foot_position[k], angles) <= 1e-12
            joints = slice(3 * k, 3 * k + 3)
            assert np.all((angles >= ROBOT.joint_lower[joints]) & (angles <= ROBOT.joint_upper[joints]))


def test_a_tolerated_gap_leaves_the_commanded_gait_as_it_is():
    script = [(0.1, 0.4, 0.0, 0.5), (1.3, -0.2, 0.1, -1.0), (2.9, 0.0, 0.0, 0.0)]
    gait, bent = CommandedGait(ROBOT, script), GovernedGait(CommandedGait(ROBOT, script))
    rng = np.random.default_rng(0)
    for t in np.arange(0.0, 5.0, 1e-3):
        assert bent.update(float(t)).record == gait.update(float(t)).record
        direction = rng.standard_normal(3)
        bent.gap[:3], bent.gap[3] = 3.99 * direction / np.linalg.norm(direction), 1.0


def test_a_share_of_the_whole_command_is_held_back_and_given_back():
    bent = GovernedGait(CommandedGait(ROBOT, [(0.0, 0.3, 0.1, 0.2)]))
    for i in range(4000):
        bent.update(1e-3 * i)
        bent.gap[:] = (0.0, 0.0, 14.0, 1.0)
    np.testing.assert_allclose(bent.gait.applied, (1.0 - bent.held_back) * np.array((0.3, 0.1, 0.2)), atol=1e-3)
    assert bent.held_back > 0.5
    np.testing.assert_array_equal(bent.gait.command, (0.3, 0.1, 0.2))
    for i in range(4000, 20000):
        bent.update(1e-3 * i)
        bent.gap[:] = (0.0, 0.0, 1.0, 1.0)
    np.testing.assert_allclose(bent.gait.applied, (0.3, 0.1, 0.2), atol=1e-3)
    bent.update(0.0)
    assert bent.held_back == 0.0


def test_footholds_shift_along_the_heading():
    """Turned to the left by a quarter, a body that lacks acceleration to the left places its feet further left."""
    bent, gait = (GovernedGait(CommandedGait(ROBOT, [(0.0, 0.0, 0.0, np.pi / 4), (2.0, 0.1, 0.0, 0.0)])) for _ in "ab")
    for i in range(8000):
        for one in (bent, gait):
            one.update(1e-3 * i)
        bent.gap[:] = (0.0, 4.5, 0.0, float(i > 4000))
    assert bent.shift == pytest.approx(0.5 * 0.02 * 4.0, rel=0.15)
    feet = [one.target.body[:2] + one.target.foot_position[:, :2] for one in (bent, gait)]
    ahead = (feet[0] - feet[1]) @ (np.cos(bent.target.heading[0]), np.sin(bent.target.heading[0]))
    lag = (bent.target.body[:2] - gait.target.body[:2]) @ (
        np.cos(bent.target.heading[0]),
        np.sin(bent.target.heading[0]),
    )
    np.testing.assert_allclose(ahead - lag, bent.shift, atol=0.015)


@CONTROLLERS
def test_a_command_too_fast_for_the_ground_is_bent_and_logged(controller):
    rows = ((0.2, 3.0, 0.0, 0.0), (2.0, -3.0, 2.0, 1.0), (3.5, 0.0, 0.0, 20.0))
    run = hp.walk(
        hp.Scenario(
            controller={"name": controller, "parameters": {"govern_command": True, **settings_of(controller)}},
            gait=hp.Commanded(velocity=rows),
            ground=hp.Ground(mu_s=0.06),
            duration=5.0,
        )
    )
    assert run.ending == "completed"
    np.testing.assert_array_equal(run["command"][1000], rows[0][1:])
    assert 0.0 < run["held_back"].max() < 1.0
    assert hp.measure(run).slip_mm_per_step < 2.0
