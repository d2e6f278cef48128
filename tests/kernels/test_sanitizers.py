"""The library's kernels under AddressSanitizer and UndefinedBehaviorSanitizer, with every index
checked.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from needs import sanitizer

HERE = Path(__file__).resolve().parents[1] / "support"
FLAGS = "-g -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
PROGRAM = """
import sys
from functools import partial
import harpy_pin.kernels
from harpy_pin.kernels import compiler
# Instrumented before it is optimised; a tenth of the time to compile.
compiler.FLAGS = (*compiler.FLAGS, "-O0")
module = sys.modules["harpy_pin.kernels.kernels"]
module.entry_code = partial(module.entry_code, debug=True)
sys.path.insert(0, sys.argv[1])
from scenes import SCENES
for name in sys.argv[2:]:
    SCENES[name]()
print("reached the end")
"""
OUTSIDE = """
import numpy as np
from harpy_pin.kernels import kernel
from outside import {name}
{name}(np.zeros(3), 3)
print("reached the end")
"""
KERNELS = """
from harpy_pin.kernels import kernel
@kernel
def beyond(a, n):
    a[n] = 1.0
"""


pytestmark = pytest.mark.needs("sanitizers")


def run(program: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    known = sanitizer()
    assert known is not None
    environment = {
        **os.environ,
        "CC": f"{known[0]} {FLAGS}",
        "LD_PRELOAD": known[1],
        "ASAN_OPTIONS": "detect_leaks=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "HARPY_PIN_CACHE": str(folder / "cache"),
        "PYTHONMALLOC": "malloc",  # or it would not see the ends of short arrays
        "PYTHONPATH": os.pathsep.join([str(HERE.parents[1]), str(folder)]),
    }
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, check=False, cwd=folder
    )


def test_a_write_behind_an_array_is_found(tmp_path):
    (tmp_path / "outside.py").write_text(KERNELS)
    done = run(OUTSIDE.format(name="beyond"), tmp_path)
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr


@pytest.mark.long
@pytest.mark.parametrize(
    "names",
    [
        ("condensed", "loops"),
        ("formulation input_space", "formulation full"),
        ("governed", "governor paper", "governor filter"),
        ("batches", "reduced", "pieces"),
        ("environments", "in_place"),
    ],
    ids=str,
)
def test_nothing_undefined(names, tmp_path):
    done = run(PROGRAM, tmp_path, str(HERE), *names)
    assert done.stdout.splitlines()[-1:] == ["reached the end"], done.stderr[-4000:]
    assert "runtime error" not in done.stderr
