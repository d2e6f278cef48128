"""Run: the log of a simulation, saved as one ``.npz`` with its metadata."""

from __future__ import annotations

import os
import platform
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.compiled import BACKEND
from harpy_pin.compiled.compiler import version as compiler_version
from harpy_pin.deprecated import new_entries
from harpy_pin.errors import RunFileError, RunFileWarning, shown
from harpy_pin.files import check_writable, journal_path
from harpy_pin.log.archive import Column, read_archive, write_archive
from harpy_pin.log.journal import is_journal, read_journal

if TYPE_CHECKING:
    import pandas

__all__ = ["FORMAT", "Run", "describe_versions", "file_header"]

FORMAT = 1
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
    "ending": TEXT,
    "robot": TEXT,
    "controller": TEXT,
    "end_time": NUMBER,
    "control_period": NUMBER,
    "dt": NUMBER,
    "mass": NUMBER,
    "ground": MAPPING,
    "plant": MAPPING,
    "parameters": MAPPING,
    "versions": MAPPING,
    "scenario": MAPPING,
    "gravity": LIST,
    "feet": LIST,
    "thrusters": LIST,
    "pushes": LIST,
}
"""What readers of a log rely on, where it is there."""
MAX_TIME, MAX_STEP = 1e9, 10.0
"""Bounds of the times of a log and of the time between its rows, s; no simulation comes near."""
MAX_NUMBER = 1e300
"""Bound of the other numbers: JSON has whole numbers that no float can hold."""


