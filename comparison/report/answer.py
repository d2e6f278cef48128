"""The answer: what this run found, in a few sentences and one small table."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparison.contenders import BEST, OWN, label
from comparison.tables import NOT_KNOWN, Cell, Table, number_text

_HEADINGS = {
    "governed/none": ("no", "governor"),
    "governed/paper": ("paper's,", "printed"),
    BEST: ("paper's,", "best"),
    "governed/filter": ("force", "filter"),
    "condensed": ("cond.", "WBC"),
    OWN: ("QP, own", "search"),
    "wbc": ("QP,", "ProxQP"),
}
"""Contenders in the answer's table, with the two lines of their headings in a terminal."""

COLUMNS = {name: label(name) for name in _HEADINGS}
"""Contenders in the answer's table, with their names; all others are in the report."""

_MEASURES = {
    "slip_mm_per_step": ("slip, all walks", 1.0),
    "falls": ("falls, % of walks", 100.0),
    "p50_us": ("tick, median, µs", 1.0),
    "p99_us": ("tick, 99 %, µs", 1.0),
    "c_p50_us": ("in C, median, µs", 1.0),
    "c_p99_us": ("in C, 99 %, µs", 1.0),
    "tracking_rms_mm": ("off target, mm", 1.0),
}
"""Rows of the table: heading, and the factor that brings a value to its unit; less is better in all
of them.
"""


