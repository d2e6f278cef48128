"""Hostile values, run files, URDFs and command lines, drawn from a seed; and what an answer to them
may be.
"""

import copy
import io
import json
import math
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import harpy_pin as hp

VALUES: tuple[Any, ...] = (
    *(
        None,
        True,
        False,
        0,
        1,
        -1,
        2,
        7,
        1.5,
        -0.0,
        1e-300,
        5e-324,
        1e300,
        1e308,
        -1e308,
        10**19,
        10**400,
        -(10**400),
    ),
    *(math.nan, math.inf, -math.inf),
    *("", "x", "nan", "0.3", "harpy", "go2", "[bold]", "<b>", "\x00", "\ud800", "a" * 5000),
    *([], [1], [None], [1, 2, 3], [[1, 2, 3]], [[0, 0, 0, 0]], ["x"], [[]], [{}], [{"time": 0}]),
    *([10**400, 0, 0], [1e300] * 6, [math.nan] * 3),
    *(
        {},
        {"name": None},
        {"name": "wbc"},
        {"name": [1]},
        {"x": 1},
        {"gait": 5},
        {"step_duration": 0},
    ),
)
"""What JSON can hold, and what no setting is."""
OPTIONAL = (
    *(
        "x_r",
        "x_w",
        "tick_ns",
        "slip_path",
        "slip_net",
        "qp_status",
        "bad_samples",
        "infeasible",
        "foot_friction",
    ),
    *(
        "desired_force",
        "demanded_force",
        "friction_estimate",
        "condensed_status",
        "velocity_command",
    ),
)
"""Signals that a log may have, which readers look for."""
NAMED = (
    *(
        "ending",
        "robot",
        "controller",
        "end_time",
        "control_period",
        "dt",
        "mass",
        "ground",
        "plant",
        "parameters",
    ),
    *(
        "versions",
        "scenario",
        "gravity",
        "feet",
        "thrusters",
        "pushes",
        "own",
        "format",
        "signals",
        "gait",
    ),
    *(
        "step_duration",
        "governor",
        "speed",
        "mu_s",
        "cone",
        "friction_strips",
        "control",
        "min_normal_force",
        "urdf",
    ),
    *(
        "name",
        "duration",
        "period",
        "disturbances",
        "noise",
        "seed",
        "delay",
        "reading",
        "patches",
        "limits",
    ),
)
"""Entries of metadata that something reads."""


def choose(rng: np.random.Generator, options: Any) -> Any:
    """One of several."""
    return options[int(rng.integers(len(options)))]


