"""Controllers and governors by name, as the command line and the comparison know them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, overload

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.changes import changed
from harpy_pin.controllers.condensed import CondensedController
from harpy_pin.controllers.governed import GovernedController
from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.controllers.whole_body import WholeBodyController
from harpy_pin.deprecated import new_value, renamed_arguments
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait, check_gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.governor import Governor
from harpy_pin.governors.reduced.cone import ConeGovernor
from harpy_pin.governors.reduced.erg import ExplicitReferenceGovernor
from harpy_pin.governors.reduced.erg_parameters import PaperGovernorParameters
from harpy_pin.governors.reduced.rows import EVALUATE_AT, ForceRows
from harpy_pin.model.robot import Robot
from harpy_pin.model.thrust import CentreGains
from harpy_pin.wbc import WholeBodyLimits

__all__ = [
    "CONTROLLERS",
    "GOVERNORS",
    "REFERENCE_GOVERNORS",
    "make_controller",
    "make_governor",
    "make_governor_parameters",
    "make_parameters",
]

CONTROLLERS = ("governed", "wbc", "condensed")
"""The paper's controller with a governor, the whole-body QP, and the condensed controller."""
REFERENCE_GOVERNORS = ("none", "paper", "cone")
"""Governors of the body's reference, on the reduced-order model."""
GOVERNORS = (*REFERENCE_GOVERNORS, "filter")
"""All governors of the walk; ``contact`` holds the true contact force."""


