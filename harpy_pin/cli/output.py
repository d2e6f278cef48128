"""Where the ``harpy`` command writes to, and the tables that commands share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from harpy_pin.plant.profile import Profile

__all__ = ["INTERRUPTED", "console", "profile_table", "stderr", "values_table"]

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

console = Console()
stderr = Console(stderr=True)


def values_table(title: str, values: dict[str, Any]) -> Table:
    """A line for each value."""
    table = Table("measure", "value", title=title)
    table.columns[1].justify = "right"
    for name, value in values.items():
        table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
    return table


def profile_table(profile: Profile) -> Table:
    """Where the time of a run went."""
    from harpy_pin.plant.profile import Part

    ticks = max(profile.ticks, 1)
    factor = profile.real_time_factor
    result = Table(
        "part",
        title=f"{profile.simulated:g} s in {profile.total:.3f} s; {factor:.1f} × real time less first calls and clocks",
        caption="log: telemetry, too; first calls: loading what is compiled; clocks: what this table costs, "
        "estimated; rest: the loop, copies of the state, checks",
    )
    for column in ("calls", "µs per call", "µs per tick", "ms", "share"):
        result.add_column(column, justify="right")
    for part in (*profile.parts, Part("total", 0, profile.total)):
        if part.name == "total":
            result.add_section()
        result.add_row(
            part.name,
            str(part.calls) if part.calls else "",
            f"{1e6 * part.seconds / part.calls:.2f}" if part.calls else "",
            f"{1e6 * part.seconds / ticks:.2f}",
            f"{1e3 * part.seconds:.1f}",
            f"{part.seconds / profile.total:.1%}",
        )
    return result
