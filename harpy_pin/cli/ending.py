"""How a command ends: Ctrl-C and SIGTERM stop it, and errors and warnings are one line each."""

import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any

import typer

from harpy_pin.cli.output import INTERRUPTED
from harpy_pin.cli.signals import Interruptible
from harpy_pin.errors import HarpyError, Interrupted, RunFileWarning
from harpy_pin.files import Shield


def say(message: object) -> None:
    """One plain line on standard error, whatever names from foreign files the message holds."""
    line = " ".join(str(message).split())
    print(f"harpy: {''.join(c if c.isprintable() else '?' for c in line)}", file=sys.stderr)


def stopping(command: Callable[..., None]) -> Callable[..., None]:
    """A command that SIGTERM ends like Ctrl-C, with the exit codes that shells expect.

    What is compiled in the background is waited for, or ended where the command did not come to its
    end.
    """

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        signals, code = Interruptible(), 0
        try:
            with signals, warnings.catch_warnings():
                warnings.simplefilter("always", RunFileWarning)
                _show_as_a_line()
                try:
                    try:
                        command(*arguments, **options)
                    except typer.Exit as ending:
                        code = ending.exit_code
                    # What would otherwise be done at the end of the process, where a signal cuts
                    # it.
                    if (kernels := _kernels()) is not None:
                        kernels.wait_for_all()
                    if sys.stdout is not None:
                        sys.stdout.flush()
                finally:
                    signals.over()
                    if (kernels := _kernels()) is not None:
                        kernels.end_all()
        except (KeyboardInterrupt, RuntimeError) as interrupt:
            # Python 3.11 wraps what a signal raises while a class of an import is made.
            cause = interrupt.__cause__ if isinstance(interrupt, RuntimeError) else interrupt
            if not isinstance(cause, KeyboardInterrupt):
                raise
            own = not isinstance(cause, Interrupted) and str(cause)
            say(own or "interrupted; nothing more was written")
            # A signal may have waited until results were kept.
            code = 128 + Shield.waited[-1] if Shield.waited else INTERRUPTED
        code = signals.code or code
        if code:
            raise typer.Exit(code)

    return run


def _kernels() -> Any:
    """The module that compiles, where a command has come so far as to need it."""
    return sys.modules.get("harpy_pin.kernels.kernels")


def _show_as_a_line() -> None:
    """Show our own warnings without the line of code, each once: some commands read a robot several
    times.
    """
    others = warnings.showwarning
    own, said = str(Path(__file__).parents[1]), set[str]()

    def show(
        message: Any, category: type[Warning], filename: str, *place: Any, **more: Any
    ) -> None:
        if issubclass(category, RunFileWarning) or (
            category is UserWarning and filename.startswith(own)
        ):
            if str(message) not in said:
                say(message)
            said.add(str(message))
        else:
            others(message, category, filename, *place, **more)

    warnings.showwarning = show


@contextmanager
def one_line_errors(program: str, code: int) -> Iterator[None]:
    """Run a program whose errors that a user can mend become one line each; others keep their
    traceback.

    These are the library's own errors, arguments that the command line cannot read, which have an
    exit code of their own, and an output that takes no more text. The program's name is in front of
    the line; characters that the output does not know are replaced.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        try:
            yield
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except Exception as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            error.show()  # type: ignore[attr-defined]
            sys.exit(code)
        fault = _output_fault(error) or _usage_fault(error)
        if fault is None and not isinstance(error, HarpyError):
            raise
        # Plain text: a message may hold brackets, which markup would swallow.
        with suppress(OSError):
            print(
                f"{program}: {' '.join((fault or str(error)).split())}", file=sys.stderr, flush=True
            )
        sys.exit(getattr(error, "exit_code", code))


def _output_fault(error: Exception) -> str | None:
    """Why the output takes no more text, if so; the rest of it is dropped, or Python would try
    again at exit.
    """
    if not isinstance(error, OSError) or error.filename is not None:
        return None
    with suppress(AttributeError, OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"cannot write the output: {error.strerror or error}"


def _usage_fault(error: Exception) -> str | None:
    """What is wrong with the arguments, by attributes of the error: its class is private to
    Typer.
    """
    if not hasattr(error, "format_message"):
        return None
    context = getattr(error, "ctx", None)
    hint = "" if context is None else f" (see {context.command_path} --help)"
    return f"{error.format_message()}{hint}"
