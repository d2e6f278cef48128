"""Walks with thrusters that lag: what is walked, resumed, and shown."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import comparison.thrusters as study
from comparison.cli import app
from comparison.thruster_tables import thruster_tables
from comparison.thrusters import WALKERS, ThrusterSettings, walk_with_lag
from harpy_pin.errors import HarpyError

SMALL = replace(ThrusterSettings.quick(), lags=(0.1,), turning_lags=(), failing=(), duration=0.2)


def test_finished_walks_are_kept(tmp_path, monkeypatch):
    path = tmp_path / "thrusters.jsonl"
    first = walk_with_lag(SMALL, None, path)
    assert [row["walker"] for row in first] == list(WALKERS)
    assert not any(row["fell"] for row in first)
    monkeypatch.setattr(study, "_walked", None)
    assert walk_with_lag(SMALL, None, path) == first


def test_plant_and_controllers_get_what_the_walk_says(monkeypatch):
    walked = []

    def keep(scenario):
        walked.append(scenario)
        raise HarpyError("enough")

    monkeypatch.setattr(study, "walk_as_far_as_it_goes", keep)
    more = {"lags": (0.0, 0.1), "turning_lags": (0.05,), "failing": (0.5,), "bandwidths": (None, 50.0)}
    jobs = list(study._jobs(replace(SMALL, **more, plants=("ours", "MuJoCo"))))
    for job in jobs:
        with pytest.raises(HarpyError, match="enough"):
            study._walked(job)
    for job, scenario in zip(jobs, walked, strict=True):
        actuators = scenario.disturbances.actuators
        assert actuators.thrusters.lag == job["lag"]
        assert actuators.bandwidth == job["bandwidth"]
        assert actuators.thrusters.turning_lag == job["turning_lag"]
        assert (actuators.thrusters.failing or (0, 0, None))[2] == job["failing"]
        known = scenario.controller.parameters
        if "knows" in job["walker"]:
            assert known == {"thrust_lag": job["lag"], "thrust_turning_lag": job["turning_lag"]}
            assert job["lag"] + job["turning_lag"] > 0.0
        else:
            assert not known


def test_tables_show_falls_slip_and_thrust():
    row = {"plant": "ours", "friction": 0.25, "bandwidth": 50.0, "lag": 0.1, "walker": "QP"}
    row |= {"turning_lag": 0.0, "failing": None, "thrust_n": 8.0, "thrust_w": 300.0}
    rows = [{**row, "fell": fell, "slip_mm_per_step": 0.25} for fell in (True, False)]
    place = ("100 ms, motors of 50 Hz", "QP")
    _, slip, *_ = thruster_tables(rows)
    assert slip.get(*place).value == "fell 1/2"
    _, *found = thruster_tables(rows[1:])
    assert [table.get(*place).value for table in found] == ["0.25", "8", "300"]
    turning = [{**rows[1], "turning_lag": 0.05, "lag": 0.0, "bandwidth": None}]
    assert thruster_tables(turning)[1].get("directions 50 ms", "QP").value == "0.25"
    failing = [{**rows[1], "failing": 0.5, "lag": 0.0, "bandwidth": None}]
    assert thruster_tables(failing)[1].get("50 % of one left", "QP").value == "0.25"


def test_margins_are_ratios_of_the_gains():
    margins = thruster_tables([])[0]
    assert margins.get("WBCs: orientation", "k_d / k_p").value == pytest.approx(100.0)
    assert margins.get("WBCs: position", "held over a tick").value == pytest.approx(400.0, rel=0.01)


def test_command_writes_every_walk(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ThrusterSettings, "quick", classmethod(lambda cls: SMALL))
    app(["thrusters", "--quick", "--json", str(tmp_path / "thrusters.json")], standalone_mode=False)
    assert len(json.loads((tmp_path / "thrusters.json").read_text())["walks"]) == len(WALKERS)
    assert "ours, friction 0.25" in capsys.readouterr().out
