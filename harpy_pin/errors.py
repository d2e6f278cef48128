"""Exceptions: a small tree, each with the evidence of what went wrong."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from importlib.metadata import requires
from pathlib import Path
from typing import Any

MAX_NAME = 60  # characters of a name that are compared with those there are


def shown(value: object, length: int = 60) -> str:
    """A value as messages show it: on one line, and cut where it is long; its type where it cannot
    be shown.
    """
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a whole number of too many digits, or an object of a stranger
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= length else f"{text[: length - 1]}…"


def reason(error: Exception) -> str:
    """An error in words: its message, and of an error that is not ours its type."""
    return (
        str(error)
        if isinstance(error, HarpyError)
        else f"{type(error).__name__}: {error}".removesuffix(": ")
    )


def first_of(names: Sequence[str], most: int = 1) -> str:
    """The first of some names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


class HarpyError(Exception):
    """Base of every exception raised by this library; what is given by name becomes an
    attribute.
    """

    def __init__(self, message: str, **evidence: Any) -> None:
        super().__init__(message)
        for name, value in evidence.items():
            setattr(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Whole, from one process to another."""
        return type(self).__new__, (type(self), *self.args), vars(self)


class InputError(HarpyError, ValueError):
    """An argument is out of its domain: wrong shape, not finite, negative, or an unknown name.

    Attributes:
        name: the argument.
        value: what was given.
    """

    name: str = ""
    value: Any = None

    @classmethod
    def unknown(cls, kind: str, value: object, valid: Iterable[str], hint: str = "") -> InputError:
        """Error for a name that is not one of ``valid``; lists the valid ones, and says which one
        is near.

        Args:
            kind: of thing that was asked for, in words: ``"robot"``.
            value: the name that was given.
            valid: the names there are.
            hint: what else may have been meant.
        """
        known = sorted(valid)
        message = f"unknown {kind} {shown(value)}; valid names: {', '.join(known)}"
        if hint:
            return cls(f"{message}; {hint}", name=kind, value=value)
        by_lower = {name.lower(): name for name in known}
        near = (
            get_close_matches(value[:MAX_NAME].lower(), by_lower, n=1, cutoff=0.6)
            if isinstance(value, str)
            else []
        )
        return cls(
            f"{message}; did you mean '{by_lower[near[0]]}'?" if near else message,
            name=kind,
            value=value,
        )


class KernelError(HarpyError, TypeError):
    """A function leaves the language of kernels, at the place that the message names; or a call has
    other arguments.
    """


class RobotError(HarpyError):
    """A robot description is missing, malformed, or lacks something that was asked of it.

    Attributes:
        path: the file, where there is one.
    """

    path: object = None


class OutOfReachError(HarpyError):
    """A foot target lies outside the workspace of its leg.

    Attributes:
        target: (3,) foot position asked for, relative to the body, m.
        nearest: (3,) joint angles of the nearest point that can be reached, rad.
        excess: distance between the two points, m.
    """

    target: Any
    nearest: Any
    excess: float


class ControlError(HarpyError):
    """A controller returned something that is not a command, or raised.

    Attributes:
        time: simulated time of the tick, s.
        run: the log up to that tick.
    """

    time: float
    run: Any = None


class RunFileError(HarpyError):
    """A run log cannot be read or written.

    Attributes:
        path: the file.
        run: the log, if it was to be written at the end of its run.
    """

    path: object = None
    run: Any = None


class RunFileWarning(UserWarning):
    """A log was found that belongs to a run that has not ended."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run.

    It is no :class:`HarpyError`: a loop over many walks that lives with errors ends all the same.

    Attributes:
        run: the log up to that moment.
    """

    def __init__(self, message: str, *, run: Any = None) -> None:
        super().__init__(message)
        self.run = run


PUBLISHED = False  # on the day of publishing True, with the addresses in pyproject.toml


def install_line(extra: str) -> str:
    """What installs an extra: from the clone that this package is in, else from package indices."""
    clone = Path(__file__).resolve().parents[1]
    if (clone / "constraints.txt").is_file():
        return f'pip install -e "{"." if clone == Path.cwd() else clone}[{extra}]"'
    lines = (
        [f"harpy-pin[{extra}]; extra == '{extra}'"] if PUBLISHED else requires("harpy-pin") or ()
    )
    return " ".join(
        [
            "pip install",
            *(f'"{r.split(";")[0].strip()}"' for r in lines if f"extra == '{extra}'" in r),
        ]
    )