@dataclass(frozen=True)
class Answer:
    """The finding in words, and a table: by heading for each of :data:`COLUMNS` its text and
    whether it is the best.
    """

    sentences: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[str, bool], ...]], ...]
    note: str

    def to_string(self, report: Path | str = "") -> str:
        """At most 25 lines of at most 80 columns, without colours."""
        wrap = textwrap.TextWrapper(
            79, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
        first = max(len(heading) for heading, _ in self.rows)
        lines = [*map(wrap.fill, self.sentences), ""]
        lines += [
            "".join([" " * first, *(f"{pair[k]:>8} " for pair in _HEADINGS.values())]).rstrip()
            for k in (0, 1)
        ]
        for heading, cells in self.rows:
            lines.append(
                f"{heading:<{first}}"
                + "".join(f"{text:>8}{'* '[not best]}" for text, best in cells).rstrip()
            )
        lines.append(wrap.fill(self.note))
        return "\n".join([*lines, *([f"Everything else: {report}"] if report else [])])

    def table(self) -> Table:
        """The table with a row for each controller, as pages show it."""
        shown = [
            (heading, zip(COLUMNS.values(), cells, strict=True)) for heading, cells in self.rows
        ]
        cells = (
            Cell(name, heading, None if text == NOT_KNOWN else float(text))
            for heading, row in shown
            for name, (text, _) in row
        )
        return Table("answer", "The answer", tuple(cells), self.note)


def answer_of(document: Mapping[str, Any]) -> Answer:
    """Which controller keeps the feet from slipping, and what a tick costs."""
    whole, ticks = document["campaign"]["whole"], document["ticks"]["contenders"]
    inside = {
        name: {f"c_{key}": value for key, value in ticks[name].get("inside_c", {}).items()}
        for name in COLUMNS
    }
    parts = (ticks, inside, whole)
    values: dict[str, dict[str, float | None]] = {
        key: dict.fromkeys(COLUMNS)
        | {
            name: _value(entry[name].get(key))
            for entry in parts
            for name in COLUMNS
            if key in entry[name]
        }
        for key in _MEASURES
    }
    rows = [(heading, values[key], scale) for key, (heading, scale) in _MEASURES.items()]
    levels = document["campaign"].get("factors", {}).get("friction", {})
    if levels:
        hardest = min(levels, key=float)
        slips = {name: _value(levels[hardest][name]["slip_mm_per_step"]) for name in COLUMNS}
        rows.insert(0, (f"slip, μ {hardest}", slips, 1.0))
    marked = tuple(
        (heading, tuple(_marked(row[name], row, scale) for name in COLUMNS))
        for heading, row, scale in rows
    )
    walks = max(whole[name]["walks"] for name in COLUMNS)
    settings, friction = document["campaign"]["settings"], document["ticks"]["friction"]
    least, most = min(settings["frictions"]), max(settings["frictions"])
    note = (
        f"* best. Ticks: friction {friction:g}, same states for all; C cannot call ProxQP. Slip: "
        f"mm per step, "
        f"medians of {walks} walks, {settings['duration']:g} s, friction {least:g} to {most:g}, "
        f"pushes, model errors."
    )
    # Both solvers of the QP find one optimum: its walks are those of either.
    spreads = {name: entry["slip_mm_per_step"] for name, entry in whole.items() if name != OWN}
    own_timer = ticks["wbc"].get("own_timer", {}).get("p50_us")
    cost = _cost(values["p50_us"], own_timer)
    if passed(document):
        trust = f"{cost} Every timed command equals an untimed one.".lstrip()
    else:
        trust = (
            f"DO NOT USE THESE TIMES: a timed command was not what it should be. {cost}".rstrip()
        )
    sentences = (_slip(spreads), _paper(spreads), trust)
    return Answer(tuple(s for s in sentences if s), marked, note)


def passed(document: Mapping[str, Any]) -> bool:
    """Whether every timed result was what it should be."""
    return bool(document["checks"]["passed"])


def _value(entry: Any) -> float | None:
    value = entry["value"] if isinstance(entry, Mapping) else entry
    return None if value is None else float(value)


def _marked(value: float | None, row: Mapping[str, float | None], scale: float) -> tuple[str, bool]:
    """A cell's text, and whether it is the least of its row to the digits shown."""
    if value is None:
        return NOT_KNOWN, False
    text = number_text(scale * value)
    return text, text == number_text(scale * min(v for v in row.values() if v is not None))


def _slip(slips: Mapping[str, Any]) -> str:
    order = sorted(
        (n for n in slips if slips[n]["value"] is not None), key=lambda n: float(slips[n]["value"])
    )
    if len(order) < 2:
        return ""
    best, second = (slips[name] for name in order[:2])
    least, next_one = (
        best["value"],
        f"{number_text(second['value'])}{_times(second['value'], best['value'])}",
    )
    text = (
        f"The feet slip least with: {spoken(order[0])}, {number_text(least)} mm per step; next "
        f"{spoken(order[1])}, "
    )
    return (
        text + next_one + (", and their 95 % intervals overlap." if _overlap(best, second) else ".")
    )


def _paper(slips: Mapping[str, Any]) -> str:
    none, paper, best = (slips[name] for name in ("governed/none", "governed/paper", BEST))
    if none["value"] is None or paper["value"] is None:
        return ""
    sizes = (
        f"{number_text(paper['value'])} mm per step with it, {number_text(none['value'])} without"
    )
    if best["value"] is not None:
        sizes += f", {number_text(best['value'])} in its best variant"
    if _overlap(none, paper):
        return f"These walks do not show whether the paper's governor makes less slip: {sizes}."
    return (
        f"The paper's governor makes {'less' if paper['value'] < none['value'] else 'more'} "
        f"slip: {sizes}."
    )


def spoken(name: str) -> str:
    """A contender's name within a sentence."""
    return label(name).replace("QP, ", "QP by ")


def _cost(ticks: Mapping[str, float | None], own_timer: float | None) -> str:
    """What a tick costs against the governor's and against each other, each time with whose
    solver.
    """
    governor, condensed, own, proxqp = (
        ticks[name] for name in ("governed/paper", "condensed", OWN, "wbc")
    )
    if not (governor and condensed and own and proxqp):
        return ""
    times = [number_text(tick / governor) for tick in (condensed, own, proxqp)]
    share = (
        "" if own_timer is None else f", of which {number_text(own_timer)} by ProxQP's own timer"
    )
    return (
        f"A tick of the paper's governor takes {number_text(governor)} µs; that of the condensed "
        f"WBC {times[0]} times "
        f"as long, of the whole-body QP {times[1]} times by own search and {times[2]} times by "
        f"ProxQP "
        f"({number_text(proxqp)} µs{share}). The condensed WBC takes "
        f"{number_text(condensed / own)} of the QP's time "
        f"by own search, and {number_text(condensed / proxqp)} by ProxQP."
    )


def _times(value: float, least: float) -> str:
    """How many times the least a value is; nothing where that says nothing."""
    return (
        f" ({value / least:.{0 if value > 10.0 * least else 1}f}×)"
        if least > 0.0 and value > least
        else ""
    )


def _overlap(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Whether two intervals overlap; one that is not known may lie anywhere."""
    ends = (a["low"], a["high"], b["low"], b["high"])
    return any(end is None for end in ends) or bool(a["low"] <= b["high"] and b["low"] <= a["high"])
