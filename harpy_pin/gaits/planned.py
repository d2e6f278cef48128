"""A gait that follows the plans of somebody else's MPC.

The planner is called with the measured state at its own rate. Its plans are on the clock of
``State.t``, so one that comes late is followed from where it should be by then. One that cannot be
followed, or none, never stops the loop: the last good plan is followed to its end, and then the
robot stands.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from math import atan2, isfinite
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import leg_length
from harpy_pin.gaits.gait import Gait, GaitTarget, Unobserved
from harpy_pin.gaits.plan import Plan, PlannedMoment
from harpy_pin.gaits.swing import on_its_way
from harpy_pin.gaits.walking import WalkingGait, WalkingParameters
from harpy_pin.ground.terrain import Plane
from harpy_pin.model.entry import all_possible, all_possible_rows, as_state, is_unit
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector

SHORTEST = 0.05
"""Time that a foot needs at least for a swing, s: with less left it stays on the ground."""
SETTLED = 0.03
"""Time before a foot is above its foothold from which on it goes there, whatever new plans say, s:
it could not follow."""
RISE, EARLY = 0.3, 0.06
"""When a foot is highest, and how long before it lands it is above its foothold, as shares of its
swing: one that moves across the ground where it leaves or meets it slips, and contacts that are
convex throw it up.
"""
DESCENT = 0.25
"""Velocity at which it lands, in √(g leg): one that lands at rest skims over the ground."""
FUTURE = 0.1
"""How long before it begins a plan may come, s."""
JUMP, TURN = 0.3, 0.5
"""How far from the measured state a plan may be when it comes: in lengths of the leg, and rad."""
REACH = 2.0
"""How far from the body's planned place a foot may stand, in its distance in the posture."""
GOES = 0.1
"""Velocity from which on a robot walks to a stand, in √(g leg)."""
FASTEST, HARDEST = 10.0, 100.0
"""Largest velocity and acceleration in a plan, m/s and m/s², also that of a foot's force alone."""
SPIN, BEND = 30.0, 1000.0
"""The same of angular ones, rad/s and rad/s²."""
ROUNDING = 1e-9
"""Of times, s."""
WALK = WalkingParameters()
"""Whose feet swing as these do, where nothing else is said."""
JITTER = 0.1
"""How far the clock may go back, s; beyond, all begins anew."""


class Planner(Protocol):
    """Somebody's MPC."""

    def plan(self, state: State) -> Plan | None:
        """A plan from a measured state, which is the planner's to keep.

        Args:
            state: of the present, or of when the call was due.

        Returns:
            The plan; None where there is no new one.
        """
        ...


