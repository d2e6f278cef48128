"""Robots that walk: the condensed WBC has the WBC QP's optimum at the QP's own states, and every tick is timed."""

from __future__ import annotations

import pytest
from needs import needs_robots

from comparison.robots import run_standing
from comparison.walking import WalkingWalk
from comparison.walking_ticks import tick_table, ticks_of
from harpy_pin import load_robot


@needs_robots
@pytest.mark.parametrize("number", [1, 4])
def test_torques_of_a_heavy_robot_are_those_of_the_qp(number: int) -> None:
    """Of 87 kg forces weigh so little that a multiplier of 1e-7 is worth newtons."""
    row = ticks_of(WalkingWalk(robot="hyq", what="random", duration=3.0, seed=1000, number=number).scenario())
    assert row["apart_worst"] < 1e-5
    assert 0.0 < row["apart"] < 1e-6
    assert tick_table([{"robot": "hyq", **row}]).number("hyq", "over 2 ms") == row["late"]


@needs_robots
def test_every_tick_of_a_robot_that_stands_is_timed() -> None:
    run, times = run_standing(load_robot("solo12"), "condensed", duration=1.2)
    assert len(times) == len(run) - 10
    assert (times > 0.0).all()
