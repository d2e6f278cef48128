"""Expressions of a kernel as expressions in C, with their types."""

from __future__ import annotations

import ast
import builtins
import time
from dataclasses import replace
from typing import Any

import numpy as np

from harpy_pin.compiled.scalars import ATOM, EQUALITY, UNARY, Refused, refused, wider
from harpy_pin.compiled.types import BOOLEAN, INTEGER, REAL, Array, Function, Scalar, Struct, Tuple, Value
from harpy_pin.compiled.views import Views

__all__ = ["Expressions", "kernel_of"]

MATHEMATICS = {
    np.sqrt: "sqrt",
    np.sin: "sin",
    np.cos: "cos",
    np.tanh: "tanh",
    np.exp: "exp",
    np.arctan2: "atan2",
    np.arccos: "acos",
    np.hypot: "hypot",
    np.copysign: "copysign",
    np.floor: "floor",
    np.ceil: "ceil",
}
"""Functions of C's library under NumPy's names."""
PREDICATES = {np.isfinite: "isfinite", np.isnan: "isnan"}
OF_TWO = (np.arctan2, np.hypot, np.copysign)
"""Functions of two numbers."""
LIBRARY = (*MATHEMATICS, *PREDICATES, min, max, abs, round, int, np.int64, float, time.perf_counter_ns)
"""All functions that are no kernels."""


def kernel_of(value: Any) -> Any:
    """The Python function of a kernel, or None for anything else."""
    return getattr(value, "py_func", None)


class Expressions(Views):
    """Translates names, attributes, tuples and calls; the statements' translator is its subclass."""

    def _constant(self, node: ast.Constant) -> Value:
        return self.constant(node.value)

    def _name(self, node: ast.Name) -> Value:
        return self.name(node)

    def _tuple(self, node: ast.Tuple) -> Value:
        items: list[Value] = []
        starred = [isinstance(element, ast.Starred) for element in node.elts]
        values = self.ordered([e.value if isinstance(e, ast.Starred) else e for e in node.elts])
        for value, several in zip(values, starred, strict=True):
            if several and not isinstance(value.type, Tuple):
                raise refused(node, ": * of something that is no tuple")
            items.extend(value.items if several else [value])
        return Value(Tuple(tuple(item.type for item in items)), items=tuple(items))

    def _attribute(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and node.value.id not in self.environment:
            found = self.name(node.value)
            if isinstance(found.type, Function):
                if not hasattr(found.type.target, node.attr):
                    raise refused(node, ", which is not there")
                return self.known(getattr(found.type.target, node.attr), node.attr)
        owner = self.expression(node.value)
        if isinstance(owner.type, Struct):
            return self._field(owner, node.attr)
        if isinstance(owner.type, Array) and node.attr in ("shape", "size"):
            sizes = tuple(self.size(n) for n in owner.type.shape)
            if node.attr == "shape":
                return Value(Tuple((INTEGER,) * len(sizes)), items=sizes)
            size = sizes[0]
            for other in sizes[1:]:
                size = self.arithmetic(ast.Mult(), size, other)
            return size
        raise refused(node)

    def known(self, found: Any, name: str) -> Value:
        """A value of Python that a kernel's source names: a number, a kernel, a module, a function."""
        if isinstance(found, int | float | tuple | np.integer | np.bool_):
            value = self.constant(found)
            if isinstance(value.type, Scalar) and value.type is not BOOLEAN and name.isupper():
                return replace(value, code=self.unit.define(name, value.code), binding=ATOM)
            return value
        return Value(Function(found))

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            owner = self.expression(node.func.value)
            if isinstance(owner.type, Array):
                return self._reshape(owner, node.args)
        target = self.expression(node.func)
        if not isinstance(target.type, Function):
            raise refused(node.func, " is no function")
        function = target.type.target
        names = [keyword.arg for keyword in node.keywords]
        if kernel_of(function) is not None:
            if None in names:
                raise refused(node, ": **")
            packed = self._tuple(ast.Tuple([*node.args, *(keyword.value for keyword in node.keywords)], ast.Load()))
            arguments = list(packed.items)
            first = len(arguments) - len(names)
            return self.call_kernel(
                function, arguments[:first], dict(zip(map(str, names), arguments[first:], strict=True))
            )
        if not any(function is one for one in LIBRARY):
            raise refused(node.func, " is no kernel and none of the functions that kernels have")
        if names:
            raise refused(node, ": arguments by name")
        arguments = self.operands(node.args)
        extreme = function in (builtins.min, builtins.max)
        count = 0 if function is time.perf_counter_ns else 2 if extreme or function in OF_TWO else 1
        if len(arguments) < count or (len(arguments) > count and not extreme):
            raise Refused(f"'{ast.unparse(node)}': another number of arguments than {count}")
        return self._library(function, arguments)

    def _library(self, function: Any, arguments: list[Value]) -> Value:
        """A function of Python or NumPy."""
        volatile = any(argument.volatile for argument in arguments)
        codes = ", ".join(self.real(argument).code for argument in arguments)
        if function in MATHEMATICS:
            return Value(REAL, f"{self.unit.function(MATHEMATICS[function])}({codes})", volatile=volatile)
        if function in PREDICATES:
            return Value(BOOLEAN, f"{PREDICATES[function]}({codes}) != 0", EQUALITY, volatile=True)
        if function is time.perf_counter_ns:
            return Value(INTEGER, f"{self.unit.helper('clock_ns')}()", volatile=True)
        if function in (builtins.min, builtins.max):
            return self._extreme("min" if function is builtins.min else "max", arguments)
        (first,) = arguments
        if function is builtins.abs:
            if first.type is REAL:
                return Value(REAL, f"{self.unit.function('fabs')}({codes})", volatile=volatile)
            return Value(INTEGER, f"{self.unit.helper('integer_abs')}({first.code})", volatile=volatile)
        if function is builtins.round:
            return Value(INTEGER, f"(integer){self.unit.function('rint')}({codes})", UNARY, volatile=volatile)
        return self.real(first) if function is builtins.float else self.cast(first, INTEGER)

    def _extreme(self, name: str, arguments: list[Value]) -> Value:
        kind = wider(*(argument.type for argument in arguments))
        kind = INTEGER if kind is BOOLEAN else kind
        value = self.cast(arguments[0], kind)
        volatile = any(argument.volatile for argument in arguments)
        for other in arguments[1:]:
            call = f"{self.unit.helper(f'{kind}_{name}')}({value.code}, {self.cast(other, kind).code})"
            value = Value(kind, call, volatile=volatile)
        return value
