"""The report as one HTML page that needs nothing beside it: tables, figures, setup, limitations."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from comparison.campaign.summary import cell_text
from comparison.report.contents import tables_of
from comparison.report.growth_figure import growth_figure
from comparison.report.pareto_figure import latency_figure, pareto_figure
from comparison.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figures_of", "render"]

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; color: #2b3440; background: #fff;
  max-width: 62rem; margin: 2.5rem auto; padding: 0 1.25rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin-bottom: .3rem; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 .6rem; border-bottom: 1px solid #dde3ea; padding-bottom: .25rem; }
h3 { font-size: .98rem; margin: 1.6rem 0 .35rem; }
p.lead, .note, figcaption, footer { color: #5d6875; font-size: .88rem; }
nav a { margin-right: 1rem; color: #0072b2; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .86rem; }
th, td { padding: .22rem .7rem; text-align: right; border-bottom: 1px solid #edf0f4; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; font-weight: 500; }
thead th { border-bottom: 1.5px solid #b8c2cc; color: #5d6875; font-weight: 600; }
tbody tr:hover { background: #f6f8fa; }
td.plain { text-align: left; white-space: normal; }
.spread { color: #7b8794; font-size: .92em; }
figure { margin: 1.2rem 0; }
figure img { width: 100%; max-width: 46rem; height: auto; }
.bad { color: #d62a1e; font-weight: 600; }
@media print { nav { display: none; } }
"""

_SECTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "overview": ("Cost and quality", ("pareto",)),
    "ticks": ("The complete tick of everyone", ("ticks", "misses")),
    "constraints": ("Holding the constraints alone", ("constraints",)),
    "formulations": ("Formulations and solvers", ("formulations",)),
    "timing": ("Where the time goes", ("timing", "ratios")),
    "campaign": ("The campaign", ("campaign",)),
    "walks": ("Undisturbed and pushed walks", ("walk", "walk_pushed")),
    "growth": ("Growth", ("growth",)),
    "simulator": ("The simulator", ("simulator",)),
    "peers": ("Peers", ("peers",)),
    "checks": ("What was checked", ("checks", "activity")),
    "setup": ("Machine, versions, settings", ("machine", "versions", "settings")),
}
_CAPTIONS = {
    "pareto": "Each point is a controller with its governor. Dashed: those that nobody betters in both.",
    "growth": "Medians; lines join the cases of one robot (feet held) or all cases (else).",
    "latency": "Times of all counted ticks of all repetitions, on the same states in turns.",
}


def figures_of(tables: Mapping[str, Table]) -> dict[str, Figure]:
    """The figures that the tables allow, by name."""
    figures: dict[str, Figure] = {}
    if "pareto" in tables:
        figures["pareto"] = pareto_figure(tables["pareto"])
    if "latency" in tables:
        figures["latency"] = latency_figure(tables["latency"])
    if "growth_faces" in tables:
        figures["growth"] = growth_figure(tables)
    return figures


def render(document: Mapping[str, Any]) -> str:
    """The page.

    Args:
        document: of :func:`comparison.benchmark.compare`.
    """
    tables = {table.name: table for table in tables_of(document)}
    figures = {name: _image(figure, name) for name, figure in figures_of(tables).items()}
    passed = all(document[f"checks{key}"]["passed"] for key in ("", "_low_friction"))
    sections: list[str] = []
    links: list[str] = []
    for anchor, (title, prefixes) in _SECTIONS.items():
        body = [_table(table) for name, table in tables.items() if _belongs(name, prefixes)]
        if not body:
            continue
        if anchor == "overview":
            body.insert(0, figures["pareto"])
        if anchor == "ticks":
            body.append(figures["latency"])
        if anchor == "growth":
            body.insert(0, figures["growth"])
        links.append(f'<a href="#{anchor}">{escape(title)}</a>')
        sections.append(f'<section id="{anchor}"><h2>{escape(title)}</h2>{"".join(body)}</section>')
    limits = "".join(f"<li>{escape(sentence)}</li>" for sentence in document["limitations"])
    links.append('<a href="#limitations">Limitations</a>')
    sections.append(f'<section id="limitations"><h2>Limitations</h2><ul>{limits}</ul></section>')
    machine = document["machine"]
    place = f"{machine['cpu']}, {machine['usable_cores']} of {machine['cores']} cores, {machine['os']}"
    verdict = (
        "Every timed result equals an untimed one within the stated tolerance."
        if passed
        else '<span class="bad">A timed result was not what it should be: do not use these times.</span>'
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Reference governors and a whole-body QP</title><style>{_STYLE}</style></head><body>"
        "<h1>Explicit reference governors and a QP whole-body controller on the same states</h1>"
        f'<p class="lead">{escape(place)}. {verdict}</p><nav>{"".join(links)}</nav>{"".join(sections)}'
        "<footer><p>Every number on this page, bins of the histograms included, is in the CSV that was written beside "
        "it.</p></footer></body></html>\n"
    )


def _belongs(name: str, prefixes: tuple[str, ...]) -> bool:
    """Whether a table is in a section: its name is one of the section's, or begins with that of an open one."""
    return any(
        name in (p, f"{p}_low_friction")
        or (p in ("campaign", "growth", "simulator", "peers") and name.startswith(f"{p}_"))
        for p in prefixes
    )


def _table(table: Table) -> str:
    columns = table.columns
    single = columns == ["value"]
    units = {cell.column: cell.unit for cell in table.cells}
    if len(set(units.values())) == 1:
        units = {}  # the title says it
    head = "".join(f"<th>{escape(_with_unit(c, units.get(c, '')))}</th>" for c in columns)
    places = {(cell.row, cell.column): cell for cell in table.cells}
    lines = []
    for row in table.rows:
        cells = []
        for column in columns:
            text, bracket, spread = cell_text(places.get((row, column))).partition(" (")
            kind = ' class="plain"' if single else ""
            rest = f' <span class="spread">({escape(spread)}</span>' if bracket and spread.endswith(")") else ""
            cells.append(f"<td{kind}>{escape(text if rest else text + bracket + spread)}{rest}</td>")
        lines.append(f"<tr><td>{escape(row)}</td>{''.join(cells)}</tr>")
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    header = "" if single else f"<thead><tr><th></th>{head}</tr></thead>"
    body = f"<table>{header}<tbody>{''.join(lines)}</tbody></table>"
    return f'<h3>{escape(table.title)}</h3><div class="scroll">{body}</div>{note}'


def _with_unit(column: str, unit: str) -> str:
    return f"{column}, {unit}" if unit else column


def _image(figure: Figure, name: str) -> str:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=160)
    data = base64.b64encode(out.getvalue()).decode()
    caption = escape(_CAPTIONS[name])
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>'
    )
