"""The report: its page, that the CSV holds every number and every figure, and what changed between two results."""

from __future__ import annotations

import base64
import copy
import csv
import io
import itertools
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from comparison.benchmark import Settings, compare
from comparison.cli import app
from comparison.contenders import CONTENDERS
from comparison.report.contents import latency_table, pareto_table, tables_of
from comparison.report.diff import changes, changes_text, read_document
from comparison.report.html import figures_of, render, write_report
from comparison.report.pareto_figure import pareto_figure, pareto_front
from comparison.sections.tick_histograms import histogram
from comparison.tables import Cell, Table, from_csv, to_csv
from harpy_pin import InputError, RunFileError


@pytest.fixture(scope="module")
def document(whole_document: dict[str, Any]) -> dict[str, Any]:
    """A whole result, with a section of peers in it that does not depend on what is installed beside the library."""
    peers = {"friction": 0.25, "tolerance": {"force": 1e-3}, "contenders": {"tsid <1>": {"reason": "not installed"}}}
    return whole_document | {"peers": peers}


@pytest.fixture(scope="module")
def rendered(document: dict[str, Any]) -> str:
    """Its page."""
    return render(document)


class Reader(HTMLParser):
    """Text, images and addresses of a page; checks that its tags are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.images: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img"):
            self.open.append(tag)
        for name, value in attrs:
            if name == "src":
                self.images.append(value or "")
            if name == "href":
                self.addresses.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    return reader


def pixels(figure: Any) -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=50, metadata={"Software": None})
    return out.getvalue()


def test_the_page_needs_nothing_beside_it(document: dict[str, Any], rendered: str) -> None:
    page = read(rendered)
    assert len(page.images) == 3
    for image in page.images:
        kind, _, data = page.images[0].partition(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG"), image
    assert all(address.startswith("#") for address in page.addresses)
    text = " ".join(page.text)
    desired = ("whole-body QP", "no governor", "Growth", "Peers", "tsid <1>", "Machine", document["machine"]["cpu"])
    for part in (*desired, document["versions"]["pin"], *document["limitations"]):
        assert part in text
    assert "do not use" not in text


def test_the_page_leaves_out_what_was_not_measured(document: dict[str, Any]) -> None:
    less = {key: value for key, value in document.items() if key not in ("growth", "peers", "ticks", "campaign")}
    page = read(render(less))
    assert page.images == []
    assert "#peers" not in page.addresses
    less["checks"] = document["checks"] | {"passed": False}
    assert "do not use" in " ".join(read(render(less)).text)


def test_every_number_of_the_page_is_in_the_csv(document: dict[str, Any]) -> None:
    tables = tables_of(document)
    lines = list(csv.DictReader(io.StringIO(to_csv(tables))))
    assert list(lines[0]) == ["table", "row", "column", "value", "unit", "low", "high"]
    places = [(line["table"], line["row"], line["column"]) for line in lines]
    assert len(set(places)) == len(places)
    read_back = from_csv(to_csv(tables))
    assert list(read_back) == [t.name for t in tables if t.cells]
    for table in tables:
        if table.cells:
            assert read_back[table.name].cells == table.cells  # to the last bit


def test_every_figure_can_be_drawn_from_the_csv(document: dict[str, Any]) -> None:
    tables = tables_of(document)
    drawn = figures_of({table.name: table for table in tables})
    again = figures_of(from_csv(to_csv(tables)))
    assert drawn.keys() == again.keys() == {"pareto", "latency", "growth"}
    for name in drawn:
        assert pixels(drawn[name]) == pixels(again[name])


def test_times_and_slips_meet_in_one_table(document: dict[str, Any]) -> None:
    table = pareto_table(document)
    assert len(table.rows) == len(CONTENDERS)
    qp = document["ticks"]["contenders"]["wbc"]
    assert table.number("whole-body QP", "tick, median") == qp["p50_us"]
    assert qp["low_us"] <= qp["p50_us"] <= qp["high_us"]
    assert (
        table.number("whole-body QP", "slip per step")
        == document["campaign"]["whole"]["wbc"]["slip_mm_per_step"]["value"]
    )
    counted = sum(cell.value for cell in latency_table(document).cells if cell.column == "count")  # type: ignore[misc]
    assert counted == sum(entry["samples"] for entry in document["ticks"]["contenders"].values())


def test_histogram_keeps_every_time() -> None:
    times = np.array([1.0, 1.01, 5.0, 99.0])
    found = histogram(times)
    edges = np.array(found["edges_us"])
    assert sum(found["counts"]) == 4
    assert len(edges) == len(found["counts"]) + 1
    assert (edges[0] <= 1.0, edges[-1] > 99.0) == (True, True)
    np.testing.assert_array_equal(np.histogram(times, edges)[0], found["counts"])


def test_the_front_is_what_nobody_betters() -> None:
    points = {"a": (1.0, 5.0), "b": (2.0, 6.0), "c": (3.0, 1.0), "d": (3.0, 2.0), "e": (9.0, 1.0)}
    assert pareto_front(points) == ["a", "c"]
    with pytest.raises(InputError, match="no contender"):
        pareto_figure(Table("pareto", "", (Cell("x", "tick, median", 1.0), Cell("x", "slip per step", None))))


def test_labels_of_the_pareto_figure_do_not_cover_each_other() -> None:
    from matplotlib.text import Text

    cells: list[Cell] = []
    for i, slip in enumerate((0.1, 0.1, 0.101, 0.12, 2.0, 0.3)):
        name = f"governor '{i}'"
        cells += [
            Cell(name, "tick, median", 4.0 + 0.5 * i),
            Cell(name, "slip per step", slip),
            Cell(name, "falls", 0.1),
        ]
    figure = pareto_figure(Table("pareto", "", tuple(cells)))
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in figure.axes[0].texts]  # without leaders
    frame = figure.bbox
    assert len(boxes) == 13
    for i, box in enumerate(boxes):
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1
        assert not any(box.overlaps(other) for other in boxes[:i])


def test_the_report_is_three_files(document: dict[str, Any], rendered: str, tmp_path: Path) -> None:
    write_report(tmp_path, document)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.html", "results.csv", "results.json"]
    assert read_document(tmp_path / "results.json") == json.loads(json.dumps(document))
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == rendered


def test_changes_beyond_the_spread_are_flagged(document: dict[str, Any]) -> None:
    assert all(change.ratio in (1.0, None) and change.beyond is not True for change in changes(document, document))
    slower = copy.deepcopy(document)
    tick = slower["ticks"]["contenders"]["wbc"]
    for key in ("p50_us", "low_us", "high_us"):
        tick[key] *= 3.0
    slower["timing"]["governed"]["tick"]["p50_us"] *= 2.0
    found = {(c.table, c.row): c for c in changes(document, slower) if c.ratio not in (1.0, None)}
    assert found.keys() == {
        ("pareto", "whole-body QP"),
        ("ticks", "whole-body QP"),
        ("timing", "governed: complete tick"),
    }
    change = found["ticks", "whole-body QP"]
    assert (change.ratio, change.beyond) == (pytest.approx(3.0), True)
    assert found["timing", "governed: complete tick"].beyond is None  # its spread is not in the document

    text = changes_text(document, slower | {"versions": {"pin": "0"}}, 80)
    assert re.search(r"\nticks\n.*\nwhole-body QP, p50 +\S+ +\S+ +3\.000 +beyond\n", text, re.DOTALL)
    assert "versions differ" in text
    assert "2 of " in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "cannot read"), ("{", "not JSON"), ("[]", "lacks 'timing'"), ('{"timing": {}}', "lacks 'walk'")],
)
def test_what_is_no_result_is_refused(content: str | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(RunFileError, match=message):
        read_document(path)


def test_unknown_sections_are_refused() -> None:
    with pytest.raises(InputError, match="valid names: campaign"):
        compare(Settings(), sections=("nonsense",))


def test_diff_on_the_command_line(document: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(json.dumps(document))
    done = CliRunner().invoke(app, ["diff", str(path), str(path)])
    assert done.exit_code == 0
    assert re.search(r"\b0 of \d+ numbers with a known spread", done.stdout)


def test_a_document_of_another_shape_is_one_line(document: dict[str, Any], tmp_path: Path) -> None:
    """Whatever one entry is replaced by, the document is compared or refused, and nothing else is raised."""
    path = tmp_path / "strange.json"
    refused, values = 0, itertools.cycle((None, "x", [1], {"a": 1}, 1.5))
    for key in document:
        entries = list(document[key]) if isinstance(document[key], dict) else []
        for inner in (None, *(entries if key == "settings" or len(entries) < 12 else entries[:4])):  # rows of a kind
            strange = next(values)
            other = document | {key: strange if inner is None else document[key] | {inner: strange}}
            path.write_text(json.dumps(other, default=str))
            try:
                changes_text(document, read_document(path), 80)
            except RunFileError:
                refused += 1
    assert refused > 0
    path.write_text("[" * 100_000)
    with pytest.raises(RunFileError, match="not JSON"):
        read_document(path)
