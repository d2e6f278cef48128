"""The peers: environments, what they are given, how their answers are judged, and what is said when there are none."""

from __future__ import annotations

import ast
import json
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forward_dynamics import forward_dynamics, generalised_force

from comparison.benchmark import Settings
from comparison.cli import app
from comparison.measure.timing import TimingSettings
from comparison.measure.walking import StateSequence, record_states, recorded_walk
from comparison.peers import environment
from comparison.peers.compare import peer_tables, standing_problem
from comparison.peers.environment import (
    NOT_INSTALLED,
    PEERS,
    WORLDS,
    Peer,
    WorkerError,
    default_folder,
    install,
    interpreter,
    run_worker,
)
from comparison.peers.measure_peer import OURS, TOLERANCE, check, load_answers, measure_peer
from comparison.peers.peer_problem import ARRAYS, VARIANTS, PeerProblem, make_problem
from harpy_pin import Robot
from harpy_pin.model.dynamics import Dynamics

FRICTION = 0.25
ALL = {**PEERS, WORLDS.name: WORLDS}
HERE = Path(environment.__file__).parents[1]
CANNOT_RUN = (
    *(NOT_INSTALLED, "cannot be started", "no result after", "ImportError", "ModuleNotFoundError"),
    *("ended by SIGILL", "ended by SIGKILL", "TSID's C++ needs a C++ compiler"),
)
"""Begins of reasons that are the machine's, not the peer's."""


@pytest.fixture(scope="module")
def sequences() -> list[StateSequence]:
    return [
        record_states(name, recorded_walk(name, friction=FRICTION, duration=0.4), least=1)
        for name in ("governed", "wbc")
    ]


@pytest.fixture(scope="module")
def problem(robot: Robot, sequences: list[StateSequence]) -> PeerProblem:
    return make_problem(robot, sequences, friction=FRICTION, warm_up=10, most=400)


def right_answers(problem: PeerProblem) -> dict[str, Any]:
    """The file that a perfect peer would write."""
    out: dict[str, Any] = {"versions": json.dumps({"perfect": "1.0"}), "overhead_ns": 40.0}
    for variant, expected in problem.expected.items():
        out |= {f"{variant}_{quantity}": getattr(expected, quantity).copy() for quantity in TOLERANCE}
        for what, each in (("tick", 2040), ("solve", 1040)):
            out[f"{variant}_{what}_ns"] = np.full((2, len(problem)), each)
    return out


def fake_peer(folder: Path, script: str, name: str = "fake") -> Peer:
    """A peer whose worker is the given script, run by this very Python."""
    python = interpreter(folder, name)
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    worker = folder / f"{name}_worker.py"
    worker.write_text(script)
    return Peer(name, worker, ())


def answered(problem: PeerProblem, folder: Path, answers: dict[str, Any]) -> dict[str, Any]:
    """The entries of a peer that gives these answers, by variant."""
    np.savez(folder / "answers.npz", **answers)
    peer = fake_peer(folder, f"import shutil, sys\nshutil.copy({str(folder / 'answers.npz')!r}, sys.argv[2])\n")
    entries = measure_peer("fake", peer, problem, folder, 2)
    return {variant: entries[f"fake, thrusts {variant}"] for variant in VARIANTS}


def judge(entries: dict[str, dict[str, Any]], ticks: int) -> None:
    """Fail unless every tick has our solution; skip if the peer cannot run on this machine."""
    for entry in entries.values():
        if entry["reason"].startswith(CANNOT_RUN):
            pytest.skip(entry["reason"])
        assert entry["reason"] == ""
        assert (entry["compared"], entry["differing"]) == (ticks, 0)


# ---------------------------------------------------------------------------------------------------- the problem


def test_problem_has_both_supports_and_active_limits(problem: PeerProblem) -> None:
    assert all(mask.any() for mask in problem.supports.values())
    assert all(expected.solved.all() for expected in problem.expected.values())
    force = problem.expected["decided"].force[problem.held > 0.0]
    slip = problem.settings["mu"] * force[:, 2:] - np.abs(force[:, :2])
    assert slip.min() > -1e-6
    assert (slip < 1e-6).any(), "no friction row is active: the check would not see a wrong pyramid"
    np.testing.assert_allclose(problem.expected["given"].thrust, problem.thrust, atol=1e-6)


@pytest.mark.parametrize("variant", VARIANTS)
def test_expected_solutions_obey_the_equations_of_motion(robot: Robot, problem: PeerProblem, variant: str) -> None:
    expected, dynamics = problem.expected[variant], Dynamics(robot)
    for i in range(0, len(problem), 37):
        q, v = problem.q[i], problem.v[i]
        dynamics.update(q, v)
        force = generalised_force(dynamics, expected.torque[i], expected.force[i], expected.thrust[i])
        motion = forward_dynamics(dynamics, q, v, force - problem.damping_force[i])
        np.testing.assert_allclose(motion, expected.acceleration[i], atol=1e-4)
        held = problem.held[i] > 0.0
        feet = (dynamics.foot_jacobian @ motion + dynamics.foot_drift).reshape(-1, 3)
        np.testing.assert_allclose(feet[held], problem.feet[i][held], atol=1e-4)
        np.testing.assert_allclose(expected.force[i][~held], 0.0, atol=1e-6)


