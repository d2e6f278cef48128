"""The comparison itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.benchmark import SECTIONS, Settings, compare
from comparison.cli.output import NumbersFile, stages
from comparison.report.answer import answer_of, passed
from comparison.report.contents import tables_of
from comparison.report.html import figures_of, write_report
from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, write_json


def whole(
    context: typer.Context,
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter walks and fewer repetitions: a look in under two minutes.")
    ] = False,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Folder for report.html, results.json and .csv, campaign.jsonl."),
    ] = Path("out/comparison"),
    json: NumbersFile = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Also save the figures there (pareto.png, ...).")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the pushes and of the order in which controllers are timed.")] = 0,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the walks whose states are timed.")] = 0.25,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 6, with --quick 2]", show_default=False)
    ] = None,
) -> None:
    """Compare reference governors, the condensed controller and a QP whole-body controller.

    Walks of the same robot are recorded. Their states are then replayed through every controller and timed: the
    complete tick, its phases, isolated governor updates and isolated solves. Every timed command is checked against an
    untimed one. Then every controller walks a campaign of randomly drawn scenarios. The command prints its answer:
    which controllers keep the feet from slipping, and what a tick costs. One HTML page has all tables and figures, what
    was checked, and the limitations; JSON and CSV files have every number.

    The full run takes some minutes. Do not use the machine for other work meanwhile: other processes change the medians
    little, but the tails a lot. Walks of the campaign that an earlier run of the same code left in the folder are not
    repeated.
    """
    if context.invoked_subcommand is not None:
        return
    if json is not None:
        check_writable(json)
    given: dict[str, Any] = {"friction": friction, "seed": seed}
    if duration is not None:
        given["duration"] = duration
    settings = Settings.quick(**given) if quick else Settings(**given)
    for folder in (out, figures):
        if folder is not None:
            _make_folder(folder)
    with stages() as progress:
        document = compare(settings, progress, sections=tuple(SECTIONS), rows=out / "campaign.jsonl")
    if json is not None:
        write_json(json, document)
    write_report(out, document)
    if figures is not None:
        for name, figure in figures_of({table.name: table for table in tables_of(document)}).items():
            figure.savefig(figures / f"{name}.png")
    answer = answer_of(document)
    assert answer is not None, "all sections are asked for"
    typer.echo(answer.to_string(out / "report.html"))
    if not passed(document):
        typer.echo("error: a timed command was not what it should be; do not use these times", err=True)
        raise typer.Exit(1)


def _make_folder(folder: Path) -> None:
    """Make a folder, and find out now whether it can be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot make the folder '{folder}': {error.strerror or error}", path=folder) from error
    check_writable(folder / "report.html")
