"""A command for each study, all with the same options."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Any

import typer

from comparison import studies
from comparison.campaign.cluster import workers
from comparison.cli.output import (
    FigureFile,
    NumbersFile,
    Quick,
    Scheduler,
    print_tables,
    stages,
    writing,
)
from comparison.study import Study
from harpy_pin.files import check_writable

_FILES = [
    import_module(f"{studies.__name__}.{file.name}") for file in iter_modules(studies.__path__)
]
STUDIES: dict[str, Study] = {
    file.STUDY.name: file.STUDY for file in _FILES if hasattr(file, "STUDY")
}
"""By name: every file of :mod:`comparison.studies` that has a ``STUDY``."""
MOST = 100_000
"""Largest number that an option takes."""


def command_of(study: Study) -> Callable[..., None]:
    """The command that runs a study."""

    def command(
        quick: Quick = False,
        only: Annotated[
            list[str] | None,
            typer.Option("--only", metavar="NAME", help="This one; may be given several times."),
        ] = None,
        out: Annotated[
            Path | None,
            typer.Option(
                "--out",
                metavar="FILE",
                help="Keep what is finished here; the same command goes on with it.",
            ),
        ] = None,
        json: NumbersFile = None,
        figure: FigureFile = None,
        scheduler: Scheduler = None,
        **options: Any,
    ) -> None:
        if figure is not None:
            check_writable(figure)
        chosen: dict[str, Any] = {study.only: tuple(only)} if only else {}
        chosen |= {name: value for name, value in options.items() if value is not None}
        with writing(json) as document, stages() as progress, workers(scheduler):
            document["walks"] = rows = study.run(
                partial(progress, study.name), quick=quick, path=out, **chosen
            )
        print_tables(study.tables(rows), quick=quick)
        if figure is not None:
            study.figure(rows).savefig(figure)

    lacking = {
        "only": not study.only,
        "figure": study.draw is None,
        "scheduler": study.jobs is Study.jobs,
    }
    *parameters, _ = inspect.signature(command, eval_str=True).parameters.values()
    kept = [parameter for parameter in parameters if not lacking.get(parameter.name)]
    for name, text in study.options.items():
        default = study.defaults[name]
        within: dict[str, Any] = {"min": 0, "max": MOST} if isinstance(default, int) else {}
        text += f"  [default: {default}]" if default else ""
        option: Any = Annotated[
            type(default) | None, typer.Option(f"--{name}", help=text, **within)
        ]
        kept.append(
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option)
        )
    command.__signature__ = inspect.Signature(kept)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in kept}
    command.__name__, command.__doc__ = study.name, study.help
    return command
