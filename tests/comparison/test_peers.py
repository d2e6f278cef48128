"""The peers: what they are given, how their answers are judged, and what is said when there are none."""

from __future__ import annotations

import json
import stat
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparison.cli import app
from comparison.measure.states import StateSequence, record_states, walk
from comparison.peers.check import TOLERANCE, Answer, check, load_answers
from comparison.peers.compare import measure_peers
from comparison.peers.environment import PEERS, Peer, default_folder, interpreter
from comparison.peers.growth_of_peers import standing_problem
from comparison.peers.measure_peer import PeerSettings
from comparison.peers.ours import OURS
from comparison.peers.peer_problem import VARIANTS, PeerProblem, make_problem
from comparison.peers.peer_tables import peer_tables
from comparison.peers.pinocchio_terms import PinocchioTerms
from comparison.peers.worker import NOT_INSTALLED, WorkerError, run_worker
from comparison.tables import from_csv, to_csv
from harpy_pin import Robot
from harpy_pin.files import finite
from harpy_pin.model.dynamics import Dynamics

FRICTION = 0.25
Measure = Callable[..., dict[str, Any]]
SETTINGS = PeerSettings(most=400, warm_up=10, repetitions=2)


@pytest.fixture(scope="module")
def sequences(robot: Robot) -> list[StateSequence]:
    return [record_states(name, walk(name, friction=FRICTION, duration=0.4), least=1) for name in ("governed", "wbc")]


@pytest.fixture(scope="module")
def problem(robot: Robot, sequences: list[StateSequence]) -> PeerProblem:
    return make_problem(robot, sequences, friction=FRICTION, warm_up=SETTINGS.warm_up, most=SETTINGS.most)


@pytest.fixture
def measure(robot: Robot, sequences: list[StateSequence]) -> Measure:
    """The comparison of peers that lie in a folder."""

    def measured(settings: PeerSettings, folder: Path, peers: Mapping[str, Peer] = PEERS) -> dict[str, Any]:
        return measure_peers(robot, sequences, friction=FRICTION, settings=settings, folder=folder, peers=peers)

    return measured


def right_answers(problem: PeerProblem) -> dict[str, Any]:
    """The file that a perfect peer would write."""
    n = len(problem)
    out: dict[str, Any] = {"versions": json.dumps({"perfect": "1.0"}), "overhead_ns": 40.0}
    for variant, expected in problem.expected.items():
        for quantity in TOLERANCE:
            out[f"{variant}_{quantity}"] = getattr(expected, quantity).copy()
        for what, each in (("tick", 2040), ("solve", 1040)):
            out[f"{variant}_{what}_ns"] = np.full((2, n), each)
    return out


def fake_peer(folder: Path, script: str, name: str = "fake") -> Peer:
    """A peer whose worker is the given script, run by this very Python."""
    python = interpreter(folder, name)
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    worker = folder / f"{name}_worker.py"
    worker.write_text(script)
    return Peer(name, worker, (), {"given": "", "decided": ""})


def copying(file: Path) -> str:
    """A worker that answers with a file made before."""
    return f"import shutil, sys\nshutil.copy({str(file)!r}, sys.argv[2])\n"


# ---------------------------------------------------------------------------------------------------- the problem


def test_problem_has_both_supports_and_active_limits(problem: PeerProblem) -> None:
    assert all(mask.any() for mask in problem.supports.values())
    assert all(expected.solved.all() for expected in problem.expected.values())
    force = problem.expected["decided"].force[problem.held > 0.0]
    slip = problem.settings["mu"] * force[:, 2:] - np.abs(force[:, :2])
    assert slip.min() > -1e-6
    assert (slip < 1e-6).any(), "no friction row is active: the check would not see a wrong pyramid"


