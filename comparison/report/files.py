"""The report: tables for people, JSON for programs, both from the same document."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from comparison.campaign.summary import print_tables, summary_tables
from comparison.measure.contenders import CONTENDERS
from comparison.peers.summary import print_peers
from comparison.report.contents import CONDITIONS, MEASURES, PHASES, pareto_table, tables_of
from comparison.report.html import render
from comparison.report.tables import to_csv
from harpy_pin.files import replacing

__all__ = ["print_report", "write_json", "write_report"]


def print_report(console: Console, document: Mapping[str, Any]) -> None:
    """Print everything a reader needs to judge the numbers.

    Args:
        console: where to.
        document: of :func:`comparison.benchmark.compare`.
    """
    settings = document["settings"]
    console.print("[bold]Explicit reference governor and QP whole-body controller on the same states[/bold]")
    _print_place(console, document)
    for key, name in CONDITIONS.items():
        friction = settings[name]
        console.print()
        console.print(_timing_table(document[f"timing{key}"], friction))
        _print_ratios(console, document[f"timing{key}"])
        console.print()
        console.print(_walk_table(document[f"walk{key}"], friction))
        if settings["pushes"]:
            console.print()
            console.print(_pushed_table(document[f"walk_pushed{key}"], friction, settings["push_speed"]))
        console.print()
        console.print(_check_table(document[f"checks{key}"], document[f"activity{key}"], friction))
    if "peers" in document:
        console.print()
        print_peers(console, document["peers"])
    if "campaign" in document:
        console.print()
        shown = summary_tables(document["campaign"])[:3]  # the others are in the HTML
        print_tables(console, [pareto_table(document), *shown] if "ticks" in document else shown)
    console.print("\n[bold]Limitations[/bold]")
    for sentence in document["limitations"]:
        console.print(f"• {sentence}", highlight=False)


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write the document; a file of that name is replaced only once the new one is whole.

    Raises:
        RunFileError: it cannot be written.
    """
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    _write(path, text)


def write_report(folder: Path, document: Mapping[str, Any]) -> None:
    """Write ``report.html``, ``results.json`` and ``results.csv``; the CSV holds every number of the page.

    Raises:
        RunFileError: one of them cannot be written.
    """
    write_json(folder / "results.json", document)
    _write(folder / "results.csv", to_csv(tables_of(document)))
    _write(folder / "report.html", render(document))


def _write(path: Path, text: str) -> None:
    with replacing(path) as file:
        file.write(text.encode())


def _print_place(console: Console, document: Mapping[str, Any]) -> None:
    m, s = document["machine"], document["settings"]
    load = "" if m["load_1min"] is None else f", load {m['load_1min']:.1f} at the start"
    versions = ", ".join(f"{name} {value}" for name, value in document["versions"].items() if name != "machine")
    t = s["timing"]
    console.print(f"{m['cpu']}, {m['usable_cores']} of {m['cores']} cores, {m['os']} {m['architecture']}{load}")
    console.print(versions, highlight=False)
    console.print(
        f"Walks of {s['duration']:g} s. Timed: {s['states']}; {t['repetitions']} repetitions in turns, in blocks of "
        f"{t['block']} ticks; not counted are the first {t['warm_up']} ticks of each replay and {t['settle']} of each "
        f"block. Garbage collection off, seed {s['seed']}.",
        highlight=False,
    )


def _timing_table(timing: Mapping[str, Any], friction: float) -> Table:
    table = Table(title=f"Time per tick, µs, friction {friction:g}", title_justify="left")
    table.add_column("what", no_wrap=True)
    for column in ("p50", "p95", "p99", "p99.9", "max"):
        table.add_column(column, justify="right", no_wrap=True)
    for name in CONTENDERS:
        table.add_section()
        for phase in (phase for phase in PHASES if phase in timing[name]):
            row = timing[name][phase]
            table.add_row(
                f"{name}: {PHASES[phase]}" if phase == "tick" else f"  {PHASES[phase]}",
                *(_short(row[column]) for column in ("p50_us", "p95_us", "p99_us", "p99_9_us", "max_us")),
                style="bold" if phase == "tick" else None,
            )
    return table


def _print_ratios(console: Console, timing: Mapping[str, Any]) -> None:
    for text, ratio in (
        ("Complete tick, wbc / governed", timing["ratio"]),
        *(
            (f"{PHASES[entry['phase']]} / governor update", entry)
            for entry in (timing["ratio_solve_over_governor"], timing["ratio_library_over_governor"])
        ),
    ):
        console.print(
            f"{text}: [bold]{ratio['p50']:.1f}[/bold] "
            f"(ratio of medians; {ratio['min']:.1f} to {ratio['max']:.1f} in {len(ratio['repetitions'])} repetitions)",
            highlight=False,
        )
    overhead = timing["timer_overhead_ns"]
    console.print(f"The timer's own {overhead:.0f} ns are subtracted from every time.", highlight=False)


