"""Whole walks in C and in plain Python, in processes of their own: every logged digit is the same.

That each kernel gives Python's bits is seen in every run by ``test_all_kernels.py``.
"""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from needs import needs_compiler, needs_mujoco, needs_robots
from walks import scenario

import harpy_pin as hp

SCRIPT = """
import json, sys, numpy as np, harpy_pin as hp
run = hp.walk(hp.Scenario.from_dict(json.loads(sys.argv[2])))
np.savez(sys.argv[1], **{name: values for name, values in run.signals.items() if name != "tick_ns"})
"""
PUSH = hp.Push(time=0.002, impulse=(0.5, 2.0, 0.0), duration=0.01)
COMMAND = ((0.0, 0.3, 0.0, 0.0), (0.005, 0.1, 0.05, 0.4))
CONTROLLERS = (
    *(hp.Condensed(), hp.Condensed(parameters={"estimate_friction": True})),
    *(hp.WholeBody(parameters={"formulation": name, "solver": "active_set"}) for name in hp.wbc.FORMULATIONS),
    *(hp.Governed(governor=name) for name in hp.controllers.GOVERNORS),
)
SLIPPERY = {"mu_s": 0.1, "pushes": (PUSH,), "start_velocity": (0.3, 0.2, 0.0, 0.0, 0.0, 0.5), "duration": 0.012}


@pytest.mark.long
@needs_compiler
@pytest.mark.parametrize(
    "settings",
    [
        *({"controller": controller} for controller in CONTROLLERS),
        {"gait": hp.Commanded(velocity=COMMAND)},
        {"plant": "pinocchio"},
        pytest.param({"plant": "mujoco"}, marks=needs_mujoco),
        *(pytest.param({"robot": name, "duration": 0.003}, marks=needs_robots) for name in ("g1", "iris")),
    ],
    ids=str,
)
def test_python_gives_every_digit(settings, tmp_path):
    walk = json.dumps(scenario(**SLIPPERY | settings).to_dict())
    for kind in ("c", "python"):
        command = [sys.executable, "-c", SCRIPT, str(tmp_path / kind), walk]
        subprocess.run(command, env=os.environ | {"HARPY_PIN_KERNELS": kind}, check=True)
    ours, theirs = (dict(np.load(tmp_path / f"{kind}.npz")) for kind in ("c", "python"))
    assert max(np.abs(ours[name]).max(initial=0.0) for name in ("torque", "thrust")) > 0.1
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=name)
