"""Tables in pages: what a comment chooses, what is replaced, and where the figures come from."""

import json
from types import SimpleNamespace

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

import comparison.cli.results as command
from comparison.cli import app
from comparison.report.pages import filled, markdown, read_blocks
from comparison.report.record import Record
from comparison.tables import Cell, Table, cell_text
from harpy_pin.errors import HarpyError, InputError, RunFileError
from reproduction.cli import app as reproduction_app

TABLE = Table(
    "walks",
    "Slip",
    (
        Cell("none", "fell", 3),
        Cell("none", "slip", 12.345, "mm"),
        Cell("wbc", "fell", 0),
        Cell("wbc", "slip", 0.25, "mm", 0.2, 0.31),
    ),
)
PAGE = """# Page

<!-- figures
table = "study/walks"
columns = {"slip" = "slip, mm"}
rows = ["wbc", "none"]
-->
| | old |
|---|---:|
| gone | 1 |

Text after it.

| a table | of its own |
|---|---|
| stays | 2 |
"""


def test_what_a_comment_chooses_replaces_what_was_there():
    asked = []

    def table_of(source, name):
        asked.append((source, name))
        return TABLE

    new = filled(PAGE, table_of)
    assert asked == [("study", "walks")]
    assert (
        "| | slip, mm |\n| --- | ---: |\n| wbc | 0.25 (0.2–0.31) |\n| none | 12.3 |\n\nText after "
        "it." in new
    )
    assert "gone" not in new
    assert new.endswith("| stays | 2 |\n")
    assert filled(new, table_of) == new


def test_all_rows_and_columns_are_shown_with_their_units_and_turned():
    assert (
        markdown(TABLE)
        == "| | fell | slip, mm |\n| --- | ---: | ---: |\n| none | 3 | 12.3 |\n| wbc | 0 | 0.25 "
        "(0.2–0.31) |\n"
    )
    assert markdown(TABLE, turned=True, rows={"wbc": "QP"}).splitlines() == [
        "| | QP |",
        "| --- | ---: |",
        "| fell | 0 |",
        "| slip, mm | 0.25 (0.2–0.31) |",
    ]


NAMES = st.text("abc, 123", min_size=1, max_size=6).map(str.strip).filter(bool)


@given(st.dictionaries(st.tuples(NAMES, NAMES), st.floats(0.0, 1e6), min_size=1))
def test_figures_are_read_as_they_were_written(values):
    table = Table(
        "t", "t", tuple(Cell(row, column, value) for (row, column), value in values.items())
    )
    page = filled('<!-- figures\ntable = "s/t"\n-->\n', lambda source, name: table)
    read = read_blocks(page)["s/t"]
    assert set(read) == {(row, column) for row in table.rows for column in table.columns}
    assert all(read[place] == cell_text(table.get(*place)) for place in read)


@pytest.mark.parametrize(
    ("comment", "message"),
    [
        ("table = ", "is not TOML"),
        ('table = "walks"', "lacks its table"),
        ('table = "study/walks"\nrow = ["wbc"]', "setting of a table"),
        ('table = "study/walks"\nrows = ["qp"]', "no row 'qp'; it has 'none', 'wbc'"),
        ('table = "study/walks"\ncolumns = ["mm"]', "no column 'mm'; it has 'fell', 'slip'"),
    ],
)
def test_comments_that_are_wrong(comment, message):
    with pytest.raises(InputError, match=message):
        filled(f"<!-- figures\n{comment}\n-->\n", lambda source, name: TABLE)


def test_a_record_is_read_as_it_was_written(tmp_path):
    odd = Table(
        "odd",
        "All sorts",
        (Cell("a [0]", "x, {y}", None), Cell('"b"', "µs", True, "", 1e-9, None)),
        "A note.",
    )
    document = {
        "commit": "0123abcd+",
        "code": "00",
        "machine": {"cpu": "one"},
        "versions": {"numpy": "2"},
        "walks": [],
    }
    Record.of("python -m comparison odd", document, [TABLE, odd]).save("odd", tmp_path)
    read = Record.load("odd", tmp_path)
    assert read.tables == {"walks": TABLE, "odd": odd}
    assert (read.command, read.origin["commit"]) == ("python -m comparison odd", "0123abcd+")
    lines = (tmp_path / "odd.json").read_text().splitlines()
    assert sum('"mm", 0.2, 0.31]' in line for line in lines) == 1  # a cell is a line


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"command": "x", "tables": {"a": {}}}', "\xff"])
def test_a_file_that_is_no_record_is_named(tmp_path, text):
    (tmp_path / "x.json").write_text(text, encoding="latin-1")
    with pytest.raises(RunFileError, match="is no record"):
        Record.load("x", tmp_path)


