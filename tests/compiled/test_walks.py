"""Whole walks in C and in plain Python: every logged digit is the same.

That each kernel gives Python's bits is seen in every run by ``test_all_kernels.py``.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from needs import needs_robots

from harpy_pin.compiled import BACKEND

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="compares with C")
SCRIPT = Path(__file__).resolve().parents[1] / "support" / "short_walks.py"
WALKS = (
    *("condensed", "condensed, friction estimated", "condensed, commanded"),
    *("QP", "QP, full", "QP, forces"),
    *("no governor", "paper's governor", "contact-force filter", "MuJoCo"),
)
ROBOTS = ("g1", "iris")
"""Flat feet, and rotors."""


def logs(folder, kind, names, ticks):
    """Logs of walks in a process of their own."""
    folder.mkdir()
    command = [sys.executable, str(SCRIPT), str(folder), str(ticks), *names]
    done = subprocess.run(command, env=os.environ | {"HARPY_PIN_KERNELS": kind}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {name: np.load(folder / f"{name}.npz") for name in names}


def compare(tmp_path, kind, names, ticks):
    ours, theirs = (logs(tmp_path / one, one, names, ticks) for one in ("c", kind))
    for name in names:
        assert len(ours[name]["t"]) == ticks
        assert max(np.abs(ours[name][what]).max(initial=0.0) for what in ("torque", "thrust")) > 0.1
        assert set(ours[name].files) == set(theirs[name].files)
        for signal in ours[name].files:
            np.testing.assert_array_equal(ours[name][signal], theirs[name][signal], err_msg=f"{name}: {signal}")


@pytest.mark.long
def test_python_gives_every_digit(tmp_path):
    compare(tmp_path, "python", WALKS, 12)


@pytest.mark.long
@needs_robots
def test_python_gives_every_digit_of_other_robots(tmp_path):
    compare(tmp_path, "python", ROBOTS, 3)
