"""The peers: environments, what they are given, how their answers are judged, and what is said when there are none."""

from __future__ import annotations

import ast
import json
import stat
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from comparison.cli import app
from comparison.cli import commands as comparison_commands
from comparison.measure.walking import StateSequence
from comparison.peers import compare, environment, measure_peer, our_replay
from comparison.peers.cases import cases, is_lifted
from comparison.peers.compare import peer_tables, unanswered
from comparison.peers.dense_program import DenseProgram, planar_options, planar_solutions, read_model
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
from comparison.peers.measure_peer import TOLERANCE, Row, check, load_answer
from comparison.peers.model_file import links_of, write_model
from comparison.peers.our_replay import contenders
from comparison.peers.peer_problem import ARRAYS, Case, PeerProblem, make_problem
from harpy_pin.model.state import State

ALL = {**PEERS, WORLDS.name: WORLDS}
HERE = Path(environment.__file__).parents[1]
CANNOT_RUN = (
    *(NOT_INSTALLED, "cannot be started", "no result after", "ImportError", "ModuleNotFoundError"),
    *("ended by SIGILL", "ended by SIGKILL", "TSID's C++ needs a C++ compiler"),
)
"""Begins of reasons that are the machine's, not the peer's."""
CASES: dict[str, Callable[[], Case]] = cases(friction=0.25, duration=0.9, warm_up=10)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Case, PeerProblem]]:
    """A case and its problem, made once."""
    known: dict[str, tuple[Case, PeerProblem]] = {}

    def make(name: str) -> tuple[Case, PeerProblem]:
        if name not in known:
            case = CASES[name]()
            known[name] = case, make_problem(case, tmp_path_factory.mktemp("model") / "robot.urdf")
        return known[name]

    return make


@pytest.fixture(scope="module")
def problem(made: Callable[[str], tuple[Case, PeerProblem]]) -> PeerProblem:
    return made("harpy, walks")[1]


def right_answer(problem: PeerProblem) -> dict[str, Any]:
    """The file that a perfect peer would write."""
    out: dict[str, Any] = {"versions": json.dumps({"perfect": "1.0"}), "overhead_ns": 40.0}
    out |= {quantity: getattr(problem.expected, quantity).copy() for quantity in TOLERANCE}
    return out | {f"{what}_ns": np.full((2, len(problem)), each) for what, each in (("tick", 2040), ("inside", 1040))}


