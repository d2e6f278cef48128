"""A fan that loses power in the air is found, made up for, and the robot lands; healthy ones are
left alone.
"""

import numpy as np
import pytest
from walks import walked

import harpy_pin as hp
from harpy_pin.contrib.flight import Fly, Flying, Jump
from harpy_pin.contrib.flight.flying_gait import PHASES
from harpy_pin.contrib.thrusters import ThrustWatch


class Weak:
    """A controller whose left thruster gives a share of its command from a time on."""

    def __init__(self, inner, since, share):
        self.inner, self.since, self.share, self.period = inner, since, share, inner.period
        self.telemetry = inner.telemetry

    def step(self, state):
        command = self.inner.step(state)
        thrust = command.thrust.copy()
        if state.t >= self.since:
            thrust[0] *= self.share
        return hp.Command(command.torque.copy(), thrust)


def flown(share, *, flight, since, duration):
    """A flight with noise."""

    def make(gait):
        return Weak(
            ThrustWatch(hp.make_controller("condensed", gait, mu=0.6), gait.robot), since, share
        )

    gait = Flying(flights=flight, start=0.1)
    return walked(make=make, gait=gait, mu_s=0.6, duration=duration, noise=hp.Noise.typical())


def test_a_weak_fan_is_found_and_made_up_for():
    share = 0.5
    run = flown(share, flight=Fly(hover=1.0), since=2.5, duration=5.5)
    t, land = run["t"].ravel(), np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("land"))
    assert run.ending == "completed"
    before, after = (run["thrust_effectiveness"][np.searchsorted(t, time)] for time in (2.49, 4.0))
    assert before == pytest.approx((1.0, 1.0), abs=0.03)
    assert after == pytest.approx((share, 1.0), abs=0.03)
    air = np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("air"))
    away = np.linalg.norm(run["q"][air, :3] - run["body_plan"][air], axis=1)
    assert away.max() < 0.03
    assert away[t[air] > 4.0].max() < 0.01
    assert np.linalg.norm(run["foot_force"][land], axis=2).sum(axis=1).max() < 2.0 * 4.02 * 9.81
    assert 2.0 * np.hypot(run["q"][-1, 3], run["q"][-1, 4]) < 0.02


def test_healthy_fans_are_left_alone_in_a_jump():
    run = flown(1.0, flight=Jump(height=0.31, forward=0.3), since=0.0, duration=2.8)
    assert run.ending == "completed"
    assert np.abs(run["thrust_effectiveness"] - 1.0).max() < 0.1


def test_commands_stay_within_the_thrusters_limit(robot):
    built = hp.build(hp.Scenario(duration=0.1))
    watch = ThrustWatch(built.controller, robot)
    watch.effectiveness[:] = 0.2
    built.controller.step(built.simulator.state)
    for _ in range(3):
        command = watch.step(built.simulator.state)
        assert np.linalg.norm(command.thrust, axis=1).max() <= robot.thrust_limit + 1e-9
    watch.reset()
    assert watch.effectiveness.tolist() == [1.0, 1.0]


def test_a_robot_without_thrusters_is_refused():
    built = hp.build(hp.Scenario(duration=0.1))
    with pytest.raises(hp.InputError, match="no free thrusters"):
        ThrustWatch(built.controller, hp.load_robot("solo12"))
