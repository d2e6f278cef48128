"""A kernel as a function in C: its statements, its variables, and the types that follow from its arguments."""

from __future__ import annotations

import ast
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.compiled.blocks import Assignment, Block, Variable, drop_unused, mentions, place, render
from harpy_pin.compiled.expressions import ATOM, SUM, Expressions, Refused, wrap
from harpy_pin.compiled.source import Source
from harpy_pin.compiled.types import (
    BOOLEAN,
    INTEGER,
    NOTHING,
    REAL,
    Array,
    Fixed,
    Function,
    Scalar,
    Struct,
    Tuple,
    Type,
    Value,
)

if TYPE_CHECKING:
    from harpy_pin.compiled.unit import Unit

__all__ = ["CFunction", "translate"]


class _Wider(Exception):
    """Something was learnt that what is written already depends on: start again."""


@dataclass
class _Learnt:
    """What is known of a function from earlier attempts to translate it.

    Attributes:
        ranks: of variables that are numbers, the type that holds every value.
        arguments: the same of arguments that are numbers of a narrower type at first.
        result: the type of the result, once there is one.
        memory: of variables that are arrays, the arguments and fields that they may stand for.
        unsettled: by the line of a loop, names that stand for different things from one round to the next.
    """

    ranks: dict[str, Scalar] = field(default_factory=dict)
    arguments: dict[str, Scalar] = field(default_factory=dict)
    result: list[Type] = field(default_factory=list)
    memory: dict[str, tuple[frozenset[str], frozenset[str]]] = field(default_factory=dict)
    unsettled: dict[int, set[str]] = field(default_factory=dict)


@dataclass
class CFunction:
    """A kernel in C, for one set of types.

    Attributes:
        name: in C.
        parameters: names and types, with sizes that are known at run time named.
        sizes: the names of those sizes that the body uses; they are parameters, too.
        result: what it returns.
        written: parameters whose memory it writes.
        head: of its declaration.
        text: all of it.
    """

    name: str
    parameters: list[tuple[str, Type]]
    sizes: set[str] = field(default_factory=set)
    result: Type = NOTHING
    written: set[str] = field(default_factory=set)
    head: str = ""
    text: str = ""


def translate(unit: Unit, source: Source, name: str, types: tuple[Type, ...]) -> CFunction:
    """One function.

    Args:
        unit: that it becomes a part of.
        source: of the kernel.
        name: in C.
        types: of its arguments.

    Raises:
        KernelError: the kernel leaves the language; the message says where.
    """
    learnt = _Learnt()
    while True:
        try:
            return _Translator(unit, source, name, types, learnt).run()
        except _Wider:
            continue


