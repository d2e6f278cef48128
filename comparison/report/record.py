"""What a command printed last: its tables, with the commit, the machine and the versions, in a file
that Git keeps.

Every figure of README and docs comes from one of these files; ``python -m comparison results``
writes them.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparison.campaign.plan import code_digest
from comparison.measure.timing import describe_all_versions, describe_machine
from comparison.tables import Cell, Table
from harpy_pin.errors import RunFileError
from harpy_pin.files import finite, replacing

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "results"
"""Where the records are: a file for each source."""


@dataclass(frozen=True)
class Record:
    """The tables of one run of a command."""

    command: str  # that printed them
    origin: Mapping[str, Any]  # see :func:`origin`
    tables: Mapping[str, Table]  # by name

    @classmethod
    def of(cls, command: str, document: Mapping[str, Any], tables: Iterable[Table]) -> Record:
        """The record of a document that a command has written as JSON.

        Args:
            command: as it is typed.
            document: what was written; its origin is taken over.
            tables: made of the document.
        """
        known = {name: document.get(name) for name in ("commit", "code", "machine", "versions")}
        return cls(command, known, {table.name: table for table in tables})

    @classmethod
    def load(cls, source: str, folder: Path = FOLDER) -> Record:
        """The record of a source.

        Raises:
            RunFileError: there is none, or it cannot be read.
        """
        path = folder / f"{source}.json"
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            tables = {
                name: Table(
                    name,
                    entry["title"],
                    tuple(Cell(*cell) for cell in entry["cells"]),
                    entry["note"],
                )
                for name, entry in data.pop("tables").items()
            }
            return cls(data.pop("command"), data, tables)
        except FileNotFoundError as error:
            how = f"python -m comparison results {source}"
            raise RunFileError(f"nothing is recorded of '{source}': {how}", path=path) from error
        except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError) as error:
            raise RunFileError(f"'{path}' is no record: {error}", path=path) from error

    def save(self, source: str, folder: Path = FOLDER) -> None:
        """Write the record of a source, one cell a line.

        Raises:
            RunFileError: the file cannot be written.
        """
        tables = {
            name: {
                "title": table.title,
                "note": table.note,
                "cells": [list(cell) for cell in table.cells],
            }
            for name, table in self.tables.items()
        }
        data = finite({"command": self.command, **self.origin, "tables": tables})
        text = json.dumps(data, indent=1, ensure_ascii=False)
        with replacing(folder / f"{source}.json") as file:
            file.write(f"{_CELL.sub(_on_one_line, text)}\n".encode())


_CELL = re.compile(r"\[(?:\n +[^\[\]{}\n]+)+\n +\]")


def _on_one_line(cell: re.Match[str]) -> str:
    return re.sub(r"\n +", " ", cell[0]).replace("[ ", "[", 1).removesuffix(" ]") + "]"


def origin() -> dict[str, Any]:
    """Where numbers come from: the commit, if Git knows it, a digest of the code, the machine and
    the versions.
    """
    return {
        "commit": _commit(),
        "code": code_digest(),
        "machine": describe_machine(),
        "versions": describe_all_versions(),
    }


def _commit() -> str | None:
    """The commit of the checkout, with ``+`` where files differ from it; None outside of one."""
    try:
        words = ["git", "describe", "--always", "--abbrev=8", "--exclude=*", "--dirty=+"]
        told = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return told.stdout.strip()
