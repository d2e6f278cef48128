"""The examples are short, say what they show, and need nothing but the library; ``.ci/run`` runs
them all.
"""

import ast
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.py"))
ALLOWED = {"harpy_pin", "numpy", "pinocchio", "gymnasium", "mujoco"}


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_example_is_short_and_stands_alone(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 60
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    found = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    found |= {node.module or "." for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules = {name.split(".")[0] for name in found}
    assert modules <= ALLOWED | set(sys.stdlib_module_names)
    private = [
        part
        for name in found
        for part in name.split(".")
        if part.startswith("_") and part != "__future__"
    ]
    assert not private


def test_there_are_examples():
    assert len(EXAMPLES) >= 15
