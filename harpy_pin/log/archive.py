"""The file of a run: an ``.npz`` that plain NumPy reads, written and read piece by piece, and never believed."""

from __future__ import annotations

import io
import json
import math
import mmap
import os
import struct
import sys
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import RunFileError
from harpy_pin.files import replacing

__all__ = ["MAPPED", "Column", "check_name", "read_archive", "release", "to_json", "write_archive"]

METADATA = "__metadata__"
MAPPED = 1 << 28
"""Bytes above which a log is mapped from its file instead of read into memory."""
MAX_TEXT = 1 << 26
"""Bytes of the metadata in the file, at most (four for each character)."""
MAX_SIGNALS = 1000
SMALL, RATIO, MAX_PACKED = 1 << 26, 100, 1 << 31
"""A file may not say that it holds more bytes than SMALL and more than RATIO times its size, nor more than MAX_PACKED
bytes in arrays that are compressed."""
BLOCK = 1 << 20
PAGE_OUT = 21
"""Linux's MADV_PAGEOUT, which Python does not name: give memory back, and lose nothing that was written to it."""
# What zipfile, zlib, NumPy and json raise on a file that is no archive of theirs, or a damaged one.
_DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    TypeError,
    AttributeError,
    RuntimeError,
    SyntaxError,
    MemoryError,
    OverflowError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


class Column(NamedTuple):
    """One signal on its way into a file.

    Attributes:
        shape: of the whole.
        dtype: of the numbers.
        blocks: the rows in order, as many at a time as one likes.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    blocks: Iterable[NDArray[Any]]


def check_name(name: str) -> str:
    """Why no signal can have this name; empty if it can."""
    if not 0 < len(name) <= 100:
        return "it must have 1 to 100 characters"
    if name.startswith("__"):
        return "names that begin with '__' are the log's own"
    if not name.isprintable() or set(name) & set("/\\<>&[]\"'`"):
        return "it holds characters that mean something in paths or markup"
    return ""


def _check_numbers(path: Path, name: str, dtype: np.dtype[Any]) -> None:
    """Refuse everything but plain numbers."""
    if dtype.kind not in "fiub" or dtype.itemsize > 8 or not dtype.isnative or dtype.fields or dtype.subdtype:
        raise RunFileError(f"'{path}' is not a run log: {name} holds {dtype}, not plain numbers", path=path)


def to_json(path: str | Path, metadata: Mapping[str, Any]) -> str:
    """Metadata as text.

    Raises:
        RunFileError: they cannot be.
    """
    try:
        return json.dumps(metadata, default=str)
    except (TypeError, ValueError, RecursionError) as error:
        raise RunFileError(f"cannot write '{path}': the metadata are no JSON: {error}", path=path) from error


def write_archive(path: str | Path, metadata: Mapping[str, Any], signals: Mapping[str, Column]) -> None:
    """Write a log; a file of that name is replaced only once the new one is whole.

    Raises:
        RunFileError: the file cannot be written, or a signal has a name or a type that no log can hold.
    """
    for name, column in signals.items():
        _check_numbers(Path(path), name, column.dtype)
        reason = check_name(name)
        if reason:
            raise RunFileError(f"cannot write '{path}': signal {name!r}: {reason}", path=path)
    header = np.array(to_json(path, metadata))
    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, column in {METADATA: Column((), header.dtype, (header,)), **signals}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                entry.write(_array_header(column, file.tell() if file.seekable() else 0))
                for block in column.blocks:
                    entry.write(np.ascontiguousarray(block).reshape(-1).view(np.uint8).data)


def _array_header(column: Column, offset: int) -> bytes:
    """NumPy's header, so long that the numbers begin at a multiple of 64 bytes of the file and can be mapped."""
    buffer = io.BytesIO()
    description = {"descr": np.lib.format.dtype_to_descr(column.dtype), "fortran_order": False, "shape": column.shape}
    np.lib.format.write_array_header_1_0(buffer, description)
    header = buffer.getvalue()  # 8 bytes of magic, 2 of length, text that ends with spaces and a new line
    spaces = -(offset + len(header)) % 64
    return header[:8] + struct.pack("<H", len(header) - 10 + spaces) + header[10:-1] + b" " * spaces + b"\n"


