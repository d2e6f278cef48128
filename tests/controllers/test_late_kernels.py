"""No controller compiles or loads a kernel after its first tick: a motor at its limit must not wait for a compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from harpy_pin.compiled.kernels import BACKEND

TESTS = Path(__file__).parents[1]
CASES = {
    "paper": ("governed", {"governor": "paper"}),
    "filter": ("governed", {"governor": "filter", "limits": True}),
    "condensed": ("condensed", {"estimate_friction": True}),
    "condensed, lag": ("condensed", {"thrust_lag": 0.1}),
    "input_space": ("wbc", {}),
    "input_space, lag": ("wbc", {"thrust_lag": 0.1}),
    "full, daqp": ("wbc", {"formulation": "full", "solver": "daqp"}),
    "contact_force": ("wbc", {"formulation": "contact_force"}),
    "added": ("wbc", {}),
}


@pytest.mark.skipif(BACKEND != "c", reason="only C is compiled")
@pytest.mark.parametrize("name", tuple(CASES))
def test_nothing_is_compiled_after_the_first_tick(name: str) -> None:
    kind, options = CASES[name]
    command = [sys.executable, str(TESTS / "support" / "late_kernels.py"), kind, json.dumps(options), name]
    paths = os.pathsep.join([str(TESTS / "support"), *sys.path])
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths})
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == []
