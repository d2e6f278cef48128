"""The command that walks drawn scenarios."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.campaign.exceptions import exceptions_table, with_reasons
from comparison.campaign.execute import run_campaign
from comparison.campaign.plan import plan
from comparison.campaign.settings import KINDS, QUICK
from comparison.campaign.summary import variants_table
from comparison.cli.output import NumbersFile, print_tables, stages, writing
from harpy_pin import checks
from harpy_pin.files import check_writable


def campaign(
    kind: Annotated[str, typer.Argument(metavar="KIND", help=f"One of {', '.join(KINDS)}.")] = "plain",
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer and shorter walks: a look in under half a minute.")
    ] = False,
    joint_damping: Annotated[
        float | None,
        typer.Option(
            metavar="D",
            help="Damping of every joint, N·m·s/rad, known to the controllers; the authors' own model has 5.  "
            "[default: 0.1]",
        ),
    ] = None,
    walks: Annotated[int | None, typer.Option(metavar="N", help="Number of walks.  [default: by kind]")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of a walk, s.  [default: 5]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the scenarios.  [default: by kind]")] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="File for the finished walks, one line of JSON each.")
    ] = Path("campaign.jsonl"),
    json: NumbersFile = None,
) -> None:
    """Walk every controller and governor through drawn scenarios.

    All walk the same ones.
    Scenarios vary the friction of the ground, lateral pushes, the body's mass and the friction that the controller
    assumes. "wide": wider ranges, noise, delay, ice, stiffness and damping of the ground, speed and engine, from a seed
    that nothing was tuned on. "variants": the same scenarios, walked by every variant of the paper's governor and by
    what it is compared with, with published settings and with those that "tune" found. "harsh": what "wide" varies,
    joint damping, weak and slow motors, and MuJoCo's default contact; every variant walks, too, with the same torque
    limits. All but "plain" need MuJoCo. Every finished walk is written to disk at once, so a campaign that was stopped
    continues when the same command is given again. Rows of other settings or other code in the file are ignored.
    """
    checks.one_of("kind", kind, KINDS)
    check_writable(out)
    damped = None if joint_damping is None else (joint_damping,)
    given: dict[str, Any] = {"walks": walks, "duration": duration, "seed": seed, "joint_dampings": damped}
    changes = (QUICK if quick else {}) | {name: value for name, value in given.items() if value is not None}
    settings = KINDS[kind](**changes)
    with writing(json) as summary, stages() as progress:
        summary |= run_campaign(settings, out, progress=partial(progress, "campaign"))
        if kind == "harsh":
            again = partial(progress, "reasons")
            summary["exceptions"] = with_reasons(summary["exceptions"], plan(settings), out, progress=again)
    print_tables([variants_table(summary), *([exceptions_table(summary)] if kind == "harsh" else [])])
