"""Every kernel of the library becomes C that compilers have nothing to say about, and is that of plain Python."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from long import long_but
from needs import needs_robots
from oracle import compared
from scenes import SCENES, library_kernels

from harpy_pin.compiled import BACKEND, compiler, entry_points
from harpy_pin.compiled.entry_points import entry_unit
from harpy_pin.model.catalogue import installed_data

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="no C compiler")
WARNINGS = (
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-Wno-unused-command-line-argument",
)


@pytest.fixture(scope="module")
def called():
    """Kernels that were called, with the types of their arguments."""
    for scene in SCENES.values():
        scene()
    return [(kernel, types) for kernel in library_kernels().values() for types in kernel._versions]


def written(called, *, single: bool) -> tuple[list[str], set[object]]:
    """The C of each of them, and all functions that it is made of."""
    codes, units = [], []

    def keep(*arguments, **how):
        units.append(entry_unit(*arguments, **how))
        return units[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(entry_points, "entry_unit", keep)
        codes = [entry_points.entry_code(kernel, types, single=single) for kernel, types in called]
    return codes, {function for unit, _ in units for function, _ in unit.functions}


@pytest.fixture(scope="module")
def in_double(called):
    return written(called, single=False)


@pytest.mark.parametrize("name", SCENES)
def test_every_bit_is_that_of_plain_python(name):
    with compared(most=3) as comparison:
        SCENES[name]()
    assert comparison.compared or installed_data() is None
    assert comparison.different == []


@needs_robots
def test_every_kernel_of_the_library_is_reached(in_double):
    _, reached = in_double
    kernels = library_kernels()
    assert len(kernels) > 300
    assert [name for name, kernel in kernels.items() if kernel.py_func not in reached] == []


@pytest.mark.parametrize("single", long_but((False, True), (False,)), ids=["double", "float"])
def test_compilers_have_nothing_to_say(single, called, in_double, tmp_path: Path):
    command = compiler.compiler()
    assert command is not None
    codes, _ = written(called, single=True) if single else in_double
    files = []
    for n, ((kernel, _), code) in enumerate(zip(called, codes, strict=True)):
        file = tmp_path / f"{kernel.py_func.__name__.strip('_')}_{n}.c"
        file.write_text(code, encoding="utf-8")
        files.append(str(file))
    done = subprocess.run([*command, *WARNINGS, "-fsyntax-only", *files], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0
    assert len(files) > 50
