"""Sections of the comparison: what they report of correctness, and that their counts add up. No time is judged."""

from __future__ import annotations

import copy
from importlib.metadata import PackageNotFoundError
from typing import Any

import numpy as np
import pytest

import harpy_pin as hp
from comparison.measure.interleave import TimingSettings, counted, interleave
from comparison.measure.states import pushed_walk, record_states
from comparison.sections import growth
from comparison.sections.formulation_times import formulations_table
from comparison.sections.tick_histograms import make_all
from harpy_pin.model import catalogue
from harpy_pin.wbc import FORMULATIONS, installed_solvers


def test_ticks_count_every_controller_and_add_up(whole_document: dict[str, Any]) -> None:
    ticks = whole_document["ticks"]["contenders"]
    assert {"governed/none", "governed/filter", "wbc", "wbc/contact_force", "wbc/proxqp", "wbc/daqp"} <= ticks.keys()
    for entry in ticks.values():
        assert sum(entry["histogram"]["counts"]) == entry["samples"]
        edges, counts = entry["histogram"]["edges_us"], entry["histogram"]["counts"]
        for rate in (1, 2, 5, 10):  # the bins say the same, to the bin that the period lies in
            surely = sum(count for edge, count in zip(edges, counts, strict=False) if edge > 1e3 / rate)
            perhaps = sum(count for edge, count in zip(edges[1:], counts, strict=True) if edge > 1e3 / rate)
            assert surely <= entry["misses"][f"{rate} kHz"] <= perhaps
        assert entry["cold_p50_us"] > 0.0


def test_contenders_of_the_ticks_agree_where_they_are_the_same() -> None:
    """Without and with reuse of the active set the QP controller gives the same commands."""
    robot = hp.load_harpy()
    states = record_states("wbc", pushed_walk("wbc", friction=0.25, duration=0.8, impulse=3.0), least=1).states
    controllers = make_all(robot, 0.25)
    commands: dict[str, list[Any]] = {}
    for name in ("wbc", "wbc/proxqp", "wbc/daqp"):
        controllers[name].reset()
        steps = (controllers[name].step(state) for state in states)
        commands[name] = [np.concatenate((c.torque, c.thrust.ravel())) for c in steps]
    np.testing.assert_allclose(commands["wbc/daqp"], commands["wbc"], atol=1e-6)
    np.testing.assert_allclose(commands["wbc/proxqp"], commands["wbc"], atol=0.02)


def test_pushed_walk_is_pushed() -> None:
    runs = {
        impulse: pushed_walk("governed/filter", friction=0.25, duration=0.9, impulse=impulse) for impulse in (0.0, 3.0)
    }
    sideways = {impulse: run["v"][:, 1] for impulse, run in runs.items()}
    np.testing.assert_allclose(sideways[0.0][:590], sideways[3.0][:590])
    assert np.abs(sideways[3.0] - sideways[0.0]).max() > 0.1


def test_projections_are_the_same_whoever_does_them(whole_document: dict[str, Any]) -> None:
    section = whole_document["constraints"]
    assert {"update: paper, as walked", "update: contact, as walked", "projection: closed form"} <= section.keys()
    for name, row in section.items():
        assert row["p50_us"] > 0.0
        if name.startswith(("projection: ", "whole-body")) and name not in (
            "projection: closed form",
            "projection: daqp, bare call",
        ):
            assert row["gap_max"] < (1e-5 if "proxqp" in name else 1e-9), name
    assert section["projection: daqp"]["violated"] > 0.05  # there is something to project
    assert section["update: cone, disturbed"]["violated"] > 0.05


def test_formulations_are_the_same_problem(whole_document: dict[str, Any]) -> None:
    section = whole_document["formulations"]
    for formulation in FORMULATIONS:
        for solver in installed_solvers():
            row = section[f"{formulation}, {solver}"]
            assert row["unsolved"] == 0
            assert row["violation_max"] < 1e-4
            limit = {"daqp": 1e-5, "quadprog": 1e-5, "proxqp": 1e-2}.get(solver, 0.5)
            if formulation == "contact_force":  # another optimum where a motor is at its limit
                limit = 0.5
            assert row["difference_max"] < limit, (formulation, solver)
        reused = section[f"{formulation}, proxqp, active set reused"]["difference_max"]
        assert reused < (0.5 if formulation == "contact_force" else 1e-2)
    less = {name: row for name, row in copy.deepcopy(section).items() if "piqp" not in name}
    assert formulations_table(less, 0.25).note.endswith("Not installed: piqp.")


def test_growth_reports_what_is_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(catalogue, "distribution", missing)
    robot = hp.load_harpy()
    calls: list[None] = []
    entry = growth.time_growth(robot, repetitions=1, seed=0, faces=(4, 8), on_case=lambda: calls.append(None))
    assert len(calls) == growth.count_cases(robot, (4, 8))
    assert entry["absent"].keys() == growth.ROBOTS.keys()
    assert entry["freedoms"]["exponents"]["terms"] is None  # one size has no slope
    assert entry["faces"]["exponents"]["full"] is not None
    assert all(row["unsolved"] == 0.0 for kind in ("faces", "contacts") for row in entry[kind]["cases"].values())
    notes = [table.note for table in growth.growth_tables(entry)]
    assert "Solo12 ('solo_description/robots/solo12.urdf' is in example-robot-data: pip install" in notes[1]


def test_exponent_of_a_power() -> None:
    points = [(float(n), 3.0 * n**1.7) for n in (4, 8, 16)]
    assert growth.exponent_of(points) == pytest.approx(1.7)
    assert growth.exponent_of(points[:1]) is None


def test_interleaving_reaches_every_piece_once() -> None:
    class Timed:
        def __init__(self) -> None:
            self.played: list[int] = []

        def time_block(self, begin: int, end: int) -> None:
            self.played += range(begin, min(end, 25))

    timed = [Timed(), Timed(), Timed()]
    interleave(timed, 25, block=7, rng=np.random.default_rng(0))
    assert all(timer.played == list(range(25)) for timer in timed)
    mask = counted(25, TimingSettings(warm_up=3, block=7, settle=2))
    assert np.flatnonzero(~mask).tolist() == [0, 1, 2, 7, 8, 14, 15, 21, 22]
