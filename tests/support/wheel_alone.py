"""Builds the wheel with kernels, installs it where no C compiler is found, and prints sizes, first
ticks and ticks.

    python tests/support/wheel_alone.py [ROBOT]...

By default for Harpy and all robots of the catalogue. The environment is made from nothing.
"""

import json
import os
import subprocess
import sys
import sysconfig
import tempfile
import venv
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
EVERY_PART = Path(__file__).with_name("every_part.py")
WALK = """
from time import perf_counter, perf_counter_ns, process_time
begin = perf_counter()
import copy, json, statistics, sys
import harpy_pin as hp
from harpy_pin.kernels import compiler, library_files
scenario = dict(robot=sys.argv[1], controller="wbc" if sys.argv[1] == "solo8" else "condensed")
hp.walk(hp.Scenario(**scenario, duration=0.001))
told = {"wall": perf_counter() - begin, "cpu": process_time(), "file": hp.__file__}
walk, states, laps = hp.build(hp.Scenario(**scenario, duration=0.5)), [], []
run = walk.run(on_tick=lambda state: states.append(copy.deepcopy(state)))
for state in states * 9:
    begin = perf_counter_ns()
    walk.controller.step(state)
    laps.append(perf_counter_ns() - begin)
told |= {"tick": statistics.median(laps) / 1e3, "ending": run.ending, "q": run["q"].tobytes().hex()}
print(json.dumps(told | {"kernels": [compiler.compiler() is None, len(library_files.MADE)]}))
"""
"""Seconds from import to the end of the first tick, by the clock and of the processor; a tick, µs;
a walk.
"""


def build(folder: Path, robots: list[str]) -> Path:
    """The wheel with kernels of these robots."""
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(folder),
        str(ROOT),
    ]
    known = {"HATCH_BUILD_HOOK_ENABLE_CUSTOM": "1", "HARPY_PIN_WHEEL_ROBOTS": " ".join(robots)}
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, **known})
    (wheel,) = folder.glob("*.whl")
    return wheel


def install(wheel: Path, environment: Path, *, shared: bool, ziglang: bool = False) -> Path:
    """The Python of an environment with the wheel; ``shared`` has its dependencies from this
    environment.
    """
    venv.create(environment)
    python = environment / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", str(wheel)]
    pip += (
        ["--no-deps"]
        if shared
        else ["-c", str(ROOT / "constraints.txt"), "example-robot-data", "mujoco", "gymnasium"]
    )
    subprocess.run(pip, check=True)
    if shared:
        (packages,) = environment.glob("lib/python*/site-packages")
        here, hidden = (
            sysconfig.get_path("purelib"),
            "" if ziglang else "import sys; sys.modules['ziglang'] = None",
        )
        (packages / "shared.pth").write_text(f"import site; site.addsitedir({here!r})\n{hidden}\n")
    return python


def run(python: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python where no program is found, in an empty folder with nothing in any cache."""
    with tempfile.TemporaryDirectory() as folder:
        known = {"HOME": folder, "PATH": folder, "OPENBLAS_NUM_THREADS": "1"}
        return subprocess.run(
            [python, *arguments], cwd=folder, env=known, capture_output=True, text=True
        )


def walk(python: Path, robot: str) -> dict[str, Any]:
    """What :data:`WALK` tells of a robot."""
    done = run(python, "-c", WALK, robot)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def walk_compiled(robot: str) -> dict[str, Any]:
    """The same of this checkout, with kernels compiled for this processor."""
    known = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", WALK, robot], env=known, stdout=subprocess.PIPE, check=True
    )
    return dict(json.loads(done.stdout))


if __name__ == "__main__":
    from harpy_pin.model.catalogue import CATALOGUE

    with tempfile.TemporaryDirectory() as folder:
        wheel = build(Path(folder), sys.argv[1:])
        made = [file for file in zipfile.ZipFile(wheel).infolist() if file.filename.endswith(".so")]
        sizes = (wheel.stat().st_size, sum(file.compress_size for file in made))
        print(
            f"{wheel.name}: {sizes[0] / 1e6:.1f} MB, of it {len(made)} libraries: "
            f"{sizes[1] / 1e6:.1f} MB"
        )
        python = install(wheel, Path(folder) / "environment", shared=False)
        for robot in sys.argv[1:] or ("harpy", *CATALOGUE):
            pairs = [(walk(python, robot), walk_compiled(robot)) for _ in range(3)]
            wall, cpu, tick = (
                min(ours[name] for ours, _ in pairs) for name in ("wall", "cpu", "tick")
            )
            compiled = min(theirs["tick"] for _, theirs in pairs)
            print(f"{robot}: first tick after {wall:.2f} s, {cpu:.2f} s of the processor", end="; ")
            print(f"a tick {tick:.2f} µs, compiled for this processor {compiled:.2f} µs")
            print(run(python, str(EVERY_PART), robot).stdout, end="")