@pytest.mark.parametrize("variant", VARIANTS)
def test_expected_solutions_obey_the_equations_of_motion(robot: Robot, problem: PeerProblem, variant: str) -> None:
    expected, dynamics = problem.expected[variant], Dynamics(robot)
    for i in range(0, len(problem), 37):
        q, v = problem.q[i], problem.v[i]
        dynamics.update(q, v)
        force = dynamics.generalised_force(expected.torque[i], expected.force[i], expected.thrust[i])
        motion = dynamics.acceleration(q, v, force - problem.damping_force[i])
        np.testing.assert_allclose(motion, expected.acceleration[i], atol=1e-4)
        held = problem.held[i] > 0.0
        feet = (dynamics.foot_jacobian @ motion + dynamics.foot_drift).reshape(-1, 3)
        np.testing.assert_allclose(feet[held], problem.feet[i][held], atol=1e-4)
        np.testing.assert_allclose(expected.force[i][~held], 0.0, atol=1e-6)


def test_given_thrusts_are_those_of_the_solution(problem: PeerProblem) -> None:
    np.testing.assert_allclose(problem.expected["given"].thrust, problem.thrust, atol=1e-6)


def test_problem_file_holds_what_was_saved(problem: PeerProblem, tmp_path: Path) -> None:
    problem.save(tmp_path / "problem.npz", repetitions=3)
    with np.load(tmp_path / "problem.npz") as file:
        for name in ("q", "v", "body", "orientation", "feet", "joints", "held", "thrust", "thrust_force"):
            np.testing.assert_array_equal(file[name], getattr(problem, name))
        settings = json.loads(str(file["settings"]))
    assert settings["repetitions"] == 3
    assert settings["feet"] == list(problem.settings["feet"])
    assert settings["base"] == "base"
    assert Path(settings["urdf"]).is_file()


def test_ticks_per_sequence_and_warm_up(robot: Robot, sequences: list[StateSequence]) -> None:
    short = make_problem(robot, sequences, friction=FRICTION, warm_up=4, most=10)
    assert len(short) == 20
    assert short.counted.tolist() == 2 * (4 * [0.0] + 6 * [1.0])


# ------------------------------------------------------------------------------------------------------ the check


def test_right_answers_pass_and_their_times_count(problem: PeerProblem, measure: Measure, tmp_path: Path) -> None:
    np.savez(tmp_path / "right.npz", **right_answers(problem))
    peer = fake_peer(tmp_path, copying(tmp_path / "right.npz"))
    result = measure(SETTINGS, tmp_path, {"fake": peer})
    for variant in VARIANTS:
        entry = result["contenders"][f"fake, thrusts {variant}"]
        assert entry["reason"] == ""
        assert entry["compared"] == len(problem)
        for support in ("single", "double"):
            times = entry["times"][support]
            assert times["tick"]["p50_us"] == pytest.approx(2.0)
            assert times["solve"]["max_us"] == pytest.approx(1.0)
            counted = problem.supports[support] & (problem.counted > 0.0)
            assert times["tick"]["samples"] == 2 * np.count_nonzero(counted)
    assert result["contenders"][OURS]["times"]["single"]["tick"]["samples"] > 0


@pytest.mark.parametrize("quantity", TOLERANCE)
def test_one_wrong_tick_is_refused(problem: PeerProblem, tmp_path: Path, quantity: str) -> None:
    answers = right_answers(problem)
    answers[f"decided_{quantity}"][17].flat[0] += 2.0 * TOLERANCE[quantity]
    np.savez(tmp_path / "wrong.npz", **answers)
    verdict = check(load_answers(tmp_path / "wrong.npz", problem)["decided"], problem.expected["decided"])
    assert not verdict.passed
    assert verdict.differing == 1
    assert verdict.difference_max[quantity] == pytest.approx(2.0 * TOLERANCE[quantity])
    assert verdict.difference_median[quantity] == 0.0


