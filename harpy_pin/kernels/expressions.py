"""Expressions of a kernel: names, operators, conditions, and the order in which they are
evaluated.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from harpy_pin.kernels.additions import ByPrecision
from harpy_pin.kernels.code import Code
from harpy_pin.kernels.numpy_functions import NumpyFunctions
from harpy_pin.kernels.source import Source
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL
from harpy_pin.kernels.unit import CFunction, Unit
from harpy_pin.kernels.values import (
    AnArray,
    Computed,
    Done,
    Items,
    Named,
    Number,
    Record,
    Refused,
    Value,
    View,
    refuse_if,
    refused,
)


class Expressions(NumpyFunctions):
    """Translates what an expression of Python evaluates to: ``_binop`` an ``ast.BinOp``, and so
    on.
    """

    def __init__(self, unit: Unit, function: CFunction, source: Source, local: set[str]) -> None:
        super().__init__(unit, function, set(map(unit.identifier, local)))
        self.source, self.local = source, local
        self.environment: dict[str, Value | None] = {}
        self.effects = 0  # calls so far that write memory

    def expression(self, node: ast.expr) -> Value:
        """Any expression."""
        name = type(node).__name__
        translate = getattr(self, f"_{name.lower()}", None)
        if translate is None:
            raise refused(node, f": kernels have no {name}")
        value: Value = translate(node)
        return value

    def ordered(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions that Python evaluates in order, and C in any: none may change what others
        read.
        """
        values: list[Value] = []
        writes: list[bool] = []
        for node in nodes:
            before = self.effects
            values.append(self.expression(node))
            writes.append(self.effects > before)
        for n, write in enumerate(writes):
            others = [writes[m] or reads(value) for m, value in enumerate(values) if m != n]
            refuse_if(
                write and any(others),
                "a call that changes what the rest of the expression reads: give its result a "
                "name first",
            )
        return values

    def inline(self, translate: Callable[[ast.expr], Any], node: ast.expr) -> Any:
        """Translate what may not run, or may run again: nothing of it may stand before the
        statement.
        """
        before = self.emitted
        value = translate(node)
        if self.emitted > before:
            raise refused(node, " where it may not run, or more than once: give it a name first")
        return value

    def number(self, node: ast.expr) -> Number:
        """An expression that must be a number."""
        value = self.expression(node)
        if not isinstance(value, Number):
            raise refused(node, " is no number")
        return value

    def integer(self, node: ast.expr) -> Number:
        """An expression that must be an integer."""
        value = self.number(node)
        if value.type is REAL:
            raise refused(node, " is no integer")
        return self.cast(value, INTEGER)

    def truth(self, node: ast.expr) -> Number:
        """An expression as a condition."""
        if isinstance(node, ast.BoolOp):
            return self._boolop(node, self.truth)
        return self.cast(self.number(node), BOOLEAN)

    def known(self, found: Any, name: str = "") -> Value:
        """A value of Python that a kernel's source names: a number, a kernel, a module, a
        function.
        """
        if isinstance(found, tuple):
            return Items(tuple(map(self.known, found)))
        if not isinstance(found, int | float | np.integer | np.bool_):
            return Named(found)
        if isinstance(found, ByPrecision) and self.unit.single:
            found = found.single
        value = self.constant(found)
        if value.type is not BOOLEAN and name.isupper():
            return Number(value.type, Code(self.unit.define(name, value.code.text)), value.constant)
        return value

    def _name(self, node: ast.Name) -> Value:
        """What a name stands for: a variable, or what the kernel's module knows by it."""
        if node.id in self.environment:
            value = self.environment[node.id]
            if value is None:
                raise Refused(f"'{node.id}', which is not the same kind of thing on every way here")
            return value
        refuse_if(node.id in self.local, f"'{node.id}' before it has a value")
        return self.known(self.source.lookup(node.id), node.id)

    def _constant(self, node: ast.Constant) -> Value:
        return self.constant(node.value)

    def _tuple(self, node: ast.Tuple) -> Items:
        items: list[Value] = []
        values = self.ordered([e.value if isinstance(e, ast.Starred) else e for e in node.elts])
        for element, value in zip(node.elts, values, strict=True):
            if not isinstance(element, ast.Starred):
                items.append(value)
            elif isinstance(value, Items | AnArray):
                items.extend(self.items_of(value))
            else:
                raise refused(element, ": * of something that is neither a tuple nor an array")
        return Items(tuple(items))

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return self.opposite(self.truth(node.operand))
        if not isinstance(node.op, ast.USub):
            raise refused(node)
        return self.elementwise(self.negative, self.expression(node.operand))

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.ordered((node.left, node.right))
        for side, value in ((node.left, left), (node.right, right)):
            if not isinstance(value, Number | AnArray):
                raise refused(side, " is no number")
        return self.arithmetic(type(node.op), left, right)

    def _boolop(
        self, node: ast.BoolOp, translate: Callable[[ast.expr], Number] | None = None
    ) -> Number:
        """Several conditions, of which the later ones are asked only where the earlier ones leave
        it open.
        """
        together = isinstance(node.op, ast.And)
        translate = translate or self._truth_value
        parts: list[Number] = []
        for operand in node.values:
            parts.append(self.inline(translate, operand) if parts else translate(operand))
            if parts[-1].constant is (not together):
                break  # what follows is never asked
        return self.conditions("&&" if together else "||", parts)

    def _truth_value(self, node: ast.expr) -> Number:
        """An operand of "and" where the result is a value: Python would give the operand itself."""
        value = self.expression(node)
        if not isinstance(value, Number) or value.type is not BOOLEAN:
            raise refused(node, " in a value of 'and' or 'or' is no truth value")
        return value

    def _compare(self, node: ast.Compare) -> Value:
        """A comparison, or a chain of them, in which a call is made once."""
        left, right = self.ordered((node.left, node.comparators[0]))
        if len(node.ops) == 1:
            return self.relation(type(node.ops[0]), left, right)
        later = [self.inline(self.expression, other) for other in node.comparators[1:]]
        parts: list[Number] = []
        for operator, other in zip(node.ops, (right, *later), strict=True):
            if not isinstance(left, Number) or not isinstance(other, Number):
                raise refused(node, ": a chain of comparisons of arrays")
            left, before = self.once(other), left
            parts.append(self.comparison(type(operator), before, left))
        return self.conditions("&&", parts)

    def _ifexp(self, node: ast.IfExp) -> Value:
        condition = self.truth(node.test)
        if condition.constant is not None:
            return self.expression(node.body if condition.constant else node.orelse)
        a, b = self.inline(self.expression, node.body), self.inline(self.expression, node.orelse)
        return self.choice(self.once(condition) if isinstance(a, Items) else condition, a, b)


def reads(value: Value) -> bool:
    """Whether another kernel may change what the value is."""
    if isinstance(value, Items):
        return any(map(reads, value.items))
    if isinstance(value, Number | Done):
        return value.code.loads or bool(value.code.calls)
    if isinstance(value, View | Record):
        return value.address.loads
    return isinstance(value, Computed)
