"""Motors and joint friction: closed forms, energy, complementarity, MuJoCo."""

import math

import numpy as np
import pytest
from needs import needs_mujoco
from walks import started

import harpy_pin as hp
from harpy_pin.simulation.actuators import Actuators, drive_motors, motors_record

ROBOT = hp.load_harpy()
Q, V = hp.make_gait(ROBOT).initial_state()


def floating(
    actuators: Actuators, *, dt: float = 5e-4, v: np.ndarray | None = None
) -> hp.Simulator:
    """The robot high above the ground, without gravity."""
    simulator = hp.Simulator(ROBOT, dt=dt, gravity=(0.0, 0.0, 0.0), actuators=actuators)
    q = Q.copy()
    q[2] += 10.0
    simulator.reset(q, np.zeros(12) if v is None else v)
    return simulator


def command(torque: float | np.ndarray, joint: int | None = None) -> hp.Command:
    """Torques of one joint or of all, no thrust."""
    values = np.zeros(6)
    values[slice(None) if joint is None else joint] = torque
    return hp.Command(values, np.zeros((2, 3)))


@pytest.mark.parametrize("bandwidth", [20.0, 200.0])
def test_step_response_of_a_motor(bandwidth):
    motors = motors_record(Actuators(bandwidth=bandwidth), np.full(6, 8.5))
    drive_motors(motors[0], np.full(6, 1.0), np.zeros(13), np.zeros(12), 5e-4)
    assert (motors["torque"] == 1.0).all()  # settled at the first command
    rate, dt = 2.0 * math.pi * bandwidth, 5e-4
    for n in range(200):
        drive_motors(motors[0], np.full(6, 3.0), np.zeros(13), np.zeros(12), dt)
        end = 3.0 - 2.0 * math.exp(-rate * (n + 1) * dt)
        mean = 3.0 + 2.0 / (rate * dt) * (math.exp(-rate * (n + 1) * dt) - math.exp(-rate * n * dt))
        assert motors["torque"][0] == pytest.approx(end, rel=1e-12)
        assert motors["mean_torque"][0] == pytest.approx(mean, rel=1e-10)


def test_weak_motors_clip_in_the_plant():
    weak, other = floating(Actuators(torque_share=0.1)), floating(Actuators())
    weak.advance(command(5.0), steps=10)
    other.advance(command(0.1 * 8.5), steps=10)
    assert np.array_equal(weak.v, other.v)


def test_viscous_friction_is_more_damping():
    actuators = Actuators(viscous_friction=2.0)
    assert np.allclose(
        np.array(actuators.damped(ROBOT).model.damping)[6:], np.array(ROBOT.model.damping)[6:] + 2.0
    )
    assert Actuators().damped(ROBOT) is ROBOT


def energy(simulator: hp.Simulator) -> float:
    return float(0.5 * simulator.v @ simulator.dynamics.mass_matrix @ simulator.v)


@pytest.mark.parametrize(("viscous", "coulomb"), [(0.0, 0.3), (1.0, 0.0), (0.5, 0.2)])
def test_energy_that_friction_takes(viscous, coulomb):
    """Kinetic energy lost = damping and Coulomb friction times the joints' motion, as the step goes
    to zero.
    """
    v = np.concatenate((np.zeros(6), np.array([2.0, -3.0, 4.0, -1.0, 2.5, -2.0])))
    damping = np.array(ROBOT.model.damping)[6:] + viscous
    errors = []
    for dt in (2e-4, 1e-4):
        simulator = floating(
            Actuators(viscous_friction=viscous, coulomb_friction=coulomb), dt=dt, v=v
        )
        before, lost = energy(simulator), 0.0
        for _ in range(round(0.01 / dt)):
            old = simulator.v[6:].copy()
            simulator.advance(command(0.0))
            mean = 0.5 * (old + simulator.v[6:])
            lost += dt * float(damping @ mean**2 + coulomb * np.abs(mean).sum())
        errors.append(abs(before - energy(simulator) - lost) / lost)
    assert errors[0] < 0.03
    assert errors[1] < 0.6 * errors[0]


