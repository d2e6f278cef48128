"""The Gymnasium environments: the checker's rules, the simulator's physics, and a vector that is n
single ones.
"""

import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

import harpy_pin as hp  # noqa: E402
from harpy_pin.contrib.gym import HarpyEnv, HarpyVectorEnv  # noqa: E402
from harpy_pin.contrib.shield import Shield  # noqa: E402

SHORT = hp.Scenario(
    gait=hp.Straight(speed=0.3), duration=0.4, period=5e-3, dt=1e-3, ground=hp.Ground(mu_s=0.4)
)


@pytest.mark.parametrize("shield", [False, True])
def test_checker_has_nothing_to_say(shield):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make("Harpy-v0", shield=shield).unwrapped)


def test_name_is_known_to_gymnasium():
    one = gymnasium.make("harpy_pin.contrib.gym:Harpy-v0", scenario=SHORT)
    many = gymnasium.make_vec(
        "Harpy-v0", num_envs=3, vectorization_mode="vector_entry_point", scenario=SHORT
    )
    assert isinstance(one.unwrapped, HarpyEnv)
    assert isinstance(many.unwrapped, HarpyVectorEnv)
    assert many.reset(seed=0)[0].shape == (3, 39)
    many.close()
    code = "import sys, harpy_pin.contrib.gym; assert 'pinocchio' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)


@pytest.mark.parametrize("shield", [False, True])
def test_vector_is_n_single_environments(shield, monkeypatch):
    """Through falls, resets and the end of episodes, on two threads."""
    monkeypatch.setattr("harpy_pin.contrib.threads.SMALL", 1)
    pushed = hp.Disturbances(pushes=(hp.Push(0.1, (0.0, 2.0, 0.0)),))
    scenario, n = replace(SHORT, gait=hp.Straight(speed=0.2), duration=0.6, disturbances=pushed), 5
    ours = HarpyVectorEnv(n, scenario, shield=shield, threads=2)
    singles = SyncVectorEnv(
        [lambda: HarpyEnv(scenario, shield=shield)] * n,
        autoreset_mode=AutoresetMode.NEXT_STEP,
        copy=True,
    )
    assert ours.single_action_space == singles.single_action_space
    assert ours.observation_space == singles.observation_space
    assert len(ours.batch._threads.cuts) == 3
    rng, ends = np.random.default_rng(0), np.zeros(2)
    for seed in (3, None):
        np.testing.assert_array_equal(ours.reset(seed=seed)[0], singles.reset(seed=seed)[0])
        for tick in range(260):
            wild = np.where(np.arange(n) < 2, 1.0, 0.2)[:, None]
            action = (wild * rng.uniform(-1.0, 1.0, 12)).astype(np.float32)
            mine, theirs = ours.step(action), singles.step(action)
            for value, expected in zip(mine[:4], theirs[:4], strict=True):
                np.testing.assert_allclose(value, expected, rtol=0, atol=1e-10, err_msg=str(tick))
                assert value.dtype == expected.dtype
            ends += mine[2].sum(), mine[3].sum()
    assert ends.min() >= 4
    ours.close()


class Springs:
    """What an action means, by the documentation, as a controller of the library: without a shield,
    joint targets.
    """

    period = 1e-3

    def __init__(self, robot, posture, mu=None):
        self.robot, self.posture, self.action = robot, posture, np.zeros(12)
        self.shield = None if mu is None else Shield(robot, mu=mu)

    def step(self, state):
        rotation = pin.Quaternion(state.q[3:7]).matrix()
        target, limit = self.posture + 0.5 * self.action[:6], self.robot.torque_limit
        thrust = 0.5 * 9.81 * self.robot.mass * self.action[6:].reshape(2, 3) @ rotation.T
        if self.shield is None:
            return hp.Command(np.zeros(6), thrust, q=target, v=np.zeros(6), k_p=400.0, k_d=3.0)
        torque = 400.0 * (target - state.q[7:]) - 3.0 * state.v[6:]
        return self.shield(state, hp.Command(np.clip(torque, -limit, limit), thrust))[0]


