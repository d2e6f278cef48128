"""Numbers of a kernel as C: constants, conversions, operators, and the order in which expressions
are evaluated.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, SINGLE, Array, Scalar, Tuple, Value

if TYPE_CHECKING:
    from harpy_pin.kernels.unit import Unit

ATOM, UNARY, PRODUCT, SUM, RELATION, EQUALITY, AND, OR, TERNARY = (
    100,
    90,
    80,
    70,
    60,
    55,
    40,
    30,
    20,
)
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
    """The type that holds numbers of all these types."""
    return max((kind for kind in types if isinstance(kind, Scalar)), key=lambda scalar: scalar.rank)


OPERATORS = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
COMPARISONS: dict[type[ast.cmpop], tuple[str, int, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", RELATION, lambda a, b: bool(a < b)),
    ast.LtE: ("<=", RELATION, lambda a, b: bool(a <= b)),
    ast.Gt: (">", RELATION, lambda a, b: bool(a > b)),
    ast.GtE: (">=", RELATION, lambda a, b: bool(a >= b)),
    ast.Eq: ("==", EQUALITY, lambda a, b: bool(a == b)),
    ast.NotEq: ("!=", EQUALITY, lambda a, b: bool(a != b)),
}


class Operators:
    """Translates numbers and operators; the translators of expressions and statements are its
    subclasses.
    """

    unit: Unit
    environment: dict[str, Any]
    effects = 0
    """Calls so far that write memory."""
    emitted = 0
    """Lines of C so far."""

    def emit(self, line: str) -> None:
        """Add a line before the statement."""
        raise NotImplementedError

    def fresh(self, name: str) -> str:
        """A name that nothing has, which begins so."""
        raise NotImplementedError

    def space(self, name: str, shape: tuple[int | str, ...]) -> Value:
        """Work space for real numbers; its size is known when compiling."""
        raise NotImplementedError

    def keep(self, name: str, value: Value) -> Value:
        """The value in a variable of its own, before the statement."""
        raise NotImplementedError

    def in_memory(self, array: Value, name: str = "array") -> Value:
        """An array that is in memory, where it is written before the statement if it is
        computed.
        """
        raise NotImplementedError

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
            if write and any(
                writes[m] or self._reads(value) for m, value in enumerate(values) if m != n
            ):
                raise Refused(
                    "a call that changes what the rest of the expression reads: give its result a "
                    "name first"
                )
        return values

    def _reads(self, value: Value) -> bool:
        """Whether the code reads memory that another kernel may write."""
        if isinstance(value.type, Tuple):
            return any(map(self._reads, value.items))
        if not isinstance(value.type, Scalar):
            return value.rule is not None or "[" in value.code
        return MEMORY.search(value.code) is not None or not self.unit.is_pure(value.code)

    def inline(self, translate: Callable[[ast.expr], Value], node: ast.expr) -> Value:
        """Translate what may not run, or may run again: nothing of it may stand before the
        statement.
        """
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
            return Value(
                INTEGER, str(int(number)), ATOM if number >= 0 else UNARY, constant=int(number)
            )
        if isinstance(number, float):
            return Value(
                REAL,
                self.unit.literal(number),
                ATOM if number >= 0 else UNARY,
                constant=float(number),
            )
        if isinstance(number, tuple):
            items = tuple(map(self.constant, number))
            return Value(Tuple(tuple(item.type for item in items)), items=items)
        raise Refused(f"a constant of type {type(number).__name__}")

    def real(self, value: Value) -> Value:
        """The value as a real number."""
        return self.cast(value, REAL)

    def cast(self, value: Value, to: Scalar) -> Value:
        """The value as a number of another type."""
        if value.type == to:
            return value
        if not isinstance(value.type, Scalar):
            raise Refused("something that is no number where one is needed")
        if to is SINGLE:
            return replace(
                self.real(value), code=f"(float){wrap(self.real(value), UNARY)}", binding=UNARY
            )
        if to is BOOLEAN:
            return Value(BOOLEAN, f"{wrap(value, EQUALITY + 1)} != 0", EQUALITY)
        if isinstance(value.constant, int):
            return self.constant(float(value.constant) if to is REAL else int(value.constant))
        return replace(
            value, type=to, code=f"({to}){wrap(value, UNARY)}", binding=UNARY, constant=None
        )

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
        if not isinstance(node.op, ast.USub):
            raise refused(node)
        return self.negative(self.expression(node.operand))

    def negative(self, value: Value) -> Value:
        """``-a``."""
        if not isinstance(value.type, Scalar):
            raise Refused("the negative of what is no number")
        value = self.cast(value, INTEGER) if value.type is BOOLEAN else value
        number = None if value.constant is None else -value.constant
        return Value(
            value.type,
            f"-{wrap(value, UNARY + 1)}",
            UNARY,
            constant=number,
            volatile=value.volatile,
        )

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.ordered((node.left, node.right))
        for side, value in ((node.left, left), (node.right, right)):
            if not isinstance(value.type, Scalar | Array):
                raise refused(side, " is no number")
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
            return Value(
                REAL, f"{wrap(a, PRODUCT)} / {wrap(b, PRODUCT + 1)}", PRODUCT, volatile=volatile
            )
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
        sign = (
            "|" if isinstance(operator, ast.BitOr) else "&"
        )  # of truth values, too: both sides are evaluated
        kind = BOOLEAN if both else INTEGER
        return Value(
            kind, f"({wrap(a, ATOM)} {sign} {wrap(b, ATOM)})", volatile=a.volatile or b.volatile
        )

    def _power(self, a: Value, b: Value) -> Value:
        """A real number to a power; to a small one that is known when compiling, a product."""
        exponent = b.constant
        if isinstance(exponent, int) and 2 <= exponent <= 4 and a.type is REAL:
            base = self.unit.helper(f"power_{exponent}")
            return Value(REAL, f"{base}({a.code})", volatile=a.volatile)
        if a.type is not REAL and b.type is not REAL:
            raise Refused("a power of integers")
        a, b = self.real(a), self.real(b)
        return Value(REAL, f"{self.unit.function('pow')}({a.code}, {b.code})", volatile=True)

    def _division(self, operator: ast.operator, kind: Scalar, a: Value, b: Value) -> Value:
        """Quotient or rest, rounded down as Python does."""
        quotient = isinstance(operator, ast.FloorDiv)
        if (
            kind is INTEGER
            and isinstance(a.constant, int)
            and isinstance(b.constant, int)
            and b.constant > 0
        ):
            return self.constant(a.constant // b.constant if quotient else a.constant % b.constant)
        if kind is REAL and quotient:
            raise Refused("// of real numbers")
        name = "real_mod" if kind is REAL else "floor_div" if quotient else "floor_mod"
        return Value(
            kind, f"{self.unit.helper(name)}({a.code}, {b.code})", volatile=a.volatile or b.volatile
        )

    def _boolop(self, node: ast.BoolOp) -> Value:
        return self._together(node, self._truth_value)

    def _truth_value(self, node: ast.expr) -> Value:
        """An operand of "and" where the result is a value: Python would give the operand itself."""
        value = self.expression(node)
        if value.type is not BOOLEAN:
            raise refused(node, " in a value of 'and' or 'or' is no truth value")
        return value

    def _together(self, node: ast.BoolOp, translate: Callable[[ast.expr], Value]) -> Value:
        """Several conditions, of which the later ones are asked only where the earlier ones leave
        it open.
        """
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
        return Value(
            BOOLEAN, sign.join(wrap(part, AND + 1) for part in parts), binding, volatile=True
        )

    def _compare(self, node: ast.Compare) -> Value:
        left, *others = self.ordered((node.left, *node.comparators[:1]))
        if (
            len(node.ops) > 1
        ):  # each of the inner ones is used twice, the later ones may not be asked
            others = [self._once(right) for right in others]
            others += [
                self._once(self.inline(self.expression, right)) for right in node.comparators[1:]
            ]
        parts: list[Value] = []
        for operator, right in zip(node.ops, others, strict=True):
            part = self.relation(operator, left, right)
            if part.constant is False:
                return part
            if part.constant is None:
                parts.append(part)
            left = right
        if not parts:
            return self.constant(True)
        if len(parts) == 1:
            return parts[0]
        if any(isinstance(part.type, Array) for part in parts):
            raise refused(node, ": a chain of comparisons of arrays")
        return Value(
            BOOLEAN, " && ".join(wrap(part, AND + 1) for part in parts), AND, volatile=True
        )

    def _once(self, value: Value) -> Value:
        """A value that is used several times: a call is made once."""
        calls = isinstance(value.type, Scalar) and not self.unit.is_pure(value.code)
        return self.keep("value", value) if calls else value

    def relation(self, operator: ast.cmpop, a: Value, b: Value) -> Value:
        """A comparison."""
        if isinstance(operator, ast.In) and isinstance(b.type, Tuple) and b.items:
            a = self._once(a)
            found = [self.relation(ast.Eq(), a, item) for item in b.items]
            return Value(BOOLEAN, " || ".join(wrap(part, AND + 1) for part in found), OR)
        if (
            isinstance(a.type, Tuple)
            and isinstance(b.type, Tuple)
            and isinstance(operator, ast.Eq | ast.NotEq)
        ):
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
        return Value(
            BOOLEAN, f"{wrap(a, binding + 1)} {sign} {wrap(b, binding + 1)}", binding, volatile=True
        )

    def _same_tuples(self, equal: bool, a: Value, b: Value) -> Value:
        if len(a.items) != len(b.items):
            return self.constant(not equal)
        parts = [self.relation(ast.Eq(), x, y) for x, y in zip(a.items, b.items, strict=True)]
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
            items = tuple(
                self.choice(condition, x, y) for x, y in zip(a.items, b.items, strict=True)
            )
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
