"""The commands ``python -m reproduction paper`` and ``python -m reproduction vlip``: the paper's simulations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from harpy_pin import checks
from harpy_pin.cli.output import JsonOption, console, stderr, values_table
from harpy_pin.files import check_writable, write_json

__all__ = ["paper", "vlip"]


def paper(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the report; made if it is not there.")],
    duration: Annotated[float, typer.Option(help="Length of each 3D walk, s.")] = 10.0,
) -> None:
    """Reproduce the paper: both simulations, every claim with a verdict and a number, and the figures.

    Writes DIR/report.html (one self-contained page), DIR/numbers.json and DIR/figures/*.pdf. Exit code 0 only if every
    number was produced.
    """
    checks.ticks(checks.number("duration", duration, low=0.1), 1e-3)
    from harpy_pin.model.robot import load_harpy
    from reproduction.report import prepare_folder, reproduce, write_report

    prepare_folder(out)
    with stderr.status("preparing") as status:
        result = reproduce(load_harpy(), duration=duration, on_stage=lambda stage: status.update(f"{stage} …"))
    table = Table("", "gait", "verdict", "number", title="Claims of the paper")
    for finding in result.findings:
        table.add_row(finding.claim.key, finding.setting, str(finding.verdict), finding.number)
    console.print(table)
    try:
        page = write_report(result, out)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; what '{out}' holds may be of two runs") from None
    console.print(f"report: {page}", markup=False, highlight=False)


def vlip(
    governor: Annotated[str, typer.Option(help="Governor: none, paper or margin.")] = "paper",
    evaluate_at: Annotated[
        str,
        typer.Option(
            help="Where the paper's governor evaluates its constraints: measured (state) or tracked (reference)."
        ),
    ] = "tracked",
    start: Annotated[
        str,
        typer.Option(
            help="Start state: paper (on the target, which violates the constraints) or inside (the friction cone)."
        ),
    ] = "paper",
    coordinates: Annotated[
        str, typer.Option(help="Coordinates of the governed reference: polar (θ, φ, l) or cartesian.")
    ] = "polar",
    mass: Annotated[float, typer.Option(help="Mass, kg.")] = 4.0,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the constraints.")] = 0.45,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 4.0,
    dt: Annotated[float, typer.Option(help="Control and integration step, s.")] = 1e-3,
    json: JsonOption = None,
) -> None:
    """Run the paper's first simulation: a point mass on a variable-length leg (VLIP) under its thruster law.

    \b
    python -m reproduction vlip --governor none
    python -m reproduction vlip --evaluate-at tracked --start inside
    python -m reproduction vlip --governor margin --start inside
    """
    from harpy_pin.governors.rows import EVALUATE_AT
    from reproduction.vlip_simulation import (
        COORDINATES,
        STARTS,
        VLIP_GOVERNORS,
        VlipParameters,
        simulate_vlip,
        vlip_governor,
        vlip_setting,
    )

    checks.one_of("governor", governor, VLIP_GOVERNORS)
    checks.one_of("evaluate_at", evaluate_at, EVALUATE_AT)
    checks.one_of("start", start, STARTS)
    checks.one_of("coordinates", coordinates, COORDINATES)
    if json is not None:
        check_writable(json)
    parameters = VlipParameters(
        mass=mass,
        mu=friction,
        duration=duration,
        dt=dt,
        coordinates="polar" if coordinates == "polar" else "cartesian",
        start="inside" if start == "inside" else "paper",
    )
    parameters = vlip_setting(governor, parameters)
    chosen = vlip_governor(parameters, name=governor, evaluate_at="tracked" if evaluate_at == "tracked" else "measured")
    summary = simulate_vlip(chosen, parameters).summary().as_dict()
    title = f"VLIP, governor {governor}" + (f" ({evaluate_at})" if governor == "paper" else "")
    console.print(values_table(title, summary))
    if json is not None:
        write_json(json, summary)
