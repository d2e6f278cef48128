"""One robot as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.gym.batched_env import ACTIONS, MOST, OBSERVATIONS, BatchedEnv
from harpy_pin.model.state import State
from harpy_pin.scenario import Scenario

__all__ = ["HarpyEnv", "spaces"]

Numbers = NDArray[np.float32]


def spaces() -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """Spaces of the observations and the actions of one robot."""
    return (
        gymnasium.spaces.Box(-MOST, MOST, (OBSERVATIONS,), np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32),
    )


class HarpyEnv(gymnasium.Env[Numbers, Numbers]):
    """Harpy, to be taught to walk; actions, observations and rewards: :mod:`harpy_pin.gym.batched_env`.

    Args:
        scenario: robot, ground, pushes, speed, period, physics step and duration; ten seconds at 0.3 m/s on friction
            0.6 by default, an action every 5 ms.
        shield: whether commands pass a shield, which knows the ground's friction.
        render_mode: none; :attr:`state` goes into the library's own viewers.

    Raises:
        InputError: the scenario has another engine, noise or delay.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(self, scenario: Scenario | None = None, *, shield: bool = False, render_mode: None = None) -> None:
        self.batch = BatchedEnv(1, scenario, shield=shield)
        self.observation_space: gymnasium.Space[Any]
        self.action_space: gymnasium.Space[Any]
        self.observation_space, self.action_space = spaces()
        self.render_mode = render_mode
        self._busy = np.zeros(1, dtype=np.bool_)

    @property
    def state(self) -> State:
        """The true state (a copy)."""
        return self.batch.state(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Stand, with joints drawn within ±0.05 rad of the posture.

        Args:
            seed: of the draws; those of the last seed go on without one.
            options: none.

        Raises:
            InputError: the seed is no whole number.
        """
        seed = None if seed is None else checks.whole("seed", seed)
        super().reset(seed=seed, options=options)
        self.batch.reset(0, self.np_random)
        return self.batch.observation[0].astype(np.float32), {}

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """One period; the episode is over where it terminates or is truncated.

        Raises:
            InputError: the action has the wrong shape, or is not finite.
        """
        worlds = self.batch
        worlds.step(np.asarray(action)[None], self._busy)
        fallen = bool(worlds.fallen[0])
        over = bool(worlds.truncated()[0]) and not fallen
        return worlds.observation[0].astype(np.float32), float(worlds.reward[0]), fallen, over, {}
