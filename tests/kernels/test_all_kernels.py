"""Every kernel of the library becomes C that compilers have nothing to say about, and is that of
plain Python.
"""

import subprocess
from functools import cache
from pathlib import Path

import pytest
from long import long_but
from needs import needs_compiler, needs_robots
from oracle import Comparison, compared
from scenes import SCENES, library_kernels

from harpy_pin.kernels import compiler
from harpy_pin.kernels.entry_points import entry_code
from harpy_pin.kernels.functions import translate
from harpy_pin.kernels.unit import Unit
from harpy_pin.model.catalogue import installed_data

pytestmark = needs_compiler
WARNINGS = (
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-Wno-unused-function",
)


IN_PLACE = "in_place"
"""A scene of batches that work in threads: their arrays change while they are compared."""
NAMES = [name for name in SCENES if name != IN_PLACE]


@cache
def comparison_in(name: str) -> Comparison:
    """Calls of a scene, in C and in Python."""
    with compared(most=3) as comparison:
        SCENES[name]()
    return comparison


@pytest.fixture(scope="module")
def called():
    """Kernels that were called, with the types of their arguments."""
    for name in NAMES:
        comparison_in(name)
    return [(kernel, types) for kernel in library_kernels().values() for types in kernel._versions]


def together(called, *, single: bool) -> Unit:
    """All of them in one file, where each function stands once."""
    unit = Unit(single=single)
    for kernel, types in called:
        translate(unit, kernel, types)
    return unit


@pytest.fixture(scope="module")
def in_double(called):
    return together(called, single=False)


@pytest.mark.parametrize("name", NAMES)
def test_every_bit_is_that_of_plain_python(name):
    comparison = comparison_in(name)
    assert comparison.compared or installed_data() is None
    assert comparison.different == []


@needs_robots
def test_every_kernel_of_the_library_is_reached(in_double):
    reached = {function for function, _ in in_double.functions}
    kernels = library_kernels()
    assert len(kernels) > 300
    assert [name for name, kernel in kernels.items() if kernel.py_func not in reached] == []


@pytest.mark.parametrize("single", long_but((False, True), (False,)), ids=["double", "float"])
def test_compilers_have_nothing_to_say(single, called, in_double, tmp_path: Path):
    """About any function, and about some of the files as they are compiled for a call."""
    command = compiler.compiler()
    assert command is not None
    assert len(called) > 50
    unit = together(called, single=True) if single else in_double
    codes = ["\n\n".join((unit.header(), unit.types(), unit.code()))]
    codes += [entry_code(kernel, types, single=single) for kernel, types in called[::20]]
    # which zig takes for a build without a result
    mode = "-c" if "ziglang" in command else "-fsyntax-only"
    for n, code in enumerate(codes):  # one by one: zig links what it compiles together
        file = tmp_path / f"{n}.c"
        file.write_text(code, encoding="utf-8")
        done = subprocess.run(
            [*command, *WARNINGS, mode, file],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
