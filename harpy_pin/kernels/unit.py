"""A file of C: the functions that a kernel needs, one struct for each record, the constants by
name.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate, count
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin.kernels.types import NOTHING, Array, Nothing, Struct, Tuple, Type, known

KEYWORDS = """auto break case char const continue default do double else enum extern float for
goto if inline int long register restrict return short signed sizeof static struct switch typedef
union unsigned void volatile while bool true false integer real inside within slot isfinite isnan"""
MATHEMATICS = "sqrt sin cos tanh exp atan2 acos hypot copysign floor ceil fabs pow fmod rint"
RESERVED = frozenset(
    [*KEYWORDS.split(), *MATHEMATICS.split(), *(f"{name}f" for name in MATHEMATICS.split())]
)
"""Words of C, and what generated code calls: no variable and no function may have such a name."""
FUNCTIONS = """acosh asin asinh atan atanh cbrt cosh erf erfc exp2 expm1 fdim fma fmax fmin
fpclassify frexp gamma ilogb isgreater isinf isless isnormal isunordered j0 j1 jn ldexp lgamma
llrint llround log log10 log1p log2 logb lrint lround modf nan nearbyint nextafter nexttoward
remainder remquo round scalb scalbln scalbn signbit significand sinh tan tgamma trunc y0 y1 yn
abort abs atexit atof bsearch calloc div exit free getenv index labs ldiv llabs malloc memcpy
memmove memset mktemp printf puts qsort rand random read realloc remove rename rindex signal srand
strtod system time write entry main signature"""
ELSEWHERE = frozenset(FUNCTIONS.split())
"""Functions of C's library: no function may have such a name."""
_TEXT = Path(__file__).with_name("helpers.c").read_text(encoding="utf-8")
HELPERS = {
    name: text
    for text, name in re.findall(
        r"^(static inline \w+ (\w+)\(.*?^\})$", _TEXT, re.DOTALL | re.MULTILINE
    )
}
"""Functions of C that generated code calls, by name."""
PART = 40_000
"""Characters of a part, which are about a second's work of GCC."""
SHORT = 1_000
"""Most characters of a function that each part has for itself."""
HIDDEN = '__attribute__((visibility("hidden")))'


def in_part(number: int | str) -> str:
    """The line of C before what only one part has; without ``PART`` the file is compiled whole."""
    return f"#if !defined(PART) || PART == {number}"


def numbered(stem: str) -> Iterator[str]:
    """Names that begin so."""
    return (f"{stem}_{n}" if n > 1 else stem for n in count(1))


def unused(stem: str, taken: Collection[str]) -> str:
    """A name that begins so, and that is not taken."""
    return next(name for name in numbered(stem) if name not in taken)


@dataclass
class CFunction:
    """A kernel in C, for one set of types."""

    name: str  # in C
    # names and types, with sizes that are known at run time named
    parameters: list[tuple[str, Type]] = field(default_factory=list)
    # the names of those sizes that the body uses; they are parameters, too
    sizes: set[str] = field(default_factory=set)
    result: Type = NOTHING  # what it returns
    written: set[str] = field(default_factory=set)  # parameters whose memory it writes
    calls: frozenset[str] = frozenset()  # names of the kernels that it calls
    # ways from parameters to memory that is written, and to what is read afterwards: no two may be
    # the same
    apart: set[tuple[str, str]] = field(default_factory=set)
    head: str = ""  # of its declaration
    text: str = ""  # all of it


