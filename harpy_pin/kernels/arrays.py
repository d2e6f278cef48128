"""Arrays that are computed: NumPy's operators and functions, element by element.

Such an array is no memory but a rule that gives the C of one element. It is written where it is
assigned. What reads an element several times, such as a product of matrices, puts it into memory
first. Sums go from the first term to the last; NumPy does not say in which order it goes.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harpy_pin.kernels.expressions import Expressions
from harpy_pin.kernels.operators import PRODUCT, SUM, UNARY, Refused, wrap
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, SINGLE, Array, Scalar, Struct, Value

SHORT = 9
"""Elements that are written one by one, without a loop."""
SIDE = 3
"""Elements along one axis of a larger array that are written one by one."""
LONG = 6
"""Terms of a sum that are written out, without a loop."""

Rule = Callable[[Sequence[Value]], Value]
Shape = tuple[int | str, ...]


class Arrays(Expressions):
    """Translates operators and functions whose result is an array, or that go through one."""

    def element(self, array: Value, indices: Sequence[Value]) -> Value:
        """An element as a number."""
        kind = as_array(array)
        if array.rule is not None:
            return array.rule(indices)
        if isinstance(kind.element, Struct):
            raise Refused("a calculation with an array of records")
        code = self.at(self.dereferenced(array), offset(kind, indices))
        if kind.element is SINGLE:
            return Value(REAL, f"(real){code}", UNARY, volatile=True)
        return Value(kind.element, code, volatile=True)

    def part(self, owner: Value, index: ast.expr) -> Value:
        """A part of an array: a view, or elements chosen by one array of indices."""
        parts = list(index.elts) if isinstance(index, ast.Tuple) else [index]
        chosen = {
            n: value
            for n, part in enumerate(parts)
            if isinstance((value := self._of_part(part)).type, Array)
        }
        if not chosen:
            return self.view(owner, parts)
        ((place, indices),) = chosen.items()
        whole = self.view(
            owner, [ast.Slice() if n == place else part for n, part in enumerate(parts)]
        )
        before = sum(isinstance(part, ast.Slice) for part in parts[:place])
        kind = as_array(whole)
        if len(chosen) > 1 or len(as_array(indices).shape) > 1 or _number(indices) is not INTEGER:
            raise Refused("a choice of elements by anything but one vector of integers")
        if before < place and len(parts) > before + 1 + sum(
            isinstance(part, ast.Slice) for part in parts[place:]
        ):
            raise Refused("a choice of elements beside an index")

        def rule(at: Sequence[Value]) -> Value:
            n = self.inside(self.element(indices, at[before : before + 1]), kind.shape[before])
            return self.element(whole, [*at[:before], n, *at[before + 1 :]])

        shape = (*kind.shape[:before], *as_array(indices).shape, *kind.shape[before + 1 :])
        packed, fields = (
            Array.packed(_number(whole), shape),
            (f"{path.partition('+')[0]}+" for path in owner.fields),
        )
        return Value(
            packed,
            rule=rule,
            roots=owner.roots,
            fields=frozenset(fields),
            reads=_elsewhere(whole, indices),
        )

    def _of_part(self, part: ast.expr) -> Value:
        """An index that may be an array; of a slice anything else."""
        return (
            self.constant(0)
            if isinstance(part, ast.Slice | ast.Constant)
            else self.expression(part)
        )

    def elementwise(self, operation: Callable[..., Value], *values: Value) -> Value:
        """An operation on numbers for each element; a number counts for every element."""
        arrays = [value for value in values if isinstance(value.type, Array)]
        if not arrays:
            return operation(*values)
        shape = as_array(arrays[0]).shape
        for array in arrays[1:]:
            shape = self.common_shape(shape, as_array(array).shape)
        parts = list(values) if 0 in shape else [self.operand(value) for value in values]

        def rule(indices: Sequence[Value]) -> Value:
            return operation(
                *(self.element(part, indices) if part in arrays else part for part in parts)
            )

        kind = operation(*(Value(_number(part), "x", volatile=True) for part in parts)).type
        assert isinstance(kind, Scalar)
        reads = tuple(read for part in arrays for read in read_by(part))
        return Value(Array.packed(kind, shape), rule=rule, reads=reads)

    def operand(self, value: Value) -> Value:
        """An array, or a number that is computed once."""
        if isinstance(value.type, Array) or value.constant is not None or value.code.isidentifier():
            return value
        if not isinstance(value.type, Scalar):
            raise Refused("a calculation with what is neither a number nor an array")
        return self.keep("factor", value)

    def common_shape(self, a: Shape, b: Shape, *, written: bool = False) -> Shape:
        """The shape of two arrays that must have the same; one row for many is Python's alone.

        Where the first one is ``written``, an axis of one element tells that the other has one,
        too.
        """
        pairs = list(zip(a, b, strict=False))
        known = [(x, y) for x, y in pairs if isinstance(x, int) and isinstance(y, int)]
        stretched = any(x != y and (y == 1 or (x == 1 and not written)) for x, y in pairs)
        if len(a) != len(b) or stretched or any(x != y for x, y in known):
            raise Refused(f"an array of shape {b} where {a} is needed")
        for x, y in pairs:
            if self.unit.debug and x != y:
                self.emit(f"{self.unit.helper('within')}({x}, {y}, {x}, __LINE__);")
        return tuple(x if isinstance(x, int) else y for x, y in pairs)

    def arithmetic(self, operator: ast.operator, a: Value, b: Value) -> Value:
        """An operation on numbers or arrays."""
        if isinstance(operator, ast.MatMult):
            return self._product(a, b)
        return self.elementwise(lambda x, y: super(Arrays, self).arithmetic(operator, x, y), a, b)

    def relation(self, operator: ast.cmpop, a: Value, b: Value) -> Value:
        """A comparison of numbers or arrays."""
        if isinstance(a.type, Array) or isinstance(b.type, Array):
            return self.elementwise(lambda x, y: super(Arrays, self).relation(operator, x, y), a, b)
        return super().relation(operator, a, b)

    def negative(self, value: Value) -> Value:
        """``-a`` of a number or an array."""
        return self.elementwise(super().negative, value)

    def choice(self, condition: Value, a: Value, b: Value) -> Value:
        """One of two values; of arrays that are computed, elements are chosen."""
        if a.rule is None and b.rule is None:
            return super().choice(condition, a, b)
        return self._where(condition, a, b)

    def _where(self, condition: Value, a: Value, b: Value) -> Value:
        choose = super().choice
        return self.elementwise(
            lambda c, x, y: choose(self.cast(c, BOOLEAN), x, y), condition, a, b
        )

    def _product(self, a: Value, b: Value) -> Value:
        """``a @ b`` of vectors and matrices."""
        a, b = self._factor(a), self._factor(b)
        left, right = as_array(a).shape, as_array(b).shape
        (inner,) = self.common_shape(left[-1:], right[:1])
        rows = len(left) - 1

        def rule(indices: Sequence[Value]) -> Value:
            def term(k: Value) -> Value:
                return self._times(
                    self.element(a, [*indices[:rows], k]), self.element(b, [k, *indices[rows:]])
                )

            return self._joined(inner, term, self._plus, "0")

        if len(left) + len(right) == 2:
            return rule(())
        return Value(
            Array.packed(REAL, (*left[:-1], *right[1:])), rule=rule, reads=_elsewhere(a, b)
        )

    def _factor(self, value: Value, axes: Sequence[int] = (1, 2)) -> Value:
        """A vector or a matrix in memory."""
        if not isinstance(value.type, Array) or len(value.type.shape) not in axes:
            raise Refused("a product of other things than vectors and matrices")
        return self.in_memory(value)

    def _times(self, a: Value, b: Value) -> Value:
        return self.arithmetic(ast.Mult(), self.real(a), self.real(b))

    def _plus(self, a: Value, b: Value) -> Value:
        return self.arithmetic(ast.Add(), a, b)

    def _joined(
        self,
        size: int | str,
        term: Callable[[Value], Value],
        join: Callable[[Value, Value], Value],
        none: str,
    ) -> Value:
        """Terms joined to one number, from the first to the last: written out, or by a loop before
        the statement.
        """
        if isinstance(size, int) and 0 < size <= LONG:
            value = term(self.constant(0))
            for k in range(1, size):
                value = join(value, term(self.constant(k)))
            return value
        index, before = Value(INTEGER, self.fresh("k_")), self.emitted
        first, other = term(self.constant(0)), term(index)
        if self.emitted > before:
            raise Refused("a sum of sums: give the inner one a name first")
        total = Value(first.type, self.fresh("total"), volatile=True)
        begin = (
            first.code if isinstance(size, int) and size else f"{size} > 0 ? {first.code} : {none}"
        )
        self.emit(f"{first.type} {total.code} = {begin};")
        loop = f"for (integer {index.code} = 1; {index.code} < {size}; {index.code}++)"
        self.emit(f"{loop} {total.code} = {join(total, other).code};")
        return total

    def _cross(self, a: Value, b: Value) -> Value:
        """``np.cross`` of vectors; one of them, or both, may be rows of a matrix."""
        a, b = self._factor(a), self._factor(b)
        left, right = as_array(a).shape, as_array(b).shape
        if left[-1] != 3 or right[-1] != 3:
            raise Refused(
                "a cross product of other arrays than of three numbers, or of rows of three"
            )
        shape = (
            self.common_shape(left, right) if len(left) == len(right) else max(left, right, key=len)
        )

        def rule(indices: Sequence[Value]) -> Value:
            next_, last = (self._turned(indices[-1], n) for n in (1, 2))
            first = self._times(of(a, indices, next_), of(b, indices, last))
            return self.arithmetic(
                ast.Sub(), first, self._times(of(a, indices, last), of(b, indices, next_))
            )

        def of(array: Value, indices: Sequence[Value], n: Value) -> Value:
            return self.element(array, [*indices[: len(as_array(array).shape) - 1], n])

        return Value(Array.packed(REAL, shape), rule=rule, reads=_elsewhere(a, b))

    def _turned(self, index: Value, n: int) -> Value:
        """An index of three, n places on."""
        return self.arithmetic(
            ast.Mod(), self.arithmetic(ast.Add(), index, self.constant(n)), self.constant(3)
        )

    def _outer(self, a: Value, b: Value) -> Value:
        a, b = self._factor(a, (1,)), self._factor(b, (1,))

        def rule(indices: Sequence[Value]) -> Value:
            return self._times(self.element(a, indices[:1]), self.element(b, indices[1:]))

        shape = (*as_array(a).shape, *as_array(b).shape)
        return Value(Array.packed(REAL, shape), rule=rule, reads=_elsewhere(a, b))

    def transposed(self, a: Value) -> Value:
        """``a.T``: of what is in memory a view."""
        kind, rule = as_array(a), a.rule
        shape = kind.shape[::-1]
        if rule is None:
            return replace(a, type=Array(kind.element, shape, kind.strides[::-1]))
        return Value(
            Array.packed(kind.element, shape), rule=lambda n: rule(n[::-1]), reads=_elsewhere(a)
        )

    def array_of(self, items: Value) -> Value:
        """Numbers, or vectors of one length, as an array."""
        rows = [self.items_of(item) for item in self.items_of(items)]
        if len({len(row) for row in rows}) != 1:
            raise Refused("rows of different lengths")
        shape = (len(rows), len(rows[0])) if rows[0] else (len(rows),)
        made = self.space("array", shape)
        numbers = [number for row in rows for number in row] or list(self.items_of(items))
        for n, number in enumerate(numbers):
            self.emit(f"{made.code}[{n}] = {self.real(number).code};")
        return made

    def items_of(self, value: Value) -> tuple[Value, ...]:
        """Items of a tuple, or elements of a vector of a known length; of a number none."""
        if not isinstance(value.type, Array):
            return value.items
        if len(value.type.shape) != 1 or not isinstance(value.type.shape[0], int):
            raise Refused("the elements of what is no vector of a known length")
        return tuple(self.element(value, [self.constant(n)]) for n in range(value.type.shape[0]))

    def _eye(self, size: Value) -> Value:
        n = size.constant if isinstance(size.constant, int) else size.code
        return Value(
            Array.packed(REAL, (n, n)), rule=lambda at: self.real(self.relation(ast.Eq(), *at))
        )

    def _through(self, join: Callable[[Value, Value], Value], array: Value, none: str) -> Value:
        """All elements of a vector joined to one number."""
        if not isinstance(array.type, Array) or len(array.type.shape) != 1:
            raise Refused("what goes through a vector, of something else")
        return self._joined(array.type.shape[0], lambda k: self.element(array, [k]), join, none)

    def of_arrays(self, function: Any, arguments: Sequence[Value]) -> Value:
        """A function of NumPy that knows arrays; a name of :data:`FUNCTIONS`."""
        count, make = FUNCTIONS[function]
        if len(arguments) != count:
            raise Refused(f"np.{function.__name__} of {len(arguments)} arguments")
        return make(self, *arguments)

    def extreme(self, name: str, array: Value) -> Value:
        """``np.max`` or ``np.min``."""
        return self._through(lambda a, b: self.extreme_of_two(name, a, b), array, "0")

    def extreme_of_two(self, name: str, a: Value, b: Value) -> Value:
        """``np.maximum`` or ``np.minimum``, which pass on what is no number."""
        return self.elementwise(
            lambda x, y: Value(
                REAL, f"{self.unit.helper(name)}({self.real(x).code}, {self.real(y).code})"
            ),
            a,
            b,
        )

    def clipped(self, a: Value, low: Value, high: Value) -> Value:
        """``np.clip``."""
        return self.extreme_of_two("minimum", self.extreme_of_two("maximum", a, low), high)

    def question(self, operator: ast.operator, array: Value, none: str) -> Value:
        """``np.any`` or ``np.all`` of a vector of truth values."""
        if _number(array) is not BOOLEAN:
            raise Refused("np.any or np.all of what are no truth values")
        return self._through(lambda x, y: self.arithmetic(operator, x, y), array, none)


FUNCTIONS: dict[Any, tuple[int, Callable[..., Value]]] = {
    np.array: (1, Arrays.array_of),
    np.eye: (1, Arrays._eye),
    np.dot: (2, Arrays._product),
    np.cross: (2, Arrays._cross),
    np.outer: (2, Arrays._outer),
    np.where: (3, Arrays._where),
    np.maximum: (2, lambda translator, a, b: translator.extreme_of_two("maximum", a, b)),
    np.minimum: (2, lambda translator, a, b: translator.extreme_of_two("minimum", a, b)),
    np.clip: (3, Arrays.clipped),
    np.any: (1, lambda translator, a: translator.question(ast.BitOr(), a, "false")),
    np.all: (1, lambda translator, a: translator.question(ast.BitAnd(), a, "true")),
    np.sum: (1, lambda translator, a: translator._through(translator._plus, a, "0")),
    np.max: (1, lambda translator, a: translator.extreme("maximum", a)),
    np.min: (1, lambda translator, a: translator.extreme("minimum", a)),
}
"""Functions of NumPy for arrays: how many arguments they have, and what they become."""


def as_array(value: Value) -> Array:
    """The type of what must be an array."""
    assert isinstance(value.type, Array)
    return value.type


def read_by(value: Value) -> tuple[tuple[Value, bool], ...]:
    """Arrays in memory that an array reads, with whether only the element with the same indices is
    read.
    """
    return value.reads if value.rule is not None else ((value, True),)


def _elsewhere(*values: Value) -> tuple[tuple[Value, bool], ...]:
    """Arrays that are read at other indices, too."""
    return tuple((array, False) for value in values for array, _ in read_by(value))


def _number(value: Value) -> Any:
    """The type of a number, or of an element as a number."""
    kind = value.type.element if isinstance(value.type, Array) else value.type
    return REAL if kind is SINGLE else kind


def offset(kind: Array, indices: Sequence[Value]) -> str:
    """Where an element is, in elements from the first one."""
    fixed, terms = 0, []
    for index, step in zip(indices, kind.strides, strict=True):
        if isinstance(index.constant, int) and (isinstance(step, int) or index.constant == 0):
            fixed += index.constant * int(step) if index.constant else 0
        else:
            terms.append(wrap(index, SUM) if step == 1 else f"{step} * {wrap(index, PRODUCT + 1)}")
    return " + ".join([*terms, *([str(fixed)] if fixed or not terms else [])])
