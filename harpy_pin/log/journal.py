"""Journal: a log on disk while its run goes on, whole up to the last piece whenever the process dies.

The file begins with :data:`MAGIC`. Records follow: kind (4 bytes), length and CRC-32 of the payload, the payload. The
first holds the signals' names and shapes and the metadata as JSON. Then comes one for each piece, and at the end one
with the metadata of a run that has ended.
"""

from __future__ import annotations

import json
import os
import struct
import warnings
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import RunFileError, RunFileWarning
from harpy_pin.files import journal_path
from harpy_pin.log.archive import check_name, to_json
from harpy_pin.log.pieces import ITEM, Layout, OnDisk

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows, which keeps open files from being moved
    fcntl = None

__all__ = ["Journal", "is_journal", "read_journal"]

MAGIC = b"harpy run journal 1\n"
_RECORD = struct.Struct("<4sQI")
_HEAD, _PIECE, _END = b"HEAD", b"ROWS", b"END "
MAX_TEXT = 1 << 24
"""Bytes of the metadata, at most."""
MAX_ROW = 1 << 20
"""Numbers in a row, at most."""


class Journal:
    """Written while a run goes on, and removed once the whole log has taken its place.

    It is locked while it is written, so that no other run writes the same log. A journal that an earlier run left
    behind is set aside under a name with a number.

    Args:
        target: the log that it is to become.
        metadata: of a run that has not ended.

    Attributes:
        target: the log.
        path: of the journal.
        error: why it could not go on; the pieces after that stay in memory.

    Raises:
        RunFileError: the file cannot be made, another run writes it, or the metadata are no JSON.
    """

    def __init__(self, target: str | Path, metadata: Mapping[str, Any]) -> None:
        self.target = Path(target)
        self.path = journal_path(target)
        self.error: OSError | None = None
        self._metadata = to_json(target, metadata)
        try:
            self._file = _created(self.path)
        except _InUseError as error:
            message = f"cannot write '{target}': another run is writing it (its journal is '{self.path}')"
            raise RunFileError(f"{message}; give this one another name, or wait", path=self.path) from error
        except OSError as error:
            raise RunFileError(f"cannot write '{self.path}': {error.strerror or error}", path=self.path) from error
        self._write(MAGIC)

    def begin(self, layout: Layout) -> None:
        """Write what a row holds."""
        signals = json.dumps({"signals": dict(layout.shapes), "flags": sorted(layout.flags)})
        self._record(_HEAD, f'{signals[:-1]}, "metadata": {self._metadata}}}'.encode())

    def add(self, piece: NDArray[np.float64]) -> OnDisk | None:
        """Write a piece.

        Returns:
            Where it is; None where it could not be written.
        """
        if not self._record(_PIECE, piece.view(np.uint8).data):
            return None
        return OnDisk(self._file, self._file.tell() - ITEM * len(piece), len(piece))

    def end(self, metadata: Mapping[str, Any]) -> None:
        """Write the metadata of the run that has ended."""
        self._record(_END, to_json(self.target, metadata).encode())

    def _record(self, kind: bytes, payload: bytes | memoryview) -> bool:
        return self._write(_RECORD.pack(kind, len(payload), zlib.crc32(payload))) and self._write(payload)

    def _write(self, data: bytes | memoryview) -> bool:
        """Whether it could be written; after a failure nothing more is, since a reader would stop before it."""
        if self.error is not None:
            return False
        rest = memoryview(data)
        try:
            self._file.seek(0, os.SEEK_END)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
        return self.error is None

    def close(self) -> None:
        """Leave it on disk."""
        self._file.close()

    def remove(self) -> None:
        """Remove it, unless another run has set it aside or moved it."""
        mine = os.fstat(self._file.fileno())
        if fcntl is None:
            self._file.close()  # Windows removes no open file
        if self.path.exists() and os.path.samestat(mine, self.path.stat()):
            self.path.unlink()
        self._file.close()


class _InUseError(Exception):
    """Another process, or another run of this one, writes the journal."""