def read_archive(path: Path) -> tuple[dict[str, NDArray[Any]], Any]:
    """Signals and metadata of a log.

    Raises:
        RunFileError: the file is damaged, or holds what no log holds.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            size = os.fstat(file.fileno()).st_size
            entries = _entries(path, archive, size)
            if METADATA not in entries:
                raise RunFileError(f"'{path}' is not a run log: no metadata", path=path)
            metadata = json.loads(str(_read(path, archive, METADATA, entries.pop(METADATA), None)))
            big = sum(entry.file_size for entry in entries.values()) > MAPPED
            memory = (file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)) if big else None
            return {name: _read(path, archive, name, entry, memory) for name, entry in entries.items()}, metadata
    except _DAMAGE as error:
        raise RunFileError(f"'{path}' is damaged or not a run log", path=path) from error


def _entries(path: Path, archive: zipfile.ZipFile, size: int) -> dict[str, zipfile.ZipInfo]:
    """The arrays of an archive by name; what an honest one cannot hold is refused before anything is unpacked."""
    entries: dict[str, zipfile.ZipInfo] = {}
    for entry in archive.infolist():
        name = entry.filename.removesuffix(".npy")
        reason = "" if name == METADATA else check_name(name)
        if name in entries:
            reason = "it is there twice"
        elif name == entry.filename:
            reason = "it is no array"
        elif entry.flag_bits & 1 or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            reason = "it is encrypted or compressed in a foreign way"
        elif name == METADATA and entry.file_size > MAX_TEXT:
            reason = "it is too long"
        if reason:
            raise RunFileError(f"'{path}' is not a run log: entry {name[:100]!r}: {reason}", path=path)
        entries[name] = entry
    if len(entries) > MAX_SIGNALS:
        raise RunFileError(f"'{path}' is not a run log: it holds {len(entries)} arrays", path=path)
    declared = sum(entry.file_size for entry in entries.values())
    packed = sum(entry.file_size for entry in entries.values() if entry.compress_type != zipfile.ZIP_STORED)
    if declared > max(SMALL, RATIO * size) or packed > MAX_PACKED:
        raise RunFileError(f"'{path}' says that its {size} bytes hold {declared}: too many to be a run log", path=path)
    return entries


def _read(
    path: Path, archive: zipfile.ZipFile, name: str, info: zipfile.ZipInfo, memory: tuple[IO[bytes], mmap.mmap] | None
) -> NDArray[Any]:
    """One array, its checksum verified; mapped where there is a mapping and the numbers lie in it as they are."""
    with archive.open(info) as entry:
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, fortran, dtype = read_header[np.lib.format.read_magic(entry)](entry)
        if name != METADATA:
            _check_numbers(path, name, dtype)
        elif shape != () or dtype.kind != "U" or not dtype.isnative:
            raise ValueError("metadata that are no text")
        begin, count = entry.tell(), math.prod(shape)
        if min(shape, default=0) < 0 or begin + count * dtype.itemsize != info.file_size:
            raise RunFileError(f"'{path}' is damaged: {name} is not as long as it says", path=path)
        start = 0
        if memory is not None and info.compress_type == zipfile.ZIP_STORED:
            start = begin + _start(memory[0], info)
        mapped = start > 0 and start % dtype.itemsize == 0
        out = np.empty(0 if mapped else count, dtype)
        view, place = out.view(np.uint8).data, 0
        while block := entry.read(BLOCK):  # to the end, where the checksum is compared
            if not mapped:
                view[place : place + len(block)] = block
            place += len(block)
        if begin + place != info.file_size:
            raise EOFError
    if mapped and memory is not None:
        out = np.frombuffer(memory[1], dtype, count, start)
    return out.reshape(shape[::-1]).T if fortran else out.reshape(shape)


def release(arrays: Iterable[NDArray[Any]]) -> None:
    """Give back the memory of arrays that lie in a file; their numbers are read again when they are needed.

    Elsewhere than on Linux nothing happens: the system takes the memory back once it is short of it.
    """
    if sys.platform != "linux":
        return
    for mapping in {id(found): found for found in map(_mapping, arrays) if found is not None}.values():
        with suppress(OSError):  # an older Linux
            mapping.madvise(PAGE_OUT)


def _mapping(array: Any) -> mmap.mmap | None:
    """The mapping that an array is a view of."""
    while isinstance(array, np.ndarray):
        array = array.base
    owner = array.obj if isinstance(array, memoryview) else array
    return owner if isinstance(owner, mmap.mmap) else None


def _start(file: IO[bytes], info: zipfile.ZipInfo) -> int:
    """Where the bytes of an entry begin in the file."""
    file.seek(info.header_offset + 26)
    name, extra = struct.unpack("<HH", file.read(4))
    return int(info.header_offset + 30 + name + extra)