def test_friction_and_contact_satisfy_both_conditions():
    """On the ground: every joint is at rest under friction within its limit, or has the whole of it
    against it.
    """
    limit, rng = 0.4, np.random.default_rng(3)
    plant = hp.Simulator(ROBOT, hp.Ground(mu_s=0.3), actuators=Actuators(coulomb_friction=limit))
    simulator = started(plant, hp.make_gait(ROBOT))
    torque = simulator.record["joints"]["torque"][0]
    stuck = 0
    for _ in range(300):
        simulator.advance(
            hp.Command(rng.normal(0.0, 1.5, 6), rng.normal((0.0, 0.0, 9.0), 5.0, (2, 3)))
        )
        speed = simulator.v[6:]
        still = np.abs(speed) < 1e-7
        stuck += int(still.sum())
        assert (np.abs(torque) <= limit).all()
        assert np.allclose(torque[~still], -limit * np.sign(speed[~still]), atol=1e-6)
    assert stuck > 20
    assert simulator.counts[1] == 0


@needs_mujoco
@pytest.mark.parametrize(
    "actuators",
    [
        *(
            Actuators(bandwidth=50.0),
            Actuators(viscous_friction=1.0),
            Actuators(coulomb_friction=0.3),
        ),
        *(
            Actuators(thrusters={"lag": 0.03, "turning_lag": turning_lag})
            for turning_lag in (0.0, 0.05)
        ),
    ],
)
def test_both_engines_agree(actuators):
    """In the air, where contact does not matter, under torques and thrusts that change."""
    from harpy_pin.simulation.mujoco import MujocoPlant

    plants = [kind(ROBOT, actuators=actuators, dt=1e-4) for kind in (hp.Simulator, MujocoPlant)]
    q = Q.copy()
    q[2] += 10.0
    ends = []
    for plant in plants:
        plant.reset(q, np.zeros(12))
        plant.advance(command(0.0))
        for n in range(300):
            torque, up = (
                0.8 * math.sin(40.0 * n * 1e-4 + 1.0),
                40.0 + 20.0 * math.sin(60.0 * n * 1e-4),
            )
            thrust = (
                np.array([(5.0, 0.0, up), (5.0, 1.0, up)])
                if actuators.thrusters
                else np.zeros((2, 3))
            )
            plant.advance(hp.Command(np.full(6, torque), thrust))
        ends.append(plant.v.copy())
    assert np.abs(ends[0][6:]).max() > 0.3
    assert np.allclose(*ends, rtol=0.02, atol=0.02)


def test_torque_falls_with_speed():
    """A motor under full voltage: stall torque at rest, none at the no-load speed, and a brake
    beyond it.
    """
    actuators = Actuators(no_load_speed=20.0, stall_share=0.5)
    v = np.zeros(12)
    v[6:] = [0.0, 5.0, 20.0, 30.0, -5.0, 5.0]
    motors = motors_record(actuators, np.full(6, 8.0))
    drive_motors(motors[0], np.array([9.0, 9.0, 9.0, 9.0, 9.0, -9.0]), np.zeros(13), v, 5e-4)
    np.testing.assert_allclose(motors["mean_torque"][0], [4.0, 3.0, 0.0, -2.0, 5.0, -5.0])
    drive_motors(motors[0], np.full(6, 0.5), np.zeros(13), v, 5e-4)
    np.testing.assert_allclose(motors["mean_torque"][0], [0.5, 0.5, 0.0, -2.0, 0.5, 0.5])


def test_torque_falls_to_nothing_at_the_velocity_limit_of_each_joint():
    fastest = np.array([10.0, 20.0, 10.0, 20.0, np.inf, 10.0])
    actuators = Actuators(no_load_share=0.5, stall_share=2.0)
    v = np.zeros(12)
    v[6:] = [2.5, 2.5, 5.0, 10.0, 1e3, -4.0]
    motors = motors_record(actuators, np.full(6, 8.0), fastest)
    drive_motors(motors[0], np.full(6, 100.0), np.zeros(13), v, 5e-4)
    np.testing.assert_allclose(motors["mean_torque"][0], [8.0, 12.0, 0.0, 0.0, 100.0, 28.8])
    with pytest.raises(hp.InputError, match="say the same"):
        Actuators(no_load_share=0.5, no_load_speed=3.0)