def _created(path: Path) -> BinaryIO:
    """A new journal that is locked; one that is there and that nobody writes is set aside.

    Raises:
        _InUseError: a run writes the one that is there.
        OSError: it cannot be made.
    """
    with suppress(FileNotFoundError), open(path, "rb", buffering=0) as old:
        _lock(old)
        _set_aside(path)
    try:
        file: BinaryIO = open(path, "x+b", buffering=0)  # noqa: SIM115
    except FileExistsError as error:  # of a run that began at the same moment
        raise _InUseError from error
    try:
        _lock(file)
        if not os.path.samestat(os.fstat(file.fileno()), os.stat(path)):
            raise _InUseError
    except BaseException:
        file.close()
        raise
    return file


def _lock(file: BinaryIO) -> None:
    """Lock a file until it is closed; where the file system has no locks, nothing happens.

    Raises:
        _InUseError: somebody else has locked it.
    """
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise _InUseError from error
    except OSError:
        pass


def _set_aside(path: Path) -> None:
    """Move a journal that an earlier run left behind to a free name."""
    if is_journal(path) and path.stat().st_size == len(MAGIC):
        path.unlink()  # of a run that came to no tick
        return
    number = 1
    while (free := path.with_name(f"{path.name}.{number}")).exists():
        number += 1
    path.rename(free)
    warnings.warn(f"the log of a run that has not ended was set aside as '{free}'", RunFileWarning, stacklevel=5)


def is_journal(path: Path) -> bool:
    """Whether a file begins like a journal."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> tuple[dict[str, NDArray[Any]], Any]:
    """Signals and metadata of a journal, up to the last piece that is whole.

    Readers are warned.

    Raises:
        RunFileError: there is not even a first record.
    """
    try:
        with open(path, "rb", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            place, pieces, ended = len(MAGIC), [], False
            layout, metadata = Layout({}), None
            while (record := _next(file, place, size)) is not None:
                kind, length, payload = record
                begin, place = place + _RECORD.size, place + _RECORD.size + length
                if kind == _PIECE:
                    if not layout.shapes or not length or length % (ITEM * layout.width):
                        raise ValueError("a piece of another width")
                    pieces.append(OnDisk(file, begin, length // ITEM))
                elif kind == _HEAD and not layout.shapes:
                    head = json.loads(payload)
                    layout, metadata = _layout(head), head["metadata"]
                elif kind == _END and not ended:
                    metadata, ended = json.loads(payload), True
                else:
                    raise ValueError("an unknown record")
            if not layout.shapes:
                raise ValueError("no signals")
            signals = layout.assemble(iter(pieces), layout.rows(pieces))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError) as error:
        raise RunFileError(f"'{path}' is damaged or holds nothing yet", path=path) from error
    rows = len(signals.get("t", ()))
    what = "whose log was not written" if ended else "that has not ended"
    lost = "" if place == size else f"; its last {size - place} bytes are not whole"
    warnings.warn(f"'{path}' is the journal of a run {what}: {rows} ticks{lost}", RunFileWarning, stacklevel=3)
    return signals, metadata


def _next(file: BinaryIO, place: int, size: int) -> tuple[bytes, int, bytes] | None:
    """Kind, length and (of all but pieces) payload of the record at a place; None where none is whole."""
    file.seek(place)
    head = file.read(_RECORD.size)
    if len(head) < _RECORD.size:
        return None
    kind, length, crc = _RECORD.unpack(head)
    if length > size - place - _RECORD.size or (kind != _PIECE and length > MAX_TEXT):
        return None
    rest, found, payload = length, 0, b""
    while rest:
        block = file.read(min(rest, 1 << 20))
        if not block:
            return None
        found, rest = zlib.crc32(block, found), rest - len(block)
        payload += block if kind != _PIECE else b""
    return (kind, length, payload) if found == crc else None


def _layout(head: Mapping[str, Any]) -> Layout:
    shapes = {name: tuple(shape) for name, shape in head["signals"].items()}
    numbers = [number for shape in shapes.values() for number in shape]
    if not all(type(number) is int and 0 <= number <= MAX_ROW for number in numbers) or any(map(check_name, shapes)):
        raise ValueError("bad signals")
    layout = Layout(shapes, frozenset(head["flags"]))
    if not 0 < layout.width <= MAX_ROW or not layout.flags <= shapes.keys():
        raise ValueError("bad signals")
    return layout
