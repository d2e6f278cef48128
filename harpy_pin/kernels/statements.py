"""A kernel as a function in C, for one set of argument types: its branches, loops, returns and
calls.
"""

from __future__ import annotations

import ast
import builtins
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

from harpy_pin.errors import KernelError
from harpy_pin.kernels.arrays import FUNCTIONS
from harpy_pin.kernels.assignments import Assignments, stored
from harpy_pin.kernels.blocks import (
    Block,
    CFunction,
    Learnt,
    Line,
    Wider,
    drop_unused,
    mentions,
    place,
    render,
)
from harpy_pin.kernels.expressions import LIBRARY, OF_TWO, kernel_of
from harpy_pin.kernels.operators import SUM, Refused, refused, wider, wrap
from harpy_pin.kernels.overlaps import stems, ways
from harpy_pin.kernels.source import Source, source_of
from harpy_pin.kernels.types import (
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
    from harpy_pin.kernels.unit import Unit

RESULT = "result_"
"""The name of the memory that an array is returned in; no other name of C ends so."""
SHORT = 3
"""Rounds of a loop that is unrolled: on a microcontroller the condensed WBC takes 0.85 of the
instructions.
"""


def _unify(a: Type, b: Type) -> Type:
    """A type that holds both."""
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return wider(a, b)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(_unify(x, y) for x, y in zip(a.items, b.items, strict=True)))
    if a != b:
        raise Refused("results of different kinds")
    return a


def translate(unit: Unit, source: Source, name: str, types: tuple[Type, ...]) -> CFunction:
    """A kernel as one function for arguments of these types; a :class:`KernelError` says where it
    is refused.
    """
    learnt = Learnt()
    while True:
        try:
            return _Translator(unit, source, name, types, learnt).run()
        except Wider:
            continue


