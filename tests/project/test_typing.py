"""Scripts of users: they pass ``mypy --strict`` beside the installed package, without its sources,
and they run.
"""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "tests" / "scripts").glob("*.py"))
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def check(python: Path, folder: Path, *files: Path) -> subprocess.CompletedProcess[str]:
    """``mypy --strict`` as a user runs it: in a folder of one's own, without a configuration
    file.
    """
    copies = [folder / file.name for file in files]
    for copy, file in zip(copies, files, strict=True):
        copy.write_text(file.read_text())
    mypy = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--python-executable",
        str(python),
        "--cache-dir",
        os.devnull,
    ]
    return subprocess.run(
        [*mypy, *(copy.name for copy in copies)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
    )


def test_strict(installed: Path, tmp_path: Path) -> None:
    """``assert_type`` in the scripts refuses an ``Any`` where a public name should have a type."""
    wrong = tmp_path / "wrong" / "leak.py"
    wrong.parent.mkdir()
    wrong.write_text(
        "import harpy_pin as hp\n\nhp.walk(3)\nx: str = hp.load_harpy()\nhp.nonsense\n"
    )
    done = check(installed, tmp_path, *SCRIPTS, *EXAMPLES, wrong)
    lines = done.stdout.splitlines()
    assert [line.partition(": error: ")[0] for line in lines if ": error: " in line] == [
        f"leak.py:{number}" for number in (3, 4, 5)
    ], done.stdout
    assert "installed, but missing library stubs" not in done.stdout


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_runs(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")
