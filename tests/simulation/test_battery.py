"""A battery behind thrusters and motors: circuit, energy, and the thrust that it leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import harpy_pin as hp
from harpy_pin.errors import InputError
from harpy_pin.simulation.battery import Battery
from harpy_pin.simulation.mujoco import installed_version

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)
FAN = {"thrust": 18.0, "power": 1000.0, "efficiency": 0.8}
PLANTS = ["compliant", pytest.param("mujoco", marks=pytest.mark.skipif(installed_version() is None, reason="MuJoCo"))]
ALOFT = np.array([0.0, 0.0, 100.0])


def open_voltage(cells, charge):
    """Of Chen and Rincón-Mora."""
    polynomial = 3.685 + 0.2156 * charge - 0.1178 * charge**2 + 0.3201 * charge**3
    return cells * (polynomial - 1.031 * math.exp(-35.0 * charge))


def hover(battery, *, command=10.0, largest=40.0, seconds=0.5, **thrusters):
    """Two fans that push upwards in the air, joints without torque; the plant afterwards."""
    fans = hp.Thrusters(largest=largest, **thrusters)
    plant = hp.Simulator(ROBOT, actuators=hp.Actuators(thrusters=fans, battery=battery))
    q, v = GAIT.initial_state()
    q[:3] = ALOFT
    plant.reset(q, v)
    push = hp.Command(np.zeros(6), np.array([(0.0, 0.0, command)] * 2))
    for _ in range(round(seconds / plant.dt / 100)):
        plant.advance(push, steps=100)
    return plant


@pytest.mark.parametrize("charge", [1.0, 0.5, 0.02])
def test_charge_follows_the_circuit(charge):
    """Against an integration of the circuit, whose current is the root of P = (U₀ − R I) I."""
    battery = Battery(cells=4, capacity=0.5, resistance=0.05, charge=charge, propulsion=FAN)
    power = 2.0 * 1000.0 * (10.0 / 18.0) ** 1.5

    def rate(_, s):
        voltage = open_voltage(4, s[0])
        current = brentq(lambda i: (voltage - 0.05 * i) * i - power, 0.0, voltage / 0.1, xtol=1e-12)
        return [-current / (3600.0 * 0.5)]

    exact = solve_ivp(rate, (0.0, 0.5), [charge], rtol=1e-10, atol=1e-12).y[0, -1] if charge > 0.1 else None
    record = hover(battery).step_record["battery"]
    if exact is not None:
        assert record["charge"][0] == pytest.approx(exact, abs=1e-6)
        drawn = (record["energy"][0][3] + record["energy"][0][4]) / 0.5
        assert drawn == pytest.approx(power, rel=1e-6)
    else:
        assert record["charge"][0] <= 0.0


def test_largest_thrust_is_that_of_the_voltage():
    """Under a command that no battery gives, thrust and voltage settle where both equations hold."""
    battery = Battery(cells=6, capacity=50.0, resistance=0.04, charge=0.4, propulsion=FAN)
    plant = hover(battery, command=60.0, largest=30.0)
    thrust = plant.step_record["thrusters"]["mean_thrust"][0, 2]

    def excess(voltage):
        power = 2.0 * 1000.0 * (30.0 * (voltage / open_voltage(6, 1.0)) ** 2 / 18.0) ** 1.5
        return (open_voltage(6, 0.4) - voltage) / 0.04 * voltage - power

    settled = brentq(excess, 0.6 * open_voltage(6, 0.4), open_voltage(6, 0.4))
    assert thrust == pytest.approx(30.0 * (settled / open_voltage(6, 1.0)) ** 2, rel=1e-3)


def test_empty_battery_has_no_thrust():
    plant = hover(Battery(capacity=0.01, propulsion=FAN), seconds=2.0)
    assert plant.step_record["battery"]["voltage"][0] == 0.0
    assert np.abs(plant.step_record["thrusters"]["mean_thrust"]).max() == 0.0


@pytest.mark.parametrize("plant", PLANTS)
def test_energy_of_a_walk(plant):
    """Chemical energy is shafts and heat; each part is what torques, speeds and thrusts of the log say."""
    battery = Battery(cells=6, capacity=2.0, resistance=0.01, propulsion=FAN, motors={"constant": 0.6})
    fans = hp.Actuators(thrusters=hp.Thrusters(largest=53.0), battery=battery)
    scenario = hp.Scenario(
        plant={"name": plant}, ground=hp.Ground(mu_s=0.25), disturbances=hp.Disturbances(actuators=fans), duration=2.0
    )
    run = hp.walk(scenario)
    energy = run["battery_energy"]
    chemical, missing, inner, shaft, heat, joints, copper = energy[-1]
    assert missing == pytest.approx(0.0, abs=1e-6)
    assert chemical == pytest.approx(inner + shaft + heat + joints + copper, rel=1e-9)
    told = hp.log.power(run, motors=hp.log.Motors(constant=0.6), propulsion=hp.log.Propulsion(**FAN))
    # The log has the speeds at the beginning of each tick, the battery those of each step.
    assert shaft == pytest.approx(0.8 * (told.thrust_shaft + told.thrust_heat).sum() * 1e-3, rel=0.01)
    assert heat / shaft == pytest.approx(0.25, rel=1e-9)
    assert joints + copper == pytest.approx((told.joint_mechanical + told.joint_heat).sum() * 1e-3, rel=0.03)
    capacity = 3600.0 * 2.0
    charges = run["battery_charge"]
    middle = [open_voltage(6, s) for s in 0.5 * (charges[1:] + charges[:-1])]
    assert energy[-1, 0] - energy[0, 0] == pytest.approx(-capacity * np.sum(middle * np.diff(charges)), rel=1e-6)


def test_joints_that_brake_charge_it():
    """Torques against the speed give back the share that is recovered, less the heat of the winding."""
    battery = Battery(propulsion=FAN, motors={"constant": 10.0, "recovered": 1.0})
    plant = hp.Simulator(ROBOT, actuators=hp.Actuators(thrusters={"largest": 40.0}, battery=battery), gravity=(0, 0, 0))
    q, v = GAIT.initial_state()
    q[:3] = ALOFT
    v = np.zeros(12)
    v[11] = 5.0
    plant.reset(q, v)
    torque = np.zeros(6)
    torque[5] = -0.1
    plant.advance(hp.Command(torque, np.zeros((2, 3))))
    energy = plant.step_record["battery"]["energy"][0]
    assert energy[5] == pytest.approx(-0.5 * plant.dt)
    assert energy[6] == pytest.approx((0.1 / 10.0) ** 2 * plant.dt)
    assert energy[0] < 0.0


def test_runs_repeat_after_a_reset():
    battery = Battery(capacity=0.05, propulsion=FAN)
    plant = hover(battery)
    first = plant.step_record["battery"].copy()
    q, v = GAIT.initial_state()
    q[:3] = ALOFT
    plant.reset(q, v)
    assert plant.step_record["battery"]["charge"][0] == 1.0
    for _ in range(10):
        plant.advance(hp.Command(np.zeros(6), np.array([(0.0, 0.0, 10.0)] * 2)), steps=100)
    assert plant.step_record["battery"] == first


@pytest.mark.parametrize(
    "values",
    [
        {"cells": 0},
        {"capacity": 0.0},
        {"resistance": -1.0},
        {"charge": 1.1},
        {"propulsion": {"thrust": 0.0, "power": 1.0}},
        {"propulsion": {"thrusts": 1.0}},
        {"motors": 3.0},
    ],
)
def test_bad_batteries_are_refused(values):
    with pytest.raises(InputError):
        Battery(**values)


def test_battery_needs_the_largest_thrust():
    with pytest.raises(InputError, match="largest"):
        hp.Actuators(battery={})


def test_scenario_has_it():
    actuators = {"thrusters": {"largest": 40.0}, "battery": {"cells": 4, "motors": {"constant": 0.5}}}
    scenario = hp.Scenario(disturbances=hp.Disturbances(actuators=actuators))
    assert scenario.disturbances.actuators.battery.motors.constant == 0.5
    assert hp.Scenario.from_dict(scenario.to_dict()) == scenario
