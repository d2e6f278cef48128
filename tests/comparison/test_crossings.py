"""The study of crossings in small."""

from __future__ import annotations

from needs import needs_robots

from comparison.crossings import CROSSINGS, CrossingSettings, cross, crossing_tables


@needs_robots
def test_a_small_study():
    rows = cross(CrossingSettings.quick())
    assert [row["through"] for row in rows] == [True, True]
    assert all(0.0 <= row["slip_mm_per_step"] < 5.0 for row in rows)
    (table,) = crossing_tables(rows)
    assert [cell.value for cell in table.cells[::2]] == ["1 of 1", "1 of 1"]


def test_a_goal_is_behind_the_last_step():
    for one in CROSSINGS.values():
        begin, end = one.ground(one.tries).height((0.0, one.goal), (0.0, 0.0))
        if "steps" in one.name:
            assert abs(end - begin) > 0.35
