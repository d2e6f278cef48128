"""Journal: the rows of a run on disk while it goes on, whole up to the last block whenever the process dies.

The file begins with :data:`MAGIC`. Records follow: length and CRC-32 of the payload, the payload. The first holds the
signals' names and shapes and the metadata as JSON, every other one a block of rows, which are float64.
"""

from __future__ import annotations

import json
import math
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

MAGIC = b"harpy run journal 3\n"
RECORD = struct.Struct("<QI")
ITEM = 8  # bytes of a number
MAX_ROW = 1 << 20  # numbers in a row, at most


@dataclass(frozen=True)
class Layout:
    """Which signals a row holds, in order."""

    shapes: Mapping[str, tuple[int, ...]]  # of each signal in one row
    flags: frozenset[str] = frozenset()  # names of those that are true or false

    @cached_property
    def spans(self) -> dict[str, tuple[int, int]]:
        """First and last number (not included) of each signal in a row."""
        spans, begin = {}, 0
        for name, shape in self.shapes.items():
            spans[name] = begin, begin + math.prod(shape)
            begin += math.prod(shape)
        return spans

    @cached_property
    def width(self) -> int:
        """Numbers in a row."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def signals(self, blocks: deque[bytes]) -> dict[str, NDArray[Any]]:
        """Whole signals from blocks of rows, each of which is dropped once it has been copied."""
        rows = sum(map(len, blocks)) // (ITEM * self.width) if self.width else 0
        arrays: dict[str, NDArray[Any]] = {
            name: np.empty((rows, *shape), np.bool_ if name in self.flags else np.float64)
            for name, shape in self.shapes.items()
        }
        end = 0
        while blocks:
            table = np.frombuffer(blocks.popleft()).reshape(-1, self.width)
            begin, end = end, end + len(table)
            for name, (first, last) in self.spans.items():
                arrays[name][begin:end] = table[:, first:last].reshape(len(table), *self.shapes[name])
        return arrays


class Journal:
    """Written while a run goes on, and removed once the whole log, its target, has taken its place.

    ``error`` says why it could not go on. A :class:`RunFileError` says that the file cannot be made, that the metadata
    are no JSON, or that another run has left its journal there.
    """

    def __init__(self, target: str | Path, metadata: Mapping[str, Any]) -> None:
        self.path = journal_path(target)
        self.error: OSError | None = None
        self._file: BinaryIO | None = None
        self._metadata = to_json(target, metadata)
        check_writable(self.path)
        if self.path.exists():
            message = f"cannot write '{target}': another run is writing it, or died: '{self.path}' is its journal"
            raise RunFileError(f"{message}; give this one another name, or move that file away", path=self.path)

    def begin(self, layout: Layout) -> None:
        """Make the file at the first row, and write what a row holds."""
        head = json.dumps({"signals": dict(layout.shapes), "flags": sorted(layout.flags)})
        try:
            self._file = open(self.path, "xb", buffering=0)  # noqa: SIM115
            self._file.write(MAGIC)
        except OSError as error:  # also where another run has begun meanwhile
            self.error = error
        self.add(f'{head[:-1]}, "metadata": {self._metadata}}}'.encode())

    def add(self, block: bytes) -> None:
        """Write some rows; after a failure nothing more is written, since a reader would stop before it."""
        if self.error is not None or self._file is None:
            return
        rest = memoryview(RECORD.pack(len(block), zlib.crc32(block)) + block)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error

    def close(self, *, remove: bool = True) -> None:
        """Close the file, which is removed where it is needed no more."""
        if self._file is not None:
            self._file.close()
            if remove:
                self.path.unlink(missing_ok=True)


def is_journal(path: Path) -> bool:
    """Whether a file begins like a journal."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> tuple[dict[str, NDArray[Any]], Any]:
    """Signals and metadata of a journal, up to the last block that is whole; readers are warned.

    A :class:`RunFileError` says that there is not even a first record.
    """
    blocks, place = deque[bytes](), len(MAGIC)
    try:
        with open(path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            records = _records(file)
            head = json.loads(first := next(records, b""))
            layout, place = _checked_layout(head), place + RECORD.size + len(first)
            for block in records:
                if not block or len(block) % (ITEM * layout.width):
                    raise ValueError("a block that does not fit")
                blocks.append(block)
                place += RECORD.size + len(block)
        signals, metadata = layout.signals(blocks), head["metadata"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError) as error:
        raise RunFileError(f"'{path}' is damaged or holds nothing yet", path=path) from error
    rows = len(signals.get("t", ()))
    lost = "" if place == size else f"; its last {size - place} bytes are not whole"
    message = f"'{path}' is the journal of a run that has not ended: {rows} ticks{lost}"
    warnings.warn(message, RunFileWarning, stacklevel=3)
    return signals, metadata


def _records(file: BinaryIO) -> Iterator[bytes]:
    """The payload of every record, up to the first that is not whole."""
    file.seek(len(MAGIC))
    while len(head := file.read(RECORD.size)) == RECORD.size:
        length, crc = RECORD.unpack(head)
        payload = file.read(min(length, os.fstat(file.fileno()).st_size))
        if len(payload) != length or zlib.crc32(payload) != crc:
            return
        yield payload


def _checked_layout(head: Mapping[str, Any]) -> Layout:
    shapes = {name: tuple(shape) for name, shape in head["signals"].items()}
    numbers = [number for shape in shapes.values() for number in shape]
    if not all(type(number) is int and 0 <= number <= MAX_ROW for number in numbers) or any(map(check_name, shapes)):
        raise ValueError("bad signals")
    layout = Layout(shapes, frozenset(head["flags"]))
    if not 0 < layout.width <= MAX_ROW or not layout.flags <= shapes.keys():
        raise ValueError("bad signals")
    return layout
