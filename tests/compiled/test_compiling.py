"""Kernels are compiled once, with a notice, and then come from disk."""

from __future__ import annotations

import os
import subprocess
import sys

SCRIPT = """
from harpy_pin import Ground
from harpy_pin.simulation.ground import normal_force
normal_force(-0.001, 0.0, Ground().record[0])
normal_force(-0.001, 0.0, Ground(mu_s=1).record[0])
"""


def test_notice_is_given_once_and_only_while_compiling(tmp_path):
    def notices() -> int:
        environment = os.environ | {"HARPY_PIN_CACHE": str(tmp_path)}
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT], capture_output=True, text=True, env=environment, check=True
        )
        return run.stderr.count("compiling kernels")

    assert notices() == 1
    assert notices() == 0  # from the cache on disk; whole numbers as settings make no new type
