"""The comparison's table of grounds: every walk once, in both engines, and what its cells say."""

from __future__ import annotations

import pytest

import comparison.sections.grounds as section
from harpy_pin.simulation.mujoco import PRESETS


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(section, "WALKERS", ("governed/none", "governed/paper"))
    monkeypatch.setattr(section, "STEPS", ("governed/paper",))
    monkeypatch.setattr(section, "STIFFNESSES", (8e3, 40e3))


def test_every_walk_on_every_ground(small):
    seen: list[tuple[int, int]] = []
    settings = section.GroundsSettings(duration=0.3, frictions=(0.25, 0.15))
    rows = section.walk_grounds(settings, lambda done, total: seen.append((done, total)))
    assert len(seen) == len(rows) == seen[-1][0] == seen[-1][1] == (2 + len(PRESETS)) * 5
    places = {(row["ground"], row["friction"], row["walker"], row["dt_s"]) for row in rows}
    assert len(places) == len(rows)
    assert {row["ground"] for row in rows} == {"8 kN/m", "40 kN/m", *(f"MuJoCo {name}" for name in PRESETS)}
    for row in rows:
        assert row["ending"] == "completed"
        assert row["end_time_s"] == pytest.approx(0.3)
        assert 20.0 < row["normal_n"] < 60.0
        assert row["path_mm"] >= 0.0
    assert len({row["path_mm"] for row in rows if row["walker"] == "governed/paper"}) > len(PRESETS) + 2


def test_tables_say_what_the_rows_say(small):
    rows = section.walk_grounds(section.GroundsSettings(duration=0.05, frictions=(0.25,)))
    rows[0] |= {"ending": "fell", "end_time_s": 1.5}
    path, net, engines = section.ground_tables(rows)
    assert path.get("no governor", "8 kN/m").value == "fell at 1.50 s"
    coarse, fine = (row for row in rows if (row["ground"], row["walker"]) == ("40 kN/m", "governed/paper"))
    assert path.number("paper's governor", "40 kN/m") == coarse["path_mm"]
    assert net.number("paper's governor", "40 kN/m") == coarse["net_mm"]
    assert engines.number("paper's governor: path with half the step, mm", "40 kN/m") == fine["path_mm"]
    assert path.columns[-1] == "MuJoCo stiff"


def test_without_mujoco_our_grounds_remain(small, monkeypatch):
    monkeypatch.setattr(section, "installed_version", lambda: None)
    rows = section.walk_grounds(section.GroundsSettings(duration=0.02, frictions=(0.25,)))
    assert {row["ground"] for row in rows} == {"8 kN/m", "40 kN/m"}
    assert "not installed" in section.ground_tables(rows)[-1].note
