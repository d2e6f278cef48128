"""Stepping in place: footholds beside the inverted pendulum in closed form, targets beside their differences, Bolt."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from long import long_but
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.gaits.stepping import cycle_offset, predict_capture_point


@pytest.fixture(scope="module")
def bolt() -> hp.Robot:
    return hp.load_robot("bolt")


def pendulum(centre, velocity, foot, omega, t):
    """Closed-form solution of c̈ = ω² (c − p)."""
    cosh, sinh = np.cosh(omega * t), np.sinh(omega * t)
    return (foot + (centre - foot) * cosh + velocity / omega * sinh, omega * (centre - foot) * sinh + velocity * cosh)


def test_footholds_bring_any_pendulum_into_the_cycle_in_one_step():
    rng = np.random.default_rng(0)
    for _ in range(20):
        omega, duration, width = rng.uniform(3.0, 8.0), rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3)
        step = rng.uniform(-0.1, 0.1, 2)
        centre, velocity = rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.5, 0.5, 2)  # as a push may leave them
        foot, side, feet = np.zeros(2), 1.0, []
        for n in range(12):
            end, fast = pendulum(centre, velocity, foot, omega, duration)
            for share in (0.0, 0.3, 0.9):
                c, v = pendulum(centre, velocity, foot, omega, share * duration)
                told = [
                    predict_capture_point(c[i] + v[i] / omega, foot[i], omega, (1 - share) * duration) for i in (0, 1)
                ]
                np.testing.assert_allclose(told, end + fast / omega, rtol=0, atol=1e-10)
            side = -side
            foot = np.array(told) - cycle_offset(side, *step, width, np.exp(omega * duration))
            feet.append(foot)
            if n > 0:  # the first foothold takes in where the pendulum was, the others are the cycle's
                np.testing.assert_allclose(foot - feet[-2], step + np.array([0.0, side * width]), rtol=0, atol=1e-7)
            centre, velocity = end, fast
        assert np.abs(centre - foot).max() < 1.0  # and so it never falls


@needs_robots
def test_targets_fit_their_differences(bolt):
    """A state that stays while time goes on: the foothold runs away, and the foot follows without a jump."""
    gait = hp.Stepping(bolt)
    q, v = gait.initial_state()
    v[:2] = 0.05, -0.1
    model, data = bolt.model, bolt.model.createData()
    pin.framesForwardKinematics(model, data, q)
    feet = np.array([data.oMf[bolt.frame_id(name)].translation for name in bolt.feet])
    feet[:, 2] = 1e-3
    state, h = hp.State(0.0, q, v, feet, np.zeros((2, 3)), np.zeros((2, 3))), 1e-5
    places, speeds, changes = [], [], []
    for t in np.arange(0.0, 0.2, h):
        gait.observe(state)
        o = gait.update(t)
        places.append(o.body[:3] + o.foot_position[1])
        speeds.append(o.body[3:6] + o.foot_velocity[1])
        changes.append(o.body[6:] + o.foot_acceleration[1])
        np.testing.assert_allclose(o.body[:3] + o.foot_position[0], feet[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(places[0], feet[1], rtol=0, atol=1e-15)
    rise = int(0.149 / h)  # until then the step goes on; after it the foot goes down at one velocity
    for whole, rate in ((places, speeds), (speeds, changes)):
        middle = 0.5 * (np.array(rate[: rise - 1]) + rate[1:rise])
        np.testing.assert_allclose(np.diff(whole[:rise], axis=0) / h, middle, rtol=0, atol=2e-3)
    assert abs(max(z for _, _, z in places) - 0.03) < 2e-3
    np.testing.assert_allclose(places[-1][:2], gait.telemetry()["foothold"], rtol=0, atol=1e-12)
    assert places[-1][2] < -5e-3
    centre = np.array(pin.centerOfMass(model, data, q, v))
    np.testing.assert_allclose(
        o.body[6:8], 9.81 / pin.centerOfMass(model, data, gait.initial_state()[0])[2] * (centre - feet[0])[:2]
    )


@needs_robots
@pytest.mark.parametrize("controller", long_but(("condensed", "wbc"), ("condensed",)))
def test_bolt_steps_in_place_and_takes_a_push(bolt, controller):
    for push in ((0.0, 0.0), (0.0, 0.1), (0.1, 0.0)):
        gait = hp.Stepping(bolt)
        scenario = hp.Scenario(
            controller={"name": controller, "parameters": gait.parameters},
            ground=hp.Ground(mu_s=0.5, stiffness=bolt.mass * 9.81 / 2e-3),
            disturbances=hp.Disturbances(
                pushes=(hp.Push(0.5, (bolt.mass * push[0], bolt.mass * push[1], 0.0)),) if any(push) else ()
            ),
            duration=5.0,
        )
        run = hp.walk(scenario, gait=gait)
        assert run.ending == "completed"
        assert hp.measure(run).tilt_max_rad < 0.05
        stance = run["stance"]
        assert (stance.sum(axis=1) == 1.0).all()
        assert 25 <= np.count_nonzero(np.diff(stance[:, 0])) <= 40
        assert np.abs(run["q"][:, :2]).max() < 0.15
        assert np.abs(run["q"][:, 2] - gait.initial_state()[0][2]).max() < 5e-3
        high = run["foot_position"][:, :, 2].max(axis=0)
        assert ((high > 0.025) & (high < 0.045)).all()
        desired = run["desired_force"][run["held"] > 0.0]
        assert (np.linalg.norm(desired[:, :2], axis=1) - 0.75 * 0.5 * desired[:, 2]).max() < 1e-6


@needs_robots
def test_it_begins_anew_and_does_not_hear_bad_samples(bolt):
    gait, state = hp.Stepping(bolt), None
    with pytest.raises(hp.InputError, match="observe"):
        gait.update(0.0)
    q, v = gait.initial_state()
    feet = np.array([[0.0, 0.03, 1e-3], [0.0, -0.03, 1e-3]])
    state = hp.State(0.0, q, v, feet, np.zeros((2, 3)), np.zeros((2, 3)))
    gait.observe(state)
    gait.update(0.0)
    for t in (0.05, 0.1):
        first = gait.update(t).record.copy()
    bad = state.copy()
    bad.q[0] = np.nan
    gait.observe(bad)
    np.testing.assert_allclose(gait.update(0.1).foot_position, first["foot_position"][0], rtol=0, atol=1e-12)
    gait.update(0.0)
    for t in (0.05, 0.1):
        gait.update(t)
    np.testing.assert_array_equal(gait.target.record, first)
    landed = state.copy()
    landed.foot_force[1, 2] = 5.0
    gait.observe(landed)
    assert gait.update(0.101).stance.tolist() == [0.0, 1.0]
    with pytest.raises(hp.InputError, match="finite"):
        gait.update(np.inf)


@needs_robots
def test_other_robots_and_values_are_refused(bolt):
    with pytest.raises(hp.InputError, match="two point feet"):
        hp.Stepping(hp.load_robot("solo12"))
    with pytest.raises(hp.InputError, match="two point feet"):
        hp.Stepping(hp.load_robot("g1"))
    swapped = hp.load_robot(bolt.urdf, feet=bolt.feet[::-1])
    with pytest.raises(hp.InputError, match="left foot"):
        hp.Stepping(swapped, bolt.posture)
    for bad in ({"step_duration": 0.0}, {"width": -0.1}, {"clearance": 0.0}, {"feet_apart": 1.0}, {"reach": 0.0}):
        with pytest.raises(hp.InputError):
            hp.Stepping(bolt, **bad)
