"""No controller compiles or loads a kernel after its first tick: a motor at its limit must not wait
for a compiler.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from needs import needs_compiler

TESTS = Path(__file__).parents[1]
CASES = {
    "paper": ("governed", {"governor": "paper"}),
    "filter": ("governed", {"governor": "filter", "limits": True}),
    "condensed": ("condensed", {"estimate_friction": True}),
    "condensed, lag": ("condensed", {"thrust_lag": 0.1}),
    "input_space": ("wbc", {"solver": "active_set"}),
    "input_space, ProxQP": ("wbc", {}),
    "input_space, lag": ("wbc", {"solver": "active_set", "thrust_lag": 0.1}),
    "motors, ProxQP": ("wbc", {"joint_stiffness": 1.0, "joint_damping": 0.3}),
    "full": ("wbc", {"formulation": "full", "solver": "active_set"}),
    "full, daqp": ("wbc", {"formulation": "full", "solver": "daqp"}),
    "added": ("wbc", {}),
}


EACH = """
import json, os, runpy, sys
import hostile_states, random_states
from harpy_pin import CentreOfMassTask, make_controller, make_gait
for name, (kind, options) in json.loads(sys.argv[2]).items():
    print(name, end=': ', flush=True)
    if os.fork() == 0:
        sys.argv[2:] = json.dumps(options), name
        script, sys.argv[1] = sys.argv[1], kind
        runpy.run_path(script)
        break
    if os.wait()[1] != 0:
        sys.exit(name)
"""
"""Runs the script for each of the cases, in a process of its own that begins with what the script
imports.
"""


@needs_compiler
def test_nothing_is_compiled_after_the_first_tick() -> None:
    command = [
        sys.executable,
        "-c",
        EACH,
        str(TESTS / "support" / "late_kernels.py"),
        json.dumps(CASES),
    ]
    paths = os.pathsep.join([str(TESTS / "support"), *sys.path])
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths}
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"{name}: []" for name in CASES]
