"""Walks that go where they are told, as the comparison walks them: what is walked, and its tables."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from comparison.steering import (
    CONTROLLERS,
    FRICTIONS,
    SteeringSettings,
    SteeringWalk,
    _jobs,
    steering_tables,
    walk_steering,
)


def test_a_look_walks_every_kind():
    settings = replace(SteeringSettings.quick(), course=1.0, pushes=())
    seen = []
    rows = walk_steering(settings, lambda done, total: seen.append((done, total)))
    assert seen[-1] == (len(rows), len(_jobs(settings)))
    assert {row["what"] for row in rows} == {"course", "random", "slippery", "absurd"}
    assert not any(row["fell"] for row in rows)
    commands, slippery = steering_tables(rows)
    assert len(commands.rows) == 3 * len(CONTROLLERS)
    assert len(slippery.rows) == 2 * len(CONTROLLERS)
    assert commands.get("course, compliant, condensed", "fell").value == "0 of 1"


def test_walks_of_one_number_have_one_command_friction_and_push():
    job = SteeringWalk(what="pushed", controller="condensed", duration=7.0, seed=3, number=5, impulse=10.0)
    scenario = job.scenario()
    for other in (replace(job, controller="wbc"), replace(job, stiff=True), replace(job, plant="mujoco")):
        same = other.scenario()
        for name in ("gait", "ground", "disturbances"):
            assert getattr(same, name) == getattr(scenario, name)
    assert np.linalg.norm(scenario.disturbances.pushes[0].impulse) == pytest.approx(10.0)
    harder = replace(job, impulse=12.0).scenario()
    assert harder.gait == scenario.gait
    assert harder.disturbances.pushes[0].time == scenario.disturbances.pushes[0].time
    assert replace(job, number=6).scenario().gait != scenario.gait
    assert replace(job, seed=4).scenario().gait != scenario.gait


@pytest.mark.parametrize("what", FRICTIONS)
def test_commands_are_drawn_within_the_walk(what):
    for number in range(20):
        job = SteeringWalk(what=what, controller="condensed", duration=6.0, seed=0, number=number)
        scenario = job.scenario()
        low, high = FRICTIONS[what]
        assert low <= scenario.ground.mu_s <= high
        assert 0.3 <= scenario.gait.velocity[-1][0] < 5.0


def test_tables_count_falls_apart():
    base = SteeringWalk(what="pushed", controller="condensed", duration=7.0, seed=0, impulse=12.0)
    measures = {"stumbled": False, "path_rms_mm": 2.0, "path_worst_mm": 5.0, "slip_mm_per_step": 0.1}
    rest = {"speed_m_s": 0.2, "held_back": 0.0}
    rows = [
        {**asdict(replace(base, stiff=stiff, number=number)), **measures, **rest, "fell": not stiff and number < 2}
        for stiff in (False, True)
        for number in range(3)
    ]
    _, pushes = steering_tables(rows)
    assert pushes.get("12 N·s, default gains, condensed", "fell").value == "2 of 3"
    assert pushes.get("12 N·s, stiffer body, condensed", "fell").value == "0 of 3"
