"""The campaign: its plan, one walk, the file, and that neither a kill nor a lost worker changes the outcome."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import harpy_pin as hp
from comparison.campaign.plan import Task, code_digest, plan
from comparison.campaign.settings import CampaignSettings
from comparison.campaign.store import Store, read_rows
from comparison.campaign.summary import summarise_rows, summary_tables
from comparison.campaign.walks import draw_push, scenario, walk_task
from comparison.contenders import BEST, CONTENDERS
from harpy_pin import InputError, RunFileError, load_harpy
from harpy_pin.controllers.named_controllers import GOVERNORS
from harpy_pin.gaits import make_gait
from harpy_pin.model.robot import heavier
from harpy_pin.simulation.sensors import Noise

ROOT = Path(__file__).resolve().parents[2]

ENVIRONMENT = {**os.environ, "COLUMNS": "140"}
WALKS = 28  # four scenarios for each contender
SMALL = ("--walks", str(WALKS), "--duration", "1.5")


def task_of(**changes: Any) -> Task:
    task = Task(
        contender="governed/none",
        friction=0.6,
        push=0.0,
        mass_error=0.0,
        friction_error=0.0,
        noise=0.0,
        delay=0.0,
        stiffness=8e3,
        damping=1.0,
        plant="compliant",
        speed=0.3,
        ice=0.0,
        jitter=0.0,
        seed=3,
        duration=1.5,
    )
    return replace(task, **changes)


# --- Which walks ----------------------------------------------------------------------------------------------------


def test_every_contender_meets_the_same_balanced_scenarios() -> None:
    settings = CampaignSettings(walks=30 * len(CONTENDERS))
    tasks = plan(settings)
    assert {t.contender for t in tasks} == {*(f"governed/{name}" for name in GOVERNORS), BEST, "condensed", "wbc"}
    assert len({t.key("x") for t in tasks}) == len(tasks) == settings.walks
    scenarios: dict[str, list[Task]] = {}
    for t in tasks:
        scenarios.setdefault(t.contender, []).append(replace(t, contender=""))
    first = scenarios["wbc"]
    assert all(other == first for other in scenarios.values())
    for factor, levels in (("friction", settings.frictions), ("push", settings.pushes)):
        drawn = [getattr(t, factor) for t in first]
        assert [drawn.count(level) for level in levels] == [30 // len(levels)] * len(levels)


def test_a_longer_campaign_contains_a_shorter_one() -> None:
    assert plan(CampaignSettings(walks=100))[:20] == plan(CampaignSettings(walks=20))[:20]
    assert plan(CampaignSettings.wide(walks=800)) == plan(CampaignSettings.wide())[:800]
    assert plan(CampaignSettings(walks=20, seed=1))[0] != plan(CampaignSettings(walks=20))[0]


def test_the_key_tells_every_field_and_the_code() -> None:
    task = task_of()
    changed = [task.key("b")]
    for name, value in vars(task).items():
        changed.append(task_of(**{name: value + (1 if not isinstance(value, str) else "x")}).key("a"))
    assert len({task.key("a"), *changed}) == len(changed) + 1
    assert task_of().key("a") == task.key("a")


# --- One walk -------------------------------------------------------------------------------------------------------


def test_a_walk_is_what_its_task_says() -> None:
    run = hp.walk(scenario(task_of(push=2.0, mass_error=0.25, friction_error=0.5, contender="wbc")))
    gait = make_gait(load_harpy())
    assert run.metadata["ground"]["mu_s"] == 0.6
    assert run.metadata["mass"] == pytest.approx(load_harpy().mass + 0.25 * load_harpy().model.inertias[1].mass)
    assert "0.9" in json.dumps(run.metadata["parameters"])  # 0.6 · 1.5: what the controller assumes
    (push,) = run.metadata["pushes"]
    assert push["impulse"][0] == push["impulse"][2] == 0.0
    assert abs(push["impulse"][1]) == 2.0
    target = gait.update(push["time"] + 0.5 * push["duration"])
    assert sorted(target.stance) == [0.0, 1.0]
    assert target.phase[int(np.argmin(target.stance))] == pytest.approx(0.5)  # the other foot is half-way


def test_the_side_of_the_push_is_drawn() -> None:
    gait = make_gait(load_harpy())
    sides = [draw_push(task_of(push=1.0, duration=5.0), gait, np.random.default_rng(seed)) for seed in range(40)]
    assert {p.impulse[1] for p in sides} == {-1.0, 1.0}
    assert len({p.time for p in sides}) == 3  # steps 1, 2 and 3 of six


def test_a_heavier_body_leaves_the_nominal_robot_as_it_is() -> None:
    robot = load_harpy()
    mass = robot.mass
    other = heavier(robot, -0.2)
    assert robot.mass == mass
    np.testing.assert_allclose(other.model.inertias[1].inertia, 0.8 * robot.model.inertias[1].inertia)
    assert other.mass == pytest.approx(mass - 0.2 * robot.model.inertias[1].mass)
    with pytest.raises(InputError, match="mass error"):
        heavier(robot, -1.5)


def test_the_same_task_gives_the_same_row() -> None:
    task = task_of(contender="governed/paper", push=2.0, jitter=0.01)
    row = walk_task(task, code_digest())
    assert walk_task(task, code_digest()) == row
    assert walk_task(replace(task, seed=4), code_digest()) != row
    assert row["fell"] is False
    assert row["fall_time_s"] is None
    json.dumps(row, allow_nan=False)


def test_a_fall_has_its_time() -> None:
    row = walk_task(
        task_of(contender="governed/paper", friction=0.15, friction_error=-0.3, push=3.5, duration=4.0), code_digest()
    )
    assert row["fell"] is True
    assert 0.0 < row["fall_time_s"] < 4.0


def test_a_worker_with_other_code_is_refused() -> None:
    with pytest.raises(InputError, match="other code"):
        walk_task(task_of(), "0")


# --- The file -------------------------------------------------------------------------------------------------------


def test_rows_survive_and_are_never_doubled(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    with Store(path) as store:
        store.append("a", {"x": 1})
        store.append("a", {"x": 2})
        with pytest.raises(RunFileError, match="another campaign"):
            Store(path)
    with path.open("ab") as file:
        file.write(b'{"key": "b", "x"')  # killed while writing
    assert read_rows(path) == {"a": {"x": 1}}
    with Store(path) as store:
        assert store.rows == {"a": {"x": 1}}
        store.append("b", {"x": 3})
    assert read_rows(path) == {"a": {"x": 1}, "b": {"x": 3}}
    assert path.read_bytes().count(b"\n") == 2


def test_a_damaged_file_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    for damage in (b"nonsense\n", b"3\n", b'{"x": 1}\n'):
        path.write_bytes(b'{"key": "a"}\n' + damage + b'{"key": "b"}\n{"ke')
        before = path.read_bytes()
        with pytest.raises(RunFileError, match="line 2"):
            Store(path)
        assert path.read_bytes() == before


def test_noise_and_delay_reach_the_walk() -> None:
    noisy = scenario(task_of(noise=0.5, delay=2e-3))
    assert noisy.disturbances.noise == Noise.typical(0.5)
    assert noisy.disturbances.delay == 2e-3
    assert noisy.disturbances.seed == 3
    built = hp.build(noisy)
    assert built.sensors is not None
    assert built.sensors.delay == 2
    assert hp.build(scenario(task_of())).sensors is None


def test_hard_levels_are_drawn_apart() -> None:
    """From another seed, and at levels that the plain campaign does not have, so that they judge what it tuned."""
    hard = CampaignSettings.hard()
    assert max(hard.pushes) == 8.0
    assert max(hard.mass_errors) == 0.25
    tasks = plan(hard)
    assert {t.noise for t in tasks} == set(hard.noises)
    assert {t.delay for t in tasks} == set(hard.delays)


# --- The summary ----------------------------------------------------------------------------------------------------


def test_the_summary_is_a_function_of_the_set_of_rows() -> None:
    tasks = plan(CampaignSettings(walks=12 * len(CONTENDERS)))
    names = [t.contender for t in tasks]
    rows: dict[str, dict[str, Any]] = {}
    for i, t in enumerate(tasks):
        fell = t.contender == "wbc" and t.friction < 0.2
        constant = ("net_slip_mm_per_step", "late_slip_mm_per_step", "sliding", "low_force")
        measures = dict.fromkeys((*constant, "tracking_rms_mm", "thrust_rms_n"), 1.0)
        measures |= {
            "fell": fell,
            "fall_time_s": 2.5 if fell else None,
            "slip_mm_per_step": float(i // len(set(names))),
        }
        rows[t.key(code_digest())] = {"measures": measures | {"solver_failures": 1}}
    summary = summarise_rows(tasks, rows)
    backward = dict(reversed(list(rows.items()))) | {"of another campaign": {"measures": {}}}
    assert summarise_rows(tasks, backward) == summary
    wbc = summary["whole"]["wbc"]
    assert wbc["walks"] == wbc["solver_failures"] == 12
    assert wbc["falls"]["value"] == pytest.approx(2 / 12)
    assert (wbc["falls"]["low"], wbc["falls"]["high"]) == pytest.approx((0.0470, 0.4480), abs=1e-4)  # Wilson
    assert wbc["fall_time_s"] == {"value": 2.5, "low": None, "high": None}
    # Of 12 values the 3rd and the 10th: P(Binomial(12, 1/2) ≤ 2) = 1.9 %, ≤ 3: 7.3 %.
    assert wbc["slip_mm_per_step"] == {"value": 5.5, "low": 2.0, "high": 9.0}
    assert summary["factors"]["friction"]["0.15"]["wbc"]["falls"]["value"] == 1.0
    assert summary["factors"]["friction"]["0.8"]["wbc"]["falls"]["value"] == 0.0
    del rows[tasks[0].key(code_digest())]
    assert summarise_rows(tasks, rows)["done"] == len(tasks) - 1
    names_of_tables = [table.name for table in summary_tables(summary)]
    assert len(set(names_of_tables)) == len(names_of_tables) == 9


# --- The whole: kills -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The table of a campaign whose walks were done here, one after the other, without Dask."""
    path, code = tmp_path_factory.mktemp("campaign") / "rows.jsonl", code_digest()
    with Store(path) as store:
        for task in plan(CampaignSettings(walks=WALKS, duration=1.5)):
            store.append(task.key(code), {"measures": walk_task(task, code)})
    done = finished(path)
    assert done.returncode == 0, done.stderr
    assert "filter" in done.stdout
    return done.stdout


