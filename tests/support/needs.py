"""What a test needs and a machine may lack: programs, and extras of the package. Tests ask for them
here only.

``@pytest.mark.needs("cmake")`` skips a test where CMake is missing; the end of a run counts what
was skipped for want of what. ``pytest --needing cmake`` runs the tests that need CMake and no
others, and refuses to begin without it.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

from harpy_pin.errors import HarpyError
from harpy_pin.kernels import compiler
from harpy_pin.model.catalogue import installed_data
from harpy_pin.simulation.mujoco import installed_version
from harpy_pin.view.page.film import find_chromium

CASSIE = Path(__file__).parents[2] / "out/clones/mujoco_menagerie/agility_cassie/scene.xml"
"""In a clone of google-deepmind/mujoco_menagerie."""


@cache
def chromium() -> str | None:
    """Path of Chromium."""
    with suppress(HarpyError):
        return find_chromium()
    return None


@cache
def sanitizer() -> tuple[str, str] | None:
    """GCC or Clang, and the libraries that must be loaded before Python; Zig has no
    AddressSanitizer.
    """
    command = compiler.compiler()
    if command is None or sys.platform != "linux" or "ziglang" in command:
        return None
    libraries = []
    for name in (
        "libasan.so",
        "libstdc++.so",
    ):  # the second one for exceptions of the first one's interceptors
        found = subprocess.run(
            [*command, f"-print-file-name={name}"], capture_output=True, text=True, check=False
        )
        libraries.append(found.stdout.strip())
    return (" ".join(command), " ".join(libraries)) if all(map(os.path.isabs, libraries)) else None


CHECKS: dict[str, Callable[[], object | None]] = {
    "chromium": chromium,
    "cmake": lambda: shutil.which("cmake"),
    "arm-none-eabi-gcc": lambda: shutil.which("arm-none-eabi-gcc"),
    "qemu-system-arm": lambda: shutil.which("qemu-system-arm"),
    "sanitizers": sanitizer,
    "gdb": lambda: shutil.which("gdb"),
    "compiler": compiler.compiler,
    "robots": installed_data,
    "mujoco": installed_version,
    "xacrodoc": lambda: find_spec("xacrodoc"),
    "menagerie": lambda: CASSIE if CASSIE.is_file() else None,
}
"""Programs and extras by the names that marks use; a check returns None where one is missing."""

needs_chromium = pytest.mark.needs("chromium")
needs_compiler = pytest.mark.needs("compiler")
needs_robots = pytest.mark.needs("robots")
needs_mujoco = pytest.mark.needs("mujoco")
QUICK_PLANTS = ("compliant", pytest.param("mujoco", marks=needs_mujoco))
"""Plants by name that walk for seconds within a second, for tests of both."""
PLANTS = (*QUICK_PLANTS, "pinocchio")
"""Plants by name, for tests of all."""


def missing(names: Iterable[str]) -> list[str]:
    """Those that this machine lacks, sorted."""
    return sorted(name for name in names if CHECKS[name]() is None)


def needed(item: pytest.Item) -> set[str]:
    """What a test is marked with; the fixture ``browser`` needs Chromium."""
    names = {name for mark in item.iter_markers("needs") for name in mark.args}
    return names | {"chromium"} if "browser" in getattr(item, "fixturenames", ()) else names
