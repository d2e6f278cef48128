"""Short cases for the peers, and one that no walk reaches."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import harpy_pin as hp
from comparison.measure.walking import StateSequence
from comparison.peers.cases import cases
from comparison.peers.peer_problem import Case, PeerProblem
from harpy_pin.model.state import State

Make = Callable[[str], tuple[Case, PeerProblem]]
"""A case and its problem by the name of the case."""
CASES: dict[str, Callable[[], Case]] = cases(friction=0.25, duration=0.9, warm_up=10)


def elbow_case() -> Case:
    """G1 with dry friction and damping in its joints, thrown, with an elbow that runs into its
    end.
    """
    robot = hp.load_robot("g1").with_joints(friction=0.7, damping=0.3)
    gait = hp.Standing(robot)
    case = replace(CASES["g1 on soles, stands"](), gait=gait)
    elbow = robot.joints.index("left_elbow_joint")
    states, dynamics, rng = [], hp.Dynamics(robot), np.random.default_rng(0)
    for k in range(8):
        q, v = gait.initial_state()
        q[7 + elbow] = robot.joint_upper[elbow] - 0.05
        v[6:] = 0.2 * rng.standard_normal(len(robot.joints))
        v[6 + elbow] = 4.0
        v[:6] = 0.6 * rng.standard_normal(6)  # more than the cones allow to catch: tasks compete
        dynamics.update(q, v)
        force = np.tile((0.0, 0.0, robot.mass * 9.81 / 8), (8, 1))
        states.append(
            State(
                0.001 * k, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force
            )
        )
    return replace(case, sequences=(StateSequence("elbow", tuple(states)),), first=0)
