"""How a command ends: Ctrl-C and SIGTERM stop it, and warnings, like errors, are one line each."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any

import typer

from harpy_pin.cli.output import INTERRUPTED
from harpy_pin.cli.signals import Interruptible
from harpy_pin.errors import Interrupted, RunFileWarning

__all__ = ["say", "stopping"]

FILES = "harpy_pin.files"
KERNELS = "harpy_pin.compiled.kernels"
"""Module that compiles, where a command has come so far as to need it."""


def say(message: object) -> None:
    """One plain line on standard error, whatever names from foreign files the message holds."""
    line = " ".join(str(message).split())
    print(f"harpy: {''.join(c if c.isprintable() else '?' for c in line)}", file=sys.stderr)


def stopping(command: Callable[..., None]) -> Callable[..., None]:
    """A command that SIGTERM ends like Ctrl-C, with the exit codes that shells expect.

    What is compiled in the background is waited for, or ended where the command did not come to its end.
    """

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        signals, code = Interruptible(), 0
        try:
            with signals, warnings.catch_warnings():
                warnings.simplefilter("always", RunFileWarning)
                _show_as_a_line()
                try:
                    code = _exit_code_of(command, arguments, options)
                    _finish()
                finally:
                    signals.over()
                    _end_compilers()
        except KeyboardInterrupt as interrupt:
            own = not isinstance(interrupt, Interrupted) and str(interrupt)
            say(own or "interrupted; nothing more was written")
            code = _code_of_waiting() or INTERRUPTED
        code = signals.code or code
        if code:
            raise typer.Exit(code)

    return run


def _code_of_waiting() -> int:
    """Exit code of a signal that waited until results were kept; 0 without one."""
    waited = files.Shield.waited if (files := sys.modules.get(FILES)) is not None else []
    return 128 + waited[-1] if waited else 0


def _exit_code_of(command: Callable[..., None], arguments: tuple[Any, ...], options: Mapping[str, Any]) -> int:
    try:
        command(*arguments, **options)
    except typer.Exit as ending:
        return ending.exit_code
    return 0


def _finish() -> None:
    """What would otherwise be done at the end of the process, where a signal cuts it."""
    if (kernels := sys.modules.get(KERNELS)) is not None:
        kernels.wait_for_all()
    if sys.stdout is not None:
        sys.stdout.flush()


def _end_compilers() -> None:
    """Compile nothing more in the background."""
    if (kernels := sys.modules.get(KERNELS)) is not None:
        kernels.end_all()


def _show_as_a_line() -> None:
    """Show our own warnings without the line of code."""
    others = warnings.showwarning
    own = str(Path(__file__).parents[1])

    def show(message: Any, category: type[Warning], filename: str, *place: Any, **more: Any) -> None:
        if issubclass(category, RunFileWarning) or (category is UserWarning and filename.startswith(own)):
            say(message)
        else:
            others(message, category, filename, *place, **more)

    warnings.showwarning = show
