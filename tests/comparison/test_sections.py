"""Sections of the comparison: what they report of correctness, and that their counts add up. No
time is judged.
"""

from typing import Any

import numpy as np
import pytest

import harpy_pin as hp
from comparison.contenders import CONTENDERS, OWN
from comparison.measure.timing import Bench, TimingSettings
from comparison.measure.walking import record_states, recorded_walk
from comparison.sections import ticks
from comparison.sections.ticks import make_all
from harpy_pin.contrib.solvers import SOLVERS
from harpy_pin.wbc import FORMULATIONS

BY_PYTHON = {"wbc", "wbc/daqp"}
"""Contenders whose solver is a module of Python."""


def test_ticks_count_every_controller_and_add_up(whole_document: dict[str, Any]) -> None:
    ticks = whole_document["ticks"]["contenders"]
    assert {*CONTENDERS, "wbc/daqp"} == ticks.keys()
    inside = {name: entry["inside_c"] for name, entry in ticks.items() if "inside_c" in entry}
    assert ticks.keys() - inside.keys() == BY_PYTHON
    assert all(
        (e["differing"], e["samples"]) == (0, ticks[name]["samples"]) for name, e in inside.items()
    )
    assert whole_document["ticks"]["own_walks"].keys() == set(CONTENDERS)
    own_timer = ticks["wbc"]["own_timer"]
    assert own_timer["samples"] == ticks["wbc"]["samples"]
    assert 0.0 < own_timer["p50_us"] < ticks["wbc"]["p50_us"]
    assert ticks["wbc"]["fallbacks"] == 0


def test_contenders_of_the_ticks_agree_where_they_are_the_same(robot: hp.Robot) -> None:
    """By every solver the QP controller gives the same commands."""
    states = record_states(
        OWN, recorded_walk(OWN, friction=0.25, duration=0.8, impulse=3.0), least=1
    ).states
    controllers = make_all(robot, 0.25)
    commands: dict[str, list[Any]] = {}
    for name in (OWN, "wbc", "wbc/daqp"):
        controllers[name].reset()
        steps = (controllers[name].step(state) for state in states)
        commands[name] = [np.concatenate((c.torque, c.thrust.ravel())) for c in steps]
    np.testing.assert_allclose(commands["wbc/daqp"], commands[OWN], atol=1e-6)
    np.testing.assert_allclose(commands["wbc"], commands[OWN], atol=1e-3)


def test_formulations_are_the_same_problem(whole_document: dict[str, Any]) -> None:
    section = whole_document["formulations"]
    for formulation in FORMULATIONS:
        for solver in SOLVERS:
            row = section[f"{formulation}, {solver}"]
            assert row["unsolved"] == 0
            assert row["violation_max"] < 1e-4
            limit = {"active_set": 1e-5, "daqp": 1e-5, "quadprog": 1e-5, "proxqp": 1e-3}.get(
                solver, 0.5
            )
            assert row["difference_max"] < limit, (formulation, solver)


def test_walks_beside_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ticks, "CONTENDERS", ("governed/paper", OWN, "wbc"))
    pieces: list[int] = []
    settings, rng = TimingSettings(repetitions=2), np.random.default_rng(0)
    bench = Bench(
        robot=hp.load_harpy(),
        friction=0.8,
        settings=settings,
        rng=rng,
        on_pass=lambda: pieces.append(1),
    )
    entry = ticks.time_simulator(bench, duration=0.1)
    assert len(pieces) == 3 * ticks.WALKS
    for row in entry.values():
        assert row["ending"] == "completed"
        assert (
            0.0 < row["real_time"]["low"] <= row["real_time"]["value"] <= row["real_time"]["high"]
        )
    assert ticks.simulator_table(entry).rows == [
        "paper's governor",
        "whole-body QP, own search",
        "whole-body QP, ProxQP",
    ]
