"""A straight walk: phases, double support, and the targets of body and feet.

Step k lasts T. It begins in double support, for a share δ of T; then one foot swings, the right one
in even steps. A stance foot follows the stance curve for T (1 + δ), a swing foot the swing curve
for T (1 − δ), both relative to the target of the body, in world axes (the target body is upright
and faces x).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, OutOfReachError
from harpy_pin.gaits.gait import (
    CHANGE_OVER,
    LONGEST,
    ClockGait,
    GaitTarget,
    GaitTargetRecord,
    two_legs,
)
from harpy_pin.kernels import kernel
from harpy_pin.model.kinematics import leg_inverse_kinematics, leg_jacobian
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

TUNED_OFFSET, TUNED_STIFFNESS, TUNED_MASS = 0.005, 8000.0, 4.02
"""Penetration offset of the tuned walk, m, the ground's stiffness, N/m, and the robot's mass, kg,
that it is for.
"""
MAX_OFFSET = 0.1
"""Largest penetration offset of the default walk, m."""
TUNED_PARAMETERS: Mapping[str, Any] = {
    "body": (100.0, 40.0),
    "orientation": (210.0, 21.0),
    "swing": (850.0, 85.0),
    "contact_damping": 100.0,
    "min_normal_force": 11.0,
    "max_normal_force": 200.0,
    "contact_threshold": 1.0,
    "estimate_friction": True,
    "limits": {"friction_share": 0.4},
    "weights": {
        "orientation": 0.25,
        "swing": 12.0,
        "posture": 1e-6,
        "arms": 1.0,
        "thrust": 3.5e-4,
        "force": 1.9e-5,
    },
}
"""Settings of whole-body controllers for that walk; ``docs/limitations.md`` says how they were
found.
"""


@dataclass(frozen=True, kw_only=True)
class StepParameters(checks.Checked):
    """Rhythm and shape of steps at the paper's rhythm; defaults tuned for little slip
    (docs/reproduction.md).

    Attributes:
        step_duration: T, one step, s (the paper's 0.75 s; its cycle is 1.5 s).
        double_support: δ, share of T with both feet on the ground.
        height: of the body, m.
        width: lateral distance of each foot from the path, m.
        sway: amplitude of the body's lateral motion, period 2 T, towards the stance foot, m.
        clearance: height of the swing foot at mid-swing, m.
        penetration_offset: how much deeper than the ground a stance foot aims, m: its penetration
            under the body's weight on that ground (see :func:`make_gait`).
        release: share of the swing after which a foot's target begins to hold in the world (see
            :attr:`GaitTarget.world_frame_blend`): it must be clear of the ground.
        settle: share of the stance in which it goes back to holding in the body.
    """

    step_duration: float = checks.setting(0.75, low=0.0, strict=True)
    double_support: float = checks.setting(0.3, low=0.0, high=0.9)
    height: float = checks.setting(0.6, low=0.0, strict=True)
    width: float = checks.setting(0.125, low=0.0)
    sway: float = checks.setting(0.025, low=0.0)
    clearance: float = checks.setting(0.08, low=0.0)
    penetration_offset: float = checks.setting(0.005, low=0.0)
    release: float = checks.setting(0.4, low=0.0, high=1.0 - CHANGE_OVER)
    settle: float = checks.setting(0.9, low=0.0, high=1.0, strict=True)


@dataclass(frozen=True, kw_only=True)
class GaitParameters(StepParameters):
    """A straight walk, by default at the paper's speed; its steps are those of
    :class:`StepParameters`.

    Attributes:
        speed: along x, m/s; zero is standing on both feet.
    """

    speed: float = checks.setting(0.3, low=-100.0, high=100.0)


class StraightRecord(RecordOf, GaitParameters):
    """The numbers of :class:`GaitParameters`, and the curves of :class:`StraightGait`."""

    stance_curve: Vector = sized(5, 3)
    swing_curve: Vector = sized(5, 3)


@kernel
def _walk(t: float, p: StraightRecord, o: GaitTargetRecord) -> bool:
    """All targets at time t; returns whether it is one."""
    if not abs(t) < LONGEST:
        return False
    if p.speed == 0.0:  # both feet on the ground, half-way through their stance
        o.body[:] = 0.0
        o.body[2] = p.height
        o.foot_position[:] = p.stance_curve[2]
        o.stance[:], o.phase[:] = 1.0, 0.5
        o.foot_position[1, 1] = -p.stance_curve[2, 1]
        return True
    _body(t, p, o.body)
    index = int(np.floor(t / p.step_duration + 1e-9))
    s = max(t / p.step_duration - index, 0.0)
    for k in range(2):
        on_ground, fraction = support(k == index % 2, s, p.double_support)
        _foot(k, on_ground, fraction, p, o)
    return True


@kernel
def support(carries: bool, s: float, double_support: float) -> tuple[bool, float]:
    """Whether a foot is on the ground, and the share of its stance or swing that it has done, at
    the share s of a step.

    It ``carries`` where its stance began with this step; the double support is a share of a step.
    """
    if carries:
        return True, s / (1.0 + double_support)
    if s < double_support:
        return True, (1.0 + s) / (1.0 + double_support)
    return False, (s - double_support) / (1.0 - double_support)


@kernel
def world_frame_blend(on_ground: bool, done: float, settle: float, release: float) -> float:
    """Of :class:`GaitTarget`, of a foot that has done a share of its stance or swing."""
    return (
        max(1.0 - done / settle, 0.0)
        if on_ground
        else min(max((done - release) / CHANGE_OVER, 0.0), 1.0)
    )


@kernel
def _body(t: float, p: StraightRecord, body: Vector) -> None:
    """Constant speed and height, and a sway of period 2 T."""
    rate = np.pi / p.step_duration
    body[:3] = p.speed * t, p.sway * np.sin(rate * t), p.height
    body[3:6] = p.speed, p.sway * rate * np.cos(rate * t), 0.0
    body[6:] = 0.0, -p.sway * rate**2 * np.sin(rate * t), 0.0


@kernel
def _foot(k: int, on_ground: bool, fraction: float, p: StraightRecord, o: GaitTargetRecord) -> None:
    """Targets of foot k, which has done a fraction of its stance or swing."""
    side = 1.0 - 2.0 * k
    curve = p.stance_curve if on_ground else p.swing_curve
    share = 1.0 + p.double_support if on_ground else 1.0 - p.double_support
    position, velocity, acceleration = (
        o.foot_position[k],
        o.foot_velocity[k],
        o.foot_acceleration[k],
    )
    bezier(curve, fraction, p.step_duration * share, position, velocity, acceleration)
    # Relative to the body, which sways; the curves are relative to the path.
    position[1] = side * position[1] - o.body[1]
    velocity[1] = side * velocity[1] - o.body[4]
    acceleration[1] = side * acceleration[1] - o.body[7]
    o.stance[k] = 1.0 if on_ground else 0.0
    o.phase[k] = fraction
    o.world_frame_blend[k] = world_frame_blend(on_ground, fraction, p.settle, p.release)


@kernel(points=(5, 3), position=(3,), velocity=(3,), acceleration=(3,))
def bezier(
    points: Vector,
    s: float,
    duration: float,
    position: Vector,
    velocity: Vector,
    acceleration: Vector,
) -> None:
    """Point, velocity and acceleration of the Bezier curve of five control points, by de
    Casteljau's scheme.

    The curve parameter s goes from 0 to 1 in the ``duration``.
    """
    r = 1.0 - s
    a = r * points[:4] + s * points[1:]
    b = r * a[:3] + s * a[1:]
    c = r * b[:2] + s * b[1:]
    position[:] = r * c[0] + s * c[1]
    velocity[:] = 4.0 * (c[1] - c[0]) / duration
    acceleration[:] = 12.0 * (b[2] - 2.0 * b[1] + b[0]) / duration**2


@fixed_arrays("stance_curve", "swing_curve")
class StraightGait(ClockGait, constant=True):
    """Targets of a walk (or of standing, at zero speed) for one robot.

    Args:
        robot: a biped with Harpy's kind of legs, left foot first.
        parameters: the walk.

    Attributes:
        stance_curve: (5, 3) control points of a left stance foot, relative to the path and the
            body's height, m; the right foot mirrors y.
        swing_curve: (5, 3) control points of a left swing foot, relative to the same, m.

    Raises:
        InputError: the robot is no biped, or a foot target is out of its leg's reach.
    """

    _kernel = _walk

    def __init__(self, robot: Robot, parameters: GaitParameters | None = None) -> None:
        super().__init__(robot)
        self.geometry = two_legs(robot)
        self.controller_parameters = tuned_parameters(robot)
        parameters = GaitParameters() if parameters is None else parameters
        self.parameters = p = checks.instance("parameters", parameters, GaitParameters)
        self.step_duration, self.double_support = p.step_duration, p.double_support
        self.standing = p.speed == 0.0
        self._record = make_record(StraightRecord, **asdict(p))
        self.stance_curve: Vector = field(self._record, "stance_curve")
        self.swing_curve: Vector = field(self._record, "swing_curve")
        stance_time = p.step_duration * (1.0 + p.double_support)
        swing_time = p.step_duration * (1.0 - p.double_support)
        front = 0.5 * p.speed * stance_time
        self.stance_curve[:, 0] = np.linspace(
            front, -front, 5
        )  # at walking speed: at rest on the ground
        # In swing: lift off and land at rest on the ground (P1, P3), no vertical speed at either
        # end.
        glide = 0.25 * p.speed * swing_time
        self.swing_curve[:, 0] = (-front, -front - glide, 0.0, front + glide, front)
        self.swing_curve[2, 2] = p.clearance * 8.0 / 3.0
        for curve in (self.stance_curve, self.swing_curve):
            curve[:, 1] = p.width
            curve[:, 2] -= p.height
        self.stance_curve[1:4, 2] -= p.penetration_offset
        self._kernel.prepare(0.0, self._record, self.target._record_)
        self._check_reach()

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return asdict(self.parameters)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`."""
        penetration = checks.number("penetration", penetration)
        target = self.update(0.0)
        q, v = self.robot.neutral, np.zeros(self.robot.nv)
        q[:3] = target.body[:3]
        q[2] = -float(target.foot_position[:, 2].min()) - penetration
        v[:3] = target.body[3:6]
        self._place_legs(target, q, v)
        return q, v

    def _place_legs(self, target: GaitTarget, q: Vector, v: Vector) -> None:
        """Joint angles and rates that put the feet on their targets relative to the body."""
        jacobian = np.zeros((3, 3))
        for k, geometry in enumerate(self.geometry):
            angles = leg_inverse_kinematics(geometry, target.foot_position[k])
            leg_jacobian(geometry.record, angles, jacobian)
            q[7 + 3 * k : 10 + 3 * k] = angles
            v[6 + 3 * k : 9 + 3 * k] = np.linalg.solve(jacobian, target.foot_velocity[k])

    def _check_reach(self) -> None:
        """Raise if a target of the cycle cannot be reached within the joint limits."""
        lower, upper = self.robot.joint_lower, self.robot.joint_upper
        period = 2.0 * self.parameters.step_duration
        for t in np.linspace(0.0, period, 61, endpoint=False):
            target = self.update(float(t))
            for k, geometry in enumerate(self.geometry):
                try:
                    angles = leg_inverse_kinematics(geometry, target.foot_position[k])
                except OutOfReachError as error:
                    raise InputError(
                        f"this gait is out of the robot's reach: {error}", name="gait"
                    ) from error
                outside = (angles < lower[3 * k : 3 * k + 3]) | (angles > upper[3 * k : 3 * k + 3])
                if np.any(outside):
                    joint = self.robot.joints[3 * k + int(np.argmax(outside))]
                    raise InputError(
                        f"this gait exceeds the limits of joint '{joint}' at t = {t:.2f} s",
                        name="gait",
                    )


