"""The study of flights in small."""

from __future__ import annotations

import numpy as np
import pytest

import harpy_pin as hp
from comparison.flight_tables import flight_tables
from comparison.flights import FLIGHTS, FlightSettings, flown, fly
from harpy_pin.log.power import PRESETS


def test_a_small_study():
    rows = fly(FlightSettings.quick())
    assert [row["flight"] for row in rows] == ["walk", "hop", "jump 0.4 m"]
    walk, hop, jump = rows
    assert all(row["stands"] for row in rows)
    assert jump["distance_m"] == pytest.approx(0.42, abs=0.03)
    assert jump["place_mm"] == pytest.approx(1e3 * abs(jump["distance_m"] - 0.42), abs=5.0)
    assert 1.0 < jump["peak"] <= 2.0
    assert jump["cost"] == pytest.approx(jump["energy_j"] / (4.02 * 9.81 * 0.42))
    assert walk["power_w"] == pytest.approx(walk["energy_j"] / 6.0)
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


def test_without_thrust_it_falls():
    run, measures = flown("walk without thrust")
    assert not run["applied_thrust"].any()
    assert not measures["stands"]
    assert "cost" not in measures


@pytest.mark.parametrize("name", list(FLIGHTS))
def test_every_try_is_as_its_row_says(name):
    one = FLIGHTS[name]
    scenario = one.scenario("wbc", "mujoco", 7)
    fans = scenario.disturbances.actuators.thrusters
    lag = next((k for k in (30, 100, 300) if f"{k} ms" in name), 0)
    assert fans.lag == one.lag == pytest.approx(1e-3 * lag)
    assert scenario.controller.parameters.get("thrust_lag", 0.0) == (one.lag if "known" in name else 0.0)
    assert (fans.failing is not None) == ("half" in name)
    assert (scenario.plant.name, scenario.disturbances.seed) == ("mujoco", 7)
    slope = next((k for k in (10, 15, 20) if f"{k}°" in name), 0) * (-1 if "down" in name else 1)
    terrain = scenario.ground.terrain
    rise = 0.0 if terrain is None else float(np.diff(terrain.height(np.array([2.0, 2.1]), np.zeros(2)))[0])
    assert np.degrees(np.arctan(rise / 0.1)) == pytest.approx(slope, abs=1e-6)


def test_names_are_checked():
    assert "hop" in FLIGHTS
    with pytest.raises(hp.InputError, match="flight"):
        FlightSettings(names=("loop",))
