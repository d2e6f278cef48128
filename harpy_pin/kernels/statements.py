"""Statements of a kernel: branches, loops and returns."""

from __future__ import annotations

import ast
from operator import or_

from harpy_pin.kernels.arrays import as_number
from harpy_pin.kernels.assignments import Assignments, stored
from harpy_pin.kernels.body import line_of
from harpy_pin.kernels.code import BINDING, Code, c, joined, variable
from harpy_pin.kernels.types import INTEGER, NOTHING, REAL, Array, Scalar, Tuple, Type, known
from harpy_pin.kernels.values import (
    AnArray,
    Done,
    Items,
    Named,
    Number,
    Refused,
    Value,
    View,
    refuse_if,
)

RESULT = "result_"
"""The name of the memory that an array is returned in; no other name of C ends so."""
SHORT = 3
"""Rounds of a loop that is unrolled: on a microcontroller the condensed WBC takes 0.85 of the
instructions.
"""

Environment = dict[str, Value | None]


class Statements(Assignments):
    """Goes through the statements once; types that turn out too narrow are kept for the next
    attempt.
    """

    def body(self, statements: list[ast.stmt]) -> bool:
        """Statements one after the other; returns whether what follows them is never reached
        through them.
        """
        for statement in statements:
            name = type(statement).__name__
            if self.unit.lines:
                self.path[-1].items.append(line_of(self.source, statement))
            try:
                translate = getattr(self, f"do_{name.lower()}", None)
                if translate is None:
                    raise Refused(f"kernels have no {name}")
                left = translate(statement)
            except Refused as reason:
                raise self.source.error(statement, str(reason)) from None
            if left:
                return True
        return False

    def inside(self, header: Code, statements: list[ast.stmt], *, loop: bool = False) -> bool:
        """Statements in a block of their own."""
        with self.block(header, loop=loop):
            return self.body(statements)

    def do_pass(self, _: ast.Pass) -> None:
        """Nothing."""

    def do_expr(self, statement: ast.Expr) -> None:
        """A call, or a docstring."""
        if isinstance(statement.value, ast.Constant):
            return
        value = self.expression(statement.value)
        refuse_if(not isinstance(statement.value, ast.Call), "an expression that does nothing")
        if isinstance(value, Number | Done):
            self.emit("{};", value.code)

    def do_return(self, statement: ast.Return) -> bool:
        """A result: none, a number, several numbers, or an array, which goes to memory that the
        caller gives.
        """
        value = self.expression(statement.value) if statement.value is not None else None
        if isinstance(value, AnArray):
            self._return_array(value)
        elif value is None:
            self._returns(NOTHING)
            self.emit("return;")
        else:
            several = isinstance(value, Items)
            numbers = [
                as_number(item, "a kernel returns numbers or an array of numbers")
                for item in (value.items if isinstance(value, Items) else (value,))
            ]
            types = tuple(number.type for number in numbers)
            kind = self._returns(Tuple(types) if several else types[0])
            kinds = kind.items if isinstance(kind, Tuple) else (kind,)
            pairs = zip(numbers, kinds, strict=True)
            codes = [self.cast(n, to).code for n, to in pairs if isinstance(to, Scalar)]
            text = c("({}){{{}}}", self.unit.result_type(kind), joined(codes))
            self.emit("return {};", text if several else codes[0])
        return True

    def _return_array(self, value: AnArray) -> None:
        refuse_if(
            known(value.shape) is None,
            "a result whose size is not known when compiling: give an array to be written",
        )
        kind, memory = Array.packed(REAL, value.shape), frozenset((RESULT,))
        self._returns(kind)
        if 0 in value.shape:
            self.emit("(void){};", RESULT)
        self.fill(View(kind, Code(RESULT), None, memory, memory), value)
        self.emit("return;")

    def _returns(self, kind: Type) -> Type:
        """The type of the result, which may have to hold another one, too."""
        return self.learn(RESULT, kind, _unified)

    def do_if(self, statement: ast.If) -> bool:
        """A branch; only one side is translated where the condition is known."""
        condition = self.truth(statement.test)
        if condition.constant is not None:
            return self.body(statement.body if condition.constant else statement.orelse)
        before = dict(self.environment)
        left = self.inside(c("if ({})", condition.code), statement.body)
        after, self.environment = self.environment, before
        orelse = statement.orelse
        left_otherwise = bool(orelse) and self.inside(Code("else"), orelse)
        if not left:
            ways = (after,) if left_otherwise else (after, self.environment)
            self.environment = _merged(*ways)
        return left and left_otherwise

    def _loop(
        self, header: Code, statement: ast.For | ast.While, own: Code | None = None, first: str = ""
    ) -> None:
        """A block that may be gone through again: names must stand for the same kind of thing
        then, or are known no more.
        """
        before, work = dict(self.environment), len(self.work)
        self.jumps.append([])
        # one that is a variable already has a place that is settled
        own = None if own is None or own.text in self.variables else own
        with self.block(header, loop=True, own=own):
            if first:
                self.emit(first)
            left = self.body(statement.body)
        ends = self.jumps.pop() + ([] if left else [self.environment])
        after = _merged(before, *ends)
        changed = {
            name for name, value in before.items() if value is not None and after[name] is None
        }
        self.learn(statement, frozenset(changed), or_)
        for name in before:
            value = after[name]
            refuse_if(
                bool(isinstance(value, View) and value.roots & set(self.work[work:])),
                f"'{name}', which outlives the work space of its round",
            )
        self.environment = after

    def _enter(self, statement: ast.For | ast.While) -> None:
        """Before a loop: a name that stands for another kind of thing in the next round is known no
        more.
        """
        for name in self.learn(statement, frozenset[str](), or_):
            self.environment[name] = None

    def do_while(self, statement: ast.While) -> bool:
        """A loop with a condition."""
        refuse_if(bool(statement.orelse), "a loop with else")
        self._enter(statement)
        condition: Number = self.inline(self.truth, statement.test)
        self._loop(c("while ({})", condition.code), statement)
        leaves = any(isinstance(node, ast.Break) for node in ast.walk(statement))
        return condition.constant is True and not leaves

    def do_break(self, statement: ast.Break | ast.Continue) -> bool:
        """Out of a loop, or to its next round."""
        self.jumps[-1].append(dict(self.environment))
        self.emit("{};", type(statement).__name__.lower())
        return True

    do_continue = do_break

    def do_for(self, statement: ast.For) -> None:
        """A loop over a range, over a tuple of numbers of one type, or over one of kernels."""
        if not isinstance(statement.target, ast.Name) or statement.orelse:
            raise Refused("a loop over several names, or with else")
        name, call, first = statement.target.id, statement.iter, ""
        refuse_if(
            name != "_" and name in stored(statement.body), f"'{name}', which its loop changes"
        )
        own = variable(self.unit.identifier(name)) if name != "_" else self.fresh("round")
        before = self.environment.get(name)
        item = Number(INTEGER, own)
        if (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "range"
        ):
            header = self._range(own, call, statement.body)
            if header is None:
                return
        else:
            items = self.expression(call)
            if isinstance(items, Items) and all(isinstance(one, Named) for one in items.items):
                self._over_kernels(name, items, statement.body)
                return
            header, item, first = self._over_items(own, items)
        self.environment[name] = item
        self._enter(statement)
        self._loop(header, statement, own, first)
        self.environment.pop(name, None)
        if before is not None:
            self.environment[name] = None

    def _range(self, own: Code, call: ast.Call, body: list[ast.stmt]) -> Code | None:
        """The header of a loop over a range; None where it is certainly empty."""
        bounds = [self.integer(argument) for argument in call.args]
        begin, end = bounds[:2] if len(bounds) > 1 else (self.constant(0), bounds[0])
        step = bounds[2].constant if len(bounds) == 3 else 1
        if not isinstance(step, int) or step == 0:
            raise Refused("a step that is not known when compiling")
        if own.text in begin.code.names:
            begin = self.keep(f"{own}_begin", begin)
        rounds = SHORT + 1  # or not known
        if begin.constant is not None and end.constant is not None:
            rounds = len(range(int(begin.constant), int(end.constant), step))
            if rounds == 0:
                return None
        if end.constant is None and self._may_change(end.code, body):
            end = self.keep(f"{own}_end", end)
        sign = "<" if step > 0 else ">"
        advance = {1: f"{own}++", -1: f"{own}--"}.get(step, f"{own} += {step}")
        unroll = "" if rounds > SHORT else f"#pragma GCC unroll {rounds}\n"
        bound = end.code.within(BINDING["+"])
        parts = (unroll, own, begin.code, own, sign, bound, advance)
        return c("{}for (integer {} = {}; {} {} {}; {})", *parts)

    def _may_change(self, code: Code, body: list[ast.stmt]) -> bool:
        """Whether the end of a range is computed once, before the loop."""
        changed = code.names & set(map(self.unit.identifier, stored(body)))
        simple = code.binding >= BINDING["+"] and "(" not in code.text
        return bool(changed) or not simple or self.may_change(code)

    def _over_kernels(self, name: str, items: Items, body: list[ast.stmt]) -> None:
        """A loop over kernels: its body once for each of them."""
        jumps = (ast.Break, ast.Continue, ast.Return)
        inside = (node for statement in body for node in ast.walk(statement))
        refuse_if(any(isinstance(node, jumps) for node in inside), "a jump out of kernels in a row")
        for item in items.items:
            self.environment[name] = item
            self.body(body)
        self.environment.pop(name, None)

    def _over_items(self, own: Code, items: Value) -> tuple[Code, Number, str]:
        """A loop over a tuple, whose numbers go into an array first: its header, an item, and how
        a round begins.
        """
        numbers = [item for item in self.items_of(items) if isinstance(item, Number)]
        kinds = {number.type for number in numbers}
        if not isinstance(items, Items) or len(numbers) < len(items.items) or len(kinds) != 1:
            raise Refused(
                "a loop over something that is neither range() nor a tuple of numbers of one type"
            )
        (kind,), count = kinds, len(numbers)
        values, codes = self.fresh(f"{own}_values"), joined([number.code for number in numbers])
        self.emit("const {} {}[{}] = {{{}}};", str(kind), values, count, codes)
        n = self.fresh(f"{own}_n")
        header = c("for (int {} = 0; {} < {}; {}++)", n, n, count, n)
        return header, Number(kind, own), f"const {kind} {own} = {values}[{n}];"


def _unified(a: Type, b: Type) -> Type:
    """A type that holds both."""
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return max(a, b, key=lambda kind: kind.rank)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(_unified(x, y) for x, y in zip(a.items, b.items, strict=True)))
    refuse_if(a != b, "results of different kinds")
    return a


def _merged(first: Environment, *others: Environment) -> Environment:
    """What is known after several ways: a name that stands for two kinds of thing is known no
    more.

    One that is assigned on some ways only is a variable with a value all the same.
    """
    merged = dict(first)
    for other in others:
        for name, value in other.items():
            merged[name] = value if name not in merged or merged[name] == value else None
    return merged
