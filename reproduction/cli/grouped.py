"""Options of a command in groups: dataclasses of which each field is an option."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature
from typing import Any, get_type_hints

import typer

__all__ = ["grouped"]


def grouped(order: Sequence[str]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A decorator of commands: their options are the fields of the dataclasses that they take.

    The command gets an object of each class and, where it takes ``given``, the names of the options that the user
    gave. Fields are annotated with ``typer.Option``, and their defaults are those of the options.

    Args:
        order: names of all options as the help lists them.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        takes = get_type_hints(command)
        groups: dict[str, Any] = {name: kind for name, kind in takes.items() if is_dataclass(kind)}
        default = {entry.name: entry.default for kind in groups.values() for entry in fields(kind)}
        hints: dict[str, Any] = {}
        for kind in groups.values():
            hints |= get_type_hints(kind, include_extras=True)

        @wraps(command)
        def run(context: typer.Context, **options: Any) -> None:
            made = {
                name: kind(**{entry.name: options[entry.name] for entry in fields(kind)})
                for name, kind in groups.items()
            }
            command(**made, **({"given": _given(context)} if "given" in takes else {}))

        parameters = [Parameter("context", Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)]
        parameters += [
            Parameter(name, Parameter.KEYWORD_ONLY, default=default[name], annotation=hints[name]) for name in order
        ]
        run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {entry.name: entry.annotation for entry in parameters}
        return run

    return decorate


def _given(context: typer.Context) -> tuple[str, ...]:
    """Names of the parameters that were given on the command line."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    return tuple(name for name, source in sources.items() if source is not None and "DEFAULT" not in source.name)
