"""Run: the log of a simulation, saved as one ``.npz`` with its metadata."""

from __future__ import annotations

import json
import math
import platform
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.files import check_writable, replacing

__all__ = ["Recorder", "Run", "check_writable", "describe_versions"]

_FLOAT = np.dtype(np.float64)
FORMAT = 1
# What zipfile, zlib, NumPy and json raise on a file that is no archive of theirs, or a damaged one.
_DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    TypeError,
    AttributeError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)
_REQUIRED = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force", "torque", "thrust")


@dataclass(frozen=True, eq=False)
class Run:
    """What happened, tick by tick.

    Attributes:
        signals: arrays with one row per control tick. Always present: ``t`` (s), ``q``, ``v``, ``foot_position``,
            ``foot_velocity``, ``foot_force`` (feet, 3), ``torque``, ``thrust`` (thrusters, 3), ``tick_ns``, by the
            conventions of :class:`~harpy_pin.model.state.State`. A controller adds its own (see its ``telemetry``).
        metadata: how the run came about: parameters, versions, and how it ended.
    """

    signals: dict[str, NDArray[Any]]
    metadata: dict[str, Any]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """One signal.

        Raises:
            InputError: there is none of that name; the message lists those there are.
        """
        checks.one_of("signal", name, self.signals)
        return self.signals[name]

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __len__(self) -> int:
        return len(self.signals.get("t", ()))

    @property
    def ending(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``interrupted``, or what the controller failed with."""
        return str(self.metadata.get("ending", "unknown"))

    @property
    def fell(self) -> bool:
        """Whether the robot fell or the simulation diverged."""
        return self.ending in ("fell", "diverged")

    def save(self, path: str | Path) -> None:
        """Write the log; a file of that name is replaced only once the new one is whole.

        Raises:
            RunFileError: the file cannot be written.
        """
        header = json.dumps({**self.metadata, "format": FORMAT, "signals": sorted(self.signals)}, default=str)
        # What numpy.savez_compressed writes, without reserving names for its own arguments.
        with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, array in {"__metadata__": np.array(header), **self.signals}.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a log.

        Raises:
            RunFileError: the file is missing, damaged, or no run log.
        """
        source = Path(path)
        if not source.is_file():
            raise RunFileError(f"no run log at '{source}'", path=source)
        try:
            with np.load(source, allow_pickle=False) as archive:
                signals = {name: archive[name] for name in archive.files}
            metadata = json.loads(str(signals.pop("__metadata__")))
        except _DAMAGE as error:
            raise RunFileError(f"'{source}' is damaged or not a run log", path=source) from error
        missing = [name for name in _REQUIRED if name not in signals]
        if missing:
            raise RunFileError(f"'{source}' is not a run log: no {', '.join(missing)}", path=source)
        if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
            raise RunFileError(f"'{source}' has a format this version cannot read (expected {FORMAT})", path=source)
        if metadata.pop("signals", sorted(signals)) != sorted(signals):
            raise RunFileError(f"'{source}' is damaged: it does not hold the signals it lists", path=source)
        if len({array.shape[:1] for array in signals.values()}) != 1 or signals["t"].ndim != 1:
            raise RunFileError(f"'{source}' is damaged: its signals differ in length", path=source)
        return cls(signals, metadata)


class Recorder:
    """Keeps the signals of every tick; a row is kept as its bytes, the cheapest copy of many small arrays there is."""

    def __init__(self) -> None:
        self._rows: list[bytes] = []
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._bool: set[str] = set()

    def __len__(self) -> int:
        return len(self._rows)

    def append(self, row: Mapping[str, ArrayLike]) -> None:
        """Add one row; the names and shapes are those of the first row.

        Raises:
            InputError: names or shapes differ from those of the first row.
        """
        if not self._rows:
            self._learn(row)
        if len(row) != len(self._shapes) or not all(map(row.__contains__, self._shapes)):
            raise InputError("the logged signals must be the same at every tick", name="telemetry")
        arrays: Any = self._arrays(row)
        try:
            if [(array.shape, array.dtype) for array in arrays] == self._layout:
                self._rows.append(b"".join(arrays) + self._pack(*self._numbers(row)))
                return
        except (AttributeError, TypeError, BufferError, struct.error):
            pass  # lists, other numbers than float64, or arrays that are not contiguous: converted one by one
        self._rows.append(self._convert(row))

    def _learn(self, row: Mapping[str, ArrayLike]) -> None:
        """Names and shapes of the signals: arrays are kept first, then the numbers."""
        samples = {name: np.asarray(value) for name, value in row.items()}
        arrays = [name for name, sample in samples.items() if sample.shape != ()]
        numbers = [name for name, sample in samples.items() if sample.shape == ()]
        self._shapes = {name: samples[name].shape for name in (*arrays, *numbers)}
        self._bool = {name for name, sample in samples.items() if sample.dtype == np.bool_}
        self._layout = [(samples[name].shape, _FLOAT) for name in arrays]
        self._arrays, self._numbers = _getter(arrays), _getter(numbers)
        self._pack = struct.Struct(f"{len(numbers)}d").pack

    def _convert(self, row: Mapping[str, ArrayLike]) -> bytes:
        """Bytes of a row of any numbers."""
        parts = {name: np.array(row[name], dtype=_FLOAT, order="C") for name in self._shapes}
        wrong = [name for name, part in parts.items() if part.shape != self._shapes[name]]
        if wrong:
            raise InputError(f"the logged signals changed shape: {', '.join(wrong)}", name="telemetry")
        return b"".join(part.tobytes() for part in parts.values())

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The rows so far; nothing before the first."""
        if not self._rows:
            return {}
        flat = np.frombuffer(b"".join(self._rows), dtype=_FLOAT).reshape(len(self._rows), -1)
        arrays: dict[str, NDArray[Any]] = {}
        begin = 0
        for name, shape in self._shapes.items():
            end = begin + math.prod(shape)
            part = flat[:, begin:end].reshape(len(flat), *shape)
            arrays[name] = part != 0.0 if name in self._bool else part.copy()
            begin = end
        return arrays


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """Looks up several names at once."""
    if len(names) > 1:
        return itemgetter(*names)
    return lambda row: tuple(row[name] for name in names)


def describe_versions() -> dict[str, str]:
    """Versions of Python and of the libraries that decide the numbers."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Looked up once: searching for a package's metadata takes as long as a hundred ticks."""
    versions = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("harpy-pin", "pin", "numpy", "numba", "proxsuite"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions
