"""Controllers and governors by name, as the command line and the comparison know them."""

from __future__ import annotations

from typing import Literal

from harpy_pin.control.governed import GovernedController, GovernedParameters
from harpy_pin.control.whole_body import WholeBodyController, WholeBodyParameters
from harpy_pin.errors import InputError
from harpy_pin.gait.base import Gait
from harpy_pin.governor.base import Governor
from harpy_pin.governor.contact import ContactForceGovernor, ContactGovernorParameters
from harpy_pin.governor.reduced.cone import ConeGovernor
from harpy_pin.governor.reduced.erg import ExplicitReferenceGovernor
from harpy_pin.governor.reduced.rows import READINGS, ForceRows
from harpy_pin.model.robot import Robot
from harpy_pin.model.thrust import CentreGains
from harpy_pin.wbc import WholeBodyLimits

__all__ = ["CONTROLLERS", "GOVERNORS", "REFERENCE_GOVERNORS", "make_controller", "make_governor"]

CONTROLLERS = ("governed", "wbc")
REFERENCE_GOVERNORS = ("none", "paper", "cone")
"""Governors of the body's reference, on the reduced-order model."""
GOVERNORS = (*REFERENCE_GOVERNORS, "contact")
"""All governors of the walk; ``contact`` holds the true contact force."""


def make_governor(
    name: str,
    robot: Robot,
    *,
    mu: float,
    reading: str = "measured",
    gains: CentreGains | None = None,
) -> Governor | None:
    """A governor of the 3D walk by name, with the paper's rates and least normal force.

    Args:
        name: one of :data:`REFERENCE_GOVERNORS`; ``none`` gives none.
        robot: its mass enters the model.
        mu: friction coefficient that the rows assume.
        reading: ``measured`` or ``tracked`` (equations.md R1, R2).
        gains: of the thruster law the governor is in front of.

    Raises:
        InputError: unknown name or reading, or a friction out of its domain.
    """
    if name not in REFERENCE_GOVERNORS:
        raise InputError.unknown("governor", name, REFERENCE_GOVERNORS)
    if reading not in READINGS:
        raise InputError.unknown("reading", reading, READINGS)
    if name == "none":
        return None
    if name == "cone":
        return ConeGovernor(mass=robot.mass, mu=mu, gains=gains)
    kind: Literal["measured", "tracked"] = "measured" if reading == "measured" else "tracked"
    return ExplicitReferenceGovernor(ForceRows(mass=robot.mass, mu=mu, gains=gains, reading=kind))


def make_controller(
    name: str,
    gait: Gait,
    *,
    mu: float,
    governor: str = "paper",
    reading: str = "measured",
    limits: bool = False,
    thrust: bool = True,
    period: float = 1e-3,
) -> GovernedController | WholeBodyController:
    """A walking controller by name, with its default settings.

    Args:
        name: one of :data:`CONTROLLERS`.
        gait: targets of body and feet; also gives the robot.
        mu: friction coefficient that the controller assumes.
        governor: of the governed controller, one of :data:`GOVERNORS`.
        reading: of that governor.
        limits: whether the governed controller clips its torques and thrusts to the hardware's limits; the whole-body
            controller always respects them.
        thrust: whether the governed controller has its thrusters; without them only the legs act.
        period: time between ticks, s.

    Raises:
        InputError: unknown name, or a friction out of its domain.
    """
    if name not in CONTROLLERS:
        raise InputError.unknown("controller", name, CONTROLLERS)
    if governor not in GOVERNORS:
        raise InputError.unknown("governor", governor, GOVERNORS)
    if name == "wbc":
        return WholeBodyController(gait, WholeBodyParameters(period=period, limits=WholeBodyLimits(mu=mu)))
    parameters = GovernedParameters(period=period, limit_torque=limits, limit_thrust=limits, thrust=thrust)
    if governor == "contact":
        force_governor = ContactForceGovernor(gait.robot, ContactGovernorParameters(mu=mu), period=parameters.period)
        return GovernedController(gait, None, parameters, force_governor=force_governor)
    chosen = make_governor(governor, gait.robot, mu=mu, reading=reading, gains=parameters.centre)
    return GovernedController(gait, chosen, parameters)