def _walk_table(walk: Mapping[str, Any], friction: float) -> Table:
    table = Table(title=f"What each achieved in closed loop, friction {friction:g}", title_justify="left")
    table.add_column("measure", no_wrap=True)
    for name in CONTENDERS:
        table.add_column(name, justify="right")
    for key, text in MEASURES.items():
        table.add_row(text, *(_value(walk[name][key]) for name in CONTENDERS))
    return table


def _pushed_table(pushed: Mapping[str, Any], friction: float, speed: float) -> Table:
    walks = pushed[CONTENDERS[0]]["walks"]
    table = Table(
        title=f"{walks} walks with a push of {speed:g} m/s at the start, friction {friction:g}: median, range",
        title_justify="left",
    )
    table.add_column("measure", no_wrap=True)
    for name in CONTENDERS:
        table.add_column(name, justify="right")
    table.add_row("falls", *(str(pushed[name]["falls"]) for name in CONTENDERS))
    for key in ("distance_m", "slip_mm_per_step", "late_slip_mm_per_step", "sliding", "low_force", "no_contact"):
        cells = []
        for name in CONTENDERS:
            v = pushed[name][key]
            cells.append(f"{_value(v['median'])}\n{_value(v['min'])} to {_value(v['max'])}")
        table.add_row(MEASURES[key], *cells)
    return table


def _check_table(checks: Mapping[str, Any], activity: Mapping[str, Any], friction: float) -> Table:
    table = Table(title=f"Checks of what was timed, friction {friction:g}", title_justify="left", show_header=False)
    table.add_column()
    table.add_column(justify="right")
    c = checks
    table.add_row(
        "timed results equal untimed ones", "[green]yes[/green]" if c["passed"] else "[bold red]NO[/bold red]"
    )
    table.add_row("states unchanged by the replays", "yes" if c["states_unchanged"] else "NO")
    table.add_row(
        "timed commands that differ from untimed ones",
        _bad(c["commands_differing"], f"{c['commands_differing']} of {c['commands_compared']}"),
    )
    table.add_row("largest difference, N and N·m", f"{c['command_difference_max']:.1e}")
    table.add_row("solves without a usable solution", f"{c['qp_failures']} of {c['qp_solves']}")
    for name, count in c["qp_failures_by_states"].items():
        table.add_row(f"  on the states of {name}", str(count))
    if c["qp_failures"]:
        table.add_row(
            "  of these feasible by a linear program", f"{c['qp_failures_feasible']} of {c['qp_failures_sampled']}"
        )
    table.add_row("largest violation of a constraint by a used solution", f"{c['qp_violation_max']:.1e}")
    table.add_row(
        "sampled solutions that are not optimal",
        _bad(c["qp_not_optimal"], f"{c['qp_not_optimal']} of {c['qp_sampled']}"),
    )
    table.add_row("  largest violation of stationarity", _value(c["qp_stationarity_max"]))
    for name in (key.removesuffix("_compared") for key in c if key.startswith("alone") and key.endswith("_compared")):
        table.add_row(f"{PHASES['solve_' + name]}: not solved", _bad(c[f"{name}_failures"], str(c[f"{name}_failures"])))
        better, worse = c[f"{name}_better"], c[f"{name}_worse"]
        table.add_row(
            "  better, worse than the controller's own",
            _bad(better + worse, f"{better}, {worse} of {c[f'{name}_compared']}"),
        )
        table.add_row("  largest gap, relative", _value(c[f"{name}_gap_max"]))
    for name, a in activity.items():
        table.add_section()
        table.add_row(f"states of {name}: ticks", str(a["ticks"]))
        table.add_row("  governor: share with a violated row", f"{a['governor_rows_violated']:.3f}")
        table.add_row(
            "  solver: iterations, mean (largest)", f"{a['qp_iterations_mean']:.2f} ({a['qp_iterations_max']})"
        )
    return table


def _short(time: float) -> str:
    """A time in at most five characters, so that the table fits a terminal however long a tail is."""
    if time < 100.0:
        return f"{time:.1f}"
    return f"{time:.0f}" if time < 1e5 else f"{time:.0e}"


def _bad(count: int, text: str) -> str:
    return f"[bold red]{text}[/bold red]" if count else text


def _value(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)
