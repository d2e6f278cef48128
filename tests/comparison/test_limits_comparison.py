"""Walks at the limits of the motors: resumed, and shown."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import comparison.limits as study
from comparison.cli import app
from comparison.limits import WALKERS, LimitsSettings, limit_tables, walk_limits
from harpy_pin.errors import HarpyError

SMALL = replace(LimitsSettings.quick(), damping=(), torque=(0.5,), bandwidth=(), viscous=(), coulomb=(), duration=0.2)


def test_finished_walks_are_kept(tmp_path, monkeypatch):
    path = tmp_path / "limits.jsonl"
    first = walk_limits(SMALL, None, path)
    assert [row["walker"] for row in first] == list(WALKERS)
    assert not any(row["fell"] for row in first)
    monkeypatch.setattr(study, "walk_as_far_as_it_goes", None)
    assert walk_limits(SMALL, None, path) == first
    assert len(path.read_text().splitlines()) == len(first)


def test_controllers_and_robot_get_what_the_walk_says():
    walked = []

    def keep(scenario):
        walked.append(scenario)
        raise HarpyError("enough")

    settings = replace(SMALL, damping=(50.0,), torque=(0.5,), coulomb=(0.3,))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "walk_as_far_as_it_goes", keep)
        for job in study._jobs(settings):
            with pytest.raises(HarpyError, match="enough"):
                study._walked(job)
    assert len(walked) == 3 * len(WALKERS)
    for job, scenario in zip(study._jobs(settings), walked, strict=True):
        share = 0.5 if job["kind"] == "torque" else 1.0
        actuators = scenario.disturbances.actuators
        assert actuators.torque_share == share
        assert actuators.coulomb_friction == (0.3 if job["kind"] == "coulomb" else 0.0)
        if scenario.controller.name == "condensed":
            assert scenario.controller.parameters.get("limits", {}).get("torque_scale", 1.0) == share
        if job["kind"] == "damping":
            with open(scenario.urdf) as file:
                assert file.read().count('damping="5"') == 6


def test_tables_show_falls_and_slip():
    row = {"gait": "straight", "friction": 0.8, "kind": "damping", "value": 50.0, "walker": "none"}
    rows = [{**row, "fell": fell, "slip_mm_per_step": 0.25} for fell in (True, False)]
    _, table = limit_tables(rows)
    assert table.get("damping 5 N·m·s/rad", "none").value == "fell 1/2"
    _, table = limit_tables(rows[1:])
    assert table.get("damping 5 N·m·s/rad", "none").value == "0.25"


def test_command_writes_every_walk(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(LimitsSettings, "quick", classmethod(lambda cls: SMALL))
    app(["limits", "--quick", "--json", str(tmp_path / "limits.json")], standalone_mode=False)
    assert len(json.loads((tmp_path / "limits.json").read_text())["walks"]) == len(WALKERS)
    assert "friction 0.25" in capsys.readouterr().out
