"""``python -m harpy_pin.gym``: how many steps of the vector environment a second has on this machine."""

from __future__ import annotations

from os import cpu_count
from time import perf_counter, process_time

import numpy as np

from harpy_pin.gym.vector import HarpyVectorEnv

WORLDS, STEPS, REPETITIONS = 1024, 50, 5


def measure(*, shield: bool, threads: int) -> tuple[float, float]:
    """Most steps of some repetitions, autoreset and observations included, under random actions.

    Returns:
        Per second of the clock, and per second of one core's time: on a busy machine the first says little.
    """
    env = HarpyVectorEnv(WORLDS, shield=shield, threads=threads)
    env.reset(seed=0)
    random, best = np.random.default_rng(0), np.zeros(2)
    actions = random.uniform(-1.0, 1.0, (STEPS, WORLDS, 12)).astype(np.float32)
    for _ in range(REPETITIONS):
        begin = np.array((perf_counter(), process_time()))
        for action in actions:
            env.step(action)
        best = np.maximum(best, STEPS * WORLDS / (np.array((perf_counter(), process_time())) - begin))
    env.close()
    return float(best[0]), float(best[1])


def main() -> None:
    """Print the table."""
    s = HarpyVectorEnv(1).batch.scenario
    steps = round(s.period / s.dt)
    print(f"a step: {1e3 * s.period:g} ms, {steps} physics steps of {1e3 * s.dt:g} ms; {WORLDS} worlds")
    for threads in sorted({1, cpu_count() or 1}):
        for shield in (False, True):
            rate, of_core = measure(shield=shield, threads=threads)
            kind = f"{threads} thread{'s' * (threads > 1)}, {'with a shield' if shield else 'plain'}"
            print(f"{kind:25s}{rate:9,.0f} steps per second, {of_core:,.0f} per second of a core")


main()
