"""Command line of the comparison."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from comparison.benchmark import LOW_FRICTION, SECTIONS, Settings, compare
from comparison.campaign.breaking import breaking_tables
from comparison.campaign.run import run_campaign
from comparison.campaign.settings import KINDS
from comparison.contenders import label
from comparison.delay import DelaySettings, delay_tables, walk_delays
from comparison.edge import EdgeSettings, edge_tables, walk_edge
from comparison.embedded import EmbeddedSettings, count_embedded, embedded_tables
from comparison.engines import engine_table, walk_engines
from comparison.ice import IceSettings, ice_tables, walk_ice
from comparison.peers.compare import compare_peers
from comparison.peers.environment import default_folder
from comparison.peers.environment import install as install_peers
from comparison.peers.peer_tables import peer_tables
from comparison.rates import RatesSettings, measure_rates, rates_tables
from comparison.report.answer import answer_of, passed
from comparison.report.contents import tables_of
from comparison.report.diff import changes_text, read_document
from comparison.report.files import write_report
from comparison.report.html import figures_of
from comparison.robots import RobotsSettings, robot_tables, stand_robots
from comparison.sections.grounds import count_walks, ground_tables, walk_grounds
from comparison.steering import SteeringSettings, steering_tables, walk_steering
from comparison.tables import Table
from harpy_pin.cli.ending import stopping
from harpy_pin.cli.faults import one_line_errors
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.files import check_writable, write_json

__all__ = ["app", "main"]


def _defaults(name: str) -> str:
    """A default of the campaign, and where it differs for a kind of campaign."""
    values = {kind: getattr(make(), name) for kind, make in KINDS.items()}
    other = [f"with --{kind} {value:g}" for kind, value in values.items() if value != values["plain"]]
    return ", ".join([f"{values['plain']:g}", *other])


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
        typer.Option("--out", metavar="DIR", help="Folder for report.html, results.json and .csv, campaign.jsonl."),
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
    hard: Annotated[
        bool, typer.Option("--hard", help="Wider ranges, noise and delay, from a seed that nothing was tuned on.")
    ] = False,
    wide: Annotated[
        bool,
        typer.Option(
            "--wide",
            help="All that --hard varies, and stiffness and damping of the ground, speed and engine. Needs MuJoCo.",
        ),
    ] = False,
    walks: Annotated[
        int | None,
        typer.Option(metavar="N", help=f"Number of walks.  [default: {_defaults('walks')}]", show_default=False),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help=f"Length of a walk, s.  [default: {_defaults('duration')}]", show_default=False)
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help=f"Seed of the scenarios.  [default: {_defaults('seed')}]", show_default=False)
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Address of a Dask scheduler whose workers were started in this checkout. By default the walks run in "
            "processes on this machine.",
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="File for the finished walks, one line of JSON each.")
    ] = Path("campaign.jsonl"),
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the summary, with 95 % intervals, to this file."),
    ] = None,
) -> None:
    """Walk every controller and governor through the same drawn scenarios.

    Scenarios vary the friction of the ground, lateral pushes, the body's mass and the friction that the controller
    assumes; --hard and --wide vary more, and more widely. At most one of --quick, --hard and --wide is given. The
    tables say who falls first, and on what, and how far the feet slip. Every finished walk is written to disk at once,
    so a campaign that was stopped continues when the same command is given again. Rows of other settings or other code
    in the file are ignored.
    """
    check_writable(out)
    if json is not None:
        check_writable(json)
    kinds = [name for name, chosen in (("quick", quick), ("hard", hard), ("wide", wide)) if chosen]
    if len(kinds) > 1:
        raise InputError("--quick, --hard and --wide exclude each other", name=f"--{kinds[-1]}")
    given = {"walks": walks, "duration": duration, "seed": seed}
    settings = KINDS[kinds[0] if kinds else "plain"](**{name: v for name, v in given.items() if v is not None})
    with _stage("campaign") as progress:
        summary = run_campaign(settings, out, scheduler=scheduler, progress=progress)
    if json is not None:
        write_json(json, summary)
    _print(breaking_tables(summary))


@app.command(epilog="Example:  python -m comparison grounds --json grounds.json")
@stopping
def grounds(
    quick: Annotated[bool, typer.Option("--quick", help="Walks of 1.5 s: a look, not to quote.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
    ] = None,
) -> None:
    """Walk every controller on grounds from 4 to 80 kN/m, and on MuJoCo's.

    Friction is 0.25 and 0.15. The tables show how far the feet slip, or when the robot fell. This takes some minutes.
    """
    if json is not None:
        check_writable(json)
    with _stage("grounds") as progress:
        done = count(1)
        rows = walk_grounds(duration=1.5 if quick else 6.0, on_walk=lambda: progress(next(done), count_walks()))
    if json is not None:
        write_json(json, {"walks": rows})
    _print(ground_tables(rows, label))


@app.command(epilog="Example:  python -m comparison engines")
@stopping
def engines(
    quick: Annotated[bool, typer.Option("--quick", help="Walks of 1.5 s: a look, not to quote.")] = False,
) -> None:
    """Walk every controller in both engines, and compare motion and forces tick by tick."""
    rows = walk_engines(duration=1.5 if quick else 6.0)
    for row in rows:
        row["walker"] = label(row["walker"])
    _print([engine_table(rows)])


@app.command(epilog="Example:  python -m comparison peers --install && python -m comparison peers --json peers.json")
@stopping
def peers(
    install: Annotated[
        bool, typer.Option("--install", help="Download and install the peers in their virtual environments, then exit.")
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder",
            metavar="DIR",
            help="Folder of these environments.  [default: in the user's cache]",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter walks and fewer repetitions.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
    friction: Annotated[float, typer.Option(help="Friction coefficient of walks and programs.")] = LOW_FRICTION,
) -> None:
    """Time other libraries' whole-body controllers and QP solvers on the same states as ours.

    placo and TSID need other versions of Pinocchio than this library: each runs in a virtual environment of its own,
    which --install makes once. Each is given our program and has to find our solution before its times count. A library
    that is not installed, fails, or finds another solution is reported without times.
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

    Slippery ground at two speeds, and pushes from four sides, for the condensed controller and the whole-body QP.
    """
    settings = EdgeSettings.quick() if quick else EdgeSettings()
    _walk_and_print(partial(walk_edge, settings), edge_tables, json)


@app.command(epilog="Example:  python -m comparison delay --json delay.json")
@stopping
def delay(
    quick: Annotated[bool, typer.Option("--quick", help="A few short walks: to see whether it works.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
    ] = None,
) -> None:
    """Walk with late and noisy measurements, beside the delays that a linear argument allows.

    The paper's joint PID, the leg law with feedforward, the condensed controller and the whole-body QP.
    """
    settings = DelaySettings.quick() if quick else DelaySettings()
    _walk_and_print(partial(walk_delays, settings), delay_tables, json)


@app.command(epilog="Example:  python -m comparison ice --json ice.json")
@stopping
def ice(
    quick: Annotated[bool, typer.Option("--quick", help="A few short walks: to see whether it works.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
    ] = None,
) -> None:
    """Walk over a strip of ice with and without an estimate of the friction.

    The condensed controller, the whole-body QP, the paper's governor and the contact-force filter, in both engines,
    with exact measurements and with noise and delay.
    """
    settings = IceSettings.quick() if quick else IceSettings()
    _walk_and_print(partial(walk_ice, settings), ice_tables, json)


@app.command(epilog="Example:  python -m comparison robots --only g1 --json g1.json")
@stopping
def robots(
    quick: Annotated[bool, typer.Option("--quick", help="Two robots and one push: to see whether it works.")] = False,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="ROBOT", help="This robot; may be given several times.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
) -> None:
    """Stand, shift the weight and push the robots that are known by name.

    Under the whole-body QP and the condensed controller, on compliant ground. Needs the extra "robots".
    """
    settings = RobotsSettings.quick() if quick else RobotsSettings()
    if only:
        settings = replace(settings, robots=tuple(only))
    _walk_and_print(partial(stand_robots, settings), robot_tables, json)


@app.command(epilog="Example:  python -m comparison steering --json steering.json")
@stopping
def steering(
    quick: Annotated[bool, typer.Option("--quick", help="A few short walks: to see whether it works.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
    ] = None,
) -> None:
    """Walk where commands say: a course, 200 random sequences, pushes, slippery ground and absurd commands.

    The condensed controller and the whole-body QP; the course and some of the sequences in MuJoCo, too. This takes many
    minutes.
    """
    settings = SteeringSettings.quick() if quick else SteeringSettings()
    _walk_and_print(partial(walk_steering, settings), steering_tables, json)


@app.command(epilog="Example:  python -m comparison embedded --json embedded.json")
@stopping
def embedded(
    quick: Annotated[bool, typer.Option("--quick", help="Harpy on one chip: to see whether it works.")] = False,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="ROBOT", help="This robot; may be given several times.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
) -> None:
    """Count what a tick costs on a microcontroller: instructions, flash, memory and stack.

    On a Cortex-M4F, M7 and M33 in QEMU: the paper's governor, that of the contact forces, the law, and the whole-body
    QP by its last active set and by DAQP's own C, for Harpy, Solo12 and Bolt on the same recorded states. Needs
    gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm; DAQP's source is fetched from its package.
    """
    settings = EmbeddedSettings.quick() if quick else EmbeddedSettings()
    if only:
        settings = replace(settings, robots=tuple(only))
    _walk_and_print(partial(count_embedded, settings), embedded_tables, json)


@app.command(epilog="Example:  python -m comparison rates --json rates.json")
@stopping
def rates(
    quick: Annotated[bool, typer.Option("--quick", help="Harpy alone, a few rounds.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
) -> None:
    """Measure how much this machine does in a second.

    Walks, environment steps and whole-body optima, and the law's tick inside C.
    """
    settings = RatesSettings.quick() if quick else RatesSettings()
    _walk_and_print(partial(measure_rates, settings), rates_tables, json)


@app.command(epilog="Example:  python -m comparison diff before.json after.json")
@stopping
def diff(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="The earlier result, a JSON file.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="The later result, a JSON file.")],
) -> None:
    """Compare two results: ratios of their medians, marked where their spreads do not overlap."""
    before, after = read_document(old), read_document(new)
    typer.echo(changes_text(before, after, Console().width))


def _walk_and_print(
    walk: Callable[[Callable[[int, int], None]], list[dict[str, Any]]],
    tables: Callable[[list[dict[str, Any]]], list[Table]],
    json: Path | None,
) -> None:
    """Walk under a bar, write every walk to a file that is known to be writable before, and print the tables."""
    if json is not None:
        check_writable(json)
    with _stage("walks") as progress:
        rows = walk(progress)
    if json is not None:
        write_json(json, {"walks": rows})
    _print(tables(rows))


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
def _stage(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for work in which nothing is timed; where the output is no terminal, lines."""
    if not sys.stderr.isatty():
        yield partial(_line_by_line(), what)
        return
    with _bars(auto_refresh=True) as bars:
        task = bars.add_task(what, total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


@contextmanager
def _stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage, drawn between pieces of work: a refreshing thread would wake up while the clock runs.

    Where the output is no terminal, a line says when a stage begins, and when it is done.
    """
    if not sys.stderr.isatty():
        yield _line_by_line()
        return
    tasks: dict[str, TaskID] = {}
    with _bars(auto_refresh=False) as bars:

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done)
            bars.refresh()

        yield progress


def _line_by_line() -> Callable[[str, int, int], None]:
    """Progress as lines on stderr."""
    begun: dict[str, float] = {}

    def progress(what: str, done: int, total: int) -> None:
        if what not in begun:
            begun[what] = perf_counter()
            typer.echo(f"{what}: 0 of {total}", err=True)
        if done == total:
            typer.echo(f"{what}: {done} of {total}, {perf_counter() - begun[what]:.1f} s", err=True)

    return progress


def main() -> None:
    """Run the command line; errors of the library become one line on stderr."""
    with one_line_errors("error", 1):
        sys.exit(app(prog_name="python -m comparison", standalone_mode=False))
