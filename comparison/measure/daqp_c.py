"""DAQP's own C on a microcontroller: its source comes from its package, and is kept in the user's
cache.
"""

from __future__ import annotations

import subprocess
import sys
import tarfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory

from harpy_pin.export.exported_controllers import Exportable

FETCH = 120.0
"""Time for the download, s."""
TOLERANCE = 1e-7
"""Violation that it may leave, as our own search (:mod:`harpy_pin.wbc.active_set_warm_start`)."""
_SOLVER = Path(__file__).with_name("daqp_solver.c")


def daqp_source(place: Path) -> Path | None:
    """The folder with DAQP's C, of the version that is installed, kept in ``place``; None where it
    cannot be had.
    """
    try:
        name = f"daqp-{version('daqp')}"
    except PackageNotFoundError:
        return None
    kept = place / name / "csrc"
    if not (kept / "src" / "api.c").exists():
        download = ["-m", "pip", "download", "--no-binary", "daqp", "--no-deps", "-q", "-d"]
        try:
            place.mkdir(parents=True, exist_ok=True)
            with TemporaryDirectory(dir=place) as new:
                command = [sys.executable, *download, new, name.replace("-", "==")]
                subprocess.run(command, check=True, capture_output=True, timeout=FETCH)
                with tarfile.open(Path(new) / f"{name}.tar.gz") as packed:
                    packed.extractall(new, filter="data")
                (Path(new) / name).replace(place / name)
        except (subprocess.SubprocessError, OSError, tarfile.TarError):
            pass  # another process may have been quicker
    return kept if (kept / "src" / "api.c").exists() else None


def daqp_count(folder: Path, name: str, what: Exportable) -> None:
    """Make the program ``count`` of an exported folder, whose tick only builds the program, solve
    it by DAQP.

    In double precision: in single precision DAQP does not end on some of these programs, with none
    of the tolerances that were tried.
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
    text = text.replace(
        "static uint32_t since(", "static int failures;\n\nstatic uint32_t since(", 1
    )
    text = text.replace(
        f"    {name}_init(&state);\n",
        f"    {name}_init(&state);\n    (void){name}_replay(&state, 0, command);\n    "
        f"set_up(&state);\n",
    )
    text = text.replace("    return 0;\n}", "    return failures > 0 ? 5 : 0;\n}")
    file.write_text(text, encoding="utf-8")
