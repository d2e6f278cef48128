"""What a file must hold to be the log of a robot over time. A file is never trusted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import RunFileError, shown

__all__ = ["FORMAT", "MAX_NUMBER", "MAX_STEP", "MAX_TIME", "check_metadata", "check_signals"]

FORMAT = 1
AXES = {
    "t": (),
    "q": (None,),
    "v": (None,),
    "foot_position": (None, 3),
    "foot_velocity": (None, 3),
    "foot_force": (None, 3),
    "torque": (None,),
    "thrust": (None, 3),
}
"""Signals of every log, and the axes of one row; None where the robot decides."""
LEAST = {"q": 7, "v": 6}
"""Numbers in a row, at least: those of the base."""
TEXT, NUMBER, MAPPING, LIST = (str,), (int, float), (dict,), (list,)
KINDS: dict[str, tuple[type, ...]] = {
    "ending": TEXT,
    "robot": TEXT,
    "controller": TEXT,
    "end_time": NUMBER,
    "control_period": NUMBER,
    "dt": NUMBER,
    "mass": NUMBER,
    "ground": MAPPING,
    "plant": MAPPING,
    "parameters": MAPPING,
    "versions": MAPPING,
    "scenario": MAPPING,
    "gravity": LIST,
    "feet": LIST,
    "thrusters": LIST,
    "pushes": LIST,
}
"""What readers of a log rely on, where it is there."""
MAX_TIME, MAX_STEP = 1e9, 10.0
"""Bounds of the times of a log and of the time between its rows, s; no simulation comes near."""
MAX_NUMBER = 1e300
"""Bound of the other numbers: JSON has whole numbers that no float can hold."""


def check_signals(source: Path, signals: Mapping[str, NDArray[Any]]) -> None:
    """Refuse what is not the log of a robot over time."""
    missing = [name for name in AXES if name not in signals]
    if missing:
        raise RunFileError(f"'{source}' is not a run log: no {', '.join(missing)}", path=source)
    if any(array.ndim == 0 for array in signals.values()) or len({len(array) for array in signals.values()}) != 1:
        raise RunFileError(f"'{source}' is damaged: its signals differ in length", path=source)
    for name, axes in AXES.items():
        shape, dtype = signals[name].shape[1:], signals[name].dtype
        fits = len(shape) == len(axes) and all(n in (None, m) for n, m in zip(axes, shape, strict=True))
        if not fits or (name in LEAST and shape[0] < LEAST[name]):
            raise RunFileError(f"'{source}' is not a run log: {name} has shape {signals[name].shape}", path=source)
        if dtype != np.float64:
            raise RunFileError(f"'{source}' is not a run log: {name} holds {dtype}, not float64", path=source)
    if len({signals[name].shape[1] for name in AXES if name.startswith("foot")}) != 1:
        raise RunFileError(f"'{source}' is damaged: its signals differ in the number of feet", path=source)
    time = signals["t"]
    if not np.all(np.abs(time) < MAX_TIME):
        raise RunFileError(f"'{source}' is damaged: its times are not finite or beyond {MAX_TIME:g} s", path=source)
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) else 1.0
    if not 0.0 < step <= MAX_STEP or np.any(np.abs(steps - step) > 0.5 * step):
        raise RunFileError(f"'{source}' is damaged: its times do not go on evenly", path=source)


def check_metadata(source: Path, metadata: Any, signals: Mapping[str, object]) -> None:
    """Refuse metadata of another format or of odd types."""
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise RunFileError(f"'{source}' has a format this version cannot read (expected {FORMAT})", path=source)
    if metadata.pop("signals", sorted(signals)) != sorted(signals):
        raise RunFileError(f"'{source}' is damaged: it does not hold the signals it lists", path=source)
    for name, kinds in KINDS.items():
        value = metadata.get(name, kinds[0]())
        good = type(value) in kinds
        if good and kinds == NUMBER:
            good = abs(value) < MAX_NUMBER
        if good and name in ("feet", "thrusters"):
            good = all(type(entry) is str for entry in value)
        if not good:
            raise RunFileError(f"'{source}' is not a run log: {name} is {shown(value)}", path=source)
