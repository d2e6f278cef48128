"""A walk of any robot with two, four or six feet that follows a velocity command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import fitting_parameters
from harpy_pin.gaits.gait import GaitTarget, Unobserved
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.velocity import FollowsVelocity, Velocity, warn_maker
from harpy_pin.gaits.walking.build import build_of
from harpy_pin.gaits.walking.can_walk import why_no_walk
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.pace import pace_of
from harpy_pin.gaits.walking.parameters import WalkingParameters, changed, parameters_of
from harpy_pin.gaits.walking.record import WalkingRecord, walking_record
from harpy_pin.gaits.walking.schedules import BY_FEET, draw_together, groups_of
from harpy_pin.gaits.walking.swing_load import free_lift
from harpy_pin.gaits.walking.swinging import PEAK
from harpy_pin.gaits.walking.tick import advance
from harpy_pin.ground.surface import greatest_rise
from harpy_pin.ground.terrain import Terrain
from harpy_pin.kernels.calls import Call
from harpy_pin.model.entry import as_state
from harpy_pin.model.legs import legs
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import Records, field
from harpy_pin.model.robot import SOLE_JOINTS, Robot
from harpy_pin.model.state import GRAVITY, State, Vector


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
        clearance: height of a foot at mid-swing, m; by default that of the parameters, which is a
            share of the leg, or less where a joint of a leg on a point would come to its end.
        max_speed: largest velocity of a foot's place, m/s; by default what legs can reach and
            motors can hold and swing, √(g leg) at most.
        parameters: the tuned numbers; or those that differ, by name.

    Attributes:
        step_duration: of a slow walk, s.
        double_support: share of a step in which every foot is on the ground.
        command: (4,) the present command; set it in place.
        applied: (4,) the velocity that is applied, of the height m/s; read only.
        schedule: its name.
        parameters: the tuned numbers.
        limited_by: what :attr:`max_speed` is not larger for, in words, such as ``the torques of its
            motors``.
        record: all that it knows and remembers, for kernels.
        target: of the last update.
        script: rows (t, command).

    Raises:
        InputError: values out of their domains, an unknown schedule or parameter, another number of
            feet, or legs that cannot walk.
    """

    _advance = advance

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
        parameters: WalkingParameters | Mapping[str, Any] | None = None,
    ) -> None:
        feet = len(robot.corners)
        if feet not in BY_FEET:
            raise InputError(
                f"the gait needs two, four or six feet; '{robot.name}' has {feet}", name="robot"
            )
        super().__init__(robot)
        self.parameters = w = parameters_of(parameters)
        self._standing = Standing(robot, posture)
        q, v = self._standing.initial_state()
        self._build = build = build_of(robot, q, w)
        self.schedule = next(iter(BY_FEET[feet])) if schedule is None else schedule
        if self.schedule != "stand" and (why := why_no_walk(robot)):
            raise InputError(why, name="robot")
        most_joints = max(len(leg.joints) for leg in legs(robot))
        if feet == 2 and not robot.flat_feet and most_joints >= SOLE_JOINTS:
            warn_maker(
                f"'{robot.name}' has points as feet on legs of {most_joints} joints: flat_feet "
                f"makes them soles"
            )
        self._group = groups_of(self.schedule, build.around())
        if clearance is None:
            clearance = w.clearance * build.leg
            if not build.soles:  # the ankle of a sole takes part, too
                clearance = free_lift(robot, q, build, clearance)
        clearance = checks.number("clearance", clearance, low=0.0, high=build.leg, strict=True)
        if max_speed is not None:
            max_speed = checks.number("max_speed", max_speed, low=0.0, high=20.0, strict=True)
        self._pace, most, self.limited_by = pace_of(
            robot, q, build, self._group, clearance, w, max_speed=max_speed
        )
        self.step_duration = self._pace.usual_step
        self.double_support = self._pace.fast_double_support
        self.record: Records[WalkingRecord] = walking_record(
            robot,
            build,
            self._pace,
            self._group,
            w,
            clearance=clearance,
            max_speed=most,
            steps_at_rest=self.schedule == "step",
        )
        parts: Any = self._record_
        self._seen: NDArray[np.int64] = parts["measured"]["seen"]
        self._chosen_speed = max_speed is not None
        self._follow(velocity, parts["planned"], parts["steps"])
        # Largest speeds on firm ground
        self._firm = most, float(self._followed["max_aside"][0])
        self.controller_parameters = fitting_parameters(robot, leg=build.leg, rise=build.rise)
        self._begin()
        measure.prepare(self._record_, q, v, np.zeros((len(robot.feet), 3)))
        advance.prepare(0.0, self._record_, self.target._record_)

    def __repr__(self) -> str:
        forward, left, turning = self.command[:3].tolist()
        command = f"{forward:g}, {left:g} m/s, {turning:g} rad/s"
        return f"WalkingGait('{self.robot.name}', {self.schedule}, {command})"

    @property
    def max_speed(self) -> float:
        """Largest velocity of a foot's place, m/s: a command beyond it is scaled down."""
        return float(self._followed["max_speed"][0])

    @property
    def max_aside(self) -> float:
        """Largest velocity sideways, m/s."""
        return float(min(self._followed["max_speed"][0], self._followed["max_aside"][0]))

    def expect_friction(self, mu: float) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.expect_friction`.

        On soles the largest velocities fall with it. A speed that was given stays. Below the
        parameter ``firm`` steps change, too.
        """
        if not self.robot.on_soles:
            return
        w, pace, build, group = self.parameters, self._record_["pace"], self._build, self._group
        share, (fastest, aside) = min(mu / w.full_grip, 1.0), self._firm
        if not self._chosen_speed:
            slowest = w.slowest * float(np.sqrt(GRAVITY * build.leg))
            self._followed["max_speed"] = min(max(fastest * share, slowest), fastest)
        self._followed["max_aside"], self._followed["max_turn"] = share * aside, share * w.max_turn
        if pace["sways"][0]:
            grip = min(max((mu - w.slippery) / (w.firm - w.slippery), 0.0), 1.0)
            nominal = build.around()
            apart = draw_together(nominal, group, build.narrow)
            close = w.slippery_gap + float(build.sole[1])
            draw_together(nominal, group, apart - (1.0 - grip) * max(apart - close, 0.0))
            pace["nominal"], swift = nominal, w.slippery_double_support
            if len(nominal) > 2 or not self.walking:  # two soles take theirs with their next step
                middle = [nominal[group == g].mean(axis=0) for g in range(2)]
                self._record_["footholds"]["middle"] = middle
            for name in ("slow_double_support", "fast_double_support"):
                pace[name] = swift + grip * (getattr(self._pace, name) - swift)

    @checked
    def expect_terrain(self, terrain: Terrain, *, reach: float) -> bool:
        """See :meth:`~harpy_pin.gaits.gait.Gait.expect_terrain`.

        On points, on ground that is no plane, feet go over it by heights in the world, and steps
        last as long as lifting a foot takes.

        Raises:
            InputError: a reach that is not above zero, or not finite.
        """
        w, t = self.parameters, terrain.record
        pace, steps = self._record_["pace"], self._record_["steps"]
        self._record_["terrain"] = t
        pace["ground_reach"] = checks.number("reach", reach, low=0.0, strict=True)
        if self._build.soles or not (t["pieces"][0] or t["cells"][0, 2]):
            return False
        both = pace["fast_double_support"]
        pace["steps_over"] = pace["slow_load_ramp"] = pace["fast_load_ramp"] = 1
        pace["slow_double_support"] = steps["double_support"] = both
        rise = greatest_rise(t, w.longest_way * self._build.height)
        rising = float(np.sqrt(PEAK * (float(pace["clearance"][0]) + rise) / w.lift_acceleration))
        least = rising / float(w.apex * (1.0 - both[0]))
        self.step_duration = max(least, float(pace["usual_step"][0]))
        pace["usual_step"] = steps["duration"] = self.step_duration
        return True

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
        was observed last. Time zero, or one more than a step before the last, begins anew.

        Raises:
            Unobserved: no state whose numbers are finite.
            InputError: t is not finite or beyond 1e9 s, or the velocity's function returned no
                command.
        """
        if not self._seen[0]:
            raise Unobserved(
                "hp.WalkingGait needs the measured state: call observe(state) before update(t)",
                name="gait",
            )
        return super().update(t)

    def _begin(self) -> None:
        self._time[0] = -1.0
        super()._begin()

    def _take_over(self, velocity: Vector, in_air: NDArray[np.bool_]) -> None:
        """Begin anew at a time zero as a robot that goes: the first step begins at once, and the
        velocity comes to the command from there.

        Args:
            velocity: (3,) forward and to the left, not zero, m/s, and turning, rad/s, in the frame
                of the heading.
            in_air: (feet,) whether each foot is in the air.
        """
        self.update(0.0)
        pace, steps = self._record_["pace"], self._record_["steps"]
        groups = int(pace["groups"][0])
        if groups == 1:
            return
        speed = float(np.hypot(*velocity[:2]))
        applied = self._record_["planned"]["velocity"]
        applied[0, :3] = min(1.0, self.max_speed / speed) * velocity
        # It is at the end of the step before that in which those swing that are in the air
        share = [in_air[pace["group"][0] == group].mean() for group in range(groups)]
        steps["walking"], steps["phase"] = 1, 1.0
        steps["swings"] = (int(np.argmax(share)) - 1) % groups

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
        pace, build = self._record_["pace"][0], self._record_["build"][0]
        return {
            "gait": "walking",
            "schedule": self.schedule,
            "step_duration": self.step_duration,
            "double_support": float(self._record_["steps"]["double_support"][0]),
            "penetration_offset": self.parameters.penetration_offset,
            "max_speed": self.max_speed,
            **{name: float(pace[name]) for name in ("clearance", "omega")},
            **{name: float(build[name]) for name in ("height", "reach")},
            "parameters": changed(self.parameters),
            "command": self.command.tolist(),
            "script": [[t, *command.tolist()] for t, command in self.script],
        }

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Command, applied velocity, path and heading; centre of mass and centre of pressure;
        footholds; steps.
        """
        r = self._record_
        return {
            "command": self.command,
            "applied_velocity": self.applied,
            "path": field(r["planned"], "path"),
            "heading": self.target.heading,
            "centre": field(r["measured"], "centre"),
            "pressure": field(r["demand"], "pressure"),
            "foothold": field(r["footholds"], "place"),
            "phase": field(r["steps"], "phase"),
            "steps": field(r["steps"], "made"),
            "refused_commands": field(r["planned"], "refused"),
        }