@pytest.mark.parametrize("mu", [None, 0.4], ids=["plain", "shield"])
def test_physics_observation_and_reward_are_what_is_documented(mu):
    env, rng = HarpyEnv(SHORT, shield=mu is not None), np.random.default_rng(1)
    observation, _ = env.reset(seed=5)
    robot, start = env.batch.robot, env.state
    plant = hp.Simulator(robot, SHORT.ground, dt=1e-3)
    straight = hp.make_gait(robot, speed=0.0, stiffness=SHORT.stiffness)
    q, _ = straight.initial_state(penetration=plant.static_penetration)
    posture, weight = q[7:], 9.81 * robot.mass
    assert np.abs(start.q[7:] - posture).max() < 0.05 < 1.0 < np.abs(observation).max() + 1.0
    plant.reset(start.q, start.v)
    springs = Springs(robot, posture, mu)
    for _ in range(60):
        action = 0.4 * rng.uniform(-1.0, 1.0, 12).astype(np.float32)
        observation, reward, terminated, truncated, _ = env.step(action)
        springs.action = np.asarray(action, dtype=float)
        for _ in range(5):
            plant.advance(springs.step(plant.state))
        state = plant.state
        np.testing.assert_allclose(env.state.q, state.q, rtol=0, atol=1e-9)
        np.testing.assert_allclose(env.state.v, state.v, rtol=0, atol=1e-7)
        np.testing.assert_allclose(env.state.foot_force, state.foot_force, rtol=0, atol=1e-6)
        rotation = pin.Quaternion(state.q[3:7]).matrix()
        velocity = rotation @ state.v[:3]
        expected = np.concatenate(
            (
                [(state.q[2] - q[2]) / 0.1],
                rotation[2],
                rotation[:2, 0],
                state.v[:3],
                state.v[3:6] / 3.0,
                (state.q[7:] - posture) / 0.5,
                state.v[6:] / 10.0,
                state.foot_force[:, 2] / weight,
                action,
                [0.3],
            )
        )
        np.testing.assert_allclose(
            observation, np.clip(expected, -10.0, 10.0), rtol=1e-5, atol=1e-5
        )
        effort = np.sum((0.5 * springs.action[6:]) ** 2)
        speed = (velocity[0] - 0.3) ** 2 + velocity[1] ** 2
        assert reward == pytest.approx(np.exp(-speed / 0.25**2) - 0.1 * effort, abs=1e-6)
        assert (terminated, truncated) == (False, False)


def test_episodes_end_as_they_should():
    env = HarpyEnv(SHORT)
    env.reset(seed=0)
    ends = [env.step(np.zeros(12, np.float32))[2:4] for _ in range(80)]
    assert ends[:-1] == [(False, False)] * 79
    assert ends[-1] == (False, True)
    env.reset()
    limp = np.zeros(12, np.float32)
    limp[[8, 11]] = -1.0  # thrust downward
    limp[[1, 4]] = 1.0
    height, steps, over = env.state.q[2], 0, (False, False)
    while not any(over):
        over = env.step(limp)[2:4]
        steps += 1
    assert over == (True, False)
    assert steps < 80
    tilt = pin.Quaternion(env.state.q[3:7]).matrix()[2, 2]
    assert env.state.q[2] < 0.6 * height or tilt < 0.5


def test_what_does_not_fit_is_refused():
    noisy, late = hp.Disturbances(noise=hp.Noise.typical()), hp.Disturbances(delay=5e-3)
    slope = hp.Ground(slope=0.1)
    given = (
        {"disturbances": noisy},
        {"disturbances": late},
        {"plant": "mujoco"},
        {"ground": slope},
        {"state": "estimated"},
    )
    for more in given:
        with pytest.raises(
            hp.InputError,
            match="own plant, without sensors, noise, delay or actuators, on flat ground",
        ):
            HarpyEnv(hp.Scenario(period=5e-3, dt=1e-3, **more))
    with pytest.raises(hp.InputError, match="num_envs must be"):
        HarpyVectorEnv(0)
    env, many = HarpyEnv(SHORT), HarpyVectorEnv(2, SHORT)
    for action in (np.zeros(11), np.full(12, np.nan)):
        with pytest.raises(hp.InputError, match="action"):
            env.step(action)
    with pytest.raises(hp.InputError, match="action"):
        many.step(np.zeros((3, 12)))
    with pytest.raises(hp.InputError, match="2 worlds need as many seeds"):
        many.reset(seed=[1, 2, 3])
