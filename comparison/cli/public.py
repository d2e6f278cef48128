"""The command that measures what other people published."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from comparison.cli.output import NumbersFile, print_tables, stages, writing
from comparison.public.study import measure_public, public_tables


def public(
    data: Annotated[Path, typer.Option("--data", metavar="DIR", help="Folder with your clones of the repositories.")],
    quick: Annotated[bool, typer.Option("--quick", help="A few programs: to see whether it works.")] = False,
    json: NumbersFile = None,
) -> None:
    """Measure on benchmarks that no one here wrote.

    Reads clones of mpc_qpbenchmark and maros_meszaros_qpbenchmark, and says which is missing and how to get it. Our
    dual active-set method solves the programs beside quadprog, DAQP, PIQP, ProxQP and Clarabel, to the tolerances of
    qpbenchmark. This takes some minutes.
    """
    how = {"problems": 6, "repetitions": 1} if quick else {}
    with writing(json) as document, stages() as progress:
        document |= measure_public(data, partial(progress, "public"), **how)
    print_tables(public_tables(document))
