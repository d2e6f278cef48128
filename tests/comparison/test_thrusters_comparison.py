"""Walks with thrusters that lag: what is walked, resumed, and shown."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import comparison.thrusters as study
from comparison.cli import app
from comparison.thrusters import WALKERS, ThrusterSettings, thruster_tables, walk_with_lag
from harpy_pin.errors import HarpyError

SMALL = replace(ThrusterSettings.quick(), lags=(0.1,), duration=0.2)


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
    jobs = list(study._jobs(replace(SMALL, lags=(0.0, 0.1), bandwidths=(None, 50.0), plants=("ours", "MuJoCo"))))
    for job in jobs:
        with pytest.raises(HarpyError, match="enough"):
            study._walked(job)
    for job, scenario in zip(jobs, walked, strict=True):
        actuators = scenario.disturbances.actuators
        assert actuators.thrusters.lag == job["lag"]
        assert actuators.bandwidth == job["bandwidth"]
        known = scenario.controller.parameters.get("thrust_lag", 0.0)
        assert known == (job["lag"] if "knows" in job["walker"] else 0.0)
        assert job["lag"] > 0.0 or "knows" not in job["walker"]


def test_tables_show_falls_slip_and_thrust():
    row = {"plant": "ours", "friction": 0.25, "bandwidth": 50.0, "lag": 0.1, "walker": "QP"}
    rows = [{**row, "fell": fell, "slip_mm_per_step": 0.25, "thrust_n": 8.0} for fell in (True, False)]
    place = ("100 ms, motors of 50 Hz", "QP")
    slip, _ = thruster_tables(rows)
    assert slip.get(*place).value == "fell 1/2"
    slip, thrust = thruster_tables(rows[1:])
    assert (slip.get(*place).value, thrust.get(*place).value) == ("0.25", "8")


def test_command_writes_every_walk(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ThrusterSettings, "quick", classmethod(lambda cls: SMALL))
    app(["thrusters", "--quick", "--json", str(tmp_path / "thrusters.json")], standalone_mode=False)
    assert len(json.loads((tmp_path / "thrusters.json").read_text())["walks"]) == len(WALKERS)
    assert "ours, friction 0.25" in capsys.readouterr().out
