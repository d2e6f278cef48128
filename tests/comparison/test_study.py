"""The runner of the studies: settings, resumption, the command, and the tables that columns
describe.
"""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from comparison.cli.studies import STUDIES, command_of
from comparison.study import Job, Study, View, fell, mean, median, most, shown, where
from comparison.tables import Cell
from harpy_pin.errors import InputError

ROWS = [
    {"robot": "go2", "ground": "ice", "fell": False, "slip": 3.0},
    {"robot": "go2", "ground": "ice", "fell": True, "slip": 9.0},
    {"robot": "g1", "ground": "wood", "fell": False, "slip": None},
]
measured: list[Job] = []


def _measure(job: Job) -> dict[str, Any]:
    measured.append(job)
    return {"twice": 2 * job["number"], "none": float("nan")}


STUDY = Study(
    name="sums",
    help="Add.\n\nNumbers.",
    defaults={"kinds": ("one", "other"), "count": 3, "scale": 1.5},
    quick={"kinds": ("one",)},
    jobs=lambda s: ({"kind": kind, "number": k} for kind in s.kinds for k in range(s.count)),
    timed=lambda s: [{"kind": "timed", "number": 10}],
    measure=_measure,
    views=[View("sums", "Sums", "{kind}", {"most": (most("twice"), "mm")})],
    only="kinds",
)


def test_rows_are_jobs_with_what_was_measured_in_their_order():
    seen: list[tuple[int, int]] = []
    rows = STUDY.run(lambda done, total: seen.append((done, total)), count=2)
    assert [row["number"] for row in rows] == [0, 1, 0, 1, 10]
    assert rows[1] == {"kind": "one", "number": 1, "twice": 2, "none": None}
    assert seen == [(done, 5) for done in range(6)]
    assert len(STUDY.run(quick=True)) == 4


def test_finished_rows_are_kept_and_others_are_others(tmp_path):
    path = tmp_path / "rows.jsonl"
    measured.clear()
    first = STUDY.run(path=path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(
        b"".join(lines[:-2]) + lines[-1][:10]
    )  # it was stopped in the middle of a line
    assert STUDY.run(path=path) == first
    assert len(measured) == len(first) + 2
    assert STUDY.run(path=path, kinds=("other",)) == first[3:]
    assert len(measured) == len(first) + 2


def test_many_are_measured_in_processes():
    rows = STUDY.run(kinds=("one",), count=45)
    assert [row["twice"] for row in rows] == [*range(0, 90, 2), 20]


@pytest.mark.parametrize(
    ("name", "value"), [("kinds", ("third",)), ("count", -1), ("scale", float("nan")), ("size", 1)]
)
def test_settings_out_of_their_domain(name, value):
    with pytest.raises(InputError) as caught:
        STUDY.settings(**{name: value})
    assert name in str(caught.value)


def test_quick_and_defaults_are_settings_of_the_study():
    for study in (*STUDIES.values(), STUDY):
        study.settings(**study.quick)
        study.settings(
            **{name: value for name, value in study.defaults.items() if value is not None}
        )
        assert not study.only or isinstance(study.defaults[study.only], tuple)


def test_the_command_writes_every_row_and_prints_the_tables(tmp_path):
    import typer

    app = typer.Typer(rich_markup_mode=None)
    app.command()(command_of(STUDY))
    path = tmp_path / "sums.json"
    done = CliRunner().invoke(
        app, ["--only", "other", "--json", str(path), "--out", str(tmp_path / "kept")]
    )
    assert done.exit_code == 0, done.output
    assert [row["kind"] for row in json.loads(path.read_text())["walks"]] == ["other"] * 3 + [
        "timed"
    ]
    assert "other        4\n" in done.output
    assert len((tmp_path / "kept").read_text().splitlines()) == 4
    printed = CliRunner().invoke(app, ["--help"]).output
    assert "--only NAME" in printed
    assert "--figure" not in printed
    assert "--no-quick" not in printed


def test_columns_say_what_rows_say():
    columns = {
        "fell": fell,
        "standing": where(median("slip"), fell=False),
        "mean": (mean("slip"), "mm"),
        "worst": most("slip"),
        "least": shown("slip", min),
        "spread": (lambda rows: Cell("", "", 1.0, "", 0.5, 2.0), "s"),
    }
    (table,) = View("t", "T", "{robot}", columns, note="Note.").of(ROWS)
    assert [table.get("go2", name).value for name in columns] == ["1 of 2", 3.0, 6.0, 9.0, 3.0, 1.0]
    assert [table.get("g1", name).value for name in columns] == [
        "0 of 1",
        None,
        None,
        None,
        None,
        1.0,
    ]
    assert table.get("go2", "spread") == Cell("go2", "spread", 1.0, "s", 0.5, 2.0)
    assert (table.get("go2", "mean").unit, table.note) == ("mm", "Note.")


def test_one_quantity_by_two_headings():
    """Rows stand in the table that their entries name; a column without a value is left out."""
    view = View(
        "t_{robot}",
        "On {ground}",
        "{robot}",
        (median("slip"), "mm"),
        across=lambda row: row["ground"],
    )
    known, unknown = view.of(ROWS)
    assert (known.name, known.title, known.cells) == (
        "t_go2",
        "On ice",
        (Cell("go2", "ice", 6.0, "mm"),),
    )
    assert (unknown.name, unknown.cells) == ("t_g1", ())
