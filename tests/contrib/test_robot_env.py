"""The environment of any robot: the checker's rules, the simulator's physics, and rewards by name
or by a function.
"""

import warnings

import numpy as np
import pinocchio as pin
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from needs import needs_robots  # noqa: E402
from walks import scenario  # noqa: E402

import harpy_pin as hp  # noqa: E402
from harpy_pin.contrib.gym import RobotEnv  # noqa: E402
from harpy_pin.contrib.gym.rewards import TERMS  # noqa: E402

pytestmark = needs_robots


@pytest.mark.parametrize("action", ["velocity", "joints"])
def test_checker_has_nothing_to_say(action):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(
            gymnasium.make("harpy_pin.contrib.gym:Robot-v0", robot="go2", action=action).unwrapped
        )


def test_velocity_actions_drive_the_robot():
    """Where the action is the velocity that is asked for, the robot moves so, and both rewards are
    almost one.
    """
    env = RobotEnv("go2", velocity=(0.5, 0.0, 0.3), reward={"velocity": 1.0, "turning": 1.0})
    env.reset(seed=0)
    top = hp.WalkingGait(env.robot).max_speed
    action = np.array([0.5 / top, 0.0, 0.3], dtype=np.float32)
    for _ in range(100):
        observation, reward, terminated, truncated, info = env.step(action)
        assert (terminated, truncated) == (False, False)
    assert reward > 1.8
    assert reward == pytest.approx(sum(info["reward"].values()))
    np.testing.assert_allclose(observation[-3:], [0.5, 0.0, 0.3], rtol=1e-6)
    np.testing.assert_allclose(observation[-6:-3], action)


@pytest.mark.parametrize("action", ["velocity", "joints"])
def test_it_stands_on_terrain(action):
    """On a slope, heights are above the ground, where its feet are; it walks up there."""
    terrain = hp.ground.Plane(slope=0.15, above=2.0)
    ground = hp.Ground(mu_s=0.8, stiffness=75e3, terrain=terrain)
    env = RobotEnv(
        "go2",
        action=action,
        velocity=(0.3, 0.0, 0.0),
        scenario=hp.Scenario(ground=ground, duration=2.0),
    )
    observation, _ = env.reset(seed=0)
    assert abs(observation[0]) < 0.5
    place = env.state.foot_position
    depth = terrain.height(place[:, 0].copy(), place[:, 1].copy()) - place[:, 2]
    assert depth.max() == pytest.approx(env.simulator.static_penetration, abs=1e-3)
    top = float(env.gait.max_speed)
    act = np.zeros(env.action_space.shape, dtype=np.float32)
    if action == "velocity":
        act[0] = 0.3 / top
    for _ in range(60):
        observation, _, terminated, _, _ = env.step(act)
        assert not terminated
    assert abs(observation[0]) < 0.5
    if action == "velocity":
        assert env.state.q[0] > 0.2


def test_observation_is_what_is_documented():
    env = RobotEnv("go2", action="joints")
    env.reset(seed=3, options={"velocity": (0.2, -0.1, 0.4)})
    rng = np.random.default_rng(0)
    q, _ = hp.Standing(env.robot).initial_state(penetration=env.simulator.static_penetration)
    for _ in range(5):
        action = 0.2 * rng.uniform(-1.0, 1.0, 12).astype(np.float32)
        observation, *_ = env.step(action)
    state = env.state
    expected = np.concatenate(
        (
            [(state.q[2] - q[2]) / 0.1],
            pin.Quaternion(state.q[3:7]).matrix()[2],
            state.v[:3],
            state.v[3:6] / 3.0,
            (state.q[7:] - q[7:]) / 0.5,
            state.v[6:] / 10.0,
            state.foot_force[:, 2] / (9.81 * env.robot.mass),
            action,
            (0.2, -0.1, 0.4),
        )
    )
    np.testing.assert_allclose(observation, np.clip(expected, -10.0, 10.0), rtol=1e-5, atol=1e-5)


def test_joint_actions_are_springs_and_dampers():
    """Beside the simulator under a controller of the documentation's formula."""
    env = RobotEnv("go2", action="joints")
    env.reset(seed=1)
    robot, start = env.robot, env.state
    posture = hp.Standing(robot).initial_state()[0]
    plant = hp.Simulator(robot, env.scenario.ground, dt=env.scenario.dt)
    plant.reset(start.q, start.v)
    limit = np.array(robot.torque_limit)
    spring = np.minimum(limit, 9.81 * robot.mass * (posture[2] - plant.static_penetration)) / 0.5
    action = np.linspace(-0.3, 0.3, 12).astype(np.float32)
    for _ in range(10):
        env.step(action)
        for _ in range(20):
            state = plant.state
            torque = (
                spring * (posture[7:] + 0.5 * action - state.q[7:]) - 0.03 * spring * state.v[6:]
            )
            plant.advance(hp.Command(np.clip(torque, -limit, limit), np.zeros((0, 3))), steps=2)
    np.testing.assert_allclose(env.state.q, plant.state.q, rtol=0, atol=1e-9)


