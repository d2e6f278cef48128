"""Tables of the claims of the paper, from the numbers that ``python -m reproduction paper --json``
writes.
"""

from collections.abc import Mapping
from typing import Any

from comparison.study import Table, View, shown

_CLAIMS = View(
    "claims",
    "The paper's claims",
    row=lambda row: f"{row['claim']}, {row['gait']}" if row["gait"] else row["claim"],
    columns={name: shown(name) for name in ("the paper says", "verdict", "number")},
)
_INSIDE = View(
    "vlip_inside",
    "The paper's first simulation from a start inside the friction cone, with Cartesian references",
    row="{governor}",
    columns={
        "ticks violated": (lambda rows: 100.0 * rows[0]["violation_share"], "%"),
        "worst": (shown("worst_violation_n"), "N"),
        **{f"reversals at Δt/{divisor}": (shown(divisor), "1/s") for divisor in "124"},
    },
    note="Reversals of the normal force, with the step of 1 ms divided by 1, 2 and 4.",
)


def paper_tables(document: Mapping[str, Any]) -> list[Table]:
    """Verdicts on the claims, whose text stands once, and the runs of the first simulation that
    start inside the friction cone.
    """
    claims = document["claims"]
    said = [entry["claim"] for entry in claims]
    findings = [
        {**entry, "the paper says": "" if entry["claim"] in said[:k] else entry["text"]}
        for k, entry in enumerate(claims)
    ]
    inside = [
        {"governor": governor, **entry, **entry["reversals_per_s"]}
        for governor, entry in document["vlip_inside"].items()
    ]
    return [*_CLAIMS.of(findings), *_INSIDE.of(inside)]
