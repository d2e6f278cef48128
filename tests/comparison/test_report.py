"""The report: its answer, that the CSV holds every number and every figure, and what
changed between two.
"""

import copy
import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import comparison.cli.commands as command_line
from comparison.cli import app
from comparison.cli.results import ROOT, pages
from comparison.contenders import CONTENDERS
from comparison.report.answer import COLUMNS, answer_of
from comparison.report.figures import pareto_figure, pareto_front
from comparison.report.pages import blocks_of, filled
from comparison.report.report import pareto_table, tables_of, write_report
from comparison.tables import Cell, Table, to_csv
from harpy_pin import InputError
from harpy_pin.files import OwnFolder

NAMES = tuple(COLUMNS)


OTHERS = ("late_slip_mm_per_step", "sliding", "low_force", "tracking_rms_mm")


def spread(value: float | None, width: float = 0.1) -> dict[str, float | None]:
    if value is None:
        return {"value": None, "low": None, "high": None}
    return {"value": value, "low": value * (1.0 - width), "high": value * (1.0 + width)}


def document_of(
    ticks: tuple[float, ...] = (8.0, 12.0, 14.0, 24.0, 18.0, 32.0, 360.0),
    slips: tuple[float | None, ...] = (2.0, 4.0, 3.5, 1.0, 3.0, 0.5, 0.5),
    falls: tuple[int, ...] = (0, 5, 4, 0, 2, 1, 1),
    *,
    width: float = 0.1,
) -> dict[str, Any]:
    """A result of which only the answer is asked: of 10 walks each."""
    whole = {
        name: {"walks": 10, "falls": spread(fell / 10), "slip_mm_per_step": spread(slip, width)}
        | {key: spread(1.0) for key in OTHERS}
        for name, slip, fell in zip(NAMES, slips, falls, strict=True)
    }
    worst = {name: {"slip_mm_per_step": spread(159.0)} for name in NAMES}
    worst["governed/filter"]["slip_mm_per_step"] = spread(25.0)
    settings = {"duration": 2.5, "frictions": [0.15, 0.8]}
    times = {
        name: {"p50_us": tick, "p99_us": 2.0 * tick}
        for name, tick in zip(NAMES, ticks, strict=True)
    }
    contenders = {
        name: entry | ({} if name == "wbc" else {"inside_c": entry})
        for name, entry in times.items()
    }
    contenders["wbc"]["own_timer"] = {"p50_us": 0.75 * ticks[-1]}
    return {
        "ticks": {"friction": 0.25, "contenders": contenders},
        "campaign": {
            "whole": whole,
            "settings": settings,
            "factors": {"friction": {"0.8": whole, "0.15": worst}},
        },
        "checks": {"passed": True},
    }


def words_of(document: dict[str, Any]) -> str:
    return " ".join(answer_of(document).sentences)


def test_words_follow_from_the_numbers() -> None:
    text = words_of(document_of())
    assert (
        "slip least with: whole-body QP by ProxQP, 0.5 mm per step; next contact-force filter, 1 "
        "(2.0×)." in text
    )
    assert (
        "The paper's governor makes more slip: 4 mm per step with it, 2 without, 3.5 in its best "
        "variant." in text
    )
    cost = (
        "A tick of the paper's governor takes 12 µs; that of the condensed WBC 1.5 times as "
        "long, of the whole-body "
    )
    cost += (
        "QP 2.67 times by own search and 30 times by ProxQP (360 µs, of which 270 by ProxQP's "
        "own timer). "
    )
    assert (
        cost + "The condensed WBC takes 0.562 of the QP's time by own search, and 0.05 by ProxQP."
        in text
    )
    assert "Every timed command equals an untimed one." in text


def test_other_numbers_turn_the_words_around() -> None:
    ticks, slips = (90.0, 80.0, 75.0, 70.0, 60.0, 5.0, 4.0), (3.0, 1.0, 4.0, 2.0, 50.0, 40.0, 40.0)
    text = words_of(document_of(ticks, slips, (10, 0, 4, 3, 10, 9, 9)))
    assert (
        "slip least with: paper's governor, 1 mm per step; next contact-force filter, 2 (2.0×)."
        in text
    )
    assert "makes less slip: 1 mm per step with it, 3 without, 4 in its best variant." in text
    cost = (
        "the condensed WBC 0.75 times as long, of the whole-body QP 0.0625 times by own search "
        "and 0.05 times by "
    )
    assert cost + "ProxQP (4 µs, of which 3 by ProxQP's own timer)." in text


