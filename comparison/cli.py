"""Command line of the comparison."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from comparison.benchmark import LOW_FRICTION, SECTIONS, Settings, compare
from comparison.campaign.plan import CampaignSettings
from comparison.campaign.run import run_campaign
from comparison.campaign.summary import summary_tables
from comparison.edge import EdgeSettings, edge_tables, walk_edge
from comparison.peers.compare import compare_peers
from comparison.peers.environment import default_folder
from comparison.peers.environment import install as install_peers
from comparison.peers.summary import peer_tables
from comparison.report.answer import answer_of, passed
from comparison.report.contents import tables_of
from comparison.report.diff import changes_text, read_document
from comparison.report.files import write_report
from comparison.report.html import figures_of
from comparison.report.tables import Table
from harpy_pin.cli.ending import stopping
from harpy_pin.cli.faults import one_line_errors
from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, write_json

__all__ = ["app", "main"]

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback(invoke_without_command=True, epilog="Example:  python -m comparison --quick --out out/quick")
@stopping
def run(
    context: typer.Context,
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter walks and fewer repetitions: a look in under two minutes.")
    ] = False,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Where report.html, results.json, results.csv, campaign.jsonl go."),
    ] = Path("out/comparison"),
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="DIR", help="Also save the figures there (pareto.png, ...).")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the pushes and of the order in which controllers are timed.")] = 0,
    friction: Annotated[
        float, typer.Option(help="Friction coefficient of the main condition. The paper's 0.25 is always added.")
    ] = 0.8,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 6, with --quick 2]", show_default=False)
    ] = None,
) -> None:
    """Compare the explicit reference governor with a QP whole-body controller.

    Both controllers walk the same robot; the states of both walks are then replayed, the same for both, and timed:
    the complete tick, its phases, and the governor and the solver alone. Every timed command is checked against an
    untimed one. Then every governor walks a campaign of drawn scenarios. Printed is the answer: who holds the feet, and
    what a tick costs. All tables and figures, what was checked, and what the numbers do not say are written as one HTML
    page, and every number as JSON and as CSV.

    The full run takes several minutes; the very first one compiles for a minute more. Leave the machine alone
    meanwhile: the medians forgive company, the tails do not. Campaign walks that an earlier run of the same code kept
    in the folder are not walked again.
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
    with _stages() as progress:
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


@app.command(epilog="Example:  python -m comparison campaign --quick --out campaign.jsonl")
@stopping
def campaign(
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer and shorter walks: a look in under half a minute.")
    ] = False,
    walks: Annotated[
        int | None, typer.Option(metavar="N", help="Walks in all.  [default: 360, with --quick 54]", show_default=False)
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 5, with --quick 2.5]", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the scenarios.")] = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Of a Dask scheduler whose workers were started in this checkout; a cluster of processes on this "
            "machine by default.",
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="Where finished walks are kept, one JSON line each.")
    ] = Path("campaign.jsonl"),
) -> None:
    """Walk every controller and governor through the same drawn scenarios.

    Scenarios vary friction, lateral pushes, the body's mass and what the controller believes of the friction. Every
    finished walk is on disk before the next is awaited: a campaign that was stopped, however it was, goes on where it
    was when the same command is given again. Rows of other settings or other code in the file are left aside.
    """
    check_writable(out)
    changes: dict[str, float | int] = {"seed": seed}
    if walks is not None:
        changes["walks"] = walks
    if duration is not None:
        changes["duration"] = duration
    settings = CampaignSettings.quick(**changes) if quick else CampaignSettings(**changes)  # type: ignore[arg-type]
    with _bars(auto_refresh=True) as bars:
        task = bars.add_task("campaign", total=None)
        summary = run_campaign(
            settings,
            out,
            scheduler=scheduler,
            progress=lambda done, total: bars.update(task, completed=done, total=total),
        )
    _print(summary_tables(summary))


@app.command(epilog="Example:  python -m comparison peers --install && python -m comparison peers --json peers.json")
@stopping
def peers(
    install: Annotated[
        bool, typer.Option("--install", help="Make the peers' virtual environments (downloads them), and end.")
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder",
            metavar="DIR",
            help="Where these environments are.  [default: in the user's cache]",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter walks and fewer repetitions.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
    friction: Annotated[float, typer.Option(help="Friction coefficient of walks and programs.")] = LOW_FRICTION,
) -> None:
    """Time whole-body controllers and QP solvers of others on the same states as ours.

    placo and TSID need other versions of Pinocchio than this library: each runs in a virtual environment of its own,
    made once by --install. Each is given our program and has to find our solution before its times count; who is not
    installed, breaks or finds something else is reported as such.
    """
    folder = default_folder() if folder is None else folder
    if install:
        outcome = install_peers(folder, lambda text: typer.echo(text, err=True))
        for name, reason in outcome.items():
            typer.echo(f"{name}: {reason or 'installed'}")
        if any(outcome.values()):
            raise typer.Exit(1)
        return
    if json is not None:
        check_writable(json)
    settings = Settings.quick(low_friction=friction) if quick else Settings(low_friction=friction)
    with _stages() as progress:
        document = compare_peers(settings, progress, folder=folder)
    if json is not None:
        write_json(json, document)
    _print(peer_tables(document["peers"]))


@app.command(epilog="Example:  python -m comparison edge --json edge.json")
@stopping
def edge(
    quick: Annotated[bool, typer.Option("--quick", help="A dozen short walks: to see whether it works.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
    ] = None,
) -> None:
    """Walk with and without the governor of the command, where walks begin to fall.

    Slippery ground at two speeds, and pushes from four sides, for the explicit law and the whole-body QP.
    """
    if json is not None:
        check_writable(json)
    with _bars(auto_refresh=True) as bars:
        task = bars.add_task("walks", total=None)
        rows = walk_edge(
            EdgeSettings.quick() if quick else EdgeSettings(),
            lambda done, total: bars.update(task, completed=done, total=total),
        )
    if json is not None:
        write_json(json, {"walks": rows})
    _print(edge_tables(rows))


@app.command(epilog="Example:  python -m comparison diff before.json after.json")
@stopping
def diff(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="A result in JSON.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another.")],
) -> None:
    """Compare two results: ratios of medians, marked where their spreads do not overlap."""
    before, after = read_document(old), read_document(new)
    typer.echo(changes_text(before, after, Console().width))


def _print(tables: Iterable[Table]) -> None:
    """Print tables one below the other, as wide as the terminal."""
    width = Console().width
    typer.echo("\n".join(table.to_string(width) for table in tables))


def _make_folder(folder: Path) -> None:
    """Make a folder, and find out now whether it can be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot make the folder '{folder}': {error.strerror or error}", path=folder) from error
    check_writable(folder / "report.html")


def _bars(*, auto_refresh: bool) -> Bars:
    """Progress bars on stderr."""
    return Bars(
        TextColumn("{task.description:<8}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        auto_refresh=auto_refresh,
        transient=True,
        disable=not sys.stderr.isatty(),
    )


@contextmanager
def _stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage, drawn between pieces of work: a refreshing thread would wake up while the clock runs."""
    tasks: dict[str, TaskID] = {}
    with _bars(auto_refresh=False) as bars:

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done)
            bars.refresh()

        yield progress


def main() -> None:
    """Run the command line; errors of the library become one line on stderr."""
    with one_line_errors("error", 1):
        app(prog_name="python -m comparison")
