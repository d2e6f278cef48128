"""Assignments of a kernel as statements of C."""

from __future__ import annotations

import ast

import numpy as np

from harpy_pin.compiled.scalars import ATOM, Refused, refused
from harpy_pin.compiled.types import BOOLEAN, INTEGER, REAL, Array, Function, Scalar, Tuple, Value
from harpy_pin.compiled.variables import Variables, stored

__all__ = ["Assignments"]

SIGNS: dict[type[ast.operator], str] = {ast.Mult: "*=", ast.Add: "+=", ast.Sub: "-="}
"""Operators that change a variable or an element."""


class Assignments(Variables):
    """Translates assignments to names, elements, views and fields."""

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
                raise refused(target, ": an array is written through [:]")
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
            names = {variable for name in stored([element]) for variable in self._variables_of(name)}
            memory = any(isinstance(part, ast.Subscript | ast.Attribute) for part in ast.walk(element))
            for m in range(n + 1, len(items)):
                items[m] = self._unharmed(items[m], names, memory)
        for element, item in zip(target.elts, items, strict=True):
            self._assign(element, item, "")

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
            raise refused(value, ": work space has a shape and a dtype")
        element = self._element_type(kinds[0]) if kinds else REAL
        parts = list(value.args[0].elts) if isinstance(value.args[0], ast.Tuple) else [value.args[0]]
        sizes = [self.integer(part).constant for part in parts]
        if not isinstance(target, ast.Name) or not all(isinstance(size, int) for size in sizes):
            raise refused(value, ": the size of work space must be known when compiling")
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
            raise refused(target.value, " is no array")
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
            sign = SIGNS.get(type(operator))
            if sign is None or value.type.rank > place.type.element.rank:  # type: ignore[union-attr]
                raise refused(statement)
            self._fill(place, value, sign)
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
