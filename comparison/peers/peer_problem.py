"""The program that peers are given, tick by tick, and the solutions that are expected of them.

Everything is taken from the records that our controllers solve, after their tasks are known:
desired accelerations with the braking of joints before their ends, weights, which feet are held and
which corners loaded, friction and damping of joints. Peers get the model's own numbers, too
(:mod:`comparison.peers.model_file`). They compute Jacobians, mass matrix and bias forces
themselves, as that is a part of their tick.

The program is the one that all can pose. A normal force has no range but f_z ≥ 0, pyramids have
four faces, thrusts no limit, no task gives way. Torque limits are rows of it. The expected
solutions are those of our formulation ``full``, solved to rounding.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import harpy_pin as hp
from comparison.measure.walking import StateSequence
from comparison.peers.model_file import BASE, links_of, sole_corners, write_model
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.weights import joint_weights

FACES = 4
"""Of the friction pyramid: what the peers have."""

OWN_SEARCH: dict[str, Any] = {"solver": "active_set"}
"""Our solver of our whole-body QP."""

FREE = 1e6
"""A normal force that no foot has, N."""

SCALE = 1e3
"""Of all weights. It changes no optimum, and lifts the least weights above the regularisation of
TSID's solver.
"""
POSTURE = 1e-6
"""Weight of the legs' joints, 1e-9 of that of the body. The condensed WBC does not have this cost,
and its torques differ in proportion to it.
"""


@dataclass(frozen=True)
class Case:
    """A robot and its states, and the program that is solved at each of them."""

    name: str  # for readers: robot, contacts, and what it does
    gait: hp.Gait
    sequences: tuple[StateSequence, ...]
    parameters: hp.controllers.WholeBodyParameters
    first: int  # tick of each sequence from which on times count
    ankles: bool = False  # whether legs on points have joints that no foot determines


def common_program(
    gait: hp.Gait, friction: float, *, posture: float = POSTURE
) -> hp.controllers.WholeBodyParameters:
    """The settings that fit a gait, less what the peers lack.

    Args:
        gait: whose settings.
        friction: coefficient that is assumed.
        posture: weight of the legs' joints.
    """
    own = hp.controllers.WholeBodyParameters.for_gait(gait, limits={"mu": friction})
    w = own.weights
    weights = hp.wbc.WholeBodyWeights(
        body=SCALE * w.body,
        orientation=SCALE * w.orientation,
        swing=SCALE * w.swing,
        posture=posture,
        arms=SCALE * w.arms,
        thrust=SCALE * w.thrust,
        force=SCALE * w.force,
    )
    limits = replace(own.limits, faces=FACES, give_way=1.0)
    return replace(
        own,
        weights=weights,
        limits=limits,
        min_normal_force=0.0,
        max_normal_force=FREE,
        estimate_friction=False,
        **OWN_SEARCH,
    )


@dataclass(frozen=True)
class Expected:
    """Solutions of all states."""

    acceleration: Vector  # (ticks, nv) generalised, m/s² and rad/s², body axes
    torque: Vector  # (ticks, joints) N·m
    force: Vector  # (ticks, contact points, 3) on the robot, world axes, N
    thrust: Vector  # (ticks, thrusters, 3) world axes, N
    solved: NDArray[np.bool_]  # (ticks,) whether the program was solved


ARRAYS = (
    "q",
    "v",
    "body",
    "orientation",
    "feet",
    "joints",
    "brake",
    "held",
    "loaded",
    "sole",
    "resistance",
    "counted",
)


@dataclass(frozen=True)
class PeerProblem:
    """What every peer is given, tick by tick."""

    settings: dict[str, Any]  # names of links and joints, weights and limits
    q: Vector  # (ticks, nq) configuration
    v: Vector  # (ticks, nv) generalised velocity
    # (ticks, 3) desired acceleration of the body's origin, world axes, m/s²; where the settings say
    # ``centred`` its
    # first two entries are that of the centre of mass
    body: Vector
    orientation: Vector  # (ticks, 3) desired angular acceleration of the body, world axes, rad/s²
    feet: Vector  # (ticks, contact points, 3) desired accelerations, world axes, m/s²
    joints: Vector  # (ticks, joints) desired accelerations, rad/s²
    # (ticks, joints) what is added to the weights of joints near the ends of their ranges
    brake: Vector
    held: Vector  # (ticks, contact points) 1 where a foot is held
    # (ticks, contact points) 1 where a point may bear load; a held sole may lift a corner
    loaded: Vector
    # (ticks, soles, 6) acceleration with which a held sole follows its corners, world axes, m/s²,
    # rad/s²
    sole: Vector
    resistance: Vector  # (ticks, nv) damping and friction of the joints, against their motion, N·m
    counted: Vector  # (ticks,) 1 where times count
    expected: Expected

    def __len__(self) -> int:
        return len(self.q)

    def save(self, path: Path, repetitions: int, options: Mapping[str, Any]) -> None:
        """Write the file that a worker reads, with how often it replays, and options of its own."""
        settings = json.dumps({**self.settings, **options, "repetitions": repetitions})
        np.savez(
            path, settings=np.array(settings), **{name: getattr(self, name) for name in ARRAYS}
        )


def make_problem(case: Case, urdf: Path) -> PeerProblem:
    """What peers are given of a case, and our solutions.

    Args:
        case: whose states and program.
        urdf: file to which the model is written.

    Raises:
        InputError: a program that the peers do not have.
    """
    controller = hp.WholeBodyController(
        case.gait, replace(case.parameters, formulation="full", **OWN_SEARCH)
    )
    robot, problem = controller.robot, controller.problem
    write_model(robot, urdf)
    ticks: list[tuple[Vector, ...]] = []
    solutions: list[tuple[Any, ...]] = []
    centred: set[bool] = set()
    data = robot.model.createData()
    inputs = np.zeros(problem.n_thrust + problem.joints)
    for sequence in case.sequences:
        controller.reset()
        for i, state in enumerate(sequence.states):
            controller.prepare(state)
            controller.build(state)
            solution = controller.solve()
            z = solution.z
            problem.inputs(z, inputs)
            solved = solution.status is hp.wbc.QPStatus.SOLVED
            solutions.append(
                (problem.acceleration(z), problem.contact_force(z), inputs.copy(), solved)
            )
            ticks.append((*_handed_over(controller, state, data), np.array(float(i >= case.first))))
            centred.add(controller.targets.centred)
    if len(centred) > 1:
        raise hp.InputError(f"{case.name}: the task of the body changes from tick to tick")
    acceleration, force, given, found = (np.array(part) for part in zip(*solutions, strict=True))
    thrust = given[:, : problem.n_thrust].reshape(len(given), -1, 3)
    expected = Expected(acceleration, given[:, problem.n_thrust :], force, thrust, found)
    weights, links = case.parameters.weights, links_of(robot)
    settings = {
        "urdf": str(urdf),
        "base": BASE,
        "joints": robot.joints,
        "contacts": links.contacts,
        "thrusters": links.thrusters,
        "soles": links.soles,
        "corners": sole_corners(robot).tolist(),
        "centred": centred.pop(),
        "armature": robot.model.armature.tolist(),
        "torque_limit": (problem.limits.torque_scale * robot.torque_limit).tolist(),
        "mu": float(problem.limits.pyramid[0, 2]),
        "weights": {
            name: getattr(weights, name)
            for name in ("body", "orientation", "swing", "thrust", "force")
        },
        "joint_weights": [getattr(weights, name) for name in joint_weights(robot)],
    }
    arrays = {
        name: np.array(part) for name, part in zip(ARRAYS, zip(*ticks, strict=True), strict=True)
    }
    return PeerProblem(settings, **arrays, expected=expected)


def _handed_over(
    controller: hp.WholeBodyController, state: State, data: pin.Data
) -> tuple[Vector, ...]:
    """What peers are given of a tick, of which the program was built: :data:`ARRAYS` but the
    last.
    """
    robot, d, t = controller.robot, controller.dynamics, controller.targets
    if t.tilted or np.isfinite(t.friction).any():
        raise hp.InputError("peers are given level ground, and one friction coefficient")
    # The controllers' bias forces have the friction of joints in them.
    free = pin.rnea(robot.model, data, state.q, state.v, np.zeros(robot.model.nv))
    resistance = d.damping * state.v + d.bias - free
    weights = controller.parameters.weights
    each = np.array([getattr(weights, name) for name in joint_weights(robot)])
    return (
        state.q,
        state.v,
        t.body.copy(),
        d.rotation @ t.orientation,
        t.feet.copy(),
        t.joints.copy(),
        (t.joint_share - 1.0) * each,
        t.held.copy(),
        (t.held * (t.force_range[:, 1] > 0.0)),
        np.array([_motion_of_sole(controller, n) for n in range(len(robot.flat_feet))]).reshape(
            -1, 6
        ),
        resistance,
    )


def _motion_of_sole(controller: hp.WholeBodyController, n: int) -> Vector:
    """Acceleration of a sole, linear in its middle and angular, that is nearest to those desired of
    its corners.

    It is the solution of the rows of :func:`harpy_pin.model.terms.flat_foot_rows`: with ρ_i from
    the middle to the corners, Σ (a_i − α_i) = 0 and Σ ρ_i × (a_i − α_i) = 0, where a_i = a + ω̇ ×
    ρ_i + ω × (ω × ρ_i).
    """
    d, corners = controller.dynamics, slice(4 * n, 4 * n + 4)
    arm = d.foot_position[corners] - d.foot_position[corners].mean(axis=0)
    spread = np.sum(arm * arm) * np.eye(3) - arm.T @ arm  # Σ ρ × (x × ρ) = S x
    turn = np.linalg.solve(spread, np.cross(arm, d.foot_velocity[corners]).sum(axis=0))
    inward = np.cross(turn, np.cross(turn, arm))
    desired = controller.targets.feet[corners]
    angular = np.linalg.solve(spread, np.cross(arm, desired - inward).sum(axis=0))
    return np.concatenate((desired.mean(axis=0), angular))
