"""The command that tunes every contender in the same way."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from comparison.cli.output import print_tables, stages, writing
from comparison.tuning.tune import TuneSettings, tuning_tables
from comparison.tuning.tune import tune as search_settings
from comparison.tuning.variants import VARIANTS
from harpy_pin.files import check_writable


def tune(
    budget: Annotated[
        int, typer.Option(metavar="N", help="Settings that each variant gets, the published ones among them.")
    ] = TuneSettings.budget,
    train: Annotated[int, typer.Option(metavar="N", help="Walks of each setting.")] = TuneSettings.train,
    judge: Annotated[
        int, typer.Option(metavar="N", help="Walks, apart from those, of the published and of the best settings.")
    ] = TuneSettings.judge,
    duration: Annotated[float, typer.Option(help="Length of a walk, s.")] = TuneSettings.duration,
    joint_damping: Annotated[
        float,
        typer.Option(
            metavar="D",
            help="Damping of every joint, N·m·s/rad, known to the controllers; the authors' own model has 5.",
        ),
    ] = TuneSettings.joint_damping,
    seed: Annotated[int, typer.Option(help="Seed of the proposed settings.")] = TuneSettings.seed,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="VARIANT", help=f"This one; may be given several times: {', '.join(VARIANTS)}."),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="File for the tried settings, one line of JSON each.")
    ] = Path("tune.jsonl"),
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write settings and scores to this file.")
    ] = None,
) -> None:
    """Search settings of every variant of the paper's governor.

    And of what it is compared with.
    Each variant gets the same number of settings: the published ones, random ones, then changes of the best so far.
    Governed variants also try the gains that were found without a governor.
    Fewest falls come first; among equals the least mean of log(1 + slip in mm per step) + tracking error in metres
    decides. The walks are drawn as those of the wide campaign, from other seeds; what is found is judged on further
    walks. Every tried setting is written to disk at once, so a search that was stopped continues when the same command
    is given again. --budget 20 --train 12 --judge 24 takes minutes, the default an hour or more. Needs MuJoCo.
    """
    check_writable(out)
    settings = TuneSettings(
        budget=budget,
        train=train,
        judge=judge,
        duration=duration,
        joint_damping=joint_damping,
        seed=seed,
        variants=tuple(only) if only else TuneSettings.variants,
    )
    with writing(json) as document, stages() as progress:
        document |= search_settings(settings, out, partial(progress, "settings"))
    print_tables(tuning_tables(document))
