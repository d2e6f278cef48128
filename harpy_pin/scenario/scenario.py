"""Everything that makes a walk, as one immutable value that can be written down and walked
again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from os import PathLike
from typing import Any

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.estimation import Imu
from harpy_pin.ground.ground import Ground, Unset
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.source import loaded_robot, named_robot, plain_source
from harpy_pin.scenario.controller_parts import CONTROLLER_PARTS, ControllerPart
from harpy_pin.scenario.disturbances import Disturbances
from harpy_pin.scenario.gait_parts import (
    GAIT_PARTS,
    GaitPart,
    Walking,
    gaits_of,
    schedules_of,
    why_not,
)
from harpy_pin.scenario.parts import plain, read_part
from harpy_pin.scenario.plant_parts import PLANT_PARTS, PlantPart
from harpy_pin.simulation.push import check_pushes
from harpy_pin.simulation.sensors import ESTIMATED, TRUE


@dataclass(frozen=True, init=False, repr=False, eq=False)
class Scenario:
    """Everything that makes a walk.

    A part can be given by its name, which gives it its default settings, or as a mapping of its
    name and settings. Without a name that is the first of its kind that has these settings::

        Scenario(controller="wbc", ground=Ground(mu_s=0.25))
        Scenario(gait=Commanded(velocity=(0.3, 0.0, 0.2)), controller=Condensed(mu=0.5),
        plant="mujoco") Scenario(robot="go2", disturbances=Disturbances(delay=2e-3,
        noise=Noise.typical()))

    Attributes:
        robot: ``harpy``, the name of a robot of the catalogue (:data:`harpy_pin.model.CATALOGUE`),
            or a robot of one's own, ``hp.load_robot("my.urdf", feet=...)``.
        gait: one of :data:`GAIT_PARTS` that the robot has; :class:`Straight` by default, or what
            fits the other robot.
        controller: one of :data:`CONTROLLER_PARTS`; :class:`Condensed` by default.
        plant: one of :data:`PLANT_PARTS`; :class:`Compliant` by default, :class:`Pinocchio` or
            :class:`Mujoco`.
        ground: what the robot walks on; by default of friction 0.25. Where no stiffness is given it
            is the paper's, for another robot than Harpy one that fits its weight.
        disturbances: pushes, noise, delay, mass error and start velocity; none by default.
        sensors: of the robot, which are simulated and logged with the estimate of the state from
            them; None: none.
        state: what the controller knows: the ``true`` state, with the noise and delay of the
            disturbances, or the ``estimated`` one, from sensors that are ``Imu()`` where no others
            are given.
        duration: simulated time, s.
        period: time between control ticks, s, a multiple of dt.
        dt: physics step, s, at least 1e-6.
        urdf: a variant of Harpy; the packaged one by default.

    Raises:
        InputError: an unknown name, a value out of its domain, or parts that do not go together.
        RobotError: no stiffness is given, and the robot, whose weight decides on it, is not
            installed.
    """

    robot: str | Robot
    gait: GaitPart
    controller: ControllerPart
    plant: PlantPart
    ground: Ground
    disturbances: Disturbances
    sensors: Imu | None
    state: str
    duration: float
    period: float
    dt: float
    urdf: str | None

    def __init__(
        self,
        *,
        robot: str | Robot | Mapping[str, Any] = "harpy",
        gait: GaitPart | str | Mapping[str, Any] | None = None,
        controller: ControllerPart | str | Mapping[str, Any] | None = None,
        plant: PlantPart | str | Mapping[str, Any] | None = None,
        ground: Ground | Mapping[str, Any] | None = None,
        disturbances: Disturbances | Mapping[str, Any] | None = None,
        sensors: Imu | Mapping[str, Any] | None = None,
        state: str = TRUE,
        duration: float = 6.0,
        period: float = 1e-3,
        dt: float = 5e-4,
        urdf: str | PathLike[str] | None = None,
    ) -> None:
        robot = named_robot(robot)
        checks.one_of("state", state, (TRUE, ESTIMATED))
        sensors = Imu() if sensors is None and state == ESTIMATED else sensors
        values: dict[str, Any] = {
            "robot": robot,
            "gait": read_part(GAIT_PARTS, "gait", gait, gaits_of(robot)),
            "controller": read_part(CONTROLLER_PARTS, "controller", controller),
            "plant": read_part(PLANT_PARTS, "plant", plant),
            "disturbances": checks.record(
                "disturbances", {} if disturbances is None else disturbances, Disturbances
            ),
            "sensors": None if sensors is None else checks.record("sensors", sensors, Imu),
            "state": state,
            "duration": checks.number("duration", duration, low=0.0, strict=True),
            "period": checks.number("period", period, low=0.0, strict=True),
            "dt": checks.number("dt", dt, low=1e-6),
            "urdf": None if urdf is None else str(checks.path("urdf", urdf)),
        }
        checks.keep(self, **values)
        self._check_robot()
        self._check_times()
        own = checks.record("ground", {} if ground is None else ground, Ground)
        if robot != "harpy" and isinstance(own.stiffness, Unset):
            own = own.fitted(loaded_robot(robot), walks=self.gait.name == Walking.name)
        checks.keep(self, ground=own)
        self.plant.felt_ground(self.ground)  # refuses a ground that the engine does not have

    def __repr__(self) -> str:
        parts = ", ".join(getattr(self, name).name for name in ("gait", "controller", "plant"))
        return (
            f"Scenario('{self.robot_name}', {parts}, mu_s={self.ground.mu_s:g}, "
            f"{self.duration:g} s)"
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(str(self.to_dict()))

    @property
    def robot_name(self) -> str:
        """Name of the robot."""
        return self.robot if isinstance(self.robot, str) else self.robot.name

    def _check_robot(self) -> None:
        """Whether gait, controller and URDF are for this robot, and go together."""
        gait, controller = self.gait.name, self.controller.name
        checks.one_of(
            f"gait of '{self.robot_name}'",
            gait,
            gaits_of(self.robot),
            hint=why_not(self.robot, gait),
        )
        if isinstance(self.gait, Walking) and self.gait.schedule is not None:
            checks.one_of(
                f"schedule of '{self.robot_name}'", self.gait.schedule, schedules_of(self.robot)
            )
        if self.gait.not_governed and controller == "governed":
            raise InputError(
                f"the paper's controller {self.gait.not_governed}: walk a {gait} gait with "
                f"'condensed' or 'wbc'",
                name="gait",
                value=gait,
            )
        if self.robot == "harpy":
            return
        if controller == "governed":
            raise InputError(
                f"the governed controller is for Harpy: '{self.robot_name}' takes "
                f"'condensed' or 'wbc'",
                name="controller",
                value=controller,
            )
        if self.urdf is not None:
            raise InputError(
                "urdf is a variant of Harpy: it goes with robot='harpy'",
                name="urdf",
                value=self.urdf,
            )

    def _check_times(self) -> None:
        """Whether steps, ticks, delay and pushes fit into each other and into the duration."""
        pushes, delay = self.disturbances.pushes, self.disturbances.delay
        if self.sensors is not None and (self.disturbances.noise or delay > 0.0):
            raise InputError(
                "sensors have noise of their own: leave the disturbances' noise and delay out",
                name="sensors",
                value=self.sensors,
            )
        check_pushes(pushes, 0.0, checks.ticks(self.duration, self.period) * self.period)
        checks.multiple("period", self.period, "physics step", self.dt)
        checks.multiple("delay", delay, "period", self.period, low=0)

    @property
    def mu(self) -> float:
        """Friction coefficient that the controller assumes."""
        return self.ground.mu_s if self.controller.mu is None else self.controller.mu

    @property
    def felt_ground(self) -> Ground:
        """The ground with the stiffness and damping that the feet feel, by the plant's preset."""
        return self.plant.felt_ground(self.ground)

    @property
    def stiffness(self) -> float:
        """Stiffness that the walk is made for, N/m."""
        stiffness: float | None = getattr(self.gait, "stiffness", None)
        return self.felt_ground.stiffness if stiffness is None else stiffness

    def to_dict(self) -> dict[str, Any]:
        """Names and values, those of a part inside it, ready for JSON and exact."""
        parts = {
            name: getattr(self, name).to_dict()
            for name in ("gait", "controller", "plant", "disturbances")
        }
        parts["sensors"] = None if self.sensors is None else plain(asdict(self.sensors))
        parts["ground"] = plain(self.ground.to_dict())
        parts["robot"] = (
            plain_source(self.robot.source) if isinstance(self.robot, Robot) else self.robot
        )
        return {
            entry.name: parts.get(entry.name, getattr(self, entry.name)) for entry in fields(self)
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scenario:
        """The scenario of :meth:`to_dict`; what is not there has its default.

        Args:
            data: names and values of the attributes, each part as a mapping or a name.

        Raises:
            InputError: unknown names, or values out of their domains.
        """
        checks.mapping("scenario", data)
        data = {**data, "robot": named_robot(data.get("robot", "harpy"))}
        for name in data:
            checks.one_of("entry of the scenario", name, [entry.name for entry in fields(cls)])
        return cls(**data)

    @classmethod
    @checked
    def of(cls, run: Run) -> Scenario:
        """The scenario that a run was walked from.

        Args:
            run: made by :func:`walk`, or loaded from its file.

        Raises:
            InputError: the run was not made by :func:`walk`, or with a gait or a controller that no
                scenario names.
        """
        if "scenario" not in run.metadata:
            raise InputError(
                "the run holds no scenario: it was not made by walk(scenario)", name="run"
            )
        own = run.metadata.get("own")
        if own:
            parts = " and ".join(
                name for name in ("gait", "controller") if isinstance(own, list) and name in own
            )
            raise InputError(
                f"the run was walked with its own {parts or 'parts'}, which its scenario "
                f"does not hold; "
                "Scenario.from_dict(run.metadata['scenario']) is the rest",
                name="run",
            )
        return cls.from_dict(run.metadata["scenario"])