class _Translator(Expressions):
    """Goes through the statements once; types that turn out too narrow are kept for the next attempt."""

    def __init__(self, unit: Unit, source: Source, name: str, types: tuple[Type, ...], learnt: _Learnt) -> None:
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
        stores = (
            node.id for node in ast.walk(source.tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        )
        self.stores = Counter(stores)
        self.local = set(self.stores) | set(source.parameters)
        for parameter, kind in zip(source.parameters, types, strict=True):
            self.environment[parameter] = self._parameter(parameter, kind)

    # --- the function --------------------------------------------------------------------------------------------

    def run(self) -> CFunction:
        """Translate it."""
        function, root = self.function, self.path[0]
        if not self.body(self.source.tree.body) and self.result not in ([], [NOTHING]):
            raise self.source.error(self.source.tree.body[-1], "the end may be reached, where there is no result")
        drop_unused(root, self.variables, self.unit.is_pure)
        for variable in self.variables.values():
            place(variable)
        function.result = self.result[0] if self.result else NOTHING
        function.written &= {name for name, _ in function.parameters}
        lines = render(root)
        text = "\n".join(lines)
        function.sizes = {size for size in function.sizes if mentions(text, size)}
        parameters = []
        for name, kind in function.parameters:
            if isinstance(kind, Array | Struct | Scalar) or (isinstance(kind, Tuple) and kind.uniform):
                parameters.append(self.unit.declare(kind, self.unit.identifier(name)))
            if isinstance(kind, Array):
                parameters += [f"integer {size}" for size in kind.sizes if size in function.sizes]
        unused = [n for n, kind in function.parameters if not isinstance(kind, Function | Fixed)]
        silent = [
            f"    (void){self.unit.identifier(n)};" for n in unused if not mentions(text, self.unit.identifier(n))
        ]
        function.head = (
            f"static {self.unit.result_type(function.result)} {function.name}({', '.join(parameters) or 'void'})"
        )
        comment = self.unit.comment(self.source.docstring)
        function.text = "\n".join([*comment, function.head, "{", *silent, *lines, "}"])
        return function

    def _parameter(self, name: str, kind: Type) -> Value:
        """An argument as a value, with names for sizes that are known at run time."""
        own = self.unit.identifier(name)
        self.taken.add(own)
        if isinstance(kind, Tuple) and kind.uniform is None:
            items = tuple(self._parameter(f"{name}_{n}", item) for n, item in enumerate(kind.items))
            return Value(kind, items=items)
        if isinstance(kind, Array):
            others, stem = set(map(self.unit.identifier, self.local)), own
            while others & set(kind.named(stem).sizes):
                stem += "_"
            kind = kind.named(stem)
            self.taken |= set(kind.sizes)
        self.function.parameters.append((name, kind))
        if isinstance(kind, Fixed):
            if not self.stores[name]:
                return self.constant(kind.value)
            self.taken.remove(own)
            self._write(self._variable(name, self.unit.declare(BOOLEAN, "{}")), self.constant(kind.value).code)
            self.numbers.add(own)
            return Value(BOOLEAN, own, volatile=True)
        if isinstance(kind, Function):
            return Value(kind)
        if isinstance(kind, Tuple):
            items = tuple(Value(item, f"{own}[{n}]", volatile=True) for n, item in enumerate(kind.items))
            return Value(kind, own, items=items)
        if isinstance(kind, Array) and kind.empty:
            return Value(kind, own, roots=frozenset((name,)), fields=frozenset((name,)))
        volatile = isinstance(kind, Scalar) and self.stores[name] > 0
        if volatile:
            wider = self.learnt.arguments.get(name)
            if wider is not None:
                given = Value(kind, own)
                own = self._variable(name, self.unit.declare(wider, "{}"))
                self._write(own, self.cast(given, wider).code)
                kind = wider
            self.numbers.add(own)
        return Value(kind, own, roots=frozenset((name,)), fields=frozenset((name,)), volatile=volatile)

    def name(self, node: ast.Name) -> Value:
        """What a name stands for: a variable, or what the kernel's module knows by it."""
        if node.id in self.environment:
            value = self.environment[node.id]
            if value is None:
                raise Refused(f"'{node.id}', which is not the same kind of thing on every way here")
            self._mention(value)
            return value
        if node.id in self.local:
            raise Refused(f"'{node.id}' before it has a value")
        found = self.source.lookup(node.id, single=self.unit.single)
        if isinstance(found, Value):
            return found
        return self.known(found, node.id)

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
            variable.places.append(
                tuple((block, len(block.items) - (block is not self.path[-1])) for block in self.path)
            )

    # --- statements ----------------------------------------------------------------------------------------------

    def body(self, statements: list[ast.stmt]) -> bool:
        """Statements one after the other; returns whether what follows them is never reached through them."""
        for statement in statements:
            try:
                left = getattr(self, f"_do_{type(statement).__name__.lower()}", self._unknown)(statement)
            except Refused as reason:
                raise self.source.error(statement, str(reason)) from None
            if left or isinstance(statement, ast.Return | ast.Continue | ast.Break):
                return True
        return False

    def _unknown(self, statement: ast.stmt) -> None:
        raise Refused(f"kernels have no {type(statement).__name__}")

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

    def _inside(self, block: Block, statements: list[ast.stmt]) -> bool:
        self.path.append(block)
        left = self.body(statements)
        self.path.pop()
        return left

    def _do_pass(self, _: ast.Pass) -> None:
        """Nothing."""

    def _do_expr(self, statement: ast.Expr) -> None:
        if isinstance(statement.value, ast.Constant):
            return
        value = self.expression(statement.value)
        if not isinstance(statement.value, ast.Call):
            raise Refused("an expression that does nothing")
        if value.code:
            self.emit(f"{value.code};")

    def _do_return(self, statement: ast.Return) -> None:
        value = self.expression(statement.value) if statement.value is not None else Value(NOTHING)
        if value.type == NOTHING:
            self._returns(NOTHING)
            self.emit("return;")
            return
        if isinstance(value.type, Tuple):
            kind = self._returns(Tuple(tuple(item.type for item in value.items)))
            assert isinstance(kind, Tuple)
            codes = [self.cast(item, to).code for item, to in zip(value.items, kind.items, strict=True)]  # type: ignore[arg-type]
            self.emit(f"return ({self.unit.result_type(kind)}){{{', '.join(codes)}}};")
            return
        kind = self._returns(value.type)
        if not isinstance(kind, Scalar):
            raise Refused("a kernel returns numbers; an array is given to it to be written")
        self.emit(f"return {self.cast(value, kind).code};")

    def _returns(self, kind: Type) -> Type:
        """The type of the result, which may have to hold another one, too."""
        if not self.result:
            self.result.append(kind)
        before = self.result[0]
        wider = _unify(before, kind)
        if wider != before:
            self.result[0] = wider
            raise _Wider
        return before

    def _do_if(self, statement: ast.If) -> bool:
        condition = self.truth(statement.test)
        if condition.constant is not None:
            return self.body(statement.body if condition.constant else statement.orelse)
        before = dict(self.environment)
        left = self._inside(self._block(f"if ({condition.code})"), statement.body)
        after = self.environment
        self.environment = dict(before)
        left_otherwise = bool(statement.orelse) and self._inside(self._block("else"), statement.orelse)
        if not left:
            self.environment = after if left_otherwise else self._merge(after, self.environment)
        return left and left_otherwise

    def _merge(self, a: dict[str, Value | None], b: dict[str, Value | None]) -> dict[str, Value | None]:
        """What is known after two ways: a name that stands for two kinds of thing is known no more."""
        merged: dict[str, Value | None] = {}
        for name in a.keys() | b.keys():
            x, y = a.get(name), b.get(name)
            if name not in a or name not in b:
                merged[name] = x if y is None else y  # assigned on one way only: a variable with a value all the same
            else:
                merged[name] = x if x is not None and y is not None and (x.code, x.type) == (y.code, y.type) else None
        return merged

    def _enter(self, statement: ast.For | ast.While) -> None:
        """Before a loop: a name that stands for another kind of thing in the next round is known no more."""
        for name in self.learnt.unsettled.get(statement.lineno, ()):
            self.environment[name] = None

    def _loop(self, block: Block, statement: ast.For | ast.While) -> None:
        """A block that may be gone through again: names must stand for the same kind of thing then."""
        before, work = dict(self.environment), len(self.work)
        self.jumps.append([])
        left = self._inside(block, statement.body)
        ends = self.jumps.pop() + ([] if left else [self.environment])
        after = before
        for end in ends:
            after = self._merge(after, end)
        changed = {name for name, value in before.items() if value is not None and after[name] is None}
        if changed:
            self.learnt.unsettled.setdefault(statement.lineno, set()).update(changed)
            raise _Wider
        for name in before:
            if (value := after[name]) is not None and value.roots & set(self.work[work:]):
                raise Refused(f"'{name}', which outlives the work space of its round")
        self.environment = after

    def _do_while(self, statement: ast.While) -> bool:
        if statement.orelse:
            raise Refused("a loop with else")
        self._enter(statement)
        condition = self.inline(self.truth, statement.test)
        self._loop(self._block(f"while ({condition.code})", loop=True), statement)
        return condition.constant is True and not any(isinstance(node, ast.Break) for node in ast.walk(statement))

    def _do_continue(self, _: ast.Continue) -> None:
        self.jumps[-1].append(dict(self.environment))
        self.emit("continue;")

    def _do_break(self, _: ast.Break) -> None:
        self.jumps[-1].append(dict(self.environment))
        self.emit("break;")

    def _do_for(self, statement: ast.For) -> None:
        if not isinstance(statement.target, ast.Name) or statement.orelse:
            raise Refused("a loop over several names, or with else")
        name = statement.target.id
        own = self.unit.identifier(name) if name != "_" else self._fresh("round")
        call = statement.iter
        ranged = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
        before = self.environment.get(name)
        if name != "_" and any(
            isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Store)
            for s in statement.body
            for n in ast.walk(s)
        ):
            raise Refused(f"'{name}', which its loop changes")
        if ranged:
            assert isinstance(call, ast.Call)
            header = self._range(own, call, statement.body)
            if header is None:
                return
            block = self._block(header, loop=True)
            self.environment[name] = Value(INTEGER, own)
        else:
            block = self._over_items(own, call)
            items = self.environment[own]
            self.environment[name] = items
        self._enter(statement)
        self._loop(block, statement)
        self.environment.pop(name, None)
        if before is not None:
            self.environment[name] = None

    def _range(self, own: str, call: ast.Call, body: list[ast.stmt]) -> str | None:
        """The header of a loop over a range; None where it is certainly empty."""
        bounds = [self.integer(argument) for argument in call.args]
        begin, end = (self.constant(0), bounds[0]) if len(bounds) == 1 else (bounds[0], bounds[1])
        step = bounds[2].constant if len(bounds) == 3 else 1
        if not isinstance(step, int) or step == 0:
            raise Refused("a step that is not known when compiling")
        if mentions(begin.code, own):
            begin = self.keep(f"{own}_begin", begin)
        if (
            begin.constant is not None
            and end.constant is not None
            and not range(int(begin.constant), int(end.constant), step)
        ):
            return None
        if end.constant is None and (end.volatile or "(" in end.code or self._assigned_in(end.code, body)):
            end = self.keep(f"{own}_end", end)
        sign = "<" if step > 0 else ">"
        advance = f"{own}++" if step == 1 else f"{own}--" if step == -1 else f"{own} += {step}"
        return f"for (integer {own} = {begin.code}; {own} {sign} {wrap(end, SUM)}; {advance})"

    def _over_items(self, own: str, node: ast.expr) -> Block:
        """A loop over a tuple: its items go into an array first."""
        items = self.expression(node)
        if not isinstance(items.type, Tuple) or items.type.uniform is None:
            raise Refused("a loop over something that is neither range() nor a tuple of numbers of one type")
        values = self._fresh(f"{own}_values")
        count = len(items.items)
        codes = ", ".join(item.code for item in items.items)
        self.emit(f"const {items.type.uniform} {values}[{count}] = {{{codes}}};")
        index = self._fresh(f"{own}_n")
        block = self._block(f"for (int {index} = 0; {index} < {count}; {index}++)", loop=True)
        block.items.append(f"const {items.type.uniform} {own} = {values}[{index}];")
        self.environment[own] = Value(items.type.uniform, own)
        return block

    def _assigned_in(self, code: str, body: list[ast.stmt]) -> bool:
        names = {
            self.unit.identifier(n.id)
            for s in body
            for n in ast.walk(s)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
        }
        return any(mentions(code, name) for name in names)

    # --- assignments ---------------------------------------------------------------------------------------------

    def _do_assign(self, statement: ast.Assign) -> None:
        if len(statement.targets) == 1:
            if self._makes_array(statement.targets[0], statement.value):
                return
            effects = self.effects
            value = self.expression(statement.value)
            if self.effects > effects and isinstance(statement.targets[0], ast.Subscript | ast.Attribute):
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
                raise Refused(f"'{ast.unparse(target)}': an array is written through [:]")
            self._writes(place)
            self.emit(f"{place.code} = {self.cast(value, place.type).code};")
        else:
            raise Refused(f"an assignment to '{ast.unparse(target)}'")

    def _unpack(self, target: ast.Tuple, value: Value) -> None:
        """Several targets at once: what would be overwritten before it is read is kept first."""
        if not isinstance(value.type, Tuple) or len(value.items) != len(target.elts):
            raise Refused("a tuple with another number of targets")
        items = list(value.items)
        for n, element in enumerate(target.elts):
            parts = [
                part for part in ast.walk(element) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
            ]
            names = {variable for part in parts for variable in self._variables_of(part.id)}
            memory = any(isinstance(part, ast.Subscript | ast.Attribute) for part in ast.walk(element))
            for m in range(n + 1, len(items)):
                items[m] = self._unharmed(items[m], names, memory)
        for element, item in zip(target.elts, items, strict=True):
            self._assign(element, item, "")

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
                    raise _Wider
                self._mention(before)
                self.emit(f"{before.code} = {self.cast(value, before.type).code};")
                return
            rank = self.learnt.ranks.setdefault(name, kind)
            if kind.rank > rank.rank:
                self.learnt.ranks[name] = kind
                raise _Wider
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
        raise _Wider

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
        variable.places.append(tuple((block, len(block.items) - (block is not self.path[-1])) for block in self.path))
        self.path[-1].items.append(Assignment(variable, code, sign))

    def _makes_array(self, target: ast.expr, value: ast.expr) -> bool:
        """Work space of a constant size: ``np.empty`` or ``np.zeros``."""
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
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
        kinds = [*value.args[1:], *(keyword.value for keyword in value.keywords if keyword.arg == "dtype")]
        if not value.args or len(kinds) > 1 or len(value.args) + len(value.keywords) > 1 + len(kinds):
            raise Refused(f"'{ast.unparse(value)}': work space has a shape and a dtype")
        element = self._element_type(kinds[0]) if kinds else REAL
        parts = list(value.args[0].elts) if isinstance(value.args[0], ast.Tuple) else [value.args[0]]
        sizes = [self.integer(part).constant for part in parts]
        if not isinstance(target, ast.Name) or not all(isinstance(size, int) for size in sizes):
            raise Refused(f"'{ast.unparse(value)}': the size of work space must be known when compiling")
        kind = Array.packed(element, tuple(int(size) for size in sizes))  # type: ignore[arg-type]
        count = int(np.prod(kind.shape))  # type: ignore[arg-type]
        if count == 0:
            self.environment[target.id] = Value(kind, "NULL")
            return True
        own = self._variable(target.id, f"{element} {{}}[{count}]", array=True, fresh=True)
        self.work.append(own)
        self._mention(Value(kind, own))
        self.environment[target.id] = Value(kind, own, roots=frozenset((own,)), fields=frozenset((own,)))
        if function.type == Function(np.zeros):
            self._fill(self.environment[target.id], self.constant(0.0))  # type: ignore[arg-type]
        return True

    def _element_type(self, node: ast.expr) -> Scalar:
        """The dtype of work space."""
        kind = self.expression(node).type
        for scalar, dtypes in ((REAL, (np.float64, float)), (INTEGER, (np.int64, int)), (BOOLEAN, (np.bool_, bool))):
            if isinstance(kind, Function) and kind.target in dtypes:
                return scalar
        raise Refused(f"work space of '{ast.unparse(node)}'")

    def _calls_numpy(self, value: ast.expr) -> bool:
        if not (isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute)):
            return False
        module = value.func.value
        known = isinstance(module, ast.Name) and module.id not in self.environment
        found = self.expression(value.func) if known else None
        return found is not None and isinstance(found.type, Function) and found.type.target in (np.empty, np.zeros)

    def _store(self, target: ast.Subscript, value: Value) -> None:
        """Write into an array: an element, or a view of it from a number or an array of the same shape."""
        owner = self.expression(target.value)
        if not isinstance(owner.type, Array):
            raise Refused(f"'{ast.unparse(target.value)}' is no array")
        view = self.view(owner, target.slice)
        self._writes(view)
        assert isinstance(view.type, Array)
        if view.type.shape:
            self._fill(view, value)
        elif isinstance(view.type.element, Scalar):
            self.emit(f"{view.code} = {self.cast(value, view.type.element).code};")
        else:
            raise Refused("an assignment of a whole record")

    def _fill(self, view: Value, value: Value, sign: str = "=") -> None:
        """Write every element of a view."""
        kind = view.type
        assert isinstance(kind, Array)
        if kind.empty or view.code == "NULL":
            return
        if isinstance(value.type, Scalar) and (value.volatile or "(" in value.code):
            value = self.keep("value", value)
        if isinstance(value.type, Array):
            self._compare_shapes(view, value)
        names = [self._fresh("ijk"[axis] + "_") for axis in range(len(kind.shape))]
        self.taken -= set(names)
        for name, size in zip(names, kind.shape, strict=True):
            self.path.append(self._block(f"for (integer {name} = 0; {name} < {size}; {name}++)", loop=True))
        if isinstance(value.type, Array):
            element = self._element(value, names)
            code = element if value.type.element == kind.element else f"({kind.element}){element}"
        else:
            assert isinstance(kind.element, Scalar)
            code = self.cast(value, kind.element).code
        self.emit(f"{self._element(view, names)} {sign} {code};")
        del self.path[len(self.path) - len(names) :]

    def _compare_shapes(self, view: Value, value: Value) -> None:
        """What is copied has the shape of the place that it goes to, and is not overwritten before it is read."""
        assert isinstance(view.type, Array)
        assert isinstance(value.type, Array)
        pairs = list(zip(view.type.shape, value.type.shape, strict=False))
        known = [(a, b) for a, b in pairs if (isinstance(a, int) and isinstance(b, int)) or 1 in (a, b)]
        different = any(a != b for a, b in known)  # one row for many is Python's alone
        if different or len(view.type.shape) != len(value.type.shape):
            raise Refused(f"an array of shape {value.type.shape} where {view.type.shape} is needed")
        if self.unit.debug:
            for a, b in pairs:
                if a != b:
                    self.emit(f"within({a}, {b}, {a}, __LINE__);")
        if view.roots & value.roots and _may_overlap(view, value):
            raise Refused("a part of an array becomes another part of it, and both may overlap")

    def _element(self, array: Value, names: list[str]) -> str:
        assert isinstance(array.type, Array)
        steps = zip(names, array.type.strides, strict=True)
        return self._at(
            self.dereferenced(array), " + ".join(name if step == 1 else f"{step} * {name}" for name, step in steps)
        )

    def _do_augassign(self, statement: ast.AugAssign) -> None:
        target, operator = statement.target, statement.op
        if isinstance(target, ast.Name):
            self._change(target, operator, self.scalar(statement.value))
            return
        place = self.expression(target)
        if isinstance(place.type, Scalar) and place.binding < ATOM:
            raise Refused("a change of an element of a float32 array")
        self._writes(place)
        effects, emitted = self.effects, self.emitted
        value = self.scalar(statement.value)
        if self.effects > effects:
            if not isinstance(place.type, Scalar) or self.emitted > emitted or place.code.count("[") > 1:
                raise Refused("a call that writes where memory is changed: give its result a name first")
            before = self.keep("before", place)  # what Python reads first
            result = self.arithmetic(operator, before, value)
            self.emit(f"{place.code} = {self.cast(result, place.type).code};")
            return
        if isinstance(place.type, Array):
            sign = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}.get(type(operator))
            if sign is None or value.type.rank > place.type.element.rank:  # type: ignore[union-attr]
                raise Refused(f"'{ast.unparse(statement)}'")
            self._fill(place, value, sign)
            return
        assert isinstance(place.type, Scalar)
        result = self.arithmetic(operator, place, value)
        if isinstance(operator, ast.Add | ast.Sub | ast.Mult) and result.type == place.type:
            sign = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}[type(operator)]
            self.emit(f"{place.code} {sign} {self.cast(value, place.type).code};")
        else:
            self.emit(f"{place.code} = {self.cast(result, place.type).code};")

    def _change(self, target: ast.Name, operator: ast.operator, value: Value) -> None:
        """``name += value``."""
        before = self.scalar(target)
        after = self.arithmetic(operator, before, value)
        variable = self.variables.get(before.code)
        signs = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}
        if variable is None or after.type != before.type or type(operator) not in signs:
            self._set(target.id, after)
            return
        assert isinstance(before.type, Scalar)
        self._write(before.code, self.cast(value, before.type).code, signs[type(operator)])

    def _writes(self, value: Value) -> None:
        self.function.written |= value.roots

    # --- calls ---------------------------------------------------------------------------------------------------

    def call_kernel(self, kernel: Any, arguments: list[Value], named: dict[str, Value]) -> Value:
        """The call of another kernel, which is translated for these types if it has not been yet."""
        source = self.unit.source(kernel)
        given = dict(zip(source.parameters, arguments, strict=False)) | named
        for name, default in source.defaults.items():
            if name not in given:
                given[name] = self.constant(default)
        if given.keys() != set(source.parameters) or len(arguments) > len(source.parameters):
            raise Refused(f"a call of {source.name} with other arguments than {', '.join(source.parameters)}")
        values = [self._argument(given[name]) for name in source.parameters]
        called = self.unit.function_for(kernel, tuple(self._passed(value) for value in values))
        self.effects += bool(called.written)
        if called.name in self.taken:
            raise Refused(f"a call of {called.name} beside a variable of that name")
        codes = []
        for value, (name, kind) in zip(_flat(values), called.parameters, strict=True):
            if isinstance(kind, Function | Fixed):
                continue
            codes.append(value.code)
            if name in called.written:
                self._writes(value)
            if isinstance(kind, Array):
                assert isinstance(value.type, Array)
                actual = dict(zip((*kind.shape, *kind.strides), (*value.type.shape, *value.type.strides), strict=True))
                codes += [str(actual[size]) for size in kind.sizes if size in called.sizes]
        code = f"{called.name}({', '.join(codes)})"
        if isinstance(called.result, Tuple):
            own = self._fresh("result")
            self.emit(f"const {self.unit.result_type(called.result)} {own} = {code};")
            items = tuple(Value(item, f"{own}.v{n}") for n, item in enumerate(called.result.items))
            return Value(called.result, items=items)
        self._uses(code)
        return Value(called.result, code, volatile=True)

    def _argument(self, value: Value) -> Value:
        """An argument in a form that can be passed: a tuple of numbers as an array."""
        if isinstance(value.type, Tuple) and not value.code and value.type.uniform is not None:
            own = self._fresh("values")
            codes = ", ".join(item.code for item in value.items)
            self.emit(f"{value.type.uniform} {own}[{len(value.items)}] = {{{codes}}};")
            return replace(value, code=own)
        return value

    @staticmethod
    def _passed(value: Value) -> Type:
        """What a kernel is translated for: a truth value that is known is part of it."""
        if value.type is BOOLEAN and isinstance(value.constant, bool):
            return Fixed(value.constant)
        if isinstance(value.type, Tuple) and value.type.uniform is None:
            return Tuple(tuple(_Translator._passed(item) for item in value.items))
        return value.type.signature if isinstance(value.type, Array) else value.type


def _flat(values: list[Value]) -> list[Value]:
    """Values with those inside tuples in the place of the tuples, as a function of C takes them."""
    flat: list[Value] = []
    for value in values:
        mixed = isinstance(value.type, Tuple) and value.type.uniform is None
        flat += _flat(list(value.items)) if mixed else [value]
    return flat


def _unify(a: Type, b: Type) -> Type:
    """A type that holds both."""
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return a if a.rank >= b.rank else b
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(_unify(x, y) for x, y in zip(a.items, b.items, strict=True)))
    if a != b:
        raise Refused("results of different kinds")
    return a


def _may_overlap(view: Value, value: Value) -> bool:
    """Whether two views of the same memory may share some elements, but not each with itself.

    Rows, and equal fields of records, are the same or have nothing in common.
    """
    assert isinstance(view.type, Array)
    assert isinstance(value.type, Array)
    alike = view.type.strides == value.type.strides
    if alike and view.code == value.code:
        return False
    if not (view.fields and value.fields):
        return True
    common = {path.rstrip("+") for path in view.fields} & {path.rstrip("+") for path in value.fields}
    parts = {path.rstrip("+") for path in view.fields | value.fields if path.endswith("+")}
    return bool(common if not alike else common & parts)
