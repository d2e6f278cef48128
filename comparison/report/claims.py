"""Tables of the claims of the paper, from the numbers that ``python -m reproduction paper --json``
writes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from comparison.tables import Cell, Table


def paper_tables(document: Mapping[str, Any]) -> list[Table]:
    """Verdicts on the claims, and the runs of the first simulation that start inside the friction
    cone.
    """
    claims = Table("claims", "The paper's claims", tuple(_claims(document["claims"])))
    inside = Table(
        "vlip_inside",
        "The paper's first simulation from a start inside the friction cone, with Cartesian "
        "references",
        tuple(_inside(document["vlip_inside"])),
        "Reversals of the normal force, with the step of 1 ms divided by 1, 2 and 4.",
    )
    return [claims, inside]


def _claims(findings: list[Mapping[str, Any]]) -> Iterator[Cell]:
    said = set()
    for entry in findings:
        key, gait = entry["claim"], entry["gait"]
        row = f"{key}, {gait}" if gait else key
        yield Cell(row, "the paper says", "" if key in said else entry["text"])
        yield Cell(row, "verdict", entry["verdict"])
        yield Cell(row, "number", entry["number"])
        said.add(key)


def _inside(governors: Mapping[str, Mapping[str, Any]]) -> Iterator[Cell]:
    for governor, entry in governors.items():
        yield Cell(governor, "ticks violated", 100.0 * entry["violation_share"], "%")
        yield Cell(governor, "worst", entry["worst_violation_n"], "N")
        for divisor, reversals in entry["reversals_per_s"].items():
            yield Cell(governor, f"reversals at Δt/{divisor}", reversals, "1/s")
