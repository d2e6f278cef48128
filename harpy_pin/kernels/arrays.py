"""Arrays of a kernel as C: their elements, what is done element by element, and how they are
written to memory.

An array that is computed is no memory but a rule that gives the C of one element. It is written
where it is assigned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from itertools import product
from math import prod

from harpy_pin.kernels.code import BINDING, UNARY, Code, c, joined, variable
from harpy_pin.kernels.numbers import Numbers, choice_of, wider
from harpy_pin.kernels.overlaps import may_meet, may_overlap
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, SINGLE, Array, Scalar, Size, known
from harpy_pin.kernels.values import (
    AnArray,
    Computed,
    Items,
    Number,
    Record,
    Refused,
    Value,
    View,
    memory_at,
)

SHORT = 9
"""Elements that are written one by one, without a loop."""
SIDE = 3
"""Elements along one axis of a larger array that are written one by one."""

Shape = tuple[Size, ...]


class Arrays(Numbers):
    """Translates what is done with arrays element by element."""

    def element(self, array: AnArray, indices: Sequence[Number]) -> Number:
        """An element as a number."""
        if isinstance(array, View):
            return self.loaded(self.dereferenced(array).at(offset(array.type, indices)))
        if array.rule is None:
            raise Refused("a calculation with what was never written")
        return array.rule(indices)

    def loaded(self, view: View) -> Number:
        """The element that a view without axes is, as a number."""
        if not isinstance(view.element, Scalar):
            raise Refused("a calculation with an array of records")
        place = view.place.loaded
        if view.element is SINGLE:
            return Number(REAL, c("(real){}", place, binding=UNARY))
        return Number(view.element, place)

    def dereferenced(self, view: View) -> View:
        """An array whose elements are named, in a branch that a robot without them never comes
        to.
        """
        if not view.is_null:
            return view
        return replace(view, base=c("(({})NULL)", self.unit.declare(view.type, "").strip()))

    def elementwise(self, operation: Callable[..., Number], *values: Value) -> Number | Computed:
        """An operation on numbers for each element; a number counts for every element."""
        arrays = [value for value in values if isinstance(value, AnArray)]
        if not arrays:
            return operation(*map(as_number, values))
        shape = arrays[0].shape
        for array in arrays[1:]:
            shape = self._stretched(shape, array.shape)
        parts = [_plain(value) if 0 in shape else self.operand(value) for value in values]

        def rule(indices: Sequence[Number]) -> Number:
            return operation(*(self._at(part, indices) for part in parts))

        kind = operation(*(Number(number_type(part), Code("x")) for part in parts)).type
        reads = tuple(
            read for array in parts if isinstance(array, AnArray) for read in read_in(array, shape)
        )
        return Computed(kind, shape, rule, reads)

    def _at(self, value: Value, indices: Sequence[Number]) -> Number:
        """An element of an array that is stretched to so many axes, or the number that every
        element is.
        """
        if not isinstance(value, AnArray):
            return as_number(value)
        own = zip(value.shape, indices[len(indices) - len(value.shape) :], strict=True)
        return self.element(value, [self.constant(0) if n == 1 else index for n, index in own])

    def operand(self, value: Value) -> Number | AnArray:
        """An array, or a number that is computed once."""
        number = _plain(value)
        if not isinstance(number, Number):
            return number
        simple = number.constant is not None or number.code.is_name
        return number if simple else self.keep("factor", number)

    def common_shape(self, a: Shape, b: Shape, *, written: bool = False) -> Shape:
        """The shape of two arrays that must have the same.

        Where the first one is ``written``, an axis of one element tells that the other has one,
        too.
        """
        pairs = list(zip(a, b, strict=False))
        known = [(x, y) for x, y in pairs if isinstance(x, int) and isinstance(y, int)]
        stretched = any(x != y and (y == 1 or (x == 1 and not written)) for x, y in pairs)
        if len(a) != len(b) or stretched or any(x != y for x, y in known):
            raise Refused(f"an array of shape {shape_text(b)} where {shape_text(a)} is needed")
        for x, y in pairs:
            if self.unit.debug and x != y:
                self.emit("{}({}, {}, {}, __LINE__);", self.unit.helper("within"), x, y, x)
        return tuple(x if isinstance(x, int) else y for x, y in pairs)

    def _stretched(self, a: Shape, b: Shape) -> Shape:
        """NumPy's shape of an operation on two arrays: that of fewer axes counts for all along the
        first ones, and one element for all along its axis.
        """
        first, other = (a, b) if len(a) >= len(b) else (b, a)
        front = len(first) - len(other)
        sizes = [
            y if x == 1 else x if y == 1 else self.common_shape((x,), (y,))[0]
            for x, y in zip(first[front:], other, strict=True)
        ]
        return (*first[:front], *sizes)

    def choice(self, condition: Number, a: Value, b: Value) -> Value:
        """One of two values; of arrays that are computed, elements are chosen."""
        if isinstance(a, Items) and isinstance(b, Items) and len(a.items) == len(b.items):
            pairs = zip(a.items, b.items, strict=True)
            return Items(tuple(self.choice(condition, x, y) for x, y in pairs))
        numbers = isinstance(a, Number) and isinstance(b, Number)
        if numbers or isinstance(a, Computed) or isinstance(b, Computed):
            return self.elementwise(self.choice_of_numbers, condition, a, b)
        if isinstance(a, View | Record) and isinstance(b, View | Record) and a.type == b.type:
            code = choice_of(condition.code, a.address, b.address)
            ways = a.ways | b.ways if a.ways and b.ways else frozenset[str]()
            return memory_at(code, a.type, a.roots | b.roots, ways)
        raise Refused("two kinds of value, one of which is chosen at run time")

    def choice_of_numbers(self, condition: Number, a: Number, b: Number) -> Number:
        """One of two numbers."""
        kind = wider(a, b)
        codes = self.cast(a, kind).code, self.cast(b, kind).code
        return Number(kind, choice_of(self.cast(condition, BOOLEAN).code, *codes))

    def space(self, name: str, shape: Shape, kind: Scalar = REAL) -> View:
        """Work space; its size is known when compiling."""
        sizes = known(shape)
        if sizes is None:
            raise Refused(
                "an array that is computed, whose size is not known when compiling: write it to "
                "work space"
            )
        if 0 in sizes:
            return View(Array.packed(kind, shape), Code("NULL"))
        declared = f"{kind} {{}}[{prod(sizes)}]"
        own = self.variable(name, self.unit.identifier(name), declared, array=True).name
        self.work.append(own)
        memory = frozenset((own,))
        return View(Array.packed(kind, shape), variable(own), None, memory, memory)

    def in_memory(self, array: AnArray, name: str = "array") -> View:
        """An array that is in memory, where it is written before the statement if it is
        computed.
        """
        if isinstance(array, View):
            return replace(array, made=False)
        made = self.space(name, array.shape, array.element)
        if array.rule is not None:
            self.fill(made, array)
        return made

    def fill(self, place: AnArray, value: Value) -> None:
        """Write every element of an array, from a number, or from an array of its shape."""
        if is_empty(place):
            return
        sizes = [size if isinstance(size, int) else SHORT + 1 for size in place.shape]
        short = prod(sizes) <= SHORT
        if isinstance(value, AnArray):
            own = place.shape[-len(value.shape) :]
            all_of = (x if y == 1 else y for x, y in zip(own, value.shape, strict=False))
            self.common_shape(own, (*all_of, *value.shape[len(own) :]), written=True)
            value = value if short else self._apart(place, value)
        if isinstance(value, Computed) and value.every is not None:
            value = value.every
        value = self.operand(value)
        names: list[Code] = []
        axes: list[list[Number]] = []
        with ExitStack() as blocks:
            for axis, size in enumerate(sizes):
                if short or size <= SIDE:
                    axes.append([self.constant(n) for n in range(size)])
                    continue
                i = self.fresh("ijk"[axis] + "_")
                names.append(i)
                axes.append([Number(INTEGER, i)])
                header = c("for (integer {} = 0; {} < {}; {}++)", i, i, place.shape[axis], i)
                blocks.enter_context(self.block(header, loop=True))
            self.taken -= {name.text for name in names}
            self._fill_elements(place, value, list(product(*axes)))

    def _fill_elements(
        self, place: AnArray, value: Number | AnArray, places: list[tuple[Number, ...]]
    ) -> None:
        """Write elements: all are computed before the first is written, so that compilers may do
        several at once.
        """
        if not isinstance(place.element, Scalar):
            raise Refused("an assignment to whole records")
        kind, several = place.element, len(places) > 1 and isinstance(value, AnArray)
        with self.block(Code("")) if several else nullcontext():
            numbers = [self._at(value, at) for at in places]
            if several:
                numbers = [self.keep("element", self.cast(number, kind)) for number in numbers]
            for at, number in zip(places, numbers, strict=True):
                if isinstance(place, View):
                    written = self.dereferenced(place).at(offset(place.type, at)).place
                else:
                    written = self.element(place, at).code
                self.emit("{} = {};", written, self.cast(number, kind).code)
            if several:
                self.taken -= {number.code.text for number in numbers}

    def _apart(self, place: AnArray, value: AnArray) -> AnArray:
        """The array where writing another one does not change what is still to be read."""
        target, overlap = place.target, may_overlap if isinstance(place, View) else may_meet
        assert target is not None
        reads = read_in(value, place.shape)
        shared = [(array, here) for array, here in reads if target.roots & array.roots]
        if any((overlap if here else may_meet)(target, array) for array, here in shared):
            if isinstance(value, View):
                raise Refused("a part of an array becomes another part of it, and both may overlap")
            return self.in_memory(value)
        for array, here in reads:
            if not here:
                pairs = product(target.ways or target.roots, array.ways or array.roots)
                self.function.apart |= set(pairs)
        return value


def is_empty(array: AnArray) -> bool:
    """Whether an array certainly has no elements."""
    return 0 in array.shape or (isinstance(array, View) and array.is_null)


def _plain(value: Value) -> Number | AnArray:
    """A number or an array."""
    if not isinstance(value, Number | AnArray):
        raise Refused("a calculation with what is neither a number nor an array")
    return value


def as_number(
    value: Value, what: str = "something that is no number where one is needed"
) -> Number:
    """What must be a number."""
    if not isinstance(value, Number):
        raise Refused(what)
    return value


def number_type(value: Number | AnArray) -> Scalar:
    """The type of a number, or of an element as a number."""
    kind = value.type if isinstance(value, Number) else value.element
    if not isinstance(kind, Scalar):
        raise Refused("a calculation with an array of records")
    return REAL if kind is SINGLE else kind


def read_by(value: AnArray) -> tuple[tuple[View, bool], ...]:
    """Arrays in memory that an array reads, with whether only the element with the same indices is
    read.
    """
    return ((value, True),) if isinstance(value, View) else value.reads


def read_in(value: AnArray, shape: Shape) -> tuple[tuple[View, bool], ...]:
    """The same for an array that is stretched to a shape: that reads one element for several."""
    same = len(value.shape) == len(shape)
    same = same and all(x != 1 or y == 1 for x, y in zip(value.shape, shape, strict=True))
    return read_by(value) if same else elsewhere(value)


def elsewhere(*values: AnArray) -> tuple[tuple[View, bool], ...]:
    """Arrays that are read at other indices, too."""
    return tuple((array, False) for value in values for array, _ in read_by(value))


def offset(kind: Array, indices: Sequence[Number]) -> Code | None:
    """Where an element is, in elements from the first one; None where it is that."""
    fixed, terms = 0, []
    for index, step in zip(indices, kind.strides, strict=True):
        if isinstance(index.constant, int) and (isinstance(step, int) or index.constant == 0):
            fixed += index.constant * step if isinstance(step, int) else 0
        else:
            terms.append(steps(index, step))
    return sum_of(terms, fixed)


def steps(index: Number, step: Size) -> Code:
    """So many steps along an axis, in elements."""
    if step == 1:
        return index.code.within(BINDING["+"])
    factor = step.within(BINDING["*"]) if isinstance(step, Code) else step
    return c("{} * {}", factor, index.code.within(BINDING["*"] + 1), binding=BINDING["*"])


def sum_of(terms: list[Code], fixed: int) -> Code | None:
    """Terms and a number, one after the other; None where there is nothing."""
    terms = [*terms, *([Code(str(fixed))] if fixed else [])]
    return joined(terms, " + ", BINDING["+"]) if terms else None


def shape_text(shape: Shape) -> str:
    """A shape as Python writes it."""
    return f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
