"""A walk of any robot with two, four or six feet that follows a velocity command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import GRAVITY, fitting_parameters
from harpy_pin.gaits.gait import LONGEST, GaitTarget, Unobserved, refuse_time
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.velocity import FollowsVelocity, Velocity, warn_maker
from harpy_pin.gaits.walking.build import (
    BY_FEET,
    Build,
    Pace,
    build_of,
    draw_together,
    groups_of,
    pace_of,
    why_no_walk,
)
from harpy_pin.gaits.walking.footholds import APART
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.pendulum import NEAR, SETTLE, STRAIGHT_NEAR
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.gaits.walking.rolling import soles_of
from harpy_pin.gaits.walking.tick import advance
from harpy_pin.ground.surface import flat_terrain
from harpy_pin.kernels.calls import Call
from harpy_pin.model.entry import as_state
from harpy_pin.model.legs import legs
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import SOLE_JOINTS, Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.model.tree import tree_record

FULL_GRIP, SLOWEST = 0.6, 0.07
"""Friction coefficient from which on a robot on soles walks at its largest speed; below, at a share
of it, but at this speed at least, in √(g leg).
"""
SLIPPERY, FIRM = 0.1, 0.2
"""Friction coefficients between which a robot on soles steps more and more as on firm ground. Where
it is slippery its feet stand close to each other, so that it sways less. They hand over the load
quickly, because that is when they slip.
"""
CLOSE, SWIFT = 0.025, 0.05
"""There: distance between the two soles, m, and share of a step in which both are on the ground."""
START = 1.6
"""Time for which it stands on every foot before the first step, in √(leg / g)."""
CLEARANCE = 0.075
"""Height of a foot at mid-swing, in lengths of the leg."""
OFFSET = 0.0015
"""How much deeper than the ground a swing foot aims, m."""
ACCELERATION, TURN_ACCELERATION = 1.0, 3.0
"""Largest change of the applied velocity, m/s², and so of its direction in a turn; and of the
turning one, rad/s².
"""
ASIDE, SHIFT = 0.117, 0.012
"""On two soles: largest velocity sideways, in √(g leg), and how far a change of velocity to the
side may move a foothold towards the other foot, m: beyond, it would have to land on that.
"""
MOST_TURN = 2.0
"""Largest turning velocity, rad/s."""
SWAY = 0.01
"""Distance of two groups of feet below which the body does not sway between them, in heights of the
centre of mass.
"""
LEAN, STEEPEST = 0.45, 0.5
"""On two points: distance of the centre of mass from the stance foot at which the next one should
land, and largest distance of a foothold, in heights of the centre of mass. Of a pendulum it is the
friction that it needs.
"""
LOW, AIM = 0.02, 0.2
"""In trots and paces, height from which on a foot goes down slowly, in clearances, and how far
below the ground it then aims, as a share of the penetration offset. A foot that lands hard slips:
inertia of its leg turns it aside.
"""
LOAD_RAMP, FAST_LOAD_RAMP = 0.26, 0.4
"""In trots and paces, share of its largest normal force up to which a foot is loaded that is about
to take over its part of the load, or begins to give it away, slow and at the largest speed; in
other walks, all of it at once.
"""
LOADED, MIN_LOADED = 0.03, 0.6
"""Normal force from which on a foot touches the ground, as a share of its load when standing, and
least, N.
"""


@fixed_arrays("applied", "command", "record")
class WalkingGait(FollowsVelocity):
    """Targets of a robot on two, four or six feet that follows a velocity command.

    It needs the measured state: controllers of this library call :meth:`observe` before each
    :meth:`update`. All settings follow from the robot's mass, legs, feet and standing posture.

    The command is (forward, to the left, turning to the left), in m/s and rad/s, in the frame of
    the heading, and may have a change of the body's height, m, as its fourth number. Change it at
    any tick: ``gait.command[:3] = (0.3, 0, 0)``. One beyond what the robot can do is scaled down as
    a whole; one that is not finite is ignored, and the last finite command is kept. At zero command
    the robot stops and stands; it steps when it is pushed so far that its capture point leaves the
    feet. A robot on two point feet cannot stand, and steps all the time; its heading is the
    measured one, because point feet hold nothing about the vertical.

    It is a gait with memory, for one controller, in one thread. It begins in its posture, at rest.
    Time zero, or a time that is more than a step before the last, begins anew.

    Args:
        robot: with two, four or six feet, points or flat ones.
        schedule: ``trot``, ``crawl``, ``pace`` or ``bound`` on four feet; ``walk``, or ``step`` to
            go on stepping at zero command, on two; ``tripod`` on six; ``stand``. By default the
            first one.
        velocity: the command; or rows of a script, (t, forward, to the left, turning[, height]),
            each valid from its time, s, on; or a function from the time to the command.
        posture: (joints,) angles in which it stands, rad; by default as of :class:`Standing`.
        clearance: height of a foot at mid-swing, m.
        max_speed: largest velocity of a foot's place, m/s; by default what legs can reach and
            motors can hold and swing, √(g leg) at most.

    Attributes:
        step_duration: of a slow walk, s.
        double_support: share of a step in which every foot is on the ground.
        command: (4,) the present command; set it in place.
        applied: (4,) the velocity that is applied, of the height m/s; read only.
        schedule: its name.
        limited_by: what :attr:`max_speed` is not larger for, in words, such as ``the torques of its
            motors``.
        record: all that it knows and remembers, for kernels.
        target: of the last update.
        script: rows (t, command).

    Raises:
        InputError: values out of their domains, an unknown schedule, another number of feet, or
            legs that cannot walk.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        schedule: str | None = None,
        velocity: Velocity = (0.0, 0.0, 0.0),
        *,
        posture: ArrayLike | None = None,
        clearance: float | None = None,
        max_speed: float | None = None,
    ) -> None:
        feet = len(robot.corners)
        if feet not in BY_FEET:
            raise InputError(
                f"the gait needs two, four or six feet; '{robot.name}' has {feet}", name="robot"
            )
        super().__init__(robot)
        self._standing = Standing(robot, posture)
        q, v = self._standing.initial_state()
        build, soles = build_of(robot, q), bool(robot.flat_feet)
        natural = float(np.sqrt(build.leg / GRAVITY))

        def optional(name: str, value: float | None, high: float) -> float | None:
            return (
                None
                if value is None
                else checks.number(name, value, low=0.0, high=high, strict=True)
            )

        self.schedule = next(iter(BY_FEET[feet])) if schedule is None else schedule
        if self.schedule != "stand" and (why := why_no_walk(robot)):
            raise InputError(why, name="robot")
        if (
            feet == 2
            and not soles
            and (most_joints := max(len(leg.joints) for leg in legs(robot))) >= SOLE_JOINTS
        ):
            warn_maker(
                f"'{robot.name}' has points as feet on legs of {most_joints} joints: flat_feet "
                f"makes them soles"
            )
        clearance = optional("clearance", clearance, build.leg) or CLEARANCE * build.leg
        group = groups_of(self.schedule, build.place[:, :2] - build.place[:, :2].mean(axis=0))
        most = optional("max_speed", max_speed, 20.0)
        pace, self.limited_by = pace_of(robot, q, build, group, clearance, max_speed=most)
        self._build, self._pace, self._chosen_speed = build, pace, max_speed is not None
        self.step_duration, self.double_support = pace.usual_step, pace.fast_double_support
        self.record: Records[WalkingRecord] = self._make_record(
            build,
            pace,
            group,
            start_time=0.0 if feet == 2 and not soles else START * natural,
            clearance=clearance,
        )
        self._measured = self._record_["measured"]
        self._follow(velocity)
        self.controller_parameters = fitting_parameters(robot, leg=build.leg, rise=build.rise)
        self._begin()
        measure.prepare(self._record_, q, v, np.zeros((len(robot.feet), 3)))
        advance.prepare(0.0, self._record_, self.target._record_)

    def _make_record(
        self, build: Build, pace: Pace, group: NDArray[np.int64], **settings: float
    ) -> Records[WalkingRecord]:
        """The record of a robot of this build that stands."""
        robot, feet, soles = self.robot, len(build.place), bool(self.robot.flat_feet)
        frames = [robot.model.frames[robot.frame_id(name)] for name in robot.feet]
        nominal = build.place[:, :2] - build.place[:, :2].mean(axis=0)
        groups, gentle = int(group.max()) + 1, pace.gentle
        balances = feet == 2 and not soles and groups == 2
        sways = groups == 2 and draw_together(nominal, group, build.narrow) > SWAY * build.rise
        known, omega = {**vars(build), **vars(pace)}, float(np.sqrt(GRAVITY / build.rise))
        max_aside, aside = np.inf, ACCELERATION
        if balances:
            max_aside = (1.0 - APART) * float(np.ptp(nominal[:, 1])) / pace.usual_step
        elif feet == 2 and groups == 2:
            max_aside = ASIDE * float(np.sqrt(GRAVITY * build.leg))
            aside = SHIFT * float(np.expm1(omega * pace.usual_step)) / pace.usual_step**2
        self._max_aside = max_aside  # on firm ground
        if balances:
            known["reach"] = min(build.reach, STEEPEST * build.rise)
        corner = (build.point - build.place[build.foot])[:, :2]
        own, askew = soles_of(corner, build.foot)
        return make_record(
            WalkingRecord,
            {"feet": feet, "entries": 4},
            tree=tree_record(robot.model),
            terrain=flat_terrain(),
            steps_over=np.int64(0),
            ground_reach=0.0,
            point_body=np.array([frame.parentJoint - 1 for frame in frames], dtype=np.int64),
            point_offset=np.array([frame.placement.translation for frame in frames]),
            corner=corner,
            own=own,
            askew=askew,
            facing=robot.facing,
            group=group,
            groups=np.int64(groups),
            nominal=nominal,
            middle=(middle := np.array([nominal[group == g].mean(axis=0) for g in range(groups)])),
            spread=nominal - middle[group],
            sways=np.int64(sways),
            step_duration=pace.usual_step,
            double_support=pace.slow_double_support,
            penetration_offset=OFFSET,
            low=LOW * settings["clearance"] if gentle else 0.0,
            deeper=(AIM if gentle else 1.0) * OFFSET,
            fast_load_ramp=FAST_LOAD_RAMP if gentle else 1.0,
            slow_load_ramp=LOAD_RAMP if gentle else 1.0,
            omega=omega,
            arrives=1.0 - SETTLE
            if soles
            else (NEAR if gentle else STRAIGHT_NEAR)
            if feet > 2
            else 0.0,
            lean=LEAN * build.rise if balances else np.inf,
            max_aside=max_aside,
            touch_force=max(LOADED * robot.mass * GRAVITY / feet, MIN_LOADED),
            acceleration=np.array((ACCELERATION, aside)),
            turn_acceleration=TURN_ACCELERATION,
            max_turn=MOST_TURN,
            max_bend=aside,
            radius=np.hypot(*nominal.T).max(),
            height_range=np.array((-0.2, 0.05)) * build.height,
            always=np.int64(self.schedule == "step" or balances),
            holds_heading=np.int64(soles or feet > 2),
            soles=np.int64(soles),
            **settings,
            **known,
            measured=make_record(MeasuredRecord, {"feet": feet, "points": len(robot.feet)}),
        )

    def __repr__(self) -> str:
        forward, left, turning = self.command[:3].tolist()
        command = f"{forward:g}, {left:g} m/s, {turning:g} rad/s"
        return f"WalkingGait('{self.robot.name}', {self.schedule}, {command})"

    @property
    def max_speed(self) -> float:
        """Largest velocity of a foot's place, m/s: a command beyond it is scaled down."""
        return float(self._record_["max_speed"][0])

    @property
    def max_aside(self) -> float:
        """Largest velocity sideways, m/s."""
        return float(min(self._record_["max_speed"][0], self._record_["max_aside"][0]))

    def expect_friction(self, mu: float) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.expect_friction`.

        On soles the largest velocities fall with it. A speed that was given stays. Below
        :data:`FIRM` steps change, too.
        """
        if not self.robot.flat_feet:
            return
        r, build, pace = self._record_, self._build, self._pace
        share = min(mu / FULL_GRIP, 1.0)
        if not self._chosen_speed:
            slowest = SLOWEST * float(np.sqrt(GRAVITY * build.leg))
            r["max_speed"] = min(max(pace.max_speed * share, slowest), pace.max_speed)
        r["max_aside"], r["max_turn"] = share * self._max_aside, share * MOST_TURN
        if r["sways"][0]:
            grip, group = min(max((mu - SLIPPERY) / (FIRM - SLIPPERY), 0.0), 1.0), r["group"][0]
            nominal = build.place[:, :2] - build.place[:, :2].mean(axis=0)
            apart = draw_together(nominal, group, build.narrow)
            close = CLOSE + float(build.sole[1])
            draw_together(nominal, group, apart - (1.0 - grip) * max(apart - close, 0.0))
            r["nominal"] = nominal
            if len(nominal) > 2 or not self.walking:  # two soles take theirs with their next step
                r["middle"] = [nominal[group == g].mean(axis=0) for g in range(2)]
            for name in ("slow_double_support", "fast_double_support"):
                r[name] = SWIFT + grip * (getattr(pace, name) - SWIFT)

    def observe(self, state: State) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.observe`; entries that are not finite are ignored.

        Raises:
            InputError: it is no state of the robot.
        """
        try:
            measure(self._record_, state.q, state.v, state.foot_force)
        except (AttributeError, TypeError):
            state = as_state(state, self.robot)
            measure(self._record_, state.q, state.v, state.foot_force)

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`; the targets are those at the state that
        was observed last.

        Raises:
            Unobserved: no state whose numbers are finite.
            InputError: t is not finite or beyond 1e9 s, or the velocity's function returned no
                command.
        """
        if not self._measured["seen"][0]:
            message = (
                "hp.WalkingGait needs the measured state: call observe(state) before update(t)"
            )
            raise Unobserved(message, name="gait")
        if type(t) is not float:
            t = checks.number("t", t)
        if not abs(t) < LONGEST:
            raise refuse_time(t)
        if t <= 0.0 or t < float(self._record_["time"][0]) - self.step_duration:
            self._begin()
        while t >= self._record_["switch"][0]:
            self._take_row()
        self._ask_function(t)
        advance(float(t), self._record_, self.target._record_)
        return self.target

    def _take_over(self, velocity: Vector, in_air: NDArray[np.bool_]) -> None:
        """Begin anew at a time zero as a robot that goes: the first step begins at once, and the
        velocity comes to the command from there.

        Args:
            velocity: (3,) forward and to the left, not zero, m/s, and turning, rad/s, in the frame
                of the heading.
            in_air: (feet,) whether each foot is in the air.
        """
        self.update(0.0)
        r, groups = self._record_, int(self._record_["groups"][0])
        if groups == 1:
            return
        speed = float(np.hypot(*velocity[:2]))
        r["velocity"][0, :3] = min(1.0, self.max_speed / speed) * velocity
        # It is at the end of the step before that in which those swing that are in the air
        share = [in_air[r["group"][0] == group].mean() for group in range(groups)]
        r["walking"], r["phase"], r["swings"] = 1, 1.0, (int(np.argmax(share)) - 1) % groups

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.calls`; Python takes a script's rows."""
        if type(self) is not WalkingGait or self._function is not None:
            return None
        observe = Call(measure, self._record_, state.q, state.v, state.foot_force)
        return observe, Call(advance, 0.0, self._record_, self.target._record_, expected=True)

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`: at rest in the posture."""
        return self._standing.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, limits and script, for the log's metadata."""
        names = (
            "double_support",
            "clearance",
            "height",
            "penetration_offset",
            "reach",
            "omega",
            "max_speed",
        )
        return {
            "gait": "walking",
            "schedule": self.schedule,
            "step_duration": self.step_duration,
            **{name: float(self._record_[name][0]) for name in names},
            "command": self.command.tolist(),
            "script": [[t, *command.tolist()] for t, command in self.script],
        }

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Command, applied velocity, path and heading; centre of mass and centre of pressure;
        footholds; steps.
        """
        return {
            "command": self.command,
            "applied_velocity": self.applied,
            "path": field(self._record_, "path"),
            "heading": self.target.heading,
            "centre": field(self._measured, "centre"),
            "pressure": field(self._record_, "pressure"),
            "foothold": field(self._record_, "foothold"),
            "phase": field(self._record_, "phase"),
            "steps": field(self._record_, "steps"),
            "refused_commands": field(self._record_, "refused"),
        }
