"""The source of a kernel, and what its names stand for."""

from __future__ import annotations

import ast
import builtins
import gc
import hashlib
import inspect
import linecache
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from harpy_pin.errors import KernelError


def kernel_of(value: Any) -> Any:
    """The Python function of a kernel, or None for anything else."""
    return getattr(value, "py_func", None)


class Source:
    """A kernel's function as a tree: its definition, its arguments in order, with defaults, and its
    first paragraph.

    A :class:`KernelError` says that there is no source to read.
    """

    def __init__(self, function: FunctionType) -> None:
        self.name = function.__name__
        self._function = function
        self._file = function.__code__.co_filename
        self.file = f"{function.__module__.replace('.', '/')}.py"
        self.tree = _definition(function)
        signature = inspect.signature(function)
        self.parameters = list(signature.parameters)
        self.defaults = {
            name: parameter.default
            for name, parameter in signature.parameters.items()
            if parameter.default is not parameter.empty
        }
        self.docstring = (inspect.getdoc(function) or "").split("\n\n")[0]

    def lookup(self, name: str) -> Any:
        """What a name of the kernel's module, or of Python, stands for."""
        found = _globals(self._function).get(name, getattr(builtins, name, None))
        if found is None:
            raise self.error(self.tree, f"there is no '{name}'")
        return found

    def error(self, node: ast.stmt, reason: str) -> KernelError:
        """An error at a statement."""
        return KernelError(f"{self._file}:{node.lineno}: {self.name}: {reason}")


def _definition(function: FunctionType) -> ast.FunctionDef:
    """The definition of a function, in the tree of its file."""
    code = function.__code__
    with suppress(SyntaxError):
        if code.co_firstlineno in (found := _definitions("".join(_LINES[function]))):
            return found[code.co_firstlineno]
    reason = "its source cannot be read: a kernel stands in a file, or in a cell of a notebook"
    raise KernelError(f"{code.co_filename}:{code.co_firstlineno}: {function.__name__}: {reason}")


@cache
def _definitions(text: str) -> dict[int, ast.FunctionDef]:
    """Functions in a file by their first lines, which are those of decorators.

    Garbage is not collected meanwhile: what it runs may let another thread parse, and Python's
    parser takes no two.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        nodes: list[ast.AST] = [ast.parse(text)]
        for node in nodes:
            nodes += [part for part in ast.iter_child_nodes(node) if not isinstance(part, ast.expr)]
    finally:
        if collects:
            gc.enable()
    found = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    return {
        min([node.lineno, *(one.lineno for one in node.decorator_list)]): node for node in found
    }


_LINES: WeakKeyDictionary[FunctionType, list[str]] = WeakKeyDictionary()


def remember(function: FunctionType) -> None:
    """Keep the file of a kernel as it is when it is loaded: later it may be another one than what
    runs.
    """
    file = function.__code__.co_filename
    linecache.checkcache(file)
    _LINES[function] = linecache.getlines(file, function.__globals__)


def _globals(function: FunctionType) -> dict[str, Any]:
    """Names of the function's module, and of the functions around it."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return {**function.__globals__, **{name: cell.cell_contents for name, cell in cells}}


@cache
def source_of(function: FunctionType) -> Source:
    """The source of a kernel's function, read once."""
    return Source(function)


def fingerprint(function: FunctionType, *, portable: bool = False) -> bytes:
    """What decides the code of a kernel and of those it may call: instructions, and the numbers
    that they name.

    A portable one has files in the place of instructions, of which every version of Python has its
    own.
    """
    seen: dict[FunctionType, bytes] = {}
    waiting = [function]
    while waiting:
        one = waiting.pop()
        if one not in seen:
            seen[one], called = _own_fingerprint(one, portable)
            waiting.extend(called)
    return b"".join(sorted(seen.values()))


@cache
def _digest(file: str) -> str:
    with suppress(OSError):  # a kernel that was typed in has no file
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return ""


@cache
def _own_fingerprint(
    function: FunctionType, portable: bool = False
) -> tuple[bytes, tuple[FunctionType, ...]]:
    code, known = function.__code__, _globals(function)
    called: list[FunctionType] = []
    named: list[str] = []
    for name in (*code.co_names, *code.co_freevars):
        value = known.get(name)
        for part in value if isinstance(value, tuple) else (value,):
            kernel = kernel_of(part)
            if kernel is not None:
                called.append(kernel)
                named.append(f"{name}→{kernel.__module__}.{kernel.__qualname__}")
        if isinstance(value, int | float | tuple | np.number):
            named.append(f"{name}={value!r}")
    lines = [line for _, _, line in code.co_lines()]  # debuggers show them
    own = _digest(code.co_filename) if portable else f"{_described(code)}{lines}"
    text = f"{function.__qualname__}{own}{function.__defaults__!r}{named!r}"
    return text.encode(), tuple(called)


def _described(code: CodeType) -> str:
    """A code object as text, without the places of its lines."""
    constants = [_described(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return f"{code.co_code.hex()}{constants}{code.co_names}{code.co_varnames}"
