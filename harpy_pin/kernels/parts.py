"""Parts of what a kernel is given: fields of records, elements and slices of arrays."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import replace
from functools import partial, reduce
from math import prod

import numpy as np

from harpy_pin.kernels.arrays import elsewhere, number_type, shape_text, steps, sum_of
from harpy_pin.kernels.code import ATOM, BINDING, Code, c
from harpy_pin.kernels.expressions import Expressions
from harpy_pin.kernels.numpy_functions import sizes_of
from harpy_pin.kernels.overlaps import part_of, stems
from harpy_pin.kernels.types import INTEGER, Array, Scalar, Size, Struct, known
from harpy_pin.kernels.values import (
    AnArray,
    Computed,
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


class Parts(Expressions):
    """Translates ``a.b`` and ``a[b]``."""

    def _attribute(self, node: ast.Attribute) -> Value:
        owner = self.expression(node.value)
        if owner == Named(np):
            if not hasattr(np, node.attr):
                raise refused(node, ", which is not there")
            return self.known(getattr(np, node.attr), node.attr)
        if isinstance(owner, Record):
            return self.field(owner, node.attr)
        if isinstance(owner, AnArray) and node.attr == "T":
            return self.transposed(owner)
        if not isinstance(owner, AnArray) or node.attr not in ("shape", "size"):
            raise refused(node)
        sizes = [self.size(n) for n in owner.shape]
        if node.attr == "shape":
            return Items(tuple(sizes))
        return reduce(partial(self.calculation, ast.Mult), sizes)

    def field(self, owner: Record, name: str) -> Number | View | Record:
        """A field of a record."""
        fields = owner.type.fields()
        if name not in fields:
            raise Refused(f"a record without '{name}'; it has {', '.join(fields)}")
        kind, own = fields[name], self.unit.identifier(name)
        code = c("{}{}{}", owner.code.within(ATOM), "->" if owner.pointer else ".", own)
        ways = frozenset(f"{way}.{name}" for way in owner.ways)
        if isinstance(kind, Array):
            return View(kind, Code("NULL") if kind.empty else code, None, owner.roots, ways)
        if isinstance(kind, Struct):
            return Record(kind, code, False, owner.roots, ways)
        assert isinstance(kind, Scalar)
        return Number(kind, code.loaded)

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.expression(node.value)
        if isinstance(owner, Items):
            n = self.integer(node.slice).constant
            if not isinstance(n, int) or not 0 <= n < len(owner.items):
                raise refused(node, ": an item of a tuple that is not known when compiling")
            return owner.items[n]
        if not isinstance(owner, AnArray):
            raise refused(node.value, " is no array")
        part = self.part(self.in_memory(owner), node.slice)
        if part.shape or isinstance(part, Computed):
            return part
        if isinstance(part.element, Scalar):
            return self.loaded(part)
        code = part.base if part.offset is None else part.place
        return Record(part.element, code, part.offset is None, part.roots, part.ways)

    def part(self, owner: View, index: ast.expr) -> AnArray:
        """A part of an array: a view, or elements chosen by one array of indices."""
        parts = list(index.elts) if isinstance(index, ast.Tuple) else [index]
        slices = [isinstance(part, ast.Slice) for part in parts]
        chosen = {
            n: value
            for n, part in enumerate(parts)
            if not isinstance(part, ast.Slice | ast.Constant)
            and isinstance(value := self.expression(part), AnArray)
        }
        if not chosen:
            return self._view(owner, parts)
        place, indices = next(iter(chosen.items()))
        refuse_if(
            len(chosen) > 1 or len(indices.shape) > 1 or number_type(indices) is not INTEGER,
            "a choice of elements by anything but one vector of integers",
        )
        whole = self._view(
            owner, [ast.Slice() if n == place else part for n, part in enumerate(parts)]
        )
        before = sum(slices[:place])
        refuse_if(
            before < place and len(parts) > before + 1 + sum(slices[place:]),
            "a choice of elements beside an index",
        )

        def rule(at: Sequence[Number]) -> Number:
            n = self._inside(self.element(indices, at[before : before + 1]), whole.shape[before])
            return self.element(whole, [*at[:before], n, *at[before + 1 :]])

        shape = (*whole.shape[:before], *indices.shape, *whole.shape[before + 1 :])
        target = replace(whole, ways=frozenset(f"{way}+" for way in stems(owner.ways)))
        reads = elsewhere(whole, indices)
        return Computed(number_type(whole), shape, rule, reads, target=target)

    def _view(self, owner: View, parts: list[ast.expr]) -> View:
        """A part of an array, without axes where all of them have an index."""
        axes = list(zip(owner.shape, owner.type.strides, strict=True))
        count = len(parts) - sum(map(_is_new_axis, parts))
        refuse_if(count > len(axes), f"{count} indices of an array of {len(axes)} axes")
        fixed, terms, begins = 0, list[Code](), list[Number]()
        sizes, kept = list[Size](), list[Size]()
        for part in parts:
            if _is_new_axis(part):
                sizes, kept = [*sizes, 1], [*kept, 0]
                continue
            size, step = axes.pop(0)
            if isinstance(part, ast.Slice):
                start, length = self._slice(part, size)
                sizes, kept = [*sizes, length], [*kept, step]
                begins += [start] if part.lower or part.upper else []
            else:
                start = self._inside(self.integer(part), size)
            if isinstance(start.constant, int) and isinstance(step, int) and not self.unit.debug:
                fixed += start.constant * step
            elif step == 1 or start.constant != 0 or self.unit.debug:
                terms.append(steps(start, step))
        rest = (size for size, _ in axes), (step for _, step in axes)
        kind = Array(owner.element, (*sizes, *rest[0]), (*kept, *rest[1]))
        if not kind.shape:
            owner = self.dereferenced(owner)
        elif owner.is_null:
            terms, fixed = [], 0
        ways = part_of(owner, begins) if begins else owner.ways
        begin = owner.at(sum_of(terms, fixed))
        return View(kind, begin.base, begin.offset, begin.roots, ways)

    def _inside(self, value: Number, size: Size) -> Number:
        """An index, which is checked if it is known or C is made to be debugged."""
        if isinstance(value.constant, int):
            refuse_if(
                value.constant < 0 or (isinstance(size, int) and value.constant >= size),
                f"index {value.constant} of an axis of {size}",
            )
        elif self.unit.debug:
            name = self.unit.helper("inside")
            return Number(INTEGER, c("{}({}, {}, __LINE__)", name, value.code, size))
        return value

    def _slice(self, node: ast.Slice, size: Size) -> tuple[Number, Size]:
        """Where a slice begins, and its size."""
        refuse_if(node.step is not None, "a slice with a step")
        begin = self.integer(node.lower) if node.lower is not None else self.constant(0)
        end = self.integer(node.upper) if node.upper is not None else self.size(size)
        length = self._length(node, begin, end, size)
        for bound in (begin.constant, end.constant):
            refuse_if(
                isinstance(bound, int) and isinstance(size, int) and not 0 <= bound <= size,
                f"a slice to {bound} of an axis of {size}",
            )
        if self.unit.debug:
            name = self.unit.helper("within")
            code = c("{}({}, {}, {}, __LINE__)", name, begin.code, end.code, size)
            begin = Number(INTEGER, code, begin.constant)
        return begin, length

    def _length(self, node: ast.Slice, begin: Number, end: Number, size: Size) -> Size:
        """The size of a slice, which may be known although its ends are not."""
        lower, upper = node.lower, node.upper
        last = self._linear(upper) if upper is not None else None
        if last is None and isinstance(size, int):
            last = {"": size}
        if last is not None:
            first = self._linear(lower) if lower is not None else {}
            rest = {t: last.get(t, 0) - first.get(t, 0) for t in last.keys() | first.keys()}
            if not any(n for term, n in rest.items() if term):
                return rest.get("", 0)
        if (
            isinstance(upper, ast.BinOp)
            and isinstance(upper.op, ast.Add)
            and lower is not None
            and ast.unparse(upper.left) == ast.unparse(lower)
        ):
            return self.integer(upper.right).code
        if begin.constant == 0:
            return end.code
        return c("({} - {})", end.code, begin.code.within(BINDING["-"] + 1))

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
            terms = left.keys() | right.keys()
            return {term: left.get(term, 0) + sign * right.get(term, 0) for term in terms}
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            for factor, other in ((node.left, node.right), (node.right, node.left)):
                known = self.integer(factor).constant
                if isinstance(known, int):
                    return {term: known * n for term, n in self._linear(other).items()}
        return {ast.unparse(node): 1}

    def reshaped(self, owner: AnArray, arguments: list[ast.expr]) -> View:
        """``a.reshape(...)``, without a copy."""
        view = self.in_memory(owner)
        refuse_if(not view.type.is_packed, "reshape of a view with gaps")
        parts = arguments[0].elts if isinstance(arguments[0], ast.Tuple) else arguments
        shape = sizes_of(Items(tuple(self.integer(part) for part in parts)))
        new, old = known(shape), known(view.shape)
        negative = any(isinstance(n, int) and n < 0 for n in shape)
        refuse_if(
            negative or (new is not None and old is not None and prod(new) != prod(old)),
            f"reshape of {shape_text(view.shape)} to {shape_text(shape)}",
        )
        return replace(view, type=Array.packed(view.element, shape))


def _is_new_axis(part: ast.expr) -> bool:
    """Whether an index is ``None``, which makes an axis of one element."""
    return isinstance(part, ast.Constant) and part.value is None
