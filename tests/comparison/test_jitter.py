"""A loop at 1 kHz, measured: every deadline is a tick or missed, and a tick that stalls is found in its place."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from comparison import jitter
from comparison.jitter import EDGES, JitterSettings, jitter_tables, measure_jitter
from harpy_pin import InputError
from harpy_pin.controllers import CondensedController

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="measured on Linux")


def test_stalls_are_counted_where_they_were(monkeypatch):
    """The tick takes as long as it sleeps, and at least the deadlines that passed in the meantime are missed."""
    step, calls = CondensedController.step, []

    def stalling(self, state):
        calls.append(state.t)
        if len(calls) == 4:  # the first one compiles
            time.sleep(0.25)
        return step(self, state)

    monkeypatch.setattr(CondensedController, "step", stalling)
    (row,) = measure_jitter(JitterSettings(seconds=0.5, controllers=("condensed",)), lambda *_: None)
    ticks = sum(row["took"]["counts"])
    assert ticks + row["missed"] == 500
    assert ticks == sum(row["late"]["counts"]) == len(calls) - 1
    assert row["missed"] >= 249
    assert row["took"]["most"] >= 250_000
    assert sum(row["took"]["counts"][EDGES.index(100_000) :]) >= 1
    np.testing.assert_allclose(np.diff(calls[1:]), 1e-3)  # physics goes on by one period for each tick
    counts, ends = jitter_tables([row])
    assert counts.number("100000 to 10000000 µs", "condensed, tick") >= 1
    assert ends.number("condensed, late", "deadlines missed") == row["missed"]
    assert "SCHED_" in counts.note


def test_priorities_that_are_not_permitted(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(jitter.os, "sched_setscheduler", refuse)
    with pytest.raises(InputError, match="does not permit priority 80"):
        measure_jitter(JitterSettings(priority=80, controllers=("condensed",)), lambda *_: None)
