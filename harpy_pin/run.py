"""Run: the log of a simulation, saved as one ``.npz`` with its metadata."""

from __future__ import annotations

import json
import platform
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError, RunFileError
from harpy_pin.files import check_writable, replacing

__all__ = ["Recorder", "Run", "check_writable", "describe_versions"]

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
_NUMBERS = (float, int)
_REQUIRED = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force", "torque", "thrust")


@dataclass(frozen=True, eq=False)
class Run:
    """What happened, tick by tick.

    Attributes:
        signals: arrays with one row per control tick. Always present: ``t`` (s), ``q``, ``v``, ``foot_position``,
            ``foot_velocity``, ``foot_force`` (feet, 3), ``torque``, ``thrust`` (thrusters, 3), ``tick_ns``. A
            controller adds its own (see its ``telemetry``).
        metadata: how the run came about: parameters, versions, and how it ended.
    """

    signals: dict[str, NDArray[Any]]
    metadata: dict[str, Any]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """One signal.

        Raises:
            InputError: there is none of that name; the message lists those there are.
        """
        if name not in self.signals:
            raise InputError.unknown("signal", name, self.signals)
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
    """Grows one array per signal; rows are appended tick by tick.

    Args:
        capacity: rows to make room for at first.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = max(capacity, 1)
        self._rows = 0
        self._arrays: dict[str, NDArray[Any]] = {}
        self._names: list[str] = []
        self._shapes: list[tuple[int, ...]] = []

    def __len__(self) -> int:
        return self._rows

    def append(self, row: Mapping[str, ArrayLike]) -> None:
        """Add one row; the names and shapes are those of the first row.

        Raises:
            InputError: the names or shapes differ from those of the first row.
        """
        if self._rows == 0:
            self._start(row)
        elif self._rows == self._capacity:
            self._grow()
        if list(row) != self._names:
            row = self._in_order(row)
        i, ndarray, values = self._rows, np.ndarray, row.values()
        # Checked apart: assignment would repeat a value that is too small.
        shapes = [value.shape if isinstance(value, ndarray) else _shape(value) for value in values]
        if shapes != self._shapes:
            wrong = [name for name, old, new in zip(self._names, self._shapes, shapes, strict=True) if old != new]
            raise InputError(f"the logged signals changed shape: {', '.join(wrong)}", name="telemetry")
        for array, value in zip(self._arrays.values(), values, strict=True):
            array[i] = value
        self._rows += 1

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The rows so far; later ones leave them as they are."""
        return {name: array[: self._rows] for name, array in self._arrays.items()}

    def _start(self, row: Mapping[str, ArrayLike]) -> None:
        """Make an array for each signal of the first row."""
        samples = {name: np.asarray(value) for name, value in row.items()}
        self._names = list(samples)
        self._shapes = [sample.shape for sample in samples.values()]
        self._arrays = {
            name: np.zeros((self._capacity, *sample.shape), np.bool_ if sample.dtype == np.bool_ else np.float64)
            for name, sample in samples.items()
        }

    def _in_order(self, row: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
        """The row in the order of the first one."""
        if row.keys() != self._arrays.keys():
            raise InputError("the logged signals must be the same at every tick", name="telemetry")
        return {name: row[name] for name in self._names}

    def _grow(self) -> None:
        """Twice the room."""
        self._capacity *= 2
        self._arrays = {name: np.concatenate((array, np.zeros_like(array))) for name, array in self._arrays.items()}


def _shape(value: ArrayLike) -> tuple[int, ...]:
    """Shape of what is no array; NumPy, which would make one first, is asked only if it is no number either."""
    return () if isinstance(value, _NUMBERS) else np.shape(value)


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
