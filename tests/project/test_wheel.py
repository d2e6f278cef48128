"""The wheel, installed in an environment of its own, walks in an empty folder."""

import json
import subprocess
import zipfile
from pathlib import Path

import pytest
import wheel_alone
from needs import needs_compiler, needs_robots


def test_wheel_walks_in_an_empty_folder(wheel: Path, installed: Path, tmp_path: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    others = (
        "urdf/harpy.urdf",
        "py.typed",
        "__init__.pyi",
        "examples/first_walk.py",
        "tutorials/robot_dog.ipynb",
    )
    page = (
        "page.html",
        "page.css",
        "player.js",
        "uPlot.iife.min.js",
        "uPlot.min.css",
        "uPlot-LICENSE.txt",
    )
    assert {
        f"harpy_pin/{n}" for n in (*others, *(f"view/page/assets/{name}" for name in page))
    } <= set(names)
    foreign, compiled = ("tests", "comparison", "reproduction"), (".nbi", ".nbc", ".pyc")
    assert not [n for n in names if n.startswith(foreign) or n.endswith(compiled)]

    def run(*command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)

    harpy, environment = str(installed.parent / "harpy"), installed.parents[1]
    walked = run(harpy, "walk", "--duration", "0.5", "--save", "a.npz", "--json", "a.json")
    assert walked.returncode == 0, walked.stderr
    assert json.loads((tmp_path / "a.json").read_text())["ending"] == "completed"
    shown = run(harpy, "view", "a.npz", "--html", "a.html")
    assert shown.returncode == 0, shown.stderr
    told = dict(
        line.split(": ", 1)
        for line in run(harpy, "info").stdout.splitlines()
        if line.startswith(("tu", "ex"))
    )
    assert Path(told["examples"]).is_relative_to(environment)
    assert (Path(told["examples"]) / "first_walk.py").is_file()
    assert (Path(told["tutorials"]) / "robot_dog.ipynb").is_file()
    where = run(str(installed), "-c", "import harpy_pin.model.loading as r; print(r.harpy_urdf())")
    assert Path(where.stdout.strip()).is_relative_to(environment)


@pytest.mark.long
@needs_robots
@needs_compiler
def test_kernels_in_the_wheel_walk_without_a_compiler(tmp_path: Path) -> None:
    """At once, and with the same digits as kernels compiled for this processor; other robots are
    refused in a line.
    """
    wheel = wheel_alone.build(tmp_path, ["harpy", "go2"])
    assert "-py311.py312.py313-none-" in wheel.name
    assert not wheel.name.endswith("-any.whl")
    python = wheel_alone.install(wheel, tmp_path / "environment", shared=True)
    for robot in ("harpy", "go2"):
        told, compiled = wheel_alone.walk(python, robot), wheel_alone.walk_compiled(robot)
        assert told["kernels"] == [True, 0]
        assert Path(told["file"]).is_relative_to(tmp_path)
        assert told["cpu"] < 1.5  # s, with Python's start and all imports
        assert told["ending"] == "completed"
        assert told["q"] == compiled["q"]
        parts = wheel_alone.run(python, str(wheel_alone.EVERY_PART), robot)
        assert parts.returncode == 0, parts.stdout + parts.stderr
        assert "bridge: done" in parts.stdout or robot == "harpy"
    refused = wheel_alone.run(
        python, "-m", "harpy_pin", "walk", "--robot", "iris", "--duration", "0.1"
    )
    assert refused.stderr.count("\n") == 1
    assert "is not in the wheel, and there is no C compiler" in refused.stderr
    (bridge,) = (tmp_path / "environment").rglob("bridge-*.so")
    bridge.write_bytes(bridge.read_bytes()[:-1])
    damaged = wheel_alone.run(python, "-m", "harpy_pin", "walk", "--duration", "0.1")
    assert "the kernel 'bridge'" in damaged.stderr
    assert "is not in the wheel, and there is no C compiler: install gcc" in damaged.stderr