class _Translator(Assignments):
    """Goes through the statements once; types that turn out too narrow are kept for the next
    attempt.
    """

    def body(self, statements: list[ast.stmt]) -> bool:
        """Statements one after the other; returns whether what follows them is never reached
        through them.
        """
        for statement in statements:
            if self.unit.lines:
                self.path[-1].items.append(Line(statement.lineno, self.source.file))
            try:
                left = getattr(self, f"_do_{type(statement).__name__.lower()}", self._unknown)(
                    statement
                )
            except Refused as reason:
                raise self.source.error(statement, str(reason)) from None
            if left or isinstance(statement, ast.Return | ast.Continue | ast.Break):
                return True
        return False

    def _unknown(self, statement: ast.stmt) -> None:
        raise Refused(f"kernels have no {type(statement).__name__}")

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
            pairs = zip(value.items, kind.items, strict=True)
            codes = [self.cast(item, to).code for item, to in pairs]  # type: ignore[arg-type]
            self.emit(f"return ({self.unit.result_type(kind)}){{{', '.join(codes)}}};")
            return
        if isinstance(value.type, Array):
            self._return_array(value, value.type.shape)
            return
        kind = self._returns(value.type)
        if not isinstance(kind, Scalar):
            raise Refused("a kernel returns numbers or an array of numbers")
        self.emit(f"return {self.cast(value, kind).code};")

    def _return_array(self, value: Value, shape: tuple[int | str, ...]) -> None:
        """An array goes to memory that the caller gives."""
        if not all(isinstance(size, int) for size in shape):
            raise Refused(
                "a result whose size is not known when compiling: give an array to be written"
            )
        kind = self._returns(Array.packed(REAL, shape))
        self._fill(
            Value(kind, RESULT, roots=frozenset((RESULT,)), fields=frozenset((RESULT,))), value
        )
        self.emit("return;")

    def _returns(self, kind: Type) -> Type:
        """The type of the result, which may have to hold another one, too."""
        if not self.result:
            self.result.append(kind)
        before = self.result[0]
        wider = _unify(before, kind)
        if wider != before:
            self.result[0] = wider
            raise Wider
        return before

    def _do_if(self, statement: ast.If) -> bool:
        condition = self.truth(statement.test)
        if condition.constant is not None:
            return self.body(statement.body if condition.constant else statement.orelse)
        before = dict(self.environment)
        left = self._inside(self._block(f"if ({condition.code})"), statement.body)
        after = self.environment
        self.environment = dict(before)
        left_otherwise = bool(statement.orelse) and self._inside(
            self._block("else"), statement.orelse
        )
        if not left:
            self.environment = after if left_otherwise else self._merge(after, self.environment)
        return left and left_otherwise

    def _merge(
        self, a: dict[str, Value | None], b: dict[str, Value | None]
    ) -> dict[str, Value | None]:
        """What is known after two ways: a name that stands for two kinds of thing is known no
        more.
        """
        merged: dict[str, Value | None] = {}
        for name in a.keys() | b.keys():
            x, y = a.get(name), b.get(name)
            if name not in a or name not in b:
                merged[name] = (
                    x if y is None else y
                )  # assigned on one way only: a variable with a value all the same
            else:
                merged[name] = (
                    x
                    if x is not None and y is not None and (x.code, x.type) == (y.code, y.type)
                    else None
                )
        return merged

    def _enter(self, statement: ast.For | ast.While) -> None:
        """Before a loop: a name that stands for another kind of thing in the next round is known no
        more.
        """
        for name in self.learnt.unsettled.get(statement.lineno, ()):
            self.environment[name] = None

    def _loop(self, block: Block, statement: ast.For | ast.While) -> None:
        """A block that may be gone through again: names must stand for the same kind of thing
        then.
        """
        before, work = dict(self.environment), len(self.work)
        self.jumps.append([])
        left = self._inside(block, statement.body)
        ends = self.jumps.pop() + ([] if left else [self.environment])
        after = before
        for end in ends:
            after = self._merge(after, end)
        changed = {
            name for name, value in before.items() if value is not None and after[name] is None
        }
        if changed:
            self.learnt.unsettled.setdefault(statement.lineno, set()).update(changed)
            raise Wider
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
        return condition.constant is True and not any(
            isinstance(node, ast.Break) for node in ast.walk(statement)
        )

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
        own = self.unit.identifier(name) if name != "_" else self.fresh("round")
        call = statement.iter
        ranged = (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "range"
        )
        before = self.environment.get(name)
        if name != "_" and name in stored(statement.body):
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
        rounds = SHORT + 1  # or not known
        if begin.constant is not None and end.constant is not None:
            rounds = len(range(int(begin.constant), int(end.constant), step))
            if rounds == 0:
                return None
        if end.constant is None and (
            end.volatile or "(" in end.code or self._assigned_in(end.code, body)
        ):
            end = self.keep(f"{own}_end", end)
        sign = "<" if step > 0 else ">"
        advance = f"{own}++" if step == 1 else f"{own}--" if step == -1 else f"{own} += {step}"
        header = f"for (integer {own} = {begin.code}; {own} {sign} {wrap(end, SUM)}; {advance})"
        return header if rounds > SHORT else f"#pragma GCC unroll {rounds}\n{header}"

    def _over_items(self, own: str, node: ast.expr) -> Block:
        """A loop over a tuple: its items go into an array first."""
        items = self.expression(node)
        if not isinstance(items.type, Tuple) or items.type.uniform is None:
            raise Refused(
                "a loop over something that is neither range() nor a tuple of numbers of one type"
            )
        values = self.fresh(f"{own}_values")
        count = len(items.items)
        codes = ", ".join(item.code for item in items.items)
        self.emit(f"const {items.type.uniform} {values}[{count}] = {{{codes}}};")
        index = self.fresh(f"{own}_n")
        block = self._block(f"for (int {index} = 0; {index} < {count}; {index}++)", loop=True)
        block.items.append(f"const {items.type.uniform} {own} = {values}[{index}];")
        self.environment[own] = Value(items.type.uniform, own)
        return block

    def _assigned_in(self, code: str, body: list[ast.stmt]) -> bool:
        return any(mentions(code, self.unit.identifier(name)) for name in stored(body))

    def __init__(
        self, unit: Unit, source: Source, name: str, types: tuple[Type, ...], learnt: Learnt
    ) -> None:
        super().__init__(unit, source, name, learnt)
        for parameter, kind in zip(source.parameters, types, strict=True):
            self.environment[parameter] = self._parameter(parameter, kind)

    def run(self) -> CFunction:
        """Translate it."""
        function, root = self.function, self.path[0]
        if not self.body(self.source.tree.body) and self.result not in ([], [NOTHING]):
            raise self.source.error(
                self.source.tree.body[-1], "the end may be reached, where there is no result"
            )
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
            if isinstance(kind, Array | Struct | Scalar):
                parameters.append(self.unit.declare(kind, self.unit.identifier(name)))
            if isinstance(kind, Array):
                parameters += [f"integer {size}" for size in kind.sizes if size in function.sizes]
        own = [
            self.unit.identifier(name)
            for name, kind in function.parameters
            if not isinstance(kind, Fixed)
        ]
        silent = [f"    (void){name};" for name in own if not mentions(text, name)]
        if isinstance(function.result, Array):
            parameters.append(self.unit.declare(function.result, RESULT))
        function.head = (
            f"static {self.unit.result_type(function.result)} "
            f"{function.name}({', '.join(parameters) or 'void'})"
        )
        comment = self.unit.comment(self.source.docstring)
        line = [str(Line(self.source.tree.lineno, self.source.file))] if self.unit.lines else []
        function.text = "\n".join([*comment, *line, function.head, "{", *silent, *lines, "}"])
        return function

    def _parameter(self, name: str, kind: Type) -> Value:
        """An argument as a value, with names for sizes that are known at run time."""
        own = self.unit.identifier(name)
        self.taken.add(own)
        if isinstance(kind, Tuple):
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
            if self.stores[name]:
                raise KernelError(
                    f"{self.source.name} changes '{name}', a truth value that is known when "
                    f"compiling"
                )
            return self.constant(kind.value)
        if isinstance(kind, Array) and kind.empty:
            return Value(kind, own, roots=frozenset((name,)), fields=frozenset((name,)))
        volatile = isinstance(kind, Scalar) and self.stores[name] > 0
        if volatile:
            self.numbers.add(own)
        return Value(
            kind, own, roots=frozenset((name,)), fields=frozenset((name,)), volatile=volatile
        )

    def _name(self, node: ast.Name) -> Value:
        """What a name stands for: a variable, or what the kernel's module knows by it."""
        if node.id in self.environment:
            value = self.environment[node.id]
            if value is None:
                raise Refused(f"'{node.id}', which is not the same kind of thing on every way here")
            self._mention(value)
            return value
        if node.id in self.local:
            raise Refused(f"'{node.id}' before it has a value")
        return self.known(self.source.lookup(node.id), node.id)

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            owner = self.expression(node.func.value)
            if isinstance(owner.type, Array):
                return self._reshape(owner, node.args)
        target = self.expression(node.func)
        if not isinstance(target.type, Function):
            raise refused(node.func, " is no function")
        function = target.type.target
        names = [keyword.arg for keyword in node.keywords]
        if kernel_of(function) is not None:
            if None in names:
                raise refused(node, ": **")
            packed = self._tuple(
                ast.Tuple([*node.args, *(keyword.value for keyword in node.keywords)], ast.Load())
            )
            arguments = list(packed.items)
            first = len(arguments) - len(names)
            return self._call_kernel(
                function,
                arguments[:first],
                dict(zip(map(str, names), arguments[first:], strict=True)),
            )
        if not any(function is one for one in (*LIBRARY, *FUNCTIONS)):
            raise refused(node.func, " is no kernel and none of the functions that kernels have")
        if names:
            raise refused(node, ": arguments by name")
        if function in FUNCTIONS:
            return self.of_arrays(
                function, self.ordered([_as_tuples(argument) for argument in node.args])
            )
        arguments = list(self._tuple(ast.Tuple(node.args, ast.Load())).items)
        extreme = function in (builtins.min, builtins.max)
        count = 2 if extreme or function in OF_TWO else 1
        if len(arguments) < count or (len(arguments) > count and not extreme):
            raise Refused(f"'{ast.unparse(node)}': another number of arguments than {count}")
        return self.elementwise(lambda *numbers: self._library(function, list(numbers)), *arguments)

    def _call_kernel(self, kernel: Any, arguments: list[Value], named: dict[str, Value]) -> Value:
        """The call of another kernel, which is translated for these types if it has not been
        yet.
        """
        source = source_of(kernel.py_func)
        given = dict(zip(source.parameters, arguments, strict=False)) | named
        for name, default in source.defaults.items():
            if name not in given:
                given[name] = self.constant(default)
        if given.keys() != set(source.parameters) or len(arguments) > len(source.parameters):
            raise Refused(
                f"a call of {source.name} with other arguments than {', '.join(source.parameters)}"
            )
        values = [given[name] for name in source.parameters]
        values = [value if value.rule is None else self.in_memory(value) for value in values]
        called = self.unit.function_for(kernel, tuple(self._passed(value) for value in values))
        self.effects += bool(called.written)
        if called.name in self.taken:
            raise Refused(f"a call of {called.name} beside a variable of that name")
        codes = []
        for value, (name, kind) in zip(_flat(values), called.parameters, strict=True):
            if isinstance(kind, Fixed):
                continue
            codes.append(value.code)
            if name in called.written:
                self._writes(value)
            if isinstance(kind, Array):
                assert isinstance(value.type, Array)
                actual = dict(
                    zip(
                        (*kind.shape, *kind.strides),
                        (*value.type.shape, *value.type.strides),
                        strict=True,
                    )
                )
                codes += [str(actual[size]) for size in kind.sizes if size in called.sizes]
        self._keep_apart(called, dict(zip(source.parameters, values, strict=True)))
        if isinstance(called.result, Array):
            made = self.space("result", called.result.shape)
            self.emit(f"{called.name}({', '.join([*codes, made.code])});")
            return replace(
                made, rule=lambda indices: self.element(made, indices), reads=((made, True),)
            )
        code = f"{called.name}({', '.join(codes)})"
        if isinstance(called.result, Tuple):
            own = self.fresh("result")
            self.emit(f"const {self.unit.result_type(called.result)} {own} = {code};")
            items = tuple(Value(item, f"{own}.v{n}") for n, item in enumerate(called.result.items))
            return Value(called.result, items=items)
        self._uses(code)
        return Value(called.result, code, volatile=True)

    def _keep_apart(self, called: CFunction, given: dict[str, Value]) -> None:
        """Refuse a call that writes what it reads afterwards; of own parameters callers have to see
        to it.
        """
        for pair in called.apart:
            written, read = (ways(way, given) for way in pair)
            if stems(written) & stems(read):
                raise Refused(
                    f"a call of {called.name} that writes to '{pair[0]}' what it reads as "
                    f"'{pair[1]}'"
                )
            self.function.apart |= set(product(written, read))

    @staticmethod
    def _passed(value: Value) -> Type:
        """What a kernel is translated for: a truth value that is known is part of it."""
        if value.type is BOOLEAN and isinstance(value.constant, bool):
            return Fixed(value.constant)
        if isinstance(value.type, Tuple):
            return Tuple(tuple(_Translator._passed(item) for item in value.items))
        return value.type.signature if isinstance(value.type, Array) else value.type


def _as_tuples(node: ast.expr) -> ast.expr:
    """Lists as tuples, for ``np.array``."""
    if isinstance(node, ast.List):
        return ast.copy_location(
            ast.Tuple([_as_tuples(item) for item in node.elts], ast.Load()), node
        )
    return node


def _flat(values: list[Value]) -> list[Value]:
    """Values with those inside tuples in the place of the tuples, as a function of C takes them."""
    flat: list[Value] = []
    for value in values:
        flat += _flat(list(value.items)) if isinstance(value.type, Tuple) else [value]
    return flat
