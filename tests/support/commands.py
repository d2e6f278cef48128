"""Scripts of commands for the commanded gait."""

from __future__ import annotations

import pytest
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.gaits import CommandedParameters

ROBOT = hp.load_harpy()
P = CommandedParameters()
entries = st.floats(-0.6, 0.6) | st.sampled_from((0.0, 3.0, -20.0, 1e5))
scripts = st.lists(st.tuples(st.floats(0.05, 1.5), entries, entries, entries), min_size=1, max_size=5).map(
    lambda rows: [(sum(row[0] for row in rows[: i + 1]), *rows[i][1:]) for i in range(len(rows))]
)


CONTROLLERS = pytest.mark.parametrize("controller", ["condensed", "wbc"])


def settings_of(controller):
    return {"solver": "daqp"} if controller == "wbc" else {}
