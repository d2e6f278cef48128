"""The preview: plans of a trot, with flight where it is fast, from measured states."""

from __future__ import annotations

from math import hypot, isfinite, sqrt

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.preview.footholds import along, footholds
from harpy_pin.contrib.preview.model import SingleBody, falling
from harpy_pin.contrib.preview.pace import FASTEST, MOST, SPEEDS, Pace, Stride
from harpy_pin.contrib.preview.program import force_program, solved
from harpy_pin.contrib.preview.schedule import Horizon, horizon
from harpy_pin.errors import InputError
from harpy_pin.gaits.plan import Plan
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.velocity import Velocity, read_velocity
from harpy_pin.gaits.walking.build import build_of
from harpy_pin.gaits.walking.parameters import WalkingParameters
from harpy_pin.gaits.walking.schedules import groups_of
from harpy_pin.model.entry import as_state
from harpy_pin.model.legs import legs
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector

INTERVALS, LONGEST = 12, 0.135
"""How many intervals the horizon is long, and the length of one at most, in √(leg / g)."""
WEIGHTS = np.array([[0.0, 0.0, 400.0, 100.0, 150.0, 20.0], [10.0, 10.0, 10.0, 1.0, 1.0, 2.0]])
"""Of squared deviations: place, tilt and yaw; their velocities."""
OVER_FEET = 100.0
"""Weight of the horizontal place where it stands."""
FORCE_WEIGHT = 2.5e-4
"""Of squared forces per mass."""
CATCH = 0.58
"""How far a foothold goes for a velocity that is not wanted, in √(leg / g)."""
LEAN = 0.5
"""How far a foothold goes outwards in a turn, in what a pendulum of the body's height needs."""
FRICTION_SHARE = 0.75
"""Of the friction coefficient that forces may use."""
LARGEST = 2.0
"""Largest normal force of a foot, in weights, as whole-body controllers have it."""
ACCELERATION, TURN_ACCELERATION = 2.0, 4.0
"""Largest change of the applied velocity, m/s² and rad/s²."""
MOST_TURN = 2.5
"""Largest turning velocity, rad/s."""
ASTRAY = 0.2
"""How far the heading may be behind, rad."""
GRIP = 0.6
"""Of the friction coefficient that a turn may need for the acceleration inwards."""
GAITS = ("trot", "bound", "pronk")
"""Which feet step together: diagonal ones, those of a pair of legs, or all."""
LONGEST_GAP = 0.1
"""Time that counts between two plans, at most, s."""
LEAST_BOUND = 0.7
"""Least friction coefficient for which a bound is planned: Go2 fell with 0.65, walked with this."""
PUSHED = 0.2
"""Velocity from which on it steps though it should stand, in √(g leg)."""


