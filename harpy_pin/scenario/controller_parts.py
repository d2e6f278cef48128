"""Controllers as parts of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.named_controllers import (
    GOVERNORS,
    make_controller,
    make_governor_parameters,
    make_parameters,
)
from harpy_pin.deprecated import new_value
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.governors.reduced.rows import EVALUATE_AT
from harpy_pin.scenario.parts import Part, plain
from harpy_pin.simulation.controller import Controller

__all__ = ["CONTROLLER_PARTS", "Condensed", "ControllerPart", "Governed", "WholeBody"]


@dataclass(frozen=True, kw_only=True)
class ControllerPart(Part):
    """A controller of a scenario.

    Attributes:
        mu: friction coefficient that it assumes; the ground's static one by default.
        parameters: further settings that differ from their defaults, such as
            ``{"solver": "daqp", "weights": {"swing": 0.5}}``, see :func:`harpy_pin.controllers.make_parameters`.
    """

    mu: float | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if self.mu is not None:
            checks.keep(self, mu=checks.number("mu", self.mu, low=0.0, high=checks.MAX_FRICTION))
        checks.keep(self, parameters=_plain_mapping("parameters", self.parameters))
        # Refuses parameters that are not its own.
        make_parameters(self.name, mu=1.0 if self.mu is None else self.mu, changes=self.parameters)

    @checked
    def make(self, gait: Gait, *, mu: float, period: float, fitting: Mapping[str, Any]) -> Controller:
        """The controller.

        Args:
            gait: that it follows.
            mu: friction coefficient that it assumes.
            period: time between its ticks, s.
            fitting: parameters that fit the robot; those of the part come first.
        """
        parameters = _merged(fitting, self.parameters)
        return make_controller(self.name, gait, mu=mu, period=period, parameters=parameters, **self._more())

    def _more(self) -> dict[str, Any]:
        """Further arguments of :func:`~harpy_pin.controllers.named_controllers`."""
        return {}


@dataclass(frozen=True, kw_only=True)
class Condensed(ControllerPart):
    """The whole-body QP condensed to the contact forces, see :class:`harpy_pin.controllers.CondensedController`.

    Attributes:
        mu: friction coefficient that it assumes; the ground's static one by default.
        parameters: further settings, by the names of :class:`harpy_pin.controllers.WholeBodyParameters`.
    """

    name = "condensed"


@dataclass(frozen=True, kw_only=True)
class WholeBody(ControllerPart):
    """The whole-body QP, see :class:`harpy_pin.controllers.WholeBodyController`.

    Attributes:
        mu: friction coefficient that it assumes; the ground's static one by default.
        parameters: further settings, by the names of :class:`harpy_pin.controllers.WholeBodyParameters`.
    """

    name = "wbc"


@dataclass(frozen=True, kw_only=True)
class Governed(ControllerPart):
    """The paper's controller with a governor, for Harpy, see :class:`harpy_pin.controllers.GovernedController`.

    Attributes:
        mu: friction coefficient that the governor assumes; the ground's static one by default.
        parameters: further settings, by the names of :class:`harpy_pin.controllers.GovernedParameters`.
        governor: one of :data:`harpy_pin.controllers.GOVERNORS`.
        evaluate_at: where the governor evaluates its constraints: ``measured`` (state) or ``tracked`` (reference).
        limits: whether torques and thrusts are clipped to the hardware's limits.
        thrust: whether it has its thrusters.
        governor_parameters: settings of the governor that differ from their defaults, such as
            ``{"alpha_n": 40.0, "friction_share": 0.75}``, see :func:`harpy_pin.controllers.make_governor_parameters`.
    """

    name = "governed"
    governor: str = "paper"
    evaluate_at: str = "measured"
    limits: bool = False
    thrust: bool = True
    governor_parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(self, governor=new_value("governor", self.governor))
        checks.one_of("governor", self.governor, GOVERNORS)
        checks.one_of("evaluate_at", self.evaluate_at, EVALUATE_AT)
        for name in ("limits", "thrust"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} must be true or false, got {shown(getattr(self, name))}", name=name)
        checks.keep(self, governor_parameters=_plain_mapping("governor_parameters", self.governor_parameters))
        # Refuses parameters that are not the governor's own.
        make_governor_parameters(self.governor, mu=1.0, changes=self.governor_parameters)

    def _more(self) -> dict[str, Any]:
        names = ("governor", "evaluate_at", "limits", "thrust", "governor_parameters")
        return {name: getattr(self, name) for name in names}


CONTROLLER_PARTS: dict[str, type[ControllerPart]] = {kind.name: kind for kind in (Condensed, WholeBody, Governed)}
"""The controllers of a scenario by name; the first one is the default."""


def _plain_mapping(name: str, value: Any) -> Any:
    """Settings as JSON has them; none for None."""
    try:
        return plain({} if value is None else value)
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers, names and mappings: {error}", name=name) from None


def _merged(fitting: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """All settings; a given one replaces a fitting one, also inside a mapping."""
    merged = {**fitting, **given}
    for name in fitting.keys() & given.keys():
        if isinstance(fitting[name], Mapping) and isinstance(given[name], Mapping):
            merged[name] = {**fitting[name], **given[name]}
    return merged