def test_problem_file_holds_what_was_saved(problem: PeerProblem, tmp_path: Path) -> None:
    problem.save(tmp_path / "problem.npz", repetitions=3)
    with np.load(tmp_path / "problem.npz") as file:
        for name in ARRAYS:
            np.testing.assert_array_equal(file[name], getattr(problem, name))
        settings = json.loads(str(file["settings"]))
    assert (settings["repetitions"], settings["base"]) == (3, "base")
    assert settings["feet"] == list(problem.settings["feet"])
    assert Path(settings["urdf"]).is_file()


def test_standing_robot_without_thrusters_is_posed(tmp_path: Path) -> None:
    problem, _, _ = standing_problem("solo12", tmp_path, warm_up=2, most=12)
    assert problem.expected["decided"].solved.all()
    assert problem.supports["all"].all()
    assert "mesh" not in Path(problem.settings["urdf"]).read_text()
    answers = {name: getattr(problem.expected["decided"], name) for name in TOLERANCE}
    assert not check(answers, problem.expected["decided"])["reason"]


# ------------------------------------------------------------------------------------------------------ the check


def test_right_answers_pass_and_their_times_count(problem: PeerProblem, tmp_path: Path) -> None:
    for entry in answered(problem, tmp_path, right_answers(problem)).values():
        assert entry["reason"] == ""
        assert entry["compared"] == len(problem)
        for support, mask in problem.supports.items():
            times = entry["times"][support]
            assert times["tick"]["p50_us"] == pytest.approx(2.0)
            assert times["solve"]["max_us"] == pytest.approx(1.0)
            assert times["tick"]["samples"] == 2 * np.count_nonzero(mask & (problem.counted > 0.0))


@pytest.mark.parametrize("quantity", TOLERANCE)
def test_one_wrong_tick_is_refused(problem: PeerProblem, quantity: str) -> None:
    expected = problem.expected["decided"]
    answer = {name: getattr(expected, name).copy() for name in TOLERANCE}
    answer[quantity][17].flat[0] += 2.0 * TOLERANCE[quantity]
    verdict = check(answer, expected)
    assert verdict["reason"]
    assert verdict["differing"] == 1
    assert verdict["difference_max"][quantity] == pytest.approx(2.0 * TOLERANCE[quantity])
    assert verdict["difference_median"][quantity] == 0.0
    solved = expected.solved.copy()  # ticks that we did not solve are not compared
    solved[17] = False
    verdict = check(answer, replace(expected, solved=solved))
    assert (verdict["reason"], verdict["compared"]) == ("", len(problem) - 1)
    assert check(answer, replace(expected, solved=np.zeros_like(solved)))["reason"]


def test_wrong_answers_get_no_times(problem: PeerProblem, tmp_path: Path) -> None:
    answers = right_answers(problem)
    answers["given_torque"] = answers["given_torque"] + 0.1
    answers["decided_force"][3] = np.nan
    found = answered(problem, tmp_path, answers)
    assert found["given"]["reason"].startswith(f"not comparable: {len(problem)} of {len(problem)} ticks")
    assert "1 of them unsolved" in found["decided"]["reason"]
    assert not any("times" in entry for entry in found.values())
    (table,) = peer_tables({"contenders": {"fake": found["given"]}, "friction": 0.25, "tolerance": TOLERANCE})[:1]
    assert table.get("fake", "no times").value == found["given"]["reason"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("given_torque", np.zeros((3, 6))),
        ("given_tick_ns", np.zeros(4, dtype=np.int64)),
        ("given_solve_ns", np.zeros((2, 800))),
        ("overhead_ns", np.array("soon")),
        ("versions", "[]"),
    ],
)
def test_answers_of_a_wrong_shape_or_kind_are_refused(
    problem: PeerProblem, tmp_path: Path, key: str, value: Any
) -> None:
    np.savez(tmp_path / "file.npz", **(right_answers(problem) | {key: value}))
    with pytest.raises(WorkerError, match="cannot be read"):
        load_answers(tmp_path / "file.npz", problem)


# ---------------------------------------------------------------------------------------------- what may go wrong

BROKEN = {
    "raise RuntimeError('no such joint')": "RuntimeError: no such joint",
    "import os; os.abort()": "ended by SIGABRT",
    "import sys; sys.exit(3)": "no message",
    "pass": "ended without a result",
    "import sys; open(sys.argv[2], 'w').write('garbage')": "its result cannot be read",
    "import sys; open(sys.argv[2], 'w')": "its result cannot be read",
    "import numpy, sys; numpy.savez(sys.argv[2], versions='{}', overhead_ns=1.0)": "its result cannot be read",
}


