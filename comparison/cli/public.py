"""The command that measures what other people published, and writes what they may measure."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from comparison.cli.output import NumbersFile, print_tables, stages, writing
from comparison.public.data_set import record_problems, write_problems
from comparison.public.study import PublicSettings, measure_public, public_tables
from harpy_pin import checks
from harpy_pin.errors import InputError


def public(
    data: Annotated[
        Path | None, typer.Option("--data", metavar="DIR", help="Folder with your clones of the public repositories.")
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            "--export",
            metavar="PATH",
            help="Record whole-body programs and write them as a data set: a Parquet file if the name ends so, "
            "else a folder of .npz files.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few programs: to see whether it works.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the walks whose programs are recorded.")] = 0,
    json: NumbersFile = None,
) -> None:
    """Measure on benchmarks that no one here wrote.

    Reads clones of mpc_qpbenchmark and maros_meszaros_qpbenchmark, and says which is missing and how to get it. Our
    dual active-set method solves the programs beside quadprog, DAQP, PIQP, ProxQP and Clarabel, to the tolerances of
    qpbenchmark. With --export it writes programs of Harpy's walks instead, as qpbenchmark reads them. --data takes
    some minutes.
    """
    checks.whole("seed", seed)
    if (data is None) == (export is None):
        raise InputError(
            "either --data or --export is needed: a folder of clones, or where to write a data set", name="--data"
        )
    if export is not None:
        problems = record_problems(4 if quick else 200, duration=1.0 if quick else 6.0, seed=seed)
        write_problems(export, problems)
        typer.echo(f"{len(problems)} programs written to '{export}'")
        return
    assert data is not None
    settings = PublicSettings.quick() if quick else PublicSettings()
    with writing(json) as document, stages() as progress:
        document |= measure_public(settings, data, partial(progress, "public"))
    print_tables(public_tables(document))
