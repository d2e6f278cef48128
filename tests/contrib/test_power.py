"""Power of thrusters and motors: momentum theory, energy, balance."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.contrib.power import Motors, power
from harpy_pin.errors import InputError
from harpy_pin.log.power import PRESETS, Propulsion

ROBOT = hp.load_harpy()
GAIT = hp.make_gait(ROBOT)


def walk(*, lag=0.0, duration=1.0):
    plant = hp.Simulator(
        ROBOT, hp.Ground(mu_s=0.25), actuators=hp.Actuators(thrusters=hp.Thrusters(lag=lag))
    )
    plant.reset(*GAIT.initial_state(penetration=plant.static_penetration))
    return plant.run(hp.make_controller("condensed", GAIT, mu=0.25), duration)


@needs_robots
def test_a_rotorcraft_that_hovers_takes_the_power_of_its_weight():
    """Four disks that carry the weight: (m g / 4)^(3/2) / √(2 ρ A) each, over figure of merit and
    efficiency.
    """
    robot = hp.load_robot("iris")
    gait = hp.Hovering(robot)
    plant = hp.Simulator(robot)
    plant.reset(*gait.initial_state())
    run = plant.run(hp.make_controller("condensed", gait, mu=0.5), 4.0)
    disk = math.pi * 0.12**2
    fan = Propulsion(thrust=1.0, power=1.0 / math.sqrt(2.0 * 1.225 * disk) / 0.6 / 0.8)
    found = power(run, motors=Motors(constant=1.0), propulsion=fan)
    hover = 4.0 * (robot.mass * 9.81 / 4.0) ** 1.5 / math.sqrt(2.0 * 1.225 * disk) / 0.6 / 0.8
    assert found.battery[-1] == pytest.approx(hover, rel=1e-6)


@pytest.mark.parametrize("name", PRESETS)
def test_presets_give_their_point(name):
    preset = PRESETS[name]
    assert preset.electrical(np.array([0.0, preset.thrust])) == pytest.approx([0.0, preset.power])
    assert preset.electrical(np.array([4.0 * preset.thrust]))[0] == pytest.approx(
        8.0 * preset.power
    )


def test_work_of_joints_is_kinetic_energy():
    """In the air, without gravity and damping, what joints do is what moves."""
    model = ROBOT.model.copy()
    model.damping = np.zeros(12)
    plant = hp.Simulator(replace(ROBOT, model=model), dt=1e-5, gravity=(0.0, 0.0, 0.0))
    q, _ = GAIT.initial_state()
    q[2] += 10.0
    plant.reset(q, np.zeros(12))

    class Swing:
        period = 1e-4

        def step(self, state):
            return hp.Command(0.5 * np.sin(30.0 * state.t + np.arange(6)), np.zeros((2, 3)))

    run = plant.run(Swing(), 0.1, metadata={})
    found = power(run, motors=Motors(constant=0.5))
    moving = pin.computeKineticEnergy(
        ROBOT.model, ROBOT.model.createData(), run["q"][-1], run["v"][-1]
    )
    rate = found.joint_mechanical
    work = float(np.sum(0.5 * (rate[1:] + rate[:-1]))) * 1e-4
    assert moving > 1e-3
    assert work == pytest.approx(moving, rel=5e-3)


@pytest.mark.parametrize("recovered", [0.0, 0.6, 1.0])
def test_battery_is_shaft_and_heat(recovered):
    run = walk()
    motors = Motors(constant=0.6, recovered=recovered)
    found = power(run, motors=motors, propulsion=PRESETS["fan"])
    positive = np.maximum(run["torque"] * run["v"][:, 6:], 0.0).sum(axis=1)
    braking = np.maximum(-run["torque"] * run["v"][:, 6:], 0.0).sum(axis=1)
    copper = (run["torque"] ** 2).sum(axis=1) / 0.36
    fans = 1000.0 * ((np.linalg.norm(run["thrust"], axis=2) / 18.0) ** 1.5).sum(axis=1)
    np.testing.assert_allclose(
        found.battery, fans + positive + copper - recovered * braking, rtol=1e-12
    )
    parts = found.thrust_shaft + found.thrust_heat + found.joint_mechanical + found.joint_heat
    np.testing.assert_allclose(found.battery, parts, rtol=1e-12)
    assert found.watts == pytest.approx(found.energy / (len(run) * 1e-3))
    assert (found.thrust_shaft + found.thrust_heat).mean() == pytest.approx(fans.mean())
    assert found.energy == pytest.approx(found.battery.mean() * len(run) * 1e-3)
    path = np.hypot(*np.diff(run["q"][:, :2], axis=0).T).sum()
    assert found.cost_of_transport == pytest.approx(found.energy / (ROBOT.mass * 9.81 * path))


def test_lagging_thrusters_take_the_power_of_the_thrust_that_they_have():
    run = walk(lag=0.1)
    had = np.linalg.norm(run["applied_thrust"], axis=2)
    asked = np.linalg.norm(run["thrust"], axis=2)
    assert np.abs(had - asked).max() > 1.0
    fans = PRESETS["fan"].electrical(had).sum(axis=1)
    found = power(run, motors=Motors(constant=0.6), propulsion=PRESETS["fan"])
    np.testing.assert_allclose(found.thrust_shaft + found.thrust_heat, fans, rtol=1e-12)
    assert "applied_thrust" not in walk(duration=0.1)


def test_thrust_needs_propulsion():
    with pytest.raises(InputError, match="propulsion"):
        power(walk(duration=0.1), motors=Motors(constant=0.6))
