"""The joint PD controller: what a walk gets without an optimum.

    τ = τ_ff + K_p (q_t − q) + K_d (q̇_t − q̇)

q_t is the inverse kinematics of the gait's feet: of stance feet below an upright body at its height
and heading, of swing feet below the body as it is; of a sole, of its corners. Joints of no leg stay
where they are. τ_ff is the inverse dynamics of the gait's accelerations, with the least contact
forces that give the body its acceleration and turn it as little as they can, clipped to the
friction cones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import Command, Robot, State, WalkingGait
from harpy_pin.controllers.joint_targets import MAX_RATE
from harpy_pin.controllers.tasks import share_of_load
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.targets import mean_felt
from harpy_pin.kernels import kernel
from harpy_pin.kernels.calls import Call
from harpy_pin.model.cholesky import factorise, solve_vector
from harpy_pin.model.dynamics import DynamicsRecord, dynamics_record
from harpy_pin.model.legs import legs
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.model.vectors import rotation_in_plane, skew

GAINS_FILE = Path(__file__).with_name("gains.json")
"""What the search wrote: gains by robot, and what they came to."""
DAMPING = 1e-4
"""Of the inverse kinematics, as a share of the squared length of a leg."""
LOWERING = 4.0
"""Rate at which the body goes down from the posture to the height of the walk, 1/s."""
MOMENT = 0.1
"""Moment that is given up for a force of one, in heights of the robot: points in a line hold none
about it.
"""
TINY = 1e-6
"""Regularises what is held, and keeps off division by zero."""
FAST = 30.0
"""Largest target velocity of a joint, rad/s."""


@dataclass(frozen=True, kw_only=True)
class JointPDGains:
    """Gains of the joints.

    Stiffness is in units of m g l / n, with a leg of length l, one of n; damping in the same times
    √(l / g).
    """

    stance_p: float = 2.0  # stiffness of legs on the ground
    stance_d: float = 0.3  # damping of legs on the ground
    swing_p: float = 2.0  # stiffness of legs in the air
    swing_d: float = 0.3  # damping of legs in the air
    # share of the body's target velocity that is the commanded one; the rest is the measured one
    follow: float = 0.5


@cache
def found_gains() -> dict[str, Any]:
    """The file's document: what was found, by robot."""
    if not GAINS_FILE.exists():
        return {}
    document: dict[str, Any] = json.loads(GAINS_FILE.read_text(encoding="utf-8"))
    return document


class JointPDRecord(RecordOf):
    """Settings and work space."""

    mass: float  # kg
    rise: float  # height of the centre of mass, m
    mu: float  # friction coefficient to which the fed-forward forces are clipped
    double_support: float  # share of a step in which every foot is on the ground
    damping: float  # of the inverse kinematics, m²
    stance_p: float  # N·m/rad
    stance_d: float  # N·m·s/rad
    swing_p: float  # N·m/rad
    swing_d: float  # N·m·s/rad
    follow: float  # share of the body's target velocity that is the commanded one
    joint: NDArray[np.int64]  # (legs, n) columns of each leg's joints
    corners: int  # contact points of each leg
    share: Vector  # (joints,) of the gains that each joint has
    leg: NDArray[np.int64]  # (joints,) the leg of each; −1 of none, which has the gains of stance
    limit: Vector  # (joints,) of the torques, N·m
    higher: float  # than the height of the walk the body still is to be, m
    period: float  # between ticks, s
    begun: int  # 1 once there are joint targets
    planned: Vector = sized("nq")  # (nq,) the state with the targets of the joints
    rest: Vector = sized("nv")  # (nv,) zeros
    speed: Vector = sized("nv")  # (nv,) targets of the joints' velocities, rad/s
    acceleration: Vector = sized("nv")  # (nv,) that is fed forward
    place: Vector = sized("feet", 3)  # (feet, 3) targets of the feet in the body, m
    rate: Vector = sized("feet", 3)  # (feet, 3) velocities of the feet in the body, m/s
    force: Vector = sized("3 feet")  # (3 feet,) contact forces that are fed forward, N
    torque: Vector = sized("joints")  # (joints,) of the last tick, N·m
    jacobian: Vector = sized(
        "rows", "chain"
    )  # (3 corners, n) of a leg's contact points in the body
    square: Vector = sized("rows", "rows")  # (3 corners, 3 corners)
    error: Vector = sized("rows")  # (3 corners,)
    change: Vector = sized("chain")  # (n,) of a leg's joints
    dynamics: DynamicsRecord  # terms at the measured state
    target: DynamicsRecord  # terms at the joints' targets


