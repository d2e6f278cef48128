"""Walks of the catalogue's robots, as the comparison walks them: what is walked, and its tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from needs import needs_robots

import comparison.walking as study
from comparison.walking import DRAWN, SIDES, WalkingSettings, WalkingWalk, _jobs, walk_robots, walking_tables
from harpy_pin import WalkingGait, load_robot

pytestmark = needs_robots


def test_a_look_walks_every_kind_without_a_fall():
    rows = walk_robots(replace(WalkingSettings.quick(), course=2.0))
    assert [row["what"] for row in rows if "fell" not in row] == ["ticks"]
    assert not any(row.get("fell") for row in rows)
    tables = walking_tables(rows)
    assert len(tables) == len(rows) + 1  # one for each kind of walk, one for the robot, one of ticks
    assert tables[0].get("solo12", "fell").value == "0 of 1"


def test_finished_walks_are_kept(tmp_path, monkeypatch):
    path, settings = tmp_path / "walks.jsonl", replace(WalkingSettings.quick(), course=1.0, walks=0, walks_on_four=0)
    first = walk_robots(settings, None, path)
    assert len(path.read_text().splitlines()) == len(first) > 1
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[1:]))
    again = walk_robots(settings, None, path)
    assert again == first
    monkeypatch.setattr(study, "walked", None)
    assert walk_robots(settings, None, path) == first


def test_walks_of_one_number_have_one_command_and_friction():
    job = WalkingWalk(robot="solo12", what="random", duration=4.0, seed=3, number=5)
    scenario = job.scenario()
    for other in (replace(job, controller="wbc"), replace(job, plant="mujoco")):
        same = other.scenario()
        for name in ("gait", "ground", "disturbances"):
            assert getattr(same, name) == getattr(scenario, name)
    assert DRAWN[0] <= scenario.ground.mu_s <= DRAWN[1]
    assert replace(job, number=6).scenario().gait != scenario.gait
    late = replace(job, what="random, noise and delay").scenario()
    assert late.gait == scenario.gait
    assert late.disturbances.delay > 0.0
    fastest = WalkingGait(load_robot("solo12")).describe()["max_speed"]
    assert np.abs(np.array(scenario.gait.velocity)[:, 1:3]).max() <= fastest


def test_pushes_come_from_every_side():
    pushes = [
        WalkingWalk(robot="g1", what="pushed", duration=4.0, seed=0, number=k).scenario().disturbances.pushes[0].impulse
        for k in range(SIDES)
    ]
    robot = load_robot("g1")
    np.testing.assert_allclose(np.linalg.norm(pushes, axis=1), 0.15 * robot.mass)
    np.testing.assert_allclose(np.sum(pushes, axis=0), 0.0, atol=1e-9)


def test_robots_on_soles_walk_ten_metres_and_turn_by_a_right_angle():
    jobs = [job for job in _jobs(WalkingSettings(robots=("go2", "icub"))) if job.what == "ten metres"]
    assert [(job.robot, job.plant) for job in jobs] == [("icub", "compliant"), ("icub", "mujoco")]
    rows = jobs[0].scenario().gait.velocity
    ends = [row[0] for row in rows[1:]] + [jobs[0].duration]
    spans = np.array([end - row[0] for row, end in zip(rows, ends, strict=True)])
    assert spans[0] * rows[0][1] > 10.0
    assert rows[0][1] >= 0.2
    assert np.sum(spans * [row[3] for row in rows]) >= np.pi / 2
    assert not any(rows[-1][1:])


def test_courses_are_walked_by_all_controllers_in_both_engines():
    """Joint PD walks legs of three joints, and all that the law walks."""
    jobs = _jobs(WalkingSettings(robots=("go2", "g1"), walks=1, walks_on_four=1, pushes=1))
    courses = [job for job in jobs if job.what == "course"]
    assert len({(job.robot, job.controller, job.plant) for job in courses}) == len(courses) == 10
    assert not any(job.what == "crawl" and job.robot == "g1" for job in jobs)
    walked_by = {
        by: {(job.what, job.plant, job.number) for job in jobs if job.robot == "go2" and job.controller == by}
        for by in ("condensed", "joint_pd")
    }
    assert walked_by["joint_pd"] == walked_by["condensed"]
    assert not any(job.controller == "joint_pd" and job.robot == "g1" for job in jobs)
