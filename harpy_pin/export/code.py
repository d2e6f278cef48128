"""The C of a controller: header, source, and a header for C++, from the templates in ``files``."""

import math
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.export.exported_controllers import LAW, Exportable
from harpy_pin.export.mathematics import PORTABLE
from harpy_pin.kernels.functions import translate
from harpy_pin.kernels.types import REAL, Array, Struct
from harpy_pin.kernels.unit import Unit
from harpy_pin.model.record import Record

FEW = 2  # entries of an array that are assigned one by one; more are copied from the table
INPUTS = {
    "q": "configuration: position of the base, m, its quaternion (x, y, z, w), joint angles, rad",
    "v": "velocity: of the base, linear, m/s, and angular, rad/s, both in its own axes; of the "
    "joints, rad/s",
    "foot_position": "of each foot, world axes, m",
    "foot_force": "of the ground on each foot, world axes, N, as measured",
    "elapsed": "time since the last step, s; of a walk at most 0.05 count",
    "gyroscope": "rad/s, axes of the inertial unit",
    "accelerometer": "m/s^2, of what it feels: at rest it points up",
    "joint_position": "rad",
    "joint_velocity": "rad/s",
    "joint_torque": "of the motors since the last step, N m",
    "normal_force": "of foot sensors, N; NAN where there is none",
    "thrust": "of each thruster since the last step, world axes, N",
    "acceleration": "that the last command intends, as v, m/s^2 and rad/s^2 (condensed.root"
    ".acceleration in a condensed controller's state); NAN where there is none",
}
OUTPUTS = {
    "torque": "of the joints, N m",
    "thrust": "of each thruster, world axes, N",
    "joint_position": "q* of the motors' law torque + k_p (q* - q) + k_d (v* - v), rad",
    "joint_velocity": "v* of that law, rad/s",
    "joint_stiffness": "k_p of that law, N m/rad",
    "joint_damping": "k_d of that law, N m s/rad",
    "q": INPUTS["q"],
    "v": INPUTS["v"],
    "foot_position": INPUTS["foot_position"],
    "foot_velocity": "of each foot, world axes, m/s",
    "foot_force": "of the ground on each foot, world axes, N",
}


def shipped(file: str, **texts: object) -> str:
    """The text of a file in ``files``, with texts for the names that it has after a ``$``; other
    ``$`` stay.
    """
    text = (files("harpy_pin.export") / "files" / file).read_text(encoding="utf-8")
    return Template(text).safe_substitute(texts)


@dataclass(frozen=True)
class Code:
    """A controller in C."""

    name: str  # of its files, and the beginning of all its names
    header: str  # <name>.h
    source: str  # <name>.c
    cpp: str  # <name>.hpp
    real: str  # float or double
    ram: int  # size of the record, bytes


def controller_code(what: Exportable, name: str, *, single: bool) -> Code:
    """The C of a controller, whose files, functions and structs have a name that begins with this
    one.

    Numbers are floats and integers of 32 bits where it is ``single``, otherwise doubles and 64
    bits.
    """
    public = {f"{name}_init", f"{name}_step"}
    unit = Unit(single=single, prefix=f"{name}_", own=PORTABLE if single else {}, taken=public)
    state, target = Struct(what.record.dtype, "state"), Struct(what.target.dtype, "target")
    measured = (Array.packed(REAL, shape) for shape in what.inputs.values())
    step = translate(unit, what.step, (state, target, *measured))
    assert step.written <= {"r"}, "a tick changes what it was given"
    unit.struct(state), unit.struct(target)
    table, statements = initial_values(unit, what.record)
    real, whole = ("float", "int32_t") if single else ("double", "int64_t")
    structs = re.sub(
        r"^    integer ", f"    {whole} ", "\n\n".join(unit.types().split("\n\n")[1:]), flags=re.M
    )
    command = f"state->{what.control}." if what.control else "state->"
    given, made = lengths(what.inputs), lengths(what.outputs)

    def parameters(number: str) -> str:
        parts = [f"struct {name}_state *state", f"const struct {name}_target *target"]
        parts += [f"const {number} {own}[{n}]" for own, n in given.items()]
        return ", ".join([*parts, *(f"{number} {own}[{n}]" for own, n in made.items())])

    texts = {
        **{
            "name": name,
            "NAME": name.upper(),
            "type": "".join(part.capitalize() for part in name.split("_")),
        },
        **{
            "title": what.title,
            "robot": what.robot.name,
            "period": f"{1e3 * what.period:g}",
            "target": textwrap.fill(about_target(what), 100, subsequent_indent="       "),
            "real": real,
            "whole": whole,
            "step": step.name,
        },
        **{"code": unit.code(), "table": table, "statements": "\n    ".join(statements)},
        **{"inputs": _described(what.inputs, INPUTS), "outputs": _described(what.outputs, OUTPUTS)},
        "structs": re.sub(r"^    real ", f"    {real} ", structs, flags=re.M),
        "statuses": "\n".join(
            f"    {name.upper()}_{status} = {value}," for status, value in what.statuses.items()
        ),
        "arguments": ", ".join(f"(real *){own}" if own in given else "NULL" for own in what.inputs),
        "copies": "\n    ".join(_copy(own, n, command) for own, n in made.items()),
        "members": "\n".join(
            f"        std::array<{real}, {n}> {own}{{}};" for own, n in made.items()
        ),
        "arrays": "".join(f", const std::array<{real}, {n}> &{own}" for own, n in given.items()),
        "pointers": "".join(
            f", {own}.data()" for own in (*given, *(f"command.{own}" for own in made))
        ),
    }
    header = shipped("controller.h", **texts, parameters=parameters(real))
    source = shipped("controller.c", **texts, parameters=parameters("real"))
    ram = _entries(what.record.dtype) * (4 if single else 8)
    return Code(name, header, source, shipped("controller.hpp", **texts), real, ram)


