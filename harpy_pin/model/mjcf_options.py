"""What the options of a MuJoCo model disable, and what is then without effect."""

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_GROUP = 30  # last group of actuators that the option can disable
SWITCHED = {
    "equality": ("eq_active0",),
    "frictionloss": ("dof_frictionloss", "tendon_frictionloss"),
    "limit": ("jnt_limited", "tendon_limited"),
    "contact": ("geom_margin", "pair_margin"),
    "spring": ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly"),
    "damper": (
        *("dof_damping", "dof_dampingpoly", "actuator_damping", "actuator_dampingpoly"),
        *("tendon_damping", "tendon_dampingpoly"),
    ),
    "gravity": ("body_gravcomp",),
    "clampctrl": ("actuator_ctrllimited",),
    "sensor": ("sensor_type",),
}
"""Arrays without effect where a ``<flag>`` of the option disables them."""
CONSTRAINTS = {"equality", "frictionloss", "limit", "contact"}
"""Flags that ``constraint`` disables together."""


def disabled(model: Any) -> set[str]:
    """Flags of the option that are disabled, such as ``gravity``; with those that they disable in
    turn.
    """
    from mujoco import mjtDisableBit

    bits = mjtDisableBit.__members__.items()
    off = {
        name.removeprefix("mjDSBL_").lower()
        for name, bit in bits
        if model.opt.disableflags & int(bit)
    }
    return off | CONSTRAINTS if "constraint" in off else off


def in_effect(model: Any) -> Any:
    """A copy of a model in which what its options disable is zero; for actuators see
    :func:`enabled_actuators`.

    Without springs and dampers MuJoCo has no passive forces at all, so neither air nor compensated
    weights.
    """
    off, model = disabled(model), copy.copy(model)
    for name in (array for flag in off for array in SWITCHED.get(flag, ())):
        getattr(model, name)[:] = 0
    if "gravity" in off:
        model.opt.gravity[:] = 0.0
    if {"spring", "damper"} <= off:
        model.body_gravcomp[:] = model.opt.density = model.opt.viscosity = 0.0
    return model


def enabled_actuators(model: Any) -> NDArray[np.bool_]:
    """(actuators,) whether they act. The armature and damping of one that does not still count."""
    off = [
        1 << group & model.opt.disableactuator if 0 <= group <= MAX_GROUP else 0
        for group in model.actuator_group
    ]
    return ~np.array(off, bool) & ("actuation" not in disabled(model))