def fake_peer(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> Peer:
    """A peer whose worker is the given script, run by this very Python."""
    python = interpreter(folder, "fake")
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    worker = folder / "fake_worker.py"
    worker.write_text(script)
    peer = Peer("fake", worker, ())
    monkeypatch.setitem(PEERS, "fake", peer)
    return peer


def answered(
    problem: PeerProblem, folder: Path, answer: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> dict[str, Any]:
    """The entry of a peer that gives this answer."""
    np.savez(folder / "answer.npz", **answer)
    script = f"import shutil, sys\nshutil.copy({str(folder / 'answer.npz')!r}, sys.argv[2])\n"
    fake_peer(folder, script, monkeypatch)
    return measure_peer.measure_peer(Row("fake"), problem, folder, 2)


def judge(entry: dict[str, Any], ticks: int) -> None:
    """Fail unless every tick has the solution; skip if the peer cannot run on this machine."""
    if entry["reason"].startswith(CANNOT_RUN):
        pytest.skip(entry["reason"])
    assert entry["reason"] == ""
    assert (entry["compared"], entry["differing"]) == (ticks, 0)


# ---------------------------------------------------------------------------------------------------- the problem

DENSE = {"harpy, walks": 43, "solo12, walks": 43, "go2, stands": 89, "go2, walks": 43, "g1 on points, stands": 89} | {
    f"{name} on soles, {what}": 67 for name in ("g1", "talos") for what in ("stands", "walks")
}
"""Every so many ticks of each case are solved once more."""


@pytest.mark.parametrize("name", DENSE)
def test_what_peers_are_given_is_what_our_controllers_solve(
    made: Callable[[str], tuple[Case, PeerProblem]], name: str
) -> None:
    """A dense program of the handed-over numbers, built by Pinocchio and NumPy and solved by quadprog."""
    case, problem = made(name)
    ticks = range(5, len(case.sequences[0]), DENSE[name])
    model, states, joints = read_model(problem), case.sequences[0].states, len(case.gait.robot.joints)
    ours = {own: make() for own, make in contenders(case).items() if "ProxQP" not in own}
    commands: dict[str, dict[int, np.ndarray]] = {own: {} for own in ours}
    for own, controller in ours.items():
        for i, state in enumerate(states):
            torque = controller.step(state).torque
            if i in ticks:
                commands[own][i] = torque.copy()
    for i in ticks:
        program = DenseProgram(problem, model, i)
        x = program.solve()
        torque, e = program.torque(x), problem.expected
        np.testing.assert_allclose(e.torque[i], torque, atol=1e-6)
        np.testing.assert_allclose(e.acceleration[i], x[: model.nv], atol=1e-5)
        force = np.zeros((len(case.gait.robot.feet), 3))
        force[program.points] = x[model.nv : model.nv + 3 * len(program.points)].reshape(-1, 3)
        np.testing.assert_allclose(e.force[i], force, atol=1e-5)
        np.testing.assert_allclose(commands["whole-body QP, own search"][i], torque, atol=1e-5)
        if case.condensed:
            np.testing.assert_allclose(commands["condensed WBC"][i], torque, atol=2e-4)
    assert joints == len(problem.settings["joint_weights"])


@pytest.mark.parametrize("name", CASES)
def test_states_are_those_of_a_robot_that_stands_or_walks(
    made: Callable[[str], tuple[Case, PeerProblem]], name: str
) -> None:
    case, problem = made(name)
    robot, e, counts = case.gait.robot, problem.expected, problem.counted > 0.0
    assert e.solved.all()
    weight = robot.mass * 9.81
    measured = np.concatenate([[s.foot_force[:, 2].sum() for s in q.states] for q in case.sequences])[counts] / weight
    assert 0.9 < np.median(measured) < 1.1
    if name == "harpy, walks":  # thrusters bear a part
        return
    assert measured.min() > 0.6
    assert e.force[counts][..., 2].sum(axis=1).min() > 0.6 * weight
    lifted = [is_lifted(robot, state) for q in case.sequences for state in q.states]
    at_limit = np.abs(e.torque) > np.array(problem.settings["torque_limit"]) - 1e-6
    assert not at_limit.any()
    changes = np.abs(np.diff(problem.held[counts], axis=0)).any(axis=1).sum()
    if "stands" in name:
        assert changes == 0
        assert not any(lifted[case.first :])
    else:
        assert changes >= 2


def elbow_case() -> Case:
    """G1 with dry friction and damping in its joints, thrown, with an elbow that runs into its end."""
    robot = hp.load_robot("g1").with_joints(friction=0.7, damping=0.3)
    gait = hp.Standing(robot)
    case = replace(CASES["g1 on soles, stands"](), gait=gait)
    elbow = robot.joints.index("left_elbow_joint")
    states, dynamics, rng = [], hp.Dynamics(robot), np.random.default_rng(0)
    for k in range(8):
        q, v = gait.initial_state()
        q[7 + elbow] = robot.joint_upper[elbow] - 0.05
        v[6:] = 0.2 * rng.standard_normal(len(robot.joints))
        v[6 + elbow] = 4.0
        v[:6] = 0.6 * rng.standard_normal(6)  # more than the cones allow to catch: tasks compete
        dynamics.update(q, v)
        force = np.tile((0.0, 0.0, robot.mass * 9.81 / 8), (8, 1))
        states.append(State(0.001 * k, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force))
    return replace(case, sequences=(StateSequence("elbow", tuple(states)),), first=0)


def test_braking_friction_and_damping_are_handed_over(tmp_path: Path) -> None:
    case = elbow_case()
    robot, states = case.gait.robot, case.sequences[0].states
    elbow = robot.joints.index("left_elbow_joint")
    problem = make_problem(case, tmp_path / "robot.urdf")
    assert (problem.brake[:, elbow] > 0.0).all()
    np.testing.assert_array_less(0.2, np.abs(problem.resistance[:, 6:]).max(axis=1))
    model, controllers = read_model(problem), {name: make() for name, make in contenders(case).items()}
    idle = {"brake": 0.0, "resistance": 0.0}  # what a program without it differs by, N·m
    for i, state in enumerate(states):
        program = DenseProgram(problem, model, i)
        torque = program.torque(program.solve())
        for controller in controllers.values():
            np.testing.assert_allclose(controller.step(state).torque, torque, atol=1e-3)
        for name in idle:
            less = replace(problem, **{name: np.zeros_like(getattr(problem, name))})
            other = DenseProgram(less, model, i)
            idle[name] = max(idle[name], float(np.abs(other.torque(other.solve()) - torque).max()))
    assert idle["brake"] > 0.01
    assert idle["resistance"] > 0.1


@pytest.mark.parametrize("name", ["harpy", "solo12", "g1", "talos", "icub"])
def test_written_model_is_the_robots(tmp_path: Path, name: str) -> None:
    """Inverse dynamics and frames by Pinocchio, of the file and of the model."""
    robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
    write_model(robot, tmp_path / "robot.urdf")
    text, own = (tmp_path / "robot.urdf").read_text(), robot.model
    assert "mesh" not in text
    model = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"), pin.JointModelFreeFlyer())
    model.armature = own.armature
    assert list(model.names)[2:] == list(own.names)[2:]
    rng, data, own_data = np.random.default_rng(1), model.createData(), own.createData()
    q = pin.integrate(own, pin.neutral(own), rng.standard_normal(own.nv))
    v, a = rng.standard_normal((2, own.nv))
    np.testing.assert_allclose(pin.rnea(model, data, q, v, a), pin.rnea(own, own_data, q, v, a), rtol=1e-11, atol=1e-11)
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(own, own_data, q)
    links = links_of(robot)
    for link, frame in zip(links.contacts + links.thrusters, robot.feet + robot.thrusters, strict=True):
        place, expected = data.oMf[model.getFrameId(link)], own_data.oMf[own.getFrameId(frame)]
        np.testing.assert_allclose(place.homogeneous, expected.homogeneous, atol=1e-12)
    for n, link in enumerate(links.soles):
        corners = [own_data.oMf[own.getFrameId(frame)].translation for frame in robot.feet[4 * n : 4 * n + 4]]
        middle = data.oMf[model.getFrameId(link)].translation
        np.testing.assert_allclose(middle, np.mean(corners, axis=0), atol=1e-12)


def test_problem_file_holds_what_was_saved(problem: PeerProblem, tmp_path: Path) -> None:
    problem.save(tmp_path / "problem.npz", 3, {"colour": "green"})
    with np.load(tmp_path / "problem.npz") as file:
        for name in ARRAYS:
            np.testing.assert_array_equal(file[name], getattr(problem, name))
        settings = json.loads(str(file["settings"]))
    assert (settings["repetitions"], settings["colour"]) == (3, "green")
    assert len(settings["contacts"]) == len(settings["thrusters"]) == 2
    assert Path(settings["urdf"]).is_file()


# ------------------------------------------------------------------------------------------------------ the check


def test_right_answers_pass_and_their_times_count(
    problem: PeerProblem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = answered(problem, tmp_path, right_answer(problem), monkeypatch)
    assert (entry["reason"], entry["compared"]) == ("", len(problem))
    assert entry["times"]["tick"]["p50_us"] == pytest.approx(2.0)
    assert entry["times"]["inside"]["max_us"] == pytest.approx(1.0)
    assert entry["times"]["tick"]["samples"] == 2 * np.count_nonzero(problem.counted)


@pytest.mark.parametrize("quantity", TOLERANCE)
def test_one_wrong_tick_is_refused(problem: PeerProblem, quantity: str) -> None:
    expected = problem.expected
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


def test_wrong_answers_get_no_times(problem: PeerProblem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = right_answer(problem)
    answer["torque"] = answer["torque"] + 0.1
    answer["force"][3] = np.nan
    entry = answered(problem, tmp_path, answer, monkeypatch)
    assert entry["reason"].startswith(f"not comparable: {len(problem)} of {len(problem)} ticks")
    assert "1 of them unsolved" in entry["reason"]
    assert "times" not in entry
    peers = {"cases": {"a walk": {"contenders": {"fake": entry}}}, "tolerance": TOLERANCE}
    assert unanswered(peers) == [f"a walk, fake: {entry['reason']}"]


def test_another_program_is_compared_with_its_own_solutions(
    made: Callable[[str], tuple[Case, PeerProblem]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, problem = made("g1 on soles, walks")
    expected = planar_solutions(problem, every=100)
    answer = right_answer(problem) | {"torque": expected.torque, "acceleration": expected.acceleration}
    np.savez(tmp_path / "answer.npz", **answer)
    script = f"import shutil, sys\nshutil.copy({str(tmp_path / 'answer.npz')!r}, sys.argv[2])\n"
    fake_peer(tmp_path, script, monkeypatch)
    row = Row("fake", planar_options(problem), expected)
    entry = measure_peer.measure_peer(row, problem, tmp_path, 1)
    assert (entry["reason"], entry["compared"]) == ("", len(range(0, len(problem), 100)))
    assert entry["apart"]["max"] > 0.1  # it is another program
    assert entry["times"]["tick"]["p50_us"] > 0.0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("torque", np.zeros((3, 6))),
        ("tick_ns", np.zeros(4, dtype=np.int64)),
        ("inside_ns", np.zeros((2, 800))),
        ("overhead_ns", np.array("soon")),
        ("versions", "[]"),
    ],
)
def test_answers_of_a_wrong_shape_or_kind_are_refused(
    problem: PeerProblem, tmp_path: Path, key: str, value: Any
) -> None:
    np.savez(tmp_path / "file.npz", **(right_answer(problem) | {key: value}))
    with pytest.raises(WorkerError, match="cannot be read"):
        load_answer(tmp_path / "file.npz", problem)


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
def test_a_worker_that_breaks_is_reported(
    problem: PeerProblem, tmp_path: Path, script: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_peer(tmp_path, script, monkeypatch)
    entry = measure_peer.measure_peer(Row("fake"), problem, tmp_path, 1)
    assert entry["reason"].startswith(BROKEN[script])


def test_a_worker_that_hangs_or_cannot_be_started_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    peer = fake_peer(tmp_path, "import time; time.sleep(60)", monkeypatch)
    python = interpreter(tmp_path, "fake")
    with pytest.raises(WorkerError, match="no result after"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b", timeout=0.5)
    python.chmod(0o644)
    with pytest.raises(WorkerError, match="cannot be started"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b")


OURS = {"condensed WBC", "whole-body QP, own search", "whole-body QP, ProxQP"}


def command(folder: Path, monkeypatch: pytest.MonkeyPatch, *, reason: str = "") -> tuple[int, dict[str, Any]]:
    """Exit code and numbers of the command on one short case without peers; with a reason, of ours that alone."""
    for name, value in {"QUICK_CASES": ("solo12, stands",), "QUICK_RECORDING": 0.2}.items():
        monkeypatch.setattr(comparison_commands, name, value)
    if reason:
        monkeypatch.setattr(compare, "measure_ours", lambda *_: {"whole-body QP, ProxQP": {"reason": reason}})
    file = folder / "peers.json"
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--quick", "--folder", str(folder), "--json", str(file)])
    return int(ended.value.code or 0), json.loads(file.read_text(encoding="utf-8"))


def test_the_command_reports_absent_peers_and_measures_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, document = command(tmp_path, monkeypatch)
    assert code == 0
    assert NOT_INSTALLED in capsys.readouterr().out
    assert document["machine"]
    (case,) = document["peers"]["cases"].values()
    entries = case["contenders"]
    assert entries["TSID in C++"]["reason"] == entries["placo, equalities kept"]["reason"] == NOT_INSTALLED
    for name in (f"{own}{processor}" for own in OURS for processor in measure_peer.PROCESSORS):
        assert entries[name]["times"]["tick"]["samples"] > 0
        assert entries[name]["difference_max"]["torque"] < TOLERANCE["torque"]
        assert ("inside" in entries[name]["times"]) == ("ProxQP" not in name)
    native, wheel = (entries[f"condensed WBC{p}"]["versions"]["flags"] for p in measure_peer.PROCESSORS)
    assert "native" in native
    assert "native" not in wheel
    tables = {table.name: table for table in peer_tables(document["peers"])}
    assert set(tables["peers"].columns) >= OURS
    assert tables["peers"].rows == ["solo12, stands"]
    assert tables["peers_solo12_stands"].number("condensed WBC", "inside C, p99") > 0.0


def test_the_command_fails_where_one_is_not_comparable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, _ = command(tmp_path, monkeypatch, reason="not comparable: 3 of 200 ticks differ from our solution")
    told = capsys.readouterr()
    assert code == 1
    assert "solo12, stands, whole-body QP, ProxQP: not comparable: 3 of 200" in told.err
    assert "what was posed" in told.out  # after all tables


def test_our_replay_has_arrays_of_numpys_own_dtype(
    made: Callable[[str], tuple[Case, PeerProblem]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arrays that come out of pickle have another dtype object; a tick that converts them takes many times as long."""
    case, _ = made("solo12, stands")
    timed: list[Case] = []
    monkeypatch.setattr(our_replay, "time_ours", lambda case, repetitions: timed.append(case))
    our_replay.save(tmp_path / "case", case, 2)
    our_replay.main(str(tmp_path / "case"), str(tmp_path / "result"))
    for found, known in zip(timed[0].sequences[0].states, case.sequences[0].states, strict=True):
        for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"):
            assert getattr(found, name).dtype is np.dtype(np.float64)
            np.testing.assert_array_equal(getattr(found, name), getattr(known, name))


@pytest.mark.long
@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("name", [*CASES, "elbow"])
def test_installed_peers_find_our_solution(
    made: Callable[[str], tuple[Case, PeerProblem]], name: str, peer: str, tmp_path: Path
) -> None:
    if not interpreter(default_folder(), peer).exists():
        pytest.skip(f"{peer} is not installed")
    problem = make_problem(elbow_case(), tmp_path / "robot.urdf") if name == "elbow" else made(name)[1]
    options = {"rewrite_equalities": True} if peer == "placo" else {}
    judge(measure_peer.measure_peer(Row(peer, options), problem, default_folder(), 1), len(problem))


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
