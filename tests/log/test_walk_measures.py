"""Measures of walks: made-up walks whose numbers are known, and a robot's beside a second way to work them out."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.log.measure_words import WORDS
from harpy_pin.log.run import Run

N, PERIOD = 2000, 1e-3
YAW = 0.7


def made_up(*, feet=2, **changes):
    """A body that goes along its heading, YAW, at 0.5 m/s, and turns at 0.2 rad/s; a joint at 10 N·m and 3 rad/s."""
    t = PERIOD * np.arange(N)
    q, v = np.zeros((N, 8)), np.zeros((N, 7))
    q[:, 0], q[:, 1], q[:, 2] = 0.5 * t * np.cos(YAW), 0.5 * t * np.sin(YAW), 0.3
    q[:, 5], q[:, 6] = np.sin(0.5 * YAW), np.cos(0.5 * YAW)
    v[:, 0], v[:, 5], v[:, 6] = 0.5, 0.2, 3.0
    force = np.zeros((N, feet, 3))
    force[:, :, 2] = 10.0
    heading = np.zeros((N, 3))
    heading[:, 0] = YAW
    signals = {
        "t": t,
        "q": q,
        "v": v,
        "foot_position": np.zeros((N, feet, 3)),
        "foot_velocity": np.zeros((N, feet, 3)),
        "foot_force": force,
        "torque": np.full((N, 1), 10.0),
        "thrust": np.zeros((N, 0, 3)),
        "tick_ns": np.zeros(N),
        "heading": heading,
        "applied_velocity": np.tile([0.4, 0.0, 0.1], (N, 1)),
    }
    metadata = {"mass": 2.0, "control_period": PERIOD, "parameters": {"gait": {"step_duration": 0.2}}}
    return Run(signals | changes.pop("signals", {}), metadata | changes)


def test_known_numbers():
    measures = hp.measure(made_up())
    distance = 0.5 * PERIOD * (N - 1)
    assert measures.cost_of_transport == pytest.approx(30.0 * PERIOD * N / (2.0 * 9.81 * distance))
    assert measures.velocity_rms_m_s == pytest.approx(0.1)
    assert measures.turning_rms_rad_s == pytest.approx(0.1)
    assert math.isnan(measures.pressure_margin_mm)


def test_sway_within_a_step_is_no_error_of_tracking():
    run = made_up()
    run["v"][:, 0] = 0.4 + 0.3 * np.sin(2.0 * np.pi * run["t"] / 0.4)
    assert hp.measure(run).velocity_rms_m_s < 1e-3


def test_negative_power_is_not_given_back():
    run = made_up()
    run["torque"][::2] *= -1.0
    assert hp.measure(run).cost_of_transport == pytest.approx(0.5 * hp.measure(made_up()).cost_of_transport)


@pytest.mark.parametrize("turn", [0.0, 0.9])
def test_margin_of_a_sole(turn):
    """A sole of 200 by 120 mm with its centre of pressure 30 mm ahead and 40 mm to the left of its middle."""
    corners = np.array([(0.1, 0.06, 0.0), (0.1, -0.06, 0.0), (-0.1, 0.06, 0.0), (-0.1, -0.06, 0.0)])
    along, across = 0.5 + 0.03 / 0.2, 0.5 + 0.04 / 0.12
    share = np.array([along * across, along * (1 - across), (1 - along) * across, (1 - along) * (1 - across)])
    position = np.tile(corners @ pin.rpy.rpyToMatrix(0.0, 0.0, turn).T + (3.0, -1.0, 0.0), (N, 1, 1))
    force = np.zeros((N, 4, 3))
    force[:, :, 2] = 19.62 * share
    force[: N // 2] *= 0.1  # too little to count
    force[: N // 2, 0] += (0.0, 0.0, 0.5)
    names = [f"sole_{k}" for k in range(4)]
    signals = {"foot_position": position, "foot_force": force, "foot_velocity": np.zeros((N, 4, 3))}
    run = made_up_with(signals, names)
    assert hp.measure(run).pressure_margin_mm == pytest.approx(20.0, abs=0.15)


def made_up_with(signals, names):
    run = made_up(feet=4, signals=signals)
    run.metadata["feet"] = names
    return run


def test_words_and_units_of_every_measure():
    measures = hp.measure(made_up())
    assert set(measures.as_dict()) == set(WORDS)
    text = str(measures)
    assert "cost of transport" in text
    assert "m/s rms: 0.1" in text
    assert "nan" not in text
    assert "pressure" not in text


@needs_robots
def test_walk_of_a_robot():
    gait = hp.Walking(velocity=(0.5, 0.0, 0.3))
    ground = hp.Ground(mu_s=0.6, stiffness=75e3)
    run = hp.walk(hp.Scenario(robot="go2", gait=gait, ground=ground, duration=3.0))
    measures = hp.measure(run)
    assert measures.velocity_rms_m_s < 0.06
    assert measures.turning_rms_rad_s < 0.1
    power = np.maximum(run["torque"] * run["v"][:, 6:], 0.0).sum()
    path = np.linalg.norm(np.diff(run["q"][:, :2], axis=0), axis=1).sum()
    expected = 1e-3 * power / (9.81 * hp.load_robot("go2").mass * path)
    assert measures.cost_of_transport == pytest.approx(expected, rel=1e-9)
    assert 0.05 < measures.cost_of_transport < 2.0


def test_logs_without_these_signals_are_measured():
    run = made_up(signals={"applied_velocity": np.zeros((N, 7))}, mass="heavy")
    measures = hp.measure(run)
    assert math.isnan(measures.velocity_rms_m_s)
    assert math.isnan(measures.cost_of_transport)