@renamed_arguments(reading="evaluate_at")
@checked
def make_governor(
    name: str,
    robot: Robot,
    *,
    mu: float,
    evaluate_at: str = "measured",
    gains: CentreGains | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Governor | None:
    """A governor of the 3D walk by name, with the paper's rates and least normal force unless said otherwise.

    Args:
        name: one of :data:`REFERENCE_GOVERNORS`; ``none`` gives none.
        robot: its mass enters the model.
        mu: friction coefficient that the rows assume.
        evaluate_at: ``measured`` or ``tracked`` (equations.md R1, R2).
        gains: of the thruster law the governor is in front of.
        parameters: of the governor, see :func:`make_governor_parameters`.

    Raises:
        InputError: unknown name, evaluate_at or parameter, or a number out of its domain.
    """
    if name == "filter":
        raise InputError(
            "'filter' bends commands, not references: ask make_controller for it, or put a "
            "ContactForceFilter(robot, ContactForceFilterParameters(mu=mu)) behind any controller",
            name="governor",
            value=name,
        )
    checks.one_of("governor", name, REFERENCE_GOVERNORS)
    checks.one_of("evaluate_at", evaluate_at, EVALUATE_AT)
    settings = make_governor_parameters(name, mu=mu, changes=parameters)
    if name == "none":
        return None
    if name == "cone":
        return ConeGovernor(mass=robot.mass, mu=mu, gains=gains)
    assert isinstance(settings, PaperGovernorParameters)
    kind: Literal["measured", "tracked"] = "measured" if evaluate_at == "measured" else "tracked"
    rows = ForceRows(
        mass=robot.mass,
        mu=mu,
        friction_share=settings.friction_share,
        min_normal_force=settings.min_normal_force,
        gains=gains,
        evaluate_at=kind,
    )
    return ExplicitReferenceGovernor(
        rows,
        alpha_r=settings.alpha_r,
        alpha_t=settings.alpha_t,
        alpha_n=settings.alpha_n,
        conditions="algorithm" if settings.conditions == "algorithm" else "equation",
    )


@overload
@checked
def make_controller(
    name: Literal["governed"],
    gait: Gait,
    *,
    mu: float,
    governor: str | None = ...,
    evaluate_at: str = ...,
    limits: bool = ...,
    thrust: bool = ...,
    period: float = ...,
    parameters: Mapping[str, Any] | None = ...,
    governor_parameters: Mapping[str, Any] | None = ...,
) -> GovernedController: ...
@overload
@checked
def make_controller(
    name: Literal["wbc"], gait: Gait, *, mu: float, period: float = ..., parameters: Mapping[str, Any] | None = ...
) -> WholeBodyController: ...
@overload
@checked
def make_controller(
    name: Literal["condensed"],
    gait: Gait,
    *,
    mu: float,
    period: float = ...,
    parameters: Mapping[str, Any] | None = ...,
) -> CondensedController: ...
@overload
@checked
def make_controller(
    name: str,
    gait: Gait,
    *,
    mu: float,
    governor: str | None = ...,
    evaluate_at: str = ...,
    limits: bool = ...,
    thrust: bool = ...,
    period: float = ...,
    parameters: Mapping[str, Any] | None = ...,
    governor_parameters: Mapping[str, Any] | None = ...,
) -> GovernedController | WholeBodyController | CondensedController: ...
@checks.explained_arguments(
    friction="the friction coefficient that it assumes is mu, as in make_controller('condensed', gait, mu=0.6)",
    mu_s="the friction coefficient that it assumes is mu, as in make_controller('condensed', gait, mu=0.6)",
)
@renamed_arguments(reading="evaluate_at")
@checked
def make_controller(
    name: str,
    gait: Gait,
    *,
    mu: float,
    governor: str | None = None,
    evaluate_at: str = "measured",
    limits: bool = False,
    thrust: bool = True,
    period: float = 1e-3,
    parameters: Mapping[str, Any] | None = None,
    governor_parameters: Mapping[str, Any] | None = None,
) -> GovernedController | WholeBodyController | CondensedController:
    """A walking controller by name.

    Args:
        name: one of :data:`CONTROLLERS`.
        gait: targets of body and feet; also gives the robot.
        mu: friction coefficient that the controller assumes.
        governor: of the governed controller, one of :data:`GOVERNORS`, ``paper`` by default; the whole-body controller
            has none.
        evaluate_at: of that governor.
        limits: whether the governed controller clips its torques and thrusts to the hardware's limits; the whole-body
            controller always respects them.
        thrust: whether the governed controller has its thrusters; without them only the legs act.
        period: time between ticks, s.
        parameters: further settings that differ from their defaults, see :func:`make_parameters`.
        governor_parameters: of the governor, see :func:`make_governor_parameters`.

    Raises:
        InputError: unknown name, a setting out of its domain, or a governor for the whole-body controller.
    """
    name, governor = new_value("controller", name), new_value("governor", governor)
    if governor is not None:
        checks.one_of("governor", governor, GOVERNORS)
    checks.one_of("evaluate_at", evaluate_at, EVALUATE_AT)
    check_gait(gait)
    settings = make_parameters(name, mu=mu, limits=limits, thrust=thrust, period=period, changes=parameters)
    if isinstance(settings, WholeBodyParameters):
        if governor not in (None, "none"):
            raise InputError(
                f"the whole-body controllers take no governor, got '{governor}'; they hold the cones themselves, and "
                "ContactForceFilter.update(state, command) goes behind any controller",
                name="governor",
                value=governor,
            )
        if governor_parameters:
            message = "the whole-body controllers take no governor, so none of its parameters"
            raise InputError(message, name="governor_parameters", value=governor_parameters)
        return CondensedController(gait, settings) if name == "condensed" else WholeBodyController(gait, settings)
    if governor == "filter":
        of_filter = make_governor_parameters("filter", mu=mu, changes=governor_parameters)
        assert isinstance(of_filter, ContactForceFilterParameters)
        force_filter = ContactForceFilter(gait.robot, of_filter, period=settings.period)
        return GovernedController(gait, None, settings, force_filter=force_filter)
    chosen = make_governor(
        "paper" if governor is None else governor,
        gait.robot,
        mu=mu,
        evaluate_at=evaluate_at,
        gains=settings.centre,
        parameters=governor_parameters,
    )
    return GovernedController(gait, chosen, settings)


@checked
def make_governor_parameters(
    name: str, *, mu: float, changes: Mapping[str, Any] | None = None
) -> PaperGovernorParameters | ContactForceFilterParameters | None:
    """The parameters of a governor by name; None for ``none`` and ``cone``, which have none.

    Args:
        name: one of :data:`GOVERNORS`.
        mu: friction coefficient that it assumes.
        changes: values by the names of :class:`~harpy_pin.governors.PaperGovernorParameters` or
            :class:`~harpy_pin.governors.ContactForceFilterParameters`.

    Raises:
        InputError: unknown name, a value out of its domain, or the friction coefficient, which is an argument here.
    """
    checks.one_of("governor", name, GOVERNORS)
    changes = {} if changes is None else changes
    if name == "paper":
        return changed(PaperGovernorParameters(), changes)
    if name == "filter":
        return changed(ContactForceFilterParameters(mu=mu), changes, fixed=("mu",))
    if changes:
        raise InputError(f"the governor '{name}' has no parameters", name="governor_parameters", value=changes)
    return None


@checked
def make_parameters(
    name: str,
    *,
    mu: float,
    limits: bool = False,
    thrust: bool = True,
    period: float = 1e-3,
    changes: Mapping[str, Any] | None = None,
) -> GovernedParameters | WholeBodyParameters:
    """The parameters of a controller by name; for the arguments see :func:`make_controller`.

    Args:
        changes: values by the names of :class:`GovernedParameters` or :class:`WholeBodyParameters`, those of a record
            inside as a mapping again, such as ``{"solver": "daqp", "weights": {"swing": 0.5}}``.

    Raises:
        InputError: unknown name, a value out of its domain, or a change of what is an argument here.
    """
    name = new_value("controller", name)
    hint = f"it is make_controller('governed', ..., governor='{name}')" if name in GOVERNORS else ""
    checks.one_of("controller", name, CONTROLLERS, hint=hint)
    changes = {} if changes is None else changes
    if name != "governed":
        if not thrust:
            raise InputError("the whole-body controller always has its thrusters", name="thrust", value=thrust)
        whole_body = WholeBodyParameters(period=period, limits=WholeBodyLimits(mu=mu))
        return changed(whole_body, changes, fixed=("period", "limits.mu"))
    governed = GovernedParameters(period=period, limit_torque=limits, limit_thrust=limits, thrust=thrust)
    return changed(governed, changes, fixed=("period", "thrust"))
