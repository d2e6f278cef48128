"""Calls of compiled kernels, repeated in plain Python on copies of their arguments and compared in
every bit.

Three things are not Python's own on that side, because they are not C's either: functions of
mathematics come from C's library (NumPy has others for sine or exponential, which differ in the
last digit), ``x ** 2`` to ``x ** 4`` are products (Python calls ``pow``), and sums go from the
first term to the last (NumPy leaves the order open).
"""

import ast
import ctypes
import ctypes.util
import inspect
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

import numpy as np
from hypothesis import strategies as st

from harpy_pin.kernels import Kernel
from harpy_pin.kernels.numbers import MATHEMATICS, OF_TWO
from harpy_pin.kernels.source import _globals

REALS = st.floats(-1e6, 1e6) | st.sampled_from(
    [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e-300, 1e300]
)
"""Numbers of all kinds."""
LIBRARY = ctypes.CDLL(ctypes.util.find_library("m"))
LONGEST = 20
"""Ticks of a call that is repeated in Python at most."""
POWERS = {2: lambda x: x * x, 3: lambda x: x * (x * x), 4: lambda x: (x * x) * (x * x)}


def four(*numbers: float) -> Any:
    """An array of four numbers."""
    return np.array(numbers or (1.0, 2.0, 3.0, 4.0))


def of_library(name: str, count: int) -> Callable[..., Any]:
    """A function of C's library, for each element of arrays."""
    function = getattr(LIBRARY, name)
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * count
    of_arrays = np.vectorize(function, otypes=[float])

    def call(*values: Any) -> Any:
        return of_arrays(*values) if any(map(np.ndim, values)) else np.float64(function(*values))

    return call


def product(a: Any, b: Any) -> Any:
    """``a @ b`` with sums from the first term to the last, which NumPy leaves open."""
    if b.shape[0] == 0:
        return np.zeros(a.shape[:-1] + b.shape[1:])[()]
    total = np.multiply.outer(a[..., 0], b[0])
    for k in range(1, b.shape[0]):
        total = total + np.multiply.outer(a[..., k], b[k])
    return total


def total(values: Any, axis: int = 0) -> Any:
    """``np.sum`` along an axis, from the first to the last."""
    values = np.moveaxis(values, axis, 0)
    return product(np.ones(len(values), np.int64), values)


NAMES: dict[str, Any] = {
    f"_{function.__name__}": of_library(name, 2 if function in OF_TWO else 1)
    for function, name in MATHEMATICS.items()
}
NAMES |= {f"_power_{n}": power for n, power in POWERS.items()} | {"_dot": product, "_sum": total}


class _AsInC(ast.NodeTransformer):
    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and node.value.id == "np" and f"_{node.attr}" in NAMES:
            return ast.copy_location(ast.Name(f"_{node.attr}", ast.Load()), node)
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        power = (
            node.right.value
            if isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant)
            else None
        )
        if isinstance(power, int) and power in POWERS:
            name = ast.Name(f"_power_{power}", ast.Load())
            return ast.copy_location(ast.Call(name, [node.left], []), node)
        if isinstance(node.op, ast.MatMult):
            return ast.copy_location(
                ast.Call(ast.Name("_dot", ast.Load()), [node.left, node.right], []), node
            )
        return node


class _Names(dict[str, Any]):
    """Names of a kernel's module; its kernels are those of this file."""

    def __init__(self, known: dict[str, Any]) -> None:
        super().__init__(
            {name: value for name, value in known.items() if not isinstance(value, Kernel)}
        )
        self._known = known

    def __missing__(self, name: str) -> Any:
        if name in NAMES:
            return NAMES[name]
        value = self._known[name]
        return plain(value) if isinstance(value, Kernel) else value


def plain(kernel: Kernel) -> FunctionType:
    """A kernel as plain Python."""
    function = kernel.__dict__.get("_as_in_c")
    if function is None:
        lines, first = inspect.getsourcelines(kernel.py_func)
        tree = ast.parse(textwrap.dedent("".join(lines)))
        (definition,) = tree.body
        definition.decorator_list, definition.returns = [], None  # type: ignore[attr-defined]
        for argument in definition.args.args:  # type: ignore[attr-defined]
            argument.annotation = None
        tree = ast.increment_lineno(ast.fix_missing_locations(_AsInC().visit(tree)), first - 1)
        names, made = _Names(_globals(kernel.py_func)), {}
        exec(compile(tree, kernel.py_func.__code__.co_filename, "exec"), names, made)
        (function,) = made.values()
        function.__defaults__ = kernel.py_func.__defaults__
        kernel.__dict__["_as_in_c"] = function
    return function