def test_motors_hold_joint_targets():
    """Beside the simulator, with friction in the joints; torque and power are those of motors, not
    commanded ones.
    """
    friction = hp.Actuators(viscous_friction=1.0)
    motors = hp.Condensed(parameters={"joint_stiffness": 1.0, "joint_damping": 0.3})
    made = scenario(controller=motors, actuators=friction)
    env = RobotEnv("go2", scenario=made, reward={"torque": 1.0, "power": 1.0})
    env.reset(seed=0)
    s, start, robot = env.scenario, env.state, env.robot
    plant, gait = hp.Simulator(robot, s.ground, dt=s.dt, actuators=friction), hp.WalkingGait(robot)
    plant.reset(start.q, start.v)
    controller = s.controller.make(gait, mu=s.mu, period=s.period)
    gait.command[:3] = np.float32(0.5) * env.gait.max_speed, 0.0, 0.0
    worst = 0.0
    for tick in range(20):
        *_, info = env.step(np.array([0.5, 0.0, 0.0], dtype=np.float32))
        for k in range(20):
            plant.t = (20 * tick + k) * s.period
            command = controller.step(plant.state)
            plant.advance(command, steps=env._substeps)
        moved = plant.record["motors"]["mean_torque"][0]
        share, commanded = (
            np.mean((torque / robot.torque_limit) ** 2) for torque in (moved, command.torque)
        )
        power = np.abs(moved * plant.v[6:]).sum() / (9.81 * robot.mass)
        assert info["reward"] == pytest.approx({"torque": share, "power": power})
        worst = max(worst, abs(commanded / share - 1.0))
    np.testing.assert_array_equal(env.state.q, plant.state.q)
    assert worst > 0.02


def test_equal_seeds_give_equal_episodes_with_noise_and_pushes():
    how = {"noise": hp.Noise.typical(), "delay": 2e-3, "pushes": (hp.Push(0.1, (0.0, 3.0, 0.0)),)}
    env = RobotEnv("go2", scenario=scenario(robot="go2", mu_s=0.6, duration=0.4, **how))
    episodes = []
    for seed in (4, 4, 5):
        rows = [env.reset(seed=seed)[0]]
        over = False
        while not over:
            observation, reward, terminated, truncated, _ = env.step(
                np.array([0.3, 0.0, 0.0], dtype=np.float32)
            )
            rows.append(np.append(observation, reward))
            over = terminated or truncated
        assert (terminated, truncated, len(rows)) == (False, True, 21)
        episodes.append(np.concatenate(rows))
    np.testing.assert_array_equal(episodes[0], episodes[1])
    assert np.abs(episodes[0] - episodes[2]).max() > 1e-3


def test_on_the_estimate():
    """The controller and the observation have the estimate; episodes of one seed are equal, and
    others are not.
    """
    last = []
    for state, seed in (("true", 4), ("estimated", 4), ("estimated", 4), ("estimated", 5)):
        env = RobotEnv(
            "go2",
            scenario=hp.Scenario(
                robot="go2", ground=hp.Ground(mu_s=0.6), state=state, duration=1.0
            ),
        )
        env.reset(seed=seed)
        over = False
        while not over:
            observation, _, terminated, over, _ = env.step(
                np.array([0.4, 0.0, 0.1], dtype=np.float32)
            )
            assert not terminated
        velocity = env.state.v[:3]
        assert np.abs(observation[4:7] - velocity).max() < 0.1
        assert np.array_equal(observation[4:7], velocity.astype(np.float32)) == (state == "true")
        last.append(observation)
    np.testing.assert_array_equal(last[1], last[2])
    assert np.abs(last[1] - last[3]).max() > 1e-3


def test_its_sensors_are_sampled_once_at_each_tick():
    """With a slow inertial unit the estimate is that of a walk; an environment that begins anew has
    forgotten all.
    """
    imu = hp.Imu(rate=500.0)
    s = hp.Scenario(
        robot="go2", ground=hp.Ground(mu_s=0.6), state="estimated", sensors=imu, duration=2.0
    )
    env = RobotEnv("go2", scenario=s)
    off, first = [], []
    for _ in range(2):
        first.append(env.reset(seed=3)[0])
        for _ in range(100):
            observation, *_ = env.step(np.array([0.4, 0.0, 0.0], dtype=np.float32))
        first.append(observation)
        estimate = env._sensors.signals["estimated_q"]
        off.append(np.linalg.norm(estimate[:2] - env.state.q[:2]))
    assert max(off) < 0.02
    np.testing.assert_array_equal(first[:2], first[2:])


