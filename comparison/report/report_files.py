"""The files of the report: the page for people, JSON and CSV for programs, all from the same document."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from comparison.report.contents import tables_of
from comparison.report.html import render
from comparison.tables import to_csv
from harpy_pin.files import replacing, write_json

__all__ = ["write_report"]


def write_report(folder: Path, document: Mapping[str, Any]) -> None:
    """Write ``report.html``, ``results.json`` and ``results.csv``; the CSV holds every number of the page.

    Raises:
        RunFileError: one of them cannot be written.
    """
    write_json(folder / "results.json", document)
    for name, text in (("results.csv", to_csv(tables_of(document))), ("report.html", render(document))):
        with replacing(folder / name) as file:
            file.write(text.encode())
