"""A function of C while it is written: nested blocks, and where each variable is declared."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from harpy_pin.kernels.types import NOTHING, Scalar, Type


class Wider(Exception):
    """Something was learnt that what is written already depends on: start again."""


@dataclass
class Learnt:
    """What is known of a function from earlier attempts to translate it."""

    # of variables that are numbers, the type that holds every value
    ranks: dict[str, Scalar] = field(default_factory=dict)
    result: list[Type] = field(default_factory=list)  # the type of the result, once there is one
    # of variables that are arrays, the arguments and fields that they may stand for
    memory: dict[str, tuple[frozenset[str], frozenset[str]]] = field(default_factory=dict)
    # by the line of a loop, names that stand for different things from one round to the next
    unsettled: dict[int, set[str]] = field(default_factory=dict)


@dataclass
class CFunction:
    """A kernel in C, for one set of types."""

    name: str  # in C
    parameters: list[
        tuple[str, Type]
    ]  # names and types, with sizes that are known at run time named
    # the names of those sizes that the body uses; they are parameters, too
    sizes: set[str] = field(default_factory=set)
    result: Type = NOTHING  # what it returns
    written: set[str] = field(default_factory=set)  # parameters whose memory it writes
    # ways from parameters to memory that is written, and to what is read afterwards: no two may be
    # the same
    apart: set[tuple[str, str]] = field(default_factory=set)
    head: str = ""  # of its declaration
    text: str = ""  # all of it


@dataclass(eq=False)
class Variable:
    """A local variable of C."""

    name: str  # in C
    declaration: str  # its type and name, real *row
    array: bool = (
        False  # whether the declaration makes an array, which no assignment can stand in for
    )
    # for each mention the blocks around it, from the outermost, with its position in each
    places: list[tuple[tuple[Block, int], ...]] = field(default_factory=list)


@dataclass(eq=False)
class Assignment:
    """``name = code;``, which may become the declaration, or ``name += code;``."""

    variable: Variable
    code: str
    sign: str = "="
    declares: bool = False


@dataclass(frozen=True)
class Line:
    """The line of Python that what follows comes from."""

    number: int
    file: str

    def __str__(self) -> str:
        return f'#line {self.number} "{self.file}"'


@dataclass(eq=False)
class Block:
    """Statements between braces."""

    header: str = ""  # before the brace
    loop: bool = False  # whether it is gone through more than once
    items: list[str | Assignment | Block | Line] = field(default_factory=list)
    declarations: list[str] = field(default_factory=list)


def place(variable: Variable) -> None:
    """Declare a variable where it is first assigned, if that is before everything else; otherwise
    further out.
    """
    if not variable.places:
        return
    if variable.array:
        variable.places[0][0][0].declarations.append(f"{variable.declaration};")
        return
    common = 0
    while all(len(path) > common for path in variable.places):
        if len({path[common][0] for path in variable.places}) > 1:
            break
        common += 1
    blocks = [block for block, _ in variable.places[0][:common]]
    home = blocks[-1]
    first = min(path[common - 1][1] for path in variable.places)
    item = home.items[first] if first < len(home.items) else None
    if isinstance(item, Assignment) and item.variable is variable:
        item.declares = True
        return
    if any(block.loop for block in blocks):
        home = blocks[0]  # what is kept from one round of a loop to the next
    home.declarations.append(f"{variable.declaration} = 0;")


def mentions(code: str, name: str) -> bool:
    """Whether a variable stands in a piece of C."""
    return (
        name in code and re.search(rf"(?<![\w.])(?<!->){re.escape(name)}(?!\w)", code) is not None
    )


def drop_unused(
    root: Block, variables: dict[str, Variable], is_pure: Callable[[str], bool]
) -> None:
    """Remove variables that nothing reads; a call with effects stays."""
    while True:
        pieces = list(_pieces(root))
        unused = {
            variable
            for variable in variables.values()
            if not any(
                owner is not variable and mentions(code, variable.name) for owner, code in pieces
            )
        }
        if not unused:
            return
        _remove(root, unused, is_pure)
        for variable in unused:
            del variables[variable.name]


def _pieces(block: Block) -> Iterator[tuple[Variable | None, str]]:
    """Every piece of code, with the variable that it is assigned to."""
    for item in block.items:
        if isinstance(item, Block):
            yield None, item.header
            yield from _pieces(item)
        elif isinstance(item, Assignment):
            yield item.variable, item.code
        elif isinstance(item, str):
            yield None, item


def _remove(block: Block, unused: set[Variable], is_pure: Callable[[str], bool]) -> None:
    for n, item in enumerate(block.items):
        if isinstance(item, Block):
            _remove(item, unused, is_pure)
        elif isinstance(item, Assignment) and item.variable in unused:
            block.items[n] = "" if is_pure(item.code) else f"{item.code};"  # places of others stay


def render(block: Block, depth: int = 1) -> list[str]:
    """Lines of a block."""
    indent = "    " * depth
    lines = [f"{indent}{line}" for line in block.declarations]
    for item in block.items:
        if isinstance(item, Block):
            joins = item.header == "else" and lines and lines[-1] == f"{indent}}}"
            header = f"{lines.pop()} else {{" if joins else f"{indent}{item.header} {{"
            lines += [header, *render(item, depth + 1), f"{indent}}}"]
        elif isinstance(item, Assignment):
            name = item.variable.declaration if item.declares else item.variable.name
            lines.append(f"{indent}{name} {item.sign} {item.code};")
        elif isinstance(item, Line):
            lines.append(str(item))
        elif item:
            lines.append(f"{indent}{item}")
    return lines
