"""Options of ``harpy walk`` that say what is walked, by the parts of a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harpy_pin import checks
from harpy_pin.cli.output import JsonOption, UrdfOption
from harpy_pin.cli.terrain_option import TerrainOption, terrain_of
from harpy_pin.deprecated import new_value
from harpy_pin.errors import InputError

if TYPE_CHECKING:
    from harpy_pin.scenario import Disturbances, Part
    from harpy_pin.simulation.ground import Ground
    from harpy_pin.simulation.push import Push

__all__ = [
    "ORDER",
    "ControllerOptions",
    "DisturbanceOptions",
    "GaitOptions",
    "GroundOptions",
    "OutputOptions",
    "PlantOptions",
    "SimulationOptions",
    "read_command",
]

ORDER = (
    *(
        "robot",
        "controller",
        "governor",
        "evaluate_at",
        "legs",
        "friction",
        "ice",
        "slope",
        "terrain",
        "assumed_friction",
    ),
    *("gait", "speed", "command", "schedule", "duration", "dt", "limits", "thrust"),
    *("govern_command", "estimate_friction", "cone", "stiffness", "assumed_stiffness", "plant", "plant_preset"),
    *("push", "mass_error", "noise", "delay", "perturbation", "seed", "urdf", "again", "save", "json", "profile"),
)
"""The options as the help lists them."""
OF_THE_GOVERNED = {"governor", "evaluate_at", "legs", "limits", "thrust"}
"""Options that only the governed controller has: with one of them it walks, if no other controller is named."""
SETTINGS = {
    "assumed_friction": "mu",
    "no_thrust": "thrust",
    "command": "velocity",
    "assumed_stiffness": "stiffness",
    "plant_preset": "preset",
}
"""Settings of parts that have another name than the option."""


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """The robot, and how it is simulated."""

    robot: Annotated[
        str, typer.Option(help="harpy, or a robot that `harpy robots` lists: it walks, stands, or hovers.")
    ] = "harpy"
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 6.0
    dt: Annotated[float, typer.Option(help="Physics step, s.")] = 5e-4
    urdf: UrdfOption = None


@dataclass(frozen=True, kw_only=True)
class ControllerOptions:
    """The controller of the scenario."""

    controller: Annotated[
        str | None,
        typer.Option(
            help="condensed (whole-body QP in the contact forces), wbc (whole-body QP), or governed (joint PID).  "
            "[default: condensed; governed with one of its options]",
            show_default=False,
        ),
    ] = None
    governor: Annotated[
        str | None,
        typer.Option(
            help="Governor of the governed controller: none, paper, cone, or filter.  [default: paper]",
            show_default=False,
        ),
    ] = None
    evaluate_at: Annotated[
        str | None,
        typer.Option(
            "--evaluate-at",
            "--reading",
            help="Where the paper's governor evaluates its constraints: measured (state) or tracked (reference).  "
            "[default: measured]",
            show_default=False,
        ),
    ] = None
    legs: Annotated[
        str,
        typer.Option(
            help="Leg control of the governed controller: pid (the paper's), or feedforward (survives 3 ms of delay)."
        ),
    ] = "pid"
    assumed_friction: Annotated[
        float | None, typer.Option(help="Friction coefficient the controller assumes; the ground's by default.")
    ] = None
    limits: Annotated[
        bool,
        typer.Option(
            "--limits",
            help="Clip the governed controller to the motors' and thrusters' limits (the others always respect them).",
        ),
    ] = False
    thrust: Annotated[
        bool, typer.Option("--thrust/--no-thrust", help="Whether the governed controller has its thrusters.")
    ] = True
    govern_command: Annotated[
        bool,
        typer.Option(
            "--govern-command",
            help="wbc and condensed: shift footholds and slow down where the ground is too slippery for that velocity.",
        ),
    ] = False
    estimate_friction: Annotated[
        bool,
        typer.Option(
            "--estimate-friction", help="Estimate the friction from measured forces and slip, below what is assumed."
        ),
    ] = False

    def part(self, given: Sequence[str]) -> dict[str, object]:
        """The controller; ``given`` are the names of the options that the user gave."""
        from harpy_pin.scenario import CONTROLLER_PARTS

        name = new_value("controller", self.controller or ("governed" if OF_THE_GOVERNED & {*given} else "condensed"))
        if self.assumed_friction is not None:
            checks.number("assumed_friction", self.assumed_friction, low=0.0, high=checks.MAX_FRICTION)
        if self.govern_command and name == "governed":
            raise InputError("--govern-command is for the controllers 'wbc' and 'condensed'", name="govern_command")
        none = self.governor == "none" and name != "governed"  # which is what the others have
        part = _part(
            "controller",
            CONTROLLER_PARTS,
            name,
            assumed_friction=self.assumed_friction,
            governor=None if none else self.governor,
            evaluate_at=self.evaluate_at,
            limits=self.limits or None,
            no_thrust=None if self.thrust else False,
        )
        parameters: dict[str, object] = {"legs": self.legs} if "legs" in given else {}
        parameters |= {key: True for key in ("govern_command", "estimate_friction") if getattr(self, key)}
        return part | {"parameters": parameters}


@dataclass(frozen=True, kw_only=True)
class GaitOptions:
    """The gait of the scenario."""

    gait: Annotated[
        str | None,
        typer.Option(
            help="Of Harpy: hand (few parameters, tuned), optimised (found in the plane), paper-curves, commanded, or "
            "flying (a jump). Of other robots: walking, stepping (in place), standing, or hovering.  "
            "[default: the first that it has]",
            show_default=False,
        ),
    ] = None
    speed: Annotated[
        float | None,
        typer.Option(
            help="Speed forward, m/s; at 0 the robot stands.  [default: 0.3; 0.15 on flat feet]", show_default=False
        ),
    ] = None
    command: Annotated[
        str | None,
        typer.Option(
            metavar="VX VY W; Ts VX VY W",
            help="Velocity from each time on: forward, sideways (m/s), turning (rad/s); wbc and condensed.",
        ),
    ] = None
    schedule: Annotated[
        str | None,
        typer.Option(help="Of the gait walking: trot, crawl, pace or bound on four feet; walk or step on two."),
    ] = None
    assumed_stiffness: Annotated[
        float | None, typer.Option(help="Stiffness that the walk is made for, N/m; the ground's by default.")
    ] = None

    def part(self, robot: str) -> dict[str, object]:
        """The gait; by default the robot's first one, or for Harpy with a velocity command the commanded one."""
        from harpy_pin.scenario import GAIT_PARTS, gaits_of
        from harpy_pin.scenario.gait_parts import schedules_of, why_not

        default = "commanded" if self.command is not None and robot == "harpy" else gaits_of(robot)[0]
        name = default if self.gait is None else self.gait
        if self.schedule is not None and robot == "harpy" and name in GAIT_PARTS:
            raise InputError("Harpy has no schedules; give --robot", name="schedule", value=self.schedule)
        told = self.speed is not None or self.command is not None or self.schedule is not None
        if told and self.gait is None and (why := why_not(robot, "walking")):
            raise InputError(f"{why}: it stands", name="robot", value=robot)
        if self.schedule is not None and name == "walking":
            checks.one_of(f"schedule of '{robot}'", self.schedule, schedules_of(robot))
        if self.speed is not None and self.command is not None:
            raise InputError("give --speed or --command, not both", name="speed", value=self.speed)
        speed = self.speed
        velocity: object = None if self.command is None else read_command(self.command)
        if name in ("commanded", "walking") and velocity is None and speed is not None:
            velocity, speed = (speed, 0.0, 0.0), None
        return _part(
            "gait",
            GAIT_PARTS,
            name,
            speed=speed,
            command=velocity,
            schedule=self.schedule,
            assumed_stiffness=self.assumed_stiffness,
        )


