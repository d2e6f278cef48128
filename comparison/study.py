"""Studies as data on one runner: what is walked, what is measured, and which tables are made of it.

A study lists jobs, each a dict that says all of one walk; ``measure`` walks one and gives what is
kept of it (where those are the library's own measures, :func:`walking` makes it). A row is both
together. Walks that a file has are not repeated; many are walked in processes of their own, one for
each core.

A new study is a file of :mod:`comparison.studies` with a ``STUDY``; its command is ``python -m
comparison NAME``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from comparison.campaign.plan import code_digest
from comparison.campaign.store import Store, do_missing
from comparison.measure.walking import (
    Progress,
    Rows,
    as_far_as_it_goes,
    grouped,
    scenario_of,
    silent,
    walk_as_far_as_it_goes,
)
from comparison.tables import Cell, Table, cell_text, in_columns, number_text
from harpy_pin import Run, Scenario, checks, measure
from harpy_pin.view.figures import styled

__all__ = [
    "STARTS",
    "Cell",
    "Job",
    "Progress",
    "Rows",
    "Shown",
    "Study",
    "Table",
    "Value",
    "View",
    "Words",
    "as_far_as_it_goes",
    "cell_text",
    "commands",
    "fell",
    "grid",
    "grouped",
    "in_columns",
    "kept",
    "mean",
    "median",
    "most",
    "number_text",
    "scenario_of",
    "share",
    "shown",
    "silent",
    "start_velocity",
    "starts",
    "walk_as_far_as_it_goes",
    "walking",
    "where",
]
"""All that the file of a study needs, but who walks (:mod:`comparison.contenders`)."""

Job = dict[str, Any]
"""What one walk is; JSON can hold it."""

STARTS: dict[str, Any] = {"starts": 1, "jitter": 0.02, "duration": 6.0, "seed": 0}
"""Settings of studies with several starts of each walk: how many, the standard deviation of the
starting velocity along x and y, m/s, the duration of a walk, s, and the seed of the starts.
"""


@dataclass(frozen=True, kw_only=True)
class Study:
    """One question, measured."""

    name: str  # of the command and of its source in pages
    help: (
        str | None
    )  # of the command: a line, an empty line, and the rest; the docstring of the study's file
    defaults: Mapping[str, Any]  # settings; a tuple of names holds all that there are
    quick: Mapping[str, Any]  # those that differ in a look
    jobs: Callable[[Any], Iterable[Job]] = lambda settings: ()  # what is walked, from the settings
    # the same of what is measured afterwards, one after the other with nothing beside it
    timed: Callable[[Any], Iterable[Job]] = lambda settings: ()
    measure: Callable[[Job], dict[str, Any]]  # gives the measures of one job; picklable
    views: Sequence[
        View | Callable[[Rows], Iterable[Table]]
    ]  # tables of the rows; or what makes tables of them
    example: str = ""  # of the command's options
    only: str = ""  # the setting that --only chooses from, if there is one
    # draws the rows in an empty figure, for --figure
    draw: Callable[[Any, Rows], None] | None = None
    options: Mapping[str, str] = field(
        default_factory=dict
    )  # settings that are options of the command, and their help

    def settings(self, *, quick: bool = False, **changes: Any) -> SimpleNamespace:
        """The settings, with changes."""
        for name, value in changes.items():
            checks.one_of("setting", name, self.defaults)
            own = self.defaults[name]
            signed = any(
                isinstance(one, float) and one < 0.0
                for one in (own if isinstance(own, tuple) else (own,))
            )
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, str) and isinstance(own, tuple):
                    checks.one_of(name, one, own)
                elif isinstance(one, float | int):
                    checks.number(name, one, low=-inf if signed else 0.0)
        return SimpleNamespace(**{**self.defaults, **(self.quick if quick else {}), **changes})

    def run(
        self,
        progress: Progress = silent,
        *,
        quick: bool = False,
        path: Path | None = None,
        **changes: Any,
    ) -> Rows:
        """Every row, in the order of the jobs.

        Args:
            progress: told at the begin and after every row.
            quick: a look.
            path: file of finished walks, whose rows of other code are left aside; None keeps none.
            changes: of settings.
        """
        settings = self.settings(quick=quick, **changes)
        code = code_digest()
        jobs, timed = (
            {f"{code} {job}": job for job in part(settings)} for part in (self.jobs, self.timed)
        )
        with (
            tempfile.TemporaryDirectory() as folder,
            Store(path or Path(folder) / "walks") as store,
        ):
            do_missing(store, jobs | timed, partial(_row, self.measure), progress, alone=timed)
            return [store.rows[key] for key in (*jobs, *timed)]

    def tables(self, rows: Rows) -> list[Table]:
        """Every table of the rows."""
        return [
            table
            for view in self.views
            for table in (view.of(rows) if isinstance(view, View) else view(rows))
        ]

    @styled
    def figure(self, rows: Rows) -> Any:
        """The drawn rows, a ``matplotlib.figure.Figure``."""
        from matplotlib.figure import Figure

        assert self.draw is not None
        figure = Figure(layout="constrained")
        self.draw(figure, rows)
        return figure


def _row(measure: Callable[[Job], dict[str, Any]], job: Job) -> dict[str, Any]:
    return job | measure(job)


def grid(**axes: Any) -> Iterator[Job]:
    """Every combination of these entries; the last one changes first. A number or a text is alone
    on its axis.
    """
    values = [
        (axis,) if isinstance(axis, str | float | int | None) else axis for axis in axes.values()
    ]
    return (dict(zip(axes, case, strict=True)) for case in product(*values))


def starts(settings: Any) -> dict[str, Any]:
    """Axes of a grid: the starts of each walk, of a study with :data:`STARTS`."""
    same = {name: getattr(settings, name) for name in ("jitter", "seed", "duration")}
    return {"start": range(settings.starts), **same}


def start_velocity(job: Job) -> tuple[float, ...]:
    """Velocity of the body with which a walk begins, of a study with :data:`STARTS`."""
    x, y = job["jitter"] * np.random.default_rng([job["seed"], job["start"]]).standard_normal(2)
    return (float(x), float(y), 0.0, 0.0, 0.0, 0.0)


def commands(
    rng: np.random.Generator,
    duration: float,
    draw: Callable[[np.random.Generator], tuple[float, float, float]],
    *,
    begin: float = 0.3,
    least: float,
    most: float,
) -> Iterator[tuple[float, float, float, float]]:
    """Drawn velocities with their times, from ``least`` to ``most`` seconds apart, until a second
    before the end.
    """
    t = begin
    while t < duration - 1.0:
        yield (t, *draw(rng))
        t += float(rng.uniform(least, most))


def kept(run: Run, *names: str) -> dict[str, Any]:
    """Whether a walk fell, and these of its measures."""
    measures = measure(run)
    return {"fell": run.ending != "completed", **{name: getattr(measures, name) for name in names}}


def walking(scenario: Callable[[Job], Scenario], *names: str) -> Callable[[Job], dict[str, Any]]:
    """A study's ``measure`` that walks the scenario of a job, and keeps these of its measures
    (:func:`kept`).
    """
    return partial(_walked, scenario, names)


def _walked(
    scenario: Callable[[Job], Scenario], names: tuple[str, ...], job: Job
) -> dict[str, Any]:
    return kept(walk_as_far_as_it_goes(scenario(job)), *names)


Value = Callable[[Rows], Any]
"""What a table says of rows that belong together: a value, or a cell whose place is left open."""
Shown = Value | tuple[Value, str]
"""A value, or a value with its unit."""
Words = str | Callable[[dict[str, Any]], str]
"""A text of a row: its entries are put into a format string, or a function makes it."""


@dataclass(frozen=True)
class View:
    """Tables of one kind: rows with the same name of a table stand in one."""

    name: Words  # of the table
    title: Words  # the same, of its first row
    row: Words  # heading of the line in which a row stands, with all others of this heading
    # what is shown of the rows of a line, by the heading of the column, where any line has a value
    columns: Mapping[str, Shown] | Shown
    # heading of the column in which a row stands, where each column shows the same; what, columns
    # says
    across: Words = ""
    note: str = ""  # below every table
    only: Callable[[dict[str, Any]], bool] = bool  # which rows are shown

    def of(self, rows: Rows) -> list[Table]:
        """The tables of these rows."""
        groups: dict[str, Rows] = {}
        for row in filter(self.only, rows):
            groups.setdefault(_text(self.name, row), []).append(row)
        return [
            Table(name, _text(self.title, same[0]), self._cells(same), self.note)
            for name, same in groups.items()
        ]

    def _cells(self, rows: Rows) -> tuple[Cell, ...]:
        places: dict[tuple[str, str], tuple[Shown, Rows]] = {}
        for row in rows:
            columns = (
                self.columns
                if isinstance(self.columns, Mapping)
                else {_text(self.across, row): self.columns}
            )
            for column, what in columns.items():
                places.setdefault((_text(self.row, row), column), (what, []))[1].append(row)
        cells = [_cell(*place, same, what) for place, (what, same) in places.items()]
        known = {cell.column for cell in cells if cell.value is not None}
        return tuple(cell for cell in cells if cell.column in known)


def _text(words: Words, row: dict[str, Any]) -> str:
    return words.format(**row) if isinstance(words, str) else words(row)


def _cell(row: str, column: str, rows: Rows, what: Shown) -> Cell:
    of, unit = what if isinstance(what, tuple) else (what, "")
    value = of(rows)
    if isinstance(value, Cell):
        return value._replace(row=row, column=column, unit=value.unit or unit)
    return Cell(row, column, value, unit)


def share(name: str, entry: Any = True) -> Value:
    """How many of them have an entry."""
    return lambda rows: f"{sum(row[name] == entry for row in rows)} of {len(rows)}"


fell = share("fell")
"""How many of them fell."""


def shown(name: str, put: Callable[[list[Any]], Any] = lambda found: found[0]) -> Value:
    """The entry of one row, or of several put together; None where no row has it."""

    def value(rows: Rows) -> Any:
        found = [row[name] for row in rows if row.get(name) is not None]
        return put(found) if found else None

    return value


def where(what: Value, /, **entries: Any) -> Value:
    """The same of those rows alone that have these entries; None of none."""

    def value(rows: Rows) -> Any:
        found = [row for row in rows if all(row[name] == entry for name, entry in entries.items())]
        return what(found) if found else None

    return value


def median(name: str) -> Value:
    """The median of an entry."""
    return shown(name, lambda found: float(np.median(found)))


def mean(name: str) -> Value:
    """The mean of an entry."""
    return shown(name, lambda found: float(np.mean(found)))


def most(name: str) -> Value:
    """The largest of an entry."""
    return shown(name, max)
