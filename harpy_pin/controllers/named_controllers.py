"""Controllers and governors by name, as the command line and the comparison know them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Literal, overload

from harpy_pin import checks, controllers, governors
from harpy_pin.arguments import checked
from harpy_pin.controllers.parameters import (
    JOINT_TARGETS,
    MAX_FORCE,
    GovernedParameters,
    WholeBodyParameters,
    changed,
)
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY
from harpy_pin.simulation import mujoco
from harpy_pin.wbc import WholeBodyWeights

CONTROLLERS = ("governed", "wbc", "condensed")
"""The paper's controller with a governor, the whole-body QP (by ProxQP by default), and the
condensed controller.
"""
GOVERNORS = ("none", "paper", "filter")
"""Governors of the walk: ``paper`` changes the body's reference; ``filter``, the contact-force
filter, the command.
"""


@checked
def make_governor(
    name: str,
    robot: Robot,
    *,
    mu: float,
    evaluate_at: str = "measured",
    gains: governors.CentreGains | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> governors.Governor | None:
    """A governor of the 3D walk by name, with the paper's rates and least normal force unless said
    otherwise.

    Args:
        name: ``paper``, or ``none``, which gives none.
        robot: its mass enters the model.
        mu: friction coefficient that the rows assume.
        evaluate_at: ``measured`` or ``tracked`` (equations.md R1, R2).
        gains: of the thruster law the governor is in front of.
        parameters: of the governor, see :func:`make_governor_parameters`.

    Raises:
        InputError: unknown name, evaluate_at or parameter, a number out of its domain, or a robot
            that weighs less than the paper's least normal force where no other is given.
    """
    if name == "filter":
        raise InputError(
            "'filter' bends commands, not references: ask make_controller for it, or put a "
            "ContactForceFilter(robot, ContactForceFilterParameters(mu=mu)) behind any controller",
            name="governor",
            value=name,
        )
    settings = make_governor_parameters(name, mu=mu, changes=parameters)
    if not isinstance(settings, governors.PaperGovernorParameters):
        return None
    if (
        "min_normal_force" not in (parameters or {})
        and settings.min_normal_force >= GRAVITY * robot.mass
    ):
        message = (
            f"the paper's least normal force, {settings.min_normal_force:g} N, is more than "
            f"'{robot.name}' weighs"
        )
        raise InputError(
            f"{message}: give one by parameters={{'min_normal_force': ...}}",
            name="robot",
            value=robot,
        )
    of_governor = asdict(settings)
    of_rows = {key: of_governor.pop(key) for key in ("friction_share", "min_normal_force")}
    rows = governors.ForceRows(
        mass=robot.mass, mu=mu, gains=gains, evaluate_at=evaluate_at, **of_rows
    )
    return governors.ExplicitReferenceGovernor(rows, **of_governor)


@overload
def make_controller(
    name: Literal["governed"], gait: Gait, *, mu: float, **settings: Any
) -> controllers.GovernedController: ...
@overload
def make_controller(
    name: Literal["wbc"], gait: Gait, *, mu: float, **settings: Any
) -> controllers.WholeBodyController: ...
@overload
def make_controller(
    name: Literal["condensed"], gait: Gait, *, mu: float, **settings: Any
) -> controllers.CondensedController: ...
@overload
def make_controller(
    name: str, gait: Gait, *, mu: float, **settings: Any
) -> (
    controllers.GovernedController
    | controllers.WholeBodyController
    | controllers.CondensedController
): ...
@checked
def make_controller(
    name: str,
    gait: Gait,
    *,
    mu: float,
    governor: str | None = None,
    period: float | None = None,
    bridge: mujoco.MujocoBridge | None = None,
    **settings: Any,
) -> (
    controllers.GovernedController
    | controllers.WholeBodyController
    | controllers.CondensedController
):
    """A walking controller by name.

    Args:
        name: one of :data:`CONTROLLERS`.
        gait: targets of body and feet; also gives the robot.
        mu: friction coefficient that the controller assumes.
        governor: of the governed controller, one of :data:`GOVERNORS`, ``paper`` by default; the
            whole-body controllers have none.
        period: time between ticks, s; by default that of a step of the bridge's model, or 1 ms.
        bridge: to the MuJoCo simulation in which it walks. There the whole-body controllers give
            joint targets, too, for motors to hold
            (:data:`~harpy_pin.controllers.parameters.JOINT_TARGETS`), because torques alone fall in
            many models of others. Torques alone are ``joint_stiffness=0.0, joint_damping=0.0``.
            Geoms of the robot that push each other apart where it stands
            (:meth:`MujocoBridge.self_contacts`) are said by a ``UserWarning``.
        settings: others that differ from those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`), by the names of :class:`WholeBodyParameters`, or
            for the governed controller from the defaults of :class:`GovernedParameters`, with
            ``evaluate_at`` and ``governor_parameters`` (see :func:`make_governor`); those of a
            record inside as a mapping, such as ``weights={"swing": 0.5}``.

    Raises:
        InputError: unknown name, a setting out of its domain, or a governor for a whole-body
            controller.
    """
    if governor is not None:
        checks.one_of("governor", governor, GOVERNORS)
    if bridge is not None and bridge.robot.joints != gait.robot.joints:
        message = f"the gait is of '{gait.robot.name}', the bridge of '{bridge.robot.name}'"
        raise InputError(message, name="bridge", value=bridge)
    for pair, force in (
        {} if bridge is None else bridge.self_contacts(gait.initial_state()[0])
    ).items():
        warnings.warn(
            f"where '{gait.robot.name}' stands, its geoms '{pair[0]}' and '{pair[1]}' push each "
            f"other apart in the "
            f"MuJoCo model, with {force:.0f} N: give another posture, or take the pair out of the "
            f"model's contacts",
            stacklevel=3,
        )
    if bridge is not None and name != "governed":
        settings = {**JOINT_TARGETS, **settings}
    if period is None:
        period = 1e-3 if bridge is None else float(bridge.model.opt.timestep)
    of_governor = {
        key: settings.pop(key) for key in ("evaluate_at", "governor_parameters") if key in settings
    }
    parameters = make_parameters(name, gait, mu=mu, period=period, changes=settings)
    if isinstance(parameters, WholeBodyParameters):
        if governor not in (None, "none") or of_governor:
            raise InputError(
                f"the whole-body controllers take no governor, got "
                f"{governor or ', '.join(of_governor)}; they hold the "
                "cones themselves, and ContactForceFilter.update(state, command) goes behind any "
                "controller",
                name="governor",
                value=governor,
            )
        return (
            controllers.CondensedController(gait, parameters)
            if name == "condensed"
            else controllers.WholeBodyController(gait, parameters)
        )
    governor, changes = governor or "paper", of_governor.pop("governor_parameters", None)
    if governor == "filter":
        of_filter = make_governor_parameters("filter", mu=mu, changes=changes)
        assert isinstance(of_filter, governors.ContactForceFilterParameters)
        force_filter = governors.ContactForceFilter(gait.robot, of_filter, period=period)
        return controllers.GovernedController(gait, None, parameters, force_filter=force_filter)
    chosen = make_governor(
        governor, gait.robot, mu=mu, gains=parameters.centre, parameters=changes, **of_governor
    )
    return controllers.GovernedController(gait, chosen, parameters)


@checked
def make_governor_parameters(
    name: str, *, mu: float, changes: Mapping[str, Any] | None = None
) -> governors.PaperGovernorParameters | governors.ContactForceFilterParameters | None:
    """The parameters of a governor by name; None for ``none``, which has none.

    Args:
        name: one of :data:`GOVERNORS`.
        mu: friction coefficient that it assumes.
        changes: values by the names of :class:`~harpy_pin.governors.PaperGovernorParameters` or
            :class:`~harpy_pin.governors.ContactForceFilterParameters`.

    Raises:
        InputError: unknown name, a value out of its domain, or the friction coefficient, which is
            an argument here.
    """
    checks.one_of("governor", name, GOVERNORS)
    if name == "paper":
        return changed(governors.PaperGovernorParameters(), changes)
    if name == "filter":
        return changed(governors.ContactForceFilterParameters(mu=mu), changes, fixed=("mu",))
    if changes:
        raise InputError(
            f"the governor '{name}' has no parameters", name="governor_parameters", value=changes
        )
    return None


@checked
def make_parameters(
    name: str,
    gait: Gait,
    *,
    mu: float,
    period: float = 1e-3,
    changes: Mapping[str, Any] | None = None,
) -> GovernedParameters | WholeBodyParameters:
    """The parameters of a controller by name.

    Args:
        name: one of :data:`CONTROLLERS`.
        gait: that it follows; those of whole-body controllers fit it and its robot.
        mu: friction coefficient that the controller assumes.
        period: time between ticks, s.
        changes: values by the names of :class:`GovernedParameters` or :class:`WholeBodyParameters`,
            those of a record inside as a mapping again, such as ``{"solver": "daqp", "weights":
            {"swing": 0.5}}``; None leaves a value as it is.

    Raises:
        InputError: unknown name, a value out of its domain, or a change of what is an argument
            here.
    """
    hint = f"it is make_controller('governed', ..., governor='{name}')" if name in GOVERNORS else ""
    checks.one_of("controller", name, CONTROLLERS, hint=hint)
    if name == "governed":
        return changed(GovernedParameters(period=period), changes, fixed=("period",))
    whole_body = WholeBodyParameters.for_gait(gait, period=period, limits={"mu": mu})
    return changed(whole_body, changes, fixed=("period", "limits.mu"))


@checked
def check_parameters(name: str, changes: Mapping[str, Any]) -> None:
    """Refuse changes of a controller's parameters that no gait and robot can have.

    Args:
        name: one of :data:`CONTROLLERS`.
        changes: as of :func:`make_parameters`.

    Raises:
        InputError: unknown name, a value out of its domain, or a change of what is an argument
            there.
    """
    checks.one_of("controller", name, CONTROLLERS)
    if name == "governed":
        changed(GovernedParameters(), changes, fixed=("period",))
    else:
        changed(ANY, changes, fixed=("period", "limits.mu"))


ANY = WholeBodyParameters(
    body=(0.0, 0.0),
    orientation=(0.0, 0.0),
    swing=(0.0, 0.0),
    contact_damping=0.0,
    min_normal_force=0.0,
    max_normal_force=MAX_FORCE,
    weights=WholeBodyWeights(orientation=1.0, swing=1.0, thrust=1.0, force=1.0),
)
"""Settings next to which every valid one is."""
