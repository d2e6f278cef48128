"""Controllers as parts of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.named_controllers import (
    GOVERNORS,
    check_parameters,
    make_controller,
    make_governor_parameters,
)
from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait
from harpy_pin.governors.rows import EVALUATE_AT
from harpy_pin.scenario.parts import Part, defaults_of, plain
from harpy_pin.simulation.loop import Controller


@dataclass(frozen=True, kw_only=True)
class ControllerPart(Part):
    """A controller of a scenario.

    Attributes:
        mu: friction coefficient that it assumes; the ground's static one by default.
        parameters: further settings that differ from those that fit gait and robot, such as
            ``{"solver": "daqp", "weights": {"swing": 0.5}}``, by the names of
            :class:`harpy_pin.controllers.WholeBodyParameters`.
    """

    further: ClassVar[type] = WholeBodyParameters
    mu: float | None = checks.setting(None, low=0.0, high=checks.MAX_FRICTION)
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @classmethod
    def settings(cls) -> dict[str, Any]:
        """Settings of the part and of its parameters."""
        settings = defaults_of(cls.further) | defaults_of(cls)
        return {name: value for name, value in settings.items() if name != "period"}

    @classmethod
    @checked
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The part with settings by their names, parameters among them.

        Args:
            settings: values by name.
        """
        own = {name: value for name, value in settings.items() if name in defaults_of(cls)}
        parameters = {name: value for name, value in settings.items() if name not in own}
        if parameters:
            own["parameters"] = {
                **checks.mapping("parameters", own.get("parameters") or {}),
                **parameters,
            }
        return super().from_settings(own)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(self, parameters=_plain_mapping("parameters", self.parameters))
        for name in self.parameters.keys() & {entry.name for entry in fields(self)}:
            raise InputError(
                f"'{name}' is a setting of the part itself, not one of its parameters", name=name
            )
        # Refuses parameters that are not its own.
        own = {
            name: value
            for name, value in self._own_settings().items()
            if name in defaults_of(self.further)
        }
        check_parameters(self.name, {**self.parameters, **own})

    @checked
    def make(self, gait: Gait, *, mu: float, period: float) -> Controller:
        """The controller.

        Args:
            gait: that it follows.
            mu: friction coefficient that it assumes.
            period: time between its ticks, s.
        """
        return make_controller(
            self.name, gait, mu=mu, period=period, **self.parameters, **self._own_settings()
        )

    def _own_settings(self) -> dict[str, Any]:
        """The part's settings for the controller besides its parameters."""
        return {
            name: getattr(self, name)
            for name in defaults_of(type(self))
            if name not in ("mu", "parameters")
        }


@dataclass(frozen=True, kw_only=True)
class Condensed(ControllerPart):
    """The whole-body QP condensed to the contact forces, see
    :class:`harpy_pin.controllers.CondensedController`.
    """

    name = "condensed"


@dataclass(frozen=True, kw_only=True)
class WholeBody(ControllerPart):
    """The whole-body QP, see :class:`harpy_pin.controllers.WholeBodyController`.

    ProxQP solves it in every tick. With ``{"solver": "active_set"}`` among the parameters it is
    this library's own search, with which a whole walk is one compiled loop.
    """

    name = "wbc"


@dataclass(frozen=True, kw_only=True)
class Governed(ControllerPart):
    """The paper's controller with a governor, for Harpy, see
    :class:`harpy_pin.controllers.GovernedController`.

    Attributes:
        mu: friction coefficient that the governor assumes; the ground's static one by default.
        parameters: further settings, by the names of
            :class:`harpy_pin.controllers.GovernedParameters`.
        governor: one of :data:`harpy_pin.controllers.GOVERNORS`.
        evaluate_at: where the governor evaluates its constraints: ``measured`` (state) or
            ``tracked`` (reference).
        limits: whether torques and thrusts are clipped to the hardware's limits.
        thrust: whether it has its thrusters.
        governor_parameters: settings of the governor that differ from their defaults, such as
            ``{"alpha_n": 40.0, "friction_share": 0.75}``, see
            :func:`harpy_pin.controllers.make_governor_parameters`.
    """

    name = "governed"
    further = GovernedParameters
    governor: str = checks.setting("paper", checks.one_of, valid=GOVERNORS)
    evaluate_at: str = checks.setting("measured", checks.one_of, valid=EVALUATE_AT)
    limits: bool = False
    thrust: bool = True
    governor_parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(
            self,
            governor_parameters=_plain_mapping("governor_parameters", self.governor_parameters),
        )
        # Refuses parameters that are not the governor's own.
        make_governor_parameters(self.governor, mu=1.0, changes=self.governor_parameters)


CONTROLLER_PARTS: dict[str, type[ControllerPart]] = {
    kind.name: kind for kind in (Condensed, WholeBody, Governed)
}
"""The controllers of a scenario by name; the first one is the default."""


def _plain_mapping(name: str, value: Any) -> Any:
    """Settings as JSON has them; none for None."""
    try:
        return plain(checks.mapping(name, {} if value is None else value))
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(
            f"{name} must be numbers, names and mappings: {error}", name=name
        ) from None
