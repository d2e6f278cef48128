"""Pieces of a log: a stretch of rows, one signal after the other, as float64."""

from __future__ import annotations

import math
import mmap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Layout", "OnDisk", "Piece"]

ITEM = 8
"""Bytes of a number."""


class Piece(Protocol):
    """What holds the numbers of a piece: an array, or a place in a file."""

    def __len__(self) -> int: ...

    def __getitem__(self, part: slice, /) -> NDArray[np.float64]: ...


@dataclass(frozen=True)
class OnDisk:
    """A piece in a file, read when it is asked for.

    Attributes:
        file: open and unbuffered.
        offset: of the first number, bytes.
        size: numbers.
    """

    file: BinaryIO
    offset: int
    size: int

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, part: slice, /) -> NDArray[np.float64]:
        begin, end, _ = part.indices(self.size)
        out = np.empty(end - begin)
        view, place = out.view(np.uint8).data, 0
        self.file.seek(self.offset + ITEM * begin)
        while place < len(view):
            count = self.file.readinto(view[place:])  # type: ignore[attr-defined]
            if not count:
                raise OSError("the file became shorter")
            place += count
        return out


@dataclass(frozen=True)
class Layout:
    """Which signals a row holds, in order.

    Attributes:
        shapes: of each signal in one row.
        flags: names of those that are true or false.
    """

    shapes: Mapping[str, tuple[int, ...]]
    flags: frozenset[str] = frozenset()

    @cached_property
    def width(self) -> int:
        """Numbers in a row."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    @cached_property
    def spans(self) -> dict[str, tuple[int, int]]:
        """First and last number (not included) of each signal in a row."""
        spans, begin = {}, 0
        for name, shape in self.shapes.items():
            spans[name] = begin, begin + math.prod(shape)
            begin += math.prod(shape)
        return spans

    def rows(self, pieces: Iterable[Piece]) -> int:
        """Rows in some pieces."""
        return sum(map(len, pieces)) // self.width

    def pack(self, rows: Sequence[bytes], *, stays: bool) -> NDArray[np.float64]:
        """A piece made of the bytes of its rows.

        Args:
            rows: the bytes of at least one row, of one or several in each entry.
            stays: it is kept in memory, and gets memory that goes back to the system as soon as it is dropped; one
                that is written and forgotten leaves its memory to the next.
        """
        table = np.frombuffer(b"".join(rows)).reshape(-1, self.width)
        count = len(table)
        piece = np.frombuffer(mmap.mmap(-1, ITEM * table.size)) if stays else np.empty(table.size)
        for begin, end in self.spans.values():
            piece[count * begin : count * end].reshape(count, -1)[:] = table[:, begin:end]
        return piece

    def column(self, name: str, piece: Piece) -> NDArray[np.float64 | np.bool_]:
        """(rows, ...) one signal of a piece."""
        rows = len(piece) // self.width
        begin, end = self.spans[name]
        values = piece[rows * begin : rows * end].reshape(rows, *self.shapes[name])
        return values != 0.0 if name in self.flags else values

    def dtype(self, name: str) -> np.dtype[np.float64 | np.bool_]:
        """Type of a signal."""
        return np.dtype(np.bool_ if name in self.flags else np.float64)

    def assemble(self, pieces: Iterator[Piece], rows: int) -> dict[str, NDArray[np.float64 | np.bool_]]:
        """Whole signals. Each piece may be dropped before the next is taken.

        Args:
            pieces: in order.
            rows: in all of them.
        """
        arrays = {name: np.empty((rows, *shape), self.dtype(name)) for name, shape in self.shapes.items()}
        begin = 0
        for piece in pieces:
            end = begin + len(piece) // self.width
            for name, array in arrays.items():
                array[begin:end] = self.column(name, piece)
            begin = end
        return arrays
