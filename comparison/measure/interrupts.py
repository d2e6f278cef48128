"""Processes that Ctrl-C in a terminal does not reach."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Processes and threads that are started within take no Ctrl-C, which a terminal sends to all
    processes.

    One that comes meanwhile waits until the end of the block. Does nothing outside the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    resource_tracker.ensure_running()  # starting it would let them through
    before, noted = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}), list[int]()
    handler = signal.getsignal(signal.SIGINT)
    if callable(
        handler
    ):  # another thread, which does not block it, would have it handled in this one
        signal.signal(signal.SIGINT, lambda number, frame: noted.append(number))
    try:
        yield
    finally:
        if callable(handler):
            signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if noted:
            signal.raise_signal(signal.SIGINT)
