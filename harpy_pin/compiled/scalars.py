"""Numbers of a kernel as C: constants, conversions, and the order in which expressions are evaluated."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.compiled.types import BOOLEAN, INTEGER, NOTHING, REAL, SINGLE, Scalar, Tuple, Value

if TYPE_CHECKING:
    from harpy_pin.compiled.unit import Unit

__all__ = ["ATOM", "Refused", "Scalars", "refused", "wider", "wrap"]

ATOM, UNARY, PRODUCT, SUM, RELATION, EQUALITY, AND, OR, TERNARY = 100, 90, 80, 70, 60, 55, 40, 30, 20
"""How tightly operators bind."""
NODES = frozenset(
    (
        *(ast.Constant, ast.Name, ast.Tuple, ast.Attribute, ast.Subscript, ast.Call),
        *(ast.UnaryOp, ast.BinOp, ast.BoolOp, ast.Compare, ast.IfExp),
    )
)
"""Expressions that kernels have."""
MEMORY = re.compile(r"\[|->|[A-Za-z_]\w*\.(?!v\d)[A-Za-z_]")
"""What code has where it reads an element or a field."""


class Refused(Exception):
    """Something that kernels do not have."""


def refused(node: ast.AST, reason: str = "") -> Refused:
    """The refusal of a piece of source, which the message begins with."""
    return Refused(f"'{ast.unparse(node)}'{reason}")


def wrap(value: Value, binding: int) -> str:
    """Code of a value as an operand of an operator that binds so tightly."""
    return value.code if value.binding >= binding else f"({value.code})"


def wider(*types: Any) -> Scalar:
    """Of numbers the type that holds them all."""
    return max((kind for kind in types if isinstance(kind, Scalar)), key=lambda scalar: scalar.rank)


class Scalars:
    """Translates what all expressions need; the translators of expressions and statements are its subclasses."""

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
            raise refused(node, " where it may not run, or more than once: give it a name first")
        return value

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
        (value,) = self.operands([node])
        return value

    def operands(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions that must be numbers, evaluated in order."""
        values = self.ordered(nodes)
        for node, value in zip(nodes, values, strict=True):
            if not isinstance(value.type, Scalar):
                raise refused(node, " is no number")
        return values

    def integer(self, node: ast.expr) -> Value:
        """An expression that must be an integer."""
        value = self.scalar(node)
        if value.type is REAL:
            raise refused(node, " is no integer")
        return self.cast(value, INTEGER)

    def expression(self, node: ast.expr) -> Value:
        """Any expression."""
        if type(node) not in NODES:
            raise Refused(f"'{ast.unparse(node)}': kernels have no {type(node).__name__}")
        value: Value = getattr(self, f"_{type(node).__name__.lower()}")(node)
        return value
