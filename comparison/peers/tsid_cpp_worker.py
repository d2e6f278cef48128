"""Replays recorded states through TSID's C++ library; runs in a virtual environment of its own.

    python tsid_cpp_worker.py PROBLEM RESULT

The files are those of :mod:`comparison.peers.placo_worker`. TSID's C++ wheel runs where its Python
bindings abort. The program ``tsid_driver.cpp`` is compiled once against the headers of the wheels
and kept in the environment.
"""

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
LIBRARIES = (
    "tsid",
    "pinocchio_default",
    "pinocchio_parsers",
    "eiquadprog",
    "boost_serialization",
    "urdfdom_model",
)
# What the wheels were built with, from their CMake files; without an architecture, as they are:
# Eigen's alignment of
# arrays depends on it.
FLAGS = (
    *("-O3", "-DNDEBUG", "-std=c++17", "-w"),
    *(
        "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
        "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
        "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    ),
    *(
        "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
        "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
        "-DPINOCCHIO_WITH_URDFDOM",
    ),
    *(
        f"-DPINOCCHIO_URDFDOM_HEADERS_{part}_VERSION={n}"
        for part, n in (("MAJOR", 3), ("MINOR", 0), ("PATCH", 0))
    ),
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
    prefix = next(
        Path(folder) / "cmeel.prefix"
        for folder in sys.path
        if (Path(folder) / "cmeel.prefix").is_dir()
    )
    library = prefix / "lib"
    include = [f"-I{prefix / 'include' / folder}" for folder in FOLDERS]
    link = [f"-L{library}", *(f"-l{name}" for name in LIBRARIES), f"-Wl,-rpath,{library}"]
    beside = program.with_suffix(f".{os.getpid()}")
    done = subprocess.run(
        [compiler, *FLAGS, *include, str(SOURCE), *link, "-o", str(beside)],
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if "error" in line]
        raise SystemExit(f"its driver does not compile: {errors[0] if errors else done.stderr}")
    beside.replace(program)
    return program


SCALARS = ("body", "orientation", "swing", "thrust", "force")
ARRAYS = (
    "q",
    "v",
    "body",
    "orientation",
    "feet",
    "joints",
    "brake",
    "held",
    "loaded",
    "sole",
    "resistance",
)
"""What is handed over tick by tick, in the driver's order."""


def header(problem: dict[str, Any]) -> str:
    """Settings, as the driver reads them."""
    s = problem["settings"]
    numbers = [s["mu"], *(s["weights"][name] for name in SCALARS)]
    lines = [s["urdf"], f"{s['base']} {len(problem['q'])} {s['repetitions']} {int(s['centred'])}"]
    lines.append(" ".join(repr(float(number)) for number in numbers))
    lines += [
        " ".join((str(len(names)), *names)) for names in (s["contacts"], s["thrusters"], s["soles"])
    ]
    return "\n".join(lines) + "\n"


def replay(program: Path, problem: dict[str, Any]) -> dict[str, Any]:
    """Solutions of all states, and the times of every repetition."""
    s = problem["settings"]
    n, nv = problem["v"].shape
    joints, points, thrusters, repetitions = (
        nv - 6,
        len(s["contacts"]),
        len(s["thrusters"]),
        s["repetitions"],
    )
    arrays = [
        s["armature"],
        s["torque_limit"],
        s["joint_weights"],
        s["corners"],
        *(problem[name] for name in ARRAYS),
    ]
    with TemporaryDirectory() as scratch:
        settings, data, result = (Path(scratch) / name for name in ("header", "data", "result"))
        settings.write_text(header(problem))
        data.write_bytes(
            b"".join(np.ascontiguousarray(array, dtype=np.float64).tobytes() for array in arrays)
        )
        done = subprocess.run(
            [str(program), str(settings), str(data), str(result)], capture_output=True, text=True
        )
        if done.returncode != 0:
            raise SystemExit(f"its driver ended with {done.returncode}: {done.stderr.strip()}")
        found = np.fromfile(result)
    row = nv + joints + 3 * (points + thrusters)
    solutions, timed = np.split(found, [n * row])
    acceleration, _, force, thrust = np.split(
        solutions.reshape(n, row), np.cumsum([nv, joints, 3 * points]), axis=1
    )
    tick, torque = np.split(timed.reshape(repetitions, n * (1 + joints)), [n], axis=1)
    return {
        "acceleration": acceleration,
        "torque": torque[-1].reshape(n, joints),  # what was timed is what is checked
        "force": force.reshape(n, points, 3),
        "thrust": thrust.reshape(n, thrusters, 3),
        "inside_ns": tick.astype(np.int64),
    }


def main(problem_file: str, result_file: str) -> None:
    """Compile, solve and time, and write the answer."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    problem["settings"] = json.loads(str(problem["settings"]))
    versions = {name: version(name) for name in PACKAGES} | {"compiled with": " ".join(FLAGS[:2])}
    out = replay(compiled(), problem)
    # The overhead of std::chrono's clock is not subtracted.
    np.savez(result_file, versions=json.dumps(versions), overhead_ns=0.0, **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