@dataclass(frozen=True, kw_only=True)
class GroundOptions:
    """The ground of the scenario."""

    friction: Annotated[
        float,
        typer.Option(
            help="Static friction coefficient; sliding friction is 0.9 of it. (hp.Scenario() has 0.25 by default.)"
        ),
    ] = 0.8
    ice: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FROM:TO:MU", help="A strip of ground from x to x, m, with another static friction; repeatable."
        ),
    ] = None
    slope: Annotated[
        float,
        typer.Option(
            metavar="DEGREES", help="Angle by which the ground rises along x, degrees; it falls where negative."
        ),
    ] = 0.0
    terrain: TerrainOption = None
    cone: Annotated[str, typer.Option(help="Friction cone: circular, or per_axis as in the paper.")] = "circular"
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the ground, N/m, with the paper's damping ratio.  [default: 8000; another robot that "
            "walks: its weight over 2 mm; that stands: so much that it sinks in by 5 mm]",
            show_default=False,
        ),
    ] = None

    def part(self, robot: str, *, walks: bool) -> Ground:
        """The ground. Without a stiffness Harpy's is the paper's, and that of other robots fits their weight.

        Args:
            robot: its name.
            walks: whether it walks.
        """
        from harpy_pin.simulation.ground import Ground
        from harpy_pin.simulation.resting import fitting_stiffness
        from harpy_pin.simulation.terrain.plane import STEEPEST

        steepest = math.floor(math.degrees(STEEPEST))
        slope = checks.number("slope, in degrees,", self.slope, low=-steepest, high=steepest)
        stiffness = fitting_stiffness(robot, walks) if self.stiffness is None else self.stiffness
        return Ground(
            stiffness=8000.0 if stiffness is None else stiffness,
            mu_s=self.friction,
            cone="per_axis" if self.cone == "per_axis" else "circular",
            friction_strips=tuple(sorted(_read_strip(text) for text in self.ice or ())),
            slope=math.radians(slope),
            terrain=terrain_of(self.terrain),
        )


