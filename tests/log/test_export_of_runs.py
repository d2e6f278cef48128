"""A run in the tables and files of other programs, read back by their own readers; and objects in
one line.
"""

import csv

import numpy as np
import pytest
from command_line import harpy
from pages import make_run

import harpy_pin as hp


@pytest.fixture(scope="module")
def run(robot):
    made = make_run(robot, rows=50)
    made["foot_force"][7, 0, 2] = np.nan
    return made


def test_keys(run):
    assert run.keys() == list(run.signals)
    assert all(name in run for name in run.keys())  # noqa: SIM118


def test_table_of_pandas(run):
    pandas = pytest.importorskip("pandas")
    table = run.to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert table.index.name == "t"
    np.testing.assert_array_equal(table.index, run["t"])
    np.testing.assert_array_equal(table["foot_force/right_foot/z"], run["foot_force"][:, 1, 2])
    np.testing.assert_array_equal(table["thrust/left_thruster/x"], run["thrust"][:, 0, 0])
    np.testing.assert_array_equal(table["q/7"], run["q"][:, 7])
    np.testing.assert_array_equal(table["tick_ns"], run["tick_ns"])
    numbers = sum(array[0].size for name, array in run.signals.items() if name != "t")
    assert table.shape == (50, numbers)
    assert table.columns.is_unique


def test_without_pandas_it_says_how_to_install(run, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(hp.InputError, match=r"pip install .*pandas"):
        run.to_pandas()


def test_csv(run, tmp_path):
    path = tmp_path / "run.csv"
    run.to_csv(path, every=10)
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0][0] == "t"
    assert len(rows) == 1 + 5
    place = rows[0].index("q/3")
    assert [float(row[place]) for row in rows[1:]] == run["q"][::10, 3].tolist()  # exact
    with pytest.raises(hp.InputError, match="every"):
        run.to_csv(path, every=0)
    with pytest.raises(hp.RunFileError):
        run.to_csv(tmp_path / "nowhere" / "run.csv")


def test_command_line(run, tmp_path, monkeypatch, capsys):
    run.save(tmp_path / "run.npz")
    code, out, _ = harpy(
        monkeypatch, capsys, "view", tmp_path / "run.npz", "--csv", tmp_path / "a.csv"
    )
    assert (code, out.count("wrote")) == (0, 1)
    assert (tmp_path / "a.csv").stat().st_size > 1000


def test_objects_in_one_line(robot, run):
    gait = hp.make_commanded_gait(robot)
    objects = {
        robot: ("harpy", "4.02 kg", "6 joints", "2 feet", "2 thrusters"),
        run: ("harpy", "50 ticks", "completed"),
        hp.Scenario(duration=2.0): ("harpy", "hand", "condensed", "mu_s=0.25", "2 s"),
        gait: ("CommandedGait", "harpy"),
        hp.make_controller("condensed", gait, mu=0.5): ("CondensedController", "harpy", "1 ms"),
        hp.Simulator(robot): ("Simulator", "harpy"),
    }
    simulator = hp.Simulator(robot)
    simulator.reset(*gait.initial_state())
    texts = {repr(thing): words for thing, words in objects.items()}
    texts[repr(simulator.state)] = ("t=0.000 s", "2 feet")
    texts[repr(hp.Command(np.ones(6), np.zeros((2, 3))))] = ("6 torques up to 1 N·m", "2 thrusts")
    for text, words in texts.items():
        assert len(text) < 120
        assert "\n" not in text
        for word in words:
            assert word in text
