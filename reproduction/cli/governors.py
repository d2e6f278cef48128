"""The command ``python -m reproduction governors``: every governor on the same walks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from harpy_pin import checks
from harpy_pin.cli.output import JsonOption, check_figure, stderr
from harpy_pin.files import check_outputs, replacing, write_json

__all__ = ["governors"]

FRICTIONS = (0.2, 0.15, 0.1)
PUSHES = (2.0, 5.0, -5.0)
DIVISORS = (1, 2, 4)
WIDTH = 120
"""Columns of the tables where the output is no terminal."""
WALK = ("slip mm/step", "late slip", "sliding", "< 20 N", "speed m/s", "thrust max N", "thrust rms N", "fell at s")
FORCE = (
    "demanded: violated",
    "worst late N",
    "model: violated",
    "worst N",
    "x_w − x_r mm",
    "reversals/s",
    "m/s of x_w",
    "max rate m/s",
)


def governors(
    duration: Annotated[float, typer.Option(help="Length of each walk, s.")] = 20.0,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the first table.")] = 0.25,
    gait: Annotated[str, typer.Option(help="Gait of the walks.")] = "hand",
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also draw slip over friction (PNG, PDF or SVG).")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Compare all governors, and the whole-body QP, on the same walks.

    Prints slip, contact forces and references of each at one friction coefficient; slip and falls on slippery ground
    and under lateral pushes; how much the applied reference chatters at shorter control periods; and the error of the
    predicted force of feet that stick.
    """
    from harpy_pin.model.robot import load_harpy
    from reproduction.study import METHODS, WBC, WalkResult, evaluate, prediction_error, vlip_study, walk_method

    checks.ticks(checks.number("duration", duration, low=0.5), 1e-3 / max(DIVISORS))
    checks.number("friction", friction, low=0.0, high=checks.MAX_FRICTION)
    check_figure(figure)
    check_outputs({"--figure": figure, "--json": json})
    robot = load_harpy()
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH)
    jobs: list[dict[str, Any]] = [{"friction": friction, "method": name} for name in METHODS]
    jobs += [{"friction": mu, "method": name} for mu in FRICTIONS for name in METHODS]
    jobs += [
        {"friction": mu, "method": name, "push": push}
        for mu in (friction, FRICTIONS[1])
        for push in PUSHES
        for name in METHODS
        if duration > 4.0
    ]
    results: list[WalkResult] = [
        evaluate(robot, walk_method(gait=gait, duration=duration, **job))
        for job in track(jobs, description="walking", console=stderr, transient=True, disable=not stderr.is_terminal)
    ]
    chattering = {
        (name, divide): evaluate(
            robot, walk_method(name, friction=friction, gait=gait, duration=duration, period=1e-3 / divide, dt=2.5e-4)
        )
        for name in METHODS
        if name != WBC
        for divide in DIVISORS
    }
    first = results[: len(METHODS)]
    models = vlip_study()
    console.print(_models(models))
    console.print(_table(f"Walk of {duration:g} s at friction {friction:g}", WALK, first, _walked))
    console.print(_table(f"Forces and reference, friction {friction:g}", FORCE, first, _forces))
    rest = results[len(METHODS) :]
    console.print(_table("Slippery ground, and lateral pushes in N·s", WALK, rest, _walked, where=True))
    console.print(_chattering_table(chattering))
    errors = prediction_error(robot, walk_method("none", friction=0.8, gait=gait, duration=min(duration, 6.0)))
    title = "Error of the predicted force of feet that stick, N (no governor, friction 0.8)"
    table = _columns(title, "phase", "samples", "median", "90 %", "99 %")
    for e in errors:
        table.add_row(e.phase, str(e.samples), f"{e.median:.3f}", f"{e.p90:.3f}", f"{e.p99:.2f}")
    console.print(table)
    if figure is not None:
        from reproduction.slip_figure import slip_figure

        rows = [(r.method, r.friction, r.slip_mm, r.fell_at_s == r.fell_at_s) for r in results if r.push_ns == 0.0]
        with replacing(figure) as file:
            slip_figure(rows).savefig(file, format=figure.suffix[1:].lower())
    if json is not None:
        write_json(
            json,
            {
                "models": [model.as_dict() for model in models],
                "walks": [result.as_dict() for result in results],
                "chattering": [
                    {"period_s": 1e-3 / divide} | result.as_dict() for (_, divide), result in chattering.items()
                ],
                "prediction_error": [vars(e) for e in errors],
            },
        )


def _columns(title: str, first: str, *others: str) -> Table:
    """A table whose columns are right-justified, but for the first."""
    table = Table(title=title)
    table.add_column(first)
    for name in others:
        table.add_column(name, justify="right")
    return table


def _models(models: Any) -> Table:
    columns = ("violated", "worst N", "reversals/s, dt", "dt/2", "dt/4", "x_w − x_r mm", "thrust rms N", "update µs")
    table = _columns("Reduced-order model: the paper's target for 4 s from inside the cone", "governor", *columns)
    for m in models:
        table.add_row(
            m.governor,
            f"{m.violation_share:.4f}",
            f"{m.worst_violation_n:.2f}",
            *(f"{rate:.1f}" for rate in m.reversals_per_s),
            f"{m.deviation_rms_mm:.0f}",
            f"{m.thrust_rms_n:.1f}",
            "–" if m.update_us != m.update_us else f"{m.update_us:.1f}",
        )
    return table


def _walked(r: Any) -> tuple[str, ...]:
    return (
        f"{r.slip_mm:.2f}",
        f"{r.late_slip_mm:.2f}",
        f"{r.sliding:.4f}",
        f"{r.low_force:.4f}",
        f"{r.speed:.3f}",
        f"{r.thrust_max_n:.1f}",
        f"{r.thrust_rms_n:.1f}",
        "–" if r.fell_at_s != r.fell_at_s else f"{r.fell_at_s:.2f}",
    )


def _forces(r: Any) -> tuple[str, ...]:
    values = (
        (r.demanded_violation, ".4f"),
        (r.demanded_worst_n, ".2f"),
        (r.model_violation, ".4f"),
        (r.model_worst_n, ".2f"),
        (r.deviation_rms_mm, ".1f"),
        (r.reversals_per_s, ".1f"),
        (r.variation_per_s, ".3f"),
        (r.rate_max, ".2f"),
    )
    return tuple("–" if value != value else f"{value:{spec}}" for value, spec in values)


def _table(title: str, columns: tuple[str, ...], results: list[Any], cells: Any, *, where: bool = False) -> Table:
    table = _columns(title, "governor", *(("friction", "push") if where else ()), *columns)
    last = None
    for r in results:
        place = (r.friction, r.push_ns)
        if where and last is not None and place != last:
            table.add_section()
        last = place
        ground = (f"{r.friction:g}", f"{r.push_ns:g}") if where else ()
        table.add_row(r.method, *ground, *cells(r))
    return table


def _chattering_table(chattering: dict[tuple[str, int], Any]) -> Table:
    title = "Chattering of x_w at shorter control periods: reversals per s (total variation, m/s)"
    table = _columns(title, "governor", *(f"{1e3 / divide:g} µs" for divide in DIVISORS))
    for name in dict.fromkeys(name for name, _ in chattering):
        cells = [chattering[name, divide] for divide in DIVISORS]
        table.add_row(name, *(f"{r.reversals_per_s:.1f} ({r.variation_per_s:.3f})" for r in cells))
    return table