class PlannedGait(Gait):
    """Targets of a robot that follows the plans of an MPC, for the whole-body controllers.

    It needs the measured state: controllers of this library call :meth:`observe` before each
    :meth:`update`. A planner that raises, and a plan that is of another robot, over, or far from
    the measured state, is refused: the last good plan is followed to its end, and then, as before
    the first plan, the robot stands. :attr:`status` says so in words, :meth:`telemetry` in numbers,
    and a warning the first time.

    It is a gait with memory, for one controller, in one thread. A time that goes back begins anew.

    Args:
        robot: with feet.
        planner: any object with ``plan(state)``, which returns a :class:`Plan`, or None where there
            is no new one.
        rate: how often the planner is called, Hz.
        executor: where the planner works, such as ``concurrent.futures.ThreadPoolExecutor(1)``: a
            tick then never waits for it, and the next call begins when the last one has ended. By
            default it is called in the tick, which is reproducible.
        clearance: height of a foot at mid-swing above the higher of its two places, m; by default a
            share of the leg's length.
        stand: gait without a plan; by default :class:`WalkingGait`, which steps where it has to in
            order to stand.

    Attributes:
        plan: that is followed; None where the robot stands.
        taken: how many plans were.
        refused: how many were not.
        error: why the last one was not, an exception with its traceback; None where all were.
        target: of the last update with a plan.
        not_governed: why the paper's controller cannot follow it.

    Raises:
        InputError: values out of their domains, or the robot cannot stand.
    """

    not_governed = "follows no plan of contacts and orientations"
    terrain = Plane()  # heights are the plan's: nothing is laid over the ground

    @checked
    def __init__(
        self,
        robot: Robot,
        planner: Planner,
        *,
        rate: float = 50.0,
        executor: Executor | None = None,
        clearance: float | None = None,
        stand: Gait | None = None,
    ) -> None:
        super().__init__(robot)
        self.planner, self.executor = planner, executor
        self.rate = checks.number("rate", rate, low=0.0, high=1e6, strict=True)
        self._leg = leg_length(robot)
        self._descent = DESCENT * float(np.sqrt(GRAVITY * self._leg))
        default = WALK.clearance * self._leg if clearance is None else clearance
        self.clearance = checks.number("clearance", default, low=0.0)
        self.stand = WalkingGait(robot) if stand is None else stand
        self.controller_parameters = self.stand.controller_parameters
        q, _ = self.initial_state()
        self._data, posed = robot.model.createData(), Posed(robot, q)
        places = [posed.frame(name).translation for name in robot.feet]
        ways = [float(np.linalg.norm(place - q[:3])) for place in places]
        self._reach = REACH * max(ways, default=0.0)
        self._state: State | None = None
        self._begin(0.0)

    def __repr__(self) -> str:
        planner = type(self.planner).__name__
        return f"PlannedGait('{self.robot.name}', {planner}, {self.rate:g} Hz)"

    def _begin(self, t: float) -> None:
        """Forget all plans."""
        feet = len(self.robot.feet)
        self.plan: Plan | None = None
        self._newest: Plan | None = None  # that was taken
        self._pending: Future[Any] | None = None
        self.taken = self.refused = 0
        self.error: Exception | None = None
        self._due, self._time = t, t
        self._stood: float | None = None  # since when it stands
        self._swings = [False] * feet
        self._foot: Vector = np.zeros((feet, 3, 3))
        self._goal: Vector = np.zeros((feet, 3))  # where it lands
        self._lifted, self._lands, self._height = [t] * feet, [t] * feet, [0.0] * feet

    @property
    def age(self) -> float:
        """How long ago the state was measured from which the plan was made, s; 0 without one."""
        return 0.0 if self.plan is None else self._time - float(self.plan.times[0])

    @property
    def status(self) -> str:
        """What it does and what has gone wrong, in words."""
        does = "stands without a plan"
        if self.plan is not None:
            does = f"follows a plan from {1e3 * self.age:.0f} ms ago"
        if self.error is None:
            return does
        return f"{does}; {self.refused} refused: {type(self.error).__name__}: {self.error}"

    def observe(self, state: State) -> None:
        """See :class:`Gait`; a bad sample is ignored.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self.robot)
        good = all_possible(state.q) and all_possible(state.v) and is_unit(state.q)
        feet = (state.foot_position, state.foot_velocity, state.foot_force)
        if good and isfinite(state.t) and all(map(all_possible_rows, feet)):
            self._state = state.copy()
        self.stand.observe(state)

    def expect_friction(self, mu: float) -> None:
        """See :class:`Gait`."""
        self.stand.expect_friction(mu)

    def expect_lag(self, lag: float) -> None:
        """See :class:`Gait`."""
        self.stand.expect_lag(lag)

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`Gait.initial_state`: that of the gait without a plan."""
        return self.stand.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """Planner and settings, for the log's metadata."""
        planner = type(self.planner).__name__
        return {
            "gait": "planned",
            "planner": planner,
            "rate": self.rate,
            "clearance": self.clearance,
            "step_duration": self.step_duration,
        }

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The plan's age, s; whether one is followed; how many were taken and refused; the planned
        forces, N.
        """
        return {
            "plan_age": self.age,
            "plan_followed": float(self.plan is not None),
            "plans_taken": float(self.taken),
            "plans_refused": float(self.refused),
            "planned_force": self.target.force,
        }

    def update(self, t: float) -> GaitTarget:
        """See :meth:`Gait.update`; targets of the plan, or of the gait without one.

        Raises:
            Unobserved: no state whose numbers are finite.
        """
        t = checks.number("t", t)
        if self._state is None:
            raise Unobserved("hp.PlannedGait needs the measured state: call observe(state)")
        if t < self._time - JITTER:
            self._begin(t)
        step, self._time = max(t - self._time, 0.0), t
        self._ask(self._state)
        if self.plan is not None and t <= self.plan.times[-1]:
            self._stood = None
            self._follow(self.plan.at(t), self.plan.centre_of_mass, self._state, step)
            return self.target
        self.plan = None
        if self._stood is None:
            return self._stand_from(self._state)
        return self.stand.update(t - self._stood)

    def _stand_from(self, state: State) -> GaitTarget:
        """Begin to stand: a robot that goes walks to a stand, if it can."""
        flies, self._swings = self._swings, [False] * len(self._swings)
        self._stood, self.target.force[:] = self._time, 0.0
        turn = pin.Quaternion(state.q[3:7]).matrix()
        x, y, _ = turn @ state.v[:3]
        goes = np.hypot(x, y) > GOES * np.sqrt(GRAVITY * self._leg)
        if not (goes and isinstance(self.stand, WalkingGait)):
            return self.stand.update(0.0)
        c, s = turn[:2, 0] / np.hypot(*turn[:2, 0])
        velocity = np.array([c * x + s * y, c * y - s * x, turn[2] @ state.v[3:6]])
        self.stand._take_over(velocity, np.array(flies))
        return self.stand.target

    def _ask(self, state: State) -> None:
        """Take what the planner has found, and call it where that is due."""
        if self._pending is not None and self._pending.done():
            found, self._pending = self._pending, None
            self._take(found.result, state)
        if self._pending is None and self._time > self._due - ROUNDING:
            self._due = max(self._due + 1.0 / self.rate, self._time)
            self._take(lambda: self._call(state.copy()), state)

    def _call(self, state: State) -> Plan | None:
        """Call the planner; nothing is found yet where it works elsewhere."""
        if self.executor is None:
            return self.planner.plan(state)
        self._pending = self.executor.submit(self.planner.plan, state)
        return None

    def _take(self, found: Callable[[], Plan | None], state: State) -> None:
        """Follow a plan from now on, or refuse it."""
        try:
            plan = found()
            if plan is not None and plan is not self._newest:
                self._check(plan, state)
                self.plan = self._newest = plan
                self.taken += 1
        except Exception as error:
            self.refused, self.error = self.refused + 1, error
            if self.refused == 1:
                warnings.warn(f"a plan was refused at {self._time:.3f} s: {error!r}", stacklevel=2)

    def _check(self, plan: Plan, state: State) -> None:
        """Refuse what cannot be followed.

        Raises:
            InputError: the message says why.
        """
        checks.instance("plan", plan, Plan)
        t, begin, end = self._time, float(plan.times[0]), float(plan.times[-1])
        if plan.feet != len(self.robot.feet):
            raise InputError(
                f"it has {plan.feet} feet, and '{self.robot.name}' {len(self.robot.feet)}",
                name="plan",
            )
        if not begin - FUTURE <= t < end:
            raise InputError(f"it is for {begin:.3f} to {end:.3f} s at {t:.3f} s", name="plan")
        speed = np.diff(plan.position, axis=0) / np.diff(plan.times)[:, None]
        arm = np.where(plan.contact[..., None], plan.foothold - plan.position[:, None], 0.0)
        for what, rows, most in (
            ("positions change by {:.3g} m/s", speed, FASTEST),
            ("velocity is {:.3g} m/s", plan.velocity, FASTEST),
            ("acceleration is {:.3g} m/s²", plan.acceleration, HARDEST),
            ("angular velocity is {:.3g} rad/s", plan.angular_velocity, SPIN),
            ("angular acceleration is {:.3g} rad/s²", plan.angular_acceleration, BEND),
            ("forces are {:.3g} N", plan.force, HARDEST * self.robot.mass),
            ("footholds are {:.3g} m from the body", arm, self._reach),
        ):
            largest = float(np.linalg.norm(rows, axis=-1).max(initial=0.0))
            if largest > most:
                raise InputError(f"its {what.format(largest)}", name="plan")
        if plan.rotation[:, 2, 2].min() < 0.0:
            raise InputError("its body turns over", name="plan")
        now, body = plan.at(t), pin.Quaternion(state.q[3:7]).matrix()
        away = float(np.linalg.norm(now.position - self._measured(plan.centre_of_mass, state)[0]))
        turned = float(np.linalg.norm(pin.log3(body.T @ now.rotation)))
        if away > JUMP * self._leg or turned > TURN:
            raise InputError(
                f"it is {away:.2f} m and {turned:.2f} rad from the measured body", name="plan"
            )

    def _measured(self, centre: bool, state: State) -> tuple[Vector, Vector]:
        """Place and velocity of the body's origin, or the centre of mass, in world axes."""
        if centre:
            data, tree = self._data, self.robot.closed(state.q)
            speed = self.robot.velocity_map(state.q) @ state.v
            pin.centerOfMass(self.robot.model, data, tree, speed)
            return data.com[0], data.vcom[0]
        return state.q[:3], pin.Quaternion(state.q[3:7]).matrix() @ state.v[:3]

    def _follow(self, now: PlannedMoment, centre: bool, state: State, step: float) -> None:
        """Write the targets of a moment of the plan."""
        target, spin, bend = self.target, now.angular_velocity, now.angular_acceleration
        place, velocity = now.position, now.velocity
        if centre:  # the body's origin is as far from its target as the centre of mass is
            origin, origin_velocity = self._measured(False, state)
            centre_place, centre_velocity = self._measured(True, state)
            place = place + origin - centre_place
            velocity = velocity + origin_velocity - centre_velocity
        target.centre_of_mass[:] = centre
        target.body[:] = np.concatenate((place, velocity, now.acceleration))
        target.up[:] = up = now.rotation[:, 2]
        ahead = now.rotation[:, 0]  # turned upright by the shortest rotation it shows the heading
        x, y = ahead[:2] - ahead[2] / (1.0 + up[2]) * up[:2]
        target.heading[:] = atan2(y, x), spin[2], bend[2]
        target.tilt_rate[:] = spin[:2], bend[:2]
        target.force[:] = now.force
        target.ground_height[:] = now.foothold[:, 2]
        target.stance[:] = 1.0
        target.phase[:] = 0.5
        # Feet in world axes: one that should be on the ground is let down where it is
        motion = np.zeros((3, *state.foot_position.shape))
        motion[0] = state.foot_position
        motion[1, :, 2] = -self._descent
        for k, contact in enumerate(now.contact.tolist()):
            if self._is_in_air(k, contact, now, state):
                target.stance[k] = 0.0
                target.phase[k] = self._swing(k, now.foothold[k], step)
                motion[:, k] = self._foot[k]
        target.foot_position[:] = motion[0] - place
        target.foot_velocity[:] = motion[1] - velocity
        target.foot_acceleration[:] = motion[2] - now.acceleration

    def _is_in_air(self, k: int, contact: bool, now: PlannedMoment, state: State) -> bool:
        """Whether foot k swings; it begins to where the plan says so and leaves it the time."""
        t, landing, foothold = self._time, float(now.landing[k]), now.foothold[k]
        if not contact:
            if not self._swings[k] and landing - t > SHORTEST:
                self._swings[k], self._lifted[k], self._goal[k] = True, t, foothold
                self._foot[k] = state.foot_position[k], np.zeros(3), np.zeros(3)
                self._height[k] = float(state.foot_position[k, 2])
            self._lands[k] = landing
        elif t >= self._lands[k]:  # one that a new plan has on the ground early goes on to land
            self._swings[k] = False
        return self._swings[k]

    def _swing(self, k: int, foothold: Vector, step: float) -> float:
        """Bring a foot in the air to the present time; returns the share of its swing."""
        lifted, lands = self._lifted[k], self._lands[k]
        span, step = lands - lifted, min(step, self._time - lifted)
        left = lands - self._time + step
        if left - EARLY * span > SETTLED:
            self._goal[k] = foothold
        x, y, height = self._goal[k].tolist()
        self._foot[k] = on_its_way(
            self._foot[k],
            (x, y, height - WALK.penetration_offset),
            step,
            left=left,
            rise=left - (1.0 - RISE) * span,
            apex=max(self._height[k], height) + self.clearance,
            early=EARLY * span,
            descent=self._descent,
        )
        return min((self._time - lifted) / span, 1.0)
