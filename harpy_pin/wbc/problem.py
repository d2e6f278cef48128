"""The whole-body problem, whatever the variables in which it is written.

    minimise    Σ w ‖task(z) − desired‖²
    subject to  M a + n + B v = S τ + J_fᵀ f + J_tᵀ u              dynamics
                J_f a + J̇ v = a_foot  or  f = 0                    a foot in stance, or in swing
                                                                    (a flat foot as a rigid body)
                P f ≥ −s                                            friction pyramid
                f_min − s ≤ f_z ≤ f_max − s
                |τ| ≤ τ_max, u in a box inside the limits of thrusters and rotors
                s ≥ 0, one for each foot, or no s at all

Feet are contact points: point feet, and the corners of flat feet (:mod:`harpy_pin.model.flat_foot`), each with a force
and a friction pyramid. Many forces at the corners of a flat foot have the same effect on the robot; the weight on
contact forces makes the optimum the smallest of them. The tasks are those of :mod:`harpy_pin.wbc.tasks.built_in`.

Dynamics and stance feet leave as many degrees of freedom as there are inputs. The formulations differ in what they keep
as variables (:mod:`harpy_pin.wbc.formulations`). The sizes never change: the rows of a foot switch between holding it
and making its force zero, so one solver keeps its memory and its warm start through touchdown and lift-off.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import ZERO, Record, RecordOf, field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.giving_way import at_a_limit
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram
from harpy_pin.wbc.tasks.built_in import joint_weights
from harpy_pin.wbc.weights import (
    TargetsRecord,
    TaskWeightsRecord,
    WholeBodyLimits,
    WholeBodyTargets,
    WholeBodyWeights,
    check_terms,
    thrust_box,
)

__all__ = ["WholeBodyProblem"]

SLACK_CURVATURE = 1e-3
"""Weight of the square of a foot's slack, relative to that of the slack itself, 1/N: it makes the optimum unique."""


class PyramidRecord(RecordOf):
    """Friction of the feet, and the pyramids in their cones.

    Attributes:
        pyramid: rows p of a pyramid, p f ≥ 0: (faces, 3), or (feet, faces, 3) where each foot has its own.
        mu: friction coefficient of the ground.
        friction_share: share of μ that is used; what is left is for errors of μ, of the model, and for impacts.
        inscribed: share of the cone's slope that the faces of the pyramid have.
        friction: (feet,) coefficient of each foot, after the safety margin.
    """

    pyramid: Vector
    mu: float
    friction_share: float
    inscribed: float
    friction: Vector


class ProblemRecord(PyramidRecord, TaskWeightsRecord):
    """Weights, limits and work space of a :class:`WholeBodyProblem`, for kernels.

    Attributes:
        w_posture: of the accelerations of the joints between base and feet.
        offset: (joints,) torques at zero acceleration, thrust and force, N·m.
        input_lower: (inputs,) limits of [u; τ], N and N·m; infinite where nothing gives way.
        input_upper: (inputs,) likewise.
        w_joint: (joints,) weight of each joint's acceleration.
        corners: (feet of the robot,) contact points of each.
        w_slack: weight of a violation, 1/N.
        violation: of the last solution, where it was found in one call.
        directions: of the held feet, where the formulation counts them.
    """

    w_posture: float
    offset: Vector = sized("joints")
    input_lower: Vector
    input_upper: Vector
    w_joint: Vector
    corners: NDArray[np.int64]
    w_slack: float
    violation: float = 0.0
    directions: int = ZERO