@dataclass(frozen=True, kw_only=True)
class PlantOptions:
    """The physics engine of the scenario."""

    plant: Annotated[
        str, typer.Option(help="Physics engine: compliant (the library's own), mujoco or drake (extras).")
    ] = "compliant"
    plant_preset: Annotated[
        str | None,
        typer.Option(
            help="MuJoCo's contact relative to the ground: soft (the same; default), overdamped, or stiff; or its own: "
            "default, elliptic, or menagerie."
        ),
    ] = None

    def part(self) -> dict[str, object]:
        """The physics engine."""
        from harpy_pin.scenario import PLANT_PARTS

        return _part("plant", PLANT_PARTS, self.plant, plant_preset=self.plant_preset)


@dataclass(frozen=True, kw_only=True)
class DisturbanceOptions:
    """What disturbs the walk."""

    push: Annotated[
        list[str] | None,
        typer.Option(metavar="TIME:X,Y,Z", help="Push the body at this time, s, by an impulse, N·s; repeatable."),
    ] = None
    mass_error: Annotated[
        float,
        typer.Option(help="Relative error of the body's mass: 0.2 means 20 % heavier than the controller assumes."),
    ] = 0.0
    noise: Annotated[
        float,
        typer.Option(
            metavar="SCALE",
            help="Measurement noise as a multiple of: joints 0.5 mrad, 20 mrad/s; body 2 mm, 2 mrad, 10 mm/s, "
            "5 mrad/s; foot forces 0.5 N.",
        ),
    ] = 0.0
    delay: Annotated[float, typer.Option(help="Delay of the controller's measurements, s; whole milliseconds.")] = 0.0
    perturbation: Annotated[
        float, typer.Option(help="Standard deviation of a random change of the start velocity, m/s and rad/s.")
    ] = 0.0
    seed: Annotated[int, typer.Option(help="Seed of the perturbation and the noise.")] = 0

    def part(self) -> Disturbances:
        """The disturbances, with a random change of the start velocity."""
        from harpy_pin.scenario import Disturbances
        from harpy_pin.simulation.sensors import Noise

        return Disturbances(
            pushes=tuple(_read_push(text) for text in self.push or ()),
            noise=Noise.typical(self.noise),
            delay=self.delay,
            mass_error=self.mass_error,
            start_velocity=_draw_start(self.perturbation, self.seed),
            seed=self.seed,
        )


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """What is done with the walk; none of this belongs to the scenario."""

    again: Annotated[
        Path | None, typer.Option(metavar="RUN.npz", help="Walk the scenario of this log again, with no other options.")
    ] = None
    save: Annotated[Path | None, typer.Option(metavar="FILE.npz", help="Write the log of the run.")] = None
    json: JsonOption = None
    profile: Annotated[bool, typer.Option("--profile", help="Also show where the time goes.")] = False