def as_given(value: Any) -> Any:
    """An argument as plain Python takes it: fields of a record are attributes."""
    if isinstance(value, tuple):
        return tuple(map(as_given, value))
    if isinstance(value, np.void):
        return np.asarray(value).view(np.recarray)[()]
    if isinstance(value, np.ndarray) and value.dtype.names:
        return value.view(np.recarray)[()] if value.ndim == 0 else value.view(np.recarray)
    return plain(value) if isinstance(value, Kernel) else value


def run_plain(kernel: Kernel, *arguments: Any) -> Any:
    """Call a kernel as plain Python."""
    with np.errstate(all="ignore"):
        return plain(kernel)(*map(as_given, map(_element, arguments)))


def _element(value: Any) -> Any:
    """A record instead of the array that holds it."""
    held = isinstance(value, np.ndarray) and value.dtype.names and value.shape == (1,)
    return np.asarray(value)[0] if held else value


def bits(value: Any) -> Any:
    """What must be equal: every bit, but not which NaN it is, nor whether a number is of NumPy."""
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    if isinstance(value, np.ndarray | np.void):
        value = np.asarray(value)
        if value.dtype.names:
            return tuple((name, bits(value[name])) for name in value.dtype.names)
        plain_number = value.dtype.kind == "f"
        return (np.where(np.isnan(value), np.nan, value) if plain_number else value).tobytes()
    if isinstance(value, bool | int | float | np.generic):
        number = np.float64(
            value
        )  # where an integer stands for a real number, C has the real number
        return b"nan" if np.isnan(number) else number.tobytes()
    return value if value is None else repr(value)


def arrays_of(values: Any) -> Iterator[np.ndarray]:
    """All arrays among arguments."""
    for value in values:
        if isinstance(value, tuple):
            yield from arrays_of(value)
        elif isinstance(value, np.ndarray | np.void):
            yield np.asarray(value)


def copied(values: Any, known: dict[int, Any]) -> tuple[Any, ...]:
    """Arguments with their arrays copied; one that is given twice stays one."""
    made = []
    for value in values:
        if isinstance(value, tuple):
            made.append(copied(value, known))
        elif isinstance(value, np.ndarray | np.void):
            made.append(known.setdefault(id(value), value.copy()))
        else:
            made.append(value)
    return tuple(made)


def share_memory(values: Any) -> bool:
    """Whether different arrays overlap, so that copies would not."""
    arrays = {id(array): array for array in arrays_of(values)}
    known = list(arrays.values())
    return any(np.may_share_memory(a, b) for n, a in enumerate(known) for b in known[:n])


@dataclass
class Comparison:
    """What was compared."""

    compared: Counter[str] = field(default_factory=Counter)  # calls by the kernel's name
    different: list[str] = field(default_factory=list)  # the kernel and what differs
    calls: Counter[str] = field(default_factory=Counter)

    def check(self, kernel: Kernel, arguments: tuple[Any, ...]) -> Any:
        """Call a kernel as C, and as Python on copies."""
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
        copies = copied(arguments, {})
        got = super(Kernel, kernel).__call__(*arguments)
        desired = run_plain(kernel, *copies)
        self.compared[name] += 1
        if bits(got) != bits(desired):
            self.different.append(f"{name} returns {got!r:.200}, Python {desired!r:.200}")
        for parameter, one, other in zip(kernel._names, arguments, copies, strict=False):
            for a, b in zip(arrays_of((one,)), arrays_of((other,)), strict=True):
                if bits(a) != bits(b):
                    fields = [n for n in a.dtype.names or () if bits(a[n]) != bits(b[n])]
                    self.different.append(f"{name}: {parameter} {fields}")
        return got


@contextmanager
def compared(most: int = 3) -> Iterator[Comparison]:
    """Within it calls of kernels are compared: of each kernel the 1st, 2nd, 4th, 8th … so many
    times at most.
    """
    comparison = Comparison()

    def call(kernel: Kernel, *arguments: Any, **named: Any) -> Any:
        bound = kernel._signature.bind(*arguments, **named)
        bound.apply_defaults()
        values = tuple(bound.arguments.values())
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
        comparison.calls[name] += 1
        n = comparison.calls[name]
        short = bound.arguments.get("ticks", 0) <= LONGEST
        chosen = (
            short
            and n & (n - 1) == 0
            and comparison.compared[name] < most
            and not share_memory(values)
        )
        return (
            comparison.check(kernel, values)
            if chosen
            else super(Kernel, kernel).__call__(*arguments, **named)
        )

    Kernel.__call__ = call  # type: ignore[method-assign]
    try:
        yield comparison
    finally:
        del Kernel.__call__


def same(function: Kernel, *arguments: Any) -> Any:
    """Call a kernel as C and as Python on copies of its arguments; returns what C gives."""
    comparison = Comparison()
    result = comparison.check(function, arguments)
    assert comparison.different == []
    return result
