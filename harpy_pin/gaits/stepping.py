"""Stepping in place on two point feet: footholds from the capture point, at every tick anew.

A robot on two points cannot stand: it would tip about the line between them. So it steps, and its centre of mass moves
as an inverted pendulum over the stance foot p: c̈ = ω² (c − p) with ω² = g / height. The pendulum's *capture point*
ξ = c + ċ/ω runs away from that foot, ξ(t) = p + (ξ(0) − p) exp(ω t), so its place at the end of the step is known. The
foothold is that place less the offset b of the capture point from the stance foot at the beginning of a step of a
periodic walk,

    forward   b = L / (exp(ω T) − 1)
    sideways  b = ∓ W / (exp(ω T) + 1) + L / (exp(ω T) − 1)

with the step's duration T, the feet's distance W and the way L per step (Englsberger, Ott and Albu-Schäffer 2015;
Khadiv, Herzog, Moosavian and Righetti 2016). So whatever a push did to the capture point is gone after one step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.deprecated import renamed_arguments
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import GaitTarget, GaitTargetRecord
from harpy_pin.gaits.standing import GRAVITY, Standing
from harpy_pin.gaits.walking.quintic import toward
from harpy_pin.model.entry import all_finite, all_possible, all_possible_rows, as_state, is_unit
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import ZERO, RecordOf, field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

__all__ = ["Stepping"]

TOUCH_FORCE = 1.0
"""Least normal force of a foot that has landed, in the second half of its swing, N."""
FROZEN = 0.02
"""Time before the end of a step during which the foothold no longer changes, s."""
DESCENT = 0.2
"""Velocity downwards of a foot that has not met the ground in time, m/s."""
REACH = 0.9
"""Largest distance between the feet, as a share of the height of the centre of mass, where none is given."""
RETURN, MAX_RETURN = 0.3, 0.02
"""Share of its way back to the start that the robot goes in one step, and the most, m."""


class SteppingRecord(RecordOf):
    """What :class:`Stepping` knows, has measured and remembers.

    Attributes:
        omega: of the pendulum, 1/s.
        step_duration: likewise width, clearance, penetration_offset, feet_apart and reach: see :class:`Stepping`.
        height: of the body, m.
        seen: 1 once a state was measured.
        body: (6,) place (m) and velocity (m/s) of the body's origin, world axes.
        heading: of the body, rad.
        centre: (6,) place (m) and velocity (m/s) of the centre of mass.
        place: (2, 3) of the feet, world, m.
        load: (2,) measured normal forces, N.
        time: of the last update, s; −1 before the first.
        begun: when the present step began, s.
        carrying: index of the stance foot.
        home: (2,) place to come back to, m.
        lifted_at: height of the swing foot when its step began, m.
        foothold: (2,) where it lands, m.
        capture_point: (2,) m.
        swing: (3, 3) place, velocity and acceleration of the swing foot, world axes.
    """

    omega: float
    step_duration: float
    width: float
    height: float
    clearance: float
    penetration_offset: float
    feet_apart: float
    reach: float
    seen: int = ZERO
    body: Vector = sized(6)
    heading: float = 0.0
    centre: Vector = sized(6)
    place: Vector = sized(2, 3)
    load: Vector = sized(2)
    time: float = -1.0
    begun: float = 0.0
    carrying: int = ZERO
    home: Vector = sized(2)
    lifted_at: float = 0.0
    foothold: Vector = sized(2)
    capture_point: Vector = sized(2)
    swing: Vector = sized(3, 3)


@renamed_arguments(press="penetration_offset")
class Stepping(KeepsViews):
    """Targets of a biped on point feet that steps in place, and steps aside when it is pushed.

    It needs the measured state: controllers of this library call :meth:`observe` before each :meth:`update`. The body's
    horizontal acceleration is the pendulum's own; the feet's forces keep height, roll and pitch. A point foot has no
    moment about the vertical: the heading is the measured one, and drifts. Each step goes a little of the way back to
    where the robot began.

    A step ends when the swing foot meets the ground in the second half of its swing. Only the footholds are kept apart,
    not the legs.

    It begins in its posture, at rest, on the first foot. It is a gait with memory, for one controller, in one thread.
    Time zero, or a time that is more than a step before the last, begins anew; one that is less before it counts as
    the last.

    Args:
        robot: with two point feet, the left one first.
        posture: (joints,) angles, rad; by default the robot's own.
        step_duration: T, from one touchdown to the next, s.
        width: W, distance of the feet to the side, m; by default such that the posture at rest is in the cycle.
        clearance: height of a foot at mid-swing, m.
        penetration_offset: how much deeper than the ground a swing foot aims, m.
        feet_apart: least distance to the side between a foothold and the other foot, m.
        reach: largest distance between them, m; by default 0.9 of the height of the centre of mass.

    Attributes:
        target: of the last update.
        double_support: 0: one foot takes over from the other at once.
        width: W, m.
        omega: ω of the pendulum, 1/s.

    Raises:
        InputError: values out of their domains, or a robot of another kind.
    """

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        step_duration: float = 0.15,
        width: float | None = None,
        clearance: float = 0.03,
        penetration_offset: float = 0.003,
        feet_apart: float = 0.05,
        reach: float | None = None,
    ) -> None:
        checks.instance("robot", robot, Robot)
        if len(robot.feet) != 2 or robot.flat_feet:
            raise InputError(f"the gait needs two point feet; '{robot.name}' has others", name="robot")
        self.robot = robot
        self._standing = Standing(robot, posture)
        self._data = robot.model.createData()
        q, v = self._standing.initial_state()
        centre = np.array(pin.centerOfMass(robot.model, self._data, q))
        pin.updateFramePlacements(robot.model, self._data)
        left, right = (self._data.oMf[robot.frame_id(name)].translation for name in robot.feet)
        apart = float(left[1] - right[1])
        if apart <= 0.0:
            raise InputError("the left foot must be the first, and to the left of the other", name="robot")
        self.step_duration = checks.number("step_duration", step_duration, low=0.05, high=2.0)
        self.double_support = 0.0
        self.omega = float(np.sqrt(GRAVITY / centre[2]))
        growth = float(np.exp(self.omega * self.step_duration))
        self.width = 0.5 * apart * (growth + 1.0) if width is None else checks.number("width", width, low=0.0)
        nearest = checks.number("feet_apart", feet_apart, low=0.0, high=self.width)
        self.record = make_record(
            SteppingRecord,
            omega=self.omega,
            step_duration=self.step_duration,
            width=self.width,
            height=float(q[2]),
            clearance=checks.number("clearance", clearance, low=0.0, strict=True),
            penetration_offset=checks.number("penetration_offset", penetration_offset, low=0.0),
            feet_apart=nearest,
            reach=REACH * float(centre[2]) if reach is None else checks.number("reach", reach, low=nearest),
        )
        self.target = GaitTarget()
        feet = np.zeros((2, 3))
        _see.prepare(self.record, q, v, feet, feet, np.zeros(3), np.zeros(3))
        _update.prepare(0.0, self.record, self.target.record)

    @property
    def parameters(self) -> dict[str, Any]:
        """Settings of whole-body controllers that fit this robot's weight, see :attr:`Standing.parameters`."""
        return self._standing.parameters

    def observe(self, state: State) -> None:
        """What was measured, for the next update; a bad sample is ignored.

        Args:
            state: of the present tick.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self.robot)
        data = self._data
        pin.centerOfMass(self.robot.model, data, state.q, state.v, False)
        _see(self.record, state.q, state.v, state.foot_position, state.foot_force, data.com[0], data.vcom[0])

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.robot.name}')"

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`; an InputError where t is not finite, or without a state."""
        if not self.record["seen"][0]:
            message = "hp.Stepping needs the measured state: call observe(state) before update(t)"
            raise InputError(message, name="gait")
        if not _update(checks.number("t", t), self.record, self.target.record):
            raise InputError(f"the gait's time must be finite, got {shown(t)}", name="t", value=t)
        return self.target

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`; at rest in the posture."""
        return self._standing.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        names = ("step_duration", "width", "clearance", "penetration_offset", "feet_apart", "reach", "omega")
        return {"gait": "stepping", **{name: float(self.record[name][0]) for name in names}}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Foothold and capture point, (2,) each, world, m."""
        return {"foothold": field(self.record, "foothold"), "capture_point": field(self.record, "capture_point")}


@kernel
def predict_capture_point(capture: float, foot: float, omega: float, left: float) -> float:
    """Where the capture point is after a time over a foot that stays, m; one coordinate.

    Args:
        capture: where it is now, m.
        foot: the foot that carries, m.
        omega: 1/s.
        left: the time, s.
    """
    return float(foot + (capture - foot) * np.exp(omega * left))


@kernel
def cycle_offset(side: float, forward: float, sideways: float, width: float, growth: float) -> tuple[float, float]:
    """Offset of the capture point from a foot that begins to carry, in a walk that goes on for ever, m.

    Args:
        side: of that foot, 1 for the left one, −1 for the right one.
        forward: way per step, m.
        sideways: likewise, to the left.
        width: distance of the feet to the side, m.
        growth: exp(ω T).

    Returns:
        Forward and to the left.
    """
    return forward / (growth - 1.0), sideways / (growth - 1.0) - side * width / (growth + 1.0)


@kernel
def _see(
    p: SteppingRecord, q: Vector, v: Vector, foot_position: Vector, foot_force: Vector, centre: Vector, velocity: Vector
) -> None:
    """Keep what was measured, if a robot can be so."""
    if not (all_possible(q) and all_possible(v) and is_unit(q) and all_finite(centre) and all_finite(velocity)):
        return
    if not (all_possible_rows(foot_position) and all_possible_rows(foot_force)):
        return
    x, y, z, w = q[3], q[4], q[5], q[6]
    p.heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    p.body[3] = (1.0 - 2.0 * (y * y + z * z)) * v[0] + 2.0 * (x * y - w * z) * v[1] + 2.0 * (x * z + w * y) * v[2]
    p.body[4] = 2.0 * (x * y + w * z) * v[0] + (1.0 - 2.0 * (x * x + z * z)) * v[1] + 2.0 * (y * z - w * x) * v[2]
    for i in range(3):
        p.body[i] = q[i]
        p.centre[i], p.centre[3 + i] = centre[i], velocity[i]
    for k in range(2):
        p.place[k] = foot_position[k]
        p.load[k] = foot_force[k, 2]
    p.seen = 1


@kernel
def _update(t: float, p: SteppingRecord, target: GaitTargetRecord) -> bool:
    """All targets at time t; returns whether it is one."""
    if not np.isfinite(t):
        return False
    if t <= 0.0 or p.time < 0.0 or t < p.time - p.step_duration:
        p.home[:] = p.centre[:2]
        p.time = t
        _lift(p, 1, t)
    span = max(t - p.time, 0.0)
    p.time = max(t, p.time)
    swings = 1 - p.carrying
    done = (p.time - p.begun) / p.step_duration
    if done > 0.5 and (p.load[swings] > TOUCH_FORCE or p.place[swings, 2] <= 0.0):
        swings, done = 1 - swings, 0.0
        _lift(p, swings, p.time)
    left = max(p.begun + p.step_duration - p.time, 0.0)
    _choose_foothold(p, swings, left)
    for i in range(2):
        now = p.swing[0, i], p.swing[1, i], p.swing[2, i]
        p.swing[0, i], p.swing[1, i], p.swing[2, i] = toward(*now, p.foothold[i], left + span, span)
    _height(p, done)
    _write(p, target, swings, min(done, 1.0))
    return True


@kernel
def _lift(p: SteppingRecord, k: int, t: float) -> None:
    """Begin a step in which foot k swings."""
    p.carrying, p.begun = 1 - k, t
    p.swing[:] = 0.0
    p.swing[0] = p.place[k]
    p.lifted_at = p.place[k, 2]
    p.foothold[:] = p.place[k, :2]


@kernel
def _choose_foothold(p: SteppingRecord, k: int, left: float) -> None:
    """Where foot k has to land after the time left; no more shortly before it does."""
    growth = np.exp(p.omega * p.step_duration)
    side = 1.0 - 2.0 * k
    c, s = np.cos(p.heading), np.sin(p.heading)
    foot = p.place[p.carrying]
    for i in range(2):
        p.capture_point[i] = p.centre[i] + p.centre[3 + i] / p.omega
    if left <= FROZEN:
        return
    dx = predict_capture_point(p.capture_point[0], foot[0], p.omega, left) - foot[0]
    dy = predict_capture_point(p.capture_point[1], foot[1], p.omega, left) - foot[1]
    back_x, back_y = p.home[0] - p.centre[0], p.home[1] - p.centre[1]
    forward = min(max(RETURN * (c * back_x + s * back_y), -MAX_RETURN), MAX_RETURN)
    sideways = min(max(RETURN * (c * back_y - s * back_x), -MAX_RETURN), MAX_RETURN)
    offset = cycle_offset(side, forward, sideways, p.width, growth)
    ahead, aside = c * dx + s * dy - offset[0], c * dy - s * dx - offset[1]
    aside = side * max(side * aside, p.feet_apart)
    share = min(p.reach / np.hypot(ahead, aside), 1.0)
    ahead, aside = share * ahead, share * aside
    p.foothold[0], p.foothold[1] = foot[0] + c * ahead - s * aside, foot[1] + s * ahead + c * aside


@kernel
def _height(p: SteppingRecord, u: float) -> None:
    """Height of the foot in the air: up to the clearance and down, ``press`` deep at the end of the step, and on."""
    rate = 1.0 / p.step_duration
    if u >= 1.0:
        p.swing[0, 2] = -p.penetration_offset - DESCENT * (u - 1.0) * p.step_duration
        p.swing[1, 2], p.swing[2, 2] = -DESCENT, 0.0
        return
    w, down = 1.0 - u, -p.penetration_offset - p.lifted_at
    up = 16.0 * p.clearance
    p.swing[0, 2] = p.lifted_at + up * u * u * w * w + down * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    p.swing[1, 2] = (2.0 * up * u * w * (w - u) + 30.0 * down * u * u * w * w) * rate
    p.swing[2, 2] = (2.0 * up * (1.0 - 6.0 * u * w) + 60.0 * down * u * w * (w - u)) * rate * rate


@kernel
def _write(p: SteppingRecord, o: GaitTargetRecord, swings: int, progress: float) -> None:
    """The targets: the body where it is, with the pendulum's acceleration; its height; the feet."""
    carries = 1 - swings
    for i in range(2):
        o.body[i], o.body[3 + i] = p.body[i], p.body[3 + i]
        o.body[6 + i] = p.omega * p.omega * (p.centre[i] - p.place[carries, i])
    o.body[2], o.body[5], o.body[8] = p.height, 0.0, 0.0
    o.heading[0] = p.heading
    for i in range(3):
        o.foot_position[carries, i] = p.place[carries, i] - o.body[i]
        o.foot_velocity[carries, i] = -o.body[3 + i]
        o.foot_acceleration[carries, i] = -o.body[6 + i]
        o.foot_position[swings, i] = p.swing[0, i] - o.body[i]
        o.foot_velocity[swings, i] = p.swing[1, i] - o.body[3 + i]
        o.foot_acceleration[swings, i] = p.swing[2, i] - o.body[6 + i]
    o.stance[carries], o.stance[swings] = 1.0, 0.0
    o.phase[carries] = o.phase[swings] = progress
