"""Variables of C: which ones there are, what they hold, and the lines that give them values."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from harpy_pin.compiled.blocks import Assignment, Block, Variable, mentions
from harpy_pin.compiled.expressions import Expressions
from harpy_pin.compiled.function import CFunction, Learnt, Wider
from harpy_pin.compiled.scalars import ATOM
from harpy_pin.compiled.source import Source
from harpy_pin.compiled.types import INTEGER, Array, Scalar, Struct, Tuple, Value

if TYPE_CHECKING:
    from harpy_pin.compiled.unit import Unit

__all__ = ["Variables", "stored"]


def stored(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Names that are assigned to anywhere in these nodes."""
    for node in nodes:
        for part in ast.walk(node):
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                yield part.id


class Variables(Expressions):
    """Keeps account of names and variables."""

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

    # --- lines and sizes -------------------------------------------------------------------------------------------

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
        return tuple((block, len(block.items) - (block is not self.path[-1])) for block in self.path)

    def _writes(self, value: Value) -> None:
        self.function.written |= value.roots

    # --- names -----------------------------------------------------------------------------------------------------

    def keep(self, name: str, value: Value) -> Value:
        """The value in a variable of its own, before the statement."""
        if isinstance(value.type, Tuple):
            return Value(value.type, items=tuple(self.keep(name, item) for item in value.items))
        own = self._fresh(name)
        if isinstance(value.type, Scalar):
            self.emit(f"const {value.type} {own} = {value.code};")
            return Value(value.type, own)
        self.emit(f"{self.unit.declare(value.type, f'const {own}')} = {value.code};")
        return replace(value, code=own, binding=ATOM)

    def _fresh(self, name: str) -> str:
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
            if before is not None and before.code in self.numbers and isinstance(before.type, Scalar):
                if kind.rank > before.type.rank:
                    self.learnt.arguments[name] = kind
                    raise Wider
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
            self.environment[name] = Value(rank, own, constant=constant, volatile=self.stores[name] > 1)
        elif isinstance(kind, Array | Struct):
            kind = self._fix_sizes(name, kind) if isinstance(kind, Array) else kind
            if value.code == "NULL":
                self.environment[name] = replace(value, type=kind)
                return
            own = self._variable(name, self.unit.declare(kind, "{}"))
            self._write(own, value.code)
            roots, fields = self._all_memory(own, value)
            self.environment[name] = Value(kind, own, roots=roots, fields=fields)
        elif isinstance(kind, Tuple):
            self._set_tuple(name, value)
        else:
            self.environment[name] = value

    def _all_memory(self, own: str, value: Value) -> tuple[frozenset[str], frozenset[str]]:
        """The arguments, and the fields of records, that a variable may stand for anywhere in the function."""
        roots, fields = self.learnt.memory.setdefault(own, (value.roots, value.fields))
        wider = fields | value.fields if fields and value.fields else frozenset[str]()
        if value.roots <= roots and wider == fields:
            return roots, fields
        self.learnt.memory[own] = (roots | value.roots, wider)
        raise Wider

    def _set_tuple(self, name: str, value: Value) -> None:
        kind = value.type
        assert isinstance(kind, Tuple)
        if kind.uniform is not None:
            own = self._variable(name, f"{kind.uniform} {{}}[{len(kind.items)}]", array=True)
            items = [item if item.constant is not None else self.keep(f"{own}_item", item) for item in value.items]
            for n, item in enumerate(items):
                self._mention(Value(kind, own))
                self.emit(f"{own}[{n}] = {item.code};")
            same = tuple(Value(kind.uniform, f"{own}[{n}]", volatile=True) for n in range(len(items)))
            self.environment[name] = Value(kind, own, items=same)
            return
        parts: list[Value] = []
        names = [self._part(name, n) for n in range(len(value.items))]
        items = [self._unharmed(item, set(names), False) for item in value.items]
        for own, item in zip(names, items, strict=True):
            self._set(own, item)
            part = self.environment[own]
            assert part is not None
            parts.append(part)
        self.environment[name] = Value(kind, items=tuple(parts))

    def _part(self, name: str, n: int) -> str:
        """A name for an item of a tuple."""
        own = f"{name}_{n}"
        while own in self.local:
            own += "_"
        self.stores[own] = self.stores[name]
        return own

    def _fix_sizes(self, name: str, kind: Array) -> Array:
        """The type of a view whose sizes no later assignment changes."""
        own = self.unit.identifier(name)
        kept: dict[str, str] = {}
        for n, size in enumerate((*kind.shape, *kind.strides)):
            if isinstance(size, str) and size not in kept and not self._lasting(size):
                known = {word for word in kept if mentions(size, word)}
                code = size if not known else " * ".join(kept.get(word, word) for word in size.split(" * "))
                kept[size] = self._fresh(f"{own}_size{n or ''}")
                self.variables[kept[size]] = Variable(kept[size], f"integer {kept[size]}")
                self.sizes.append(kept[size])
                self._write(kept[size], code)  # goes again where nothing reads it
        shape = tuple(kept.get(size, size) if isinstance(size, str) else size for size in kind.shape)
        if kind.is_packed:
            return Array.packed(kind.element, shape)
        return Array(kind.element, shape, tuple(kept.get(n, n) if isinstance(n, str) else n for n in kind.strides))

    def _lasting(self, code: str) -> bool:
        """Whether an expression is a name that stands for one number all the time."""
        parameters = {size for _, kind in self.function.parameters if isinstance(kind, Array) for size in kind.sizes}
        return code.isidentifier() and (
            code in parameters
            or code in self.taken - set(map(self.unit.identifier, self.local))
            or (self.stores.get(code, 0) == 1 and not any(b.loop for b in self.path))
            or (code in self.source.parameters and self.stores.get(code, 0) == 0)
        )

    def _variable(self, name: str, declaration: str, *, array: bool = False, fresh: bool = False) -> str:
        """The C variable of a name; another one where the name stood for another kind of thing, or is to be fresh."""
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
        harmed = any(mentions(value.code, name) for name in names) or (memory and self._reads(value))
        return self.keep("next", value) if harmed else value

    def _variables_of(self, name: str) -> set[str]:
        """The variables of C that a name stands for, or has stood for."""
        own = self.unit.identifier(name)
        return {own, *(known for known in self.variables if known.startswith(f"{own}_"))}
