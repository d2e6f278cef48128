"""A kernel as a function in C, for one set of argument types, and the calls of it: what its
parameters are, and what goes to them.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from typing import Any

from harpy_pin.errors import KernelError
from harpy_pin.kernels.assignments import Wider
from harpy_pin.kernels.body import line_of
from harpy_pin.kernels.code import Code, c, joined, variable
from harpy_pin.kernels.numbers import EXTREMES
from harpy_pin.kernels.numpy_functions import FUNCTIONS, KEYWORDS
from harpy_pin.kernels.overlaps import stems, ways_of_caller
from harpy_pin.kernels.source import Source, kernel_of, source_of
from harpy_pin.kernels.statements import RESULT, Statements
from harpy_pin.kernels.types import BOOLEAN, NOTHING, Array, Fixed, Scalar, Struct, Tuple, Type
from harpy_pin.kernels.unit import CFunction, Unit
from harpy_pin.kernels.values import (
    AnArray,
    Computed,
    Done,
    Items,
    Named,
    Number,
    Record,
    Refused,
    Value,
    View,
    memory_at,
    refuse_if,
    refused,
)


def translate(unit: Unit, kernel: Any, types: tuple[Type, ...]) -> CFunction:
    """A kernel in a file of C, as one function for arguments of these types; a
    :class:`KernelError` says where it is refused.
    """
    function = kernel.py_func
    if (function, types) not in unit.functions:
        source = source_of(function)
        if function in unit.under_way:
            raise KernelError(f"{source.name} calls itself, which no kernel may")
        unit.under_way.append(function)
        name, learnt, made = unit.function_name(function), dict[object, Any](), None
        while made is None:
            try:
                made = _Function(unit, source, name, types, learnt).run()
            except Wider:
                continue
        unit.under_way.pop()
        unit.functions[function, types] = made
    return unit.functions[function, types]


class _Function(Statements):
    """A kernel while it is translated."""

    def __init__(
        self,
        unit: Unit,
        source: Source,
        name: str,
        types: tuple[Type, ...],
        learnt: dict[object, Any],
    ) -> None:
        super().__init__(unit, CFunction(name), source, learnt)
        for parameter, kind in zip(source.parameters, types, strict=True):
            self.environment[parameter] = self._parameter(parameter, kind)

    def _parameter(self, name: str, kind: Type) -> Value:
        """An argument as a value, with names for sizes that are known at run time."""
        own = self.unit.identifier(name)
        self.taken.add(own)
        if isinstance(kind, Tuple):
            items = enumerate(kind.items)
            return Items(tuple(self._parameter(f"{name}_{n}", item) for n, item in items))
        if isinstance(kind, Array):
            stem = own
            while self.reserved & {size.text for size in kind.named(stem).sizes}:
                stem += "_"
            kind = kind.named(stem)
            self.taken |= {size.text for size in kind.sizes}
        self.function.parameters.append((name, kind))
        memory = frozenset((name,))
        if isinstance(kind, Array | Struct):
            return memory_at(variable(own), kind, memory, memory)
        if isinstance(kind, Fixed):
            if self.stores[name]:
                raise KernelError(
                    f"{self.source.name} changes '{name}', a truth value that is known when "
                    f"compiling"
                )
            return self.constant(kind.value)
        assert isinstance(kind, Scalar)
        number = Number(kind, variable(own))
        if self.stores[name]:
            self.arguments[name] = number
        return number

    def run(self) -> CFunction:
        """Translate it."""
        function, source, tree = self.function, self.source, self.source.tree
        left = self.body(tree.body)
        function.result = self.learnt.get(RESULT, NOTHING)
        if not left and function.result != NOTHING:
            raise source.error(tree.body[-1], "the end may be reached, where there is no result")
        lines = self.finish()
        function.written &= {name for name, _ in function.parameters}
        parameters: list[str] = []
        silent: list[str] = []
        for name, kind in function.parameters:
            own = self.unit.identifier(name)
            if isinstance(kind, Fixed):
                continue
            parameters.append(self.unit.declare(kind, own))
            silent += [] if own in self.mentioned else [f"    (void){own};"]
            if isinstance(kind, Array):
                function.sizes |= {size.text for size in kind.sizes} & self.mentioned
                parameters += [f"integer {n}" for n in kind.sizes if n.text in function.sizes]
        if isinstance(function.result, Array):
            parameters.append(self.unit.declare(function.result, RESULT))
        result_type = self.unit.result_type(function.result)
        function.head = f"static {result_type} {function.name}({', '.join(parameters) or 'void'})"
        comment = self.unit.comment(source.docstring)
        line = [str(line_of(source, tree))] if self.unit.lines else []
        function.text = "\n".join([*comment, *line, function.head, "{", *silent, *lines, "}"])
        return function

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            owner = self.expression(node.func.value)
            if isinstance(owner, AnArray):
                return self.reshaped(owner, node.args)
        named = self.expression(node.func)
        if not isinstance(named, Named):
            raise refused(node.func, " is no function")
        function = named.target
        if kernel_of(function) is not None:
            return self._call_kernel(function, self._arguments(node, source_of(function.py_func)))
        if not any(function is one for one in FUNCTIONS):
            raise refused(node.func, " is no kernel and none of the functions that kernels have")
        if not {keyword.arg for keyword in node.keywords} <= KEYWORDS.get(function, set()):
            raise refused(node, ": arguments by name")
        options = {str(keyword.arg): self.number(keyword.value) for keyword in node.keywords}
        arguments = self._tuple(ast.Tuple(list(map(_as_tuples, node.args)))).items
        count, make = FUNCTIONS[function]
        if len(arguments) != count and not (len(arguments) > count and function in EXTREMES):
            raise refused(node, f": another number of arguments than {count}")
        return make(self, *arguments, **options)

    def _arguments(self, node: ast.Call, source: Source) -> dict[str, Value]:
        """Arguments of a call by the names that they have in the kernel, in its order."""
        names = [keyword.arg or "**" for keyword in node.keywords]
        values = [keyword.value for keyword in node.keywords]
        items = list(self._tuple(ast.Tuple([*node.args, *values])).items)
        count = len(items) - len(names)
        given = dict(zip(source.parameters, items[:count], strict=False))
        given |= dict(zip(names, items[count:], strict=True))
        for name, default in source.defaults.items():
            if name not in given:
                given[name] = self.known(default)
        if given.keys() != set(source.parameters) or count > len(source.parameters):
            expected = ", ".join(source.parameters)
            raise Refused(f"a call of {source.name} with other arguments than {expected}")
        return {name: given[name] for name in source.parameters}

    def _call_kernel(self, kernel: Any, given: dict[str, Value]) -> Value:
        """The call of another kernel, which is translated for these types if it has not been
        yet.
        """
        for name, value in given.items():
            given[name] = self.in_memory(value) if isinstance(value, Computed) else value
        called = translate(self.unit, kernel, tuple(map(_passed, given.values())))
        self.effects += bool(called.written)
        refuse_if(
            called.name in self.taken, f"a call of {called.name} beside a variable of that name"
        )
        codes: list[Code] = []
        for value, (name, kind) in zip(_flat(given.values()), called.parameters, strict=True):
            if name in called.written and isinstance(value, View | Record):
                self.function.written |= value.roots
            if isinstance(value, View) and isinstance(kind, Array):
                codes.append(value.address)
                sizes = (*kind.shape, *kind.strides), (*value.shape, *value.type.strides)
                actual = dict(zip(*sizes, strict=True))
                codes += [c("{}", actual[n]) for n in kind.sizes if n.text in called.sizes]
            elif not isinstance(kind, Fixed):
                codes.append(value.code if isinstance(value, Number) else value.address)
        self._keep_apart(called, given)
        call = Code(called.name, calls=frozenset((called.name,)))
        if isinstance(called.result, Array):
            made = self.space("result", called.result.shape)
            self.emit("{}({});", call, joined([*codes, made.base]))
            return replace(made, made=True)
        code = c("{}({})", call, joined(codes))
        if isinstance(called.result, Tuple):
            own = self.fresh("result")
            self.emit("const {} {} = {};", self.unit.result_type(called.result), own, code)
            kinds = [kind for kind in called.result.items if isinstance(kind, Scalar)]
            return Items(tuple(Number(kind, c("{}.v{}", own, n)) for n, kind in enumerate(kinds)))
        return Number(called.result, code) if isinstance(called.result, Scalar) else Done(code)

    def _keep_apart(self, called: CFunction, given: dict[str, Value]) -> None:
        """Refuse a call that writes what it reads afterwards; of own parameters callers have to see
        to it.
        """
        memory = {
            name: value.ways or value.roots
            for name, value in given.items()
            if isinstance(value, View | Record)
        }
        for pair in called.apart:
            written, read = (ways_of_caller(way, memory) for way in pair)
            refuse_if(
                bool(stems(written) & stems(read)),
                f"a call of {called.name} that writes to '{pair[0]}' what it reads as '{pair[1]}'",
            )
            self.function.apart |= set(product(written, read))


def _passed(value: Value) -> Type:
    """What a kernel is translated for: a truth value that is known is part of it."""
    if isinstance(value, Items):
        return Tuple(tuple(map(_passed, value.items)))
    if isinstance(value, View):
        return value.type.signature
    if isinstance(value, Number) and value.type is BOOLEAN and isinstance(value.constant, bool):
        return Fixed(value.constant)
    if isinstance(value, Number | Record):
        return value.type
    raise Refused("an argument that is neither a number nor an array nor a record")


def _as_tuples(node: ast.expr) -> ast.expr:
    """Lists as tuples, for ``np.array``."""
    if isinstance(node, ast.List):
        return ast.copy_location(ast.Tuple(list(map(_as_tuples, node.elts))), node)
    return node


def _flat(values: Iterable[Value]) -> list[Number | View | Record]:
    """Values with those inside tuples in the place of the tuples, as a function of C takes them."""
    flat: list[Number | View | Record] = []
    for value in values:
        if isinstance(value, Items):
            flat += _flat(value.items)
        elif isinstance(value, Number | View | Record):
            flat.append(value)
    return flat
