"""Tables in pages: each stands below a comment that says where it comes from, and is never edited
by hand.

The comment is TOML::

    <!-- figures
    table = "wide/variants"
    columns = {"fell" = "fell", "slip, median" = "slip, mm"}
    -->

A table is named by its source and its own name. ``rows`` and ``columns`` choose, order and rename;
without them all are shown. ``turned = true`` exchanges the two.
"""

import re
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

from comparison.tables import WORDY, Table, cell_text
from harpy_pin import checks
from harpy_pin.errors import InputError

_BLOCK = re.compile(r"(<!-- figures\n(.*?)\n-->\n)((?:\|[^\n]*\n)*)", re.DOTALL)
_SETTINGS = ("table", "rows", "columns", "turned")


def blocks_of(page: str) -> dict[str, list[str]]:
    """The comments of a page, each with the table below it, by the table that it names."""
    found: dict[str, list[str]] = {}
    for match in _BLOCK.finditer(page):
        found.setdefault(_settings(match[2])["table"], []).append(match[0])
    return found


def filled(page: str, table_of: Callable[[str, str], Table]) -> str:
    """The page with every table made again.

    Args:
        page: its text.
        table_of: gives the table of a source, by the two names.
    """

    def block(match: re.Match[str]) -> str:
        settings = _settings(match[2])
        source, _, name = settings.pop("table").partition("/")
        return match[1] + markdown(table_of(source, name), **settings)

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
    units = {
        cell.column: f"{cell.column}, {cell.unit}" if cell.unit else cell.column
        for cell in table.cells
    }
    down = _chosen(table, "row", rows, {row: row for row in table.rows})
    across = _chosen(table, "column", columns, units)
    text = [[cell_text(table.get(row, column)) for column in across] for row in down]
    names, heads = list(down.values()), list(across.values())
    if turned:
        names, heads, text = heads, names, [list(line) for line in zip(*text, strict=True)]
    wordy = [any(len(line[k]) > WORDY for line in text) for k in range(len(heads))]
    lines = [["", *heads], ["---", *("---" if words else "---:" for words in wordy)]]
    lines += [[name, *cells] for name, cells in zip(names, text, strict=True)]
    return "".join(f"| {' | '.join(line)} |\n".replace("|  |", "| |") for line in lines)


def read_blocks(page: str) -> dict[str, dict[tuple[str, str], str]]:
    """The figures that stand in a page: for each table the text of its cells by row and column, as
    they are shown.
    """
    found: dict[str, dict[tuple[str, str], str]] = {}
    for match in _BLOCK.finditer(page):
        lines = [
            [part.strip() for part in line.strip("|").split("|")] for line in match[3].splitlines()
        ]
        found[_settings(match[2])["table"]] = {
            (name, column): cell
            for name, *cells in lines[2:]
            for column, cell in zip(lines[0][1:], cells, strict=True)
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
    table: Table,
    what: str,
    names: Mapping[str, str] | list[str] | None,
    all_names: Mapping[str, str],
) -> Mapping[str, str]:
    """The rows or columns to show, with the names that they are to have."""
    if names is None:
        return all_names
    for name in names:
        if name not in all_names:
            known = ", ".join(f"'{known}'" for known in all_names)
            raise InputError(
                f"the table '{table.name}' has no {what} '{name}'; it has {known}", name="page"
            )
    return names if isinstance(names, Mapping) else {name: all_names[name] for name in names}
