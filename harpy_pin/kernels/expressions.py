"""Expressions of a kernel as expressions in C: names, calls, fields of records, elements and views
of arrays.
"""

from __future__ import annotations

import ast
import builtins
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from harpy_pin.kernels.operators import (
    ATOM,
    EQUALITY,
    PRODUCT,
    SUM,
    UNARY,
    Operators,
    Refused,
    refused,
    wider,
    wrap,
)
from harpy_pin.kernels.types import (
    BOOLEAN,
    INTEGER,
    REAL,
    SINGLE,
    Array,
    ByPrecision,
    Function,
    Scalar,
    Struct,
    Tuple,
    Value,
)


def _is_sum_from(end: ast.BinOp, begin: ast.expr | None) -> bool:
    """Whether the end of a slice is its beginning and something more."""
    return (
        begin is not None
        and isinstance(end.op, ast.Add)
        and ast.unparse(end.left) == ast.unparse(begin)
    )


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
OF_TWO = (np.arctan2, np.hypot, np.copysign)  # functions of two numbers
LIBRARY = (*MATHEMATICS, *PREDICATES, min, max, abs, np.abs, int, np.int64, float)
"""All functions that are no kernels."""


def kernel_of(value: Any) -> Any:
    """The Python function of a kernel, or None for anything else."""
    return getattr(value, "py_func", None)


def _part_of(path: str, begins: list[Any]) -> str:
    """The way to a part of an array, with where the part begins if that is all there is to know."""
    stem, slice_of_slice, _ = path.partition("+")
    known = len(begins) == 1 and isinstance(begins[0], int) and not slice_of_slice
    return f"{stem}+{begins[0]}" if known else f"{stem}+"


