"""A battery behind thrusters and motors: circuit, energy, and the thrust that it leaves; lags of
second order.
"""

import math

import numpy as np
import pytest
from needs import PLANTS
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from walks import scenario

import harpy_pin as hp
from harpy_pin.contrib.battery import Battery
from harpy_pin.contrib.power import Motors, power
from harpy_pin.contrib.thrusters import SecondOrderThrusters
from harpy_pin.errors import InputError
from harpy_pin.log import Propulsion

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)
FAN = Propulsion(thrust=18.0, power=1000.0, efficiency=0.8)


def open_voltage(cells, charge):
    """Of Chen and Rincón-Mora."""
    polynomial = 3.685 + 0.2156 * charge - 0.1178 * charge**2 + 0.3201 * charge**3
    return cells * (polynomial - 1.031 * math.exp(-35.0 * charge))


def aloft(thrusters, *parts, v=0.0, joint=0):
    """A robot in the air."""
    plant = hp.Simulator(
        ROBOT, actuators=hp.Actuators(thrusters=thrusters), gravity=(0.0, 0.0, 0.0)
    )
    for part in parts:
        plant.attach(part)
    q, speed = GAIT.initial_state()[0], np.zeros(12)
    q[2] += 100.0
    speed[6 + joint] = v
    plant.reset(q, speed)
    return plant


def hover(battery, *, command=10.0, largest=40.0, seconds=0.5):
    """Two fans that push upwards in the air, joints without torque; the plant afterwards."""
    plant = aloft(hp.Thrusters(largest=largest), battery)
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

    exact = (
        solve_ivp(rate, (0.0, 0.5), [charge], rtol=1e-10, atol=1e-12).y[0, -1]
        if charge > 0.1
        else None
    )
    hover(battery)
    record = battery.record
    if exact is not None:
        assert record["charge"][0] == pytest.approx(exact, abs=1e-6)
        drawn = (record["energy"][0][3] + record["energy"][0][4]) / 0.5
        assert drawn == pytest.approx(power, rel=1e-6)
    else:
        assert record["charge"][0] <= 0.0


def test_largest_thrust_is_that_of_the_voltage():
    """Under a command that no battery gives, thrust and voltage settle where both equations
    hold.
    """
    battery = Battery(cells=6, capacity=50.0, resistance=0.04, charge=0.4, propulsion=FAN)
    plant = hover(battery, command=60.0, largest=30.0)
    thrust = plant.record["thrusters"]["mean_thrust"][0, 2]

    def excess(voltage):
        power = 2.0 * 1000.0 * (30.0 * (voltage / open_voltage(6, 1.0)) ** 2 / 18.0) ** 1.5
        return (open_voltage(6, 0.4) - voltage) / 0.04 * voltage - power

    settled = brentq(excess, 0.6 * open_voltage(6, 0.4), open_voltage(6, 0.4))
    assert thrust == pytest.approx(30.0 * (settled / open_voltage(6, 1.0)) ** 2, rel=1e-3)


def test_empty_battery_has_no_thrust():
    battery = Battery(capacity=0.01, propulsion=FAN)
    plant = hover(battery, seconds=2.0)
    assert battery.record["voltage"][0] == 0.0
    assert np.abs(plant.record["thrusters"]["mean_thrust"]).max() == 0.0


@pytest.mark.parametrize("plant", PLANTS)
def test_energy_of_a_walk(plant):
    """Chemical energy is shafts and heat; each part is what torques, speeds and thrusts of the log
    say.
    """
    fans = hp.Actuators(thrusters=hp.Thrusters(largest=53.0))
    made = hp.build(scenario(plant=plant, actuators=fans, duration=1.0))
    battery = Battery(capacity=2.0, resistance=0.01, propulsion=FAN, motors=Motors(constant=0.6))
    made.simulator.attach(battery)
    run = made.run()
    energy, charges = run["battery_energy"], run["battery_charge"]
    chemical, missing, inner, shaft, heat, joints, copper = energy[-1]
    assert missing == pytest.approx(0.0, abs=1e-6)
    assert chemical == pytest.approx(inner + shaft + heat + joints + copper, rel=1e-9)
    logged = power(run, motors=Motors(constant=0.6), propulsion=FAN)
    # The log has the speeds at the beginning of each tick, the battery those of each step.
    assert shaft == pytest.approx(
        0.8 * (logged.thrust_shaft + logged.thrust_heat).sum() * 1e-3, rel=0.01
    )
    assert heat / shaft == pytest.approx(0.25, rel=1e-9)
    assert joints + copper == pytest.approx(
        (logged.joint_mechanical + logged.joint_heat).sum() * 1e-3, rel=0.03
    )
    middle = [open_voltage(6, s) for s in 0.5 * (charges[1:] + charges[:-1])]
    assert chemical - energy[0, 0] == pytest.approx(
        -7200.0 * np.sum(middle * np.diff(charges)), rel=1e-6
    )


def test_joints_that_brake_charge_it():
    """Torques against the speed give back the work that the joint does, less the heat of the
    winding.
    """
    battery = Battery(propulsion=FAN, motors=Motors(constant=10.0, recovered=1.0))
    plant = aloft(hp.Thrusters(largest=40.0), battery, v=5.0, joint=5)
    torque = np.zeros(6)
    torque[5] = -0.1
    before = plant.q[12]
    plant.advance(hp.Command(torque, np.zeros((2, 3))))
    energy = battery.record["energy"][0]
    assert energy[5] == pytest.approx(-0.1 * (plant.q[12] - before), rel=1e-9)
    assert energy[6] == pytest.approx((0.1 / 10.0) ** 2 * plant.dt)
    assert energy[0] < 0.0


def test_runs_repeat_after_a_reset():
    battery = Battery(capacity=0.05, propulsion=FAN)
    plant = hover(battery)
    first = battery.record.copy()
    plant.reset(*GAIT.initial_state())
    assert battery.record["charge"][0] == 1.0
    hover(battery)
    assert battery.record == first


def test_battery_needs_the_largest_thrust():
    with pytest.raises(InputError, match="largest"):
        hp.Simulator(ROBOT).attach(Battery())


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5])
def test_second_order_is_the_differential_equation(ratio):
    """Magnitudes after a step of the command, against an integration of the lag; their mean is its
    integral.
    """
    plant = aloft(SecondOrderThrusters(lag=0.02, damping_ratio=ratio))
    up = np.array([(0.0, 0.0, 1.0)] * 2)
    plant.advance(hp.Command(np.zeros(6), 3.0 * up))
    record, impulse, steps = plant.record["thrusters"], 0.0, 60
    for _ in range(steps):
        plant.advance(hp.Command(np.zeros(6), 8.0 * up))
        impulse += np.linalg.norm(record["mean_thrust"][0, :3]) * plant.dt

    def rate(_, x):
        return [x[1], (8.0 - x[0]) / 0.02**2 - 2.0 * ratio * x[1] / 0.02, x[0]]

    exact = solve_ivp(rate, (0.0, steps * plant.dt), [3.0, 0.0, 0.0], rtol=1e-10, atol=1e-12).y[
        :, -1
    ]
    np.testing.assert_allclose(record["level"][0, 0], exact[:2], rtol=1e-6, atol=1e-6)
    assert impulse == pytest.approx(exact[2], rel=1e-6)
