"""A walk that follows a velocity command: forward, sideways and turning, which may change at any
time.

It is no :class:`~harpy_pin.gaits.walking.WalkingGait` with Harpy's numbers, because Harpy's
thrusters carry its body along the path by the clock: that one steps as a body on two points without
thrusters has to, and at friction 0.25 goes half as far, does not turn, and slips three times as far
per metre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import two_legs
from harpy_pin.gaits.steering import advance, restart
from harpy_pin.gaits.straight import (
    TUNED_STIFFNESS,
    StepParameters,
    penetration_offset_on,
    tuned_parameters,
)
from harpy_pin.gaits.velocity import FollowsVelocity, Velocity, VelocityRecord, largest
from harpy_pin.ground.surface import TerrainRecord, flat_terrain
from harpy_pin.ground.terrain import Terrain
from harpy_pin.kernels.calls import Call
from harpy_pin.model.kinematics import leg_inverse, leg_inverse_kinematics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

HALVINGS = 10
"""How often the range of the legs' reach is halved: to less than a millimetre."""


@dataclass(frozen=True, kw_only=True)
class CommandedParameters(StepParameters):
    """Rhythm and shape of the steps, see :class:`~harpy_pin.gaits.straight.StepParameters`, and how
    fast it changes.

    Attributes:
        acceleration: largest change of the applied velocity, m/s².
        turn_acceleration: largest change of the applied turning velocity, rad/s².
        max_turn: largest turning velocity, rad/s.
        feet_apart: least distance to the side between a foothold and the other foot, m.
        frozen: share of a swing after which the foothold stays where it is.
        settled: how far a foot may be from where it stands, for the walk to end, m.
        spare: how much of the legs' reach is never asked for, m.
    """

    acceleration: float = checks.setting(0.4, low=0.0, high=100.0, strict=True)
    turn_acceleration: float = checks.setting(0.8, low=0.0, high=100.0, strict=True)
    max_turn: float = checks.setting(1.0, low=0.0, high=100.0, strict=True)
    feet_apart: float = checks.setting(0.1, low=0.0, high=1.0)
    frozen: float = checks.setting(0.75, low=0.0, high=1.0)
    settled: float = checks.setting(5e-3, low=0.0, high=100.0, strict=True)
    spare: float = checks.setting(0.02, low=0.0, high=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number("double_support", self.double_support, low=0.01)
        checks.number("width", self.width, low=0.5 * self.feet_apart, strict=True)


class CommandedRecord(VelocityRecord, CommandedParameters):
    """What the walk of :class:`CommandedGait` remembers, besides its parameters."""

    terrain: TerrainRecord  # the ground, on whose edges no foot is set
    # sway (m) and its velocity (m/s) at the end of the last walk, and the time in which they go, s
    leftover: Vector = sized(3)
    foot: Vector = sized(2, 2)  # x and y of each foot's target, world, m
    foot_velocity: Vector = sized(2, 2)  # of each foot's target, m/s
    foothold: Vector = sized(2, 2)  # where each foot lands, m
    in_air: Vector = sized(2)  # 1 for a swing foot, else 0
    left: Vector = sized(2)  # time until it lands, s
    time: float = 0.0  # of the last update, s
    phase: float = 0.0  # of the walk in steps, 0 to 2
    walking: float = 0.0  # 1 while steps are made, else 0
    begun: float = 0.0  # share of the first step that is done


@fixed_arrays("applied", "command", "record")
class CommandedGait(FollowsVelocity):
    """Targets of a walk of Harpy's kind of biped that follows a velocity command.

    The command is (forward, sideways to the left, turning to the left), in m/s and rad/s, in the
    frame of the heading. It begins standing at the origin, and ends standing: at zero command the
    walk slows down, places its feet side by side, and stops in a double support.

    The velocity that is applied follows the command at bounded acceleration. A command is scaled
    down as a whole where its velocity is above :attr:`most_speed` (turning counts by ``width``:
    \\|v\\| + \\|ω\\| width), sideways above :attr:`most_sideways`, or its turning above
    ``max_turn``. One that holds NaN or infinity is ignored: the last finite one is kept, and
    :attr:`refused` counts the updates.

    It is a gait with memory, for one controller, in one thread: :meth:`update` goes on from the
    last time to the next. Time zero, or one that is more than a step before the last, begins the
    walk anew; one that is less before it, as of a clock that jitters, changes nothing.

    Args:
        robot: a biped with Harpy's kind of legs, left foot first.
        velocity: the command; or rows of a script, (t, forward, sideways, turning), each valid from
            its time, s, on; or a function from the time to these three.
        parameters: rhythm and shape of the steps.

    Attributes:
        command: (3,) the present command; set it while the robot walks, ``gait.command = (0.3, 0.0,
            0.0)``. The next row of a script overwrites it. Where a function gives the command it is
            read only.
        applied: (3,) the velocity that is applied; read only.
        record: all that the walk remembers, for kernels.
        most_speed: m/s; what the legs reach, see :meth:`_speeds`.
        most_sideways: m/s; faster, a foot would land closer than ``feet_apart`` to the other.

    Raises:
        InputError: the robot is no biped, the velocity is none, or the legs do not reach so far as
            to stand and turn.
    """

    not_governed = "faces x and cannot turn"
    _advance = advance

    @checked
    def __init__(
        self,
        robot: Robot,
        velocity: Velocity = (0.0, 0.0, 0.0),
        parameters: CommandedParameters | None = None,
    ) -> None:
        super().__init__(robot)
        self.geometry = two_legs(robot)
        self.controller_parameters = tuned_parameters(robot)
        self.parameters = p = parameters if parameters is not None else CommandedParameters()
        self.step_duration, self.double_support = p.step_duration, p.double_support
        self.most_speed, self.most_sideways = self._speeds()
        self.record = make_record(
            CommandedRecord,
            {"entries": 3},
            **asdict(p),
            radius=p.width,
            max_speed=self.most_speed,
            max_aside=self.most_sideways,
            max_bend=inf,
            terrain=flat_terrain(),
        )
        self._follow(velocity, self._record_, self._record_)
        restart.prepare(self._record_)
        advance.prepare(0.0, self._record_, self.target._record_)
        self._begin()

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.calls`; Python takes a script's rows."""
        if type(self) is not CommandedGait or self._function is not None:
            return None
        return (Call(advance, 0.0, self._record_, self.target._record_, expected=True),)

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`; the walk's memory stays as it
        is.
        """
        p, q = self.parameters, self.robot.neutral
        done = 0.5 * p.double_support / (1.0 + p.double_support)
        depth = p.height + p.penetration_offset * (1.0 - (1.0 - done) ** 4 - done**4)
        q[2] = depth - penetration
        for k, geometry in enumerate(self.geometry):
            foot = (0.0, p.width * (1.0 - 2.0 * k), -depth)
            q[7 + 3 * k : 10 + 3 * k] = leg_inverse_kinematics(geometry, foot)
        return q, np.zeros(self.robot.nv)

    @checked
    def expect_terrain(self, terrain: Terrain, *, reach: float) -> bool:
        """See :meth:`~harpy_pin.gaits.gait.Gait.expect_terrain`; no foot is set on edges."""
        self._record_["terrain"] = terrain.record
        return False

    def describe(self) -> Mapping[str, Any]:
        """Parameters, limits and script, for the log's metadata."""
        return {
            **asdict(self.parameters),
            "most_speed": self.most_speed,
            "most_sideways": self.most_sideways,
            "command": [[t, *command.tolist()] for t, command in self.script],
        }

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The command, the velocity that is applied, the target's heading, and how many commands
        were refused.
        """
        return {
            "command": self.command,
            "applied_velocity": self.applied,
            "heading": self.target.heading,
            "refused_commands": field(self._record_, "refused"),
        }

    def _begin(self) -> None:
        restart(self._record_)
        super()._begin()

    def _take_row(self) -> None:
        """The walk goes on to the time of the row by the command before."""
        switch, self._switch[0] = float(self._switch[0]), inf
        self._go_on(switch)
        super()._take_row()

    def _speeds(self) -> tuple[float, float]:
        """Largest velocity, and largest sideways, m/s.

        Seen from the body, a stance foot moves by |v| + |ω| width at most, for half a stance to
        either side of where it stands. To this come the sway, and the body's motion that was
        unknown when the foothold was fixed: a (f + h)²/2 at most, where a is the acceleration, h
        half a stance, and f the end of the swing.
        """
        p = self.parameters
        half = 0.5 * p.step_duration * (1.0 + p.double_support)
        late = (1.0 - p.frozen) * p.step_duration * (1.0 - p.double_support)
        acceleration = p.acceleration + p.turn_acceleration * p.width
        unforeseen = 0.5 * acceleration * (half + late) ** 2
        speed = (_reach(self.robot, p) - p.spare - p.sway - unforeseen) / half
        if speed <= 0.0:
            raise InputError("this gait is out of the robot's reach", name="gait")
        return speed, (2.0 * p.width - p.feet_apart) / p.step_duration


@checked
def make_commanded_gait(
    robot: Robot, velocity: Velocity = (0.0, 0.0, 0.0), *, stiffness: float = TUNED_STIFFNESS
) -> CommandedGait:
    """The default commanded walk of a robot.

    Args:
        robot: a biped of Harpy's kind.
        velocity: to follow, see :class:`CommandedGait`.
        stiffness: of the ground that the walk is for, N/m, see
            :func:`~harpy_pin.gaits.straight.make_gait`.

    Raises:
        InputError: a value out of its domain, or a ground so soft that the feet cannot reach so
            deep.
    """
    return CommandedGait(
        robot,
        velocity,
        CommandedParameters(penetration_offset=penetration_offset_on(robot, stiffness)),
    )


@lru_cache(maxsize=32)
def _reach(robot: Robot, p: CommandedParameters) -> float:
    """Radius of the largest circle on the ground around where a foot stands that its leg reaches,
    m.

    At the height of mid-swing half of it must be in reach.
    """
    geometry, lower, upper, angles = (
        two_legs(robot),
        robot.joint_lower,
        robot.joint_upper,
        np.empty(3),
    )

    def reached(k: int, x: float, y: float, z: float) -> bool:
        inside = leg_inverse(geometry[k].record, np.array((x, y, z)), angles) <= 1e-12
        joints = slice(3 * k, 3 * k + 3)
        return bool(inside and np.all(angles >= lower[joints]) and np.all(angles <= upper[joints]))

    def circle(radius: float) -> bool:
        return all(
            reached(
                k,
                share * radius * np.cos(angle),
                side * p.width + share * radius * np.sin(angle),
                z - p.height,
            )
            for k, side in enumerate((1.0, -1.0))
            for share, z in ((1.0, -p.penetration_offset), (0.5, p.clearance))
            for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        )

    return largest(circle, p.height, halvings=HALVINGS)
