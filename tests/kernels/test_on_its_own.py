"""The language of kernels on its own feet: it knows no robots, and whoever describes one does
without it.
"""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from needs import needs_robots

import harpy_pin.kernels

FOLDER = Path(harpy_pin.kernels.__file__).parent


def test_it_knows_nothing_of_robots():
    """Of the package it uses the kinds of errors, and nothing else."""
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or "."] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            others = {
                name
                for name in names
                if name.startswith((".", "harpy_pin")) and "harpy_pin.kernels" not in name
            }
            assert others <= {"harpy_pin.errors"}, path.name


def test_no_circle_of_files():
    """Not even for the sake of types."""
    nodes = {path.stem: ast.walk(ast.parse(path.read_text())) for path in FOLDER.glob("*.py")}
    graph = {
        name: {
            own
            for node in found
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
            for own in (f"{node.module}.{alias.name}".split(".")[2:])
            if own in nodes
        }
        for name, found in nodes.items()
    }
    assert graph["functions"] >= {"statements", "unit"}
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize(
    "load", ["load_harpy()", pytest.param("load_robot('go2')", marks=needs_robots)]
)
def test_a_robot_is_loaded_without_it(load):
    """A robot of a URDF takes at most twelve files besides those of packages."""
    script = f"""
import sys, harpy_pin as hp
hp.{load}
print(*(name for name, module in sys.modules.items() if name.startswith("harpy_pin.")
    and not hasattr(module, "__path__")))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    files = done.stdout.split()
    assert len(files) <= 12, files
    assert "harpy_pin.model.robot" in files
    assert not any(name.startswith("harpy_pin.kernels") for name in files)


def test_nothing_is_compiled_at_import(tmp_path):
    """Not even what calls go through; the walk of a robot is importable where no compiler is."""
    script = """
import sys
sys.modules["ziglang"] = None
import harpy_pin.scenario, harpy_pin.controllers.condensed
import harpy_pin.simulation.mujoco, harpy_pin.contrib.gym
from harpy_pin.kernels import compiler, library_files
assert compiler.compiler() is None and not library_files.MADE
"""
    environment = {
        "PATH": str(tmp_path),
        "HOME": str(tmp_path),
        "PYTHONPATH": str(FOLDER.parents[1]),
    }
    subprocess.run([sys.executable, "-c", script], env=environment, check=True, cwd=tmp_path)