def command(path: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "comparison", "campaign", *SMALL, "--out", str(path), *more]


def finished(path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(path), cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, timeout=120)


def wait_for_rows(path: Path, count: int) -> int:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        if path.exists() and (found := path.read_bytes().count(b"\n")) >= count:
            return found
        time.sleep(0.005)
    raise AssertionError("no rows")


def test_a_killed_campaign_goes_on_where_it_was(undisturbed: str, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    process = subprocess.Popen(command(path), cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.DEVNULL)
    try:
        wait_for_rows(path, 4)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = read_rows(path)
    assert 4 <= len(before) < WALKS  # killed in the middle
    path.write_bytes(path.read_bytes() + b'{"key": "half a li')
    done = finished(path)
    assert done.stdout == undisturbed
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert len({line["key"] for line in lines}) == len(lines) == WALKS
    assert [line["key"] for line in lines[: len(before)]] == list(before)  # nothing was done twice


def test_a_killed_worker_loses_nothing(undisturbed: str, tmp_path: Path) -> None:
    """One scheduler and two workers, each a process; one worker dies in the middle."""
    path, address = tmp_path / "rows.jsonl", tmp_path / "scheduler.json"
    started: list[subprocess.Popen[bytes]] = []

    def start(*arguments: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:], "--scheduler-file", str(address)],
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        started.append(process)
        return process

    quiet = ("--no-dashboard", "--host", "127.0.0.1")
    try:
        start("dask_scheduler", *quiet, "--port", "0")
        folder = ("--no-nanny", "--nthreads", "1", "--local-directory", str(tmp_path))
        workers = [start("dask_worker", *quiet, *folder) for _ in range(2)]
        end = time.monotonic() + 60.0
        while not address.exists() or not address.read_text().endswith("}"):
            assert time.monotonic() < end
            time.sleep(0.05)
        scheduler = json.loads(address.read_text())["address"]
        process = subprocess.Popen(
            command(path, "--scheduler", scheduler), cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
        )
        started.append(process)  # type: ignore[arg-type]
        assert wait_for_rows(path, 4) < WALKS
        workers[0].send_signal(signal.SIGKILL)
        table, _ = process.communicate(timeout=120)
    finally:
        for process in started:  # type: ignore[assignment]
            process.kill()
            process.wait()
    assert table == undisturbed
    keys = [json.loads(line)["key"] for line in path.read_text().splitlines()]
    assert len(set(keys)) == len(keys) == WALKS


def test_nobody_at_the_address_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from comparison.campaign import execute
    from comparison.campaign.campaign_run import run_campaign

    monkeypatch.setattr(execute, "PATIENCE", 0.5)
    with pytest.raises(InputError, match="no scheduler answers"):
        run_campaign(CampaignSettings(walks=1), tmp_path / "rows.jsonl", scheduler="tcp://127.0.0.1:9")


@pytest.mark.parametrize("row", [{}, {"measures": 3}, {"measures": {}}, {"measures": {"fell": "no"}}], ids=str)
def test_a_row_of_another_kind_is_one_line(row: dict[str, Any]) -> None:
    tasks = plan(CampaignSettings(walks=1))
    with pytest.raises(RunFileError, match="does not hold its measures"):
        summarise_rows(tasks, {tasks[0].key(code_digest()): row})
