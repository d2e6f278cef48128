"""A scenario is everything that makes a walk; :func:`walk` walks it.

A run remembers its scenario, so that it can be walked again from its file::

    run = walk(Scenario(controller="wbc", ground=Ground(mu_s=0.25), duration=3.0), save="walk.npz")
    again = walk(Scenario.of(Run.load("walk.npz")))

With the same versions on the same machine the two are equal bit for bit. Only where ProxQP is asked (the whole-body
controller's default solver) the last digits may differ, as they depend on where its memory lies; DAQP's do not.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from os import fspath
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from harpy_pin import checks
from harpy_pin.controllers.make import GOVERNORS, make_controller, make_parameters
from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.deprecated import new_entries, new_value, renamed_arguments, start_of
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import check_script, make_commanded_gait
from harpy_pin.gaits.gait import Gait
from harpy_pin.gaits.hovering import Hovering
from harpy_pin.gaits.make import GAITS, make_named_gait
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.stepping import Stepping
from harpy_pin.governors.reduced.rows import EVALUATE_AT
from harpy_pin.log.run import Run
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.robot import Robot, heavier, load_harpy, load_robot
from harpy_pin.model.state import State
from harpy_pin.simulation.controller import Controller
from harpy_pin.simulation.ground import MAX_STIFFNESS, Ground
from harpy_pin.simulation.mujoco.presets import preset_ground
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.push import Push, check_pushes
from harpy_pin.simulation.sensors import Noise, Sensors
from harpy_pin.simulation.simulator import Simulator

__all__ = ["PLANTS", "Scenario", "Walk", "build", "walk"]

_Record = TypeVar("_Record")
PLANTS = ("compliant", "mujoco")
MAX_SPEED, MAX_MASS_ERROR = 100.0, 100.0
"""Upper ends, m/s and as a share: far beyond what any walker does, and far from numbers that overflow."""


@renamed_arguments(reading="evaluate_at")
@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that makes a walk.

    Attributes:
        robot: ``harpy``, or a robot that is known by name (:data:`harpy_pin.model.CATALOGUE`). Robots other than Harpy
            stand, step in place on two points, or hover; the governed controller is for Harpy alone.
        controller: one of :data:`harpy_pin.controllers.CONTROLLERS`; ``condensed`` by default, ``governed`` where a
            setting is given that only this one has.
        governor: of the governed controller, one of :data:`harpy_pin.controllers.GOVERNORS`, ``paper`` by default; the
            whole-body controllers take ``none``.
        evaluate_at: of that governor: where it evaluates its constraints, ``measured`` (state) or ``tracked``
            (reference).
        limits: whether the governed controller respects the hardware's limits (the whole-body controller always does).
        thrust: whether the governed controller has its thrusters.
        parameters: further settings of the controller that differ from their defaults, such as
            ``{"solver": "daqp", "weights": {"swing": 0.5}}``, see :func:`harpy_pin.controllers.make_parameters`.
        assumed_friction: friction coefficient that the controller assumes; the ground's μ_s by default.
        assumed_stiffness: stiffness that the walk's carrying feet press into, N/m; the ground's by default. The found
            gaits have no such thing.
        gait: one of :data:`harpy_pin.gaits.GAITS`, along x; ``commanded``, for the whole-body controllers; of another
            robot ``standing``, ``stepping`` or ``hovering``. By default ``hand``, or what fits the other robot.
        speed: along x, m/s; zero stands on both feet. A command has speeds of its own.
        command: of the gait ``commanded``: rows (t, forward, sideways, turning) in s, m/s and rad/s, each valid from
            its time on, in the frame of the heading (see :class:`harpy_pin.gaits.CommandedGait`); without any,
            ``speed`` forward.
        urdf: a variant of Harpy; the packaged one by default.
        mass_error: share by which the robot's body is heavier than the controller believes, above −1.
        ground: what the robot walks on.
        plant: the engine, one of :data:`PLANTS`: ``compliant``, the library's own, or ``mujoco`` (an extra).
        plant_preset: of MuJoCo's contact, one of :data:`harpy_pin.simulation.mujoco.PRESETS`: how its stiffness and
            damping relate to those of ``ground``; ``soft``, the same, by default. The library's own plant has none.
        start_velocity: (6,) what the body has too much at the start: linear, m/s, and angular velocity, rad/s, body
            axes (upright and facing x, so that they agree with the world's).
        pushes: forces on the body.
        noise: of the controller's measurements.
        delay: age of the controller's measurements, s, a multiple of the period (see
            :class:`harpy_pin.simulation.sensors.Sensors`).
        duration: simulated time, s.
        period: time between control ticks, s, a multiple of dt.
        dt: physics step, s, at least 1e-6.
        seed: of the noise.

    Raises:
        InputError: an unknown name or a value out of its domain.
    """

    robot: str = "harpy"
    controller: str | None = None
    governor: str | None = None
    evaluate_at: str = "measured"
    limits: bool = False
    thrust: bool = True
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    assumed_friction: float | None = None
    assumed_stiffness: float | None = None
    gait: str | None = None
    speed: float = 0.3
    command: tuple[tuple[float, float, float, float], ...] = ()
    urdf: str | None = None
    mass_error: float = 0.0
    ground: Ground = field(default_factory=Ground)
    plant: str = "compliant"
    plant_preset: str | None = None
    start_velocity: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pushes: tuple[Push, ...] = ()
    noise: Noise = field(default_factory=Noise)
    delay: float = 0.0
    duration: float = 6.0
    period: float = 1e-3
    dt: float = 5e-4
    seed: int = 0

    def __post_init__(self) -> None:
        def keep(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        for name in ("controller", "governor"):
            keep(name, new_value(name, getattr(self, name)))
        checks.one_of("robot", self.robot, ("harpy", *CATALOGUE))
        if self.controller is None:
            keep("controller", "governed" if self._says_governed() else "condensed")
        if self.governor is None:
            keep("governor", "paper" if self.controller == "governed" else "none")
        keep("gait", self._checked_gait())
        keep("command", check_script(self.command))
        if self.gait == "commanded" and self.controller == "governed":
            message = "the paper's controller faces x and cannot turn: walk a commanded gait with 'condensed' or 'wbc'"
            raise InputError(message, name="gait", value=self.gait)
        if self.gait != "commanded" and self.command:
            raise InputError(f"a command is for the gait 'commanded', not '{self.gait}'", name="command")
        checks.one_of("governor", self.governor, GOVERNORS)
        if self.controller != "governed" and self.governor != "none":
            message = f"the whole-body controller takes no governor, got '{self.governor}'"
            raise InputError(message, name="governor", value=self.governor)
        checks.one_of("evaluate_at", self.evaluate_at, EVALUATE_AT)
        for name in ("limits", "thrust"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} must be true or false, got {getattr(self, name)!r}", name=name)
        for name, kind in (("ground", Ground), ("noise", Noise)):
            if not isinstance(getattr(self, name), kind):
                raise InputError(f"{name} must be a {kind.__name__}, got {getattr(self, name)!r}", name=name)
        keep("seed", checks.whole("seed", self.seed))
        for name in ("duration", "period"):
            keep(name, checks.number(name, getattr(self, name), low=0.0, strict=True))
        keep("dt", checks.number("dt", self.dt, low=1e-6))
        keep("speed", checks.number("speed", self.speed, low=-MAX_SPEED, high=MAX_SPEED))
        keep("delay", checks.number("delay", self.delay, low=0.0))
        keep("mass_error", checks.number("mass_error", self.mass_error, low=-1.0, high=MAX_MASS_ERROR, strict=True))
        if self.assumed_friction is not None:
            keep(
                "assumed_friction",
                checks.number("assumed_friction", self.assumed_friction, low=0.0, high=checks.MAX_FRICTION),
            )
        if self.assumed_stiffness is not None:
            if self.gait not in ("hand", "commanded"):
                message = f"the gait '{self.gait}' has the press it was found with: it assumes no stiffness"
                raise InputError(message, name="assumed_stiffness", value=self.assumed_stiffness)
            stiffness = checks.number(
                "assumed_stiffness", self.assumed_stiffness, low=0.0, high=MAX_STIFFNESS, strict=True
            )
            keep("assumed_stiffness", stiffness)
        checks.one_of("plant", self.plant, PLANTS)
        if self.plant == "mujoco":
            preset_ground(self.ground, self.plant_preset)  # refuses an unknown preset, and what MuJoCo cannot do
        elif self.plant_preset is not None:
            message = f"the plant '{self.plant}' has no presets, got '{self.plant_preset}'"
            raise InputError(message, name="plant_preset", value=self.plant_preset)
        if self.urdf is not None:
            keep("urdf", fspath(self.urdf))
        keep("start_velocity", tuple(checks.vector("start_velocity", self.start_velocity, 6).tolist()))
        keep("pushes", tuple(self.pushes))
        if not all(isinstance(push, Push) for push in self.pushes):
            raise InputError(f"pushes must be Push objects, got {self.pushes!r}", name="pushes", value=self.pushes)
        check_pushes(self.pushes, 0.0, checks.ticks(self.duration, self.period) * self.period)
        checks.multiple("period", self.period, "physics step", self.dt)
        checks.multiple("delay", self.delay, "period", self.period, low=0)
        try:
            keep("parameters", _plain(self.parameters))
        except (AttributeError, TypeError, ValueError) as error:
            raise InputError(f"parameters must be numbers, names and mappings: {error}", name="parameters") from None
        make_parameters(  # refuses an unknown controller, and parameters that are not its own
            str(self.controller),
            mu=self.mu,
            limits=self.limits,
            thrust=self.thrust,
            period=self.period,
            changes=self.parameters,
        )

    def _says_governed(self) -> bool:
        """Whether a setting is given that only the governed controller has."""
        own = {entry.name for entry in fields(GovernedParameters)} - {
            entry.name for entry in fields(WholeBodyParameters)
        }
        names = self.parameters if isinstance(self.parameters, Mapping) else ()
        given = self.governor is not None or self.evaluate_at != "measured" or self.limits is not False
        return given or self.thrust is not True or not own.isdisjoint(names)

    def _checked_gait(self) -> str:
        """The gait, the default where none is given."""
        if self.robot == "harpy":
            gait = "hand" if self.gait is None else self.gait
            checks.one_of("gait", gait, (*GAITS, "commanded"))
            return gait
        known = CATALOGUE[self.robot]
        points = len(known.feet) == 2 and not known.flat_feet
        valid = ("standing", *(("stepping",) if points else ())) if known.feet else ("hovering",)
        gait = valid[-1] if self.gait is None else self.gait
        checks.one_of(f"gait of '{self.robot}'", gait, valid)
        if self.controller == "governed":
            message = (
                f"the governed controller is for Harpy's legs and thrusters: '{self.robot}' takes 'condensed' or 'wbc'"
            )
            raise InputError(message, name="controller", value=self.controller)
        if self.urdf is not None:
            raise InputError("urdf is a variant of Harpy: it goes with robot='harpy'", name="urdf", value=self.urdf)
        return gait

    @property
    def mu(self) -> float:
        """Friction coefficient that the controller assumes."""
        return self.ground.mu_s if self.assumed_friction is None else self.assumed_friction

    @property
    def felt_ground(self) -> Ground:
        """The ground with the stiffness and damping that the feet feel, by the plant's preset."""
        return preset_ground(self.ground, self.plant_preset) if self.plant == "mujoco" else self.ground

    @property
    def stiffness(self) -> float:
        """Stiffness that the walk is made for, N/m."""
        return self.felt_ground.stiffness if self.assumed_stiffness is None else self.assumed_stiffness

    def to_dict(self) -> dict[str, Any]:
        """Names and values, ready for JSON and exact."""
        values: dict[str, Any] = _plain(asdict(self))
        return values

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scenario:
        """The scenario of :meth:`to_dict`; what is not there has its default.

        Args:
            data: names and values of the attributes; ``ground``, ``noise`` and each push as mappings again.

        Raises:
            InputError: unknown names, or values out of their domains.
        """
        values = _known(cls, "scenario", data)
        if values.get("controller", "governed") not in ("governed", None):
            values["governor"] = "none"  # files from before 0.2 say "paper" there
        for name, kind in (("ground", Ground), ("noise", Noise)):
            if name in values:
                values[name] = _read(kind, name, values[name])
        pushes = values.pop("pushes", ())
        if not isinstance(pushes, list | tuple):
            raise InputError(f"pushes must be a list, got {pushes!r}", name="pushes", value=pushes)
        return cls(**values, pushes=tuple(_read(Push, "push", push) for push in pushes))

    @classmethod
    def of(cls, run: Run) -> Scenario:
        """The scenario that a run was walked from.

        Args:
            run: made by :func:`walk`, or loaded from its file.

        Raises:
            InputError: the run was not made by :func:`walk`, or with a gait or a controller that no scenario names.
        """
        if "scenario" not in run.metadata:
            raise InputError("the run holds no scenario: it was not made by walk(scenario)", name="run")
        own = run.metadata.get("own")
        if own:
            message = f"the run was walked with its own {' and '.join(own)}, which its scenario does not hold"
            raise InputError(f"{message}; Scenario.from_dict(run.metadata['scenario']) is the rest", name="run")
        return cls.from_dict(new_entries(run.metadata["scenario"]))


@dataclass(frozen=True, eq=False)
class Walk:
    """A scenario built and ready to be walked once.

    Attributes:
        scenario: what it was built from.
        gait: targets of body and feet; ``gait.robot`` is the robot whose mass and inertia the controller assumes.
        controller: that walks it.
        simulator: holds the true robot, in its start state.
        sensors: between them; none where the scenario has neither noise nor delay.
        own: which of gait and controller are not the scenario's.
    """

    scenario: Scenario
    gait: Gait
    controller: Controller
    simulator: Plant
    sensors: Sensors | None
    own: tuple[str, ...] = ()

    def run(
        self,
        *,
        on_tick: Callable[[State], None] | None = None,
        on_piece: Callable[[float], None] | None = None,
        metadata: Mapping[str, object] | None = None,
        save: str | Path | None = None,
    ) -> Run:
        """Walk; for arguments and errors see :func:`walk` and :meth:`harpy_pin.simulation.plant.Plant.run`."""
        own = {"own": list(self.own)} if self.own else {}
        return self.simulator.run(
            self.controller,
            self.scenario.duration,
            control_period=self.scenario.period,
            metadata={"scenario": self.scenario.to_dict(), **own, **(metadata or {})},
            on_tick=on_tick,
            on_piece=on_piece,
            pushes=self.scenario.pushes,
            sensors=self.sensors,
            save=save,
        )


def build(
    scenario: Scenario, *, gait: Gait | None = None, controller: Callable[[Gait], Controller] | None = None
) -> Walk:
    """Everything that a walk needs, ready to run: a profiler or a viewer may stand in between.

    Args:
        scenario: what to walk.
        gait: one's own, with its robot, instead of the scenario's gait, speed and URDF.
        controller: makes one's own controller from the gait, instead of the scenario's.

    Raises:
        InputError: a value that this gait or robot does not have, another control period than the scenario's, or
            MuJoCo is asked for and not installed.
        RobotError: the URDF is missing, malformed, or lacks a foot or a thruster.
    """
    own = tuple(name for name, given in (("gait", gait), ("controller", controller)) if given is not None)
    if gait is None:
        gait = _make_gait(scenario)
    # The plant first: its kernels are compiled while the controller is made.
    simulator = _make_plant(scenario, heavier(gait.robot, scenario.mass_error) if scenario.mass_error else gait.robot)
    chosen: Controller
    if controller is not None:
        chosen = controller(gait)
    else:
        chosen = make_controller(
            str(scenario.controller),
            gait,
            mu=scenario.mu,
            governor=scenario.governor,
            evaluate_at=scenario.evaluate_at,
            limits=scenario.limits,
            thrust=scenario.thrust,
            period=scenario.period,
            parameters=scenario.parameters if "gait" in own else _fitting(gait, scenario.parameters),
        )
    period = getattr(chosen, "period", scenario.period)
    if period != scenario.period:
        raise InputError(f"the controller's period {period:g} s is not the scenario's {scenario.period:g} s")
    q, v = start_of(gait, simulator.static_penetration)
    v[:6] += np.array(scenario.start_velocity)
    simulator.reset(q, v)
    delay = checks.multiple("delay", scenario.delay, "period", scenario.period, low=0)
    sensors = None
    if scenario.noise or delay > 0:
        sensors = Sensors(simulator.robot, scenario.noise, delay=delay, seed=scenario.seed)
    return Walk(scenario, gait, chosen, simulator, sensors, own)


def _make_gait(scenario: Scenario) -> Gait:
    """The gait of a scenario, with its robot."""
    if scenario.robot != "harpy":
        other = load_robot(scenario.robot)
        kinds: dict[str | None, type[Hovering | Standing | Stepping]]
        kinds = {"hovering": Hovering, "standing": Standing, "stepping": Stepping}
        return kinds[scenario.gait](other)
    robot = load_harpy(scenario.urdf)
    if scenario.gait != "commanded":
        return make_named_gait(robot, str(scenario.gait), speed=scenario.speed, stiffness=scenario.stiffness)
    command = scenario.command or ((0.0, scenario.speed, 0.0, 0.0),)
    return make_commanded_gait(robot, command, stiffness=scenario.stiffness)


def _fitting(gait: Gait, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Settings of a controller: those that fit the weight of a robot that stands or steps, then the ones given."""
    fitting: dict[str, Any] = getattr(gait, "parameters", {}) if isinstance(gait, Standing | Stepping) else {}
    merged = {**fitting, **given}
    for name in fitting.keys() & given.keys():
        if isinstance(fitting[name], Mapping) and isinstance(given[name], Mapping):
            merged[name] = {**fitting[name], **given[name]}
    return merged


def _make_plant(scenario: Scenario, robot: Robot) -> Plant:
    """The plant of a scenario, without a state."""
    if scenario.plant == "compliant":
        return Simulator(robot, scenario.ground, dt=scenario.dt)
    from harpy_pin.simulation.mujoco import MujocoPlant

    return MujocoPlant(robot, scenario.felt_ground, dt=scenario.dt)


def walk(
    scenario: Scenario,
    *,
    gait: Gait | None = None,
    controller: Callable[[Gait], Controller] | None = None,
    on_tick: Callable[[State], None] | None = None,
    metadata: Mapping[str, object] | None = None,
    save: str | Path | None = None,
) -> Run:
    """Walk a scenario.

    Args:
        scenario: what to walk; saved as ``run.metadata["scenario"]``.
        gait: see :func:`build`.
        controller: see :func:`build`.
        on_tick: called with the true state at each tick, before the controller.
        metadata: more entries for the log's metadata.
        save: file of the log, on disk while the walk goes on; see :meth:`harpy_pin.simulation.plant.Plant.run`.

    Returns:
        The log; it ends early if the robot falls.

    Raises:
        InputError: see :func:`build`.
        RobotError: see :func:`build`.
        ControlError: the controller failed; ``error.run`` holds the log so far.
        RunFileError: the log cannot be written; ``error.run`` holds it if there is one.
        Interrupted: Ctrl-C; ``error.run`` holds the log so far.
    """
    return build(scenario, gait=gait, controller=controller).run(on_tick=on_tick, metadata=metadata, save=save)


def _plain(value: Any) -> Any:
    """Mappings, lists, numbers and names as JSON has them, with its own memory; NumPy's become Python's."""
    return json.loads(json.dumps(value, allow_nan=False, default=lambda other: other.tolist()))


def _known(kind: type, what: str, data: Any) -> dict[str, Any]:
    """The entries of a mapping, all of them attributes of a dataclass."""
    if not isinstance(data, Mapping):
        raise InputError(f"{what} must be a mapping, got {data!r}", name=what, value=data)
    valid = [entry.name for entry in fields(kind)]
    for name in data:
        checks.one_of(f"entry of the {what}", name, valid)
    return dict(data)


def _read(kind: type[_Record], what: str, data: Any) -> _Record:
    """A dataclass from a mapping of its attributes."""
    try:
        return kind(**_known(kind, what, data))
    except TypeError as error:
        raise InputError(f"{what}: {error}", name=what, value=data) from None
