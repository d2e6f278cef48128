"""Recorder: the rows of a run while it goes on, in memory or in a journal on disk."""

import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError, shown
from harpy_pin.log.journal import FLOAT, Journal, Layout
from harpy_pin.log.run_file import check_name

BLOCK = 1000
"""Rows of a block, at most."""


class Recorder:
    """Keeps the signals of every tick: a row as its bytes, the cheapest copy of many small arrays
    there is.

    Args:
        journal: takes the blocks; they stay in memory where there is none, or once its disk is
            full.
        block: rows that are written at a time.
    """

    def __init__(self, journal: Journal | None = None, *, block: int = BLOCK) -> None:
        self._journal = journal
        self._size = block
        # a walk that is killed at once leaves its first tick
        self._due = block if journal is None else 1
        self._rows: list[bytes] = []  # one row each, or several
        self._held = 0  # rows in them
        self._before = 0
        self._blocks: deque[bytes] = deque()
        self._layout = Layout({})

    def __len__(self) -> int:
        return self._before + self._held

    @property
    def layout(self) -> Layout:
        """Layout of a row; there is none before the first."""
        return self._layout

    @property
    def room(self) -> int:
        """Rows until the next block is full."""
        return self._due - self._held

    def append_table(self, table: NDArray[np.float64]) -> None:
        """Add rows (rows, width) that are laid out as :attr:`layout` says, at most :attr:`room`."""
        self._add(table.tobytes(), len(table))

    def append(self, row: Mapping[str, ArrayLike]) -> None:
        """Add one row; the names and shapes are those of the first row.

        Args:
            row: arrays and numbers by name.

        Raises:
            InputError: names or shapes differ from those of the first row, or a name is none for a
                signal.
        """
        if not self._layout.shapes:
            self._learn(row)
        if row.keys() != self._layout.shapes.keys():
            raise InputError("the logged signals must be the same at every tick", name="telemetry")
        arrays = self._arrays(row)
        try:
            fit = [(array.shape, array.dtype) for array in arrays] == self._forms
            packed = (
                b"".join(arrays) + self._pack(*self._numbers(row)) if fit else self._convert(row)
            )
        except (AttributeError, TypeError, BufferError, struct.error):
            packed = self._convert(row)  # lists, or arrays that are not contiguous
        self._add(packed, 1)

    def _learn(self, row: Mapping[str, ArrayLike]) -> None:
        """Names and shapes of the signals: arrays are kept first, then the numbers."""
        samples = {name: np.asarray(value) for name, value in row.items()}
        for name in samples:
            reason = check_name(name)
            if reason:
                raise InputError(
                    f"no signal can be called {shown(name)}: {reason}", name="telemetry", value=name
                )
        arrays = [name for name, sample in samples.items() if sample.shape != ()]
        numbers = [name for name, sample in samples.items() if sample.shape == ()]
        flags = frozenset(name for name, sample in samples.items() if sample.dtype == np.bool_)
        self._layout = Layout({name: samples[name].shape for name in (*arrays, *numbers)}, flags)
        self._forms = [(samples[name].shape, FLOAT) for name in arrays]
        self._arrays, self._numbers = _getter(arrays), _getter(numbers)
        self._pack = struct.Struct(f"{len(numbers)}d").pack
        if self._journal is not None:
            self._journal.begin(self._layout)

    def _convert(self, row: Mapping[str, ArrayLike]) -> bytes:
        """Bytes of a row of any numbers."""
        shapes = self._layout.shapes
        parts = {name: np.array(row[name], dtype=FLOAT, order="C") for name in shapes}
        wrong = [name for name, part in parts.items() if part.shape != shapes[name]]
        if wrong:
            raise InputError(
                f"the logged signals changed shape: {', '.join(wrong)}", name="telemetry"
            )
        return b"".join(part.tobytes() for part in parts.values())

    def _add(self, packed: bytes, rows: int) -> None:
        """Keep rows as their bytes."""
        self._rows.append(packed)
        self._held += rows
        if self._held >= self._due:
            self.flush()

    def flush(self) -> None:
        """Make a block of the latest rows, on disk where there is a journal."""
        if not self._held:
            return
        block = b"".join(self._rows)
        if self._journal is None or not self._journal.add(block):
            self._blocks.append(block)
        self._before += self._held
        self._rows, self._held = [], 0
        self._due = self._size - self._before % self._size

    def take(self) -> dict[str, NDArray[Any]]:
        """All signals, each with a row for every tick; the recorder is empty then."""
        self.flush()
        blocks = self._blocks if self._journal is None else self._journal.blocks() + self._blocks
        self._blocks, self._before = deque(), 0
        return self._layout.signals(blocks)


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """Looks up several names at once."""
    if len(names) > 1:
        return itemgetter(*names)
    return lambda row: tuple(row[name] for name in names)
