"""The file of a run: an ``.npz`` that plain NumPy reads, replaced only when the new one is whole,
never trusted.
"""

import json
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import RunFileError, shown
from harpy_pin.files import replacing

FORMAT = 1
METADATA = "__metadata__"
AXES = {
    "t": (),
    "q": (None,),
    "v": (None,),
    "foot_position": (None, 3),
    "foot_velocity": (None, 3),
    "foot_force": (None, 3),
    "torque": (None,),
    "thrust": (None, 3),
}
"""Signals of every log, and the axes of one row; None where the robot decides."""
LEAST = {"q": 7, "v": 6}
"""Numbers in a row, at least: those of the base."""
TEXT, NUMBER, MAPPING, LIST = (str,), (int, float), (dict,), (list,)
KINDS: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("ending", "robot", "controller"), TEXT),
    **dict.fromkeys(("end_time", "control_period", "dt", "mass"), NUMBER),
    **dict.fromkeys(("ground", "plant", "parameters", "versions", "scenario"), MAPPING),
    **dict.fromkeys(("gravity", "feet", "thrusters", "pushes"), LIST),
}
"""Types of the metadata that readers of a log rely on, where they are there."""
MAX_TIME, MAX_STEP = 1e9, 10.0
"""Bounds of the times of a log and of the time between its rows, s; no simulation comes near."""
MAX_NUMBER = 1e300
"""Bound of the other numbers: JSON has whole numbers that no float can hold."""
MAX_TEXT = 1 << 26
"""Bytes of the metadata in the file, at most (four for each character)."""
MAX_SIGNALS = 1000
SMALL, RATIO, MAX_PACKED = 1 << 26, 100, 1 << 31
"""A file may not say that it holds more bytes than SMALL and more than RATIO times its size, nor
more than MAX_PACKED bytes in arrays that are compressed.
"""
DAMAGE = (
    *(
        OSError,
        ValueError,
        KeyError,
        EOFError,
        TypeError,
        AttributeError,
        RuntimeError,
        SyntaxError,
        MemoryError,
    ),
    *(OverflowError, struct.error, zipfile.BadZipFile, zlib.error),
)
"""What zipfile, zlib, NumPy and json raise on a file that is no archive of theirs, or a damaged
one.
"""


def check_name(name: str) -> str:
    """Why no signal can have this name; empty if it can."""
    if not 0 < len(name) <= 100:
        return "it must have 1 to 100 characters"
    if name.startswith("__"):
        return "names that begin with '__' are the log's own"
    if not name.isprintable() or set(name) & set("/\\<>&[]\"'`"):
        return "it holds characters that mean something in paths or markup"
    return ""


def _require(holds: object, path: str | Path, why: str) -> None:
    """Refuse a file where something does not hold; ``why`` comes after its name."""
    if not holds:
        raise RunFileError(f"'{path}' {why}", path=path)


def _check_numbers(path: str | Path, name: str, dtype: np.dtype[Any]) -> None:
    """Refuse everything but plain numbers."""
    plain = dtype.kind in "fiub" and dtype.itemsize <= 8 and dtype.isnative
    _require(plain, path, f"is not a run log: {name} holds {dtype}, not plain numbers")


def to_json(path: str | Path, metadata: Mapping[str, Any]) -> str:
    """Metadata as text.

    Raises:
        RunFileError: they cannot be.
    """
    try:
        return json.dumps(metadata, default=str)
    except (TypeError, ValueError, RecursionError) as error:
        raise RunFileError(
            f"cannot write '{path}': the metadata are no JSON: {error}", path=path
        ) from error


def write_run(
    path: str | Path, metadata: Mapping[str, Any], signals: Mapping[str, NDArray[Any]]
) -> None:
    """Write a log; a file of that name is replaced only once the new one is whole.

    Raises:
        RunFileError: the file cannot be written, or a signal has a name or a type that no log can
            hold.
    """
    arrays = {name: np.asarray(signal) for name, signal in signals.items()}
    for name, array in arrays.items():
        _check_numbers(path, name, array.dtype)
        reason = check_name(name)
        if reason:
            raise RunFileError(f"cannot write '{path}': signal {name!r}: {reason}", path=path)
    header = to_json(path, {**metadata, "format": FORMAT, "signals": sorted(signals)})
    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in {METADATA: np.array(header), **arrays}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


