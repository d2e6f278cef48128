"""A run for other programs: as a table of pandas or of any spreadsheet, and as messages for Foxglove."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.files import replacing
from harpy_pin.log.table import columns

if TYPE_CHECKING:
    import pandas

__all__ = ["Exports"]


class Exports:
    """The part of :class:`~harpy_pin.log.run.Run` that other programs read."""

    def to_pandas(self: Any) -> pandas.DataFrame:
        """All signals as a ``pandas.DataFrame``, with the time, s, as its index and one column for each number.

        Columns are named ``foot_force/left_foot/z``: the signal, and what of it; see :mod:`harpy_pin.log.table`.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise InputError(f"pandas cannot be imported ({error}): pip install pandas", name="pandas") from error
        table = dict(columns(self))
        return pandas.DataFrame(table).set_index("t")

    def to_csv(self: Any, path: str | Path, *, every: int = 1) -> None:
        """Write all signals as a table that any program reads, in the columns of :meth:`to_pandas`.

        Args:
            path: of the file; one of that name is replaced.
            every: one row of so many is written.

        Raises:
            RunFileError: the file cannot be written.
        """
        path, step = checks.path("path", path), checks.whole("every", every, low=1)
        names, values = zip(*columns(self), strict=True)
        rows = zip(*(column[::step].tolist() for column in values), strict=True)
        with replacing(path) as file:
            text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
            writer = csv.writer(text)
            writer.writerow(names)
            writer.writerows(rows)
            text.detach()

    def to_mcap(self: Any, path: str | Path, *, every: int = 1) -> None:
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