class Expressions(Operators):
    """Translates attributes, tuples, functions of Python and NumPy, and what refers to memory."""

    def _field(self, owner: Value, name: str) -> Value:
        assert isinstance(owner.type, Struct)
        fields = owner.type.fields()
        if name not in fields:
            raise Refused(f"a record without '{name}'; it has {', '.join(fields)}")
        kind = fields[name]
        inside = owner.code[1:] + "." if owner.code.startswith("&") else wrap(owner, ATOM) + "->"
        code = f"{inside}{self.unit.identifier(name)}"
        part = frozenset(f"{path}.{name}" for path in owner.fields)
        if isinstance(kind, Array):
            return Value(kind, "NULL" if kind.empty else code, roots=owner.roots, fields=part)
        if isinstance(kind, Struct):
            return Value(kind, f"&{code}", UNARY, roots=owner.roots, fields=part)
        return Value(kind, code, roots=owner.roots, volatile=True)

    def size(self, size: int | str) -> Value:
        """A size of an array as a number."""
        return (
            self.constant(size)
            if isinstance(size, int)
            else Value(INTEGER, size, PRODUCT if "*" in size else ATOM)
        )

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.expression(node.value)
        if isinstance(owner.type, Tuple):
            return self._item(owner, self.integer(node.slice))
        if not isinstance(owner.type, Array):
            raise refused(node.value, " is no array")
        view = self.part(self.in_memory(owner), node.slice)
        assert isinstance(view.type, Array)
        if view.type.shape:
            return view
        if isinstance(view.type.element, Struct):
            code = view.code[: -len("[0]")] if view.code.endswith("[0]") else f"&{view.code}"
            binding = UNARY if code == f"&{view.code}" else ATOM
            return Value(view.type.element, code, binding, roots=view.roots, fields=view.fields)
        if view.type.element is SINGLE:
            return Value(REAL, f"(real){view.code}", UNARY, roots=view.roots, volatile=True)
        return Value(view.type.element, view.code, roots=view.roots, volatile=True)

    def _item(self, owner: Value, index: Value) -> Value:
        if isinstance(index.constant, int):
            return owner.items[index.constant]
        assert isinstance(owner.type, Tuple)
        if owner.type.uniform is None or not owner.code:
            raise Refused("an item of this tuple that is chosen at run time")
        return Value(owner.type.uniform, f"{owner.code}[{index.code}]", volatile=True)

    def part(self, owner: Value, index: ast.expr) -> Value:
        """A part of an array: a view, or elements chosen by an array of indices."""
        raise NotImplementedError

    def view(self, owner: Value, parts: list[ast.expr]) -> Value:
        """A part of an array; without axes left its code is the element, otherwise the address of
        the first one.
        """
        assert isinstance(owner.type, Array)
        shape, strides = list(owner.type.shape), list(owner.type.strides)
        if len(parts) > len(shape):
            raise Refused(f"{len(parts)} indices of an array of {len(shape)} axes")
        fixed, terms, begins = 0, [], []
        left_shape: list[int | str] = []
        left_strides: list[int | str] = []
        for axis, part in enumerate(parts):
            if isinstance(part, ast.Slice):
                start, size = self._slice(part, shape[axis])
                left_shape.append(size)
                left_strides.append(strides[axis])
                begins += [start.constant] if part.lower or part.upper else []
            else:
                start = self._index(part, shape[axis])
            step = strides[axis]
            if isinstance(start.constant, int) and isinstance(step, int) and not self.unit.debug:
                fixed += start.constant * step
            elif step == 1:
                terms.append(wrap(start, SUM))
            elif start.constant != 0 or self.unit.debug:
                terms.append(f"{step} * {wrap(start, PRODUCT + 1)}")
        if fixed or not terms:
            terms.append(str(fixed))
        offset = " + ".join(terms)
        kind = Array(
            owner.type.element,
            (*left_shape, *shape[len(parts) :]),
            (*left_strides, *strides[len(parts) :]),
        )
        if not kind.shape:
            owner = self.dereferenced(owner)
            return Value(kind, f"{self.at(owner, offset)}", roots=owner.roots, fields=owner.fields)
        if begins:
            owner = replace(
                owner, fields=frozenset(_part_of(path, begins) for path in owner.fields)
            )
        if offset == "0" or owner.code == "NULL":
            return replace(owner, type=kind)
        return Value(
            kind, f"{wrap(owner, SUM)} + {offset}", SUM, roots=owner.roots, fields=owner.fields
        )

    def dereferenced(self, owner: Value) -> Value:
        """An array whose elements are named, in a branch that a robot without them never comes
        to.
        """
        if owner.code != "NULL":
            return owner
        return replace(owner, code=f"(({self.unit.declare(owner.type, '').strip()})NULL)")

    def at(self, owner: Value, offset: str) -> str:
        """An element of an array, whose address may already be a sum."""
        base, _, begin = owner.code.partition(" + ")
        if owner.binding == SUM and "(" not in base:
            return f"{base}[{begin} + {offset}]" if offset != "0" else f"{base}[{begin}]"
        return f"{wrap(owner, ATOM)}[{offset}]"

    def _index(self, node: ast.expr, size: int | str) -> Value:
        return self.inside(self.integer(node), size)

    def inside(self, value: Value, size: int | str) -> Value:
        """An index, which is checked if it is known or C is made to be debugged."""
        if isinstance(value.constant, int):
            if value.constant < 0 or (isinstance(size, int) and value.constant >= size):
                raise Refused(f"index {value.constant} of an axis of {size}")
        elif self.unit.debug:
            return Value(INTEGER, f"{self.unit.helper('inside')}({value.code}, {size}, __LINE__)")
        return value

    def _slice(self, node: ast.Slice, size: int | str) -> tuple[Value, int | str]:
        """Where a slice begins, and its size."""
        if node.step is not None:
            raise Refused("a slice with a step")
        begin = self.integer(node.lower) if node.lower is not None else self.constant(0)
        end = self.integer(node.upper) if node.upper is not None else self.size(size)
        length: int | str | None = self._difference(node, size)
        if (
            length is None
            and isinstance(node.upper, ast.BinOp)
            and _is_sum_from(node.upper, node.lower)
        ):
            length = self.integer(node.upper.right).code
        if length is None:
            length = end.code if begin.constant == 0 else f"({end.code} - {wrap(begin, SUM + 1)})"
        for bound in (begin, end):
            if (
                isinstance(bound.constant, int)
                and isinstance(size, int)
                and not 0 <= bound.constant <= size
            ):
                raise Refused(f"a slice to {bound.constant} of an axis of {size}")
        if self.unit.debug:
            begin = Value(
                INTEGER, f"{self.unit.helper('within')}({begin.code}, {end.code}, {size}, __LINE__)"
            )
        return begin, length

    def _difference(self, node: ast.Slice, size: int | str) -> int | None:
        """The size of a slice, where it is known although its ends may not be."""
        begin = self._linear(node.lower) if node.lower is not None else {}
        if node.upper is not None:
            end = self._linear(node.upper)
        elif isinstance(size, int):
            end = {"": size}
        else:
            return None
        rest = {term: end.get(term, 0) - begin.get(term, 0) for term in end.keys() | begin.keys()}
        return rest.get("", 0) if not any(n for term, n in rest.items() if term) else None

    def _linear(self, node: ast.expr) -> dict[str, int]:
        """An integer expression as a sum of terms with constant factors; the term without a name is
        1.
        """
        value = self.integer(node)
        if isinstance(value.constant, int):
            return {"": value.constant}
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            sign = 1 if isinstance(node.op, ast.Add) else -1
            left, right = self._linear(node.left), self._linear(node.right)
            return {
                term: left.get(term, 0) + sign * right.get(term, 0)
                for term in left.keys() | right.keys()
            }
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            for factor, other in ((node.left, node.right), (node.right, node.left)):
                known = self.integer(factor).constant
                if isinstance(known, int):
                    return {term: known * n for term, n in self._linear(other).items()}
        return {ast.unparse(node): 1}

    def _reshape(self, owner: Value, arguments: list[ast.expr]) -> Value:
        owner = self.in_memory(owner)
        assert isinstance(owner.type, Array)
        if not owner.type.is_packed:
            raise Refused("reshape of a view with gaps")
        parts = list(arguments[0].elts) if isinstance(arguments[0], ast.Tuple) else arguments
        shape: list[int | str] = []
        for part in parts:
            size = self.integer(part)
            shape.append(size.constant if isinstance(size.constant, int) else size.code)
        known = [all(isinstance(n, int) for n in sizes) for sizes in (shape, owner.type.shape)]
        if any(isinstance(n, int) and n < 0 for n in shape) or (
            all(known) and prod(shape) != prod(owner.type.shape)
        ):
            raise Refused(f"reshape of {owner.type.shape} to {tuple(shape)}")
        return replace(owner, type=Array.packed(owner.type.element, tuple(shape)))

    def transposed(self, a: Value) -> Value:
        """``a.T``."""
        raise NotImplementedError

    def items_of(self, value: Value) -> tuple[Value, ...]:
        """Items of a tuple, or elements of a vector."""
        raise NotImplementedError

    def _constant(self, node: ast.Constant) -> Value:
        return self.constant(node.value)

    def _tuple(self, node: ast.Tuple) -> Value:
        items: list[Value] = []
        starred = [isinstance(element, ast.Starred) for element in node.elts]
        values = self.ordered([e.value if isinstance(e, ast.Starred) else e for e in node.elts])
        for value, several in zip(values, starred, strict=True):
            if several and not isinstance(value.type, Tuple | Array):
                raise refused(node, ": * of something that is neither a tuple nor an array")
            items.extend(self.items_of(value) if several else [value])
        return Value(Tuple(tuple(item.type for item in items)), items=tuple(items))

    def _attribute(self, node: ast.Attribute) -> Value:
        owner = self.expression(node.value)
        if owner.type == Function(np):
            if not hasattr(np, node.attr):
                raise refused(node, ", which is not there")
            return self.known(getattr(np, node.attr), node.attr)
        if isinstance(owner.type, Struct):
            return self._field(owner, node.attr)
        if isinstance(owner.type, Array) and node.attr == "T":
            return self.transposed(owner)
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
        """A value of Python that a kernel's source names: a number, a kernel, a module, a
        function.
        """
        if isinstance(found, int | float | tuple | np.integer | np.bool_):
            if isinstance(found, ByPrecision) and self.unit.single:
                found = found.single
            value = self.constant(found)
            if isinstance(value.type, Scalar) and value.type is not BOOLEAN and name.isupper():
                return replace(value, code=self.unit.define(name, value.code), binding=ATOM)
            return value
        return Value(Function(found))

    def _library(self, function: Any, arguments: list[Value]) -> Value:
        """A function of Python or NumPy."""
        volatile = any(argument.volatile for argument in arguments)
        codes = ", ".join(self.real(argument).code for argument in arguments)
        if function in MATHEMATICS:
            return Value(
                REAL, f"{self.unit.function(MATHEMATICS[function])}({codes})", volatile=volatile
            )
        if function in PREDICATES:
            return Value(BOOLEAN, f"{PREDICATES[function]}({codes}) != 0", EQUALITY, volatile=True)
        if function in (builtins.min, builtins.max):
            return self._extreme("min" if function is builtins.min else "max", arguments)
        (first,) = arguments
        if function in (builtins.abs, np.abs):
            if first.type is REAL:
                return Value(REAL, f"{self.unit.function('fabs')}({codes})", volatile=volatile)
            return Value(
                INTEGER, f"{self.unit.helper('integer_abs')}({first.code})", volatile=volatile
            )
        return self.real(first) if function is builtins.float else self.cast(first, INTEGER)

    def _extreme(self, name: str, arguments: list[Value]) -> Value:
        kind = wider(*(argument.type for argument in arguments))
        kind = INTEGER if kind is BOOLEAN else kind
        value = self.cast(arguments[0], kind)
        volatile = any(argument.volatile for argument in arguments)
        for other in arguments[1:]:
            call = (
                f"{self.unit.helper(f'{kind}_{name}')}({value.code}, {self.cast(other, kind).code})"
            )
            value = Value(kind, call, volatile=volatile)
        return value