class JointPD:
    """Feedforward, and stiffness and damping about inverse kinematics.

    It follows the same gait as the whole-body controllers, with the same footholds, touchdowns and
    accelerations.

    Args:
        gait: of a robot whose legs have three joints and point feet, or six joints and soles.
        gains: see there.
        mu: friction coefficient to which the fed-forward forces are clipped.
        period: time between ticks, s.
    """

    def __init__(
        self, gait: WalkingGait, gains: JointPDGains, *, mu: float, period: float = 1e-3
    ) -> None:
        self.gait, self.gains, self.period, self.robot = gait, gains, period, gait.robot
        robot, build = gait.robot, gait._build
        stiffness = robot.mass * GRAVITY * build.leg / len(robot.corners)
        damping = stiffness * float(np.sqrt(build.leg / GRAVITY))
        joint, corners, leg = (
            _joints_of_legs(robot),
            robot.corners[0],
            np.full(len(robot.joints), -1),
        )
        leg[joint - 6] = np.arange(len(joint))[:, None]
        inertia = (
            1.0
            / np.diag(
                pin.computeMinverse(robot.model, robot.model.createData(), gait.initial_state()[0])
            )[6:]
        )
        share = np.minimum(
            1.0, MAX_RATE * inertia / (max(gains.stance_d, gains.swing_d, TINY) * damping)
        )
        self._record = make_record(
            JointPDRecord,
            {
                **robot.sizes,
                "nq": robot.nq,
                "joints": len(robot.joints),
                "rows": 3 * corners,
                "chain": joint.shape[1],
            },
            mass=robot.mass,
            rise=build.rise,
            mu=mu,
            double_support=gait.double_support,
            damping=DAMPING * build.leg**2,
            stance_p=gains.stance_p * stiffness,
            stance_d=gains.stance_d * damping,
            swing_p=gains.swing_p * stiffness,
            swing_d=gains.swing_d * damping,
            follow=gains.follow,
            joint=joint,
            corners=np.int64(corners),
            share=share,
            leg=leg,
            limit=np.array(robot.model.effortLimit[6:]),
            higher=float(gait.initial_state()[0][2]) - build.height,
            period=period,
            begun=np.int64(0),
            dynamics=dynamics_record(robot),
            target=dynamics_record(robot),
        )
        self._records = (self._record, gait.record, gait.target.record)
        self.command = (field(self._record, "torque"), np.zeros((0, 3)))
        self._command = Command(*self.command)

    def reset(self) -> None:
        """Begin the inverse kinematics anew at the measured angles."""
        self._record["begun"] = 0

    def describe(self) -> Mapping[str, Any]:
        """Gains and gait, for the log's metadata."""
        return {"controller": "joint_pd", **asdict(self.gains), "gait": dict(self.gait.describe())}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The gait's signals, and which feet are in stance."""
        return {"stance": self.gait.target.stance, **self.gait.telemetry()}

    def step(self, state: State) -> Command:
        """Torques of one tick; those of the last one at a state that no robot can have."""
        self.gait.observe(state)
        self.gait.update(state.t)
        joint_torques(*self._records, state.q, state.v)
        return self._command

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """The kernels of a tick, for a loop in C (:mod:`harpy_pin.simulation.ticks`); None where
        Python takes part.
        """
        calls = self.gait.calls(state)
        return (
            None
            if calls is None
            else (*calls, Call(joint_torques, *self._records, state.q, state.v))
        )


