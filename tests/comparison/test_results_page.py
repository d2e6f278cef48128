"""Tables in pages: what a comment chooses, what is replaced, and where the figures come from."""

import json

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import comparison.cli.results as command
from comparison.cli import app
from comparison.cli.results import markdown, read_blocks, rewritten, sources_of
from comparison.tables import Cell, Table, cell_text
from harpy_pin.errors import HarpyError, InputError

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

    new = rewritten(PAGE, table_of)
    assert asked == [("study", "walks")]
    assert "| | slip, mm |\n| --- | ---: |\n| wbc | 0.25 (0.2–0.31) |\n| none | 12.3 |\n\nText after it." in new
    assert "gone" not in new
    assert new.endswith("| stays | 2 |\n")
    assert rewritten(new, table_of) == new


def test_all_rows_and_columns_are_shown_with_their_units_and_turned():
    assert (
        markdown(TABLE)
        == "| | fell | slip, mm |\n| --- | ---: | ---: |\n| none | 3 | 12.3 |\n| wbc | 0 | 0.25 (0.2–0.31) |\n"
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
    table = Table("t", "t", tuple(Cell(row, column, value) for (row, column), value in values.items()))
    page = rewritten('<!-- figures\ntable = "s/t"\n-->\n', lambda source, name: table)
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
        rewritten(f"<!-- figures\n{comment}\n-->\n", lambda source, name: TABLE)


def page_at(folder, table):
    path = folder / "page.md"
    path.write_text(f'<!-- figures\ntable = "{table}"\n-->\n', encoding="utf-8")
    return path


def test_only_what_the_folder_lacks_is_measured(tmp_path, monkeypatch):
    """The command of a source is run once; its document then makes the table."""
    run = []

    class Ended:
        returncode = 0

    def measured(words, **_):
        run.append(words[1:-2])
        row = {"ground": "8 kN/m", "friction": 0.25, "walker": "wbc", "dt_s": 5e-4, "ending": "completed"}
        numbers = {"end_time_s": 6.0, "distance_m": 1.8, "normal_n": 60.0, "path_mm": 0.5, "net_mm": 0.25}
        with open(words[-1], "w") as file:
            json.dump({"walks": [{**row, **numbers}]}, file)
        return Ended()

    monkeypatch.setattr(command.subprocess, "run", measured)
    page = page_at(tmp_path, "grounds/grounds_0.25_net")
    for _ in range(2):
        ended = CliRunner().invoke(app, ["results", str(page), "--data", str(tmp_path / "data")])
        assert ended.exit_code == 0, ended.output
    assert run == [["-m", "comparison", "grounds", "--out", str(tmp_path / "data" / "grounds.jsonl")]]
    assert read_blocks(page.read_text())["grounds/grounds_0.25_net"] == {("whole-body QP", "8 kN/m"): "0.25"}


def test_a_command_that_fails_leaves_its_tables(tmp_path, monkeypatch):
    """The tables of the others are made, and the error comes last."""
    row = {"what": "course", "plant": "compliant", "controller": "wbc", "impulse": 0.0, "fell": False}
    found = {"path_rms_mm": 0.75, "path_worst_mm": 2.0, "slip_mm_per_step": 0.5}
    (tmp_path / "steering.json").write_text(json.dumps({"walks": [row | found]}))

    class Ended:
        returncode = 3

    monkeypatch.setattr(command.subprocess, "run", lambda *_, **__: Ended())
    page = tmp_path / "page.md"
    old = '<!-- figures\ntable = "grounds/x"\n-->\n| | slip |\n|---|---:|\n| walk | 1 |\n\n'
    page.write_text(old + '<!-- figures\ntable = "steering/steering_commands"\n-->\n')
    with pytest.raises(HarpyError, match="failed, and their tables are as before: grounds"):
        command.results(page, tmp_path)
    assert page.read_text().startswith(old)
    assert read_blocks(page.read_text())["steering/steering_commands"]["course, compliant, QP", "rms, mm"] == "0.75"


def test_pages_that_are_wrong_stay(tmp_path):
    page = page_at(tmp_path, "moon/x")
    before = page.read_text()
    with pytest.raises(HarpyError, match="source of a table"):
        command.results(page, tmp_path)
    assert page.read_text() == before
    with pytest.raises(HarpyError, match="cannot read"):
        command.results(tmp_path / "none.md", tmp_path)


def test_every_source_is_a_command_of_ours(tmp_path):
    """Its words are understood, with the file that is asked for."""
    program = typer.main.get_command(app)
    for text in command.SOURCES.values():
        words = [*text.format(folder=tmp_path).split(), "--json", str(tmp_path / "x.json")]
        of_its_own = not words[0].startswith("--")
        context = program.make_context("comparison", words[:1] if of_its_own else words)
        if of_its_own:
            program.get_command(context, words[0]).make_context(words[0], words[1:])


def test_sources_are_named_once():
    assert sources_of(PAGE + PAGE) == ["study"]
