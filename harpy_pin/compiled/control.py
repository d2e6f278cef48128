"""Branches, loops and returns of a kernel as statements of C."""

from __future__ import annotations

import ast

from harpy_pin.compiled.assignments import Assignments
from harpy_pin.compiled.blocks import Block, mentions
from harpy_pin.compiled.function import Wider
from harpy_pin.compiled.scalars import SUM, Refused, wider, wrap
from harpy_pin.compiled.types import INTEGER, NOTHING, Scalar, Tuple, Type, Value
from harpy_pin.compiled.variables import stored

__all__ = ["Control"]


class Control(Assignments):
    """Translates blocks of statements, and what decides which of them run."""

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
        return any(mentions(code, self.unit.identifier(name)) for name in stored(body))


def _unify(a: Type, b: Type) -> Type:
    """A type that holds both."""
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return wider(a, b)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(_unify(x, y) for x, y in zip(a.items, b.items, strict=True)))
    if a != b:
        raise Refused("results of different kinds")
    return a