def read_run(path: Path) -> tuple[dict[str, NDArray[Any]], Any]:
    """Signals and metadata of a log.

    Raises:
        RunFileError: the file is damaged, or holds what no log holds.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            entries = _entries(path, archive, os.fstat(file.fileno()).st_size)
            arrays = {name: _read(path, archive, name, entry) for name, entry in entries.items()}
        _require(METADATA in arrays, path, "is not a run log: no metadata")
        return arrays, json.loads(str(arrays.pop(METADATA)))
    except DAMAGE as error:
        raise RunFileError(f"'{path}' is damaged or not a run log", path=path) from error


def _entries(path: Path, archive: zipfile.ZipFile, size: int) -> dict[str, zipfile.ZipInfo]:
    """The arrays of an archive by name; what an honest one cannot hold is refused before anything
    is unpacked.
    """
    entries: dict[str, zipfile.ZipInfo] = {}
    for entry in archive.infolist():
        name = entry.filename.removesuffix(".npy")
        reason = "" if name == METADATA else check_name(name)
        if name in entries:
            reason = "it is there twice"
        elif name == entry.filename:
            reason = "it is no array"
        elif entry.flag_bits & 1 or entry.compress_type not in (
            zipfile.ZIP_STORED,
            zipfile.ZIP_DEFLATED,
        ):
            reason = "it is encrypted or compressed in a foreign way"
        elif name == METADATA and entry.file_size > MAX_TEXT:
            reason = "it is too long"
        _require(not reason, path, f"is not a run log: entry {name[:100]!r}: {reason}")
        entries[name] = entry
    few = len(entries) <= MAX_SIGNALS
    _require(few, path, f"is not a run log: it holds {len(entries)} arrays")
    declared = sum(entry.file_size for entry in entries.values())
    packed = sum(
        entry.file_size for entry in entries.values() if entry.compress_type != zipfile.ZIP_STORED
    )
    fits = declared <= max(SMALL, RATIO * size) and packed <= MAX_PACKED
    _require(fits, path, f"says that its {size} bytes hold {declared}: too many to be a run log")
    return entries


def _read(path: Path, archive: zipfile.ZipFile, name: str, info: zipfile.ZipInfo) -> NDArray[Any]:
    """One array; zipfile verifies its checksum."""
    with archive.open(info) as entry:
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        shape, fortran, dtype = read_header[np.lib.format.read_magic(entry)](entry)
        if name == METADATA:
            _require(shape == () and dtype.kind == "U" and dtype.isnative, path, "has no metadata")
        else:
            _check_numbers(path, name, dtype)
        size = entry.tell() + math.prod(shape) * dtype.itemsize
        whole = min(shape, default=0) >= 0 and size == info.file_size
        _require(whole, path, f"is damaged: {name} is not as long as it says")
        array = np.frombuffer(bytearray(entry.read()), dtype, math.prod(shape))
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


def check_log(source: Path, signals: Mapping[str, NDArray[Any]], metadata: Any) -> None:
    """Refuse what is not the log of a robot over time; takes the list of signals out of the
    metadata.

    Raises:
        RunFileError: it is not.
    """
    known = isinstance(metadata, dict) and metadata.get("format") == FORMAT
    _require(known, source, f"has a format this version cannot read (expected {FORMAT})")
    _check_signals(source, signals)
    listed = metadata.pop("signals", sorted(signals)) == sorted(signals)
    _require(listed, source, "is damaged: it does not hold the signals it lists")
    for name, kinds in KINDS.items():
        value = metadata.get(name, kinds[0]())
        good = type(value) in kinds
        if good and kinds == NUMBER:
            good = abs(value) < MAX_NUMBER
        if good and name in ("feet", "thrusters"):
            good = all(type(entry) is str for entry in value)
        _require(good, source, f"is not a run log: {name} is {shown(value)}")


def _check_signals(source: Path, signals: Mapping[str, NDArray[Any]]) -> None:
    """Refuse signals of other shapes and types, and times that do not go on."""
    missing = ", ".join(name for name in AXES if name not in signals)
    _require(not missing, source, f"is not a run log: no {missing}")
    lengths = {len(array) if array.ndim else -1 for array in signals.values()}
    _require(len(lengths) == 1, source, "is damaged: its signals differ in length")
    for name, axes in AXES.items():
        shape, dtype = signals[name].shape, signals[name].dtype
        fits = len(shape) == len(axes) + 1 and all(
            n in (None, m) for n, m in zip(axes, shape[1:], strict=True)
        )
        fits = fits and (name not in LEAST or shape[1] >= LEAST[name])
        _require(fits, source, f"is not a run log: {name} has shape {shape}")
        exact = dtype == np.float64
        _require(exact, source, f"is not a run log: {name} holds {dtype}, not float64")
    feet = {signals[name].shape[1] for name in AXES if name.startswith("foot")}
    _require(len(feet) == 1, source, "is damaged: its signals differ in the number of feet")
    time = signals["t"]
    finite = np.all(np.abs(time) < MAX_TIME)
    _require(finite, source, f"is damaged: its times are not finite or beyond {MAX_TIME:g} s")
    steps = np.diff(time)
    goes_on = np.all(steps > 0.0) and (len(steps) == 0 or np.median(steps) <= MAX_STEP)
    _require(goes_on, source, "is damaged: its times do not go on")
