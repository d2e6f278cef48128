"""Many worlds in one compiled loop: a policy explores, without and with the shield (extra gym)."""

from time import perf_counter

import gymnasium
import numpy as np

import harpy_pin as hp

WORLDS, STEPS, NOISE = 128, 300, 0.3


def policy(observation: np.ndarray) -> np.ndarray:
    """Stands, (n, 39) to (n, 12): joints hold their posture, thrusters oppose tilt and velocity."""
    thrust = 3.0 * observation[:, 1:4] - 0.5 * observation[:, 6:9]
    thrust[:, 2] = -0.5 * observation[:, 0] - 0.5 * observation[:, 8]
    return np.hstack((np.zeros((len(observation), 6)), thrust, thrust))


scenario = hp.Scenario(
    ground=hp.Ground(mu_s=0.3), gait=hp.Straight(speed=0.0), duration=10.0, period=5e-3, dt=1e-3
)
for shield in (False, True):
    env = gymnasium.make_vec(
        "harpy_pin.contrib.gym:Harpy-v0",
        num_envs=WORLDS,
        vectorization_mode="vector_entry_point",
        scenario=scenario,
        shield=shield,
    )
    random = np.random.default_rng(0)
    observation = env.reset(seed=0)[0]
    falls, total, begin = 0, 0.0, perf_counter()
    for _ in range(STEPS):
        action = policy(observation) + random.normal(0.0, NOISE, (WORLDS, 12))
        observation, reward, fallen = env.step(np.clip(action, -1.0, 1.0).astype(np.float32))[:3]
        falls, total = falls + fallen.sum(), total + reward.sum()
    rate = WORLDS * STEPS / (perf_counter() - begin)
    name = "with a shield" if shield else "without"
    mean = total / (WORLDS * STEPS)
    print(f"{name:13s} {falls} falls, mean reward {mean:.3f}, {rate:,.0f} steps per second")
    env.close()
