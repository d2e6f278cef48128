"""A wheel for one platform, with the kernels compiled that robots of the catalogue need.

    HATCH_BUILD_HOOK_ENABLE_CUSTOM=1 python -m build --wheel

Without the variable the wheel is for every platform and has no libraries.
``$HARPY_PIN_WHEEL_ROBOTS``, names with spaces between them, chooses robots.
"""

import os
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

TRIED = "py311.py312.py313"
"""Versions of Python that the kernels' tests were run with; pip gives the wheel to later ones,
too.
"""
COMPILE = """
import runpy, sys
from harpy_pin.cli.compile import compile_ahead
from harpy_pin.model.catalogue import CATALOGUE
robots = sys.argv[1:] or ["harpy", *CATALOGUE]
compile_ahead(robots)
sys.exit(not runpy.run_path("tests/support/every_part.py")["use_all"](robots))
"""


class WheelWithKernels(BuildHookInterface[Any]):
    """Compiles before the wheel is packed, with the library itself, in a folder that is gone
    afterwards.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and say what the wheel holds besides Python."""
        if version == "editable":
            return
        self.work = tempfile.TemporaryDirectory()
        known = {
            "PYTHONPATH": self.root,
            "HARPY_PIN_CACHE": self.work.name,
            "HARPY_PIN_FOR_A_WHEEL": "1",
        }
        robots = os.environ.get("HARPY_PIN_WHEEL_ROBOTS", "").split()
        command = [sys.executable, "-c", COMPILE, *robots]
        subprocess.run(command, env={**os.environ, **known}, check=True, cwd=self.root)
        made = sorted(Path(self.work.name).glob("*.so"))
        build_data["force_include"] |= {
            str(path): f"harpy_pin/kernels/libraries/{path.name}" for path in made
        }
        build_data["pure_python"] = False
        build_data["tag"] = (
            f"{TRIED}-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
        )

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the folder."""
        if version != "editable":
            self.work.cleanup()