def _part(what: str, kinds: Mapping[str, type[Part]], name: str, **options: object) -> dict[str, object]:
    """A part of the scenario from the options that were given; those with None were not.

    Args:
        what: the part is.
        kinds: class of each name.
        name: of the part.
        options: by their names on the command line.

    Raises:
        InputError: an unknown name, or an option that the part does not have.
    """
    from harpy_pin.scenario.parts import check_part_name

    check_part_name(kinds, what, name)
    given = {option: value for option, value in options.items() if value is not None}
    has = {entry.name for entry in fields(kinds[name])}
    for option in given:
        if SETTINGS.get(option, option) not in has:
            option = option.replace("_", "-")
            raise InputError(f"--{option} is not for the {what} '{name}'", name=option)
    return {"name": name, **{SETTINGS.get(option, option): value for option, value in given.items()}}


def _draw_start(perturbation: float, seed: int) -> tuple[float, ...]:
    """A random change of the start velocity."""
    import numpy as np

    spread = checks.number("perturbation", perturbation, low=0.0, high=100.0)
    if spread == 0.0:
        return (0.0,) * 6
    return tuple((spread * np.random.default_rng(checks.whole("seed", seed)).standard_normal(6)).tolist())


def _read_push(text: str) -> Push:
    """A push from ``TIME:X,Y,Z``."""
    from harpy_pin.simulation.push import Push

    time, _, impulse = text.partition(":")
    try:
        x, y, z = (float(part) for part in impulse.split(","))
        return Push(float(time), (x, y, z))
    except InputError:
        raise
    except ValueError:
        raise InputError(f"a push must look like TIME:X,Y,Z (s and N·s), got '{text}'", name="push") from None


def read_command(text: str) -> tuple[tuple[float, float, float, float], ...]:
    """The rows of a velocity command from ``VX VY W; Ts VX VY W; ...``; the first one may leave its time out."""
    rows: list[tuple[float, float, float, float]] = []
    for part in text.split(";"):
        words = part.split()
        if len(words) == 3 and not rows:
            words = ["0s", *words]
        try:
            if not words[0].endswith("s"):
                raise ValueError
            t, forward, sideways, turning = float(words[0][:-1]), *(float(word) for word in words[1:])
        except (IndexError, ValueError):
            message = f"a command must look like 'VX VY W; Ts VX VY W' (m/s, m/s, rad/s), got '{part.strip()}'"
            raise InputError(message, name="command", value=text) from None
        rows.append((t, forward, sideways, turning))
    return tuple(rows)


def _read_strip(text: str) -> tuple[float, float, float]:
    """A strip of ground from ``FROM:TO:MU``."""
    try:
        begin, end, mu = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"ice must look like FROM:TO:MU (m, m and a coefficient), got '{text}'", name="ice") from None
    return begin, end, mu