def able(robot: Robot) -> bool:
    """Whether joint PD is for the robot: legs of three joints on point feet, or of six on soles."""
    return {(len(leg.joints), len(leg.points) > 1) for leg in legs(robot)} <= {
        (3, False),
        (6, True),
    }


def _joints_of_legs(robot: Robot) -> NDArray[np.int64]:
    """(legs, n) columns of the joints that move one foot each."""
    if not able(robot):
        counts = [len(leg.joints) for leg in legs(robot)]
        raise ValueError(
            "joint PD is for legs of 3 joints on point feet, or of 6 on soles; "
            f"those of '{robot.name}' have {counts}"
        )
    return np.array([[robot.model.joints[j].idx_v for j in leg.joints] for leg in legs(robot)])


@kernel
def joint_torques(
    r: JointPDRecord, p: WalkingRecord, o: GaitTargetRecord, q: Vector, v: Vector
) -> int:
    """Torques of one tick; returns what the state is.

    Args:
        r: settings and work space.
        p: what the gait knows.
        o: its targets.
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
    """
    verdict = update_terms(r.dynamics, q, v)
    if verdict != 0:
        return verdict
    if r.begun == 0:
        r.planned[:] = q
        r.begun = 1
    r.higher -= LOWERING * r.period * r.higher
    r.planned[:7] = q[:7]
    update_terms(r.target, r.planned, r.rest)
    r.acceleration[:] = 0.0
    r.acceleration[:3] = r.dynamics.tree.rotation[:2].T @ o.body[6:8]
    for k in range(o.stance.shape[0]):
        _foot_goal(r, p, o, v, k)
    for leg in range(r.joint.shape[0]):
        _inverse_kinematics(r, o, q, leg)
    _contact_forces(r, p, o)
    _add_up(r, o, q, v)
    return verdict


@kernel
def _foot_goal(r: JointPDRecord, p: WalkingRecord, o: GaitTargetRecord, v: Vector, k: int) -> None:
    """Place and velocity of a foot in the body: in an upright one if it is a stance foot."""
    frame, spin, place, rate = np.zeros((3, 3)), np.zeros(3), np.empty(3), np.empty(3)
    place[:], rate[:] = o.foot_position[k], o.foot_velocity[k]
    if o.stance[k] != 0.0:
        frame[:2, :2], frame[2, 2], spin[2] = rotation_in_plane(o.heading[0]), 1.0, o.heading[1]
        place[2] -= p.build.height + r.higher + p.planned.raised + mean_felt(p) - o.body[2]
        rate[:2] -= r.follow * (p.planned.desired - o.body[3:5])
        rate[2] -= p.planned.velocity[3] - LOWERING * r.higher - o.body[5]
    else:
        frame[:], spin[:] = r.dynamics.tree.rotation, v[3:6]
    r.place[k] = frame.T @ place
    r.rate[k] = frame.T @ rate - np.cross(spin, r.place[k])


@kernel
def _inverse_kinematics(r: JointPDRecord, o: GaitTargetRecord, q: Vector, leg: int) -> None:
    """Targets of a leg's joints: a step of Newton's method from those of the last tick; and what is
    fed forward.
    """
    turned, first, joint = r.dynamics.tree.rotation, leg * r.corners, r.joint[leg]
    _leg_jacobian(r, r.target, leg)
    for c in range(r.corners):
        error = r.error[3 * c : 3 * c + 3]
        error[:] = r.place[first + c]
        for j in range(3):
            error -= turned[j] * (r.target.foot_position[first + c, j] - q[j])
    _solve(r)
    for i in range(joint.shape[0]):
        r.planned[joint[i] + 1] += r.change[i]
    for c in range(r.corners):
        r.error[3 * c : 3 * c + 3] = r.rate[first + c]
    _solve(r)
    for i in range(joint.shape[0]):
        r.speed[joint[i]] = min(max(r.change[i], -FAST), FAST)
    if o.stance[first] == 0.0:
        _leg_jacobian(r, r.dynamics, leg)
        for c in range(r.corners):
            r.error[3 * c : 3 * c + 3] = turned.T @ o.foot_acceleration[first + c]
        _solve(r)
        for i in range(joint.shape[0]):
            r.acceleration[joint[i]] = r.change[i]


