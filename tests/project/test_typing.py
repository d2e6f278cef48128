"""Scripts of users: they pass ``mypy --strict`` beside the installed package, without its sources, and they run."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "tests" / "scripts").glob("*.py"))
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment that has the wheel, and everything else from the environment of the tests."""
    environment = tmp_path_factory.mktemp("typed")
    venv.create(environment, symlinks=True)
    python = environment / "bin" / "python"
    ask = [str(python), "-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"]
    packages = Path(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip())
    zipfile.ZipFile(wheel).extractall(packages)
    (packages / "others.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return python


def check(python: Path, folder: Path, *files: Path) -> subprocess.CompletedProcess[str]:
    """``mypy --strict`` as a user runs it: in a folder of one's own, without a configuration file."""
    copies = [folder / file.name for file in files]
    for copy, file in zip(copies, files, strict=True):
        copy.write_text(file.read_text())
    mypy = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(python), "--cache-dir", os.devnull]
    return subprocess.run(
        [*mypy, *(copy.name for copy in copies)], cwd=folder, capture_output=True, text=True, timeout=600
    )


def test_strict(python: Path, tmp_path: Path) -> None:
    """``assert_type`` in the scripts refuses an ``Any`` where a public name should have a type."""
    wrong = tmp_path / "wrong" / "leak.py"
    wrong.parent.mkdir()
    wrong.write_text("import harpy_pin as hp\n\nhp.walk(3)\nx: str = hp.load_harpy()\nhp.nonsense\n")
    done = check(python, tmp_path, *SCRIPTS, *EXAMPLES, wrong)
    lines = done.stdout.splitlines()
    assert [line.partition(": error: ")[0] for line in lines if ": error: " in line] == [
        f"leak.py:{number}" for number in (3, 4, 5)
    ], done.stdout
    assert "installed, but missing library stubs" not in done.stdout


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_runs(script: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
