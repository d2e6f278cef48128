"""The comparison of both engines, tick by tick: equal walks differ by nothing, others by what they differ."""

from __future__ import annotations

import numpy as np
import pytest

import comparison.engines as engines
import harpy_pin as hp


def test_difference_is_that_of_the_logs(monkeypatch):
    monkeypatch.setattr(engines, "WALKERS", ("governed/none",))
    walks = []

    def walk(scenario):
        walks.append((scenario.plant.name, hp.walk(scenario)))
        return walks[-1][1]

    monkeypatch.setattr(engines, "walk", walk)
    (row,) = engines.walk_engines(duration=0.4)
    (first, ours), (second, theirs) = walks
    assert (first, second) == ("compliant", "mujoco")
    gap = [np.linalg.norm(a - b) for a, b in zip(ours["q"][:, :3], theirs["q"][:, :3], strict=True)]
    assert row["apart_mm"] == pytest.approx(1e3 * max(gap)) != 0.0
    normal = (ours["foot_force"] - theirs["foot_force"])[:, :, 2]
    assert row["normal_rms_n"] == pytest.approx(np.sqrt(np.mean(normal**2)))
    assert row["normal_n"] == pytest.approx([run["foot_force"].sum(axis=1)[:, 2].mean() for run in (ours, theirs)])
    table = engines.engine_table([row])
    assert table.number("bodies apart, mm", "no governor") == row["apart_mm"]
    assert table.get("ending", "no governor").value == "completed"
    same = engines._compare(ours, ours)
    assert (same["apart_mm"], same["normal_rms_n"], same["tangential_rms_n"]) == (0.0, 0.0, 0.0)


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(engines, "installed_version", lambda: None)
    with pytest.raises(hp.InputError, match="pip install"):
        engines.walk_engines(duration=0.1)