class Preview:
    """Plans for :class:`~harpy_pin.gaits.planned.PlannedGait`: a quadruped trots where a velocity
    says, and runs with flight where that is fast.

    A convex model-predictive control of a single rigid body over some 0.3 s. How long feet stand
    and swing follows from the speed and from what the motors can do (:class:`Pace`). At zero
    command it stands, and steps where it is pushed. The ground is level, at height zero.

    It has memory: one planner is for one gait. A time that goes back begins anew.

    Args:
        robot: on four legs of three joints, whose feet are points.
        velocity: forward and to the left, m/s, and turning to the left, rad/s; or rows of a script,
            or a function of time, as of :class:`~harpy_pin.gaits.walking.WalkingGait`.
        mu: friction coefficient of the ground.
        max_speed: largest velocity, m/s, to which a command is scaled down; by default that at
            which the stride asks 1.15 times as much of a motor as it has: swing feet give way.
        gait: which feet step together: those of a diagonal ("trot"), of a pair of legs ("bound"),
            or all ("pronk").

    Attributes:
        robot: whose.
        gait: which feet step together.
        command: (3,) the velocity that is wanted; change it at any time.
        applied: (3,) that is followed, which changes gradually.
        max_speed: m/s.
        paces: durations of stance and swing by the speed.

    Raises:
        InputError: values out of their domains, or another kind of legs.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        velocity: Velocity = (0.0, 0.0, 0.0),
        *,
        mu: float = 0.6,
        max_speed: float | None = None,
        gait: str = "trot",
    ) -> None:
        checks.instance("robot", robot, Robot)
        if robot.corners != (1, 1, 1, 1) or any(len(leg.joints) != 3 for leg in legs(robot)):
            raise InputError(
                f"the preview needs four legs of three joints on points, not '{robot.name}'",
                name="robot",
            )
        self.robot = robot
        self._command, self._script, self._function = read_velocity(velocity, 3)
        self.mu = checks.number("mu", mu, low=0.0, high=checks.MAX_FRICTION, strict=True)
        if gait == "bound" and self.mu < LEAST_BOUND:
            raise InputError(f"on less friction than {LEAST_BOUND:g} a bound falls", name="mu")
        q, _ = Standing(robot).initial_state()
        walk = WalkingParameters()
        build = build_of(robot, q, walk)
        self._natural = float(np.sqrt(build.leg / GRAVITY))
        self._height = build.height
        q[2] = build.height
        self._body = SingleBody(robot, q)
        self._hips = build.place * [1.0, 1.0, 0.0]
        places = self._hips[:, :2] - self._hips[:, :2].mean(axis=0)
        checks.one_of("gait", gait, GAITS)
        self.gait = gait
        self._offset: Vector = groups_of("stand" if gait == "pronk" else gait, places) / 2.0
        stride = Stride(robot, q, leg=build.leg, clearance=walk.clearance * build.leg)
        fastest = FASTEST * float(np.sqrt(GRAVITY * build.leg))
        speeds = np.linspace(0.0, fastest, SPEEDS)
        self.paces: tuple[Pace, ...] = tuple(stride.best(speed) for speed in speeds.tolist())
        loads = np.maximum.accumulate([pace.load for pace in self.paces])
        bound = float(np.interp(MOST, loads, speeds))
        given = bound if max_speed is None else max_speed
        self.max_speed = checks.number("max_speed", given, low=0.0, high=20.0, strict=True)
        self._begin(0.0)

    @property
    def command(self) -> Vector:
        """Velocity forward and to the left, m/s, and turning, rad/s; it may be written in place."""
        return self._command

    @command.setter
    def command(self, value: Vector) -> None:
        self._command[:] = checks.vector("command", value, 3)

    def __repr__(self) -> str:
        forward, left, turning = self.command.tolist()
        return f"Preview('{self.robot.name}', {forward:g}, {left:g} m/s, {turning:g} rad/s)"

    def _begin(self, t: float) -> None:
        self.applied: Vector = np.zeros(3)
        self._time, self._phase, self._stands = t, 0.0, True
        self._heading: float | None = None

    def _durations(self, speed: float) -> tuple[float, float]:
        """Times that a foot stands and swings at a speed, s."""
        speeds = [pace.speed for pace in self.paces]
        stance, swing = (
            float(np.interp(speed, speeds, [getattr(pace, name) for pace in self.paces]))
            for name in ("stance", "swing")
        )
        return stance, swing

    def plan(self, state: State) -> Plan:
        """A plan from a measured state.

        Raises:
            InputError: it is no state of the robot.
            HarpyError: the solver has not converged.
        """
        state = as_state(state, self.robot)
        if state.t < self._time:
            self._begin(state.t)
        step, self._time = min(state.t - self._time, LONGEST_GAP), state.t
        body = self._body
        body.measure(state)
        self._follow_command(step)
        ahead = self._look_ahead(step)
        feet = self._footholds(ahead, state)
        middle = 0.5 * (ahead.times[1:] + ahead.times[:-1])
        place, yaw = along(self.applied, ahead.times[1:])
        path = along(self.applied, middle)[0]
        path[:, 2] = self._height - body.place[2]
        interval, foot = np.nonzero(ahead.contact)
        gain = body.acceleration(feet[interval, foot], path[interval])
        falls = falling(body.motion, ahead.times)
        wanted = self._wanted(place, yaw, state)
        weights = WEIGHTS.copy()
        weights[0, :2] = OVER_FEET * self._stands
        program = force_program(
            gain,
            interval,
            ahead.times,
            wanted - falls,
            weights=weights,
            force_weight=FORCE_WEIGHT,
            mu=FRICTION_SHARE * self.mu,
            most=LARGEST * GRAVITY,
        )
        force = np.zeros((*ahead.contact.shape, 3))
        found = solved(program)
        force[interval, foot] = body.mass * found
        motion = falls + program.effect @ found.ravel()
        motion = np.concatenate((body.motion[:, None], motion), axis=1)
        bends = np.zeros((len(middle), 6))
        np.add.at(bends, interval, np.einsum("nac,nc->na", gain, found))
        bends[:, 2] -= GRAVITY
        return self._told(state.t, ahead, motion, bends, feet, force)

    def _follow_command(self, step: float) -> None:
        """Let the velocity come to the command."""
        if self._function is not None:
            self.command = checks.array("velocity", self._function(self._time), 3)
        for t, row in self._script:
            if t <= self._time:
                self.command[:] = row
        wanted = self.command if all(map(isfinite, self.command.tolist())) else self.applied
        speed = hypot(*wanted[:2])
        share = min(1.0, self.max_speed / max(speed, 1e-9), MOST_TURN / max(abs(wanted[2]), 1e-9))
        inwards = share**2 * speed * abs(wanted[2])  # m/s²
        share *= min(1.0, sqrt(GRIP * self.mu * GRAVITY / max(inwards, 1e-9)))
        most = np.array([ACCELERATION, ACCELERATION, TURN_ACCELERATION]) * step
        self.applied += np.clip(share * wanted - self.applied, -most, most)
        yaw = self._body.yaw
        heading = yaw if self._heading is None else self._heading + self.applied[2] * step
        off = (heading - yaw + np.pi) % (2.0 * np.pi) - np.pi
        self._heading = yaw + float(np.clip(off, -ASTRAY, ASTRAY))

    def _look_ahead(self, step: float) -> Horizon:
        """The contacts to come; it begins and ends to stand."""
        stance, swing = self._durations(hypot(*self.applied[:2]))
        longest = LONGEST * self._natural
        duty = stance / (stance + swing)
        going = bool(self.command.any() or self.applied.any())
        pushed = hypot(*self._body.motion[1, :2]) > PUSHED * GRAVITY * self._natural
        if self._stands and (going or pushed):
            self._stands = False
            self._phase = duty if self._offset.any() else 0.0  # one pair is lifted, or all jump
        elif not self._stands:
            self._phase += step / (stance + swing)
            held = (self._phase + self._offset) % 1.0 < duty
            self._stands = not (going or pushed) and bool(held.all())
        phase: Vector = (self._phase + self._offset) % 1.0
        duration = INTERVALS * longest
        if self._stands:
            return horizon(
                0.0 * phase,
                stance=2.0 * duration,
                swing=0.0,
                duration=duration,
                longest=3 * longest,
            )
        return horizon(phase, stance=stance, swing=swing, duration=duration, longest=longest)

    def _footholds(self, ahead: Horizon, state: State) -> Vector:
        """(N, feet, 3) in the axes of the heading, about the body's place, m."""
        body = self._body
        stance = self._durations(hypot(*self.applied[:2]))[0]
        excess = body.motion[1, :3] - [*self.applied[:2], 0.0]
        feet = footholds(
            self._hips,
            ahead.touchdown + 0.5 * stance,
            velocity=self.applied,
            excess=excess,
            catch=CATCH * self._natural,
            lean=LEAN * self._height / GRAVITY,
        )
        feet[..., 2] = -body.place[2]
        present = (state.foot_position - body.place) @ body.turn
        stays = (ahead.stance == 0) & ahead.contact[0]
        return np.where(stays[..., None], present, feet)

    def _wanted(self, place: Vector, yaw: Vector, state: State) -> Vector:
        """(2, N, 6) places and velocities at the ends of the intervals."""
        body, n = self._body, len(yaw)
        wanted = np.zeros((2, n, 6))
        wanted[0, :, :3] = place
        if self._stands:
            over = state.foot_position.mean(axis=0) - body.place
            wanted[0, :, :3] = body.turn.T @ over - self._hips.mean(axis=0)
        wanted[0, :, 2] = self._height - body.place[2]
        assert self._heading is not None
        wanted[0, :, 5] = self._heading - body.yaw + yaw
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, turning = self.applied
        wanted[1, :, 0], wanted[1, :, 1] = c * x - s * y, s * x + c * y
        wanted[1, :, 5] = turning
        return wanted

    def _told(
        self, t: float, ahead: Horizon, motion: Vector, bends: Vector, feet: Vector, force: Vector
    ) -> Plan:
        """The plan in the world's axes."""
        body = self._body
        turn, place = body.turn, body.place
        rotations = [body.rotation, *(turn @ pin.exp3(tilt) for tilt in motion[0, 1:, 3:])]
        return Plan(
            times=t + ahead.times,
            position=place + (body.centre + motion[0, :, :3]) @ turn.T,
            centre_of_mass=True,
            velocity=motion[1, :, :3] @ turn.T,
            acceleration=bends[:, :3] @ turn.T,
            orientation=[pin.Quaternion(rotation).coeffs() for rotation in rotations],
            angular_velocity=motion[1, :, 3:] @ turn.T,
            angular_acceleration=bends[:, 3:] @ turn.T,
            contact=ahead.contact,
            foothold=place + feet @ turn.T,
            force=force @ turn.T,
        )
