"""Grounds by name: how stiff and how damped MuJoCo's contact is, relative to the scenario's ground."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.simulation.mujoco.soft_contact import CONTACTS

__all__ = ["DEFAULT_PRESET", "PRESETS", "Preset", "preset_ground"]


@dataclass(frozen=True, kw_only=True)
class Preset:
    """Factors on the stiffness and the damping of a ground."""

    stiffness: float
    damping: float


PRESETS = {
    "soft": Preset(stiffness=1.0, damping=1.0),
    "overdamped": Preset(stiffness=1.0, damping=2.0 * math.sqrt(2.0)),
    "stiff": Preset(stiffness=10.0, damping=math.sqrt(10.0)),
}
"""``soft``: the ground's own, by default 8 kN/m and 268 N·s/m. ``overdamped``: a damping ratio of 2 in the place of
0.71, 759 N·s/m. ``stiff``: ten times as stiff with the same damping ratio, 80 kN/m and 848 N·s/m."""
DEFAULT_PRESET = "soft"


@checked
def preset_ground(ground: Ground, name: str | None = None) -> Ground:
    """The ground with the stiffness and damping of a preset.

    Args:
        ground: that the factors apply to.
        name: one of :data:`PRESETS`, :data:`DEFAULT_PRESET` by default; one of
            :data:`harpy_pin.simulation.mujoco.CONTACTS`, whose stiffness is not the ground's, leaves it as it is.

    Raises:
        InputError: unknown name, or a friction cone that MuJoCo does not have.
    """
    name = DEFAULT_PRESET if name is None else name
    checks.one_of("plant preset", name, (*PRESETS, *CONTACTS))
    if ground.cone != "circular":
        raise InputError("MuJoCo's friction cone is circular, not per_axis", name="friction cone", value=ground.cone)
    if name in CONTACTS:
        return ground
    preset = PRESETS[name]
    assert ground.damping is not None
    strips = tuple((begin, end, preset.stiffness * value) for begin, end, value in ground.stiffness_strips)
    return replace(
        ground,
        stiffness=preset.stiffness * ground.stiffness,
        damping=preset.damping * ground.damping,
        stiffness_strips=strips,
    )
