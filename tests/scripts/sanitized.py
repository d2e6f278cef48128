"""Runs short_walks.py with kernels built with sanitizers, whose every index is checked."""

import runpy
import sys
from functools import partial
from pathlib import Path

import harpy_pin.compiled.kernels as kernels
from harpy_pin.compiled import compiler

compiler.FLAGS = (*compiler.EXACT, "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
kernels.entry_code = partial(kernels.entry_code, debug=True)
sys.argv[0] = str(Path(__file__).with_name("short_walks.py"))
runpy.run_path(sys.argv[0], run_name="__main__")
print("clean", len(compiler.MADE))