def test_what_was_never_measured_is_named_with_its_command(tmp_path):
    with pytest.raises(
        RunFileError, match="nothing is recorded of 'wide': python -m comparison results wide"
    ):
        Record.load("wide", tmp_path)


def test_only_what_the_folder_lacks_is_measured_and_pages_follow(tmp_path, monkeypatch):
    """The command of a source is run once; its record then makes the table, and without it
    again.
    """
    run = []

    def measured(words, **_):
        run.append(words[1:-2])
        row = {
            "ground": "8 kN/m",
            "friction": 0.25,
            "walker": "condensed",
            "dt_s": 5e-4,
            "ending": "completed",
        }
        numbers = {
            "end_time_s": 6.0,
            "distance_m": 1.8,
            "normal_n": 60.0,
            "path_mm": 0.5,
            "net_mm": 0.25,
        }
        with open(words[-1], "w") as file:
            json.dump({"commit": "abc", "walks": [{**row, **numbers}]}, file)
        return SimpleNamespace(returncode=0)

    records, data = tmp_path / "docs" / "results", tmp_path / "data"
    records.mkdir(parents=True)
    monkeypatch.setattr(command.subprocess, "run", measured)
    page = tmp_path / "docs" / "page.md"
    page.write_text('<!-- figures\ntable = "grounds/grounds_0.25_net"\n-->\n', encoding="utf-8")
    for _ in range(2):
        assert command.measured("grounds", data, records)
        command.fill_pages(tmp_path, records)
    assert run == [["-m", "comparison", "grounds", "--out", str(data / "grounds.jsonl")]]
    assert read_blocks(page.read_text())["grounds/grounds_0.25_net"] == {
        ("condensed WBC", "8 kN/m"): "0.25"
    }
    assert Record.load("grounds", records).origin["commit"] == "abc"


def test_a_report_of_the_paper_is_a_source(tmp_path, monkeypatch):
    def measured(words, **_):
        assert words[1:-2] == [
            "-m",
            "reproduction",
            "paper",
            "--out",
            str(tmp_path / "data" / "paper"),
        ]
        finding = {"claim": "Q4", "text": "It walks.", "verdict": "holds", "number": "2 m"}
        inside = {
            "violation_share": 0.5,
            "worst_violation_n": 2.0,
            "reversals_per_s": {"1": 1.5, "2": 3.0},
        }
        numbers = {"claims": [{**finding, "gait": gait} for gait in ("hand", "optimised")]}
        with open(words[-1], "w") as file:
            json.dump({**numbers, "vlip_inside": {"margin": inside}}, file)
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(command.subprocess, "run", measured)
    assert command.measured("paper", tmp_path / "data", tmp_path)
    record = Record.load("paper", tmp_path)
    assert record.command == "python -m reproduction paper"
    assert markdown(record.tables["claims"]).splitlines()[2:] == [
        "| Q4, hand | It walks. | holds | 2 m |",
        "| Q4, optimised | | holds | 2 m |",
    ]
    assert markdown(record.tables["vlip_inside"]).splitlines()[2:] == [
        "| margin | 50 | 2 | 1.5 | 3 |"
    ]


def test_a_command_that_fails_leaves_its_record(tmp_path, monkeypatch):
    monkeypatch.setattr(command.subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=3))
    Record.of("old", {}, [TABLE]).save("grounds", tmp_path)
    assert not command.measured("grounds", tmp_path / "data", tmp_path)
    assert Record.load("grounds", tmp_path).command == "old"


def test_unknown_sources_are_refused_before_anything_is_measured(tmp_path):
    with pytest.raises(HarpyError, match="unknown source 'moon'"):
        command.results(["moon"], tmp_path)


def test_every_source_is_a_command_of_ours(tmp_path):
    """Its words are understood, with the file that is asked for."""
    programs = {
        "comparison": typer.main.get_command(app),
        "reproduction": typer.main.get_command(reproduction_app),
    }
    for source, text in command.SOURCES.items():
        out = [] if source == "peers" else ["--out", str(tmp_path / "x")]
        name, *words = [*text.split(), *out, "--json", str(tmp_path / "x.json")]
        program, of_its_own = programs[name], not words[0].startswith("--")
        context = program.make_context("comparison", words[:1] if of_its_own else words)
        if of_its_own:
            program.get_command(context, words[0]).make_context(words[0], words[1:])


def test_brackets_hold_the_number_before_them():
    for low, value, high in ((24.6, 24.8, 26.1), (2.54, 2.54, 2.58), (35.6, 35.7, 35.9)):
        text = cell_text(Cell("a", "b", value, "µs", low, high))
        number, brackets = text.rstrip(")").split(" (")
        least, most = map(float, brackets.split("–"))
        assert least <= float(number) <= most
        assert least == pytest.approx(low, rel=0.05)
