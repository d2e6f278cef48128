"""Workers: scripts that import nothing of ours, and that may break or hang."""

import ast
import sys
from pathlib import Path

import pytest
from fake_peers import fake_peer

from comparison.peers import environment, measure_peer
from comparison.peers.environment import WorkerError, interpreter, run_worker
from comparison.peers.measure_peer import Row
from comparison.peers.peer_problem import PeerProblem

HERE = Path(environment.__file__).parents[1]
BROKEN = {
    "raise RuntimeError('no such joint')": "RuntimeError: no such joint",
    "import os; os.abort()": "ended by SIGABRT",
    "import sys; sys.exit(3)": "no message",
    "pass": "ended without a result",
    "import sys; open(sys.argv[2], 'w').write('garbage')": "its result cannot be read",
    "import sys; open(sys.argv[2], 'w')": "its result cannot be read",
    "import numpy, sys; numpy.savez(sys.argv[2], versions='{}', "
    "overhead_ns=1.0)": "its result cannot be read",
}


@pytest.mark.parametrize("script", sorted(HERE.rglob("*_worker.py")), ids=lambda path: path.stem)
def test_workers_import_nothing_of_ours(script: Path) -> None:
    allowed = {"numpy", "onnxruntime", "placo", "pinocchio"} | set(sys.stdlib_module_names)
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {alias.name.split(".")[0] for alias in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert (node.module or "").split(".")[0] in allowed


@pytest.mark.parametrize("script", BROKEN)
def test_a_worker_that_breaks_is_reported(
    problem: PeerProblem, tmp_path: Path, script: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_peer(tmp_path, script, monkeypatch)
    entry = measure_peer.measure_peer(Row("fake"), problem, tmp_path, 1)
    assert entry["reason"].startswith(BROKEN[script])


def test_a_worker_that_hangs_or_cannot_be_started_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    peer = fake_peer(tmp_path, "import time; time.sleep(60)", monkeypatch)
    python = interpreter(tmp_path, "fake")
    with pytest.raises(WorkerError, match="no result after"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b", timeout=0.5)
    python.chmod(0o644)
    with pytest.raises(WorkerError, match="cannot be started"):
        run_worker(python, peer.worker, tmp_path / "a", tmp_path / "b")
