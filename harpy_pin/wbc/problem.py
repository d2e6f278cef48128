"""The whole-body problem, whatever the variables in which it is written.

    minimise    Σ w ‖task(z) − desired‖²
    subject to  M a + n + B v = S τ + J_fᵀ f + J_tᵀ u              dynamics
                J_f a + J̇ v = a_foot  or  f = 0                    a foot in stance, or in swing
                                                                    (a flat foot as a rigid body)
                P f ≥ 0,  f_min ≤ f_z ≤ f_max                       friction pyramid, normal force
                |τ| ≤ τ_max, u in a box inside the limits of thrusters and rotors

Feet are contact points: point feet, and the corners of flat feet
(:mod:`harpy_pin.model.flat_foot`), each with a force and a friction pyramid. Many forces at the
corners of a flat foot have the same effect on the robot; the weight on contact forces makes the
optimum the smallest of them.

Dynamics and stance feet leave as many degrees of freedom as there are inputs. The formulations
differ in what they keep as variables (:mod:`harpy_pin.wbc.formulations`). The sizes never change:
the rows of a foot switch between holding it and making its force zero, so one solver keeps its
memory and its warm start through touchdown and lift-off.

In kernels of this package each letter has one meaning, an element of a record: ``d`` of the
dynamics, ``t`` of the targets, ``p`` of the problem (:class:`ProblemRecord`, or a record with more
fields), ``e`` of the elimination (:mod:`harpy_pin.wbc.condensed.elimination`), ``m`` what a
formulation keeps of the last state, ``qp`` of the program and ``w`` the work space of a search for
its optimum. ``v`` (nv,) is the generalised velocity and ``rotation`` (3, 3) takes body to world
axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import ZERO, Record, Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.targets import ProblemRecord, TargetsRecord, root_acceleration
from harpy_pin.wbc.weights import (
    WholeBodyLimits,
    WholeBodyTargets,
    WholeBodyWeights,
    check_terms,
    joint_weights,
    thrust_box,
)


class FormulationRecord(ProblemRecord):
    """The problem in a formulation."""

    corners: NDArray[np.int64]  # (feet of the robot,) contact points of each
    directions: int = ZERO  # of the held feet, where the formulation counts them


def problem_values(
    robot: Robot, weights: WholeBodyWeights, limits: WholeBodyLimits
) -> Mapping[str, Any]:
    """Fields of a :class:`ProblemRecord`."""
    torque, (lower, upper) = limits.torque_scale * robot.torque_limit, thrust_box(robot, limits)
    joints = [getattr(weights, name) for name in joint_weights(robot)]
    return {
        **{f"w_{name}": getattr(weights, name) for name in ("body", "swing", "thrust", "force")},
        **{
            name: getattr(limits, name)
            for name in ("give_way", "pyramid", "mu", "friction_share", "inscribed")
        },
        "w_motion": np.array([weights.body] * 3 + [weights.orientation] * 3 + joints),
        "torque_limit": torque,
        "input_lower": np.append(lower, -torque),
        "input_upper": np.append(upper, torque),
        "friction": np.full(len(robot.feet), limits.friction_share * limits.mu),
    }


@dataclass(frozen=True)
class FormulationKernels:
    """What a formulation does in a tick."""

    build: Kernel[None]  # fills in the program: (d, t, p, m, qp, v, rotation)
    inputs: Kernel[None]  # reads [u; τ] off a solution: (m, qp, z, out)
    force: Kernel[None]  # reads the contact forces off it: (p, m, qp, z, out)
    acceleration: Kernel[None]  # reads the generalised acceleration off it: (m, z, out)
    # puts limits of thrusts and torques into the program, or takes them out: (p, m, qp, on)
    limit: Kernel[None]
    # lets tasks give way to a solution without these limits: (d, t, p, m, qp, z)
    give_way: Kernel[None]


@fixed_arrays("record", "terms")
class WholeBodyProblem(KeepsViews):
    """A whole-body problem in one choice of variables, the bounded ones first.

    Args:
        robot: any robot; feet, thrusters or rotors may be absent.
        weights: of the tasks; by default those that fit the robot.
        limits: of the constraints.

    Attributes:
        program: the quadratic program, filled by :meth:`build`.
        record: weights and limits, for kernels.
        terms: what a formulation keeps of the last :meth:`build`, for kernels.
    """

    name: ClassVar[str]
    kernels: ClassVar[FormulationKernels]
    terms: Record
    _record_: Records[Any]
    _terms_: Records[Any]

    @checked
    def __init__(
        self,
        robot: Robot,
        weights: WholeBodyWeights | None = None,
        limits: WholeBodyLimits | None = None,
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights.for_robot(robot)
        self.limits = limits if limits is not None else WholeBodyLimits()
        self.feet, self.joints = len(robot.feet), len(robot.joints)
        self.nv, self.n_force, self.n_thrust = robot.nv, 3 * self.feet, robot.n_thrust
        # the pyramid's faces, and the range of the normal force
        self.foot_rows = len(self.limits.pyramid) + 1
        self.record = make_record(
            FormulationRecord,
            corners=np.array(robot.corners, dtype=np.int64),
            **problem_values(robot, self.weights, self.limits),
        )
        self.program, self.terms = self._allocate()
        self.program.weight_unit = self.weights.body or max(asdict(self.weights).values())

    @property
    def thrust_bounds(self) -> tuple[Vector, Vector]:
        """Arrays whose first entries are the least and largest thrust variables of the next
        program, N.
        """
        return field(self._record_, "input_lower"), field(self._record_, "input_upper")

    def _allocate(self) -> tuple[QuadraticProgram, Record]:
        """A program with everything that never changes in it, and what else the kernels need."""
        raise NotImplementedError

    def prepare(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """Begin to compile :meth:`build`.

        Args:
            dynamics: of the robot.
            targets: of the tasks.
        """
        check_terms(self.robot, dynamics, targets)
        self.kernels.build.prepare(
            *self._records(dynamics, targets), np.zeros(self.nv), dynamics.rotation
        )

    def build(
        self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets
    ) -> None:
        """Fill in the program; the objective anew as a whole, whatever was done to it since the
        last tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.

        Raises:
            InputError: terms or targets of another robot, or an array of another shape.
        """
        check_terms(self.robot, dynamics, targets)
        sample = as_array("v", v, (self.nv,)), as_array("rotation", rotation, (3, 3))
        self.kernels.build(*self._records(dynamics, targets), *sample)

    def _records(self, dynamics: Dynamics, targets: WholeBodyTargets) -> tuple[Records[Any], ...]:
        """What the kernels take first."""
        return (
            dynamics._record_,
            targets._record_,
            self._record_,
            self._terms_,
            self.program._record_,
        )

    def inputs(self, z: Vector, out: Vector) -> None:
        """Read the inputs off a solution of the program last built.

        Args:
            z: (n,) solution.
            out: (thrust variables + joints,) [u; τ] out: thrusts, N, and joint torques, N·m.

        Raises:
            InputError: an array of another size, or one that cannot be written into.
        """
        z = self._solution(z)
        if as_array("out", out, (self.n_thrust + self.joints,)) is not out:
            raise InputError(
                "out must be a float64 array in C order: it is overwritten", name="out", value=out
            )
        self.kernels.inputs(self._terms_, self.program._record_, z, out)

    def acceleration(self, z: Vector) -> Vector:
        """(nv,) generalised acceleration that a solution of the program last built brings about.

        Args:
            z: (n,) solution.
        """
        raise NotImplementedError

    def contact_force(self, z: Vector) -> Vector:
        """(feet, 3) contact forces that a solution of the program last built brings about, world
        axes, N.

        Args:
            z: (n,) solution.
        """
        force = np.zeros(self.n_force)
        self.kernels.force(
            self._record_, self._terms_, self.program._record_, self._solution(z), force
        )
        return force.reshape(-1, 3)

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """Accelerations and contact forces of any z of the program last built: [a; f] = X z + x₀.

        Args:
            held: (feet,) 1 where a foot is held on the ground, else 0, as in the targets of
                :meth:`build`.

        Returns:
            (nv + 3 feet, n) X and (nv + 3 feet,) x₀; the rows of swing feet are zero, as their
            forces are.
        """
        raise NotImplementedError

    def _solution(self, z: Vector) -> Vector:
        """A solution of the program, as kernels take it; refuses one of another size."""
        return as_array("z", z, self.program.gradient.shape)


def enter_pyramids(program: QuadraticProgram, pyramid: Vector, feet: int, *, force: int) -> None:
    """Enter the rows of pyramids and normal forces on force variables from index ``force``; see
    :func:`~harpy_pin.wbc.targets.friction_rows`."""
    rows = len(pyramid) + 1
    for k in range(feet):
        first, x = program.bounded + rows * k, force + 3 * k
        program.inequality[first : first + rows - 1, x : x + 3] = pyramid
        program.inequality[first + rows - 1, x + 2] = 1.0


@kernel
def add_tasks(
    weight: Vector, rows: Vector, value: Vector, hessian: Vector, gradient: Vector
) -> None:
    """Add ½ Σ weight_i (row_i z − value_i)² on the leading variables: to the lower triangle of H,
    and to g; zeros are skipped.
    """
    for i in range(rows.shape[0]):
        w, row, desired = weight[i], rows[i], value[i]
        if w != 0.0:
            for a in range(row.shape[0]):
                x = w * row[a]
                if x != 0.0:
                    gradient[a] -= x * desired
                    hessian[a, : a + 1] += x * row[: a + 1]


@kernel
def desired_acceleration(v: Vector, rotation: Vector, t: TargetsRecord, out: Vector) -> None:
    """Generalised acceleration (nv,) that the targets of body, orientation and posture ask for."""
    root_acceleration(v, rotation, t, out)
    out[6:] = t.joints


@kernel
def body_rows(
    d: DynamicsRecord, t: TargetsRecord, v: Vector, rotation: Vector, rows: Vector, value: Vector
) -> None:
    """The rows of the body's linear task along the world axes, where the centre of mass has the
    horizontal ones: ``rows`` (3, nv) a = ``value`` (3,), m/s², both out.

    The base's linear rows of M a + n are the robot's mass times the acceleration of its centre of
    mass, less gravity, in base axes: c̈ = R (M_l a + n_l) / m + g. The task of the body has these
    rows where a gait demands that acceleration
    (:attr:`harpy_pin.gaits.gait.GaitTarget.centre_of_mass`): of a robot on soles legs, torso and
    arms are heavy, and what they do moves its centre of mass against the origin of its base.

    The vertical one is that of the body's origin.
    """
    rows[:2] = rotation[:2] @ d.mass_matrix[:3] / d.mass_matrix[0, 0]
    rows[2, :3], rows[2, 3:] = rotation[2], 0.0
    value[:2] = t.body[:2] - t.centre_drift
    value[2] = t.body[2] - rotation[2] @ np.cross(v[3:6], v[:3])