def outcome(
    function: Callable[..., Any], *arguments: Any, **given: Any
) -> tuple[Any, hp.HarpyError | None]:
    """What a call returns, or the error of ours that it ends with; any other error passes.

    The message has to be one line that is not too long.
    """
    try:
        return function(*arguments, **given), None
    except hp.HarpyError as error:
        message = str(error)
        assert message
        assert "\n" not in message, message
        assert len(message) < 700, message
        return None, error


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of everything in nested mappings and lists."""
    items = (
        data.items()
        if isinstance(data, dict)
        else enumerate(data)
        if isinstance(data, list)
        else ()
    )
    found = [path] if path else []
    for key, value in items:
        found += places(value, (*path, key))
    return found


def spoil_mapping(
    rng: np.random.Generator, data: dict[str, Any], changes: int = 2
) -> dict[str, Any]:
    """A copy with some entries replaced, removed or added."""
    data = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, changes + 1))):
        path = choose(rng, places(data) or [("x",)])
        owner: Any = data
        for key in path[:-1]:
            owner = owner[key]
        kind = rng.integers(6)
        value = copy.deepcopy(choose(rng, VALUES))
        if kind == 0:
            del owner[path[-1]]
        elif kind == 1 and isinstance(owner, dict):
            owner[choose(rng, NAMED)] = value
        elif kind == 2 and isinstance(owner[path[-1]], list):
            owner[path[-1]].append(value)
        else:
            owner[path[-1]] = value
    return data


def spoil_signals(
    rng: np.random.Generator, signals: dict[str, Any], changes: int = 2
) -> dict[str, Any]:
    """A copy with some signals reshaped, of another type, with odd numbers, missing or new."""
    signals = dict(signals)
    rows = len(signals["t"])
    for _ in range(int(rng.integers(1, changes + 1))):
        name = choose(rng, (*signals, *OPTIONAL, *OPTIONAL))
        kind = rng.integers(10)
        if name not in signals or kind == 0:
            shape = (rows, *rng.integers(0, 5, rng.integers(0, 4)).tolist())
            signals[name] = rng.standard_normal(shape)
        elif kind == 1:
            del signals[name]
        elif kind == 2:
            signals[name] = signals[name][..., None]
        elif kind == 3 and signals[name].ndim > 1:
            signals[name] = signals[name][:, : rng.integers(signals[name].shape[1] + 1)]
        elif kind == 4 and signals[name].ndim > 1 and signals[name].shape[1]:
            signals[name] = signals[name][:, 0]
        elif kind == 5:
            signals[name] = np.nan_to_num(signals[name]).astype(
                choose(rng, ("?", "i1", "u1", "i8", "u8", "f2", "f4"))
            )
        elif kind == 6:
            keep = int(rng.integers(0, 4))
            signals = {key: array[:keep] for key, array in signals.items()}
            rows = min(rows, keep)
        else:
            signals[name] = odd_numbers(rng, signals[name])
        if not signals:
            break
    return signals


def odd_numbers(rng: np.random.Generator, array: Any) -> Any:
    """A copy with one number, one row or all numbers replaced."""
    array = np.array(array)
    if array.dtype.kind not in "fiu" or array.size == 0:
        return array
    if array.dtype.kind == "f":
        value = choose(rng, (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e200, 1e-320, -1.0, 0.0, 9e8))
    else:
        value = choose(rng, (0, np.iinfo(array.dtype).min, np.iinfo(array.dtype).max))
    part = rng.integers(3)
    if part == 0:
        array.reshape(-1)[rng.integers(array.size)] = value
    elif part == 1:
        array[rng.integers(len(array))] = value
    else:
        array[...] = value
    return array


def write_log(path: Path, signals: dict[str, Any], metadata: Any) -> Path:
    """A file in the form of a log, with whatever signals and metadata."""
    text = np.array(json.dumps(metadata))
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in {"__metadata__": text, **signals}.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=False)
            archive.writestr(f"{name}.npy", buffer.getvalue())
    return path


NUMBERS = (
    *(
        "0",
        "-1",
        "nan",
        "inf",
        "-inf",
        "1e308",
        "1e-320",
        "1e6",
        "1e7",
        "-1e6",
        "1e400",
        "",
        "x",
        "0x10",
        "1,5",
        "1e",
    ),
    *(
        "1 2",
        "0 0 0",
        "1 0 0 0",
        "1e300 0 0",
        "nan nan nan",
        "1e-200 0 0",
        "1e-9",
        "3.2",
        "\u0663",
        "9" * 400,
        "1_0",
    ),
)
TAGS = (
    "link",
    "joint",
    "inertial",
    "mass",
    "inertia",
    "origin",
    "axis",
    "limit",
    "parent",
    "child",
    "visual",
    "mimic",
)


def spoil_urdf(rng: np.random.Generator, text: str, changes: int = 2) -> bytes:
    """The text with attributes, elements or bytes changed."""
    for _ in range(int(rng.integers(1, changes + 1))):
        kind = rng.integers(9)
        attributes = list(re.finditer(r'([\w:]+)="([^"]*)"', text))
        elements = list(re.finditer(r"<(\w+)[^<>]*/>", text))
        if kind < 4 and attributes:
            hit = choose(rng, attributes)
            value = choose(rng, NUMBERS) if kind < 3 else choose(rng, attributes)[2]
            text = f"{text[: hit.start(2)]}{value}{text[hit.end(2) :]}"
        elif kind == 4 and attributes:
            hit = choose(rng, attributes)
            text = text[: hit.start()] + text[hit.end() :]
        elif kind == 5 and elements:
            hit = choose(rng, elements)
            text = text[: hit.start()] + text[hit.end() :]
        elif kind == 6 and elements:
            hit, other = choose(rng, elements), choose(rng, elements)
            text = text[: hit.start()] + other[0] + text[hit.start() :]
        elif kind == 7:
            tag, other = choose(rng, TAGS), choose(rng, TAGS)
            text = text.replace(f"<{tag}", f"<{other}", 1).replace(f"</{tag}>", f"</{other}>", 1)
        else:
            data = bytearray(text.encode(errors="replace"))
            for _ in range(int(rng.integers(1, 4))):
                data[rng.integers(len(data))] = rng.integers(256)
            if rng.integers(4) == 0:
                del data[rng.integers(len(data)) :]
            return bytes(data)
    return text.encode(errors="replace")
