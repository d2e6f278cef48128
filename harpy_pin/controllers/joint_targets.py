"""Joint targets for motors that close a loop of their own, from the accelerations of the optimum.

A motor adds k_p (q* − q) + k_d (q̇* − q̇) to the torque that it is given, much faster than a
controller ticks (:class:`harpy_pin.model.state.Command`). The targets are the motion that the
optimum intends. Its joint accelerations a are integrated over ticks of length h, with a leak λ
towards what is measured,

    q* ← q* + h q̇* + ½ h² a + ρ (q − q*),    q̇* ← q̇* + h a + ρ (q̇ − q̇*),    ρ = 1 − e^(−λ h).

These are the targets at the beginning of a tick. A motor holds what it is given until the next one,
so the command has them half a tick later, q* + ½ h q̇* + ⅛ h² a and q̇* + ½ h a. Where the robot
moves as intended, motors add next to nothing: q* − q comes from the change of accelerations within
a tick alone. Where it does not, the difference is what it lags behind the intended motion over some
1/λ: the leak keeps targets from drifting away.

**What the model lacks of the joints.** Few files have the inertia that a motor's rotor adds to its
joint, the armature. Without it swing legs come late, the more so the faster they swing, and the
robot falls where it walks fast. So an inertia I and a damping b of every joint are learned while
walking, and its torque gets I a + b q̇*. As in the adaptive control of Slotine and Li ("On the
adaptive control of robot manipulators", 1987) they follow the gradient of the squared error of the
velocity, which needs no measured acceleration:

    (I, b) ← max((I, b) + ρ' k_d (q̇* − q̇) y / (⟨y²⟩ + y₀²), 0),    ρ' = 1 − e^(−η h),

where y is a and q̇, low-passed with the leak, ⟨y²⟩ its mean over some 1/η, and y₀ what a joint has
that hardly moves. The error q̇* − q̇ is that of the acceleration over λ, low-passed alike. A leg
whose foot is held does not learn, since its error is that of the contact.

At the first tick, and after one without a solution or with a bad sample, targets start at the
measured state. In a tick without a solution they are the measured motion; with bad samples they
stay, and the gains fade as the torques do.

Gains are the same for all joints: stiffness in units of m g l / 4, with the robot's mass m and the
length l of its leg, damping in the same times √(l/g). A light joint, such as a wrist, has smaller
ones, by which its damping alone would stop it at a rate of :data:`MAX_RATE`; it could not be faster
than some physics steps anyway.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.controllers.condensed_tick import CondensedTickRecord
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage
from harpy_pin.controllers.tick import TaskTickRecord
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait, GaitTargetRecord
from harpy_pin.gaits.walking import WalkingParameters
from harpy_pin.gaits.walking.build import build_of
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS
from harpy_pin.model.posed import free_inertia
from harpy_pin.model.record import ZERO, RecordOf, Records, fields, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.wbc.condensed.solve import TORQUE_CLIPPED

MAX_RATE = 500.0
"""Largest ratio of a joint's damping to its inertia where all other joints are free, 1/s."""

STILL = 0.2
"""Acceleration and velocity y₀, in g / leg and √(g / leg)."""
MOST_LACKING = 0.5
"""Largest inertia and damping that are learned, in units of a stiffness of one times leg / g and
√(leg / g).
"""


class JointTargetsRecord(RecordOf):
    """Targets of the joints."""

    period: float  # h, s
    share: float  # ρ
    lead: float  # from the beginning of a tick to where the command has the targets, s
    gains: Vector  # (2, joints) stiffness, N·m/rad, and damping, N·m·s/rad
    follows: int = ZERO  # whether the targets are those that the last tick led to
    target: Vector = sized(2, "joints")  # q* and q̇* at the beginning of the tick, rad and rad/s
    learning: float = 0.0  # η h
    still: Vector = sized(2)  # y₀ of acceleration and velocity, rad/s² and rad/s
    most: Vector = sized(2)  # largest inertia and damping that are learned, kg·m² and N·m·s/rad
    moves: Vector = sized("joints", "feet")  # 1 where a joint moves a foot
    limit: Vector = sized("joints")  # largest torque, N·m
    lacking: Vector = sized(2, "joints")  # I and b, kg·m² and N·m·s/rad
    motion: Vector = sized(2, "joints")  # y, rad/s² and rad/s
    square: Vector = sized(2, "joints")  # ⟨y²⟩
    law: Vector = sized(4, "joints")  # of the command: see :class:`harpy_pin.model.state.Command`


def joint_targets_record(
    robot: Robot, p: WholeBodyParameters, posture: Vector
) -> Records[JointTargetsRecord] | None:
    """What the motors of a robot are to be given; None where they are to have no law.

    Args:
        robot: with legs.
        p: of its controller.
        posture: (nq,) configuration in which it stands.

    Raises:
        InputError: it has no legs, whose length gives the gains their unit.
    """
    if p.joint_stiffness == p.joint_damping == 0.0:
        return None
    gains, unit = joint_gains(robot, p, posture), _units(robot, posture)
    above = [robot.carriers(foot) for foot in robot.feet]
    return make_record(
        JointTargetsRecord,
        robot.sizes,
        period=p.period,
        share=-np.expm1(-p.joint_leak * p.period),
        lead=0.5 * p.period,
        gains=gains,
        learning=-np.expm1(-p.joint_learning * p.period),
        still=STILL * unit[0] / unit[[2, 1]],
        most=MOST_LACKING * unit[[2, 1]],
        limit=p.limits.torque_scale * robot.torque_limit,
        moves=[[j in joints for joints in above] for j in robot.driven],
    )