def make_gait(
    robot: Robot, *, speed: float = 0.3, stiffness: float = TUNED_STIFFNESS
) -> StraightGait:
    """The default walk of a robot.

    On a ground of stiffness k a stance foot aims deeper than the surface by 1.014 m g / k, the
    depth to which one foot sinks under the robot's weight. The factor is that of the tuned 5 mm for
    4.02 kg on 8 kN/m.

    Args:
        robot: a biped of Harpy's kind.
        speed: along x, m/s; zero is standing.
        stiffness: of the ground that the walk is for, N/m.

    Raises:
        InputError: a value out of its domain, or a ground so soft that the feet cannot reach so
            deep.
    """
    return StraightGait(
        robot,
        GaitParameters(speed=speed, penetration_offset=penetration_offset_on(robot, stiffness)),
    )


def penetration_offset_on(robot: Robot, stiffness: float) -> float:
    """How much deeper than the surface a stance foot of the default walk aims, m; see
    :func:`make_gait`.
    """
    checks.instance("robot", robot, Robot)
    stiffness = checks.number("stiffness of the ground", stiffness, low=0.0, strict=True)
    offset = TUNED_OFFSET * (TUNED_STIFFNESS / stiffness) * (robot.mass / TUNED_MASS)
    if offset > MAX_OFFSET:
        sinks = f"a foot would sink by {offset:g} m"
        raise InputError(
            f"a ground of stiffness {stiffness:g} N/m is too soft for this walk: {sinks}",
            name="stiffness",
            value=stiffness,
        )
    return offset


def tuned_parameters(robot: Robot) -> dict[str, Any]:
    """Settings of whole-body controllers for Harpy's walks: :data:`TUNED_PARAMETERS`, by the
    robot's mass.

    Args:
        robot: a biped of Harpy's kind. Forces scale with its mass, weights on squared forces with
            1/mass².
    """
    ratio = robot.mass / TUNED_MASS
    parameters = {**TUNED_PARAMETERS, "weights": {**TUNED_PARAMETERS["weights"]}}
    for name in ("min_normal_force", "max_normal_force"):
        parameters[name] *= ratio
    for name in ("thrust", "force"):
        parameters["weights"][name] /= ratio**2
    return parameters
