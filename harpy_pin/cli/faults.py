"""What becomes of errors at the edge of a program: one line on stderr and an exit code."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from harpy_pin.errors import HarpyError

__all__ = ["one_line_errors"]


@contextmanager
def one_line_errors(program: str, code: int) -> Iterator[None]:
    """Run a program whose errors that a user can mend become one line each; others keep their traceback.

    These are the library's own errors, arguments that the command line cannot read, and an output that takes no more
    text. Characters that the output does not know are replaced.

    Args:
        program: name in front of the line.
        code: exit code; arguments that cannot be read have the one of their own exception.
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
            print(f"{program}: {' '.join((fault or str(error)).split())}", file=sys.stderr, flush=True)
        sys.exit(getattr(error, "exit_code", code))


def _output_fault(error: Exception) -> str | None:
    """Why the output takes no more text, if so; the rest of it is dropped, or Python would try again at exit."""
    if not isinstance(error, OSError) or error.filename is not None:
        return None
    with suppress(AttributeError, OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"cannot write the output: {error.strerror or error}"


def _usage_fault(error: Exception) -> str | None:
    """What is wrong with the arguments, where the command line could not read them.

    Told by its attributes: the class is Click's, whose code has moved into Typer.
    """
    if not hasattr(error, "format_message"):
        return None
    context = getattr(error, "ctx", None)
    hint = "" if context is None else f" (see {context.command_path} --help)"
    return f"{error.format_message()}{hint}"