def test_what_the_spreads_do_not_tell_is_not_said() -> None:
    text = words_of(document_of(width=0.9))
    assert "and their 95 % intervals overlap." in text
    sizes = "4 mm per step with it, 2 without, 3.5 in its best variant."
    assert f"These walks do not show whether the paper's governor makes less slip: {sizes}" in text
    unknown = document_of()
    unknown["campaign"]["whole"]["wbc"]["slip_mm_per_step"] |= {"low": None, "high": None}
    assert "and their 95 % intervals overlap." in words_of(unknown)


def test_times_that_were_not_verified_are_refused() -> None:
    document = document_of() | {"checks": {"passed": False}}
    text = words_of(document)
    assert "DO NOT USE THESE TIMES" in text
    assert "equals an untimed one" not in text


def test_the_best_of_each_row_is_marked_and_ties_are_shared() -> None:
    found = answer_of(document_of())
    marks = {heading: [best for _, best in cells] for heading, cells in found.rows}
    assert marks["tick, median, µs"] == [True, *[False] * 6]
    assert marks["slip, μ 0.15"] == [*[False] * 3, True, *[False] * 3]
    assert marks["slip, all walks"] == [*[False] * 5, True, True]
    assert marks["falls, % of walks"] == [True, False, False, True, *[False] * 3]
    assert marks["in C, median, µs"] == [True, *[False] * 6]
    assert marks["off target, mm"] == [True] * 7
    inside = dict(found.rows)["in C, median, µs"]
    assert inside[-1] == ("–", False)  # C cannot call ProxQP


STRESS = (
    document_of(
        (98765.4, 123456.7, 123456.8, 234567.8, 4.0, 345678.9, 456789.1),
        (1234.5, 0.000123456, 0.000123457, 99999.9, 12.0, 1e-9, 1e-9),
        (10,) * 7,
    ),
    document_of((1e-3, 2e-3, 3e-3, 6e-3, 5e-3, 4e-3, 7e-3), (None,) * 7, (0,) * 7),
    document_of((7.0,) * 7, (0.0,) * 7),
    document_of(width=0.9),
)


@pytest.mark.parametrize("document", STRESS)
def test_the_answer_fits_the_terminal_whatever_the_numbers(document: dict[str, Any]) -> None:
    for walks in (1, 99999):
        changed = copy.deepcopy(document)
        for entry in changed["campaign"]["whole"].values():
            entry["walks"] = walks
        lines = answer_of(changed).to_string("out/comparison/results.csv").splitlines()
        assert len(lines) <= 25
        assert max(map(len, lines)) <= 80
        assert lines[-1] == "Everything else: out/comparison/results.csv"
        assert not re.search(r"\x1b|…", "".join(lines))


def test_tables_for_a_terminal_never_break_a_cell() -> None:
    cells = [
        Cell("a contender", f"measure {i}", 1234.5 + i, "mm", 1000.0, 2000.0) for i in range(12)
    ]
    cells.append(
        Cell(
            "absent",
            "no times",
            "a reason that is far too long to stand in the column of any table",
        )
    )
    table = Table(
        "x",
        "A title that is longer than the terminal is wide, so that it has to go on below it",
        tuple(cells),
    )
    text = table.to_string(80)
    assert max(map(len, text.splitlines())) <= 80
    for i in range(12):
        assert f"measure {i}, mm" in text
        assert f"{1234.5 + i:.0f} (1000–2000)" in text
    assert "absent: a reason that is far too long" in text


