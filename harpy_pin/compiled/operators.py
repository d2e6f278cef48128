"""Operators of a kernel as operators of C: arithmetic, comparisons, conditions, and choices."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from harpy_pin.compiled.scalars import (
    AND,
    ATOM,
    EQUALITY,
    OR,
    PRODUCT,
    RELATION,
    SUM,
    TERNARY,
    UNARY,
    Refused,
    Scalars,
    refused,
    wider,
    wrap,
)
from harpy_pin.compiled.types import BOOLEAN, INTEGER, REAL, Scalar, Tuple, Value

__all__ = ["Operators"]

OPERATORS = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
COMPARISONS: dict[type[ast.cmpop], tuple[str, int, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", RELATION, lambda a, b: bool(a < b)),
    ast.LtE: ("<=", RELATION, lambda a, b: bool(a <= b)),
    ast.Gt: (">", RELATION, lambda a, b: bool(a > b)),
    ast.GtE: (">=", RELATION, lambda a, b: bool(a >= b)),
    ast.Eq: ("==", EQUALITY, lambda a, b: bool(a == b)),
    ast.NotEq: ("!=", EQUALITY, lambda a, b: bool(a != b)),
}


class Operators(Scalars):
    """Translates operators."""

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

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            value = self.truth(node.operand)
            if value.constant is not None:
                return self.constant(not value.constant)
            return replace(value, code=f"!{wrap(value, UNARY)}", binding=UNARY)
        value = self.scalar(node.operand)
        if not isinstance(node.op, ast.USub):
            raise refused(node)
        value = self.cast(value, INTEGER) if value.type is BOOLEAN else value
        number = None if value.constant is None else -value.constant
        return Value(value.type, f"-{wrap(value, UNARY + 1)}", UNARY, constant=number, volatile=value.volatile)

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.operands((node.left, node.right))
        return self.arithmetic(node.op, left, right)

    def arithmetic(self, operator: ast.operator, a: Value, b: Value) -> Value:
        """An operation on two numbers."""
        assert isinstance(a.type, Scalar)
        assert isinstance(b.type, Scalar)
        if isinstance(operator, ast.BitOr | ast.BitAnd):
            if REAL in (a.type, b.type):
                raise Refused("| or & of real numbers")
            return self._bits(operator, a, b)
        kind = wider(a.type, b.type)
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
        """A number to a power: of a constant integer by squaring."""
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
            raise refused(node, " in a value of 'and' or 'or' is no truth value")
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
        kind = wider(a.type, b.type)
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
            kind = wider(a.type, b.type)
            a, b = self.cast(a, kind), self.cast(b, kind)
        elif a.type != b.type:
            raise Refused("two kinds of value, one of which is chosen at run time")
        else:
            a, b = replace(a, binding=TERNARY + 1), replace(b, binding=TERNARY + 1)
        code = f"{wrap(condition, TERNARY + 1)} ? {wrap(a, TERNARY + 1)} : {wrap(b, TERNARY)}"
        fields = a.fields | b.fields if a.fields and b.fields else frozenset[str]()
        return Value(a.type, code, TERNARY, roots=roots, fields=fields, volatile=True)
