"""A run in the tables and files of other programs, read back by their own readers; and objects in one line."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
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
    with pytest.raises(hp.InputError, match="pip install pandas"):
        run.to_pandas()
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(hp.InputError, match=r"pip install 'harpy-pin\[mcap\]'"):
        run.to_mcap("never.mcap")


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


def test_mcap(run, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    path = tmp_path / "run.mcap"
    run.to_mcap(path, every=2)
    with open(path, "rb") as file:
        found = [
            (schema, channel, message, json.loads(message.data))
            for schema, channel, message in reader.make_reader(file).iter_messages()
        ]
    topics = {channel.topic for _, channel, _, _ in found}
    assert topics == {f"/{name}" for name in run.signals if name != "t"} | {"/tf"}
    assert len(found) == 25 * len(topics)
    for schema, channel, message, content in found:
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        row = message.sequence
        assert message.log_time == pytest.approx(1e9 * (run["t"][row] - run["t"][0]), abs=1.0)
        if channel.topic == "/foot_force":
            assert content["right_foot"]["z"] == run["foot_force"][row, 1, 2]
            assert json.loads(schema.data)["properties"].keys() == content.keys()
        elif channel.topic == "/v":
            assert content["values"] == run["v"][row].tolist()
        elif channel.topic == "/tick_ns":
            assert content == {"value": run["tick_ns"][row]}
        elif channel.topic == "/tf":
            assert schema.name == "foxglove.FrameTransform"
            assert [content["rotation"][axis] for axis in "xyzw"] == run["q"][row, 3:7].tolist()


def test_numbers_that_json_lacks_are_null(run, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    run.to_mcap(tmp_path / "run.mcap")
    with open(tmp_path / "run.mcap", "rb") as file:
        messages = reader.make_reader(file).iter_messages(topics=["/foot_force"])
        contents = {message.sequence: json.loads(message.data) for _, _, message in messages}
    assert contents[7]["left_foot"]["z"] is None
    assert contents[8]["left_foot"]["z"] is not None


def test_command_line(run, tmp_path, monkeypatch, capsys):
    pytest.importorskip("mcap")
    from harpy_pin.cli.app import main

    log = tmp_path / "run.npz"
    run.save(log)
    words = ["harpy", "view", str(log), "--csv", str(tmp_path / "a.csv"), "--mcap", str(tmp_path / "a.mcap")]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert (tmp_path / "a.csv").stat().st_size > 1000
    assert (tmp_path / "a.mcap").read_bytes()[:5] == b"\x89MCAP"
    assert capsys.readouterr().out.count("wrote") == 2


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
