"""``harpy compile``: what it makes, what it says, and what it removes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from needs import needs_compiler

ROOT = Path(__file__).resolve().parents[2]
pytestmark = needs_compiler


def run(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "harpy_pin", *arguments]
    environment = {**os.environ, "HARPY_PIN_CACHE": str(folder), "COLUMNS": "200"}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )


QP = ("--set", "controller=wbc")


def libraries(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("*.so")}


@pytest.mark.long
def test_what_is_compiled_ahead_is_not_compiled_again(tmp_path: Path) -> None:
    made = run("compile", folder=tmp_path)
    assert made.returncode == 0, made.stderr
    *parts, summary, _ = made.stdout.splitlines()  # at the end stands the next command
    names = {line.partition(":")[0] for line in parts}
    assert {
        "harpy, condensed controller, gait 'hand'",
        "harpy, whole-body QP, ProxQP, gait 'hand'",
        "harpy, whole-body QP, own search, gait 'hand'",
        "harpy, governor 'filter'",
    } <= names
    assert str(tmp_path) in summary
    before = libraries(tmp_path)
    assert int(summary.split()[0]) == len(before)
    for options in (
        [],
        [*QP],
        [*QP, "--set", "controller.solver=active_set"],
        ["--set", "controller=governed"],
    ):
        assert run("walk", "--duration", "0.01", *options, folder=tmp_path).returncode == 0
    assert libraries(tmp_path) == before
    assert run("compile", folder=tmp_path).stdout.splitlines()[-2].startswith("0 libraries")


def test_clear_removes_libraries_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "other.so").write_text("mine")
    assert run("compile", "--clear", folder=tmp_path).returncode == 0
    assert {path.name for path in tmp_path.iterdir() if not path.name.startswith("bridge-")} == {
        "notes.txt",
        "other.so",
    }


def test_an_unknown_robot_is_refused_before_anything_is_compiled(tmp_path: Path) -> None:
    refused = run("compile", "harpyy", folder=tmp_path)
    assert refused.returncode == 2
    assert "valid names" in refused.stderr
    assert all(name.startswith("bridge-") for name in libraries(tmp_path))
