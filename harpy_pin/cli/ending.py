"""How a command ends: Ctrl-C and SIGTERM stop it, and warnings, like errors, are one line each."""

from __future__ import annotations

import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import typer

from harpy_pin.cli.output import INTERRUPTED, TERMINATED
from harpy_pin.errors import Interrupted, RunFileWarning

__all__ = ["say", "stopping"]


def say(message: object) -> None:
    """One plain line on standard error, whatever names from foreign files the message holds."""
    line = " ".join(str(message).split())
    print(f"harpy: {''.join(c if c.isprintable() else '?' for c in line)}", file=sys.stderr)


def stopping(command: Callable[..., None]) -> Callable[..., None]:
    """A command that SIGTERM ends like Ctrl-C, with the exit codes that shells expect."""

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        with _terminable() as received, warnings.catch_warnings():
            warnings.simplefilter("always", RunFileWarning)
            _show_as_a_line()
            code = 0
            try:
                command(*arguments, **options)
            except KeyboardInterrupt as interrupt:
                own = not isinstance(interrupt, Interrupted) and str(interrupt)
                say(own or "interrupted; nothing more was written")
                code = INTERRUPTED
            except typer.Exit as ending:
                code = ending.exit_code
        if received:
            code = TERMINATED
        if code:
            raise typer.Exit(code)

    return run


def _show_as_a_line() -> None:
    """Show our own warnings without the line of code."""
    others = warnings.showwarning

    def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, RunFileWarning):
            say(message)
        else:
            others(message, category, *place, **more)

    warnings.showwarning = show


@contextmanager
def _terminable() -> Iterator[list[int]]:
    """SIGTERM interrupts the block as Ctrl-C does; the list says whether it came."""
    received: list[int] = []

    def terminate(number: int, frame: object) -> None:
        received.append(number)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield received
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield received
    finally:
        signal.signal(signal.SIGTERM, before)