class WholeBodyProblem(KeepsViews):
    """A whole-body problem in one choice of variables, the bounded ones first: [u; …; s; …].

    Args:
        robot: any robot; feet, thrusters or rotors may be absent.
        weights: of the tasks.
        limits: of the constraints.

    Attributes:
        program: the quadratic program, filled by :meth:`build`.
        record: weights and limits, for kernels.
        terms: what a formulation keeps of the last :meth:`build`, for kernels.
        gives_way: whether tasks give way where torques are at their limits.

    Raises:
        InputError: the limits ask for another cone than a pyramid.
    """

    name: ClassVar[str]
    can_give_way: ClassVar[bool] = True
    terms: Record

    @checked
    def __init__(
        self, robot: Robot, weights: WholeBodyWeights | None = None, limits: WholeBodyLimits | None = None
    ) -> None:
        checks.instance("robot", robot, Robot)
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights()
        self.limits = limits if limits is not None else WholeBodyLimits()
        self.feet, self.joints = len(robot.feet), len(robot.joints)
        self.nv, self.n_force, self.n_thrust = robot.model.nv, 3 * self.feet, robot.n_thrust
        self.n_slack = self.feet if self.limits.slack > 0.0 else 0
        self._torque_limit = self.limits.torque_scale * robot.torque_limit
        self._pyramid = self.limits.pyramid
        self.gives_way = self.can_give_way and self.limits.give_way < 1.0
        lower, upper = np.full((2, self.n_thrust + self.joints), np.inf) * np.array([[-1.0], [1.0]])
        if self.gives_way:
            box = thrust_box(robot, self.limits)
            lower, upper = np.append(box[0], -self._torque_limit), np.append(box[1], self._torque_limit)
        self.foot_rows = len(self._pyramid) + 1  # the pyramid's faces, and the range of the normal force
        self.record = make_record(
            ProblemRecord,
            robot.sizes,
            **{f"w_{name}": value for name, value in asdict(self.weights).items()},
            pyramid=self._pyramid,
            mu=self.limits.mu,
            friction_share=self.limits.friction_share,
            inscribed=self.limits.inscribed,
            friction=np.full(self.feet, self.limits.friction_share * self.limits.mu),
            torque_limit=self._torque_limit,
            w_joint=np.array([getattr(self.weights, name) for name in joint_weights(robot)]),
            corners=np.array(robot.corners, dtype=np.int64),
            give_way=self.limits.give_way,
            input_lower=lower,
            input_upper=upper,
            w_slack=self.limits.slack,
        )
        self.program = self._allocate()

    @property
    def thrust_bounds(self) -> list[tuple[Vector, Vector]]:
        """Arrays whose first entries are the least and largest thrust variables of the next program, N."""
        own = (field(self.record, "input_lower"), field(self.record, "input_upper"))
        return [own, (self.program.lower, self.program.upper)]

    def _allocate(self) -> QuadraticProgram:
        """A program with everything that never changes in it."""
        raise NotImplementedError

    def prepare(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """Begin to compile :meth:`build`.

        Args:
            dynamics: of the robot.
            targets: of the tasks.
        """

    def _rehearse(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """Call what few ticks need, so that none of them waits for a compiler; the program is to be built anew.

        Args:
            dynamics: of the robot.
            targets: of the tasks.
        """
        z, inputs = np.zeros(len(self.program.gradient)), np.zeros(self.n_thrust + self.joints)
        if self.gives_way:
            for on in (False, True):
                self._put_limits(on)
            self._let_give_way(dynamics, targets, z)
        self.inputs(z, inputs)
        at_a_limit(inputs, self.record)

    def build(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """Fill in the program; the objective anew as a whole, whatever was done to it since the last tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.

        Raises:
            InputError: terms or targets of another robot, or an array of another shape.
        """
        check_terms(self.robot, dynamics, targets)
        self._fill(dynamics, as_array("v", v, (self.nv,)), as_array("rotation", rotation, (3, 3)), targets)

    def _fill(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """As :meth:`build`, of arguments that were checked: for controllers, in every tick."""
        raise NotImplementedError

    def inputs(self, z: Vector, out: Vector) -> None:
        """Read the inputs off a solution of the program last built: its first variables, where torques are variables.

        Args:
            z: (n,) solution.
            out: (thrust variables + joints,) [u; τ] out: thrusts, N, and joint torques, N·m.
        """
        out = self._output(out)
        out[:] = self._solution(z)[: len(out)]

    def acceleration(self, z: Vector) -> Vector:
        """(nv,) generalised acceleration that a solution of the program last built brings about.

        Args:
            z: (n,) solution.
        """
        raise NotImplementedError

    def contact_force(self, z: Vector) -> Vector:
        """(feet, 3) contact forces that a solution of the program last built brings about, world axes, N.

        Args:
            z: (n,) solution.
        """
        raise NotImplementedError

    def _put_limits(self, on: bool) -> None:
        """Put the limits of thrusts and torques into the program last built, or take them out.

        Args:
            on: whether they hold.
        """

    def _let_give_way(self, dynamics: Dynamics, targets: WholeBodyTargets, z: Vector) -> None:
        """Let swing feet and least forces give way in the program last built (:mod:`harpy_pin.wbc.giving_way`).

        Args:
            dynamics: as of :meth:`build`.
            targets: as of :meth:`build`.
            z: (n,) solution without limits of thrusts and torques.
        """

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """Accelerations and contact forces of any z of the program last built: [a; f] = X z + x₀.

        Args:
            held: (feet,) 1 where a foot is held on the ground, else 0, as in the targets of :meth:`build`.

        Returns:
            (nv + 3 feet, n) X and (nv + 3 feet,) x₀; the rows of swing feet are zero, as their forces are.
        """
        raise NotImplementedError

    def _solution(self, z: Vector) -> Vector:
        """A solution of the program, as kernels take it.

        Raises:
            InputError: it has another size.
        """
        return as_array("z", z, self.program.gradient.shape)

    def _output(self, out: Vector) -> Vector:
        """Where inputs are written.

        Raises:
            InputError: it is no float64 array of their number.
        """
        size = self.n_thrust + self.joints
        if as_array("out", out, (size,)) is not out:
            raise InputError("out must be a float64 array in C order: it is overwritten", name="out", value=out)
        return out

    def check_rows(self, matrix: Vector) -> None:
        """Refuse rows on [a; f] that this formulation cannot take; here it takes all.

        Args:
            matrix: (m, nv + 3 feet).
        """

    def _bound(self, program: QuadraticProgram, *, torque: bool, slack: int) -> None:
        """Enter the bounds of thrusts, of torques where they are variables, and of the slacks from index ``slack``."""
        nt = self.n_thrust
        if nt:
            program.lower[:nt], program.upper[:nt] = thrust_box(self.robot, self.limits)
        if torque:
            program.lower[nt : nt + self.joints] = -self._torque_limit
            program.upper[nt : nt + self.joints] = self._torque_limit
        self._bound_slacks(program, slack=slack)

    def _bound_slacks(self, program: QuadraticProgram, *, slack: int) -> None:
        """Enter the slacks from index ``slack``: their bounds, and their columns of the feet's rows."""
        for k in range(self.n_slack):
            program.lower[slack + k] = 0.0
            first = program.bounded + self.foot_rows * k
            program.inequality[first : first + self.foot_rows, slack + k] = 1.0

    def _friction(self, program: QuadraticProgram, *, force: int) -> None:
        """Enter the pyramids' rows on force variables from index ``force``; see :func:`friction_rows`."""
        for k in range(self.feet):
            first, x = program.bounded + self.foot_rows * k, force + 3 * k
            program.inequality[first : first + self.foot_rows - 1, x : x + 3] = self._pyramid
            program.inequality[first + self.foot_rows - 1, x + 2] = 1.0


@kernel
def add_task(weight: float, row: Vector, value: float, hessian: Vector, gradient: Vector) -> None:
    """Add ½ weight (row z − value)² on the leading variables: to the lower triangle of H, and to g."""
    for a in range(row.shape[0]):
        x = weight * row[a]
        if x != 0.0:
            gradient[a] -= x * value
            for b in range(a + 1):
                hessian[a, b] += x * row[b]


@kernel
def clear_objective(p: ProblemRecord, qp: ProgramRecord, slack: int, slacks: int) -> None:
    """Zero H and g, then the costs of the slacks from index ``slack``."""
    qp.hessian[:] = 0.0
    qp.gradient[:] = 0.0
    for k in range(slack, slack + slacks):
        qp.gradient[k] = p.w_slack
        qp.hessian[k, k] = SLACK_CURVATURE * p.w_slack


@kernel
def mirror(hessian: Vector, size: int) -> None:
    """Copy the leading lower triangle above the diagonal."""
    for a in range(size):
        for b in range(a):
            hessian[b, a] = hessian[a, b]


@kernel
def motion_task(i: int, p: ProblemRecord) -> float:
    """Weight of the task on entry i of the generalised acceleration: body, orientation, or a joint's."""
    return p.w_body if i < 3 else (p.w_orientation if i < 6 else p.w_joint[i - 6])


@kernel
def desired_acceleration(v: Vector, rotation: Vector, t: TargetsRecord, out: Vector) -> None:
    """Generalised acceleration that the targets of body, orientation and posture ask for.

    Its first three entries are in body axes: the body's world acceleration is R (a_v + ω × v).
    """
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        out[i] = -(v[3 + a] * v[b] - v[3 + b] * v[a])
        for k in range(3):
            out[i] += rotation[k, i] * t.body[k]
        out[3 + i] = t.orientation[i]
    for j in range(t.joints.shape[0]):
        out[6 + j] = t.joints[j]


@kernel
def friction_limits(t: TargetsRecord, p: PyramidRecord) -> None:
    """Coefficient of each foot's cone in this tick, after the safety margin: into ``p.friction`` (feet,)."""
    for k in range(p.friction.shape[0]):
        p.friction[k] = p.friction_share * min(p.mu, t.friction[k])


@kernel
def friction_rows(p: ProblemRecord, qp: ProgramRecord, force: int) -> None:
    """Fit the pyramids' rows on force variables from index ``force`` to ``p.friction``: only f_z has another factor."""
    faces = p.pyramid.shape[0]
    for k in range(p.friction.shape[0]):
        up, first, z = p.friction[k] * p.inscribed, qp.bounded + (faces + 1) * k, force + 3 * k + 2
        for row in range(first, first + faces):
            qp.inequality[row, z] = up


@kernel
def force_bounds(t: TargetsRecord, faces: int, lower: Vector, upper: Vector) -> None:
    """Bounds of each foot's rows on its force itself; never active in swing, where f = 0."""
    for k in range(t.held.shape[0]):
        on = t.held[k] != 0.0
        first = (faces + 1) * k
        for row in range(first, first + faces):
            lower[row] = 0.0 if on else -1.0
        lower[first + faces] = t.force_range[k, 0] if on else -1.0
        upper[first + faces] = t.force_range[k, 1] if on else 1.0
