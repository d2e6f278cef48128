"""Run: the log of a simulation, saved as one ``.npz`` with its metadata."""

from __future__ import annotations

import csv
import io
import os
import platform
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, RunFileError, RunFileWarning, install_line, shown
from harpy_pin.files import check_writable, journal_path, replacing
from harpy_pin.kernels.compiler import version as compiler_version
from harpy_pin.log.journal import is_journal, read_journal
from harpy_pin.log.run_file import check_log, read_run, write_run

if TYPE_CHECKING:
    import pandas


AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What happened, tick by tick.

    Attributes:
        signals: arrays with one row per control tick. Always present: ``t`` (s), ``q``, ``v``,
            ``foot_position``, ``foot_velocity``, ``foot_force`` (feet, 3), ``torque``, ``thrust``
            (thrusters, 3), ``tick_ns``, by the conventions of
            :class:`~harpy_pin.model.state.State`. A controller adds its own (see its
            ``telemetry``).
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
        return (
            f"Run('{robot}', {span:.2f} s, {len(self)} ticks, {self.ending[:200]}, "
            f"{len(self.signals)} signals)"
        )

    def keys(self) -> list[str]:
        """Names of the signals: ``run[name]`` is the signal."""
        return list(self.signals)

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __len__(self) -> int:
        return len(self.signals.get("t", ()))

    @property
    def ending(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``interrupted``, or what the controller failed
        with.

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
        write_run(path, self.metadata, self.signals)

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a log.

        Where there is no such file, but the journal ``<path>.part`` of a run that has not ended (it
        still runs, or its process died), that is read, with a warning. A file is never trusted:
        what it holds is checked.

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
            warnings.warn(
                f"'{source}' is an older run: '{journal}' beside it is the journal of one "
                f"that has not ended",
                RunFileWarning,
                stacklevel=2,
            )
        if not os.path.isfile(source):
            raise RunFileError(f"no run log at '{source}'", path=source)
        try:
            journaled = is_journal(source)
        except OSError as error:
            raise RunFileError(
                f"cannot read '{source}': {error.strerror or error}", path=source
            ) from error
        signals, metadata = read_journal(source) if journaled else read_run(source)
        check_log(source, signals, metadata)
        run = cls(signals, metadata)
        if run.ending == "unfinished" and len(run):
            metadata["end_time"] = float(run["t"][-1]) + metadata.get("control_period", 0.0)
        return run

    def to_pandas(self) -> pandas.DataFrame:
        """All signals as a ``pandas.DataFrame``, with the time, s, as its index and one column for
        each number.

        Columns are named ``foot_force/left_foot/z``, ``q/7``: the signal, and which of its numbers;
        programs such as PlotJuggler show the names as a tree.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise InputError(
                f"pandas cannot be imported ({error}): {install_line('pandas')}", name="pandas"
            ) from error
        return pandas.DataFrame(dict(columns(self))).set_index("t")

    def to_csv(self, path: str | Path, *, every: int = 1) -> None:
        """Write all signals as a table that any program reads, in the columns of :meth:`to_pandas`.

        Args:
            path: of the file; one of that name is replaced.
            every: one row of so many is written.

        Raises:
            RunFileError: the file cannot be written.
        """
        target, every = checks.path("path", path), checks.whole("every", every, low=1)
        names, values = zip(*columns(self), strict=True)
        rows = zip(*(column[::every].tolist() for column in values), strict=True)
        with replacing(target) as file:
            text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
            writer = csv.writer(text)
            writer.writerow(names)
            writer.writerows(rows)
            text.detach()


def describe_versions() -> dict[str, str]:
    """Versions of Python and of the libraries that decide the numbers."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Looked up once: searching for a package's metadata takes as long as a hundred ticks."""
    versions = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("harpy-pin", "pin", "numpy", "proxsuite"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    versions["kernels"] = f"C, {compiler_version()}"
    return versions


def _column_names(run: Run, signal: str) -> list[str]:
    """Names of the numbers in a row of a signal, in their order in memory, without that of the
    signal.
    """
    shape = run[signal].shape[1:]
    names = []
    for axis, size in enumerate(shape):
        last = axis == len(shape) - 1
        owner = "thrusters" if signal.startswith("thrust") else "feet"
        known = run.metadata.get(owner)
        if (
            axis == 0
            and _is_of_parts(signal, len(shape))
            and isinstance(known, list | tuple)
            and len(known) == size
        ):
            names.append([str(name) for name in known])
        else:
            names.append(
                list(AXES) if last and size == 3 and axis > 0 else [str(k) for k in range(size)]
            )
    return ["/".join(parts) for parts in product(*names)]


def _is_of_parts(signal: str, axes: int) -> bool:
    """Whether the rows of a signal are of feet or thrusters."""
    return (
        signal.startswith(("foot_", "slip_", "thrust", "stance", "friction_estimate")) or axes == 2
    )


def columns(run: Run) -> Iterator[tuple[str, NDArray[Any]]]:
    """Name and values of every column, the time first."""
    yield "t", np.asarray(run["t"])
    for signal in run.signals:
        if signal == "t":
            continue
        names = _column_names(run, signal)
        values = np.asarray(run[signal]).reshape(len(run), len(names))
        for number, name in enumerate(names):
            yield (f"{signal}/{name}" if name else signal), values[:, number]