def test_a_fall_terminates():
    env = RobotEnv("solo12", action="joints")
    env.reset(seed=0)
    for _ in range(200):
        _, reward, terminated, truncated, _ = env.step(
            np.ones(12, dtype=np.float32) * np.resize((1.0, -1.0), 12)
        )
        assert np.isfinite(reward)
        if terminated:
            break
    assert terminated
    assert not truncated


def test_rewards_by_name_and_by_a_function():
    """Every term by its name is that of a function that works it out from the step."""
    seen = []

    def own(step):
        seen.append(step)
        return 2.0

    action = np.array([0.3, 0.1, -0.2], dtype=np.float32)
    by_function, by_name = (
        RobotEnv("go2", reward=own),
        RobotEnv("go2", reward=dict.fromkeys(TERMS, 1.0)),
    )
    for env in (by_function, by_name):
        env.reset(seed=2)
        for _ in range(5):
            _, reward, _, _, info = env.step(action)
        if env is by_function:
            assert reward == 2.0
    step, parts = seen[-1], info["reward"]
    rotation = pin.Quaternion(step.state.q[3:7]).matrix()
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    linear = pin.rpy.rpyToMatrix(0.0, 0.0, -yaw) @ rotation @ step.state.v[:3]
    turning = (rotation @ step.state.v[3:6])[2]
    expected = {
        "velocity": np.exp(-np.sum((linear[:2] - step.desired[:2]) ** 2) / 0.25**2),
        "turning": np.exp(-((turning - step.desired[2]) ** 2) / 0.25**2),
        "alive": 1.0,
        "tilt": 1.0 - rotation[2, 2] ** 2,
        "height": ((step.state.q[2] - step.standing_height) / 0.1) ** 2,
        "bounce": linear[2] ** 2,
        "torque": np.mean((step.command.torque / by_name.robot.torque_limit) ** 2),
        "power": np.abs(step.command.torque * step.state.v[6:]).sum() / (9.81 * by_name.robot.mass),
        "slip": 1e3 * step.slip,
        "action_rate": 0.0,
    }
    assert parts.keys() == expected.keys()
    for name, value in expected.items():
        assert parts[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name


def test_a_robot_of_ones_own_and_mujoco():
    pytest.importorskip("mujoco")
    made = scenario(plant="mujoco", mu_s=0.6, duration=0.5)
    env = RobotEnv(hp.load_robot("solo12"), scenario=made, velocity=((0.1, 0, 0), (0.2, 0, 0)))
    env.reset(seed=0)
    assert 0.1 <= env.desired[0] <= 0.2
    for _ in range(10):
        _, _, terminated, _, _ = env.step(np.array([0.2, 0.0, 0.0], dtype=np.float32))
    assert not terminated


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"robot": "go3"}, "go2"),
        ({"robot": "iris"}, "two, four or six feet"),
        ({"robot": 3}, "robot"),
        ({"action": "torque"}, "velocity"),
        ({"reward": {"speed": 1.0}}, "velocity"),
        ({"reward": {"velocity": np.nan}}, "velocity"),
        ({"reward": 3.0}, "scales by name"),
        ({"velocity": (1.0, 2.0)}, "velocity"),
        ({"velocity": ((1.0, 0, 0), (0.0, 0, 0))}, "lower end"),
        ({"scenario": 3}, "scenario"),
        ({"scenario": "a1"}, "a1"),
        ({"scenario": "governed"}, "governed"),
    ],
)
def test_what_is_refused(arguments, reason):
    if arguments.get("scenario") == "a1":
        arguments = {"robot": "go2", "scenario": hp.Scenario(robot="a1")}
    elif arguments.get("scenario") == "governed":
        arguments = {"scenario": hp.Scenario(controller="governed")}
    with pytest.raises(hp.InputError, match=reason):
        RobotEnv(**arguments)


def test_bad_actions_and_options_are_refused():
    env = RobotEnv("go2")
    with pytest.raises(hp.InputError, match="velocity"):
        env.reset(options={"speed": 1.0})
    env.reset(seed=0)
    for action in (np.zeros(4), np.array([np.nan, 0.0, 0.0])):
        with pytest.raises(hp.InputError, match="action"):
            env.step(action)
