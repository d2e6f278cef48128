"""The commands that are not studies: the comparison itself, campaigns, the search for settings,
other libraries.
"""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.benchmark import FRICTION, Settings, compare
from comparison.campaign.cluster import workers
from comparison.campaign.plan import KINDS, QUICK, CampaignSettings, plan
from comparison.campaign.summary import variants_table
from comparison.campaign.walks import exceptions_table, run_campaign, with_reasons
from comparison.cli.output import (
    NO_EVIDENCE,
    FigureFile,
    NumbersFile,
    Quick,
    Scheduler,
    print_tables,
    stages,
    writing,
)
from comparison.contenders import VARIANTS
from comparison.peers.compare import (
    QUICK_CASES,
    QUICK_RECORDING,
    RECORDING,
    compare_peers,
    peer_tables,
    unanswered,
)
from comparison.peers.environment import PEERS, WORLDS, default_folder
from comparison.peers.environment import install as install_peer
from comparison.report.answer import answer_of, passed
from comparison.report.figures import pareto_figure
from comparison.report.report import pareto_table, write_report
from comparison.tuning.tune import TuneSettings, tuning_tables
from comparison.tuning.tune import tune as search_settings
from harpy_pin import checks
from harpy_pin.cli.output import Force
from harpy_pin.files import OwnFolder, check_writable


