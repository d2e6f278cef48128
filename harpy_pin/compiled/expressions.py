"""Expressions of a kernel as expressions in C, with their types."""

from __future__ import annotations

import ast
import builtins
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.compiled.types import (
    BOOLEAN,
    INTEGER,
    NOTHING,
    REAL,
    SINGLE,
    Array,
    Function,
    Scalar,
    Struct,
    Tuple,
    Value,
)

if TYPE_CHECKING:
    from harpy_pin.compiled.unit import Unit

__all__ = ["ATOM", "Expressions", "Refused", "kernel_of", "wrap"]

ATOM, UNARY, PRODUCT, SUM, RELATION, EQUALITY, AND, OR, TERNARY = 100, 90, 80, 70, 60, 55, 40, 30, 20
"""How tightly operators bind."""
OPERATORS = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
COMPARISONS: dict[type[ast.cmpop], tuple[str, int, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", RELATION, lambda a, b: bool(a < b)),
    ast.LtE: ("<=", RELATION, lambda a, b: bool(a <= b)),
    ast.Gt: (">", RELATION, lambda a, b: bool(a > b)),
    ast.GtE: (">=", RELATION, lambda a, b: bool(a >= b)),
    ast.Eq: ("==", EQUALITY, lambda a, b: bool(a == b)),
    ast.NotEq: ("!=", EQUALITY, lambda a, b: bool(a != b)),
}
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
NODES = frozenset(
    (
        *(ast.Constant, ast.Name, ast.Tuple, ast.Attribute, ast.Subscript, ast.Call),
        *(ast.UnaryOp, ast.BinOp, ast.BoolOp, ast.Compare, ast.IfExp),
    )
)
"""Expressions that kernels have."""
LIBRARY = (*MATHEMATICS, *PREDICATES, min, max, abs, round, int, np.int64, float, time.perf_counter_ns)
"""All functions that are no kernels."""
MEMORY = re.compile(r"\[|->|[A-Za-z_]\w*\.(?!v\d)[A-Za-z_]")
"""What code has where it reads an element or a field."""


class Refused(Exception):
    """Something that kernels do not have."""


def wrap(value: Value, binding: int) -> str:
    """Code of a value as an operand of an operator that binds so tightly."""
    return value.code if value.binding >= binding else f"({value.code})"


def kernel_of(value: Any) -> Any:
    """The Python function of a kernel, or None for anything else."""
    return getattr(value, "py_func", None)


class Expressions:
    """Translates expressions; the statements' translator is its subclass."""

    unit: Unit
    environment: dict[str, Any]
    effects = 0
    """Calls so far that write memory."""
    emitted = 0
    """Lines of C so far."""

    def name(self, node: ast.Name) -> Value:
        """What a name stands for."""
        raise NotImplementedError

    def call_kernel(self, kernel: Any, arguments: list[Value], named: dict[str, Value]) -> Value:
        """The call of another kernel."""
        raise NotImplementedError

    def keep(self, name: str, value: Value) -> Value:
        """The value in a variable of its own, before the statement."""
        raise NotImplementedError

    # --- order ---------------------------------------------------------------------------------------------------

    def ordered(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions that Python evaluates in order, and C in any: none may change what others read."""
        values: list[Value] = []
        writes: list[bool] = []
        for node in nodes:
            before = self.effects
            values.append(self.expression(node))
            writes.append(self.effects > before)
        for n, write in enumerate(writes):
            if write and any(writes[m] or self._reads(value) for m, value in enumerate(values) if m != n):
                raise Refused("a call that changes what the rest of the expression reads: give its result a name first")
        return values

    def _reads(self, value: Value) -> bool:
        """Whether the code reads memory that another kernel may write."""
        if isinstance(value.type, Tuple):
            return any(map(self._reads, value.items))
        if not isinstance(value.type, Scalar):
            return "[" in value.code
        return MEMORY.search(value.code) is not None or not self.unit.is_pure(value.code)

    def inline(self, translate: Callable[[ast.expr], Value], node: ast.expr) -> Value:
        """Translate what may not run, or may run again: nothing of it may stand before the statement."""
        before = self.emitted
        value = translate(node)
        if self.emitted > before:
            raise Refused(f"'{ast.unparse(node)}' where it may not run, or more than once: give it a name first")
        return value

    # --- numbers -------------------------------------------------------------------------------------------------

    def constant(self, number: object) -> Value:
        """A number that is known, or a tuple of such numbers."""
        if isinstance(number, bool | np.bool_):
            return Value(BOOLEAN, "true" if number else "false", constant=bool(number))
        if isinstance(number, int | np.integer):
            return Value(INTEGER, str(int(number)), ATOM if number >= 0 else UNARY, constant=int(number))
        if isinstance(number, float):
            return Value(REAL, self.unit.literal(number), ATOM if number >= 0 else UNARY, constant=float(number))
        if isinstance(number, tuple):
            items = tuple(map(self.constant, number))
            return Value(Tuple(tuple(item.type for item in items)), items=items)
        if number is None:
            return Value(NOTHING)
        raise Refused(f"a constant of type {type(number).__name__}")

    def real(self, value: Value) -> Value:
        """The same as a real number."""
        return self.cast(value, REAL)

    def cast(self, value: Value, to: Scalar) -> Value:
        """The same as a number of another type."""
        if value.type == to:
            return value
        if not isinstance(value.type, Scalar):
            raise Refused("something that is no number where one is needed")
        if to is SINGLE:
            return replace(self.real(value), code=f"(float){wrap(self.real(value), UNARY)}", binding=UNARY)
        if to is BOOLEAN:
            return Value(BOOLEAN, f"{wrap(value, EQUALITY + 1)} != 0", EQUALITY)
        if isinstance(value.constant, int):
            return self.constant(float(value.constant) if to is REAL else int(value.constant))
        return replace(value, type=to, code=f"({to}){wrap(value, UNARY)}", binding=UNARY, constant=None)

    def scalar(self, node: ast.expr) -> Value:
        """An expression that must be a number."""
        value = self.expression(node)
        if not isinstance(value.type, Scalar):
            raise Refused(f"'{ast.unparse(node)}' is no number")
        return value

    def truth(self, node: ast.expr) -> Value:
        """An expression as a condition."""
        if isinstance(node, ast.BoolOp):
            return self._together(node, self.truth)
        value = self.scalar(node)
        if value.type is BOOLEAN:
            return value
        if value.constant is not None:
            return self.constant(bool(value.constant))
        return self.cast(value, BOOLEAN)

    def integer(self, node: ast.expr) -> Value:
        """An expression that must be an integer."""
        value = self.scalar(node)
        if value.type is REAL:
            raise Refused(f"'{ast.unparse(node)}' is no integer")
        return self.cast(value, INTEGER)

    # --- kinds of expressions ------------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> Value:
        """Any expression."""
        if type(node) not in NODES:
            raise Refused(f"'{ast.unparse(node)}': kernels have no {type(node).__name__}")
        value: Value = getattr(self, f"_{type(node).__name__.lower()}")(node)
        return value

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
                raise Refused(f"'{ast.unparse(node)}': * of something that is no tuple")
            items.extend(value.items if several else [value])
        return Value(Tuple(tuple(item.type for item in items)), items=tuple(items))

    def _attribute(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and node.value.id not in self.environment:
            found = self.name(node.value)
            if isinstance(found.type, Function):
                if not hasattr(found.type.target, node.attr):
                    raise Refused(f"'{ast.unparse(node)}', which is not there")
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
        raise Refused(f"'{ast.unparse(node)}'")

    def known(self, found: Any, name: str) -> Value:
        """A value of Python that a kernel's source names: a number, a kernel, a module, a function."""
        if isinstance(found, int | float | tuple | np.integer | np.bool_):
            value = self.constant(found)
            if isinstance(value.type, Scalar) and value.type is not BOOLEAN and name.isupper():
                return replace(value, code=self.unit.define(name, value.code), binding=ATOM)
            return value
        return Value(Function(found))

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
        return self.constant(size) if isinstance(size, int) else Value(INTEGER, size, PRODUCT if "*" in size else ATOM)

    # --- operators -----------------------------------------------------------------------------------------------

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            value = self.truth(node.operand)
            if value.constant is not None:
                return self.constant(not value.constant)
            return replace(value, code=f"!{wrap(value, UNARY)}", binding=UNARY)
        value = self.scalar(node.operand)
        if not isinstance(node.op, ast.USub):
            raise Refused(f"'{ast.unparse(node)}'")
        value = self.cast(value, INTEGER) if value.type is BOOLEAN else value
        number = None if value.constant is None else -value.constant
        return Value(value.type, f"-{wrap(value, UNARY + 1)}", UNARY, constant=number, volatile=value.volatile)

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.ordered((node.left, node.right))
        for side, value in ((node.left, left), (node.right, right)):
            if not isinstance(value.type, Scalar):
                raise Refused(f"'{ast.unparse(side)}' is no number")
        return self.arithmetic(node.op, left, right)

    def arithmetic(self, operator: ast.operator, a: Value, b: Value) -> Value:
        """An operation on two numbers."""
        assert isinstance(a.type, Scalar)
        assert isinstance(b.type, Scalar)
        if isinstance(operator, ast.BitOr | ast.BitAnd):
            if REAL in (a.type, b.type):
                raise Refused("| or & of real numbers")
            return self._bits(operator, a, b)
        kind = max(a.type, b.type, key=lambda scalar: scalar.rank)
        kind = INTEGER if kind is BOOLEAN else kind
        volatile = a.volatile or b.volatile
        if isinstance(operator, ast.Pow):
            return self._power(a, b)
        if isinstance(operator, ast.Div):
            a, b = self.real(a), self.real(b)
            return Value(REAL, f"{wrap(a, PRODUCT)} / {wrap(b, PRODUCT + 1)}", PRODUCT, volatile=volatile)
        a, b = self.cast(a, kind), self.cast(b, kind)
        if isinstance(operator, ast.FloorDiv | ast.Mod):
            return self._division(operator, kind, a, b)
        if type(operator) not in OPERATORS:
            raise Refused(f"the operator {type(operator).__name__}")
        sign, binding = OPERATORS[type(operator)]
        constant = None
        if kind is INTEGER and a.constant is not None and b.constant is not None:
            x, y = int(a.constant), int(b.constant)
            constant = {"+": x + y, "-": x - y, "*": x * y}[sign]
            if a.code.lstrip("-").isdigit() and b.code.lstrip("-").isdigit():
                return self.constant(constant)
        code = f"{wrap(a, binding)} {sign} {wrap(b, binding + 1)}"
        return Value(kind, code, binding, constant=constant, volatile=volatile)

    def _bits(self, operator: ast.operator, a: Value, b: Value) -> Value:
        both = a.type is BOOLEAN and b.type is BOOLEAN
        sign = "|" if isinstance(operator, ast.BitOr) else "&"  # of truth values, too: both sides are evaluated
        kind = BOOLEAN if both else INTEGER
        return Value(kind, f"({wrap(a, ATOM)} {sign} {wrap(b, ATOM)})", volatile=a.volatile or b.volatile)

    def _power(self, a: Value, b: Value) -> Value:
        """A number to a power: of a constant integer by squaring, as Numba does it."""
        exponent = b.constant
        if isinstance(exponent, int) and 2 <= exponent <= 4 and a.type is REAL:
            base = self.unit.helper(f"power_{exponent}")
            return Value(REAL, f"{base}({a.code})", volatile=a.volatile)
        if a.type is not REAL and b.type is not REAL and not (isinstance(exponent, int) and exponent < 0):
            if exponent is None:
                raise Refused("a whole number to a power that is not known when compiling")
            power = self.unit.helper("integer_power")
            return Value(INTEGER, f"{power}({self.cast(a, INTEGER).code}, {int(exponent)})", volatile=a.volatile)
        a, b = self.real(a), self.real(b)
        return Value(REAL, f"{self.unit.function('pow')}({a.code}, {b.code})", volatile=True)

    def _division(self, operator: ast.operator, kind: Scalar, a: Value, b: Value) -> Value:
        """Quotient or rest, rounded down as Python does."""
        quotient = isinstance(operator, ast.FloorDiv)
        if kind is INTEGER and isinstance(a.constant, int) and isinstance(b.constant, int) and b.constant > 0:
            return self.constant(a.constant // b.constant if quotient else a.constant % b.constant)
        if kind is REAL and quotient:
            raise Refused("// of real numbers")
        name = "real_mod" if kind is REAL else "floor_div" if quotient else "floor_mod"
        return Value(kind, f"{self.unit.helper(name)}({a.code}, {b.code})", volatile=a.volatile or b.volatile)

    def _boolop(self, node: ast.BoolOp) -> Value:
        return self._together(node, self._truth_value)

    def _truth_value(self, node: ast.expr) -> Value:
        """An operand of "and" where the result is a value: Python would give the operand itself."""
        value = self.expression(node)
        if value.type is not BOOLEAN:
            raise Refused(f"'{ast.unparse(node)}' in a value of 'and' or 'or' is no truth value")
        return value

    def _together(self, node: ast.BoolOp, translate: Callable[[ast.expr], Value]) -> Value:
        """Several conditions, of which the later ones are asked only where the earlier ones leave it open."""
        together = isinstance(node.op, ast.And)
        parts: list[Value] = []
        for n, operand in enumerate(node.values):
            value = self.inline(translate, operand) if n else translate(operand)
            if value.constant is None or value.constant != together:
                parts.append(value)
            if value.constant is not None and value.constant != together:
                break  # what follows is never asked
        if not parts:
            return self.constant(together)
        if len(parts) == 1:
            return parts[0]
        sign, binding = (" && ", AND) if together else (" || ", OR)
        return Value(BOOLEAN, sign.join(wrap(part, AND + 1) for part in parts), binding, volatile=True)

    def _compare(self, node: ast.Compare) -> Value:
        left, *others = self.ordered((node.left, *node.comparators[:1]))
        if len(node.ops) > 1:  # each of the inner ones is used twice, the later ones may not be asked
            others = [self._once(right) for right in others]
            others += [self._once(self.inline(self.expression, right)) for right in node.comparators[1:]]
        parts: list[Value] = []
        for operator, right in zip(node.ops, others, strict=True):
            part = self._relation(operator, left, right)
            if part.constant is False:
                return part
            if part.constant is None:
                parts.append(part)
            left = right
        if not parts:
            return self.constant(True)
        if len(parts) == 1:
            return parts[0]
        return Value(BOOLEAN, " && ".join(wrap(part, AND + 1) for part in parts), AND, volatile=True)

    def _once(self, value: Value) -> Value:
        """A value that is used several times: a call is made once."""
        calls = isinstance(value.type, Scalar) and not self.unit.is_pure(value.code)
        return self.keep("value", value) if calls else value

    def _relation(self, operator: ast.cmpop, a: Value, b: Value) -> Value:
        if isinstance(operator, ast.In | ast.NotIn) and isinstance(b.type, Tuple):
            if not b.items:
                return self.constant(isinstance(operator, ast.NotIn))
            a = self._once(a)
            found = [self._relation(ast.Eq(), a, item) for item in b.items]
            code = " || ".join(wrap(part, AND + 1) for part in found)
            if isinstance(operator, ast.NotIn):
                return Value(BOOLEAN, f"!({code})", UNARY)
            return Value(BOOLEAN, code, OR)
        if isinstance(a.type, Tuple) and isinstance(b.type, Tuple) and isinstance(operator, ast.Eq | ast.NotEq):
            return self._same_tuples(isinstance(operator, ast.Eq), a, b)
        if type(operator) not in COMPARISONS:
            raise Refused(f"the comparison {type(operator).__name__}")
        sign, binding, compare = COMPARISONS[type(operator)]
        if not (isinstance(a.type, Scalar) and isinstance(b.type, Scalar)):
            raise Refused("a comparison of things that are no numbers")
        if a.constant is not None and b.constant is not None:
            return self.constant(compare(a.constant, b.constant))
        kind = max(a.type, b.type, key=lambda scalar: scalar.rank)
        a, b = self.cast(a, kind), self.cast(b, kind)
        return Value(BOOLEAN, f"{wrap(a, binding + 1)} {sign} {wrap(b, binding + 1)}", binding, volatile=True)

    def _same_tuples(self, equal: bool, a: Value, b: Value) -> Value:
        if len(a.items) != len(b.items):
            return self.constant(not equal)
        parts = [self._relation(ast.Eq(), x, y) for x, y in zip(a.items, b.items, strict=True)]
        if any(part.constant is False for part in parts):
            return self.constant(not equal)
        parts = [part for part in parts if part.constant is None]
        if not parts:
            return self.constant(equal)
        code = " && ".join(wrap(part, AND + 1) for part in parts)
        return Value(BOOLEAN, code, AND) if equal else Value(BOOLEAN, f"!({code})", UNARY)

    def _ifexp(self, node: ast.IfExp) -> Value:
        condition = self.truth(node.test)
        if condition.constant is not None:
            return self.expression(node.body if condition.constant else node.orelse)
        a, b = self.inline(self.expression, node.body), self.inline(self.expression, node.orelse)
        return self.choice(self._once(condition) if isinstance(a.type, Tuple) else condition, a, b)

    def choice(self, condition: Value, a: Value, b: Value) -> Value:
        """One of two values."""
        if isinstance(a.type, Tuple) and isinstance(b.type, Tuple) and len(a.items) == len(b.items):
            items = tuple(self.choice(condition, x, y) for x, y in zip(a.items, b.items, strict=True))
            return Value(Tuple(tuple(item.type for item in items)), items=items)
        roots = a.roots | b.roots
        if isinstance(a.type, Scalar) and isinstance(b.type, Scalar):
            kind = max(a.type, b.type, key=lambda scalar: scalar.rank)
            a, b = self.cast(a, kind), self.cast(b, kind)
        elif a.type != b.type:
            raise Refused("two kinds of value, one of which is chosen at run time")
        else:
            a, b = replace(a, binding=TERNARY + 1), replace(b, binding=TERNARY + 1)
        code = f"{wrap(condition, TERNARY + 1)} ? {wrap(a, TERNARY + 1)} : {wrap(b, TERNARY)}"
        fields = a.fields | b.fields if a.fields and b.fields else frozenset[str]()
        return Value(a.type, code, TERNARY, roots=roots, fields=fields, volatile=True)

    # --- arrays --------------------------------------------------------------------------------------------------

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.expression(node.value)
        if isinstance(owner.type, Tuple):
            return self._item(owner, self.integer(node.slice))
        if not isinstance(owner.type, Array):
            raise Refused(f"'{ast.unparse(node.value)}' is no array")
        view = self.view(owner, node.slice)
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

    def view(self, owner: Value, index: ast.expr) -> Value:
        """A part of an array; without axes left its code is the element, otherwise the address of the first one."""
        assert isinstance(owner.type, Array)
        parts = list(index.elts) if isinstance(index, ast.Tuple) else [index]
        shape, strides = list(owner.type.shape), list(owner.type.strides)
        if len(parts) > len(shape):
            raise Refused(f"{len(parts)} indices of an array of {len(shape)} axes")
        fixed, terms = 0, []
        left_shape: list[int | str] = []
        left_strides: list[int | str] = []
        for axis, part in enumerate(parts):
            if isinstance(part, ast.Slice):
                start, size = self._slice(part, shape[axis])
                left_shape.append(size)
                left_strides.append(strides[axis])
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
        kind = Array(owner.type.element, (*left_shape, *shape[len(parts) :]), (*left_strides, *strides[len(parts) :]))
        if not kind.shape:
            owner = self.dereferenced(owner)
            return Value(kind, f"{self._at(owner, offset)}", roots=owner.roots, fields=owner.fields)
        if any(isinstance(part, ast.Slice) and (part.lower or part.upper) for part in parts):
            owner = replace(owner, fields=frozenset(path.rstrip("+") + "+" for path in owner.fields))
        if offset == "0" or owner.code == "NULL":
            return replace(owner, type=kind)
        return Value(kind, f"{wrap(owner, SUM)} + {offset}", SUM, roots=owner.roots, fields=owner.fields)

    def dereferenced(self, owner: Value) -> Value:
        """An array whose elements are named, in a branch that a robot without them never comes to."""
        if owner.code != "NULL":
            return owner
        return replace(owner, code=f"(({self.unit.declare(owner.type, '').strip()})NULL)")

    def _at(self, owner: Value, offset: str) -> str:
        """An element of an array, whose address may already be a sum."""
        base, _, begin = owner.code.partition(" + ")
        if owner.binding == SUM and "(" not in base:
            return f"{base}[{begin} + {offset}]" if offset != "0" else f"{base}[{begin}]"
        return f"{wrap(owner, ATOM)}[{offset}]"

    def _index(self, node: ast.expr, size: int | str) -> Value:
        value = self.integer(node)
        if isinstance(value.constant, int):
            if value.constant < 0 or (isinstance(size, int) and value.constant >= size):
                raise Refused(f"index {value.constant} of an axis of {size}")
        elif self.unit.debug:
            return Value(INTEGER, f"inside({value.code}, {size}, __LINE__)")
        return value

    def _slice(self, node: ast.Slice, size: int | str) -> tuple[Value, int | str]:
        """Where a slice begins, and its size."""
        if node.step is not None:
            raise Refused("a slice with a step")
        begin = self.integer(node.lower) if node.lower is not None else self.constant(0)
        end = self.integer(node.upper) if node.upper is not None else self.size(size)
        length: int | str | None = self._difference(node, size)
        if length is None and isinstance(node.upper, ast.BinOp) and _is_sum_from(node.upper, node.lower):
            length = self.integer(node.upper.right).code
        if length is None:
            length = end.code if begin.constant == 0 else f"({end.code} - {wrap(begin, SUM + 1)})"
        for bound in (begin, end):
            if isinstance(bound.constant, int) and isinstance(size, int) and not 0 <= bound.constant <= size:
                raise Refused(f"a slice to {bound.constant} of an axis of {size}")
        if self.unit.debug:
            begin = Value(INTEGER, f"within({begin.code}, {end.code}, {size}, __LINE__)")
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
        """An integer expression as a sum of terms with constant factors; the term without a name is 1."""
        value = self.integer(node)
        if isinstance(value.constant, int):
            return {"": value.constant}
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            sign = 1 if isinstance(node.op, ast.Add) else -1
            left, right = self._linear(node.left), self._linear(node.right)
            return {term: left.get(term, 0) + sign * right.get(term, 0) for term in left.keys() | right.keys()}
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            for factor, other in ((node.left, node.right), (node.right, node.left)):
                known = self.integer(factor).constant
                if isinstance(known, int):
                    return {term: known * n for term, n in self._linear(other).items()}
        return {ast.unparse(node): 1}

    # --- calls ---------------------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            owner = self.expression(node.func.value)
            if isinstance(owner.type, Array):
                return self._reshape(owner, node.args)
        target = self.expression(node.func)
        if not isinstance(target.type, Function):
            raise Refused(f"'{ast.unparse(node.func)}' is no function")
        function = target.type.target
        names = [keyword.arg for keyword in node.keywords]
        if kernel_of(function) is not None:
            if None in names:
                raise Refused(f"'{ast.unparse(node)}': **")
            packed = self._tuple(ast.Tuple([*node.args, *(keyword.value for keyword in node.keywords)], ast.Load()))
            arguments = list(packed.items)
            first = len(arguments) - len(names)
            return self.call_kernel(
                function, arguments[:first], dict(zip(map(str, names), arguments[first:], strict=True))
            )
        if not any(function is one for one in LIBRARY):
            raise Refused(f"'{ast.unparse(node.func)}' is no kernel and none of the functions that kernels have")
        if names:
            raise Refused(f"'{ast.unparse(node)}': arguments by name")
        arguments = self.ordered(node.args)
        for argument, value in zip(node.args, arguments, strict=True):
            if not isinstance(value.type, Scalar):
                raise Refused(f"'{ast.unparse(argument)}' is no number")
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
        kind = max((argument.type for argument in arguments if isinstance(argument.type, Scalar)), key=lambda s: s.rank)
        kind = INTEGER if kind is BOOLEAN else kind
        value = self.cast(arguments[0], kind)
        volatile = any(argument.volatile for argument in arguments)
        for other in arguments[1:]:
            call = f"{self.unit.helper(f'{kind}_{name}')}({value.code}, {self.cast(other, kind).code})"
            value = Value(kind, call, volatile=volatile)
        return value

    def _reshape(self, owner: Value, arguments: list[ast.expr]) -> Value:
        assert isinstance(owner.type, Array)
        if not owner.type.is_packed:
            raise Refused("reshape of a view with gaps")
        parts = list(arguments[0].elts) if isinstance(arguments[0], ast.Tuple) else arguments
        shape: list[int | str] = []
        for part in parts:
            size = self.integer(part)
            shape.append(size.constant if isinstance(size.constant, int) else size.code)
        known = [all(isinstance(n, int) for n in sizes) for sizes in (shape, owner.type.shape)]
        if any(isinstance(n, int) and n < 0 for n in shape) or (all(known) and prod(shape) != prod(owner.type.shape)):
            raise Refused(f"reshape of {owner.type.shape} to {tuple(shape)}")
        return replace(owner, type=Array.packed(owner.type.element, tuple(shape)))


def _is_sum_from(end: ast.BinOp, begin: ast.expr | None) -> bool:
    """Whether the end of a slice is its beginning and something more."""
    return begin is not None and isinstance(end.op, ast.Add) and ast.unparse(end.left) == ast.unparse(begin)
