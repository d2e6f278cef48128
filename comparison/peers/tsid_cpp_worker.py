"""Replays recorded states through TSID's C++ library; runs in a virtual environment of its own.

    python tsid_cpp_worker.py PROBLEM RESULT

The files are those of :mod:`comparison.peers.placo_worker`. TSID's C++ wheel runs where its Python bindings abort. The
program ``tsid_driver.cpp`` is compiled once against the headers of the wheels and kept in the environment.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

PACKAGES = ("libtsid", "libpinocchio", "eiquadprog")
SOURCE = Path(__file__).with_name("tsid_driver.cpp")
LIBRARIES = ("tsid", "pinocchio_default", "pinocchio_parsers", "eiquadprog", "boost_serialization", "urdfdom_model")
# What the wheels were built with, from their CMake files; without an architecture, as they are: Eigen's alignment of
# arrays depends on it.
FLAGS = (
    *("-O3", "-DNDEBUG", "-std=c++17", "-w"),
    *("-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS"),
    *("-DBOOST_FUSION_INVOKE_MAX_ARITY=12", "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", "-DPINOCCHIO_WITH_URDFDOM"),
    *(f"-DPINOCCHIO_URDFDOM_HEADERS_{part}_VERSION={n}" for part, n in (("MAJOR", 3), ("MINOR", 0), ("PATCH", 0))),
)
FOLDERS = ("", "pinocchio/deprecated", "eigen3", "urdfdom", "urdfdom_headers")


def compiled() -> Path:
    """The driver's program, compiled if its source has changed."""
    key = hashlib.sha256(SOURCE.read_bytes() + repr((FLAGS, LIBRARIES)).encode()).hexdigest()[:16]
    program = Path(sys.prefix) / f"tsid_driver_{key}"
    if program.exists():
        return program
    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        raise SystemExit("TSID's C++ needs a C++ compiler, and there is none")
    prefix = next(Path(folder) / "cmeel.prefix" for folder in sys.path if (Path(folder) / "cmeel.prefix").is_dir())
    library = prefix / "lib"
    include = [f"-I{prefix / 'include' / folder}" for folder in FOLDERS]
    link = [f"-L{library}", *(f"-l{name}" for name in LIBRARIES), f"-Wl,-rpath,{library}"]
    beside = program.with_suffix(f".{os.getpid()}")
    done = subprocess.run(
        [compiler, *FLAGS, *include, str(SOURCE), *link, "-o", str(beside)], capture_output=True, text=True
    )
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if "error" in line]
        raise SystemExit(f"its driver does not compile: {errors[0] if errors else done.stderr}")
    beside.replace(program)
    return program


def header(problem: dict[str, Any], given: bool) -> str:
    """Settings, as the driver reads them."""
    s = problem["settings"]
    w, g = s["weights"], s["gains"]
    weights = [w[name] for name in ("body", "orientation", "swing", "thrust", "force")]
    numbers = [s["mu"], *weights, g["contact"], *g["orientation"], *g["posture"]]
    lines = [s["urdf"], f"{s['base']} {len(problem['q'])} {s['repetitions']} {int(given)}"]
    lines.append(" ".join(repr(float(number)) for number in numbers))
    lines += [" ".join((str(len(names)), *names)) for names in (s["feet"], s["thrusters"])]
    return "\n".join(lines) + "\n"


def replay(program: Path, problem: dict[str, Any], given: bool, out: dict[str, Any]) -> None:
    """Pose one variant, and put its solutions and times among the results."""
    s, variant = problem["settings"], "given" if given else "decided"
    n, nv = problem["v"].shape
    joints, feet, thrusters, repetitions = nv - 6, len(s["feet"]), len(s["thrusters"]), s["repetitions"]
    arrays = [s["armature"], s["torque_limit"], s["posture"], s["posture_weights"]]
    arrays += [problem[name] for name in ("q", "v", "body", "feet", "held", "thrust", "damping_force")]
    with TemporaryDirectory() as scratch:
        settings, data, result = (Path(scratch) / name for name in ("header", "data", "result"))
        settings.write_text(header(problem, given))
        data.write_bytes(b"".join(np.ascontiguousarray(array, dtype=np.float64).tobytes() for array in arrays))
        done = subprocess.run([str(program), str(settings), str(data), str(result)], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"its driver ended with {done.returncode}: {done.stderr.strip()}")
        found = np.fromfile(result)
    row = nv + joints + 3 * (feet + thrusters)
    solutions, timed = np.split(found, [n * row])
    parts = np.split(solutions.reshape(n, row), np.cumsum([nv, joints, 3 * feet]), axis=1)
    tick, solve, _, torque = np.split(timed.reshape(repetitions, n * (3 + joints)), [n, 2 * n, 3 * n], axis=1)
    answers = {
        "acceleration": parts[0],
        "torque": torque[-1].reshape(n, joints),  # what was timed is what is checked
        "force": parts[2].reshape(n, feet, 3),
        "thrust": parts[3].reshape(n, thrusters, 3),
        "tick_ns": tick.astype(np.int64),
        "solve_ns": solve.astype(np.int64),
    }
    out |= {f"{variant}_{key}": value for key, value in answers.items()}


def main(problem_file: str, result_file: str) -> None:
    """Compile, solve, time and write both variants."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    problem["settings"] = json.loads(str(problem["settings"]))
    out: dict[str, Any] = {
        "versions": json.dumps({name: version(name) for name in PACKAGES}),
        "overhead_ns": 0.0,  # of std::chrono's clock: not subtracted
    }
    program = compiled()
    for given in (True, False):
        replay(program, problem, given, out)
    np.savez(result_file, **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
