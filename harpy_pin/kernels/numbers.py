"""Numbers of a kernel as C: constants, conversions, operators and functions."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np

from harpy_pin.kernels.body import Body
from harpy_pin.kernels.code import ATOM, BINDING, UNARY, Code, c, infix, joined
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, SINGLE, Scalar, Size
from harpy_pin.kernels.values import Number, Refused, refuse_if

OPERATORS: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
BITS: dict[type[ast.operator], str] = {ast.BitOr: "|", ast.BitAnd: "&"}
COMPARISONS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", lambda a, b: a < b),
    ast.LtE: ("<=", lambda a, b: a <= b),
    ast.Gt: (">", lambda a, b: a > b),
    ast.GtE: (">=", lambda a, b: a >= b),
    ast.Eq: ("==", lambda a, b: a == b),
    ast.NotEq: ("!=", lambda a, b: a != b),
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
EXTREMES = {builtins.min: "min", builtins.max: "max"}
OF_TWO = (np.arctan2, np.hypot, np.copysign, *EXTREMES)  # functions of two numbers, or more
LIBRARY = (*MATHEMATICS, *PREDICATES, *EXTREMES, abs, np.abs, int, np.int64, float, bool)
"""All functions of numbers."""
LARGEST_POWER = 4
"""Powers up to this one are products."""


def wider(*numbers: Number) -> Scalar:
    """The type that holds numbers of all these types."""
    return max((number.type for number in numbers), key=lambda kind: kind.rank)


class Numbers(Body):
    """Translates what is done with numbers."""

    def constant(self, number: object) -> Number:
        """A number that is known."""
        if isinstance(number, bool | np.bool_):
            return Number(BOOLEAN, Code("true" if number else "false"), bool(number))
        if isinstance(number, int | np.integer):
            return self._constant_of(INTEGER, str(int(number)), int(number))
        if isinstance(number, float):
            return self._constant_of(REAL, self.unit.literal(float(number)), float(number))
        raise Refused(f"a constant of type {type(number).__name__}")

    def _constant_of(self, kind: Scalar, text: str, number: float) -> Number:
        return Number(kind, Code(text, ATOM if number >= 0 else UNARY), number)

    def size(self, size: Size) -> Number:
        """A size of an array as a number."""
        return self.constant(size) if isinstance(size, int) else Number(INTEGER, size)

    def real(self, value: Number) -> Number:
        """The value as a real number."""
        return self.cast(value, REAL)

    def cast(self, value: Number, to: Scalar) -> Number:
        """The value as a number of another type."""
        if value.type == to:
            return value
        if to is BOOLEAN:
            return Number(
                BOOLEAN, c("{} != 0", value.code.within(BINDING["!="] + 1), binding=BINDING["!="])
            )
        if to is not SINGLE and isinstance(value.constant, int):
            return self.constant(float(value.constant) if to is REAL else int(value.constant))
        value = self.real(value) if to is SINGLE else value
        return Number(to, c("({}){}", str(to), value.code.within(UNARY), binding=UNARY))

    def keep(self, name: str, number: Number) -> Number:
        """The number in a variable of its own, before the statement."""
        own = self.fresh(name)
        self.emit("const {} {} = {};", str(number.type), own, number.code)
        return Number(number.type, own)

    def once(self, number: Number) -> Number:
        """A number that is used several times: a call is made once."""
        return self.keep("value", number) if number.code.calls else number

    def negative(self, value: Number) -> Number:
        """``-a``."""
        value = self.cast(value, INTEGER) if value.type is BOOLEAN else value
        code = c("-{}", value.code.within(UNARY + 1), binding=UNARY)
        return Number(value.type, code, None if value.constant is None else -value.constant)

    def calculation(self, operator: type[ast.operator], a: Number, b: Number) -> Number:
        """An operation on two numbers."""
        if operator in BITS:
            refuse_if(REAL in (a.type, b.type), "| or & of real numbers")
            kind = BOOLEAN if a.type is BOOLEAN and b.type is BOOLEAN else INTEGER
            return Number(
                kind, c("({} {} {})", a.code.within(ATOM), BITS[operator], b.code.within(ATOM))
            )
        if operator is ast.Pow:
            return self._power(a, b)
        if operator is ast.Div:
            return Number(REAL, infix(self.real(a).code, "/", self.real(b).code))
        kind = INTEGER if wider(a, b) is BOOLEAN else wider(a, b)
        a, b = self.cast(a, kind), self.cast(b, kind)
        if operator in (ast.FloorDiv, ast.Mod):
            return self._division(operator is ast.FloorDiv, a, b)
        refuse_if(operator not in OPERATORS, f"the operator {operator.__name__}")
        sign = OPERATORS[operator]
        constant = None
        if kind is INTEGER and a.constant is not None and b.constant is not None:
            x, y = int(a.constant), int(b.constant)
            constant = {"+": x + y, "-": x - y, "*": x * y}[sign]
            if (a.code.text, b.code.text) == (str(x), str(y)):  # and not their names
                return self.constant(constant)
        return Number(kind, infix(a.code, sign, b.code), constant)

    def _power(self, a: Number, b: Number) -> Number:
        """A real number to a power; to a small one that is known when compiling, a product."""
        exponent = b.constant
        if isinstance(exponent, int) and 2 <= exponent <= LARGEST_POWER and a.type is REAL:
            return self.helped(REAL, f"power_{exponent}", a)
        refuse_if(a.type is not REAL and b.type is not REAL, "a power of integers")
        return self._called(self.unit.function("pow"), a, b)

    def _division(self, quotient: bool, a: Number, b: Number) -> Number:
        """Quotient or rest, rounded down as Python does."""
        if a.type is REAL:
            refuse_if(quotient, "// of real numbers")
            return self.helped(REAL, "real_mod", a, b)
        if isinstance(a.constant, int) and isinstance(b.constant, int) and b.constant > 0:
            return self.constant(a.constant // b.constant if quotient else a.constant % b.constant)
        return self.helped(INTEGER, "floor_div" if quotient else "floor_mod", a, b)

    def helped(self, kind: Scalar, name: str, *numbers: Number) -> Number:
        """A function of helpers.c."""
        codes = joined([number.code for number in numbers])
        return Number(kind, c("{}({})", self.unit.helper(name), codes))

    def _called(self, name: str, *numbers: Number) -> Number:
        """A function of C's library."""
        return Number(
            REAL, c("{}({})", name, joined([self.real(number).code for number in numbers]))
        )

    def comparison(self, operator: type[ast.cmpop], a: Number, b: Number) -> Number:
        """A comparison of two numbers."""
        sign, compare = COMPARISONS[operator]
        if a.constant is not None and b.constant is not None:
            return self.constant(bool(compare(a.constant, b.constant)))
        kind, binding = wider(a, b), BINDING[sign]
        left, right = self.cast(a, kind).code, self.cast(b, kind).code
        return Number(BOOLEAN, infix(left.within(binding + 1), sign, right))

    def conditions(self, sign: str, parts: Sequence[Number]) -> Number:
        """Several conditions with ``&&`` or ``||`` between them."""
        neutral = sign == "&&"
        parts = [part for part in parts if part.constant is not neutral]
        if len(parts) < 2:
            return parts[0] if parts else self.constant(neutral)
        codes = [part.code.within(BINDING["&&"] + 1) for part in parts]
        return Number(BOOLEAN, joined(codes, f" {sign} ", BINDING[sign]))

    def opposite(self, value: Number) -> Number:
        """``not a`` of a truth value."""
        if value.constant is not None:
            return self.constant(not value.constant)
        return Number(BOOLEAN, c("!{}", value.code.within(UNARY), binding=UNARY))

    def function_of_numbers(self, function: Any, numbers: Sequence[Number]) -> Number:
        """A function of :data:`LIBRARY`."""
        first = numbers[0]
        if function in MATHEMATICS:
            return self._called(self.unit.function(MATHEMATICS[function]), *numbers)
        if function in PREDICATES:
            code = c(
                "{}({}) != 0", PREDICATES[function], self.real(first).code, binding=BINDING["!="]
            )
            return Number(BOOLEAN, code)
        if function in EXTREMES:
            kind = INTEGER if wider(*numbers) is BOOLEAN else wider(*numbers)
            extreme = partial(self.helped, kind, f"{kind}_{EXTREMES[function]}")
            return reduce(extreme, [self.cast(number, kind) for number in numbers])
        if function in (builtins.abs, np.abs):
            if first.type is REAL:
                return self._called(self.unit.function("fabs"), first)
            return self.helped(INTEGER, "integer_abs", first)
        kinds = {builtins.float: REAL, builtins.bool: BOOLEAN}
        return self.cast(first, kinds.get(function, INTEGER))


def choice_of(condition: Code, a: Code, b: Code) -> Code:
    """One of two pieces of C."""
    below = BINDING["?"]
    parts = condition.within(below + 1), a.within(below + 1), b.within(below)
    return c("{} ? {} : {}", *parts, binding=below)
