"""Where a user's states and commands enter: as kernels need them, or refused by name.

A kernel looks at the sizes and numbers of what it is given itself, which costs it some nanoseconds,
before it writes anything, and returns a code. Only where that is not :data:`GOOD`, or where the
kernel takes no such argument, the functions below say what is wrong, or make float64 arrays of what
may be used all the same (lists, integers).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.model.terms import (
    BAD,
    GOOD,
    MAX_SAMPLE,
    MISFIT,
    all_finite,
    all_possible,
    all_possible_rows,
    is_unit,
)

__all__ = [
    "BAD",
    "FADE",
    "FLOAT64",
    "GOOD",
    "HOLD_TICKS",
    "MAX_SAMPLE",
    "MISFIT",
    "all_finite",
    "all_possible",
    "all_possible_rows",
    "as_array",
    "as_command",
    "as_state",
    "is_finite",
    "is_unit",
    "refuse_law",
]

FLOAT64 = np.dtype(np.float64)
HOLD_TICKS = 20  # bad samples in a row for which the last good answer is held as it is
FADE = 0.9  # factor on it for every further one: the robot goes limp over some tens of ticks
is_finite: Callable[[float], bool] = np.isfinite
"""In kernels whether a number is one: NumPy's, with a result that is said to be a truth value."""


def as_state(state: State, robot: Robot) -> State:
    """The state itself where its arrays are float64 and of the robot's sizes, otherwise a copy in
    which they are.
    """
    nq, nv, feet = robot.nq, robot.nv, (len(robot.feet), 3)
    shapes = {
        "q": (nq,),
        "v": (nv,),
        "foot_position": feet,
        "foot_velocity": feet,
        "foot_force": feet,
    }
    arrays, same = _arrays("state", state, shapes)
    if isinstance(getattr(state, "t", None), float) and same:
        return state
    try:
        t = float(state.t)
    except (AttributeError, TypeError, ValueError):
        raise InputError(
            "state.t must be a number", name="state.t", value=getattr(state, "t", None)
        ) from None
    return State(t, **arrays)


def refuse_law(command: Command) -> None:
    """Raise where a command has a motors' law, of whose torques what corrects torques would know
    nothing.
    """
    if getattr(command, "_law_", None) is not None:
        raise InputError(
            "a command with a motors' law is not taken here: give torques alone", name="command.law"
        )


def as_command(command: Command, robot: Robot) -> Command:
    """A command itself where its arrays are float64, of the robot's sizes and may be written,
    otherwise a copy.
    """
    shapes = {"torque": (len(robot.joints),), "thrust": (len(robot.thrusters), 3)}
    arrays, same = _arrays("command", command, shapes)
    law = getattr(command, "law", None)
    if law is not None:
        fit = as_array("command.law", law, (4, shapes["torque"][0]))
        same, law = same and fit is law, fit
    if same and isinstance(command, Command):
        return command
    made = Command(**arrays)
    made.law = law
    return made


def _arrays(
    kind: str, given: Any, shapes: dict[str, tuple[int, ...]]
) -> tuple[dict[str, Any], bool]:
    """The arrays of a state or command by name, and whether all of them are fit for kernels as they
    are.
    """
    arrays, same = {}, True
    for name, shape in shapes.items():
        if not hasattr(given, name):
            raise InputError(
                f"a {kind} must have '{name}', got {type(given).__name__}", name=kind, value=given
            )
        value = getattr(given, name)
        arrays[name] = as_array(f"{kind}.{name}", value, shape)
        same = same and arrays[name] is value
    return arrays, same


def as_array(name: str, value: Any, shape: tuple[int, ...]) -> Vector:
    """The array itself where kernels take it, otherwise a copy that they take."""
    if (
        type(value) is np.ndarray
        and value.dtype == FLOAT64
        and value.shape == shape
        and value.flags.carray
    ):
        return value
    return checks.array(name, value, shape)
