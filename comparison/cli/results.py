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

from comparison.campaign.exceptions import exceptions_table
from comparison.campaign.summary import summary_tables, variants_table
from comparison.cli.studies import STUDIES
from comparison.report.contents import tables_of
from comparison.results import rewritten, sources_of
from comparison.study import Study
from comparison.tables import Table
from harpy_pin import checks
from harpy_pin.errors import HarpyError, RunFileError
from harpy_pin.files import check_writable, replacing

Tables = Callable[[dict[str, Any]], list[Table]]


def _campaign(summary: dict[str, Any]) -> list[Table]:
    """Every table of a campaign."""
    return [variants_table(summary), exceptions_table(summary), *summary_tables(summary)]


def _study(study: Study) -> tuple[str, Tables]:
    """Its command, which keeps what it has done, and the tables of its document."""
    kept = "" if study.all_at_once is not None else f" --out {{folder}}/{study.name}.jsonl"
    return f"{study.name}{kept}", lambda document: study.tables(document["walks"])


SOURCES: Mapping[str, tuple[str, Tables]] = {
    "comparison": ("--out {folder}/comparison", tables_of),
    "wide": ("campaign wide --out {folder}/wide.jsonl", _campaign),
    "variants": ("campaign variants --out {folder}/variants.jsonl", _campaign),
    "damped": ("campaign variants --walks 960 --joint-damping 5 --out {folder}/damped.jsonl", _campaign),
    "harsh": ("campaign harsh --out {folder}/harsh.jsonl", _campaign),
    **{name: _study(study) for name, study in STUDIES.items()},
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
    docs/results.md take an hour, and need the extras compare and robots, and what "embedded" needs.
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
