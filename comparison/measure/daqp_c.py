"""DAQP's own C on a microcontroller: its source comes from its package, and is built in a temporary folder."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from harpy_pin.export.exported_controllers import Exportable

FETCH = 120.0
"""Time for the download, s."""
TOLERANCE = 1e-7
"""Violation that it may leave, as our own search (:mod:`harpy_pin.wbc.active_set_warm_start`)."""
_SOLVER = Path(__file__).with_name("daqp_solver.c")


def daqp_source(place: Path) -> Path | None:
    """The folder with DAQP's C, of the version that is installed; None where it cannot be had."""
    try:
        desired = f"daqp=={version('daqp')}"
    except PackageNotFoundError:
        return None
    download = ["-m", "pip", "download", "--no-binary", "daqp", "--no-deps", "-q", "-d"]
    command = [sys.executable, *download, str(place), desired]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=FETCH)
        (archive,) = place.glob("daqp-*.tar.gz")
        with tarfile.open(archive) as packed:
            packed.extractall(place, filter="data")
    except (subprocess.SubprocessError, OSError, ValueError):
        return None
    folder = archive.with_name(archive.name.removesuffix(".tar.gz")) / "csrc"
    return folder if (folder / "src" / "api.c").exists() else None


def daqp_count(folder: Path, name: str, what: Exportable) -> None:
    """Make the program ``count`` of an exported folder, whose tick only builds the program, solve it by DAQP.

    In double precision: in single precision DAQP does not end on some of these programs, with none of the tolerances
    that were tried.
    """
    program = what.record.dtype["program"]
    sizes = {"VARIABLES": program["gradient"].shape[0], "ROWS": program["lower"].shape[0]}
    values = {**sizes, "TOLERANCE": TOLERANCE, "STATE": f"{name}_state"}
    defined = [f"#define {key} {value}" for key, value in values.items()]
    solver = "\n".join((*defined, _SOLVER.read_text("utf-8")))
    file = folder / "count.c"
    text = file.read_text(encoding="utf-8")
    text = text.replace("#define PAINT", f"{solver}\n#define PAINT")
    replay = f"    (void){name}_replay(state, n, command);\n"
    assert replay in text
    text = text.replace(replay, replay + "    failures += solve() < 0;\n")
    text = text.replace("static uint32_t since(", "static int failures;\n\nstatic uint32_t since(", 1)
    text = text.replace(
        f"    {name}_init(&state);\n",
        f"    {name}_init(&state);\n    (void){name}_replay(&state, 0, command);\n    set_up(&state);\n",
    )
    text = text.replace("    return 0;\n}", "    return failures > 0 ? 5 : 0;\n}")
    file.write_text(text, encoding="utf-8")
