"""The command that walks drawn scenarios."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.campaign.exceptions import exceptions_table, with_reasons
from comparison.campaign.execute import run_campaign
from comparison.campaign.plan import plan
from comparison.campaign.settings import KINDS
from comparison.campaign.summary import variants_table
from comparison.cli.output import print_tables, stages, writing
from harpy_pin.errors import InputError
from harpy_pin.files import check_writable


def _defaults(name: str) -> str:
    """A default of the campaign, and where it differs for a kind of campaign."""
    values = {kind: getattr(make(), name) for kind, make in KINDS.items()}
    other = [f"with --{kind} {value:g}" for kind, value in values.items() if value != values["plain"]]
    return ", ".join([f"{values['plain']:g}", *other])


def campaign(
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer and shorter walks: a look in under half a minute.")
    ] = False,
    wide: Annotated[
        bool,
        typer.Option(
            "--wide",
            help="Wider ranges, noise, delay, ice, stiffness and damping of the ground, speed and engine, from a seed "
            "that nothing was tuned on. Needs MuJoCo.",
        ),
    ] = False,
    variants: Annotated[
        bool,
        typer.Option(
            "--variants",
            help="The scenarios of --wide, walked by every variant of the paper's governor and by what it is compared "
            "with, with published settings and with those that 'tune' found. Needs MuJoCo.",
        ),
    ] = False,
    harsh: Annotated[
        bool,
        typer.Option(
            "--harsh",
            help="All that --wide varies, joint damping, weak and slow motors, and MuJoCo's default contact; every "
            "variant of the paper's governor walks, too. All have the same torque limits. Needs MuJoCo.",
        ),
    ] = False,
    joint_damping: Annotated[
        float | None,
        typer.Option(
            metavar="D",
            help="Damping of every joint, N·m·s/rad, known to the controllers; the authors' own model has 5.  "
            "[default: 0.1]",
            show_default=False,
        ),
    ] = None,
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
    """Walk every controller and governor through drawn scenarios.

    All walk the same ones.
    Scenarios vary the friction of the ground, lateral pushes, the body's mass and the friction that the controller
    assumes; --wide and --harsh vary more, and more widely. At most one of --quick, --wide, --variants and --harsh is
    given. The tables say who falls first, and on what, and how far the feet slip. Every finished walk is
    written to disk at once, so a campaign that was stopped continues when the same command is given again. Rows of
    other settings or other code in the file are ignored.
    """
    check_writable(out)
    chosen_kinds = (("quick", quick), ("wide", wide), ("variants", variants), ("harsh", harsh))
    kinds = [name for name, chosen in chosen_kinds if chosen]
    if len(kinds) > 1:
        raise InputError("--quick, --wide, --variants and --harsh exclude each other", name=f"--{kinds[-1]}")
    damped = None if joint_damping is None else (joint_damping,)
    given: dict[str, Any] = {"walks": walks, "duration": duration, "seed": seed, "joint_dampings": damped}
    settings = KINDS[kinds[0] if kinds else "plain"](**{name: v for name, v in given.items() if v is not None})
    with writing(json) as summary, stages() as progress:
        summary |= run_campaign(settings, out, scheduler=scheduler, progress=partial(progress, "campaign"))
        if harsh:
            again = partial(progress, "reasons")
            found = with_reasons(summary["exceptions"], plan(settings), out, scheduler=scheduler, progress=again)
            summary["exceptions"] = found
    print_tables([variants_table(summary), *([exceptions_table(summary)] if harsh else [])])
