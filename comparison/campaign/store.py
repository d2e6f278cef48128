"""Finished walks in a file of JSON lines, each on disk before the next is awaited."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Container, Mapping
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

from comparison.measure.walking import Progress, one_by_one
from harpy_pin.errors import RunFileError
from harpy_pin.files import finite

_Job = TypeVar("_Job")


class Store:
    """The file of a campaign, locked while the campaign writes to it.

    It is made if there is none; a last row that is half written is cut off.

    Attributes:
        rows: all rows in it, by key.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("ab")
        except OSError as error:
            raise RunFileError(
                f"cannot write '{path}': {error.strerror or error}", path=path
            ) from error
        try:
            _lock(self._file.fileno(), path)
            self.rows, whole = read_rows(path)
            if whole < path.stat().st_size:
                self._file.truncate(whole)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *ending: object) -> None:
        self._file.close()

    def append(self, key: str, row: dict[str, Any]) -> None:
        """Write a row and wait until it is on the disk; a key that is there already is left as it
        is.
        """
        if key in self.rows:
            return
        line = json.dumps({"key": key, **row}, sort_keys=True, allow_nan=False) + "\n"
        try:
            self._file.write(line.encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise RunFileError(
                f"cannot write '{self.path}': {error.strerror or error}", path=self.path
            ) from error
        self.rows[key] = row


def do_missing(
    store: Store,
    jobs: Mapping[str, _Job],
    work: Callable[[_Job], dict[str, Any]],
    progress: Progress,
    *,
    alone: Container[str] = (),
) -> None:
    """Do the jobs that a store lacks; the row of each is stored as soon as it and all before it are
    done.

    Many are done in processes of their own, or by a cluster, but for those whose keys are in
    ``alone``. These come last among the jobs.
    """
    missing, total = [key for key in jobs if key not in store.rows], len(jobs)
    progress(total - len(missing), total)
    with closing(one_by_one(work, [jobs[key] for key in missing if key not in alone])) as together:
        rows = chain(together, map(work, (jobs[key] for key in missing if key in alone)))
        for left, (key, row) in enumerate(zip(missing, rows, strict=True), start=1 - len(missing)):
            store.append(key, finite(row))
            progress(total + left, total)


def read_rows(path: Path) -> tuple[dict[str, dict[str, Any]], int]:
    """Rows by key, and how many bytes of the file are whole lines; a last line that is not whole is
    left out.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RunFileError(f"cannot read '{path}': {error.strerror or error}", path=path) from error
    lines = data.split(b"\n")
    rows: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(
        lines[:-1], start=1
    ):  # what follows the last newline is not whole
        try:
            row = json.loads(line)
            key = row.pop("key")
        except (ValueError, AttributeError, KeyError, TypeError):
            raise RunFileError(
                f"line {number} of '{path}' is not a row of a campaign", path=path
            ) from None
        rows.setdefault(str(key), row)
    if not b'{"'.startswith(lines[-1][:2]):
        raise RunFileError(f"the end of '{path}' is not a row of a campaign", path=path)
    return rows, len(data) - len(lines[-1])


def _lock(descriptor: int, path: Path) -> None:
    """Hold the file until it is closed (where the system can)."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise RunFileError(f"another campaign is writing to '{path}'", path=path) from None
