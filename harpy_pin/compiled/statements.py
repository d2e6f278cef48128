"""A kernel as a function in C, for one set of argument types."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from harpy_pin.compiled.blocks import drop_unused, mentions, place, render
from harpy_pin.compiled.control import Control
from harpy_pin.compiled.function import CFunction, Learnt, Wider
from harpy_pin.compiled.scalars import Refused
from harpy_pin.compiled.source import Source
from harpy_pin.compiled.types import BOOLEAN, NOTHING, Array, Fixed, Function, Scalar, Struct, Tuple, Type, Value

if TYPE_CHECKING:
    from harpy_pin.compiled.unit import Unit

__all__ = ["translate"]


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
    learnt = Learnt()
    while True:
        try:
            return _Translator(unit, source, name, types, learnt).run()
        except Wider:
            continue


class _Translator(Control):
    """Goes through the statements once; types that turn out too narrow are kept for the next attempt."""

    def __init__(self, unit: Unit, source: Source, name: str, types: tuple[Type, ...], learnt: Learnt) -> None:
        super().__init__(unit, source, name, learnt)
        for parameter, kind in zip(source.parameters, types, strict=True):
            self.environment[parameter] = self._parameter(parameter, kind)

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
