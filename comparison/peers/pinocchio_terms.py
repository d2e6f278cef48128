"""Pinocchio's own terms in place of our kernel's, and what that costs.

Solvers of this library take any :class:`~harpy_pin.model.dynamics.Dynamics`, whoever filled its arrays:
:class:`PinocchioTerms` fills them by Pinocchio's functions. A model that is computed elsewhere enters in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.controllers import make_contender
from comparison.measure.states import StateSequence
from comparison.measure.timing import Laps, summarise_repetitions, timer_overhead, without_gc
from comparison.peers.measure_peer import PeerSettings
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed import CondensedSolver

SOURCES = {"kernel": "our kernel", "pinocchio": "Pinocchio, called from Python"}
"""Where terms come from, as readers see it."""

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioTerms:
    """Fills the arrays of a :class:`~harpy_pin.model.dynamics.Dynamics` of a robot without rotors."""

    def __init__(self, robot: Robot) -> None:
        if robot.rotors:
            raise InputError("terms from Pinocchio are for robots without rotors", name="robot", value=robot)
        self.model, self.data = robot.model, robot.model.createData()
        self.feet = [robot.frame_id(name) for name in robot.feet]
        self.mounts = [robot.frame_id(name) for name in robot.thrusters]
        self.zero = np.zeros(self.model.nv)

    def fill(self, dynamics: Dynamics, q: Vector, v: Vector) -> None:
        """All terms at a state: CRBA, RNEA and Jacobians in ``computeAllTerms``, and drifts of the feet."""
        model, data = self.model, self.data
        pin.computeAllTerms(model, data, q, v)
        dynamics.mass_matrix[:] = data.M
        dynamics.bias[:] = data.nle
        pin.forwardKinematics(model, data, q, v, self.zero)
        pin.updateFramePlacements(model, data)
        for k, frame in enumerate(self.feet):
            rows = slice(3 * k, 3 * k + 3)
            dynamics.foot_jacobian[rows] = pin.getFrameJacobian(model, data, frame, _WORLD)[:3]
            dynamics.foot_drift[rows] = pin.getFrameClassicalAcceleration(model, data, frame, _WORLD).linear
            dynamics.foot_velocity[k] = pin.getFrameVelocity(model, data, frame, _WORLD).linear
            dynamics.foot_position[k] = data.oMf[frame].translation
        for k, frame in enumerate(self.mounts):
            dynamics.thruster_jacobian[3 * k : 3 * k + 3] = pin.getFrameJacobian(model, data, frame, _WORLD)[:3]
        dynamics.rotation[:] = data.oMi[1].rotation


def compare_terms(
    robot: Robot, sequences: Sequence[StateSequence], *, friction: float, settings: PeerSettings
) -> dict[str, Any]:
    """Condensed WBC and WBC QP with terms of both sources, in turns at every state; targets are made outside the clock.

    Returns:
        ``times`` of terms, condensed WBC and WBC QP by source, µs; ``difference``: largest one of a command, N and N·m,
        by controller; ``unsolved``: ticks that one of them did not solve.
    """
    controller = make_contender("wbc", robot, friction)
    parameters, problem = controller.parameters, controller.problem
    dynamics, targets = controller.dynamics, controller.targets
    fill = {"kernel": dynamics.update, "pinocchio": partial(PinocchioTerms(robot).fill, dynamics)}
    condensed = {name: CondensedSolver(robot, parameters.weights, parameters.limits) for name in SOURCES}
    states = [s for sequence in sequences for s in sequence.states[: settings.most]]
    counted = np.concatenate([np.arange(min(settings.most, len(s))) >= settings.warm_up for s in sequences])
    laps: dict[str, list[Laps]] = {name: [] for name in SOURCES}
    largest, unsolved = {"condensed": 0.0, "qp": 0.0}, 0
    inputs = {name: np.zeros(problem.n_thrust + problem.joints) for name in SOURCES}
    clock = perf_counter_ns
    with without_gc():
        overhead = timer_overhead()
        for _ in range(settings.repetitions):
            controller.reset()
            rows = {name: np.zeros((len(states), 3), dtype=np.int64) for name in SOURCES}
            for i, state in enumerate(states):
                controller.prepare(state)
                for name in SOURCES:
                    update, law = fill[name], condensed[name]
                    t0 = clock()
                    update(state.q, state.v)
                    t1 = clock()
                    law.solve(dynamics, state.v, dynamics.rotation, targets)
                    t2 = clock()
                    controller.build(state)
                    controller.solve()
                    t3 = clock()
                    rows[name][i] = t1 - t0, t2 - t1 + t1 - t0, t3 - t2 + t1 - t0
                    unsolved += int(law.status) > 3 or not controller.solution.usable
                    problem.inputs(controller.solution.z, inputs[name])
                for part, (a, b) in (
                    ("condensed", [condensed[name].inputs for name in SOURCES]),
                    ("qp", [inputs[name] for name in SOURCES]),
                ):
                    largest[part] = max(largest[part], float(np.abs(a - b).max()))
            for name in SOURCES:
                laps[name].append(rows[name][counted])
    times = {
        name: {
            part: summarise_repetitions([row[:, k] for row in laps[name]], overhead)
            for k, part in enumerate(("terms", "condensed", "qp"))
        }
        for name in SOURCES
    }
    return {"times": times, "difference": largest, "unsolved": unsolved, "ticks": int(np.count_nonzero(counted))}
