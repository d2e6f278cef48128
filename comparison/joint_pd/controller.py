"""The joint PD controller: what a walk gets without an optimum."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from comparison.joint_pd.law import GRAVITY, JointPDRecord, joint_torques
from harpy_pin import Command, Robot, State, WalkingGait
from harpy_pin.compiled.calls import Call
from harpy_pin.model.dynamics import dynamics_record
from harpy_pin.model.record import field, make_record

GAINS_FILE = Path(__file__).with_name("gains.json")
"""What the search wrote: gains by robot, and what they came to."""
DAMPING = 1e-4
"""Of the inverse kinematics, as a share of the squared length of a leg."""
JOINTS = 3
"""Of a leg."""


@dataclass(frozen=True, kw_only=True)
class JointPDGains:
    """Gains of the joints.

    Stiffness is in units of m g l / n, with a leg of length l, one of n; damping in the same times √(l / g).

    Attributes:
        stance_p: stiffness of legs on the ground.
        stance_d: damping of legs on the ground.
        swing_p: stiffness of legs in the air.
        swing_d: damping of legs in the air.
        follow: share of the body's target velocity that is the commanded one; the rest is the measured one.
    """

    stance_p: float = 2.0
    stance_d: float = 0.3
    swing_p: float = 2.0
    swing_d: float = 0.3
    follow: float = 0.5


@cache
def found_gains() -> dict[str, Any]:
    """The file's document: what was found, by robot."""
    if not GAINS_FILE.exists():
        return {}
    document: dict[str, Any] = json.loads(GAINS_FILE.read_text(encoding="utf-8"))
    return document


class JointPD:
    """Feedforward, and stiffness and damping about inverse kinematics; see :mod:`comparison.joint_pd.law`.

    It follows the same gait as the whole-body controllers, with the same footholds, touchdowns and accelerations.

    Args:
        gait: of a robot with point feet and three joints a leg.
        gains: see there.
        mu: friction coefficient to which the fed-forward forces are clipped.
        period: time between ticks, s.
    """

    def __init__(self, gait: WalkingGait, gains: JointPDGains, *, mu: float, period: float = 1e-3) -> None:
        self.gait, self.gains, self.period, self.robot = gait, gains, period, gait.robot
        robot, build = gait.robot, gait._build
        stiffness = robot.mass * GRAVITY * build.leg / len(robot.feet)
        damping = stiffness * float(np.sqrt(build.leg / GRAVITY))
        self._record = make_record(
            JointPDRecord,
            {**robot.sizes, "nq": robot.model.nq, "joints": len(robot.joints)},
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
            joint=np.array([_joints_of(robot, name) for name in robot.feet]),
            limit=np.array(robot.model.effortLimit[6:]),
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
        """The gait's signals, and which feet should carry."""
        return {"stance": self.gait.target.stance, **self.gait.telemetry()}

    def step(self, state: State) -> Command:
        """Torques of one tick; those of the last one at a state that no robot can have.

        Args:
            state: as measured.
        """
        self.gait.observe(state)
        self.gait.update(state.t)
        joint_torques(*self._records, state.q, state.v)
        return self._command

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """The kernels of a tick, for a loop in C (:mod:`harpy_pin.simulation.ticks`); None where Python takes part.

        Args:
            state: arrays of the measured state, which stay where they are.
        """
        calls = self.gait.calls(state)
        return None if calls is None else (*calls, Call(joint_torques, *self._records, state.q, state.v))


def _joints_of(robot: Robot, foot: str) -> list[int]:
    """Columns of the joints between body and foot."""
    model = robot.model
    chain = [model.joints[j].idx_v for j in model.supports[model.frames[robot.frame_id(foot)].parentJoint] if j > 1]
    if len(chain) != JOINTS:
        raise ValueError(f"joint PD is for legs of {JOINTS} joints, '{robot.name}' has one of {len(chain)}")
    return chain
