"""The body of a function of C while it is written: lines, blocks, and where each variable is
declared.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from harpy_pin.kernels.code import Code, c, variable
from harpy_pin.kernels.source import Source
from harpy_pin.kernels.unit import CFunction, Unit, numbered, unused


@dataclass
class Variable:
    """A local variable of C."""

    name: str  # in C
    of: str  # what the kernel calls it
    declaration: str  # its type and name, real *row
    array: bool = False  # whether it is declared as memory of its own


@dataclass
class Assignment:
    """``name = code;``, which may become the declaration, or ``name += code;``."""

    variable: Variable
    code: Code
    sign: str = "="
    declares: bool = False


def line_of(source: Source, node: ast.stmt) -> Code:
    """What says which line of Python the next ones come from."""
    return Code(f'#line {node.lineno} "{source.file}"')


@dataclass(eq=False)
class Block:
    """Statements between braces."""

    header: Code  # before the brace
    loop: bool = False  # whether it is gone through more than once
    own: Code | None = None  # what it counts with, which nothing outside of it is
    items: list[Code | Assignment | Block] = field(default_factory=list)
    declarations: list[str] = field(default_factory=list)

    def render(self, depth: int = 1) -> list[str]:
        """Lines of C."""
        indent = "    " * depth
        lines = [f"{indent}{line}" for line in self.declarations]
        for item in self.items:
            if isinstance(item, Block):
                joins = item.header.text == "else" and lines and lines[-1] == f"{indent}}}"
                header = f"{lines.pop()} else {{" if joins else f"{indent}{item.header} {{"
                lines += [header, *item.render(depth + 1), f"{indent}}}"]
            elif isinstance(item, Assignment):
                own = item.variable
                name = own.declaration if item.declares else own.name
                lines.append(f"{indent}{name} {item.sign} {item.code};")
            elif item.text:
                lines.append(f"{'' if item.text.startswith('#') else indent}{item}")
        return lines


Place = tuple[tuple[Block, int], ...]
"""The blocks around an item, from the outermost, with its position in each."""


def _items(block: Block, around: Place = ()) -> Iterator[tuple[Place, Code, Variable | None]]:
    """Every piece of C, where it is, and the variable that it is assigned to."""
    for n, item in enumerate(block.items):
        place = (*around, (block, n))
        if isinstance(item, Assignment):
            yield place, item.code, item.variable
        elif isinstance(item, Block):
            for where, code, target in (place, item.header, None), *_items(item, place):
                if item.own and item.own.text in code.names:
                    code = code._replace(names=code.names - item.own.names)
                yield where, code, target
        else:
            yield place, item, None


class Body:
    """A function that is being written. Names that C gets here are never those of the kernel's own
    variables.
    """

    def __init__(self, unit: Unit, function: CFunction, reserved: set[str]) -> None:
        self.unit, self.function, self.reserved = unit, function, reserved
        self.taken: set[str] = set()
        self.variables: dict[str, Variable] = {}
        self.work: list[str] = []  # variables that are work space
        self.path: list[Block] = [Block(Code(""))]
        self.emitted = 0  # lines so far

    def emit(self, template: str, *parts: Code | int | str) -> None:
        """Add a line, with pieces in the place of ``{}``."""
        self.emitted += 1
        self.path[-1].items.append(c(template, *parts))

    @contextmanager
    def block(
        self, header: Code, *, loop: bool = False, own: Code | None = None
    ) -> Iterator[Block]:
        """A block, which lines go to meanwhile."""
        block = Block(header, loop, own)
        self.path[-1].items.append(block)
        self.path.append(block)
        yield block
        self.path.pop()

    def fresh(self, name: str) -> Code:
        """A name that nothing has, which begins so."""
        own = unused(name, self.taken | self.reserved)
        self.taken.add(own)
        return variable(own)

    def variable(self, of: str, name: str, declaration: str, *, array: bool = False) -> Variable:
        """The variable of a name of the kernel; another one where that stood for another kind of
        thing, or if it is an array.
        """
        for own in numbered(name):
            found = self.variables.get(own)
            if found is not None and found.declaration == declaration.format(own) and not array:
                return found
            if found is None and own not in self.taken:
                break
        self.taken.add(own)
        self.variables[own] = Variable(own, of, declaration.format(own), array)
        return self.variables[own]

    def write(self, own: Variable, code: Code, sign: str = "=") -> Code:
        """Give a variable a value; returns the variable as C."""
        self.path[-1].items.append(Assignment(own, code, sign))
        return variable(own.name)

    def finish(self) -> list[str]:
        """Lines of C, without variables that nothing reads, and with the others declared."""
        root = self.path[0]
        places: dict[str, list[Place]] = {}
        for place, code, target in _items(root):
            for name in code.names | ({target.name} if target else set()):
                places.setdefault(name, []).append(place)
        self._drop_unused()
        for name, one in self.variables.items():
            _declare(one, root, places[name])
        codes = [code for _, code, _ in _items(root)]
        self.mentioned = {name for code in codes for name in code.names}
        self.function.calls = frozenset[str]().union(*(code.calls for code in codes))
        return root.render()

    def _drop_unused(self) -> None:
        """Remove variables that nothing reads; a call of a kernel stays."""
        while True:
            read = {
                name
                for _, code, target in _items(self.path[0])
                for name in code.names
                if target is None or target.name != name
            }
            unused = self.variables.keys() - read
            if not unused:
                return
            for place, code, target in list(_items(self.path[0])):
                if target is not None and target.name in unused:
                    block, n = place[-1]
                    block.items[n] = c("{};", code) if code.calls else Code("")
            for name in unused:
                del self.variables[name]


def _declare(own: Variable, root: Block, places: list[Place]) -> None:
    """Declare a variable where it is first assigned, if that is before everything else; otherwise
    further out.
    """
    if own.array:
        root.declarations.append(f"{own.declaration};")
        return
    common = 0
    while all(len(path) > common for path in places):
        if len({path[common][0] for path in places}) > 1:
            break
        common += 1
    blocks = [block for block, _ in places[0][:common]]
    home, first = blocks[-1], min(path[common - 1][1] for path in places)
    item = home.items[first]
    if isinstance(item, Assignment) and item.variable is own:
        item.declares = True
        return
    if any(block.loop for block in blocks):
        home = root  # what is kept from one round of a loop to the next
    home.declarations.append(f"{own.declaration} = 0;")
