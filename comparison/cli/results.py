"""The command that makes the tables of a page; each stands below a comment that says which one it is.

The comment is TOML::

    <!-- figures
    table = "wide/variants"
    columns = {"fell" = "fell", "slip, median" = "slip, mm"}
    -->

``rows`` and ``columns`` choose, order and rename; without them all are shown. ``turned = true`` exchanges the two. The
table that follows the comment is replaced.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.campaign.summary import summary_tables, variants_table
from comparison.campaign.walks import exceptions_table
from comparison.cli.studies import STUDIES
from comparison.report.html import tables_of
from comparison.tables import Table, cell_text
from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError, RunFileError
from harpy_pin.files import check_writable, replacing

_BLOCK = re.compile(r"(<!-- figures\n(.*?)\n-->\n)((?:\|[^\n]*\n)*)", re.DOTALL)
_SETTINGS = ("table", "rows", "columns", "turned")


def sources_of(page: str) -> list[str]:
    """Names of the sources that a page's tables come from, each once."""
    return list(dict.fromkeys(_settings(match[2])["table"].partition("/")[0] for match in _BLOCK.finditer(page)))


def rewritten(page: str, table_of: Callable[[str, str], Table | None]) -> str:
    """The page with every table made again.

    Args:
        page: its text.
        table_of: gives the table of a source, by the two names; None leaves what is there.
    """

    def block(match: re.Match[str]) -> str:
        settings = _settings(match[2])
        source, _, name = settings.pop("table").partition("/")
        table = table_of(source, name)
        return match[0] if table is None else match[1] + markdown(table, **settings)

    return _BLOCK.sub(block, page)


def markdown(
    table: Table,
    *,
    rows: Mapping[str, str] | list[str] | None = None,
    columns: Mapping[str, str] | list[str] | None = None,
    turned: bool = False,
) -> str:
    """A table in Markdown.

    Args:
        table: which.
        rows: those to show, in this order, with their new names or without.
        columns: the same of the columns; one without a new name keeps its unit.
        turned: whether rows become columns.
    """
    units = {cell.column: f"{cell.column}, {cell.unit}" if cell.unit else cell.column for cell in table.cells}
    down = _chosen(table, "row", rows, {row: row for row in table.rows})
    across = _chosen(table, "column", columns, units)
    text = [[cell_text(table.get(row, column)) for column in across] for row in down]
    names, heads = list(down.values()), list(across.values())
    if turned:
        names, heads, text = heads, names, [list(line) for line in zip(*text, strict=True)]
    lines = [["", *heads], ["---", *("---:" for _ in heads)]]
    lines += [[name, *cells] for name, cells in zip(names, text, strict=True)]
    return "".join(f"| {' | '.join(line)} |\n".replace("|  |", "| |") for line in lines)


def read_blocks(page: str) -> dict[str, dict[tuple[str, str], str]]:
    """The figures that stand in a page: for each table the text of its cells by row and column, as they are shown."""
    found: dict[str, dict[tuple[str, str], str]] = {}
    for match in _BLOCK.finditer(page):
        lines = [[part.strip() for part in line.strip("|").split("|")] for line in match[3].splitlines()]
        found[_settings(match[2])["table"]] = {
            (name, column): cell for name, *cells in lines[2:] for column, cell in zip(lines[0][1:], cells, strict=True)
        }
    return found


def _settings(comment: str) -> dict[str, Any]:
    """What a comment says."""
    try:
        settings = tomllib.loads(comment)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"a comment above a table is not TOML: {error}", name="page") from error
    for name in settings:
        checks.one_of("setting of a table", name, _SETTINGS)
    if "/" not in settings.get("table", ""):
        raise InputError("a comment above a table lacks its table, 'source/name'", name="page")
    return settings


def _chosen(
    table: Table, what: str, names: Mapping[str, str] | list[str] | None, all_names: Mapping[str, str]
) -> Mapping[str, str]:
    """The rows or columns to show, with the names that they are to have."""
    if names is None:
        return all_names
    for name in names:
        if name not in all_names:
            known = ", ".join(f"'{known}'" for known in all_names)
            raise InputError(f"the table '{table.name}' has no {what} '{name}'; it has {known}", name="page")
    return names if isinstance(names, Mapping) else {name: all_names[name] for name in names}


SOURCES: Mapping[str, str] = {
    "comparison": "--out {folder}/comparison",
    **{kind: f"campaign {kind} --out {{folder}}/{kind}.jsonl" for kind in ("wide", "variants", "harsh")},
    "damped": "campaign variants --walks 960 --joint-damping 5 --out {folder}/damped.jsonl",
    **{name: f"{name} --out {{folder}}/{name}.jsonl" for name in STUDIES},
}
"""For each source of a page the command that measures it, without ``--json``."""


def tables_from(source: str, document: dict[str, Any]) -> list[Table]:
    """The tables of what the command of a source writes."""
    if source in STUDIES:
        return STUDIES[source].tables(document["walks"])
    if source == "comparison":
        return tables_of(document)
    return [variants_table(document), exceptions_table(document), *summary_tables(document)]


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
    try:
        data.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot make the folder '{data}': {error.strerror}", path=data) from error
    failed = [source for source in sources if not _measured(source, data)]

    @cache
    def tables(source: str) -> dict[str, Table]:
        document = json.loads((data / f"{source}.json").read_text(encoding="utf-8"))
        return {table.name: table for table in tables_from(source, document)}

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
    words = SOURCES[source].format(folder=folder).split()
    typer.echo(f"python -m comparison {' '.join(words)}", err=True)
    ended = subprocess.run(
        [sys.executable, "-m", "comparison", *words, "--json", str(path)], stdout=subprocess.DEVNULL, check=False
    )
    return ended.returncode == 0
