"""The constants of a record: a table in C, and the function that fills the record from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled.unit import Unit
from harpy_pin.model.record import Record

__all__ = ["initial_values", "number_text"]

FEW = 2
"""Entries of an array that are assigned one by one; more are copied from the table."""


def initial_values(unit: Unit, record: Record) -> tuple[str, list[str]]:
    """The table and the statements that fill a record which is zero.

    Args:
        unit: whose precision and names are used.
        record: as it is to be.

    Returns:
        The table in C, empty where nothing is copied, and the statements; ``state`` points to the record.
    """
    tables: dict[str, list[str]] = {"real": [], "integer": []}
    lengths = {"real": 0, "integer": 0}
    statements = []
    for place, values in _entries(unit, record[0], "state->"):
        kind = "integer" if values.dtype.kind == "i" else "real"
        texts = [number_text(value, single=unit.single) for value in values.ravel()]
        if values.ndim == 0:
            statements.append(f"{place} = {texts[0]};")
        elif np.count_nonzero(values) <= FEW:
            statements += [f"{place}[{n}] = {texts[n]};" for n in np.flatnonzero(values.ravel())]
        else:
            tables[kind].append(f"/* {place.removeprefix('state->')} */\n    {_lines(texts)},")
            statements.append(f"copy_{kind}({place}, {kind}s + {lengths[kind]}, {len(texts)});")
            lengths[kind] += len(texts)
    parts = []
    for kind, rows in tables.items():
        if rows:
            parts.append(f"static const {kind} {kind}s[{lengths[kind]}] = {{\n    " + "\n    ".join(rows) + "\n};")
            parts.append(
                f"static void copy_{kind}({kind} *to, const {kind} *from, int count)\n"
                "{\n    for (int n = 0; n < count; n++) {\n        to[n] = from[n];\n    }\n}"
            )
    return "\n\n".join(parts), statements


def number_text(value: Any, *, single: bool) -> str:
    """A number as a constant in C, with the digits that it needs."""
    if isinstance(value, np.integer | int):
        return str(int(value))
    if not np.isfinite(value):
        return "(real)NAN" if np.isnan(value) else "(real)INFINITY" if value > 0 else "-(real)INFINITY"
    if not single:
        return repr(float(value))
    text = str(np.float32(value))
    return (text if "." in text or "e" in text else f"{text}.0") + "f"


def _entries(unit: Unit, element: Any, place: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Places in C and values of all fields that are not zero."""
    for name in element.dtype.names:
        value, own = element[name], place + unit.identifier(name)
        if value.dtype.names is not None:
            if value.ndim == 0:
                yield from _entries(unit, value, f"{own}.")
            else:
                for n, one in enumerate(value.ravel()):
                    yield from _entries(unit, one, f"{own}[{n}].")
        elif np.count_nonzero(value):
            yield own, np.asarray(value)


def _lines(texts: list[str]) -> str:
    rows = [", ".join(texts[n : n + 8]) for n in range(0, len(texts), 8)]
    return ",\n    ".join(rows)
