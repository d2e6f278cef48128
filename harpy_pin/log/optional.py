"""Signals and settings that a log may have: readers get them as they should be, or an error that
names them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import MAX_STEP, MAX_TIME

SHAPES: dict[str, tuple[int | str, ...]] = {
    "x_r": (3,),
    "slip_path": ("foot_force",),
    "slip_net": ("foot_force",),
    "applied_thrust": ("thrust", 3),
    "motor_torque": ("torque",),
    "motor_law": (4, "torque"),
    "desired_force": ("foot_force", 3),
    "qp_status": (),
    "qp_fallbacks": (),
    "bad_samples": (),
    "battery_energy": (7,),
}
"""Shapes of one row, with as many rows in a tick as the signal named has; of the reference x_r, the
least.
"""
MAX_COUNT = 1e15


def optional_signal(run: Run, name: str) -> NDArray[Any] | None:
    """A signal of :data:`SHAPES`; none where the run has none of that name."""
    if name not in run:
        return None
    signal = run[name]
    desired = tuple(run[size].shape[1] if isinstance(size, str) else size for size in SHAPES[name])
    found = signal.shape[1:]
    if name == "x_r" and len(found) == 1 and found[0] > 3:
        desired = found
    if found != desired or (desired and signal.dtype.kind != "f"):
        raise InputError(
            f"the signal {name} of the run must have rows of {desired} floats, got {found} "
            f"of {signal.dtype}",
            name="run",
            value=name,
        )
    return signal


def given_thrust(run: Run) -> NDArray[Any]:
    """(n, thrusters, 3) The thrusts that there were, N: of thrusters that lag, not those
    commanded.
    """
    given = optional_signal(run, "applied_thrust")
    return run["thrust"] if given is None else given


def given_torque(run: Run) -> NDArray[Any]:
    """(n, joints) The torques at the end of each tick, N·m: of motors with a law of their own, not
    those commanded.
    """
    given = optional_signal(run, "motor_torque")
    return run["torque"] if given is None else np.concatenate((given[1:], given[-1:]))


def has_target(run: Run) -> bool:
    """Whether the log holds a place x_r where the body should be; a walking gait's x_r is the
    measured body itself.
    """
    place: Any = run.metadata
    for name in ("parameters", "gait", "gait"):
        place = place.get(name) if isinstance(place, Mapping) else None
    return "x_r" in run and place != "walking"


def last_count(run: Run, name: str) -> int:
    """What a signal that counts has come to; zero where the run has none of that name."""
    signal = optional_signal(run, name)
    return (
        0
        if signal is None
        else int(checks.number(f"the run's last {name}", signal[-1], low=0.0, high=MAX_COUNT))
    )


def tick_times(run: Run) -> NDArray[np.float64] | None:
    """(n,) time of each tick of the controller, µs; None where the log has none."""
    times = run.signals.get("tick_ns")
    if times is None or times.ndim != 1 or times.dtype.kind not in "biuf" or not np.any(times > 0):
        return None
    return np.asarray(1e-3 * times.astype(np.float64))


def control_period(run: Run) -> float:
    """Time between ticks, s; 1 ms where the log does not say."""
    period = run.metadata.get("control_period", 1e-3)
    return checks.number("the run's control_period", period, low=0.0, high=MAX_STEP, strict=True)


def step_duration(run: Run) -> float:
    """Time of a step of the gait, s; 0.75 s where the log does not say."""
    place: Any = run.metadata
    for name in ("parameters", "gait"):
        place = checks.mapping(f"the run's {name}", place.get(name, {}))
    value = place.get("step_duration", 0.75)
    return checks.number("the run's step_duration", value, low=0.0, high=MAX_TIME, strict=True)