@dataclass
class Unit:
    """C being written."""

    # whether real numbers are floats, and integers of 32 bits; otherwise doubles and 64 bits
    single: bool = False
    debug: bool = False  # whether every index is checked when it is used
    lines: bool = False  # whether it names the lines of Python that it comes from, for debuggers
    prefix: str = ""  # of the names of structs
    # functions real_<name> that take the place of those of C's library, by their names there
    own: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    structs: dict[np.dtype[Any], str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    helpers: dict[str, str] = field(default_factory=dict)
    results: dict[Tuple, str] = field(default_factory=dict)
    functions: dict[tuple[Any, tuple[Type, ...]], CFunction] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)  # names that functions have, or must not have
    under_way: list[Any] = field(default_factory=list)  # kernels that are being translated

    def literal(self, number: float) -> str:
        """A real number."""
        if math.isinf(number):
            return "(real)INFINITY" if number > 0 else "-(real)INFINITY"
        if math.isnan(number):
            return "(real)NAN"
        return repr(number) + ("f" if self.single else "")

    def define(self, name: str, code: str) -> str:
        """A constant by name; of two constants of one name the later one has a number."""
        names = (own for own in numbered(name) if own not in ("INFINITY", "NAN", "NULL"))
        return next(own for own in names if self.constants.setdefault(own, code) == code)

    def helper(self, name: str) -> str:
        """One of :data:`HELPERS`, from now on a part of the file."""
        text = (
            HELPERS[name]
            .replace("$fmod", self.function("fmod"))
            .replace("$copysign", self.function("copysign"))
        )
        self.helpers.setdefault(name, text)
        return name

    def function(self, name: str) -> str:
        """A function of C's library, for this precision, or what stands for it."""
        if name in self.own:
            self.helpers.update({text: text.strip() for text in self.own[name]})
            return f"real_{name}"
        return f"{name}f" if self.single else name

    def identifier(self, name: str) -> str:
        """A name as C takes it; names in capitals are those of constants, and two names stay
        two.
        """
        return f"{name}_" if name in RESERVED or name.isupper() or name.endswith("_") else name

    def result_type(self, kind: Type) -> str:
        """The type of what a function returns."""
        if isinstance(kind, Nothing | Array):
            return "void"
        if isinstance(kind, Tuple):
            letters = "".join(
                {"real": "r", "integer": "i", "bool": "b"}[str(item)] for item in kind.items
            )
            return self.results.setdefault(kind, f"results_{letters}")
        return str(kind)

    def element(self, kind: Type) -> str:
        """The type of a number or a record, or of the elements of an array."""
        kind = kind.element if isinstance(kind, Array) else kind
        return f"struct {self.struct(kind)}" if isinstance(kind, Struct) else str(kind)

    def declare(self, kind: Type, name: str) -> str:
        """A declaration of a name; that of an array or a record is a pointer."""
        return f"{self.element(kind)} {'*' * isinstance(kind, Array | Struct)}{name}"

    def struct(self, record: Struct) -> str:
        """The name of a record's struct."""
        if record.dtype not in self.structs:
            for kind in record.fields().values():
                self.element(kind)  # a struct before this one
            stem = self.identifier(self.prefix + record.name)
            self.structs[record.dtype] = unused(stem, self.structs.values())
        return self.structs[record.dtype]

    def comment(self, text: str) -> list[str]:
        """A docstring as a comment."""
        if not text:
            return []
        lines = textwrap.wrap(" ".join(text.replace("*/", "* /").split()), 112)
        return ("/* " + "\n   ".join(lines) + " */").split("\n")

    def types(self) -> str:
        """The types of the numbers, and the structs."""
        real, whole = ("float", "int32_t") if self.single else ("double", "int64_t")
        parts = [f"typedef {real} real;\ntypedef {whole} integer;"]
        parts += [self._struct_text(dtype, name) for dtype, name in self.structs.items()]
        return "\n\n".join(parts)

    def code(self, *, apart: bool = False) -> str:
        """Constants, helpers and functions; ``apart`` in parts for as many compilers
        (:meth:`_parts`).
        """
        constants = "\n".join(f"#define {name} {value}" for name, value in self.constants.items())
        results = "\n".join(
            f"typedef struct "
            f"{{ {' '.join(f'{item} v{n};' for n, item in enumerate(kind.items))} }} {name};"
            for kind, name in self.results.items()
        )
        parts = [constants, results, *self.helpers.values()]
        parts += self._parts() if apart else [function.text for function in self.functions.values()]
        return "\n\n".join(part for part in parts if part)

    def _parts(self) -> list[str]:
        """Functions in parts of about equal length: a compiler makes that one whose number ``PART``
        is.

        Short functions are in every part that calls them; longer ones are in one, and the others
        call them there.
        """
        functions = list(self.functions.values())
        ends = list(accumulate(len(function.text) for function in functions))
        parts = 1 + ends[-1] // PART
        if parts == 1:
            return [function.text for function in functions]
        middles = [
            end - len(function.text) // 2 for function, end in zip(functions, ends, strict=True)
        ]
        part = {
            function.name: n * parts // ends[-1]
            for function, n in zip(functions, middles, strict=True)
        }
        called: dict[str, set[int]] = {name: set() for name in part}
        heads, texts = [], []
        for function in reversed(functions):  # callers before what they call
            text, places = function.text, called[function.name] | {part[function.name]}
            if len(places) > 1 and len(text) > SHORT:
                places = {part[function.name]}
                head = function.head.replace("static", HIDDEN, 1)
                text = text.replace(function.head, head, 1)
                heads.append(f"{head};")
            for name in function.calls:
                called[name] |= places
            texts.append(text if len(places) > 1 else f"{in_part(*places)}\n{text}\n#endif")
        return [f"#define PARTS {parts}\n" + "\n".join(heads), *reversed(texts)]

    def header(self) -> str:
        """What the file includes."""
        names = [
            "math.h",
            "stdbool.h",
            "stddef.h",
            "stdint.h",
            *(("stdio.h", "stdlib.h") if self.debug else ()),
        ]
        return "\n".join(f"#include <{name}>" for name in names)

    def _struct_text(self, dtype: np.dtype[Any], name: str) -> str:
        lines = [f"struct {name} {{"]
        for entry, kind in Struct(dtype).fields().items():
            shape = known(kind.shape) if isinstance(kind, Array) else None
            count = "" if shape is None else f"[{math.prod(shape)}]"
            axes = f"  /* {shape} */" if shape is not None and len(shape) > 1 else ""
            if count != "[0]":
                lines.append(f"    {self.element(kind)} {self.identifier(entry)}{count};{axes}")
        return "\n".join([*lines, "};"])

    def function_name(self, function: Any) -> str:
        """A name for a kernel that nothing has."""
        module, name = function.__module__.rpartition(".")[2], function.__name__.strip("_")
        stem = f"{module}_{name}" if function.__name__.startswith("_") else name
        stem = f"kernel_{stem}" if stem.startswith("results_") else stem  # those are types
        own = unused(stem, self.taken | RESERVED | ELSEWHERE | HELPERS.keys())
        self.taken.add(own)
        return own
