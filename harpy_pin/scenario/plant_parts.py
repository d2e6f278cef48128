"""Physics engines as parts of a scenario."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from harpy_pin import checks, simulation
from harpy_pin.arguments import checked
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.scenario.parts import Part
from harpy_pin.simulation import mujoco
from harpy_pin.simulation.actuators import Actuators
from harpy_pin.simulation.mujoco.soft_contact import (
    CONTACTS,
    DEFAULT_PRESET,
    PRESETS,
    preset_ground,
)
from harpy_pin.simulation.pinocchio_plant import STICTION_TOLERANCE, TOLERANCES
from harpy_pin.simulation.plant import Plant


@dataclass(frozen=True, kw_only=True)
class PlantPart(Part):
    """A physics engine of a scenario."""

    @checked
    def felt_ground(self, ground: Ground) -> Ground:
        """The ground with the stiffness and damping that the feet feel.

        Args:
            ground: of the scenario.

        Raises:
            InputError: the engine has no such ground.
        """
        return ground

    @abstractmethod
    @checked
    def make(
        self, robot: Robot, ground: Ground, *, dt: float, actuators: Actuators | None = None
    ) -> Plant:
        """The engine, without a state.

        Args:
            robot: the true one.
            ground: of the scenario.
            dt: physics step, s.
            actuators: motors and joint friction of the true robot.

        Raises:
            InputError: the engine is not installed.
        """


@dataclass(frozen=True, kw_only=True)
class Compliant(PlantPart):
    """The library's own engine, see :class:`harpy_pin.Simulator`."""

    name = "compliant"

    @checked
    def make(
        self, robot: Robot, ground: Ground, *, dt: float, actuators: Actuators | None = None
    ) -> Plant:
        """See :class:`PlantPart`."""
        return simulation.Simulator(robot, ground, dt=dt, actuators=actuators)


@dataclass(frozen=True, kw_only=True)
class Pinocchio(PlantPart):
    """The paper's model as written, by Pinocchio's ABA and explicit steps.

    See :class:`harpy_pin.simulation.PinocchioPlant`.

    Attributes:
        stiction_tolerance: speed below which friction falls to zero, m/s: a foot that holds some
            friction creeps.
    """

    name = "pinocchio"
    stiction_tolerance: float = checks.setting(STICTION_TOLERANCE, **TOLERANCES)

    @checked
    def make(
        self, robot: Robot, ground: Ground, *, dt: float, actuators: Actuators | None = None
    ) -> Plant:
        """See :class:`PlantPart`."""
        tolerance = self.stiction_tolerance
        return simulation.PinocchioPlant(
            robot, ground, dt=dt, actuators=actuators, stiction_tolerance=tolerance
        )


@dataclass(frozen=True)
class Mujoco(PlantPart):
    """MuJoCo, an extra, see :class:`harpy_pin.simulation.mujoco.MujocoPlant`.

    Attributes:
        preset: one of :data:`harpy_pin.simulation.mujoco.PRESETS`: how stiffness and damping of its
            contact relate to those of the ground; or one of
            :data:`harpy_pin.simulation.mujoco.CONTACTS`, MuJoCo's own, which the ground's stiffness
            and damping do not change.
        foot_radius: of spheres that roll over the ground, m; feet are points by default.
    """

    name = "mujoco"
    preset: str = checks.setting(
        DEFAULT_PRESET, checks.one_of, valid=(*PRESETS, *CONTACTS), called="plant preset"
    )
    foot_radius: float = checks.setting(0.0, low=0.0, high=1.0)

    @checked
    def felt_ground(self, ground: Ground) -> Ground:
        """See :class:`PlantPart`."""
        return preset_ground(ground, self.preset)

    @checked
    def make(
        self, robot: Robot, ground: Ground, *, dt: float, actuators: Actuators | None = None
    ) -> Plant:
        """See :class:`PlantPart`."""
        contact, felt = CONTACTS.get(self.preset), self.felt_ground(ground)
        return mujoco.MujocoPlant(
            robot, felt, dt=dt, actuators=actuators, contact=contact, foot_radius=self.foot_radius
        )


PLANT_PARTS: dict[str, type[PlantPart]] = {
    kind.name: kind for kind in (Compliant, Pinocchio, Mujoco)
}
"""The physics engines of a scenario by name; the first one is the default."""