@kernel
def _leg_jacobian(r: JointPDRecord, d: DynamicsRecord, leg: int) -> None:
    """Motion of a leg's contact points in the body by its joints."""
    for c in range(r.corners):
        row = 3 * (leg * r.corners + c)
        moved = d.foot_jacobian[row : row + 3, r.joint[leg]]
        r.jacobian[3 * c : 3 * c + 3] = d.tree.rotation.T @ moved


@kernel
def _solve(r: JointPDRecord) -> None:
    """Jᵀ (J Jᵀ + λ)⁻¹ error: change of the joints that moves a leg's contact points so, as far as
    it can.
    """
    r.square[:] = r.damping * np.eye(r.square.shape[0])
    for c in range(r.jacobian.shape[1]):
        r.square += np.outer(r.jacobian[:, c], r.jacobian[:, c])
    factorise(r.square, r.square)
    solve_vector(r.square, r.error)
    r.change[:] = r.jacobian.T @ r.error


@kernel
def _contact_forces(r: JointPDRecord, p: WalkingRecord, o: GaitTargetRecord) -> None:
    """Least forces of the stance feet for the body's acceleration and no moment, as far as their
    places allow.
    """
    square, x, grasp = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 3))
    for i in range(6):
        square[i, i] = TINY if i < 3 else MOMENT * MOMENT
    for k in range(o.stance.shape[0]):
        if o.stance[k] != 0.0:
            share = share_of_load(o, k, r.double_support) * o.load[k]
            _grasp(r, p, k, grasp)
            for c in range(3):
                square += np.outer(share * grasp[:, c], grasp[:, c])
    x[:3] = r.mass * np.array((*p.demand.acceleration, GRAVITY))
    factorise(square, square)
    solve_vector(square, x)
    for k in range(o.stance.shape[0]):
        f = r.force[3 * k : 3 * k + 3]
        f[:] = 0.0
        if o.stance[k] != 0.0:
            share = share_of_load(o, k, r.double_support) * o.load[k]
            _grasp(r, p, k, grasp)
            f[:] = (share * grasp).T @ x
            f[2] = max(f[2], 0.0)
            across = np.hypot(f[0], f[1])
            if across > r.mu * f[2]:
                f[:2] = r.mu * f[2] / across * f[:2]


@kernel
def _grasp(r: JointPDRecord, p: WalkingRecord, k: int, out: Vector) -> None:
    """(6, 3) force, and moment about the centre of mass in heights of the robot, of a force on a
    foot.
    """
    out[:3] = np.eye(3)
    out[3:] = skew((p.measured.point[k] - p.measured.centre[:3]) / r.rise)


@kernel
def _add_up(r: JointPDRecord, o: GaitTargetRecord, q: Vector, v: Vector) -> None:
    """Feedforward, stiffness and damping, within the motors' limits."""
    d = r.dynamics
    r.torque[:] = d.bias[6:]
    for i in range(r.acceleration.shape[0]):
        r.torque += d.mass_matrix[6:, i] * r.acceleration[i]
    for i in range(r.force.shape[0]):
        r.torque -= d.foot_jacobian[i, 6:] * r.force[i]
    for j in range(r.torque.shape[0]):
        air = r.leg[j] >= 0 and o.stance[max(r.leg[j], 0) * r.corners] == 0.0
        stiffness, damping = (r.swing_p, r.swing_d) if air else (r.stance_p, r.stance_d)
        r.torque[j] += r.share[j] * stiffness * (r.planned[7 + j] - q[7 + j]) + r.share[
            j
        ] * damping * (r.speed[6 + j] - v[6 + j])
    r.torque[:] = np.clip(r.torque, -r.limit, r.limit)
