"""Recorder: the rows of a run while it goes on, in memory or in a journal on disk."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError, shown
from harpy_pin.log.archive import Column, check_name
from harpy_pin.log.journal import Journal
from harpy_pin.log.pieces import ITEM, Layout, Piece

__all__ = ["PIECE", "Recorder"]

_FLOAT = np.dtype(np.float64)
PIECE = 1000
"""Rows of a piece, at most."""


class Recorder:
    """Keeps the signals of every tick.

    A row is kept as its bytes, the cheapest copy of many small arrays there is, and many rows together as a piece.

    Args:
        journal: takes the pieces; they stay in memory where there is none, or once its disk is full.
        piece: rows of a piece.
    """

    def __init__(self, journal: Journal | None = None, *, piece: int = PIECE) -> None:
        self._journal = journal
        self._size = piece
        self._due = piece if journal is None else 1  # a walk that is killed at once leaves its first tick
        self._rows: list[bytes] = []  # one row each, or several
        self._held = 0  # rows in them
        self._pieces: list[Piece] = []
        self._before = 0
        self._layout = Layout({})
        self._last: tuple[Any, ...] | None = None  # arrays of the last row, known to fit

    def __len__(self) -> int:
        return self._before + self._held

    @property
    def nbytes(self) -> int:
        """Of all rows."""
        return ITEM * self._layout.width * len(self)

    @property
    def layout(self) -> Layout:
        """Of a row; there is none before the first."""
        return self._layout

    @property
    def room(self) -> int:
        """Rows until the next piece is full."""
        return self._due - self._held

    def append_table(self, table: NDArray[np.float64]) -> None:
        """Add rows that are laid out as :attr:`layout` says.

        Args:
            table: (rows, width), at most :attr:`room` rows.
        """
        self._add(table.tobytes(), len(table))

    def append(self, row: Mapping[str, ArrayLike], *, known: int = 0) -> None:
        """Add one row; the names and shapes are those of the first row.

        Args:
            row: arrays and numbers by name.
            known: how many of the first arrays are float64 and of the first row's shapes for certain. Of the others,
                those that are the very arrays of the last row are not looked at again.

        Raises:
            InputError: names or shapes differ from those of the first row, or a name is none for a signal.
        """
        shapes = self._layout.shapes
        if not shapes:
            shapes = self._learn(row)
        if len(row) != len(shapes) or not all(map(row.__contains__, shapes)):
            raise InputError("the logged signals must be the same at every tick", name="telemetry")
        arrays: Any = self._arrays(row)
        try:
            fit = self._fits(arrays[known:], known)
            packed = b"".join(arrays) + self._pack(*self._numbers(row)) if fit else self._convert(row)
        except (AttributeError, TypeError, BufferError, struct.error):
            packed = self._convert(row)  # lists, or arrays that are not contiguous
        self._add(packed, 1)

    def _add(self, packed: bytes, rows: int) -> None:
        """Keep rows as their bytes."""
        self._rows.append(packed)
        self._held += rows
        if self._held >= self._due:
            self.flush()

    def _fits(self, arrays: tuple[Any, ...], known: int) -> bool:
        """Whether arrays may be kept as their bytes; those that are the very ones of the last row are known to."""
        last, expected = self._last, self._expected[known:]
        if last is None:
            fit = [(array.shape, array.dtype) for array in arrays] == expected
        else:
            fit = all(
                array is before or (array.shape, array.dtype) == form
                for array, before, form in zip(arrays, last, expected, strict=True)
            )
        self._last = arrays if fit else None
        return fit

    def _learn(self, row: Mapping[str, ArrayLike]) -> Mapping[str, tuple[int, ...]]:
        """Names and shapes of the signals: arrays are kept first, then the numbers."""
        samples = {name: np.asarray(value) for name, value in row.items()}
        for name in samples:
            reason = check_name(name)
            if reason:
                raise InputError(f"no signal can be called {shown(name)}: {reason}", name="telemetry", value=name)
        arrays = [name for name, sample in samples.items() if sample.shape != ()]
        numbers = [name for name, sample in samples.items() if sample.shape == ()]
        flags = frozenset(name for name, sample in samples.items() if sample.dtype == np.bool_)
        self._layout = Layout({name: samples[name].shape for name in (*arrays, *numbers)}, flags)
        self._expected = [(samples[name].shape, _FLOAT) for name in arrays]
        self._arrays, self._numbers = _getter(arrays), _getter(numbers)
        self._pack = struct.Struct(f"{len(numbers)}d").pack
        if self._journal is not None:
            self._journal.begin(self._layout)
        return self._layout.shapes

    def _convert(self, row: Mapping[str, ArrayLike]) -> bytes:
        """Bytes of a row of any numbers."""
        shapes = self._layout.shapes
        parts = {name: np.array(row[name], dtype=_FLOAT, order="C") for name in shapes}
        wrong = [name for name, part in parts.items() if part.shape != shapes[name]]
        if wrong:
            raise InputError(f"the logged signals changed shape: {', '.join(wrong)}", name="telemetry")
        return b"".join(part.tobytes() for part in parts.values())

    def flush(self) -> None:
        """Make a piece of the latest rows, on disk where there is a journal."""
        if not self._held:
            return
        piece = self._layout.pack(self._rows, stays=self._journal is None)
        stored = None if self._journal is None else self._journal.add(piece)
        self._pieces.append(piece if stored is None else stored)
        self._before += self._held
        self._rows, self._held = [], 0
        self._due = self._size - self._before % self._size

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The rows so far; nothing before the first."""
        self.flush()
        return self._layout.assemble(iter(self._pieces), len(self)) if self._pieces else {}

    def take(self) -> dict[str, NDArray[Any]]:
        """The rows so far; they leave the recorder piece by piece, so that they never are in memory twice."""
        self.flush()
        rows, pieces, self._before, self._pieces = len(self), self._pieces[::-1], 0, []

        def leaving() -> Iterator[Piece]:
            while pieces:
                yield pieces.pop()

        return self._layout.assemble(leaving(), rows) if rows else {}

    def columns(self) -> dict[str, Column]:
        """The rows so far, to be written piece by piece."""
        self.flush()

        def blocks(name: str) -> Iterator[NDArray[Any]]:
            return (self._layout.column(name, piece) for piece in self._pieces)

        return {
            name: Column((len(self), *shape), self._layout.dtype(name), blocks(name))
            for name, shape in self._layout.shapes.items()
        }


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """Looks up several names at once."""
    if len(names) > 1:
        return itemgetter(*names)
    return lambda row: tuple(row[name] for name in names)
