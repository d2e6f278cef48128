"""Threads that share the loop of a batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from os import getpid
from typing import Any

__all__ = ["Threads"]


class Threads:
    """Threads of the present process, begun when they are first needed.

    A forked child has none of its parent's threads, and would wait for them for ever: it begins its own. So does a
    copy.

    Args:
        count: how many; with one, the work is done by the thread that calls.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = getpid()

    def run(self, piece: Callable[..., None], *arguments: Sequence[int]) -> None:
        """Call a function for each tuple of arguments, and wait until all of it is done."""
        if self.count == 1:
            for given in zip(*arguments, strict=True):
                piece(*given)
            return
        if self._pool is None or self._process != getpid():
            self._pool, self._process = ThreadPoolExecutor(self.count), getpid()
        list(self._pool.map(piece, *arguments))

    def close(self) -> None:
        """End the threads; the next :meth:`run` begins new ones."""
        if self._pool is not None and self._process == getpid():
            self._pool.shutdown()
        self._pool = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Threads, (self.count,)
