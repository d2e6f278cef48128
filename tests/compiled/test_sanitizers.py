"""No undefined behaviour, and no access outside an array: walks with sanitized kernels and checked indices."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from harpy_pin.compiled import BACKEND, compiler, kernel

SCRIPT = Path(__file__).parents[1] / "scripts" / "sanitized.py"
WALKS = ("law", "law, disc", "law, governed and commanded", "QP", "QP, full", "paper's governor", "force governor")


def runtime():
    """What a process that loads sanitized libraries must begin with: the sanitizer, and C++ before its exceptions."""
    if BACKEND != "c":
        return None
    found = []
    for name in ("libasan.so", "libstdc++.so"):
        command = [*compiler.compiler(), f"-print-file-name={name}"]
        found.append(subprocess.run(command, capture_output=True, text=True).stdout.strip())
    return " ".join(found) if all("/" in path for path in found) else None


def sanitized(tmp_path, names, ticks):
    environment = os.environ | {
        "LD_PRELOAD": runtime(),
        "ASAN_OPTIONS": "detect_leaks=0",
        "HARPY_PIN_CACHE": str(tmp_path / "cache"),
    }
    command = [sys.executable, str(SCRIPT), str(tmp_path), str(ticks), *names]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


@pytest.mark.skipif(runtime() is None, reason="needs the address sanitizer")
def test_walks_are_clean(tmp_path, fuzz):
    """At the first ticks of slippery, pushed walks, with limits met; --fuzz 2 walks on."""
    done = sanitized(tmp_path, WALKS, 40 * fuzz)
    assert done.returncode == 0, done.stderr[-3000:]
    made = int(done.stdout.split("clean")[1])
    assert made > 10
    for name in WALKS:
        assert len(np.load(tmp_path / f"{name}.npz")["t"]) == 40 * fuzz


def test_an_index_outside_its_array_is_found():
    """In C that checks indices, which is what is looked at above."""

    @kernel
    def outside(a, k: int):
        return a[k]

    code = outside.c_source(np.zeros(3), 0, debug=True)
    assert "inside(k, a_size, __LINE__)" in code
    assert "inside" not in outside.c_source(np.zeros(3), 0)
