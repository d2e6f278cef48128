"""Answers of peers: what is right, what is refused, and that those of the installed ones are
right.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_peers import answered, fake_peer, right_answer
from peer_cases import CASES, Make, elbow_case

from comparison.peers import measure_peer
from comparison.peers.compare import unanswered
from comparison.peers.dense_program import planar_options, planar_solutions
from comparison.peers.environment import (
    NOT_INSTALLED,
    PEERS,
    WorkerError,
    default_folder,
    interpreter,
)
from comparison.peers.measure_peer import TOLERANCE, Row, check, load_answer
from comparison.peers.peer_problem import PeerProblem, make_problem

CANNOT_RUN = (
    *(NOT_INSTALLED, "cannot be started", "no result after", "ImportError", "ModuleNotFoundError"),
    *("ended by SIGILL", "ended by SIGKILL", "TSID's C++ needs a C++ compiler"),
)
"""Begins of reasons that are the machine's, not the peer's."""


def judge(entry: dict[str, Any], ticks: int) -> None:
    """Fail unless every tick has the solution; skip if the peer cannot run on this machine."""
    if entry["reason"].startswith(CANNOT_RUN):
        pytest.skip(entry["reason"])
    assert entry["reason"] == ""
    assert (entry["compared"], entry["differing"]) == (ticks, 0)


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


def test_wrong_answers_get_no_times(
    problem: PeerProblem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    made: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, problem = made("g1 on soles, walks")
    expected = planar_solutions(problem, every=100)
    answer = right_answer(problem) | {
        "torque": expected.torque,
        "acceleration": expected.acceleration,
    }
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


@pytest.mark.long
@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("name", [*CASES, "elbow"])
def test_installed_peers_find_our_solution(
    made: Make, name: str, peer: str, tmp_path: Path
) -> None:
    if not interpreter(default_folder(), peer).exists():
        pytest.skip(f"{peer} is not installed")
    problem = (
        make_problem(elbow_case(), tmp_path / "robot.urdf") if name == "elbow" else made(name)[1]
    )
    options = {"rewrite_equalities": True} if peer == "placo" else {}
    judge(measure_peer.measure_peer(Row(peer, options), problem, default_folder(), 1), len(problem))
