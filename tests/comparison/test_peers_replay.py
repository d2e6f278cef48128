"""The replay of our own controllers in a process of its own."""

from pathlib import Path

import numpy as np
import pytest
from peer_cases import Make

from comparison.peers import our_replay
from comparison.peers.peer_problem import Case


def test_our_replay_has_arrays_of_numpys_own_dtype(
    made: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arrays that come out of pickle have another dtype object; a tick that converts them takes
    many times as long.
    """
    case, _ = made("solo12, stands")
    timed: list[Case] = []
    monkeypatch.setattr(our_replay, "time_ours", lambda case, repetitions: timed.append(case))
    our_replay.save(tmp_path / "case", case, 2)
    our_replay.main(str(tmp_path / "case"), str(tmp_path / "result"))
    for found, known in zip(timed[0].sequences[0].states, case.sequences[0].states, strict=True):
        for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"):
            assert getattr(found, name).dtype is np.dtype(np.float64)
            np.testing.assert_array_equal(getattr(found, name), getattr(known, name))
