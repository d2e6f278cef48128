"""Ways through the air against closed forms, and the balance there against Pinocchio's own
dynamics.
"""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.contrib.flight.airway import SWIFT, Balance, Fall, Quintic, lacking_wrenches, rest
from harpy_pin.contrib.flight.flyer import Flyer
from harpy_pin.model.state import GRAVITY


@given(
    height=st.floats(0.3, 1.0),
    speed=st.floats(0.8, 4.0),
    brake=st.floats(1.0, 8.0),
    carried=st.floats(0.0, 0.9),
    below=st.floats(-0.5, 0.02),
)
def test_a_fall_conserves_energy_and_ends_at_the_touchdowns_speed(
    height, speed, brake, carried, below
):
    """v² = 2 g h in free fall, v² = 2 b h while it is braked."""
    g = (1.0 - carried) * GRAVITY
    fall = Fall(height, speed, height + below, 0.1, brake, g)
    apex = height + speed**2 / (2.0 * g)
    for t in np.linspace(0.0, fall.free, 7):
        z, v, a = fall.at(float(t))
        assert v**2 == pytest.approx(2.0 * g * (apex - z), abs=1e-9)
        assert a == -g or t == fall.free
    z, v, _ = fall.at(fall.free + fall.braked)
    assert z == pytest.approx(height + below, abs=1e-9)
    assert v == pytest.approx(-0.1, abs=1e-9)
    assert fall.at(fall.free + fall.braked + 1.0)[0] == pytest.approx(z - 0.1)


@settings(max_examples=12, deadline=None)
@given(
    height=st.floats(0.5, 1.0),
    speed=st.floats(0.8, 3.0),
    brake=st.floats(3.0, 8.0),
    carried=st.floats(0.0, 0.9),
    lag=st.floats(0.01, 0.15),
)
def test_a_fall_with_lag_is_that_of_a_thrust_switched_on_and_off(
    height, speed, brake, carried, lag
):
    """The thrust's acceleration follows by ȧ = (goal − a) / T, integrated here in small steps."""
    g = (1.0 - carried) * GRAVITY
    fall = Fall(height, speed, height - 0.1, 0.1, brake, g, lag)
    z, v, a, t, step = height, speed, -g, 0.0, 1e-4
    end = fall.free + fall.braked + 12.0 * lag
    while t < end:
        goal = (
            -g
            if t + 0.5 * step < fall.free
            else brake
            if t + 0.5 * step < fall.free + fall.braked
            else 0.0
        )
        old, a = a, goal + (a - goal) * np.exp(-step / lag)
        z, v, t = z + step * (v + 0.25 * step * (old + a)), v + 0.5 * step * (old + a), t + step
        if round(t / step) % 500 == 0:
            assert fall.at(t)[:2] == pytest.approx((z, v), abs=3e-3)
            assert fall.at(t)[2] == pytest.approx(
                a, abs=0.1
            )  # the steps' own error when the goal changes
    assert v == pytest.approx(-0.1, abs=2e-3)
    assert z == pytest.approx(height - 0.1 - 0.1 * 12.0 * lag, abs=5e-3)


@given(
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.floats(0.1, 3.0),
)
def test_a_quintic_goes_through_both_states(start, end, duration):
    way = Quintic(np.array(start)[:, None], np.array(end)[:, None], duration)
    assert way.at(0.0)[:, 0] == pytest.approx(start, abs=1e-6)
    assert way.at(duration)[:, 0] == pytest.approx(end, abs=1e-6)
    step = 1e-5
    middle = 0.4 * duration
    slope = (way.at(middle + step)[0] - way.at(middle - step)[0]) / (2.0 * step)
    assert way.at(middle)[1] == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_the_largest_acceleration_from_rest_to_rest():
    way = Quintic(rest(np.zeros(1)), rest(np.ones(1)), 1.0)
    assert max(abs(way.at(t)[2, 0]) for t in np.linspace(0.0, 1.0, 2001)) == pytest.approx(
        SWIFT, rel=1e-4
    )


@pytest.fixture(scope="module")
def flyer() -> Flyer:
    robot = hp.load_harpy()
    return Flyer(robot, hp.make_commanded_gait(robot).initial_state()[0])


def test_in_the_air_the_centre_of_mass_hangs_below_the_thrusters(flyer):
    """Two forces on a line have no moment about it: what hangs on it must have its weight below
    it.
    """
    centre = pin.centerOfMass(flyer.robot.model, flyer.robot.model.createData(), flyer.air)
    assert centre[:2] == pytest.approx((0.0, 0.0), abs=1e-5)
    assert centre[2] < 0.0


def test_two_thrusters_lack_the_moment_about_the_line_between_them(flyer):
    flyer.balance.dynamics.update(flyer.air, np.zeros(12))
    lacking = lacking_wrenches(flyer.balance.dynamics)
    assert np.abs(lacking[:, 0]) == pytest.approx((0, 0, 0, 0, 1, 0), abs=1e-9)


def test_accelerations_are_those_that_thrusts_and_torques_can_give(flyer):
    """By Pinocchio's inverse dynamics the body needs no moment that the thrusters have not."""
    rng = np.random.default_rng(3)
    model = flyer.robot.model
    for _ in range(10):
        q = pin.integrate(model, flyer.air, 0.3 * rng.standard_normal(12))
        v, a = rng.standard_normal(12), 5.0 * rng.standard_normal(12)
        found = flyer.balance.reachable(q, v, a)
        force = pin.rnea(model, model.createData(), q, v, found) + model.damping * v
        assert lacking_wrenches(flyer.balance.dynamics).T @ force[:6] == pytest.approx(
            0.0, abs=1e-9
        )
        assert np.abs(flyer.balance.reachable(q, v, found) - found).max() < 1e-9


@pytest.mark.parametrize("weight", [0.5, 1.0, 1.6])
def test_the_feedback_brings_the_robot_back(flyer, weight):
    """From 5 cm, 0.1 rad and swinging legs, by the equations of motion with the thrust's share of
    gravity.
    """
    robot, balance = flyer.robot, Balance(flyer.robot, flyer.air, weight=weight)
    model = robot.model.copy()
    model.gravity.linear = np.array((0.0, 0.0, -weight * GRAVITY))
    v = np.zeros(12)
    v[6:] = 0.5
    q = pin.integrate(model, flyer.air, np.array([0.05, -0.05, 0.05, 0.1, 0.1, 0.1, *np.zeros(6)]))
    data, dt = model.createData(), 2e-3
    for _ in range(3000):
        a = balance.gain @ np.concatenate((pin.difference(model, flyer.air, q), v))
        flyer.balance.dynamics.update(q, v)
        lacking = lacking_wrenches(flyer.balance.dynamics)
        force = pin.rnea(model, data, q, v, a)
        force[:6] -= lacking @ (lacking.T @ force[:6])
        v = v + dt * pin.aba(model, data, q, v, force)
        q = pin.integrate(model, q, dt * v)
    assert np.abs(pin.difference(model, flyer.air, q)).max() < 5e-3
    assert np.abs(v).max() < 0.02
