"""A run of tests says for want of what it did not run some of them."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run(*options: str, path: Path) -> subprocess.CompletedProcess[str]:
    """The tests of exported folders, where no program is found."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-k",
        "printed_commands",
        "tests/project/test_folders.py",
        *options,
    ]
    known = {**os.environ, "PATH": str(path)}
    return subprocess.run(command, cwd=ROOT, env=known, capture_output=True, text=True, check=False)


def test_what_is_missing_is_named_and_counted(tmp_path: Path) -> None:
    done = run(path=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "tests not run for want of: cmake (1)" in done.stdout.splitlines()


def test_what_is_demanded_must_be_there(tmp_path: Path) -> None:
    done = run("--needing", "cmake", path=tmp_path)
    assert done.returncode != 0
    assert "--needing: no cmake on this machine" in done.stderr
