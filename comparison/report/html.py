"""The report: one HTML page that needs nothing beside it, and all its numbers as JSON and CSV."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from comparison.report.answer import COLUMNS, answer_of, passed
from comparison.report.contents import tables_of
from comparison.report.figures import growth_figure, pareto_figure
from comparison.tables import Table, to_csv
from harpy_pin.files import replacing, write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SECTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "overview": ("Cost and quality", ("pareto",)),
    "ticks": ("The complete tick of every controller", ("ticks", "misses")),
    "formulations": ("Formulations and solvers", ("formulations",)),
    "timing": ("Where the time goes", ("timing", "ratios")),
    "campaign": ("The campaign", ("campaign",)),
    "walks": ("Undisturbed walks", ("walk",)),
    "growth": ("Growth", ("growth",)),
    "simulator": ("The simulator", ("simulator",)),
    "checks": ("What was checked", ("checks", "activity")),
    "setup": ("Machine, versions, settings", ("machine", "versions", "settings")),
}
_FIGURES = {"overview": "pareto", "growth": "growth"}
"""The figure of a section."""
_CAPTIONS = {
    "pareto": "Each point is a controller with its governor. Dashed line: no other controller is better in both.",
    "growth": "Medians. Lines join the cases of one robot (for feet held) or all cases (otherwise).",
}


def figures_of(tables: Mapping[str, Table]) -> dict[str, Figure]:
    """The figures that the tables allow, by name."""
    figures: dict[str, Figure] = {}
    if "pareto" in tables:
        figures["pareto"] = pareto_figure(tables["pareto"])
    if "growth_faces" in tables:
        figures["growth"] = growth_figure(tables)
    return figures


def write_report(folder: Path, document: Mapping[str, Any]) -> None:
    """Write ``report.html``, ``results.json`` and ``results.csv``; the CSV holds every number of the page.

    Raises:
        RunFileError: one of them cannot be written.
    """
    write_json(folder / "results.json", document)
    for name, text in (("results.csv", to_csv(tables_of(document))), ("report.html", render(document))):
        with replacing(folder / name) as file:
            file.write(text.encode())


def render(document: Mapping[str, Any]) -> str:
    """The page."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    tables = {table.name: table for table in tables_of(document)}
    figures = {name: _image(figure, _CAPTIONS[name]) for name, figure in figures_of(tables).items()}
    sections = [
        {"anchor": anchor, "title": title, "tables": found, "figure": figures.get(_FIGURES.get(anchor, ""))}
        for anchor, (title, prefixes) in _SECTIONS.items()
        if (found := [table for name, table in tables.items() if _belongs(name, prefixes)])
    ]
    machine = document["machine"]
    return environment.get_template("report.html.j2").render(
        place=f"{machine['cpu']}, {machine['usable_cores']} of {machine['cores']} cores, {machine['os']}",
        passed=passed(document),
        answer=answer_of(document),
        contenders=COLUMNS.values(),
        sections=sections,
        limitations=document["limitations"],
    )


def _belongs(name: str, prefixes: tuple[str, ...]) -> bool:
    """Whether a table is in a section: its name is one of the section's, or goes on after it."""
    return any(name == prefix or name.startswith(f"{prefix}_") for prefix in prefixes)


def _image(figure: Figure, caption: str) -> dict[str, str]:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=160)
    return {"caption": caption, "source": f"data:image/png;base64,{base64.b64encode(out.getvalue()).decode()}"}
