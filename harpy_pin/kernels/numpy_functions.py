"""NumPy's functions and operators on arrays as C: products, sums, and arrays of several numbers.

Sums go from the first term to the last; NumPy does not say in which order it goes.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from harpy_pin.kernels.additions import diagonal
from harpy_pin.kernels.arrays import Arrays, as_number, elsewhere, number_type
from harpy_pin.kernels.code import Code, c
from harpy_pin.kernels.numbers import COMPARISONS, LIBRARY, OF_TWO
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, Array, Size, known
from harpy_pin.kernels.values import (
    AnArray,
    Computed,
    Items,
    Number,
    Refused,
    Value,
    View,
    refuse_if,
)

LONG = 6
"""Terms of a sum that are written out, without a loop."""

Join = Callable[[Number, Number], Number]


class NumpyFunctions(Arrays):
    """Translates operators and functions of which one result needs several elements."""

    def arithmetic(self, operator: type[ast.operator], a: Value, b: Value) -> Number | Computed:
        """An operation on numbers or arrays."""
        if operator is ast.MatMult:
            return self.product(a, b)
        return self.elementwise(partial(self.calculation, operator), a, b)

    def relation(self, operator: type[ast.cmpop], a: Value, b: Value) -> Number | Computed:
        """A comparison of numbers, arrays, or tuples of numbers."""
        if operator is ast.In and isinstance(a, Number) and isinstance(b, Items):
            number = self.once(a)
            found = [self.comparison(ast.Eq, number, as_number(item)) for item in b.items]
            return self.conditions("||", found)
        tuples = isinstance(a, Items) and isinstance(b, Items)
        refuse_if(
            operator not in ((ast.Eq, ast.NotEq) if tuples else COMPARISONS),
            f"the comparison {operator.__name__}",
        )
        if not isinstance(a, Items) or not isinstance(b, Items):
            return self.elementwise(partial(self.comparison, operator), a, b)
        pairs = zip(a.items, b.items, strict=False)
        parts = [self.comparison(ast.Eq, as_number(x), as_number(y)) for x, y in pairs]
        alike = len(a.items) == len(b.items)
        same = self.conditions("&&", parts) if alike else self.constant(False)
        return same if operator is ast.Eq else self.opposite(same)

    def product(self, a: Value, b: Value) -> Number | Computed:
        """``a @ b`` of vectors and matrices."""
        left, right = self._factor(a), self._factor(b)
        (inner,) = self.common_shape(left.shape[-1:], right.shape[:1])
        rows = len(left.shape) - 1

        def rule(indices: Sequence[Number]) -> Number:
            def term(k: Number) -> Number:
                row, column = [*indices[:rows], k], [k, *indices[rows:]]
                return self._times(self.element(left, row), self.element(right, column))

            return self._through(inner, term, self.plus, "0")

        if len(left.shape) + len(right.shape) == 2:
            return rule(())
        shape = (*left.shape[:-1], *right.shape[1:])
        return Computed(REAL, shape, rule, elsewhere(left, right))

    def _factor(self, value: Value, axes: Sequence[int] = (1, 2)) -> View:
        """A vector or a matrix in memory."""
        if not isinstance(value, AnArray) or len(value.shape) not in axes:
            raise Refused("a product of other things than vectors and matrices")
        return self.in_memory(value)

    def _times(self, a: Number, b: Number) -> Number:
        return self.calculation(ast.Mult, self.real(a), self.real(b))

    def plus(self, a: Number, b: Number) -> Number:
        """``a + b``."""
        return self.calculation(ast.Add, a, b)

    def _through(
        self, size: Size, term: Callable[[Number], Number], join: Join, none: Code | str
    ) -> Number:
        """Terms joined to one number, from the first to the last: written out, or by a loop before
        the statement.
        """
        if isinstance(size, int) and 0 < size <= LONG:
            value = term(self.constant(0))
            for k in range(1, size):
                value = join(value, term(self.constant(k)))
            return value
        index, before = self.fresh("k_"), self.emitted
        first, other = term(self.constant(0)), term(Number(INTEGER, index))
        refuse_if(self.emitted > before, "a sum of sums: give the inner one a name first")
        total, begins = Number(first.type, self.fresh("total")), 1
        if first.type is INTEGER:
            self.emit("{} {} = {};", str(total.type), total.code, none)
            begins = 0
        elif isinstance(size, int) and size:
            self.emit("{} {} = {};", str(total.type), total.code, first.code)
        else:
            begin = (str(total.type), total.code, size, first.code, none)
            self.emit("{} {} = {} > 0 ? {} : {};", *begin)
        joined = join(total, other).code
        loop = "for (integer {} = {}; {} < {}; {}++) {} = {};"
        self.emit(loop, index, begins, index, size, index, total.code, joined)
        return total

    def joined(
        self, array: Value, join: Join, none: Code | str, axis: Number | None = None
    ) -> Number | Computed:
        """All elements of a vector joined to one number, or those along one axis."""
        if not isinstance(array, AnArray) or (axis is None and len(array.shape) != 1):
            raise Refused("what goes through a vector, of something else")
        n = 0 if axis is None else int(axis.constant or 0)
        one = Number(number_type(array), Code("x"))
        kind = join(one, one).type

        def rule(at: Sequence[Number]) -> Number:
            def term(k: Number) -> Number:
                return self.cast(self.element(array, [*at[:n], k, *at[n:]]), kind)

            return self._through(array.shape[n], term, join, none)

        if axis is None:
            return rule(())
        shape = (*array.shape[:n], *array.shape[n + 1 :])
        return Computed(kind, shape, rule, elsewhere(array))

    def cross(self, a: Value, b: Value) -> Number | Computed:
        """``np.cross`` of vectors; one of them, or both, may be rows of a matrix."""
        left, right = self._factor(a), self._factor(b)
        refuse_if(
            left.shape[-1] != 3 or right.shape[-1] != 3,
            "a cross product of other arrays than of three numbers, or of rows of three",
        )
        turned = [(self._turned(left, n), self._turned(right, 3 - n)) for n in (1, 2)]
        first, second = (self.elementwise(self._times, *pair) for pair in turned)
        return self.elementwise(partial(self.calculation, ast.Sub), first, second)

    def _turned(self, rows: View, n: int) -> Computed:
        """Vectors of three numbers that begin with their number ``n``."""

        def rule(at: Sequence[Number]) -> Number:
            last = self.plus(at[-1], self.constant(n))
            last = self.calculation(ast.Mod, last, self.constant(3))
            return self.element(rows, [*at[:-1], last])

        return Computed(number_type(rows), rows.shape, rule, elsewhere(rows))

    def outer(self, a: Value, b: Value) -> Number | Computed:
        """``np.outer``."""
        left, right = self._factor(a, (1,)), self._factor(b, (1,))
        kind = Array(left.element, (*left.shape, 1), (*left.type.strides, 0))
        return self.elementwise(self._times, replace(left, type=kind), right)

    def transposed(self, a: AnArray) -> AnArray:
        """``a.T``: of what is in memory a view."""
        if isinstance(a, View) and not a.made:
            kind = Array(a.element, a.shape[::-1], a.type.strides[::-1])
            return replace(a, type=kind)
        return Computed(
            number_type(a), a.shape[::-1], lambda at: self.element(a, at[::-1]), elsewhere(a)
        )

    def diagonal(self, matrix: Value) -> View:
        """:func:`diagonal`."""
        if not isinstance(matrix, View) or len(matrix.shape) != 2:
            raise Refused("the diagonal of what is no matrix in memory")
        shape = self.common_shape(matrix.shape[:1], matrix.shape[1:])
        step = self.calculation(ast.Add, *map(self.size, matrix.type.strides))
        return replace(matrix, type=Array(matrix.element, shape, sizes_of(step)))

    def repeat(self, vector: Value, count: Value) -> Computed:
        """``np.repeat``."""
        if not isinstance(vector, AnArray) or len(vector.shape) != 1:
            raise Refused("np.repeat of what is no vector")
        times = as_number(count)
        size = self.calculation(ast.Mult, self.size(vector.shape[0]), times)

        def rule(at: Sequence[Number]) -> Number:
            return self.element(vector, [self.calculation(ast.FloorDiv, at[0], times)])

        return Computed(number_type(vector), sizes_of(size), rule, elsewhere(vector))

    def array_of(self, items: Value) -> View:
        """Numbers, or vectors of one length, as an array."""
        rows = [self.items_of(item) for item in self.items_of(items)]
        refuse_if(len({len(row) for row in rows}) != 1, "rows of different lengths")
        made = self.space("array", (len(rows), len(rows[0])) if rows[0] else (len(rows),))
        numbers = [number for row in rows for number in row] or self.items_of(items)
        for n, number in enumerate(numbers):
            self.emit("{}[{}] = {};", made.base, n, self.real(as_number(number)).code)
        return made

    def items_of(self, value: Value) -> tuple[Value, ...]:
        """Items of a tuple, or elements of a vector of a known length; of a number none."""
        if not isinstance(value, AnArray):
            return value.items if isinstance(value, Items) else ()
        if len(value.shape) != 1 or not isinstance(value.shape[0], int):
            raise Refused("the elements of what is no vector of a known length")
        return tuple(self.element(value, [self.constant(n)]) for n in range(value.shape[0]))

    def eye(self, size: Value) -> Computed:
        """``np.eye``."""
        (n,) = sizes_of(size)
        return Computed(REAL, (n, n), lambda at: self.real(self.comparison(ast.Eq, *at)))

    def work_space(self, shape: Value, every: Value | None = None) -> Computed:
        """``np.empty``, or ``np.full`` and ``np.zeros`` with what all elements are."""
        sizes = known(sizes_of(shape))
        if sizes is None:
            raise Refused("work space of a size that is not known when compiling")
        if every is None:
            return Computed(REAL, sizes)
        number = self.real(as_number(self.operand(as_number(every))))
        return Computed(REAL, sizes, lambda _: number, every=number)

    def extreme(self, name: str, a: Value, b: Value) -> Number | Computed:
        """``np.maximum`` or ``np.minimum``, which pass on what is no number."""
        return self.elementwise(partial(self._extreme_of_numbers, name), a, b)

    def _extreme_of_numbers(self, name: str, a: Number, b: Number) -> Number:
        return self.helped(REAL, name, self.real(a), self.real(b))

    def clip(self, a: Value, low: Value, high: Value) -> Number | Computed:
        """``np.clip``."""
        return self.extreme("minimum", self.extreme("maximum", a, low), high)

    def most(
        self, name: str, array: Value, axis: Number | None = None, initial: Number | None = None
    ) -> Number | Computed:
        """``np.max`` or ``np.min``."""
        none = "0" if initial is None else initial.code
        found = self.joined(array, partial(self._extreme_of_numbers, name), none, axis)
        return found if initial is None else self.extreme(name, found, initial)

    def place_of(self, beside: str, vector: Value) -> Number:
        """``np.argmax`` or ``np.argmin``: the first extreme, or the first that is no number."""
        if not isinstance(vector, AnArray) or len(vector.shape) != 1:
            raise Refused("the place in what is no vector")
        size = vector.shape[0]
        k, found, best, one = map(self.fresh, ("k_", "place", "best", "one"))
        first, other = (
            self.real(self.element(vector, [at])).code
            for at in (self.constant(0), Number(INTEGER, k))
        )
        self.emit("integer {} = 0;", found)
        self.emit("real {} = {} > 0 ? {} : 0;", best, size, first)
        with self.block(c("for (integer {} = 1; {} < {}; {}++)", k, k, size, k), loop=True):
            self.emit("const real {} = {};", one, other)
            better = (one, beside, best, best, best)
            with self.block(c("if (!({} {} {}) && {} == {})", *better)):
                self.emit("{} = {};", best, one)
                self.emit("{} = {};", found, k)
        self.emit("(void){};", found)  # of an array without elements nothing is read there
        return Number(INTEGER, found)

    def question(
        self, operator: type[ast.operator], array: Value, none: str, axis: Number | None = None
    ) -> Number | Computed:
        """``np.any`` or ``np.all`` of truth values, which become as wide as real numbers: so
        compilers do several at once.
        """
        if not isinstance(array, AnArray) or number_type(array) is not BOOLEAN:
            raise Refused("np.any or np.all of what are no truth values")
        numbers = self.elementwise(lambda truth: self.cast(truth, INTEGER), array)
        found = self.joined(numbers, partial(self.calculation, operator), none, axis)
        return self.elementwise(lambda number: self.cast(number, BOOLEAN), found)


def _of_numbers(function: Any) -> Callable[..., Value]:
    """A function of numbers for each element of arrays."""
    return lambda body, *values: body.elementwise(
        lambda *numbers: body.function_of_numbers(function, numbers), *values
    )


FUNCTIONS: dict[Any, tuple[int, Callable[..., Value]]] = {
    **{one: (2 if one in OF_TWO else 1, _of_numbers(one)) for one in LIBRARY},
    np.array: (1, NumpyFunctions.array_of),
    np.zeros: (1, lambda body, shape: body.work_space(shape, body.constant(0.0))),
    np.empty: (1, NumpyFunctions.work_space),
    np.full: (2, NumpyFunctions.work_space),
    np.eye: (1, NumpyFunctions.eye),
    np.repeat: (2, NumpyFunctions.repeat),
    diagonal: (1, NumpyFunctions.diagonal),
    np.dot: (2, NumpyFunctions.product),
    np.cross: (2, NumpyFunctions.cross),
    np.outer: (2, NumpyFunctions.outer),
    np.where: (3, lambda body, *given: body.elementwise(body.choice_of_numbers, *given)),
    np.maximum: (2, lambda body, a, b: body.extreme("maximum", a, b)),
    np.minimum: (2, lambda body, a, b: body.extreme("minimum", a, b)),
    np.clip: (3, NumpyFunctions.clip),
    np.any: (1, lambda body, a, **k: body.question(ast.BitOr, a, "0", **k)),
    np.all: (1, lambda body, a, **k: body.question(ast.BitAnd, a, "1", **k)),
    np.sum: (1, lambda body, a, **k: body.joined(a, body.plus, "0", **k)),
    np.argmax: (1, lambda body, a: body.place_of("<=", a)),
    np.argmin: (1, lambda body, a: body.place_of(">=", a)),
    np.max: (1, lambda body, a, **k: body.most("maximum", a, **k)),
    np.min: (1, lambda body, a, **k: body.most("minimum", a, **k)),
}
"""Functions of numbers and arrays: how many arguments they have, and what they become."""
KEYWORDS: dict[Any, set[str]] = {
    **{function: {"axis"} for function in (np.sum, np.any, np.all)},
    **{function: {"axis", "initial"} for function in (np.max, np.min)},
}
"""Arguments by name, which are numbers."""


def sizes_of(value: Value) -> tuple[Size, ...]:
    """A shape that is given by its sizes."""
    numbers = [as_number(item) for item in (value.items if isinstance(value, Items) else [value])]
    return tuple(
        number.constant if isinstance(number.constant, int) else number.code for number in numbers
    )
