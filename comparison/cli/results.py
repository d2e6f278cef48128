"""The command that makes the tables of a page."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.campaign.breaking import breaking_tables
from comparison.campaign.exceptions import exceptions_table
from comparison.campaign.summary import summary_tables
from comparison.campaign.variants_table import variants_table
from comparison.contacts import contact_tables
from comparison.crossings import crossing_tables
from comparison.delay import delay_tables
from comparison.edge import edge_tables
from comparison.embedded import embedded_tables
from comparison.ice import ice_tables
from comparison.limits import limit_tables
from comparison.measure.walking import Rows
from comparison.report.contents import tables_of
from comparison.results import rewritten, sources_of
from comparison.robots import robot_tables
from comparison.sections.grounds import ground_tables
from comparison.slopes import slope_tables
from comparison.steering import steering_tables
from comparison.tables import Table
from comparison.walkers.study import walkers_tables
from comparison.walking import walking_tables
from harpy_pin import checks
from harpy_pin.errors import HarpyError, RunFileError
from harpy_pin.files import check_writable, replacing

__all__ = ["SOURCES", "results"]

Tables = Callable[[dict[str, Any]], list[Table]]


def _campaign(summary: dict[str, Any]) -> list[Table]:
    """Every table of a campaign."""
    return [*breaking_tables(summary), variants_table(summary), exceptions_table(summary), *summary_tables(summary)]


def _walks(tables: Callable[[Rows], list[Table]]) -> Tables:
    """The tables of a study that keeps its walks."""
    return lambda document: tables(document["walks"])


SOURCES: Mapping[str, tuple[str, Tables]] = {
    "comparison": ("--out {folder}/comparison", tables_of),
    "wide": ("campaign --wide --out {folder}/wide.jsonl", _campaign),
    "variants": ("campaign --variants --out {folder}/variants.jsonl", _campaign),
    "damped": ("campaign --variants --walks 960 --joint-damping 5 --out {folder}/damped.jsonl", _campaign),
    "harsh": ("campaign --harsh --out {folder}/harsh.jsonl", _campaign),
    "grounds": ("grounds", _walks(ground_tables)),
    "contacts": ("contacts --out {folder}/contacts.jsonl", _walks(contact_tables)),
    "limits": ("limits --out {folder}/limits.jsonl", _walks(limit_tables)),
    "delay": ("delay", _walks(delay_tables)),
    "ice": ("ice", _walks(ice_tables)),
    "steering": ("steering", _walks(steering_tables)),
    "edge": ("edge", _walks(edge_tables)),
    "robots": ("robots", _walks(robot_tables)),
    "embedded": ("embedded", _walks(embedded_tables)),
    "slopes": ("slopes --out {folder}/slopes.jsonl", _walks(slope_tables)),
    "walkers": ("walkers --out {folder}/walkers.jsonl", _walks(walkers_tables)),
    "walking": ("walking --out {folder}/walking.jsonl", _walks(walking_tables)),
    "crossings": ("crossings --out {folder}/crossings.jsonl", _walks(crossing_tables)),
}
"""For each source of a page the command that measures it, without ``--json``, and the tables of what it writes."""


def results(
    page: Annotated[Path, typer.Argument(metavar="PAGE", help="The Markdown page.")] = Path("docs/results.md"),
    data: Annotated[
        Path, typer.Option("--data", metavar="DIR", help="Folder of the measurements; what it has is not repeated.")
    ] = Path("out/results"),
) -> None:
    """Make the tables of a page anew.

    Above each table of the page a comment says from which command it comes, and which rows and columns it shows. The
    commands whose JSON file is not in the folder are run first; the tables of one that fails stay as they are. Those of
    docs/results.md take an hour, and need the extras compare, robots and drake, and what "embedded" needs.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunFileError(f"cannot read '{page}': {error}", path=page) from error
    check_writable(page)
    sources = sources_of(text)
    for source in sources:
        checks.one_of("source of a table", source, SOURCES)
    data.mkdir(parents=True, exist_ok=True)
    failed = [source for source in sources if not _measured(source, data)]

    @cache
    def tables(source: str) -> dict[str, Table]:
        document = json.loads((data / f"{source}.json").read_text(encoding="utf-8"))
        return {table.name: table for table in SOURCES[source][1](document)}

    def table_of(source: str, name: str) -> Table | None:
        if source in failed:
            return None
        checks.one_of(f"table of '{source}'", name, tables(source))
        return tables(source)[name]

    new = rewritten(text, table_of)
    with replacing(page) as file:
        file.write(new.encode())
    if failed:
        raise HarpyError(f"these commands failed, and their tables are as before: {', '.join(failed)}")


def _measured(source: str, folder: Path) -> bool:
    """Whether the document of a source is there, now that its command has been run if need be."""
    path = folder / f"{source}.json"
    if path.exists():
        return True
    words = SOURCES[source][0].format(folder=folder).split()
    typer.echo(f"python -m comparison {' '.join(words)}", err=True)
    ended = subprocess.run(
        [sys.executable, "-m", "comparison", *words, "--json", str(path)], stdout=subprocess.DEVNULL, check=False
    )
    return ended.returncode == 0
