"""The problem that peers are given, and the solutions that are expected of them.

From recorded states our controller makes tasks, contact states and thrusts; our own program, solved tightly, gives the
expected solutions. Peers do not know a range of the normal force other than f_z ≥ 0, nor limits of thrust:
the expected solutions are those of the program without either. The thrusts come in two variants:

* ``given``: fixed at those of the complete program, a generalised force to the peer;
* ``decided``: free, with the program's own weight.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from comparison.measure.walking import StateSequence
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import Gait, make_gait
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights, make_solver
from harpy_pin.wbc.tasks.built_in import joint_weights

VARIANTS = ("given", "decided")
"""How the thrusts enter the problem."""

FACES = 4
"""Of the friction pyramid: what the peers have."""

_FREE = 1e4
"""A bound that no force reaches, N."""

TARGETS = ("body", "orientation", "feet", "joints", "held")
ARRAYS = ("q", "v", *TARGETS, "thrust", "thrust_force", "damping_force", "counted")


@dataclass(frozen=True)
class Expected:
    """Solutions of all states."""

    acceleration: Vector  # (ticks, nv) generalised, m/s² and rad/s², body axes
    torque: Vector  # (ticks, joints) N·m
    force: Vector  # (ticks, feet, 3) on the feet, world axes, N
    thrust: Vector  # (ticks, thrusters, 3) world axes, N
    solved: NDArray[np.bool_]  # (ticks,) whether the program was solved


@dataclass(frozen=True)
class PeerProblem:
    """What every peer is given, tick by tick."""

    settings: dict[str, Any]  # URDF, names, weights, gains and limits
    q: Vector  # (ticks, nq) configuration
    v: Vector  # (ticks, nv) generalised velocity
    body: Vector  # (ticks, 3) desired acceleration of the body, world axes, m/s²
    orientation: Vector  # (ticks, 3) desired angular acceleration, body axes, rad/s²
    feet: Vector  # (ticks, feet, 3) desired acceleration of the feet, world axes, m/s²
    joints: Vector  # (ticks, joints) desired joint accelerations, rad/s²
    held: Vector  # (ticks, feet) 1 where a foot is held
    thrust: Vector  # (ticks, thrusters, 3) given thrusts, world axes, N
    thrust_force: Vector  # (ticks, nv) J_tᵀ u of the given thrusts
    damping_force: Vector  # (ticks, nv) B v
    counted: Vector  # (ticks,) 0 in the warm-up of each sequence
    expected: dict[str, Expected]  # our solutions by variant

    def __len__(self) -> int:
        return len(self.q)

    @property
    def supports(self) -> dict[str, NDArray[np.bool_]]:
        """(ticks,) masks of single and double support; with more than two feet, of all held."""
        held, feet = self.held.sum(axis=1), len(self.settings["feet"])
        return {"single": held == 1.0, "double": held == 2.0} if feet == 2 else {"all": held == feet}

    def save(self, path: Path, repetitions: int) -> None:
        """Write the file that a worker reads."""
        settings = json.dumps({**self.settings, "repetitions": repetitions})
        np.savez(path, settings=np.array(settings), **{name: getattr(self, name) for name in ARRAYS})


def make_problem(
    robot: Robot,
    sequences: Sequence[StateSequence],
    *,
    friction: float,
    warm_up: int,
    most: int,
    gait: Gait | None = None,
    weights: WholeBodyWeights | None = None,
) -> PeerProblem:
    """Tasks, contact states and thrusts of recorded states, and our solutions.

    Of each sequence ``most`` ticks are taken from its start, of which those in the warm-up will not be counted. The
    gait is the robot's default where none is given, and so are the weights.
    """
    limits = WholeBodyLimits(mu=friction, faces=FACES)
    gait = make_gait(robot) if gait is None else gait
    parameters = WholeBodyParameters.for_gait(gait, formulation="full", limits=limits, weights=weights)
    controller = WholeBodyController(gait, parameters)
    problem, p, t = controller.problem, controller.parameters, controller.targets
    weights = p.weights
    program, n_thrust = problem.program, problem.n_thrust
    normal = program.bounded + np.arange(1, problem.feet + 1) * problem.foot_rows - 1  # rows of f_z
    box = program.lower[:n_thrust].copy(), program.upper[:n_thrust].copy()
    solvers = {name: make_solver("active_set", program) for name in ("complete", *VARIANTS)}
    rows: list[tuple[Vector, ...]] = []
    solutions: dict[str, list[tuple[Any, ...]]] = {name: [] for name in VARIANTS}
    inputs = np.zeros(n_thrust + problem.joints)
    for sequence in sequences:
        controller.reset()
        for i, state in enumerate(sequence.states[:most]):
            controller.prepare(state)
            program.lower[:n_thrust], program.upper[:n_thrust] = box
            controller.build(state)
            complete = solvers["complete"].solve(program)
            problem.inputs(complete.z, inputs)
            thrust, usable = inputs[:n_thrust].copy(), complete.usable
            # No range of the normal force but f_z ≥ 0.
            program.lower[normal] = np.where(t.held != 0.0, 0.0, -1.0)
            program.upper[normal] = np.where(t.held != 0.0, _FREE, 1.0)
            for name, bounds in (("given", (thrust, thrust)), ("decided", (-_FREE, _FREE))):
                program.lower[:n_thrust], program.upper[:n_thrust] = bounds
                solution = solvers[name].solve(program)
                problem.inputs(solution.z, inputs)
                z, solved = solution.z, bool(usable and solution.status == 0)
                solutions[name].append((problem.acceleration(z), problem.contact_force(z), inputs.copy(), solved))
            forces = thrust @ controller.dynamics.thruster_jacobian, robot.model.damping * state.v
            targets = (getattr(t, key).copy() for key in TARGETS)
            rows.append((state.q, state.v, *targets, thrust.reshape(-1, 3), *forces, np.array(float(i >= warm_up))))
    expected = {}
    for name in VARIANTS:
        acceleration, force, given, found = (np.array(part) for part in zip(*solutions[name], strict=True))
        thrusts = given[:, :n_thrust].reshape(len(given), -1, 3)
        expected[name] = Expected(acceleration, given[:, n_thrust:], force, thrusts, found)
    settings = {
        "urdf": str(robot.urdf),
        # The link on the free flyer.
        "base": next(f.name for f in robot.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == 1),
        "joints": robot.joints,
        "feet": robot.feet,
        "thrusters": robot.thrusters,
        "armature": robot.model.armature.tolist(),
        "torque_limit": (problem.limits.torque_scale * robot.torque_limit).tolist(),
        "mu": float(limits.pyramid[0, 2]),
        "weights": {name: getattr(weights, name) for name in ("body", "orientation", "swing", "thrust", "force")},
        "posture_weights": [getattr(weights, name) for name in joint_weights(robot)],
        "gains": {"orientation": p.orientation, "posture": p.posture, "contact": p.contact_damping},
        "posture": controller.gait.initial_state()[0][7:].tolist(),
    }
    arrays = {name: np.array(part) for name, part in zip(ARRAYS, zip(*rows, strict=True), strict=True)}
    return PeerProblem(settings, **arrays, expected=expected)
