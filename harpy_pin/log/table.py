"""A run as a table: a name for each number of each signal.

A column's name is that of its signal, and which number it is, with ``/`` between: ``foot_force/FL_foot/z``,
``q/7``, ``thrust/left_thruster/x``. Programs such as PlotJuggler show these as a tree.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from harpy_pin.log.run import Run

__all__ = ["column_names", "columns"]

AXES = ("x", "y", "z")


def column_names(run: Run, signal: str) -> list[str]:
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
        for number, name in enumerate(column_names(run, signal)):
            yield (f"{signal}/{name}" if name else signal), values[:, number]
