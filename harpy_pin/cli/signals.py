"""Ctrl-C and SIGTERM: what they do before, during and after a command."""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
ENDING = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
    if hasattr(signal, name)
)
"""Signals after which no compiler is left running."""
COMPILER = "harpy_pin.kernels.compiler"
"""The module whose compilers and folders a process does not leave behind, once it has been
imported.
"""


def leave_at_signals() -> None:
    """From now on a signal ends the process at once and without a word, with the exit code that
    shells expect.

    For the time in which nothing is at stake: while modules are imported, and once everything is
    written. A signal that the process was started to ignore stays ignored.
    """
    for number in ENDING:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _leave)


def _leave(number: int, frame: object) -> None:
    if (compiler := sys.modules.get(COMPILER)) is not None and hasattr(compiler, "leave"):
        compiler.leave()
    os._exit(128 + number)


class _Stopped(KeyboardInterrupt):
    """Not the class itself: once C code has seen that, Python ends by SIGINT whatever exit code it
    is given.
    """


class Interruptible:
    """A block that Ctrl-C and SIGTERM end by a ``KeyboardInterrupt``; ``received`` are the signals
    so far.

    Does nothing outside the main thread, where no signal arrives.
    """

    def __init__(self) -> None:
        self.received: list[int] = []
        self._before: dict[int, Any] = {}
        self._working = False

    def __enter__(self) -> Interruptible:
        if threading.current_thread() is threading.main_thread():
            self._working = True
            for number in SIGNALS:
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._receive)
        return self

    def _receive(self, number: int, frame: object) -> None:
        self.received.append(number)
        if self._working:
            raise _Stopped

    def over(self) -> None:
        """From now on signals are only noted: what they would end has ended."""
        self._working = False

    def __exit__(self, *error: object) -> None:
        self.over()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @property
    def code(self) -> int:
        """Exit code that shells expect of the last signal; 0 without one."""
        return 128 + self.received[-1] if self.received else 0
