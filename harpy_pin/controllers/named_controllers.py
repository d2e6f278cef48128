"""Controllers and governors by name, as the command line and the comparison know them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, is_dataclass, replace
from typing import Any, Literal, TypeVar, overload

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.condensed import CondensedController
from harpy_pin.controllers.governed import GovernedController
from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.controllers.whole_body import WholeBodyController
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait, check_gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.contact_force_kernels import ContactForceFilterParameters
from harpy_pin.governors.erg import ExplicitReferenceGovernor, PaperGovernorParameters
from harpy_pin.governors.governor import Governor
from harpy_pin.governors.rows import ForceRows
from harpy_pin.governors.thrust import CentreGains
from harpy_pin.model.robot import Robot
from harpy_pin.wbc import WholeBodyLimits

Parameters = TypeVar("Parameters")

CONTROLLERS = ("governed", "wbc", "condensed")
"""The paper's controller with a governor, the whole-body QP (by ProxQP by default), and the condensed controller."""
GOVERNORS = ("none", "paper", "filter")
"""Governors of the walk: ``paper`` changes the body's reference; ``filter``, the contact-force filter, the command."""


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
        name: ``paper``, or ``none``, which gives none.
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
    settings = make_governor_parameters(name, mu=mu, changes=parameters)
    if not isinstance(settings, PaperGovernorParameters):
        return None
    of_governor = asdict(settings)
    of_rows = {key: of_governor.pop(key) for key in ("friction_share", "min_normal_force")}
    rows = ForceRows(mass=robot.mass, mu=mu, gains=gains, evaluate_at=evaluate_at, **of_rows)
    return ExplicitReferenceGovernor(rows, **of_governor)


@overload
def make_controller(name: Literal["governed"], gait: Gait, *, mu: float, **settings: Any) -> GovernedController: ...
@overload
def make_controller(name: Literal["wbc"], gait: Gait, *, mu: float, **settings: Any) -> WholeBodyController: ...
@overload
def make_controller(name: Literal["condensed"], gait: Gait, *, mu: float, **settings: Any) -> CondensedController: ...
@overload
def make_controller(
    name: str, gait: Gait, *, mu: float, **settings: Any
) -> GovernedController | WholeBodyController | CondensedController: ...
@checked
def make_controller(
    name: str, gait: Gait, *, mu: float, governor: str | None = None, period: float = 1e-3, **settings: Any
) -> GovernedController | WholeBodyController | CondensedController:
    """A walking controller by name.

    Args:
        name: one of :data:`CONTROLLERS`.
        gait: targets of body and feet; also gives the robot.
        mu: friction coefficient that the controller assumes.
        governor: of the governed controller, one of :data:`GOVERNORS`, ``paper`` by default; the whole-body controllers
            have none.
        period: time between ticks, s.
        settings: others that differ from their defaults, or from the gait's ``controller_parameters``
            (:class:`~harpy_pin.gaits.gait.Gait`), by the names of :class:`WholeBodyParameters`, or for the governed
            controller those of :class:`GovernedParameters`, ``evaluate_at`` and ``governor_parameters`` (see
            :func:`make_governor`); those of a record inside as a mapping, such as ``weights={"swing": 0.5}``.

    Raises:
        InputError: unknown name, a setting out of its domain, or a governor for a whole-body controller.
    """
    if governor is not None:
        checks.one_of("governor", governor, GOVERNORS)
    check_gait(gait)
    of_governor = {key: settings.pop(key) for key in ("evaluate_at", "governor_parameters") if key in settings}
    if name != "governed":
        fits: Mapping[str, Any] = getattr(gait, "controller_parameters", {})
        own = {key: {**fits[key], **settings[key]} for key in settings if isinstance(fits.get(key), Mapping)}
        settings = {**fits, **settings, **own}
    parameters = make_parameters(name, mu=mu, period=period, changes=settings)
    if isinstance(parameters, WholeBodyParameters):
        if governor not in (None, "none") or of_governor:
            raise InputError(
                f"the whole-body controllers take no governor, got {governor or ', '.join(of_governor)}; they hold the "
                "cones themselves, and ContactForceFilter.update(state, command) goes behind any controller",
                name="governor",
                value=governor,
            )
        return CondensedController(gait, parameters) if name == "condensed" else WholeBodyController(gait, parameters)
    governor, changes = governor or "paper", of_governor.pop("governor_parameters", None)
    if governor == "filter":
        of_filter = make_governor_parameters("filter", mu=mu, changes=changes)
        assert isinstance(of_filter, ContactForceFilterParameters)
        force_filter = ContactForceFilter(gait.robot, of_filter, period=period)
        return GovernedController(gait, None, parameters, force_filter=force_filter)
    chosen = make_governor(governor, gait.robot, mu=mu, gains=parameters.centre, parameters=changes, **of_governor)
    return GovernedController(gait, chosen, parameters)


