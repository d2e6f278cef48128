"""Assignments of a kernel: variables of C, and what is written to arrays and records."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any, TypeVar

from harpy_pin.kernels.arrays import as_number, is_empty
from harpy_pin.kernels.body import Variable
from harpy_pin.kernels.code import NONE, Code
from harpy_pin.kernels.expressions import reads
from harpy_pin.kernels.parts import Parts
from harpy_pin.kernels.source import Source
from harpy_pin.kernels.types import SINGLE, Array, Scalar, Size
from harpy_pin.kernels.unit import CFunction, Unit
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
    refuse_if,
    refused,
)

SIGNS: dict[type[ast.operator], str] = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}
"""Operators that change a variable or an element."""
WRITES = "a call that writes where memory is changed: give its result a name first"
SWAPPED = "an array that an assignment beside it changes: give it a name first"
LONG = 16
"""Characters of a value that is written out for each of several targets."""


Known = TypeVar("Known")
Memory = tuple[frozenset[str], frozenset[str]]  # roots and ways of a view or a record


class Wider(Exception):
    """Something was learnt that what is written already depends on: start again."""


def stored(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Names that are assigned to anywhere in these nodes."""
    for node in nodes:
        yield from _stored_in(node)


@cache
def _stored_in(node: ast.AST) -> list[str]:
    return [
        part.id
        for part in ast.walk(node)
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
    ]


