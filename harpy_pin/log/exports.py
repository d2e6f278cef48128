"""A run as a table, for pandas and for any spreadsheet: a name for each number of each signal.

A column's name is that of its signal, and which number it is, with ``/`` between: ``foot_force/FL_foot/z``,
``q/7``, ``thrust/left_thruster/x``. Programs such as PlotJuggler show these as a tree.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.files import replacing

if TYPE_CHECKING:
    from harpy_pin.log.run import Run

__all__ = ["columns", "write_csv"]

AXES = ("x", "y", "z")


def _column_names(run: Run, signal: str) -> list[str]:
    """Names of the numbers in a row of a signal, in their order in memory, without that of the signal.

    Args:
        run: gives the names of feet and thrusters.
        signal: its name.
    """
    shape = run[signal].shape[1:]
    names = []
    for axis, size in enumerate(shape):
        last = axis == len(shape) - 1
        owner = "thrusters" if signal.startswith("thrust") else "feet"
        known = run.metadata.get(owner)
        if axis == 0 and _is_of_parts(signal, len(shape)) and isinstance(known, list | tuple) and len(known) == size:
            names.append([str(name) for name in known])
        else:
            names.append(list(AXES) if last and size == 3 and axis > 0 else [str(k) for k in range(size)])
    return ["/".join(parts) for parts in product(*names)]


def _is_of_parts(signal: str, axes: int) -> bool:
    """Whether the rows of a signal are of feet or thrusters."""
    return signal.startswith(("foot_", "slip_", "thrust", "stance", "friction_estimate")) or axes == 2


def columns(run: Run) -> Iterator[tuple[str, NDArray[Any]]]:
    """Name and values of every column, the time first."""
    yield "t", np.asarray(run["t"])
    for signal in run.signals:
        if signal == "t":
            continue
        values = np.asarray(run[signal]).reshape(len(run), -1)
        for number, name in enumerate(_column_names(run, signal)):
            yield (f"{signal}/{name}" if name else signal), values[:, number]


def write_csv(run: Run, path: Path, *, every: int) -> None:
    """What :meth:`harpy_pin.log.run.Run.to_csv` does, with the same arguments and errors."""
    names, values = zip(*columns(run), strict=True)
    rows = zip(*(column[::every].tolist() for column in values), strict=True)
    with replacing(path) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
        writer = csv.writer(text)
        writer.writerow(names)
        writer.writerows(rows)
        text.detach()
