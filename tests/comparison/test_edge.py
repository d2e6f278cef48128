"""Where walks begin to fall, with and without the governor of the command: what is walked, and its tables."""

from __future__ import annotations

import pytest

from comparison.edge import DIRECTIONS, EdgeSettings, edge_tables, walk_edge


def test_every_case_is_walked_by_both_controllers_with_and_without():
    settings = EdgeSettings(frictions=(0.3,), speeds=(0.3,), starts=1, duration=1.5, pushes=(1.0,), push_time=0.4)
    seen = []
    rows = walk_edge(settings, lambda done, total: seen.append((done, total)))
    cases = 1 + len(DIRECTIONS)
    assert len(rows) == 4 * cases == seen[-1][0] == seen[-1][1]
    quiet = [row for row in rows if row["push"] == 0.0]
    assert {(row["controller"], row["governed"]) for row in quiet} == {
        (controller, governed) for controller in ("condensed", "wbc") for governed in (False, True)
    }
    for off, on in zip(rows[::2], rows[1::2], strict=True):
        assert (off["governed"], on["governed"]) == (False, True)
        assert off["direction"] == on["direction"]
        if not off["push"]:
            # Good ground: nothing is bent. (ProxQP's last digits may differ between two walks.)
            assert on["bent_share"] == 0.0
            assert on["speed_share"] == pytest.approx(off["speed_share"], rel=1e-6)
    friction, pushes = edge_tables(rows)
    assert friction.rows == ["μ 0.3, 0.3 m/s, condensed WBC", "μ 0.3, 0.3 m/s, whole-body QP"]
    cell = friction.get(friction.rows[0], "fell, on")
    assert cell is not None
    assert cell.value == "0 of 1"
    assert pushes.rows == [f"μ 0.35, 1 N·s, {name}" for name in DIRECTIONS]
    assert {cell.value for cell in pushes.cells} == {"walked on"}
