"""Each record of a walk is written by the kernels of one file: read from their syntax trees."""

import ast
import inspect
import textwrap
from collections import defaultdict
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from harpy_pin.gaits import walking
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.kernels.kernels import Kernel

FOLDER = Path(walking.__file__).parent
PARTS = {name: str(kind) for name, kind in inspect.get_annotations(WalkingRecord).items()}
OWN = {f"{walking.__name__}.{path.stem}" for path in FOLDER.glob("*.py")}
WRITERS = {
    "measured": {"measuring"},
    "planned": {"path"},
    "steps": {"contacts"},
    "roll": {"rolling"},
    "footholds": {"footholds"},
    "swing": {"swinging"},
    "demand": {"demand"},
    "time": {"tick"},
}
"""The others are written by Python alone."""


@cache
def tree_of(kernel: Kernel[Any]) -> ast.FunctionDef:
    found = ast.parse(textwrap.dedent(inspect.getsource(kernel.py_func))).body[0]
    assert isinstance(found, ast.FunctionDef)
    return found


def pairs(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    """Targets and values of an assignment, one by one; a value of many parts with each target."""
    if not isinstance(target, ast.Tuple):
        return [(target, value)]
    same = isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts)
    values = value.elts if same and isinstance(value, ast.Tuple) else [value] * len(target.elts)
    return [pair for one in zip(target.elts, values, strict=True) for pair in pairs(*one)]


@cache
def written(kernel: Kernel[Any]) -> frozenset[tuple[str, str, str]]:
    """(argument, part of the walk or "", file) of all that a kernel writes, itself or by others."""
    tree, found = tree_of(kernel), set()
    names: dict[str, tuple[str, str]] = {}
    for argument in tree.args.args:
        kind = ast.unparse(argument.annotation) if argument.annotation else ""
        part = next((part for part, one in PARTS.items() if one == kind), "")
        names[argument.arg] = (argument.arg, "*" if kind == "WalkingRecord" else part)

    def place(node: ast.expr) -> tuple[str, str] | None:
        """Of which argument an expression is a view, and of which part of the walk."""
        if isinstance(node, ast.Name):
            return names.get(node.id)
        if isinstance(node, ast.Attribute | ast.Subscript):
            inside = place(node.value)
            if inside and inside[1] == "*" and isinstance(node, ast.Attribute):
                return inside[0], node.attr
            return inside
        return None

    def write(node: ast.expr) -> None:
        at = place(node)
        if at:
            found.add((*at, kernel.py_func.__module__))

    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target, value in (pair for one in targets for pair in pairs(one, node.value)):
                if isinstance(target, ast.Name):
                    view = place(value)
                    if view:
                        names[target.id] = view
                else:
                    write(target)
        elif isinstance(node, ast.AugAssign):
            write(node.target)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            called = vars(import_module(kernel.py_func.__module__)).get(node.func.id)
            if not isinstance(called, Kernel):
                continue
            given = dict(zip(inspect.signature(called.py_func).parameters, node.args, strict=False))
            for argument, part, file in written(called):
                at = place(given[argument])
                # A kernel of the walk that takes a record answers for it in its own file.
                if at and not (part and file in OWN):
                    found.add((*at, kernel.py_func.__module__))
    return frozenset(found)


def test_each_record_is_written_by_the_kernels_of_one_file():
    found: dict[str, set[str]] = defaultdict(set)
    for module in map(import_module, OWN):
        for kernel in vars(module).values():
            if isinstance(kernel, Kernel) and kernel.py_func.__module__ == module.__name__:
                for _, part, file in written(kernel):
                    if part:
                        found[part].add(file.rpartition(".")[2])
    assert found == WRITERS


def test_every_record_has_a_writer_or_none():
    assert set(PARTS) == {*WRITERS, "tuned", "build", "pace", "terrain"}
