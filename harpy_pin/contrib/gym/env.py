"""Harpy as a Gymnasium environment, alone and many at once in one compiled loop."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.contrib.gym.batched_env import ACTIONS, MOST, OBSERVATIONS, BatchedEnv
from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import State
from harpy_pin.scenario import Scenario

Numbers = NDArray[np.float32]
Flags = NDArray[np.bool_]


def spaces() -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """Spaces of the observations and the actions of one robot."""
    box = gymnasium.spaces.Box
    return box(-MOST, MOST, (OBSERVATIONS,), np.float32), box(-1.0, 1.0, (ACTIONS,), np.float32)


class HarpyEnv(gymnasium.Env[Numbers, Numbers]):
    """Harpy, to be taught to walk; actions, observations and rewards:
    :mod:`harpy_pin.contrib.gym.batched_env`.

    Args:
        scenario: robot, ground, pushes, speed, period, physics step and duration; ten seconds at
            0.3 m/s on friction 0.6 by default, an action every 5 ms.
        shield: whether commands pass a shield, which knows the ground's friction.
        render_mode: none; :attr:`state` goes into the library's own viewers.

    Raises:
        InputError: the scenario has another engine, noise or delay.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self, scenario: Scenario | None = None, *, shield: bool = False, render_mode: None = None
    ) -> None:
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
        worlds.step(checks.array("action", action, (ACTIONS,))[None], self._busy)
        fallen = bool(worlds.fallen[0])
        over = bool(worlds.truncated()[0]) and not fallen
        return worlds.observation[0].astype(np.float32), float(worlds.reward[0]), fallen, over, {}


class HarpyVectorEnv(VectorEnv[Numbers, Numbers, NDArray[Any]]):
    """n times :class:`~harpy_pin.contrib.gym.env.HarpyEnv`, in one compiled loop, on a thread for
    each core.

    It answers as :class:`gymnasium.vector.SyncVectorEnv` with n single environments does: a world
    whose episode is over begins anew at the next step, whose action it does not see
    (``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: n.
        scenario: as of the single environment.
        shield: as of the single environment.
        threads: most that step at a time; one for each core by default.

    Raises:
        InputError: n is no positive integer, or as for the single environment.
    """

    # As Gymnasium declares it.
    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | None = None,
        *,
        shield: bool = False,
        threads: int | None = None,
    ) -> None:
        self.batch = BatchedEnv(num_envs, scenario, shield=shield, threads=threads)
        self.num_envs = self.batch.n
        self.single_observation_space, self.single_action_space = spaces()
        self.observation_space: gymnasium.Space[Any] = batch_space(
            self.single_observation_space, self.num_envs
        )
        self.action_space: gymnasium.Space[Any] = batch_space(
            self.single_action_space, self.num_envs
        )
        self._random = [seeding.np_random(None)[0] for _ in range(self.num_envs)]
        self._over = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin all episodes anew.

        Args:
            seed: of the draws: one for each world, or the first one's, from which the others count
                up.
            options: none.

        Raises:
            InputError: not as many seeds as worlds.
        """
        if isinstance(seed, int | np.integer):
            seed = [int(seed) + i for i in range(self.num_envs)]
        if seed is not None:
            if not isinstance(seed, list | tuple | np.ndarray) or len(seed) != self.num_envs:
                raise InputError(
                    f"{self.num_envs} worlds need as many seeds, or one whole number, got "
                    f"{shown(seed)}",
                    name="seed",
                    value=seed,
                )
            for i, value in enumerate(seed):
                if value is not None:
                    self._random[i] = seeding.np_random(checks.whole("seed", value))[0]
        for i in range(self.num_envs):
            self.batch.reset(i, self._random[i])
        self._over[:] = False
        return self.batch.observation.astype(np.float32), {}

    def step(self, actions: Numbers) -> tuple[Numbers, NDArray[Any], Flags, Flags, dict[str, Any]]:
        """One period of every world; those whose episode was over are reset instead, with reward
        zero.

        Raises:
            InputError: the actions have the wrong shape, or are not finite.
        """
        worlds, again = self.batch, self._over
        worlds.step(checks.array("actions", actions, (self.num_envs, ACTIONS)), again)
        for i in np.flatnonzero(again):
            worlds.reset(int(i), self._random[i])
        reward = np.where(again, 0.0, worlds.reward)
        fallen = worlds.fallen.copy()
        late = worlds.truncated() & ~fallen
        self._over = fallen | late
        return worlds.observation.astype(np.float32), reward, fallen, late, {}

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self.batch.close()
