"""Variables of C, and the assignments of a kernel that give them values."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.kernels.arrays import SHORT, SIDE, Arrays, as_array, offset, read_by
from harpy_pin.kernels.blocks import Assignment, Block, CFunction, Learnt, Variable, Wider, mentions
from harpy_pin.kernels.operators import ATOM, Refused, refused
from harpy_pin.kernels.overlaps import may_meet, may_overlap
from harpy_pin.kernels.source import Source
from harpy_pin.kernels.types import INTEGER, REAL, Array, Function, Scalar, Struct, Tuple, Value

if TYPE_CHECKING:
    from harpy_pin.kernels.unit import Unit


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


SIGNS: dict[type[ast.operator], str] = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}
"""Operators that change a variable or an element."""


class Assignments(Arrays):
    """Keeps account of names and variables, and translates what gives them values."""

    def __init__(self, unit: Unit, source: Source, name: str, learnt: Learnt) -> None:
        self.unit, self.source = unit, source
        self.function = CFunction(name, [])
        self.environment: dict[str, Value | None] = {}
        self.variables: dict[str, Variable] = {}
        self.taken: set[str] = set()
        self.learnt, self.result = learnt, learnt.result
        self.jumps: list[list[dict[str, Value | None]]] = []
        self.work: list[str] = []
        self.sizes: list[str] = []
        self.numbers: set[str] = set()
        self.path: list[Block] = [Block()]
        self.stores = Counter(stored([source.tree]))
        self.local = set(self.stores) | set(source.parameters)

    def emit(self, line: str) -> None:
        """Add a line."""
        self.emitted += 1
        self._uses(line)
        self.path[-1].items.append(line)

    def _block(self, header: str, *, loop: bool = False) -> Block:
        self._uses(header)
        block = Block(header, loop)
        self.path[-1].items.append(block)
        return block

    def size(self, size: int | str) -> Value:
        """A size of an array as a number; one that is a parameter is needed from now on."""
        if isinstance(size, str):
            self._uses(size)
        return super().size(size)

    def _uses(self, code: str) -> None:
        for size in self.sizes:
            if size in self.variables and mentions(code, size):
                self._mention(Value(INTEGER, size))
        for _, kind in self.function.parameters:
            if isinstance(kind, Array):
                self.function.sizes |= {size for size in kind.sizes if mentions(code, size)}

    def _mention(self, value: Value) -> None:
        variable = self.variables.get(value.code)
        if variable is not None:
            variable.places.append(self._here())

    def _here(self) -> tuple[tuple[Block, int], ...]:
        """The blocks around the next line, with its position in each."""
        return tuple(
            (block, len(block.items) - (block is not self.path[-1])) for block in self.path
        )

    def _writes(self, value: Value) -> None:
        self.function.written |= value.roots

    def keep(self, name: str, value: Value) -> Value:
        """The value in a variable of its own, before the statement."""
        if isinstance(value.type, Tuple):
            return Value(value.type, items=tuple(self.keep(name, item) for item in value.items))
        if value.rule is not None:
            return self.in_memory(value)
        own = self.fresh(name)
        if isinstance(value.type, Scalar):
            self.emit(f"const {value.type} {own} = {value.code};")
            return Value(value.type, own)
        self.emit(f"{self.unit.declare(value.type, f'const {own}')} = {value.code};")
        return replace(value, code=own, binding=ATOM)

    def in_memory(self, array: Value, name: str = "array") -> Value:
        """An array that is in memory, where it is written before the statement if it is
        computed.
        """
        if array.rule is None or array.code:
            return replace(array, rule=None, reads=())
        made = self.space(name, as_array(array).shape)
        self._fill(made, array)
        return made

    def fresh(self, name: str) -> str:
        """A name that nothing has, which begins so."""
        own, n = name, 2
        while own in self.taken or own in map(self.unit.identifier, self.local):
            own, n = f"{name}_{n}", n + 1
        self.taken.add(own)
        return own

    def _set(self, name: str, value: Value) -> None:
        """Give a name a value."""
        own = self.unit.identifier(name)
        kind = value.type
        if isinstance(kind, Scalar):
            before = self.environment.get(name)
            if (
                before is not None
                and before.code in self.numbers
                and isinstance(before.type, Scalar)
            ):
                if kind.rank > before.type.rank:
                    raise Refused(
                        f"'{name}', an argument of a narrower type: give the number another name"
                    )
                self._mention(before)
                self.emit(f"{before.code} = {self.cast(value, before.type).code};")
                return
            rank = self.learnt.ranks.setdefault(name, kind)
            if kind.rank > rank.rank:
                self.learnt.ranks[name] = kind
                raise Wider
            value = self.cast(value, rank)
            own = self._variable(name, self.unit.declare(rank, "{}"))
            self._write(own, value.code)
            constant = value.constant if self.stores[name] == 1 else None
            self.environment[name] = Value(
                rank, own, constant=constant, volatile=self.stores[name] > 1
            )
        elif isinstance(kind, Array) and value.rule is not None:
            self.environment[name] = self.in_memory(value, name)
        elif isinstance(kind, Array | Struct):
            kind = self._fix_sizes(name, kind) if isinstance(kind, Array) else kind
            if value.code == "NULL":
                self.environment[name] = replace(value, type=kind)
                return
            own = self._variable(name, self.unit.declare(kind, "{}"))
            self._write(own, value.code)
            roots, fields = self._all_memory(own, value)
            self.environment[name] = Value(kind, own, roots=roots, fields=fields)
        elif isinstance(kind, Tuple) and kind.uniform is not None:
            own = self._variable(name, f"{kind.uniform} {{}}[{len(kind.items)}]", array=True)
            items = [
                item if item.constant is not None else self.keep(f"{own}_item", item)
                for item in value.items
            ]
            for n, item in enumerate(items):
                self._mention(Value(kind, own))
                self.emit(f"{own}[{n}] = {item.code};")
            same = tuple(
                Value(kind.uniform, f"{own}[{n}]", volatile=True) for n in range(len(items))
            )
            self.environment[name] = Value(kind, own, items=same)
        else:
            raise Refused(
                f"'{name}', which is neither a number nor an array, a record, or numbers of one "
                f"type"
            )

    def _all_memory(self, own: str, value: Value) -> tuple[frozenset[str], frozenset[str]]:
        """The arguments, and the fields of records, that a variable may stand for anywhere in the
        function.
        """
        roots, fields = self.learnt.memory.setdefault(own, (value.roots, value.fields))
        wider = fields | value.fields if fields and value.fields else frozenset[str]()
        if value.roots <= roots and wider == fields:
            return roots, fields
        self.learnt.memory[own] = (roots | value.roots, wider)
        raise Wider

    def _fix_sizes(self, name: str, kind: Array) -> Array:
        """The type of a view whose sizes no later assignment changes."""
        own = self.unit.identifier(name)
        kept: dict[str, str] = {}
        for n, size in enumerate((*kind.shape, *kind.strides)):
            if isinstance(size, str) and size not in kept and not self._lasting(size):
                known = {word for word in kept if mentions(size, word)}
                code = (
                    size
                    if not known
                    else " * ".join(kept.get(word, word) for word in size.split(" * "))
                )
                kept[size] = self.fresh(f"{own}_size{n or ''}")
                self.variables[kept[size]] = Variable(kept[size], f"integer {kept[size]}")
                self.sizes.append(kept[size])
                self._write(kept[size], code)  # goes again where nothing reads it
        shape = tuple(
            kept.get(size, size) if isinstance(size, str) else size for size in kind.shape
        )
        if kind.is_packed:
            return Array.packed(kind.element, shape)
        return Array(
            kind.element,
            shape,
            tuple(kept.get(n, n) if isinstance(n, str) else n for n in kind.strides),
        )

    def _lasting(self, code: str) -> bool:
        """Whether an expression is a name that stands for one number all the time."""
        parameters = {
            size
            for _, kind in self.function.parameters
            if isinstance(kind, Array)
            for size in kind.sizes
        }
        return code.isidentifier() and (
            code in parameters
            or code in self.taken - set(map(self.unit.identifier, self.local))
            or (self.stores.get(code, 0) == 1 and not any(b.loop for b in self.path))
            or (code in self.source.parameters and self.stores.get(code, 0) == 0)
        )

    def _variable(
        self, name: str, declaration: str, *, array: bool = False, fresh: bool = False
    ) -> str:
        """The C variable of a name; another one where the name stood for another kind of thing, or
        is to be fresh.
        """
        own, n = self.unit.identifier(name), 1
        while True:
            known = self.variables.get(own)
            if known is not None and known.declaration == declaration.format(own) and not fresh:
                return own
            if known is None and own not in self.taken:
                break
            n += 1
            own = f"{self.unit.identifier(name)}_{n}"
        self.taken.add(own)
        self.variables[own] = Variable(own, declaration.format(own), array)
        return own

    def _write(self, own: str, code: str, sign: str = "=") -> None:
        self._uses(code)
        variable = self.variables[own]
        variable.places.append(self._here())
        self.path[-1].items.append(Assignment(variable, code, sign))

    def _unharmed(self, value: Value, names: set[str], memory: bool) -> Value:
        """A value that assignments to variables of these names, or to memory, do not change."""
        if isinstance(value.type, Tuple):
            items = tuple(self._unharmed(item, names, memory) for item in value.items)
            return value if items == value.items else Value(value.type, items=items)
        if not isinstance(value.type, Scalar | Array | Struct) or value.constant is not None:
            return value
        if value.rule is not None:
            return self.in_memory(value)
        harmed = any(mentions(value.code, name) for name in names) or (
            memory and self._reads(value)
        )
        return self.keep("next", value) if harmed else value

    def _variables_of(self, name: str) -> set[str]:
        """The variables of C that a name stands for, or has stood for."""
        own = self.unit.identifier(name)
        return {own, *(known for known in self.variables if known.startswith(f"{own}_"))}

    def _do_assign(self, statement: ast.Assign) -> None:
        if len(statement.targets) == 1:
            if self._makes_array(statement.targets[0], statement.value):
                return
            effects = self.effects
            value = self.expression(statement.value)
            if self.effects > effects and isinstance(
                statement.targets[0], ast.Subscript | ast.Attribute
            ):
                value = self.keep("value", value)  # before the place that it goes to is looked for
            self._assign(statement.targets[0], value, ast.unparse(statement.targets[0]))
            return
        value = self.expression(statement.value)
        if value.code and (value.volatile or len(value.code) > 16):
            value = self.keep("value", value)
        for target in statement.targets:
            self._assign(target, value, "")

    def _do_annassign(self, statement: ast.AnnAssign) -> None:
        if statement.value is not None:
            self._assign(statement.target, self.expression(statement.value), "")

    def _assign(self, target: ast.expr, value: Value, text: str) -> None:
        if isinstance(target, ast.Tuple):
            self._unpack(target, value)
        elif isinstance(target, ast.Name):
            self._set(target.id, value)
        elif isinstance(target, ast.Subscript):
            self._store(target, value)
        elif isinstance(target, ast.Attribute):
            place = self.expression(target)
            if not isinstance(place.type, Scalar):
                raise refused(target, ": an array is written through [:]")
            self._writes(place)
            self.emit(f"{place.code} = {self.cast(value, place.type).code};")
        else:
            raise Refused(f"an assignment to '{ast.unparse(target)}'")

    def _unpack(self, target: ast.Tuple, value: Value) -> None:
        """Several targets at once: what would be overwritten before it is read is kept first."""
        items = list(self.items_of(value))
        if len(items) != len(target.elts):
            raise Refused("another number of targets than of values")
        for n, element in enumerate(target.elts):
            names = {
                variable for name in stored([element]) for variable in self._variables_of(name)
            }
            memory = any(
                isinstance(part, ast.Subscript | ast.Attribute) for part in ast.walk(element)
            )
            for m in range(n + 1, len(items)):
                items[m] = self._unharmed(items[m], names, memory)
        for element, item in zip(target.elts, items, strict=True):
            self._assign(element, item, "")

    def _makes_array(self, target: ast.expr, value: ast.expr) -> bool:
        """Work space of a constant size: ``np.empty`` or ``np.zeros``."""
        if (
            isinstance(target, ast.Tuple)
            and isinstance(value, ast.Tuple)
            and len(target.elts) == len(value.elts)
        ):
            if not any(map(self._calls_numpy, value.elts)):
                return False
            for one, part in zip(target.elts, value.elts, strict=True):
                if not self._makes_array(one, part):
                    self._assign(one, self.expression(part), "")
            return True
        if not self._calls_numpy(value):
            return False
        assert isinstance(value, ast.Call)
        function = self.expression(value.func)
        if len(value.args) != 1 or value.keywords:
            raise refused(value, ": work space has a shape, and its elements are real numbers")
        parts = (
            list(value.args[0].elts) if isinstance(value.args[0], ast.Tuple) else [value.args[0]]
        )
        sizes = tuple(
            size for part in parts if isinstance(size := self.integer(part).constant, int)
        )
        if not isinstance(target, ast.Name) or len(sizes) < len(parts):
            raise refused(value, ": the size of work space must be known when compiling")
        made = self.environment[target.id] = self.space(target.id, sizes)
        if function.type == Function(np.zeros):
            self._fill(made, self.constant(0.0))
        return True

    def space(self, name: str, shape: tuple[int | str, ...]) -> Value:
        """Work space for real numbers; its size is known when compiling."""
        kind, sizes = Array.packed(REAL, shape), [size for size in shape if isinstance(size, int)]
        if len(sizes) < len(shape):
            raise Refused(
                "an array that is computed, whose size is not known when compiling: write it to "
                "work space"
            )
        if kind.empty:
            return Value(kind, "NULL")
        own = self._variable(name, f"{REAL} {{}}[{prod(sizes)}]", array=True, fresh=True)
        self.work.append(own)
        self._mention(Value(kind, own))
        return Value(kind, own, roots=frozenset((own,)), fields=frozenset((own,)))

    def _calls_numpy(self, value: ast.expr) -> bool:
        if not (isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute)):
            return False
        module = value.func.value
        known = isinstance(module, ast.Name) and module.id not in self.environment
        found = self.expression(value.func) if known else None
        return (
            found is not None
            and isinstance(found.type, Function)
            and found.type.target in (np.empty, np.zeros)
        )

    def _store(self, target: ast.Subscript, value: Value) -> None:
        """Write into an array: an element, or a view of it from a number or an array of the same
        shape.
        """
        owner = self.expression(target.value)
        if not isinstance(owner.type, Array):
            raise refused(target.value, " is no array")
        view = self.part(owner, target.slice)
        self._writes(view)
        assert isinstance(view.type, Array)
        if view.type.shape:
            self._fill(view, value)
        elif isinstance(view.type.element, Scalar):
            self.emit(f"{view.code} = {self.cast(value, view.type.element).code};")
        else:
            raise Refused("an assignment of a whole record")

    def _fill(self, view: Value, value: Value) -> None:
        """Write every element of a view, from a number, or from an array of its shape."""
        kind = as_array(view)
        if kind.empty or view.code == "NULL":
            return
        if isinstance(value.type, Tuple):
            value = self.array_of(value)
        known = [size if isinstance(size, int) else SHORT + 1 for size in kind.shape]
        short = prod(known) <= SHORT
        if isinstance(value.type, Array):
            self.common_shape(kind.shape, value.type.shape, written=True)
            value = value if short else self._apart(view, value)
        value = self.operand(value)
        names: list[str] = []
        axes: list[Sequence[Value]] = []
        for axis, size in enumerate(known):
            if short or size <= SIDE:
                axes.append([self.constant(n) for n in range(size)])
                continue
            names.append(self.fresh("ijk"[axis] + "_"))
            axes.append([Value(INTEGER, names[-1])])
            header = (
                f"for (integer {names[-1]} = 0; {names[-1]} < {kind.shape[axis]}; {names[-1]}++)"
            )
            self.path.append(self._block(header, loop=True))
        self.taken -= set(names)
        self._fill_elements(view, value, list(product(*axes)))
        del self.path[len(self.path) - len(names) :]

    def _fill_elements(self, view: Value, value: Value, places: Sequence[Sequence[Value]]) -> None:
        """Write elements: all are computed before the first is written, so that compilers may do
        several at once.
        """
        kind = as_array(view).element
        assert isinstance(kind, Scalar)
        several = len(places) > 1 and isinstance(value.type, Array)
        if several:
            self.path.append(self._block("", loop=False))
        numbers = [
            self.element(value, at) if isinstance(value.type, Array) else value for at in places
        ]
        if several:
            numbers = [self.keep("element", self.cast(number, kind)) for number in numbers]
        for at, number in zip(places, numbers, strict=True):
            plain = (
                self.at(self.dereferenced(view), offset(as_array(view), at))
                if view.rule is None
                else ""
            )
            place = plain if view.rule is None else view.rule(at).code
            self.emit(f"{place} = {self.cast(number, kind).code};")
        if several:
            self.taken -= {number.code for number in numbers}
            self.path.pop()

    def _apart(self, view: Value, value: Value) -> Value:
        """The array where writing the view does not change what is still to be read."""
        reads = read_by(value)
        shared = [(array, here) for array, here in reads if view.roots & array.roots]
        if any(
            may_overlap(view, array) if here else may_meet(view, array) for array, here in shared
        ):
            if value.rule is None:
                raise Refused("a part of an array becomes another part of it, and both may overlap")
            return self.in_memory(value)
        for array, here in reads:
            if not here:
                self.function.apart |= set(
                    product(view.fields or view.roots, array.fields or array.roots)
                )
        return value

    def _do_augassign(self, statement: ast.AugAssign) -> None:
        target, operator = statement.target, statement.op
        place = self.expression(target)
        if isinstance(place.type, Array) and (place.type.empty or place.code == "NULL"):
            return
        if isinstance(target, ast.Name) and isinstance(place.type, Scalar):
            self._change(target, operator, self.scalar(statement.value))
            return
        if isinstance(place.type, Scalar) and place.binding < ATOM:
            raise Refused("a change of an element of a float32 array")
        self._writes(place)
        effects, emitted = self.effects, self.emitted
        value = self.expression(statement.value)
        if self.effects > effects:
            if (
                not isinstance(place.type, Scalar)
                or self.emitted > emitted
                or place.code.count("[") > 1
            ):
                raise Refused(
                    "a call that writes where memory is changed: give its result a name first"
                )
            before = self.keep("before", place)  # what Python reads first
            result = self.arithmetic(operator, before, value)
            self.emit(f"{place.code} = {self.cast(result, place.type).code};")
            return
        if isinstance(place.type, Array):
            self._fill(place, self.arithmetic(operator, place, value))
            return
        assert isinstance(place.type, Scalar)
        result = self.arithmetic(operator, place, value)
        if type(operator) in SIGNS and result.type == place.type:
            self.emit(f"{place.code} {SIGNS[type(operator)]} {self.cast(value, place.type).code};")
        else:
            self.emit(f"{place.code} = {self.cast(result, place.type).code};")

    def _change(self, target: ast.Name, operator: ast.operator, value: Value) -> None:
        """``name += value``."""
        before = self.scalar(target)
        after = self.arithmetic(operator, before, value)
        variable = self.variables.get(before.code)
        if variable is None or after.type != before.type or type(operator) not in SIGNS:
            self._set(target.id, after)
            return
        assert isinstance(before.type, Scalar)
        self._write(before.code, self.cast(value, before.type).code, SIGNS[type(operator)])