@pytest.mark.parametrize("script", BROKEN)
def test_a_worker_that_breaks_is_reported(problem: PeerProblem, tmp_path: Path, script: str) -> None:
    entries = measure_peer("fake", fake_peer(tmp_path, script), problem, tmp_path, 1)
    assert len(entries) == len(VARIANTS)
    assert all(entry["reason"].startswith(BROKEN[script]) for entry in entries.values())


def test_a_worker_that_hangs_or_cannot_be_started_is_given_up(tmp_path: Path) -> None:
    peer, python = fake_peer(tmp_path, "import time; time.sleep(60)"), interpreter(tmp_path, "fake")
    with pytest.raises(WorkerError, match="no result after"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b", timeout=0.5)
    python.chmod(0o644)
    with pytest.raises(WorkerError, match="cannot be started"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b")


def test_the_command_reports_absent_peers_and_measures_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    timing = TimingSettings(repetitions=2, warm_up=10, programs=60)
    monkeypatch.setattr(Settings, "quick", lambda **changes: Settings(duration=0.7, timing=timing, **changes))
    file = tmp_path / "peers.json"
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--quick", "--folder", str(tmp_path), "--json", str(file)])
    assert ended.value.code == 0
    assert NOT_INSTALLED in capsys.readouterr().out
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["machine"]
    peers, contenders = document["peers"], document["peers"]["contenders"]
    for name in PEERS:
        for variant in VARIANTS:
            assert contenders[f"{name}, thrusts {variant}"]["reason"] == NOT_INSTALLED
    assert contenders[OURS]["times"]["single"]["tick"]["samples"] > 0
    assert contenders[f"{OURS}, the peers' program, condensed WBC"]["times"]
    same = contenders[f"{OURS}, the peers' program, WBC QP"]
    assert same["difference_max"]["torque"] < 1e-6  # the same program, in other variables
    assert peers["growth"]["bolt"]["contenders"][f"{OURS}, WBC QP"]["p50_us"] > 0.0
    tables = {table.name: table for table in peer_tables(peers)}
    assert set(tables["peers_tick"].rows) >= {name for name in contenders if not name.startswith(OURS)}


@pytest.mark.long
@pytest.mark.parametrize("name", PEERS)
def test_installed_peers_find_our_solution(problem: PeerProblem, name: str) -> None:
    if not interpreter(default_folder(), name).exists():
        pytest.skip(f"{name} is not installed")
    judge(measure_peer(name, PEERS[name], problem, default_folder(), 1), len(problem))


# --------------------------------------------------------------------------------------------------- environments


@pytest.mark.parametrize("script", sorted(HERE.rglob("*_worker.py")), ids=lambda path: path.stem)
def test_workers_import_nothing_of_ours(script: Path) -> None:
    allowed = {"numpy", "onnxruntime", "placo", "pinocchio"} | set(sys.stdlib_module_names)
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {alias.name.split(".")[0] for alias in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert (node.module or "").split(".")[0] in allowed


def test_failed_installation_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked = []

    def run(command: list[str], **options: Any) -> Any:
        asked.append(command)
        text = "ERROR: No matching distribution found\n\n[notice] a new release of pip\n"
        raise subprocess.CalledProcessError(1, command, "", text)

    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.EnvBuilder, "create", lambda self, folder: None)
    for name, peer in ALL.items():
        assert install(tmp_path, name) == "ERROR: No matching distribution found"
        assert {"--only-binary=:all:", *peer.requirements} <= set(asked[-1])
        pinned = {*peer.requirements, *peer.libraries, *peer.alone} - {"numpy"}
        assert all("==" in requirement for requirement in pinned)


def test_installation_ends_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(command: list[str], **options: Any) -> Any:
        if any("placo" in word for word in command):
            raise subprocess.TimeoutExpired(command, options["timeout"])
        return subprocess.CompletedProcess(command, 0, str(tmp_path), "")

    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.EnvBuilder, "create", lambda self, folder: None)
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--install", "--folder", str(tmp_path)])
    assert ended.value.code == 1
    placo, *others = capsys.readouterr().out.splitlines()
    assert placo == "placo: cannot be installed: not installed after 600 s"
    assert others == [f"{name}: installed" for name in ALL if name != "placo"]


def test_installation_leaves_foreign_folders_alone(tmp_path: Path) -> None:
    for name in ALL:
        (tmp_path / name.lower()).mkdir()
        (tmp_path / name.lower() / "thesis.tex").write_text("precious")
        assert "was not made by this command" in install(tmp_path, name)
        assert (tmp_path / name.lower() / "thesis.tex").read_text() == "precious"