def about_target(what: Exportable) -> str:
    """What the target of a tick is."""
    if "velocity" in (what.target.dtype.names or ()):
        return (
            "the velocity in the axes of the heading: forward and to the left, m/s, turning to the "
            "left, rad/s; and "
            "the change of the height, m; scaled down to what the robot can do, and ignored where "
            "it is not finite"
        )
    return "what the gait asks for at this time"


def _copy(own: str, count: int, command: str) -> str:
    """The statement that copies an output from the record."""
    if own in LAW:
        return (
            f"memcpy({own}, {command}motors.law + {LAW.index(own) * count}, {count} * "
            f"sizeof(real));"
        )
    return f"memcpy({own}, {command}{own}, sizeof {command}{own});"


def lengths(arrays: Mapping[str, tuple[int, ...]]) -> dict[str, int]:
    """How many numbers each array has that has any."""
    return {own: math.prod(shape) for own, shape in arrays.items() if math.prod(shape)}


def _described(arrays: Mapping[str, tuple[int, ...]], texts: Mapping[str, str]) -> str:
    """Lines of a comment on arrays."""
    lines = [f"{own} {arrays[own]}: {texts[own]}".replace(",)", ")") for own in lengths(arrays)]
    return "\n".join(
        textwrap.fill(line, 110, initial_indent="     ", subsequent_indent="       ")
        for line in lines
    )


def _entries(dtype: object) -> int:
    """How many numbers a record has; all are of one size in C."""
    fields = Struct(dtype).fields()  # type: ignore[arg-type]
    total = 0
    for kind in fields.values():
        element = kind.element if isinstance(kind, Array) else kind
        each = _entries(element.dtype) if isinstance(element, Struct) else 1
        total += each * (
            math.prod(n for n in kind.shape if isinstance(n, int)) if isinstance(kind, Array) else 1
        )
    return total


def initial_values(unit: Unit, record: Record) -> tuple[str, list[str]]:
    """The table in C, empty where nothing is copied, and the statements that fill a record which is
    zero, ``state``.
    """
    tables: dict[str, list[str]] = {"real": [], "integer": []}
    lengths = {"real": 0, "integer": 0}
    statements = []
    for place, values in _places(unit, record[0], "state->"):
        kind = "integer" if values.dtype.kind == "i" else "real"
        texts = [number_text(value, single=unit.single) for value in values.ravel()]
        if values.ndim == 0:
            statements.append(f"{place} = {texts[0]};")
        elif np.count_nonzero(values) <= FEW:
            statements += [f"{place}[{n}] = {texts[n]};" for n in np.flatnonzero(values.ravel())]
        else:
            lines = ",\n    ".join(", ".join(texts[n : n + 8]) for n in range(0, len(texts), 8))
            tables[kind].append(f"/* {place.removeprefix('state->')} */\n    {lines},")
            statements.append(f"copy_{kind}({place}, {kind}s + {lengths[kind]}, {len(texts)});")
            lengths[kind] += len(texts)
    parts = []
    for kind, rows in tables.items():
        if rows:
            parts.append(
                f"static const {kind} {kind}s[{lengths[kind]}] = {{\n    "
                + "\n    ".join(rows)
                + "\n};"
            )
            parts.append(
                f"static void copy_{kind}({kind} *to, const {kind} *from, int count)\n"
                "{\n    for (int n = 0; n < count; n++) {\n        to[n] = from[n];\n    }\n}"
            )
    return "\n\n".join(parts), statements


def number_text(value: Any, *, single: bool) -> str:
    """A number as a constant in C, with the digits that it needs."""
    if isinstance(value, np.integer | int):
        return str(int(value))
    if not np.isfinite(value):
        return (
            "(real)NAN" if np.isnan(value) else "(real)INFINITY" if value > 0 else "-(real)INFINITY"
        )
    if not single:
        return repr(float(value))
    text = str(np.float32(value))
    return (text if "." in text or "e" in text else f"{text}.0") + "f"


def _places(unit: Unit, element: Any, place: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Places in C and values of all fields that are not zero."""
    for name in element.dtype.names:
        value, own = element[name], place + unit.identifier(name)
        if value.dtype.names is not None:
            if value.ndim == 0:
                yield from _places(unit, value, f"{own}.")
            else:
                for n, one in enumerate(value.ravel()):
                    yield from _places(unit, one, f"{own}[{n}].")
        elif np.count_nonzero(value):
            yield own, np.asarray(value)
