"""Threads that share the loop of a batch, and the choice of some of it."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count, getpid
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, shown

SMALL = 64  # robots that are not worth a second thread


def selection(name: str, which: ArrayLike | None, count: int) -> NDArray[np.int64]:
    """Indices of some of ``count`` things, which are given as indices from 0 or as a mask; None for
    all.
    """
    everything = np.arange(count)
    try:
        given = everything if which is None else np.atleast_1d(np.asarray(which))
        chosen = everything[given if given.size else given.astype(np.int64)]
    except (IndexError, ValueError, TypeError):
        raise InputError(
            f"{name} must be indices from 0 to {count - 1} or a mask of {count}, got "
            f"{shown(which)}",
            name=name,
            value=which,
        ) from None
    return chosen.reshape(-1)


class Threads:
    """Threads of the present process, begun when they are first needed, each for a part of a batch
    of ``n`` robots.

    At most ``most`` work at a time, by default one for each core. A part ends and the next begins
    at each of the ``cuts``; with one part, the work is done by the thread that calls. A forked
    child has none of its parent's threads, and would wait for them for ever: it begins its own. So
    does a copy.
    """

    def __init__(self, n: int, most: int | None = None) -> None:
        workers = checks.whole(
            "threads", cpu_count() or 1 if most is None else most, low=1, high=1024
        )
        self.cuts: list[int] = (
            np.linspace(0, n, min(workers, max(n // SMALL, 1)) + 1).astype(int).tolist()
        )
        self._pool: ThreadPoolExecutor | None = None
        self._process, self._alone = getpid(), Lock()

    def run(self, piece: Callable[[int, int, int], None]) -> None:
        """Call a function with number, begin and end of each part, and wait; refused while another
        thread does so.
        """
        if self._process != getpid():
            self._pool, self._process, self._alone = None, getpid(), Lock()
        if not self._alone.acquire(blocking=False):
            raise InputError(
                "another thread is in a step of this batch: give each thread a batch of its own"
            )
        try:
            if len(self.cuts) > 2 and self._pool is None:
                self._pool = ThreadPoolExecutor(len(self.cuts) - 1)
            share = map if self._pool is None else self._pool.map
            list(share(piece, range(len(self.cuts) - 1), self.cuts[:-1], self.cuts[1:]))
        finally:
            self._alone.release()

    def close(self) -> None:
        """End the threads; the next :meth:`run` begins new ones."""
        if self._pool is not None and self._process == getpid():
            self._pool.shutdown()
        self._pool = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_pool": None, "_process": 0, "_alone": None}