@checked
def make_governor_parameters(
    name: str, *, mu: float, changes: Mapping[str, Any] | None = None
) -> PaperGovernorParameters | ContactForceFilterParameters | None:
    """The parameters of a governor by name; None for ``none``, which has none.

    Args:
        name: one of :data:`GOVERNORS`.
        mu: friction coefficient that it assumes.
        changes: values by the names of :class:`~harpy_pin.governors.PaperGovernorParameters` or
            :class:`~harpy_pin.governors.ContactForceFilterParameters`.

    Raises:
        InputError: unknown name, a value out of its domain, or the friction coefficient, which is an argument here.
    """
    checks.one_of("governor", name, GOVERNORS)
    if name == "paper":
        return _changed(PaperGovernorParameters(), changes)
    if name == "filter":
        return _changed(ContactForceFilterParameters(mu=mu), changes, fixed=("mu",))
    if changes:
        raise InputError(f"the governor '{name}' has no parameters", name="governor_parameters", value=changes)
    return None


@checked
def make_parameters(
    name: str, *, mu: float, period: float = 1e-3, changes: Mapping[str, Any] | None = None
) -> GovernedParameters | WholeBodyParameters:
    """The parameters of a controller by name.

    Args:
        name: one of :data:`CONTROLLERS`.
        mu: friction coefficient that the controller assumes.
        period: time between ticks, s.
        changes: values by the names of :class:`GovernedParameters` or :class:`WholeBodyParameters`, those of a record
            inside as a mapping again, such as ``{"solver": "daqp", "weights": {"swing": 0.5}}``.

    Raises:
        InputError: unknown name, a value out of its domain, or a change of what is an argument here.
    """
    hint = f"it is make_controller('governed', ..., governor='{name}')" if name in GOVERNORS else ""
    checks.one_of("controller", name, CONTROLLERS, hint=hint)
    if name == "governed":
        return _changed(GovernedParameters(period=period), changes, fixed=("period",))
    whole_body = WholeBodyParameters(period=period, limits=WholeBodyLimits(mu=mu))
    return _changed(whole_body, changes, fixed=("period", "limits.mu"))


def _changed(
    parameters: Parameters, changes: Mapping[str, Any] | None, *, fixed: Collection[str] = (), inside: str = ""
) -> Parameters:
    """A copy of a frozen dataclass with other values, checked as when it is made.

    Args:
        parameters: may hold further dataclasses.
        changes: values by name; those of a dataclass inside as a mapping. Lists become tuples.
        fixed: names that may not change; those of a dataclass inside after its name and a dot.
        inside: name of the dataclass and a dot, for messages; empty at the top.
    """
    changes = {} if changes is None else changes
    if not isinstance(changes, Mapping):
        raise InputError(f"parameters {inside[:-1] or 'of the controller'} must be a mapping, got {shown(changes)}")
    valid = [entry.name for entry in fields(parameters)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in changes.items():
        checks.one_of("parameter", name, valid)
        if inside + name in fixed:
            raise InputError(f"parameter '{inside}{name}' has an argument of its own", name=name, value=value)
        default = getattr(parameters, name)
        if is_dataclass(default):
            value = _changed(default, value, fixed=fixed, inside=f"{inside}{name}.")
        elif isinstance(default, bool) and not isinstance(value, bool):
            raise InputError(f"{inside}{name} must be true or false, got {shown(value)}", name=name, value=value)
        values[name] = tuple(value) if isinstance(value, list) else value
    return replace(parameters, **values)  # type: ignore[type-var]
