"""The function of a library that Python calls: arguments come as one array of slots, results go
into another.
"""

from __future__ import annotations

import json
from typing import Any

from harpy_pin.kernels.code import Code
from harpy_pin.kernels.functions import translate
from harpy_pin.kernels.source import source_of
from harpy_pin.kernels.types import BOOLEAN, Array, Scalar, Tuple, Type
from harpy_pin.kernels.unit import CFunction, Unit, in_part

SLOT = "typedef union { void *pointer; double number; int64_t whole; } slot;"
UPPER_HALVES = """#if defined(__AVX__) && (defined(__clang__) || __GNUC__ >= 12)
#define exp(x) (__builtin_ia32_vzeroupper(), exp(x))
#define hypot(x, y) (__builtin_ia32_vzeroupper(), hypot(x, y))
#endif"""
"""GCC calls these with the upper halves of vector registers in use, for which their SSE
instructions wait: without it Harpy's physics take 1.3 times as long. GCC 11 does not know that the
instruction changes registers.
"""
MEMBERS = {"real": "number", "integer": "whole", "bool": "whole"}
LETTERS = {"real": "r", "integer": "i", "bool": "b"}


def entry_code(
    kernel: Any,
    types: tuple[Type, ...],
    *,
    single: bool = False,
    debug: bool = False,
    traced: bool = True,
) -> str:
    """A whole file with the function that Python calls."""
    unit = Unit(single=single, debug=debug, lines=traced)
    function = translate(unit, kernel, types)
    slots = iter(range(1000))
    arguments = [
        code for _, kind in function.parameters for code in _unpack(unit, kind, function, slots)
    ]
    call = f"{function.name}({', '.join(arguments)})"
    kind = function.result
    lines: list[str]
    if isinstance(kind, Tuple):
        lines = [f"const {unit.result_type(kind)} result = {call};"]
        lines += [f"{_result(n, str(item))} result.v{n};" for n, item in enumerate(kind.items)]
        results = "(" + "".join(LETTERS[str(item)] for item in kind.items)
    elif isinstance(kind, Scalar):
        lines, results = [f"{_result(0, str(kind))} {call};"], LETTERS[str(kind)]
    elif isinstance(kind, Array):
        source = source_of(kernel.py_func)
        raise source.error(source.tree, "an array as result, which only another kernel can take")
    else:
        lines, results = [f"{call};", "(void)r;"], ""
    told = json.dumps({"results": results, "written": sorted(function.written)}).replace('"', '\\"')
    body = "\n".join(f"    {line}" for line in lines)
    entry = (
        f'const char *const signature = "{told}";\n\nvoid entry(const slot *a, slot '
        f"*r)\n{{\n{body}\n}}"
    )
    code = unit.code(apart=True)
    begin = [in_part("PARTS - 1"), *(['#line 1 "entry"'] if unit.lines else [])]
    entry = "\n".join([*begin, entry, "#endif"])
    return "\n\n".join([unit.header(), UPPER_HALVES, unit.types(), SLOT, code, entry]) + "\n"


def _result(n: int, kind: str) -> str:
    """The beginning of an assignment to a slot of the results."""
    return f"r[{n}].number = (double)" if kind == "real" else f"r[{n}].whole ="


def _unpack(unit: Unit, kind: Type, function: CFunction, slots: Any) -> list[str]:
    """Arguments in C from slots, for one argument of the kernel."""
    if isinstance(kind, Scalar):
        member = f"a[{next(slots)}].{MEMBERS[str(kind)]}"
        cast = f"({kind})" if unit.single else ""
        return [f"{member} != 0" if kind is BOOLEAN else f"{cast}{member}"]
    codes = [f"a[{next(slots)}].pointer"]
    if isinstance(kind, Array):
        for size in kind.shape:
            if isinstance(size, Code):
                slot = next(slots)
                if size.text in function.sizes:
                    codes.append(f"{'(integer)' if unit.single else ''}a[{slot}].whole")
    return codes
