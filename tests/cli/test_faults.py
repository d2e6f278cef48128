"""The command in odd places: what its output may do to it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = "from harpy_pin.cli.ending import one_line_errors\nwith one_line_errors('harpy', 2):\n"


def python(*arguments, stdout=subprocess.PIPE, **environment):
    return subprocess.run(
        [sys.executable, *arguments],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, **environment},
        check=False,
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("module", "argument", "code", "says"),
    [
        ("harpy_pin", "info", 2, "harpy"),
        ("harpy_pin", "--help", 2, "harpy"),
        ("comparison", "--help", 1, "error"),
    ],
)
def test_full_output_is_one_line(module, argument, code, says):
    with open("/dev/full", "w") as full:
        done = python("-m", module, argument, stdout=full)
    assert done.returncode == code
    assert done.stderr == f"{says}: cannot write the output: No space left on device\n"


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
        {"TERM": "dumb"},
    ],
    ids=str,
)
@pytest.mark.parametrize("arguments", [("info",), ("info", "--robot", "no·where")], ids=str)
def test_output_of_any_encoding(environment, arguments):
    done = python("-m", "harpy_pin", *arguments, **environment)
    assert done.returncode == (2 if "--robot" in arguments else 0)
    assert "Traceback" not in done.stderr
    assert ("left_hip_frontal" in done.stdout) == (arguments == ("info",))


def test_closed_pipe_is_silent():
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as pipe:
        done = python("-m", "harpy_pin", "info", stdout=pipe)
    assert done.stderr == ""


def test_other_errors_keep_their_traceback():
    done = python("-c", PROGRAM + "    raise KeyError('ours')\n", PYTHONPATH=str(ROOT))
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    done = python("-c", PROGRAM + "    open('/nowhere/file')\n", PYTHONPATH=str(ROOT))
    assert "Traceback" in done.stderr
    assert "standard output" not in done.stderr


def test_names_with_brackets_are_shown(tmp_path):
    text = (ROOT / "urdf" / "harpy.urdf").read_text()
    path = tmp_path / "markup.urdf"
    path.write_text(
        text.replace('name="harpy"', 'name="[/red]"').replace("left_knee", "[bold]knee")
    )
    done = python("-m", "harpy_pin", "info", "--robot", str(path), "--feet", "left_foot,right_foot")
    assert done.returncode == 0, done.stderr
    assert "[/red]: 4.020 kg" in done.stdout
    assert "[bold]knee" in done.stdout
