"""Journal: the rows of a run on disk while it goes on, whole up to the last block whenever the
process dies.

The file begins with :data:`MAGIC`. Records follow: kind (4 bytes), length and CRC-32 of the
payload, the payload. The first holds the signals' names and shapes and the metadata as JSON. Then
comes one for each block of rows, which are float64, and at the end one with the metadata of a run
that has ended.
"""

import json
import os
import struct
import warnings
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import RunFileError, RunFileWarning
from harpy_pin.files import check_writable, journal_path
from harpy_pin.log.run_file import check_name, to_json

MAGIC = b"harpy run journal 2\n"
RECORD = struct.Struct("<4sQI")
HEAD, ROWS, END = b"HEAD", b"ROWS", b"END "
FLOAT = np.dtype(np.float64)
MAX_ROW = 1 << 20
"""Numbers in a row, at most."""


@dataclass(frozen=True)
class Layout:
    """Which signals a row holds, in order."""

    shapes: Mapping[str, tuple[int, ...]]  # of each signal in one row
    flags: frozenset[str] = frozenset()  # names of those that are true or false

    @cached_property
    def row(self) -> np.dtype[np.void]:
        """A row: its signals, one after the other."""
        return np.dtype([(name, np.float64, shape) for name, shape in self.shapes.items()])

    @property
    def width(self) -> int:
        """Numbers in a row."""
        return self.row.itemsize // FLOAT.itemsize

    def signals(self, blocks: deque[bytes]) -> dict[str, NDArray[Any]]:
        """Whole signals from blocks of rows, each of which is dropped once it has been copied."""
        rows = sum(map(len, blocks)) // max(self.row.itemsize, 1)
        arrays: dict[str, NDArray[Any]] = {
            name: np.empty((rows, *shape), np.bool_ if name in self.flags else np.float64)
            for name, shape in self.shapes.items()
        }
        end = 0
        while blocks:
            table = np.frombuffer(blocks.popleft(), self.row)
            begin, end = end, end + len(table)
            for name, array in arrays.items():
                array[begin:end] = table[name]
        return arrays


class Journal:
    """Written while a run goes on, and removed once the whole log has taken its place.

    Args:
        target: the log that it is to become.
        metadata: of a run that has not ended.

    Attributes:
        path: of the journal.
        error: why it could not go on; the rows after that stay in memory.

    Raises:
        RunFileError: the file cannot be made, the metadata are no JSON, or another run has left its
            journal there.
    """

    def __init__(self, target: str | Path, metadata: Mapping[str, Any]) -> None:
        self.path = journal_path(target)
        self.error: OSError | None = None
        self._file: BinaryIO | None = None
        self._added = 0  # blocks of rows
        self._metadata = to_json(target, metadata)
        check_writable(self.path)
        if self.path.exists():
            raise RunFileError(
                f"cannot write '{target}': another run is writing it, or died: '{self.path}' "
                f"is its journal; "
                "give this one another name, or move that file away",
                path=self.path,
            )

    def begin(self, layout: Layout) -> None:
        """Make the file at the first row, and write what a row holds."""
        head = json.dumps({"signals": dict(layout.shapes), "flags": sorted(layout.flags)})
        try:
            self._file = open(self.path, "x+b", buffering=0)  # noqa: SIM115
        except OSError as error:  # also where another run has begun meanwhile
            self.error = error
        self._write(MAGIC)
        self._add(HEAD, f'{head[:-1]}, "metadata": {self._metadata}}}'.encode())

    def add(self, block: bytes) -> bool:
        """Write some rows; False where they could not be written."""
        written = self._add(ROWS, block)
        self._added += written
        return written

    def end(self, metadata: Mapping[str, Any]) -> None:
        """Write the metadata of the run that has ended."""
        self._add(END, to_json(self.path, metadata).encode())

    def _add(self, kind: bytes, payload: bytes) -> bool:
        return self._write(RECORD.pack(kind, len(payload), zlib.crc32(payload))) and self._write(
            payload
        )

    def _write(self, data: bytes) -> bool:
        """Whether it could be written; after a failure nothing more is, since a reader would stop
        before it.
        """
        if self.error is not None or self._file is None:
            return False
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
        return self.error is None

    def blocks(self) -> deque[bytes]:
        """The rows that have been written; the last thing that is asked of a journal. Readers are
        warned of damage.
        """
        if self._file is None:
            return deque()
        self._file.seek(0)
        found = deque(payload for kind, payload in _records(self._file) if kind == ROWS)
        if len(found) < self._added:
            warnings.warn(
                f"'{self.path}' was damaged while the run went on: "
                f"{self._added - len(found)} blocks of its log "
                "are lost",
                RunFileWarning,
                stacklevel=3,
            )
        return found

    def close(self) -> None:
        """Leave it on disk."""
        if self._file is not None:
            self._file.close()

    def remove(self) -> None:
        """Remove it."""
        if self._file is not None:
            self._file.close()
            self.path.unlink(missing_ok=True)


def is_journal(path: Path) -> bool:
    """Whether a file begins like a journal."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> tuple[dict[str, NDArray[Any]], Any]:
    """Signals and metadata of a journal, up to the last block that is whole.

    Readers are warned.

    Raises:
        RunFileError: there is not even a first record.
    """
    layout, metadata, ended, blocks = Layout({}), None, False, deque[bytes]()
    place = len(MAGIC)
    try:
        with open(path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            for kind, payload in _records(file):
                place += RECORD.size + len(payload)
                if (
                    kind == ROWS
                    and layout.shapes
                    and payload
                    and len(payload) % layout.row.itemsize == 0
                ):
                    blocks.append(payload)
                elif kind == HEAD and not layout.shapes:
                    head = json.loads(payload)
                    layout, metadata = _checked_layout(head), head["metadata"]
                elif kind == END and not ended:
                    metadata, ended = json.loads(payload), True
                else:
                    raise ValueError("a record that does not fit")
        if not layout.shapes:
            raise ValueError("no signals")
        signals = layout.signals(blocks)
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
        MemoryError,
    ) as error:
        raise RunFileError(f"'{path}' is damaged or holds nothing yet", path=path) from error
    rows = len(signals.get("t", ()))
    what = "whose log was not written" if ended else "that has not ended"
    lost = "" if place == size else f"; its last {size - place} bytes are not whole"
    warnings.warn(
        f"'{path}' is the journal of a run {what}: {rows} ticks{lost}", RunFileWarning, stacklevel=3
    )
    return signals, metadata


def _records(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Kind and payload of every record, up to the first that is not whole."""
    rest = os.fstat(file.fileno()).st_size - file.seek(len(MAGIC))
    while rest >= RECORD.size:
        kind, length, crc = RECORD.unpack(file.read(RECORD.size))
        rest -= RECORD.size + length
        if rest < 0:
            return
        payload = file.read(length)
        if len(payload) != length or zlib.crc32(payload) != crc:
            return
        yield kind, payload


def _checked_layout(head: Mapping[str, Any]) -> Layout:
    shapes = {name: tuple(shape) for name, shape in head["signals"].items()}
    numbers = [number for shape in shapes.values() for number in shape]
    if not all(type(number) is int and 0 <= number <= MAX_ROW for number in numbers) or any(
        map(check_name, shapes)
    ):
        raise ValueError("bad signals")
    layout = Layout(shapes, frozenset(head["flags"]))
    if not 0 < layout.width <= MAX_ROW or not layout.flags <= shapes.keys():
        raise ValueError("bad signals")
    return layout
