"""Many robots as one Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.gym.batched_env import ACTIONS, BatchedEnv
from harpy_pin.gym.env import spaces
from harpy_pin.scenario import Scenario

__all__ = ["HarpyVectorEnv"]

Numbers = NDArray[np.float32]
Flags = NDArray[np.bool_]


class HarpyVectorEnv(VectorEnv[Numbers, Numbers, NDArray[Any]]):
    """n times :class:`~harpy_pin.gym.env.HarpyEnv`, in one compiled loop, on as many threads as there are cores.

    It answers as :class:`gymnasium.vector.SyncVectorEnv` with n single environments does: a world whose episode is over
    begins anew at the next step, whose action it does not see (``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: n.
        scenario: as of the single environment.
        shield: likewise.
        threads: most that step at a time; one for each core by default.

    Raises:
        InputError: n is no positive integer, or as for the single environment.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self, num_envs: int = 1, scenario: Scenario | None = None, *, shield: bool = False, threads: int | None = None
    ) -> None:
        self.batch = BatchedEnv(num_envs, scenario, shield=shield, threads=threads)
        self.num_envs = self.batch.n
        self.single_observation_space, self.single_action_space = spaces()
        self.observation_space: gymnasium.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space: gymnasium.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        self._random = [seeding.np_random(None)[0] for _ in range(self.num_envs)]
        self._over = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin all episodes anew.

        Args:
            seed: of the draws: one for each world, or the first one's, from which the others count up.
            options: none.

        Raises:
            InputError: not as many seeds as worlds.
        """
        if isinstance(seed, int | np.integer):
            seed = [int(seed) + i for i in range(self.num_envs)]
        if seed is not None:
            if (
                not isinstance(seed, Sequence | np.ndarray)
                or isinstance(seed, str)
                or not np.shape(np.array(seed, dtype=object))
            ):
                message = f"seed must be one whole number or several, got {shown(seed)}"
                raise InputError(message, name="seed", value=seed)
            if len(seed) != self.num_envs:
                raise InputError(f"{self.num_envs} worlds need as many seeds, got {len(seed)}", name="seed", value=seed)
            for i, value in enumerate(seed):
                if value is not None:
                    self._random[i] = seeding.np_random(checks.whole("seed", value))[0]
        for i in range(self.num_envs):
            self.batch.reset(i, self._random[i])
        self._over[:] = False
        return self.batch.observation.astype(np.float32), {}

    def step(self, actions: Numbers) -> tuple[Numbers, NDArray[Any], Flags, Flags, dict[str, Any]]:
        """One period of every world; those whose episode was over are reset instead, with reward zero.

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
