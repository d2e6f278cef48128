"""Levels of the factors, for tables."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["FACTOR_TEXTS", "level_key", "level_text"]


def _number(pattern: str, factor: float = 1.0) -> Callable[[str], str]:
    """Writes a level, multiplied by a factor, into a pattern."""
    return lambda key: pattern.format(factor * float(key))


def _unless_zero(zero: str, pattern: str) -> Callable[[str], str]:
    """The same, with a text of its own for zero."""
    return lambda key: zero if key == "0" else pattern.format(float(key))


FACTOR_TEXTS: dict[str, tuple[str, Callable[[str], str]]] = {
    "friction": ("friction of the ground", _number("μ {:g}")),
    "push": ("lateral push", _number("push {:g} N·s")),
    "mass_error": ("error of the body's mass", _number("mass {:+.0f} %", 100.0)),
    "friction_error": ("error of the assumed friction", _number("μ error {:+.0f} %", 100.0)),
    "noise": ("measurement noise", _number("noise × {:g}")),
    "delay": ("delay of the measurements", _number("delay {:g} ms", 1e3)),
    "stiffness": ("stiffness of the ground", _number("ground {:g} kN/m", 1e-3)),
    "damping": ("damping of the ground", _number("damping × {:g}")),
    "plant": ("engine", lambda key: key.replace("mujoco", "MuJoCo") if "mujoco" in key else f"{key} engine"),
    "speed": ("speed", _number("speed {:g} m/s")),
    "ice": ("strip of ice", lambda key: "no ice" if key == "0" else f"ice, μ {key}"),
    "joint_damping": ("damping of the joints", _number("joint damping {:g}")),
    "torque_share": ("torque limits of the motors", _unless_zero("torque unclipped", "torque × {:g}")),
    "bandwidth": ("bandwidth of the motors", _unless_zero("motors without lag", "motors {:g} Hz")),
}
"""What a factor is called, and how one of its levels is written, from its key in the summary."""


def level_key(level: float | str) -> str:
    """A level as a key of the summary."""
    return level if isinstance(level, str) else f"{level:g}"


def level_text(factor: str, key: str) -> str:
    """A level, from its key, with a word for its factor: ``push 2 N·s``."""
    return FACTOR_TEXTS[factor][1](key)