def test_the_command_prints_the_answer_and_nothing_else(
    document: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command_line, "compare", lambda *args, **kwargs: document)
    done = CliRunner().invoke(app, ["--quick", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    *lines, last, quick = done.stdout.splitlines()
    assert "no evidence" in quick
    assert last == f"Everything else: {tmp_path / 'results.csv'}"
    assert len(lines) < 25
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith("The feet slip least with: ")
    assert (tmp_path / "results.csv").is_file()
    assert "\x1b" not in done.stdout
    assert done.stderr.strip() == ""


def test_a_failed_check_fails_the_command(
    document: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = document | {"checks": document["checks"] | {"passed": False}}
    monkeypatch.setattr(command_line, "compare", lambda *args, **kwargs: failed)
    monkeypatch.setattr(command_line, "write_report", lambda *args: None)
    done = CliRunner().invoke(app, ["--quick", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "DO NOT USE THESE TIMES" in done.stdout
    assert done.stderr.startswith("error: a timed command was not what it should be")


@pytest.fixture(scope="module")
def document(whole_document: dict[str, Any]) -> dict[str, Any]:
    return whole_document


def test_every_number_is_in_the_csv(document: dict[str, Any]) -> None:
    """To the last bit, and at a place of its own."""
    cells = [(table.name, *cell) for table in tables_of(document) for cell in table.cells]
    heading, *lines = csv.reader(io.StringIO(to_csv(tables_of(document))))
    assert heading == ["table", "row", "column", "value", "unit", "low", "high"]
    assert lines == [["" if part is None else str(part) for part in cell] for cell in cells]
    assert len({tuple(line[:3]) for line in lines}) == len(lines)


def test_times_and_slips_meet_in_one_table(document: dict[str, Any]) -> None:
    table = pareto_table(document)
    assert len(table.rows) == len(CONTENDERS)
    qp = document["ticks"]["contenders"]["wbc"]
    assert table.number("whole-body QP, ProxQP", "tick, median") == qp["p50_us"]
    rounding = 1.0 + 1e-12
    assert qp["low_us"] <= qp["p50_us"] * rounding <= qp["high_us"] * rounding**2
    assert (
        table.number("whole-body QP, ProxQP", "slip per step")
        == document["campaign"]["whole"]["wbc"]["slip_mm_per_step"]["value"]
    )


def test_the_front_is_what_nobody_betters() -> None:
    points = {"a": (1.0, 5.0), "b": (2.0, 6.0), "c": (3.0, 1.0), "d": (3.0, 2.0), "e": (9.0, 1.0)}
    assert pareto_front(points) == ["a", "c"]
    with pytest.raises(InputError, match="no contender"):
        pareto_figure(
            Table("pareto", "", (Cell("x", "tick, median", 1.0), Cell("x", "slip per step", None)))
        )


def test_the_figure_names_every_contender_with_its_falls() -> None:
    cells: list[Cell] = []
    for name, share in (("paper's governor", 0.28), ("whole-body QP, ProxQP", 0.0)):
        cells += [Cell(name, "tick, median", 4.0), Cell(name, "slip per step", 0.1)]
        cells.append(Cell(name, "falls", share))
    (legend,) = pareto_figure(Table("pareto", "", tuple(cells))).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["paper's governor\nfalls in 28 % of walks", "whole-body QP, ProxQP\nno falls"]


def test_the_report_is_two_files(document: dict[str, Any], tmp_path: Path) -> None:
    write_report(OwnFolder(tmp_path), document)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        OwnFolder.LIST,
        "results.csv",
        "results.json",
    ]
    assert json.loads((tmp_path / "results.json").read_text()) == json.loads(json.dumps(document))


def test_every_row_and_column_that_pages_name_is_printed(whole_document: dict[str, Any]) -> None:
    """README's and docs' tables of the comparison can be made of what today's code prints.

    But for those by a factor, such as friction, of which one walk has none.
    """
    printed = {table.name: table for table in tables_of(whole_document)}
    blocks = [
        re.sub(r'"slip, μ [^"]*" = "[^"]*",?\s', "", block)
        for text in pages(ROOT).values()
        for name, found in blocks_of(text).items()
        for block in found
        if name.startswith("comparison/") and not name.startswith("comparison/campaign_")
    ]
    assert len(blocks) >= 5
    for block in blocks:
        filled(block, lambda source, name: printed[name])
    ticks = next(block for block in blocks if '"no governor" =' in block)
    gone = ticks.replace('"no governor" =', '"gone" =')
    with pytest.raises(InputError, match="has no row 'gone'"):
        filled(gone, lambda source, name: printed[name])
