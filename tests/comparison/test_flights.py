"""The study of flights in small."""

from __future__ import annotations

import numpy as np
import pytest

import harpy_pin as hp
from comparison.flights import FLIGHTS, FlightSettings, HalfAFan, flight_tables, fly
from harpy_pin.log.power import PRESETS


def test_a_small_study():
    rows = fly(FlightSettings.quick())
    assert [row["flight"] for row in rows] == ["hop", "jump 0.4 m", "walk"]
    hop, jump, walk = rows
    assert all(row["stands"] for row in rows)
    assert jump["distance_m"] == pytest.approx(0.42, abs=0.03)
    assert jump["place_mm"] == pytest.approx(1e3 * abs(jump["distance_m"] - 0.42), abs=5.0)
    assert 1.0 < jump["peak"] <= 2.0
    assert jump["cost"] == pytest.approx(jump["energy_j"] / (4.02 * 9.81 * 0.42))
    assert hop["cost"] is None
    assert jump["cost"] > walk["cost"] > 0.0
    (table,) = flight_tables(rows)
    assert [cell.value for cell in table.cells if cell.column == "stands"] == ["1 of 1"] * 3


def test_hovering_costs_what_the_closed_form_says():
    """Two fans that carry half the weight each, at 1 kW for 18 N and as the thrust to the power 3/2."""
    run = hp.walk(hp.Scenario(gait=hp.Flying(flights=hp.Fly(hover=1.0)), duration=4.6, ground=hp.Ground(mu_s=0.6)))
    thrust = np.linalg.norm(run["thrust"][3700:3900], axis=2)
    watts = PRESETS["fan"].electrical(thrust).sum(axis=1).mean()
    assert watts == pytest.approx(2.0 * 1000.0 * (0.5 * 4.02 * 9.81 / 18.0) ** 1.5, rel=0.02)


def test_half_a_fan_gives_half():
    class Still:
        period = 1e-3
        telemetry = describe = reset = dict

        def step(self, state):
            return hp.Command(np.zeros(6), np.ones((2, 3)))

    state = hp.build(hp.Scenario(duration=0.1)).simulator.state
    half = HalfAFan(Still(), 1.0)
    assert half.step(state).thrust.tolist() == [[1.0] * 3] * 2
    state.t = 2.0
    assert half.step(state).thrust.tolist() == [[0.5] * 3, [1.0] * 3]


def test_names_are_checked():
    assert "hop" in FLIGHTS
    with pytest.raises(hp.InputError, match="flight"):
        FlightSettings(names=("loop",))
