"""A piece of C, with what the translation has to know about it."""

from __future__ import annotations

from typing import NamedTuple

ATOM = 100
"""How tightly names, calls and elements bind."""
UNARY = 90
"""How tightly signs and casts bind."""
BINDING = {"*": 80, "/": 80, "+": 70, "-": 70, "<": 60, "<=": 60, ">": 60, ">=": 60}
BINDING |= {"==": 55, "!=": 55, "&&": 40, "||": 30, "?": 20}
"""How tightly operators between two operands bind."""


NONE = frozenset[str]()


class Code(NamedTuple):
    """An expression in C, or a line."""

    text: str
    binding: int = ATOM  # how tightly its outermost operator binds
    names: frozenset[str] = NONE  # variables of C that stand in it
    loads: bool = False  # whether it reads an element or a field
    calls: frozenset[str] = NONE  # functions of C in it that are kernels

    def __str__(self) -> str:
        return self.text

    @property
    def is_name(self) -> bool:
        """Whether it is a variable, and nothing else."""
        return self.text in self.names

    def within(self, binding: int) -> Code:
        """The code as an operand of an operator that binds so tightly."""
        return self if self.binding >= binding else c("({})", self)

    @property
    def loaded(self) -> Code:
        """The same, where it is an element or a field that is read."""
        return Code(self.text, self.binding, self.names, True, self.calls)


def c(template: str, *parts: Code | int | str, binding: int = ATOM) -> Code:
    """C with pieces in the place of ``{}``."""
    names = calls = NONE
    loads = False
    for part in parts:
        if isinstance(part, Code):
            names, calls = names | part.names, calls | part.calls
            loads = loads or part.loads
    return Code(template.format(*parts), binding, names, loads, calls)


def variable(name: str) -> Code:
    """A variable of C."""
    return Code(name, names=frozenset((name,)))


def infix(a: Code, sign: str, b: Code) -> Code:
    """An operator between two operands."""
    binding = BINDING[sign]
    return c("{} {} {}", a.within(binding), sign, b.within(binding + 1), binding=binding)


def joined(codes: list[Code], separator: str = ", ", binding: int = ATOM) -> Code:
    """Pieces with a separator between them."""
    return c(separator.join(["{}"] * len(codes)), *codes, binding=binding)
