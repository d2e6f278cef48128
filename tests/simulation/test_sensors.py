"""Noise and delay of what a controller measures."""

import numpy as np
import pinocchio as pin
import pytest
from walks import assert_same, scenario, walked

import harpy_pin as hp
from harpy_pin.simulation.sensors import Noise, Sensors

NOISE = Noise(
    joint_position=1e-3,
    joint_velocity=0.05,
    position=4e-3,
    orientation=3e-3,
    velocity=0.02,
    angular_velocity=0.03,
    foot_force=0.7,
)
DRAWS = 8000


@pytest.fixture(scope="module")
def state(robot, draw_state):
    """A state in motion with feet that carry, as the simulator gives it."""
    simulator = hp.Simulator(robot)
    simulator.reset(*draw_state(np.random.default_rng(3)), t=1.25)
    state = simulator.state
    state.foot_force[:] = [[1.0, -2.0, 30.0], [0.0, 0.0, 0.0]]
    return state


@pytest.fixture(scope="module")
def errors(robot, state):
    """(draws, 30) what was measured less the true value: position, rotation vector, joints, their
    rates, forces.
    """
    sensors = Sensors(robot, NOISE, seed=5)
    upright = pin.Quaternion(state.q[3:7]).matrix()
    rows = []
    for _ in range(DRAWS):
        m = sensors.measure(state)
        assert np.linalg.norm(m.q[3:7]) == pytest.approx(1.0, abs=1e-12)
        turn = pin.log3(upright.T @ pin.Quaternion(m.q[3:7]).matrix())
        force = (m.foot_force - state.foot_force).ravel()
        rows.append(
            np.concatenate(
                (m.q[:3] - state.q[:3], turn, m.q[7:] - state.q[7:], m.v - state.v, force)
            )
        )
    return np.array(rows)


def test_the_noise_has_the_stated_deviations(errors):
    lengths = {
        "position": 3,
        "orientation": 3,
        "joint_position": 6,
        "velocity": 3,
        "angular_velocity": 3,
    }
    lengths |= {"joint_velocity": 6, "foot_force": 6}
    stated = np.repeat([getattr(NOISE, name) for name in lengths], [*lengths.values()])
    # Of n draws, the estimate of a deviation is off by 1/sqrt(2 n), that of a mean by 1/sqrt(n):
    # five times that.
    np.testing.assert_allclose(errors.std(axis=0), stated, rtol=5.0 / np.sqrt(2 * DRAWS))
    np.testing.assert_array_less(np.abs(errors.mean(axis=0)), 5.0 * stated / np.sqrt(DRAWS))


def test_the_noise_is_white(errors):
    """Neither the components at one tick nor those of two ticks in a row have to do with each
    other.
    """
    n = errors.shape[1]
    both = np.corrcoef(np.hstack((errors[:-1], errors[1:])).T)
    np.testing.assert_array_less(np.abs(both - np.eye(2 * n)), 5.5 / np.sqrt(DRAWS))


def test_feet_follow_from_what_was_measured(robot, state):
    sensors = Sensors(robot, NOISE)
    data = robot.model.createData()
    for _ in range(50):
        m = sensors.measure(state)
        pin.forwardKinematics(robot.model, data, m.q, m.v)
        pin.updateFramePlacements(robot.model, data)
        for k, foot in enumerate(robot.feet):
            frame = robot.frame_id(foot)
            velocity = pin.getFrameVelocity(
                robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED
            ).linear
            np.testing.assert_allclose(m.foot_position[k], data.oMf[frame].translation, atol=1e-12)
            np.testing.assert_allclose(m.foot_velocity[k], velocity, atol=1e-11)
            assert np.abs(m.foot_position[k] - state.foot_position[k]).max() > 1e-6


class RecordingController:
    """Keeps the states that a controller is given."""

    def __init__(self, gait):
        self.inner = hp.make_controller("governed", gait, mu=0.8, governor="none")
        self.seen = []

    def step(self, state):
        self.seen.append(state.copy())
        return self.inner.step(state)


def recorded_walk(**disturbances):
    built = hp.build(
        scenario(mu_s=0.8, duration=0.03, **disturbances), controller=RecordingController
    )
    true_states = []
    run = built.run(on_tick=lambda state: true_states.append(state.copy()))
    return run, true_states, built.controller.seen


@pytest.mark.parametrize("ticks", [1, 2, 7])
def test_a_delay_is_exact(ticks):
    """The whole state of so many ticks ago, with the present time; at first the oldest."""
    run, true_states, seen = recorded_walk(delay=ticks * 1e-3)
    assert len(run) == len(seen) == 30
    for k in range(30):
        old = true_states[max(k - ticks, 0)]
        assert seen[k].t == run["t"][k]
        for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"):
            np.testing.assert_array_equal(getattr(seen[k], name), getattr(old, name))
    assert not np.array_equal(true_states[-1].q, seen[-1].q)


def test_noise_and_delay_act_together():
    """The delayed measurement is the one that would have been made then."""
    now, late = (Sensors(hp.load_harpy(), NOISE, delay=delay, seed=2) for delay in (0, 3))
    _, true_states, _ = recorded_walk()
    at_once = [now.measure(state) for state in true_states]
    for k, state in enumerate(true_states):
        delayed = late.measure(state)
        np.testing.assert_array_equal(delayed.q, at_once[max(k - 3, 0)].q)
        np.testing.assert_array_equal(delayed.foot_force, at_once[max(k - 3, 0)].foot_force)
        assert delayed.t == state.t


def test_the_log_keeps_the_true_states():
    run, true_states, seen = recorded_walk(noise=NOISE)
    np.testing.assert_array_equal(run["q"], [state.q for state in true_states])
    np.testing.assert_array_equal(
        run["foot_position"], [state.foot_position for state in true_states]
    )
    difference = np.array([state.q for state in seen])[:, 7:] - run["q"][:, 7:]
    assert difference.std() == pytest.approx(NOISE.joint_position, rel=0.2)


def test_perfect_sensors_change_nothing(robot):
    plain, built = walked(mu_s=0.8, duration=0.3), hp.build(scenario(mu_s=0.8, duration=0.3))
    assert built.sensors is None
    measured = built.simulator.run(built.controller, 0.3, sensors=Sensors(robot))
    assert_same(measured, plain)


def test_the_seed_decides_the_noise(robot, state):
    first, same, other = (Sensors(robot, NOISE, seed=seed) for seed in (1, 1, 2))
    a, b, c = (sensors.measure(state).q for sensors in (first, same, other))
    np.testing.assert_array_equal(a, b)
    assert np.all(a != c)
    assert np.all(first.measure(state).q != a)
    first.reset()
    np.testing.assert_array_equal(first.measure(state).q, a)


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("noise", [Noise(), NOISE])
def test_what_is_given_is_not_the_simulators(robot, state, noise, delay):
    """A controller that writes into what it is given changes neither the true state nor its next
    measurement.
    """
    sensors, before = Sensors(robot, noise, delay=delay), state.copy()
    first = sensors.measure(state)
    expected = first.copy()
    for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"):
        getattr(first, name)[:] = np.nan
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))
    if delay == 1:
        np.testing.assert_array_equal(sensors.measure(state).q, expected.q)


def test_typical_noise_is_scaled():
    assert not Noise.typical(0.0)
    assert Noise.typical(0.5).position == 0.5 * Noise.typical().position > 0.0
    assert Noise.typical(2.0).foot_force == 1.0