def test_wrong_answers_get_no_times(problem: PeerProblem, measure: Measure, tmp_path: Path) -> None:
    answers = right_answers(problem)
    answers["given_torque"] = answers["given_torque"] + 0.1
    answers["decided_force"][3] = np.nan
    np.savez(tmp_path / "wrong.npz", **answers)
    peer = fake_peer(tmp_path, copying(tmp_path / "wrong.npz"))
    result = measure(SETTINGS, tmp_path, {"fake": peer})
    given, decided = (result["contenders"][f"fake, thrusts {variant}"] for variant in VARIANTS)
    assert given["reason"].startswith(f"not comparable: {len(problem)} of {len(problem)} ticks")
    assert "1 of them unsolved" in decided["reason"]
    assert "times" not in given
    assert "times" not in decided
    shown = {table.name: table for table in peer_tables(finite(result))}
    assert shown["peers_tick"].get("fake, thrusts given", "no times").value == given["reason"]  # type: ignore[union-attr]


def test_ticks_that_we_did_not_solve_are_not_compared(problem: PeerProblem, tmp_path: Path) -> None:
    answers = right_answers(problem)
    answers["decided_force"][5] += 1.0
    np.savez(tmp_path / "file.npz", **answers)
    answer = load_answers(tmp_path / "file.npz", problem)["decided"]
    solved = problem.expected["decided"].solved.copy()
    solved[5] = False
    verdict = check(answer, replace(problem.expected["decided"], solved=solved))
    assert verdict.passed
    assert verdict.compared == len(problem) - 1
    assert not check(answer, replace(problem.expected["decided"], solved=np.zeros_like(solved))).passed


# ---------------------------------------------------------------------------------------------- what may go wrong


def test_absent_peers_are_reported_and_stop_nothing(measure: Measure, tmp_path: Path) -> None:
    result = measure(SETTINGS, tmp_path)
    contenders = result["contenders"]
    assert contenders["placo, thrusts given"]["reason"] == NOT_INSTALLED
    assert contenders["placo, thrusts decided"]["reason"] == NOT_INSTALLED
    assert contenders["TSID, thrusts decided"]["reason"] == NOT_INSTALLED
    assert contenders["TSID, thrusts given"]["reason"] == PEERS["TSID"].variants["given"]
    assert contenders[OURS]["times"]
    assert contenders["TSID-C++, thrusts given"]["reason"] == NOT_INSTALLED
    assert contenders[f"{OURS}, the peers' program, condensed WBC"]["times"]
    same = contenders[f"{OURS}, the peers' program, WBC QP"]
    assert same["times"]
    assert same["difference_max"]["torque"] < 1e-6  # the same program, in other variables
    tables = peer_tables(finite(result))
    read = from_csv(to_csv(tables))
    for table in tables:
        assert read[table.name].cells == table.cells
    times = next(table for table in tables if table.name == "peers_tick")
    assert set(times.rows) >= {*(name for name in contenders if not name.startswith(OURS))}


def test_terms_of_pinocchio_are_those_of_our_kernel(robot: Robot, sequences: list[StateSequence]) -> None:
    ours, theirs, pinocchio = Dynamics(robot), Dynamics(robot), PinocchioTerms(robot)
    for state in sequences[0].states[::40]:
        ours.update(state.q, state.v)
        pinocchio.fill(theirs, state.q, state.v)
        for name in ("mass_matrix", "bias", "foot_jacobian", "foot_drift", "foot_velocity", "foot_position"):
            np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), atol=1e-10, rtol=1e-12)
        np.testing.assert_allclose(theirs.thruster_jacobian, ours.thruster_jacobian, atol=1e-12)
        np.testing.assert_allclose(theirs.rotation, ours.rotation, atol=1e-14)


def test_standing_robot_without_thrusters_is_posed(tmp_path: Path) -> None:
    made = standing_problem("solo12", tmp_path, warm_up=2, most=12)
    assert not isinstance(made, str), made
    problem, _, _ = made
    assert problem.expected["decided"].solved.all()
    assert problem.supports["all"].all()
    assert "mesh" not in Path(problem.settings["urdf"]).read_text()
    answers = {name: getattr(problem.expected["decided"], name) for name in TOLERANCE}
    laps = np.ones((1, len(problem)), dtype=np.int64)
    assert check(Answer(answers, laps, laps, 0.0, {}), problem.expected["decided"]).passed