def whole(
    context: typer.Context,
    quick: Quick = False,
    out: Annotated[
        str,
        typer.Option(
            "--out", metavar="DIR", help="Folder for results.json and .csv, campaign.jsonl."
        ),
    ] = "out/comparison",
    force: Force = False,
    json: NumbersFile = None,
    figure: FigureFile = None,
    seed: Annotated[
        int,
        typer.Option(help="Seed of the pushes and of the order in which controllers are timed."),
    ] = 0,
    friction: Annotated[
        float, typer.Option(help="Friction coefficient of the walks whose states are timed.")
    ] = 0.25,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 6, with --quick 2]")
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Compare reference governors, the condensed controller and a QP whole-body controller.

    Walks of the same robot are recorded. Their states are then replayed and timed: the complete
    tick of every controller, governor updates alone and solves alone. Every timed command is
    checked against an untimed one. Then every controller walks a campaign of
    randomly drawn scenarios. The command prints its answer: which controllers keep the feet from
    slipping, and what a tick costs. A CSV file has the numbers of all tables, a JSON file also what
    was checked, and the limitations.

    The full run takes some minutes. Do not use the machine for other work meanwhile: other
    processes change the medians little, but the tails a lot. Walks of the campaign that an earlier
    run of the same code left in the folder are not repeated.
    """
    if context.invoked_subcommand is not None:
        return
    given: dict[str, Any] = {"friction": friction, "seed": seed}
    given |= {} if duration is None else {"duration": duration}
    settings = Settings.quick(**given) if quick else Settings(**given)
    folder = OwnFolder(out, force=force)
    if figure is not None:
        check_writable(figure)
    with writing(json) as document, stages() as progress, workers(scheduler):
        document |= compare(settings, progress, rows=folder.place("campaign.jsonl"))
    write_report(folder, document)
    if figure is not None:
        pareto_figure(pareto_table(document)).savefig(figure)
    typer.echo(
        answer_of(document).to_string(folder.path / "results.csv")
        + (f"\n{NO_EVIDENCE}" if quick else "")
    )
    if not passed(document):
        typer.echo(
            "error: a timed command was not what it should be; do not use these times", err=True
        )
        raise typer.Exit(1)


_DAMPING = (
    "Damping of every joint, N·m·s/rad, known to the controllers; the authors' own model has 5."
)


def campaign(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help=f"One of {', '.join(KINDS)}.")
    ] = "plain",
    quick: Quick = False,
    joint_damping: Annotated[
        float | None, typer.Option(metavar="D", help=f"{_DAMPING}  [default: 0.1]")
    ] = None,
    walks: Annotated[
        int | None, typer.Option(metavar="N", help="Number of walks.  [default: by kind]")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 5]")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of the scenarios.  [default: by kind]")
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FILE", help="File for the finished walks, one line of JSON each."
        ),
    ] = Path("campaign.jsonl"),
    json: NumbersFile = None,
    scheduler: Scheduler = None,
) -> None:
    """Walk every controller and governor through drawn scenarios.

    All walk the same ones.
    Scenarios vary the friction of the ground, lateral pushes, the body's mass and the friction that
    the controller assumes. "wide": wider ranges, noise, delay, ice, stiffness and damping of the
    ground, speed and engine, from a seed that nothing was tuned on. "variants": the same scenarios,
    walked by every variant of the paper's governor and by what it is compared with, with published
    settings and with those that "tune" found. "harsh": what "wide" varies, joint damping, weak and
    slow motors, and MuJoCo's default contact; every variant walks, too, with the same torque
    limits. Every finished walk is written to disk at once, so a
    campaign that was stopped continues when the same command is given again. Rows of other settings
    or other code in the file are ignored.
    """
    checks.one_of("kind", kind, KINDS)
    check_writable(out)
    damped = None if joint_damping is None else (joint_damping,)
    given: dict[str, Any] = {
        "walks": walks,
        "duration": duration,
        "seed": seed,
        "joint_dampings": damped,
    }
    given = {name: value for name, value in given.items() if value is not None}
    settings = CampaignSettings.of(kind, **((QUICK if quick else {}) | given))
    with writing(json) as summary, stages() as progress, workers(scheduler):
        summary |= run_campaign(settings, out, progress=partial(progress, "campaign"))
        if kind == "harsh":
            again = partial(progress, "reasons")
            summary["exceptions"] = with_reasons(
                summary["exceptions"], plan(settings), out, progress=again
            )
    print_tables(
        [variants_table(summary), *([exceptions_table(summary)] if kind == "harsh" else [])],
        quick=quick,
    )


def tune(
    budget: Annotated[
        int,
        typer.Option(
            metavar="N", help="Settings that each variant gets, the published ones among them."
        ),
    ] = TuneSettings.budget,
    train: Annotated[
        int, typer.Option(metavar="N", help="Walks of each setting.")
    ] = TuneSettings.train,
    judge: Annotated[
        int,
        typer.Option(
            metavar="N", help="Walks, apart from those, of the published and of the best settings."
        ),
    ] = TuneSettings.judge,
    duration: Annotated[float, typer.Option(help="Length of a walk, s.")] = TuneSettings.duration,
    joint_damping: Annotated[
        float, typer.Option(metavar="D", help=_DAMPING)
    ] = TuneSettings.joint_damping,
    seed: Annotated[int, typer.Option(help="Seed of the proposed settings.")] = TuneSettings.seed,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="VARIANT",
            help=f"This one; may be given several times: {', '.join(VARIANTS)}.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FILE", help="File for the tried settings, one line of JSON each."
        ),
    ] = Path("tune.jsonl"),
    json: NumbersFile = None,
) -> None:
    """Search settings of every variant of the paper's governor.

    And of what it is compared with.
    Each variant gets the same number of settings: the published ones, random ones, then changes of
    the best so far. Governed variants also try the gains that were found without a governor.
    Fewest falls come first; among equals the least mean of log(1 + slip in mm per step) + tracking
    error in metres decides. The walks are drawn as those of the wide campaign, from other seeds;
    what is found is judged on further walks. Every tried setting is written to disk at once, so a
    search that was stopped continues when the same command is given again. --budget 20 --train
    12 --judge 24 takes minutes, the default an hour or more.
    """
    check_writable(out)
    who = tuple(only) if only else TuneSettings.variants
    settings = TuneSettings(
        budget=budget,
        train=train,
        judge=judge,
        duration=duration,
        joint_damping=joint_damping,
        seed=seed,
        variants=who,
    )
    with writing(json) as document, stages() as progress:
        document |= search_settings(settings, out, partial(progress, "settings"))
    print_tables(tuning_tables(document))


def peers(
    install: Annotated[
        bool,
        typer.Option(
            "--install",
            help="Install the peers in environments of their own, then exit: with 1 if one cannot "
            "be.",
        ),
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of these environments.  [default: in the user's cache]"
        ),
    ] = None,
    quick: Quick = False,
    json: NumbersFile = None,
    friction: Annotated[
        float, typer.Option(help="Friction coefficient of Harpy's ground.")
    ] = FRICTION,
) -> None:
    """Time other libraries' controllers on our program.

    Robots stand and are pushed, and walk. Their states, and what our controllers ask for at each,
    are handed to placo and TSID, which need other versions of Pinocchio than this library: each
    runs in a virtual environment of its own, which --install makes once. A contender has to find
    the solution before its times count; one that does not, or fails, makes the command end with
    exit code 1, after all tables. This takes some minutes.
    """
    folder = default_folder() if folder is None else folder
    if install:
        _install(folder)
        return
    settings = Settings.quick(friction=friction) if quick else Settings(friction=friction)
    duration, only = (QUICK_RECORDING, QUICK_CASES) if quick else (RECORDING, None)
    with writing(json) as document, stages() as progress:
        document |= compare_peers(
            progress, friction, duration=duration, timing=settings.timing, folder=folder, only=only
        )
    print_tables(peer_tables(document["peers"]), quick=quick)
    wrong = unanswered(document["peers"])
    if wrong:
        typer.echo("\n".join(["error: no times for", *wrong]), err=True)
        raise typer.Exit(1)


def _install(folder: Path) -> None:
    """Install every peer, and say of each how it ended."""
    failed = False
    for name in (*PEERS, WORLDS.name):
        typer.echo(f"{name}: installing in {folder / name.lower()}", err=True)
        reason = install_peer(folder, name)
        typer.echo(f"{name}: {f'cannot be installed: {reason}' if reason else 'installed'}")
        failed |= bool(reason)
    if failed:
        raise typer.Exit(1)
