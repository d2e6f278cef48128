"""Walks over ice with and without the estimate of the friction: what is walked, and its tables."""

from __future__ import annotations

import numpy as np
import pytest

import harpy_pin as hp
from comparison.ice import SENSORS, WALKERS, IceSettings, _slips, ice_tables, walk_ice


def test_every_case_is_walked_with_and_without():
    seen = []
    rows = walk_ice(IceSettings.quick(), lambda done, total: seen.append((done, total)))
    assert len(rows) == 2 * len(WALKERS) * len(SENSORS) == seen[-1][0] == seen[-1][1]
    for off, on in zip(rows[::2], rows[1::2], strict=True):
        assert (off["estimate"], on["estimate"]) == (False, True)
        assert off["lowest_estimate"] is None
        assert on["lowest_estimate"] < 0.8
        if on["walker"] == "condensed":
            assert max(off["ice_mm"]) > 10.0 * max(on["ice_mm"])
    (table,) = ice_tables(rows)
    assert len(table.rows) == len(rows)
    cell = table.get("condensed WBC, exact, estimate on", "fell")
    assert cell is not None
    assert cell.value == "0 of 1"


def test_slip_belongs_to_the_step_it_happens_in():
    """Three steps: on good ground, on ice, and behind it, with 1, 20 and 3 mm."""
    t = np.arange(2250) * 1e-3
    step = np.floor(t / 0.75 + 1e-9)
    x = np.array([0.1, 0.7, 1.5])[step.astype(int)]
    per_tick = np.array([1.0, 20.0, 3.0])[step.astype(int)] * 1e-3 / 750
    position, force = np.zeros((2250, 2, 3)), np.zeros((2250, 2, 3))
    position[:, 0, 0], force[:, 0, 2] = x, 30.0
    path = np.zeros((2250, 2))
    path[:, 0] = np.cumsum(per_tick)
    run = hp.Run({"t": t, "foot_position": position, "foot_force": force, "slip_path": path}, {"ending": "completed"})
    slips = _slips(run, (0.6, 1.2, 0.15))
    assert slips["ice_mm"] == pytest.approx([20.0])
    assert slips["after_mm"] == pytest.approx([3.0])
    assert not slips["fell"]