BROKEN = (
    ("raise RuntimeError('no such joint')", "RuntimeError: no such joint"),
    ("import os; os.abort()", "ended by SIGABRT"),
    ("import sys; sys.exit(3)", "no message"),
    ("pass", "ended without a result"),
    ("import sys; open(sys.argv[2], 'w').write('garbage')", "its result cannot be read"),
    ("import sys; open(sys.argv[2], 'w')", "its result cannot be read"),
    ("import numpy, sys; numpy.savez(sys.argv[2], versions='{}')", "its result cannot be read"),
    ("import numpy, sys; numpy.savez(sys.argv[2], versions='{}', overhead_ns=1.0)", "its result holds no answer"),
    ("import numpy, sys; numpy.savez(sys.argv[2], versions='[]', overhead_ns=1.0)", "its result cannot be read"),
)


def test_a_worker_that_breaks_is_reported(measure: Measure, tmp_path: Path) -> None:
    peers = {f"fake{i}": fake_peer(tmp_path, script, f"fake{i}") for i, (script, _) in enumerate(BROKEN)}
    result = measure(replace(SETTINGS, most=20), tmp_path, peers)
    for i, (_, reason) in enumerate(BROKEN):
        for variant in VARIANTS:
            assert result["contenders"][f"fake{i}, thrusts {variant}"]["reason"].startswith(reason)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("given_torque", np.zeros((3, 6))),
        ("given_tick_ns", np.zeros(4, dtype=np.int64)),
        ("given_solve_ns", np.zeros((2, 800))),
        ("overhead_ns", np.array("soon")),
    ],
)
def test_answers_of_a_wrong_shape_or_kind_are_refused(
    problem: PeerProblem, tmp_path: Path, key: str, value: Any
) -> None:
    np.savez(tmp_path / "file.npz", **(right_answers(problem) | {key: value}))
    with pytest.raises(WorkerError, match="cannot be read"):
        load_answers(tmp_path / "file.npz", problem)


def test_a_worker_that_hangs_is_given_up(tmp_path: Path) -> None:
    peer = fake_peer(tmp_path, "import time; time.sleep(60)")
    with pytest.raises(WorkerError, match="no result after"):
        run_worker(interpreter(tmp_path, "fake"), peer.worker, tmp_path / "a", tmp_path / "b", timeout=0.5)


def test_an_interpreter_that_is_none_is_reported(tmp_path: Path) -> None:
    peer = fake_peer(tmp_path, "pass")
    python = interpreter(tmp_path, "fake")
    python.chmod(0o644)
    with pytest.raises(WorkerError, match="cannot be started"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b")


# -------------------------------------------------------------------------------------------- command line, peers


def test_command_line_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "peers.json"
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--quick", "--folder", str(tmp_path), "--json", str(file)])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    assert "not installed: run python -m comparison peers --install" in out
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["peers"]["contenders"]["placo, thrusts given"]["reason"] == NOT_INSTALLED
    assert document["machine"]


@pytest.mark.long
@pytest.mark.parametrize("name", PEERS)
def test_installed_peers_find_our_solution(problem: PeerProblem, measure: Measure, name: str) -> None:
    folder = default_folder()
    if not interpreter(folder, name).exists():
        pytest.skip(f"{name} is not installed")
    result = measure(replace(SETTINGS, repetitions=1), folder, {name: PEERS[name]})
    for variant, impossible in PEERS[name].variants.items():
        entry = result["contenders"][f"{name}, thrusts {variant}"]
        assert entry["reason"] == impossible
        if not impossible:
            assert entry["compared"] == len(problem)
            assert entry["differing"] == 0