class Assignments(Parts):
    """Translates statements that give names, elements and fields their values: ``do_assign`` an
    ``ast.Assign``, and so on.
    """

    def __init__(
        self, unit: Unit, function: CFunction, source: Source, learnt: dict[object, Any]
    ) -> None:
        self.stores = Counter(stored([source.tree]))
        super().__init__(unit, function, source, set(self.stores) | set(source.parameters))
        self.learnt = learnt
        # what is known at each ``break`` and ``continue``, by the loops around
        self.jumps: list[list[dict[str, Value | None]]] = []
        self.arguments: dict[str, Number] = {}  # numbers that the kernel changes

    def learn(self, what: object, found: Known, both: Callable[[Known, Known], Known]) -> Known:
        """What is known from all places of the function, and earlier attempts to translate it; a
        new attempt begins where that is more than it was.
        """
        before: Known = self.learnt.setdefault(what, found)
        after = both(before, found)
        if after != before:
            self.learnt[what] = after
            raise Wider
        return before

    def do_assign(self, statement: ast.Assign) -> None:
        """``target = value``, or ``target = other = value``."""
        effects, (first, *others) = self.effects, statement.targets
        value = self.expression(statement.value)
        if others:
            if isinstance(value, Number) and (
                self.may_change(value.code) or len(value.code.text) > LONG
            ):
                value = self.keep("value", value)
        elif self.effects > effects and isinstance(first, ast.Subscript | ast.Attribute):
            # before the place that it goes to is looked for
            value = self.keep("value", as_number(value, WRITES))
        for target in statement.targets:
            self._assign(target, value)

    def may_change(self, code: Code) -> bool:
        """Whether the value of an expression may be another one later."""
        variables = [self.variables[name] for name in code.names & self.variables.keys()]
        changed = code.names & {number.code.text for number in self.arguments.values()}
        return code.loads or bool(changed) or any(self.stores[own.of] > 1 for own in variables)

    def do_annassign(self, statement: ast.AnnAssign) -> None:
        """``target: type = value``."""
        if statement.value is not None:
            self._assign(statement.target, self.expression(statement.value))

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Tuple):
            self._unpack(target, value)
        elif isinstance(target, ast.Name):
            self._set(target.id, value)
        elif isinstance(target, ast.Subscript | ast.Attribute):
            self._store(target, value)
        else:
            raise refused(target, ", to which nothing can be assigned")

    def _unpack(self, target: ast.Tuple, value: Value) -> None:
        """Several targets at once: what would be overwritten before it is read is kept first."""
        items = list(self.items_of(value))
        refuse_if(len(items) != len(target.elts), "another number of targets than of values")
        for n, element in enumerate(target.elts):
            names = set(stored([element]))
            changed = {own.name for own in self.variables.values() if own.of in names}
            changed |= {self.unit.identifier(name) for name in names}
            parts = ast.walk(element)
            memory = any(isinstance(part, ast.Subscript | ast.Attribute) for part in parts)
            items[n + 1 :] = [self._unharmed(item, changed, memory) for item in items[n + 1 :]]
        for element, item in zip(target.elts, items, strict=True):
            self._assign(element, item)

    def _unharmed(self, value: Value, names: set[str], memory: bool) -> Value:
        """A value that assignments to variables of these names, or to memory, do not change."""
        if isinstance(value, Items):
            return Items(tuple(self._unharmed(item, names, memory) for item in value.items))
        if isinstance(value, Computed):
            return value if value.every is not None or value.rule is None else self.in_memory(value)
        if isinstance(value, View) and value.made:
            return replace(value, made=False)
        if not isinstance(value, Number | View | Record):
            return value
        code = value.code if isinstance(value, Number) else value.address
        harmed = bool(code.names & names) or (memory and reads(value))
        return self.keep("next", as_number(value, SWAPPED)) if harmed else value

    def _set(self, name: str, value: Value) -> None:
        """Give a name a value."""
        if isinstance(value, Number):
            self.environment[name] = self._set_number(name, value)
        elif isinstance(value, Computed) or (isinstance(value, View) and value.made):
            self.environment[name] = self.in_memory(value, name)
        elif isinstance(value, View | Record):
            self.environment[name] = self._set_memory(name, value)
        else:
            raise Refused(f"'{name}', which is neither a number nor an array nor a record")

    def _set_number(self, name: str, value: Number) -> Number:
        argument = self.arguments.get(name)
        if argument is not None and self.environment.get(name) == argument:
            refuse_if(
                value.type.rank > argument.type.rank,
                f"'{name}', an argument of a narrower type: give the number another name",
            )
            self.emit("{} = {};", argument.code, self.cast(value, argument.type).code)
            return argument
        kind = self.learn(("number", name), value.type, _wider)
        value = self.cast(value, kind)
        own = self.variable(name, self.unit.identifier(name), self.unit.declare(kind, "{}"))
        constant = value.constant if self.stores[name] == 1 else None
        return Number(kind, self.write(own, value.code), constant)

    def _set_memory(self, name: str, value: View | Record) -> View | Record:
        """A name for an array or a record: a pointer."""
        if isinstance(value, View):
            value = replace(value, type=self._fix_sizes(name, value.type))
            if value.is_null:
                return value
        declared = self.unit.declare(value.type, "{}")
        own = self.variable(name, self.unit.identifier(name), declared)
        code = self.write(own, value.address)
        memory = (value.roots, value.ways)  # of all that it may stand for anywhere in the function
        return memory_at(code, value.type, *self.learn(("memory", own.name), memory, _all_memory))

    def _fix_sizes(self, name: str, kind: Array) -> Array:
        """The type of a view whose sizes no later assignment changes."""
        own = self.unit.identifier(name)
        fixed: dict[Code, Code] = {}

        def fix(axis: int, size: Code) -> Size:
            if size not in fixed and not self._lasting(size):
                made = self.fresh(f"{own}_size{axis or ''}").text
                self.variables[made] = Variable(made, made, f"integer {made}")
                fixed[size] = self.write(self.variables[made], size)
            return fixed.get(size, size)

        axes = len(kind.shape)
        return kind.mapped(fix, lambda axis, step: fix(axes + axis, step))

    def _lasting(self, size: Code) -> bool:
        """Whether a size is a name that stands for one number all the time."""
        (name,) = (size.text,) if size.is_name else ("",)
        return (
            name in self.taken - self.reserved
            or (self.stores[name] == 1 and not any(block.loop for block in self.path))
            or (name in self.source.parameters and self.stores[name] == 0)
        )

    def _place(self, target: ast.Subscript | ast.Attribute) -> Number | AnArray:
        """What is written: an element or a field, by its name in C, or a part of an array."""
        owner = self.expression(target.value)
        if isinstance(owner, Record) and isinstance(target, ast.Attribute):
            self.function.written |= owner.roots
            found = self.field(owner, target.attr)
            if isinstance(found, Number):
                return found._replace(code=found.code._replace(loads=owner.code.loads))
            if isinstance(found, View):
                return found
        if not isinstance(owner, AnArray) or not isinstance(target, ast.Subscript):
            raise refused(target, ", to which nothing can be assigned")
        part = self.part(self.in_memory(owner), target.slice)
        assert part.target is not None
        self.function.written |= part.target.roots
        if part.shape:
            return part
        if not isinstance(part, View) or not isinstance(part.element, Scalar):
            raise Refused("an assignment of a whole record")
        return Number(part.element, part.place)

    def _store(self, target: ast.Subscript | ast.Attribute, value: Value) -> None:
        """Write an element, a field, or a part of an array."""
        place = self._place(target)
        if isinstance(place, Number):
            number = self.cast(as_number(value), place.type)
            self.emit("{} = {};", place.code, number.code)
        elif isinstance(target, ast.Attribute):
            raise refused(target, ": an array is written through [:]")
        else:
            self.fill(place, self.array_of(value) if isinstance(value, Items) else value)

    def do_augassign(self, statement: ast.AugAssign) -> None:
        """``target += value``."""
        target, operator = statement.target, type(statement.op)
        place = self.expression(target) if isinstance(target, ast.Name) else self._place(target)
        if isinstance(target, ast.Name) and isinstance(place, Number):
            self._change(target, operator, self.number(statement.value))
        elif isinstance(place, Number):
            self._change_memory(place, operator, statement.value)
        elif not isinstance(place, AnArray):
            raise refused(target, " is neither a number nor an array")
        elif not is_empty(place):
            effects, value = self.effects, self.expression(statement.value)
            refuse_if(self.effects > effects, WRITES)
            if isinstance(place, View):
                self.function.written |= place.roots
            self.fill(place, self.arithmetic(operator, place, value))

    def _change(self, target: ast.Name, operator: type[ast.operator], value: Number) -> None:
        """``name += value``."""
        before = self.number(target)
        after = self.calculation(operator, before, value)
        own = self.variables.get(before.code.text)
        if own is None or after.type != before.type or operator not in SIGNS:
            self._set(target.id, after)
        else:
            self.write(own, self.cast(value, before.type).code, SIGNS[operator])

    def _change_memory(self, place: Number, operator: type[ast.operator], node: ast.expr) -> None:
        """``a[i] += value``, or that of a field."""
        refuse_if(place.type is SINGLE, "a change of an element of a float32 array")
        effects, emitted = self.effects, self.emitted
        value, before = self.number(node), Number(place.type, place.code.loaded)
        if self.effects > effects:
            refuse_if(self.emitted > emitted or place.code.loads, WRITES)
            before = self.keep("before", before)  # what Python reads first
        after = self.calculation(operator, before, value)
        if before.code.is_name or operator not in SIGNS or after.type != place.type:
            self.emit("{} = {};", place.code, self.cast(after, place.type).code)
        else:
            self.emit("{} {} {};", place.code, SIGNS[operator], self.cast(value, place.type).code)


def _wider(a: Scalar, b: Scalar) -> Scalar:
    return max(a, b, key=lambda kind: kind.rank)


def _all_memory(a: Memory, b: Memory) -> Memory:
    return a[0] | b[0], a[1] | b[1] if a[1] and b[1] else NONE