@dataclass(frozen=True, eq=False, repr=False)
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

    def __repr__(self) -> str:
        span = float(self["t"][-1] - self["t"][0]) if len(self) else 0.0
        robot = self.metadata.get("robot", "unknown")
        return f"Run('{robot}', {span:.2f} s, {len(self)} ticks, {self.ending}, {len(self.signals)} signals)"

    def keys(self) -> list[str]:
        """Names of the signals: ``run[name]`` is the signal."""
        return list(self.signals)

    def to_pandas(self) -> pandas.DataFrame:
        """All signals as a ``pandas.DataFrame``, with the time, s, as its index and one column for each number.

        Columns are named ``foot_force/left_foot/z``: the signal, and what of it; see :mod:`harpy_pin.log.table`.

        Raises:
            InputError: pandas is not installed.
        """
        from harpy_pin.log.table import to_pandas

        return to_pandas(self)

    def to_csv(self, path: str | Path, *, every: int = 1) -> None:
        """Write all signals as a table that any program reads, in the columns of :meth:`to_pandas`.

        Args:
            path: of the file; one of that name is replaced.
            every: one row of so many is written.

        Raises:
            RunFileError: the file cannot be written.
        """
        from harpy_pin.log.table import write_csv

        write_csv(self, path, every=every)

    def to_mcap(self, path: str | Path, *, every: int = 1) -> None:
        """Write all signals as messages that Foxglove and PlotJuggler open, see :mod:`harpy_pin.log.mcap_file`.

        Args:
            path: of the file; one of that name is replaced.
            every: one row of so many is written.

        Raises:
            InputError: the package mcap is not installed.
            RunFileError: the file cannot be written.
        """
        from harpy_pin.log.mcap_file import write_mcap

        write_mcap(self, path, every=every)

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __len__(self) -> int:
        return len(self.signals.get("t", ()))

    @property
    def ending(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``interrupted``, or what the controller failed with.

        ``unfinished`` where the log is of a process that still runs, or died.
        """
        return str(self.metadata.get("ending", "unknown"))

    @property
    def fell(self) -> bool:
        """Whether the robot fell or the simulation diverged."""
        return self.ending in ("fell", "diverged")

    def save(self, path: str | Path) -> None:
        """Write the log; a file of that name is replaced only once the new one is whole.

        Args:
            path: of the file; ``.npz`` is usual and not required.

        Raises:
            RunFileError: the file cannot be written.
        """
        check_writable(path)
        arrays = {name: np.asarray(array) for name, array in self.signals.items()}
        columns = {name: Column(array.shape, array.dtype, (array,)) for name, array in arrays.items()}
        write_archive(path, file_header(self.metadata, columns), columns)

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a log.

        Where there is no such file, but the journal ``<path>.part`` of a run that has not ended (it still runs, or its
        process died), that is read, with a warning. A file is never trusted: what it holds is checked.

        Args:
            path: of a log that :meth:`save`, or a run with ``save=``, has written.

        Raises:
            RunFileError: the file is missing, damaged, or no run log.
        """
        source = checks.path("path", path)
        try:
            journal = journal_path(source)
        except ValueError as error:  # a character that no name of a file has
            raise RunFileError(f"no run log at {shown(str(source))}", path=source) from error
        if not os.path.isfile(source) and os.path.isfile(journal):
            source = journal
        elif os.path.isfile(journal) and source != journal:
            message = f"'{source}' is an older run: '{journal}' beside it is the journal of one that has not ended"
            warnings.warn(message, RunFileWarning, stacklevel=2)
        if not os.path.isfile(source):
            raise RunFileError(f"no run log at '{source}'", path=source)
        try:
            journaled = is_journal(source)
        except OSError as error:
            raise RunFileError(f"cannot read '{source}': {error.strerror or error}", path=source) from error
        signals, metadata = read_journal(source) if journaled else read_archive(source)
        _check_signals(source, signals)
        _check_metadata(source, metadata, signals)
        signals, metadata = new_entries(signals), new_entries(metadata)
        run = cls(signals, metadata)
        if run.ending == "unfinished" and len(run):
            metadata["end_time"] = float(run["t"][-1]) + metadata.get("control_period", 0.0)
        return run


def file_header(metadata: Mapping[str, Any], signals: Mapping[str, object]) -> dict[str, Any]:
    """Metadata as the file holds them."""
    return {**metadata, "format": FORMAT, "signals": sorted(signals)}


def _check_signals(source: Path, signals: Mapping[str, NDArray[Any]]) -> None:
    """Refuse what is not the log of a robot over time."""
    missing = [name for name in AXES if name not in signals]
    if missing:
        raise RunFileError(f"'{source}' is not a run log: no {', '.join(missing)}", path=source)
    if any(array.ndim == 0 for array in signals.values()) or len({len(array) for array in signals.values()}) != 1:
        raise RunFileError(f"'{source}' is damaged: its signals differ in length", path=source)
    for name, axes in AXES.items():
        shape, dtype = signals[name].shape[1:], signals[name].dtype
        fits = len(shape) == len(axes) and all(n in (None, m) for n, m in zip(axes, shape, strict=True))
        if not fits or (name in LEAST and shape[0] < LEAST[name]):
            raise RunFileError(f"'{source}' is not a run log: {name} has shape {signals[name].shape}", path=source)
        if dtype != np.float64:
            raise RunFileError(f"'{source}' is not a run log: {name} holds {dtype}, not float64", path=source)
    if len({signals[name].shape[1] for name in AXES if name.startswith("foot")}) != 1:
        raise RunFileError(f"'{source}' is damaged: its signals differ in the number of feet", path=source)
    time = signals["t"]
    if not np.all(np.abs(time) < MAX_TIME):
        raise RunFileError(f"'{source}' is damaged: its times are not finite or beyond {MAX_TIME:g} s", path=source)
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) else 1.0
    if not 0.0 < step <= MAX_STEP or np.any(np.abs(steps - step) > 0.5 * step):
        raise RunFileError(f"'{source}' is damaged: its times do not go on evenly", path=source)


def _check_metadata(source: Path, metadata: Any, signals: Mapping[str, object]) -> None:
    """Refuse metadata of another format or of odd types."""
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise RunFileError(f"'{source}' has a format this version cannot read (expected {FORMAT})", path=source)
    if metadata.pop("signals", sorted(signals)) != sorted(signals):
        raise RunFileError(f"'{source}' is damaged: it does not hold the signals it lists", path=source)
    for name, kinds in KINDS.items():
        value = metadata.get(name, kinds[0]())
        good = type(value) in kinds
        if good and kinds == NUMBER:
            good = abs(value) < MAX_NUMBER
        if good and name in ("feet", "thrusters"):
            good = all(type(entry) is str for entry in value)
        if not good:
            raise RunFileError(f"'{source}' is not a run log: {name} is {shown(value)}", path=source)


def describe_versions() -> dict[str, str]:
    """Versions of Python and of the libraries that decide the numbers."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Looked up once: searching for a package's metadata takes as long as a hundred ticks."""
    versions = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("harpy-pin", "pin", "numpy", "proxsuite", *(["numba"] if BACKEND == "numba" else [])):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    versions["kernels"] = f"C, {compiler_version()}" if BACKEND == "c" else BACKEND
    return versions
