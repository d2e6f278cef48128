"""Peers that answer what a test says."""

import json
import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparison.peers import measure_peer
from comparison.peers.environment import PEERS, Peer, interpreter
from comparison.peers.measure_peer import TOLERANCE, Row
from comparison.peers.peer_problem import PeerProblem


def right_answer(problem: PeerProblem) -> dict[str, Any]:
    """The file that a perfect peer would write."""
    out: dict[str, Any] = {"versions": json.dumps({"perfect": "1.0"}), "overhead_ns": 40.0}
    out |= {quantity: getattr(problem.expected, quantity).copy() for quantity in TOLERANCE}
    return out | {
        f"{what}_ns": np.full((2, len(problem)), each)
        for what, each in (("tick", 2040), ("inside", 1040))
    }


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