def motors_stage(gait: Gait, p: WholeBodyParameters, set_law: Kernel[None]) -> Stage | None:
    """Joint targets in a controller whose kernel ``set_law`` closes its tick; None without them."""
    record = joint_targets_record(gait.robot, p, gait.initial_state()[0])
    if record is None:
        return None
    signals = {"joint_inertia_estimate": ("lacking", 0), "joint_damping_estimate": ("lacking", 1)}
    return Stage(name="motors", memory=fields(record), closing=(set_law,), signals=signals)


def _units(robot: Robot, posture: Vector) -> Vector:
    """Of stiffness, damping and inertia (3,), N·m/rad, N·m·s/rad and kg·m²: m g l / 4 times 1,
    √(l/g) and l/g.
    """
    leg = build_of(robot, posture, WalkingParameters()).leg
    return np.array(0.25 * robot.mass * GRAVITY * leg * np.sqrt(leg / GRAVITY) ** np.arange(3))


def joint_gains(robot: Robot, p: WholeBodyParameters, posture: Vector) -> Vector:
    """Stiffness and damping of each joint (2, joints); arguments and errors as of
    :func:`joint_targets_record`.
    """
    if not robot.feet or not all(map(robot.carriers, robot.feet)):
        message = (
            f"joint_stiffness and joint_damping are in units of a leg's length, and "
            f"'{robot.name}' has no legs"
        )
        raise InputError(message, name="joint_stiffness", value=p.joint_stiffness)
    stiffness, damping, _ = _units(robot, posture)
    inertia = free_inertia(robot, posture)
    share = np.minimum(1.0, MAX_RATE * inertia / max(p.joint_damping * damping, 1e-12))
    return np.array((p.joint_stiffness * stiffness * share, p.joint_damping * damping * share))


@kernel
def add_lacking(
    m: JointTargetsRecord,
    held: Vector,
    acceleration: Vector,
    usable: bool,
    v: Vector,
    torque: Vector,
) -> None:
    """Learn what the joints lack, and add it to the torques (joints,), within their limits; before
    :func:`move_targets`.

    It is learned by joints that move no ``held`` foot, from the error of the last tick's targets;
    arguments as there.
    """
    joints = m.gains.shape[1]
    measured = v[6 : 6 + joints]
    speed = np.where(m.follows == 0, measured, m.target[1])
    error = speed - measured
    for k in range(held.shape[0]):
        error *= 1.0 - held[k] * m.moves[:, k]
    y, still = m.motion, m.still * m.still
    m.square += m.learning * (y * y - m.square)
    step = m.learning * m.gains[1] * error * y / (m.square + still[:, None])
    m.lacking[:] = np.clip(m.lacking + step, 0.0, m.most[:, None])
    a = np.where(usable, acceleration[6 : 6 + joints], 0.0)
    m.motion[0] += m.share * (a - m.motion[0])
    m.motion[1] += m.share * (measured - m.motion[1])
    torque[:joints] = np.clip(
        torque[:joints] + m.lacking[0] * a + m.lacking[1] * speed, -m.limit, m.limit
    )


@kernel
def move_targets(
    m: JointTargetsRecord, acceleration: Vector, usable: bool, q: Vector, v: Vector
) -> None:
    """The law of this tick, and the targets at the beginning of the next.

    They follow the acceleration (nv,) of the optimum, where it is ``usable``, from the measured q
    (nq,) and v (nv,).
    """
    h, s = m.period, m.lead
    fresh, joints = m.follows == 0 or not usable, m.gains.shape[1]
    angle, speed = q[7 : 7 + joints], v[6 : 6 + joints]
    x, w = np.where(fresh, angle, m.target[0]), np.where(fresh, speed, m.target[1])
    a = np.where(usable, acceleration[6 : 6 + joints], 0.0)
    m.law[0], m.law[1], m.law[2:] = x + s * (w + 0.5 * s * a), w + s * a, m.gains
    m.target[0] = x + h * (w + 0.5 * h * a) + m.share * (angle - x)
    m.target[1] = w + h * a + m.share * (speed - w)
    m.follows = 1 if usable else 0


class MotorsTickRecord(TaskTickRecord):
    """A whole-body controller with joint targets."""

    motors: JointTargetsRecord  # of them


class CondensedMotorsRecord(MotorsTickRecord, CondensedTickRecord):
    """The condensed one."""


@kernel
def set_law(r: MotorsTickRecord, acceleration: Vector, usable: bool, q: Vector, v: Vector) -> None:
    """The motors' law of a tick, by the acceleration (nv,) of an optimum, where that is ``usable``.

    After a bad sample it is that of the last tick, which fades as the torques do.
    """
    m = r.motors
    if r.verdict == GOOD:
        add_lacking(m, r.targets.held, acceleration, usable, v, r.torque)
        move_targets(m, acceleration, usable, q, v)
    else:
        m.law[2:] *= FADE if r.bad_in_a_row > HOLD_TICKS else 1.0
        m.follows = 0


@kernel
def set_condensed_law(
    r: CondensedMotorsRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage that closes a tick of the condensed controller."""
    set_law(r, r.condensed.system.acceleration, r.status & TORQUE_CLIPPED == 0, q, v)
