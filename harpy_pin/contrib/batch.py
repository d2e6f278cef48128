"""The condensed whole-body optimum of many robots at once, on arrays with a row for each robot."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.threads import Threads, selection
from harpy_pin.controllers.condensed_tick import CondensedTasksRecord
from harpy_pin.controllers.joint_targets import (
    JointTargetsRecord,
    joint_targets_record,
    move_targets,
)
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.task_controller import tasks_record
from harpy_pin.controllers.tasks import forces_in_world, measured_terms, set_tasks
from harpy_pin.errors import InputError, reason
from harpy_pin.gaits.gait import Gait, GaitTarget, GaitTargetRecord
from harpy_pin.gaits.standing import Hovering, Standing
from harpy_pin.gaits.straight import make_gait
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import GOOD
from harpy_pin.model.memory import KeepsViews, fixed_arrays, lasting
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts
from harpy_pin.wbc.condensed.condensed_solver import condensed_record
from harpy_pin.wbc.condensed.solve import TORQUE_CLIPPED, solve_condensed

__all__ = ["BatchTargets", "CondensedBatch"]

BAD_STATE = -1
"""Status of a robot whose state or targets are not finite: its torques, thrusts and gains are
zero.
"""
Array = NDArray[Any]


@dataclass(frozen=True, slots=True)
class BatchTargets:
    """Targets of n robots, with the names and units of :class:`~harpy_pin.gaits.gait.GaitTarget`;
    write them in place.

    Attributes:
        body: (n, 9) position, velocity and acceleration of the body.
        heading: (n, 3) yaw of the upright body, its rate and acceleration.
        foot_position: (n, feet, 3) relative to the body's target, world axes.
        foot_velocity: (n, feet, 3).
        foot_acceleration: (n, feet, 3).
        stance: (n, feet) 1 where the foot should be on the ground, else 0.
        phase: (n, feet) share of its stance or swing that each foot has done.
    """

    body: Array
    heading: Array
    foot_position: Array
    foot_velocity: Array
    foot_acceleration: Array
    stance: Array
    phase: Array

    @checked
    def fill(self, target: GaitTarget, which: Any = slice(None)) -> None:
        """Give robots the targets of one gait.

        Args:
            target: of a gait's ``update``.
            which: index, slice or mask of the robots; all by default.

        Raises:
            InputError: the gait is of a robot with other feet.
        """
        if target.stance.shape != self.stance.shape[1:]:
            raise InputError(
                "target must be of a gait of the same robot", name="target", value=target
            )
        chosen = which if isinstance(which, slice) else selection("which", which, len(self.body))
        for name in self.__slots__:
            getattr(self, name)[chosen] = getattr(target, name)


class BodyRecord(RecordOf):
    """Mass and inertia of the base, without the errors of the robots."""

    mass: float  # kg
    inertia: Vector  # (3, 3) about the centre of mass, body axes, kg·m²


@fixed_arrays("force", "law", "mass_error", "mu", "status", "thrust", "torque")
class CondensedBatch(KeepsViews):
    """n robots of one kind: tasks, then the whole-body optimum in contact forces, in one compiled
    loop.

    Row i of the results is what a condensed controller of its own gives robot i, to the last digit
    where the arrays are float64. A robot whose state is not finite, or whose system is singular,
    changes no other row.

    Args:
        robot: any, whose feet are points or soles, none of them on its base.
        n: how many robots.
        parameters: gains, weights and limits; by default those that fit the robot where it stands
            or hovers. There is no friction estimate here: give each robot its friction in ``mu``.
            Gains of joint targets are those of ``robot``, whatever the errors of the mass, and
            nothing is learned of the joints.
        double_support: share of a step with both feet on the ground, over which the load goes from
            one foot to the other; zero where it may go at once.
        dtype: float64 or float32, of all arrays; the arithmetic is float64.
        threads: most that work at a time; one for each core by default.

    Attributes:
        mu: (n,) friction coefficient of each robot's ground.
        mass_error: (n,) relative error of the body's mass and inertia that each controller knows
            of.
        torque: (n, joints) of the last step, N·m.
        thrust: (n, thrusters, 3) of the last step, world axes, N.
        law: (n, 4, joints) of the motors in the last step: q*, v*, stiffness and damping, as in
            :class:`~harpy_pin.model.state.Command`; zero without ``joint_stiffness`` and
            ``joint_damping``.
        force: (n, feet, 3) contact forces of the last step, world axes, N.
        status: (n,) of the last step: :class:`~harpy_pin.wbc.condensed.CondensedStatus`, or −1 for
            a bad state.

    Raises:
        InputError: n is no positive integer, the type is another one, or a foot is on the base.
    """

    n = property(attrgetter("_n"))

    @checked
    def __init__(
        self,
        robot: Robot,
        n: int,
        parameters: WholeBodyParameters | None = None,
        *,
        double_support: float = 0.3,
        dtype: DTypeLike = np.float64,
        threads: int | None = None,
    ) -> None:
        self.robot = robot
        self._n = n = checks.whole("n", n, low=1)
        checks.one_of("dtype", getattr(dtype, "__name__", str(dtype)), ("float64", "float32"))
        self.dtype = np.dtype(dtype)
        gait: Gait
        if robot.name == "harpy":
            gait = make_gait(robot, speed=0.0)
        else:
            gait = Standing(robot) if robot.feet else Hovering(robot)
        if parameters is None:
            parameters = WholeBodyParameters.for_gait(gait, estimate_friction=False)
        self.parameters = p = parameters
        if p.estimate_friction or p.estimate_joint_friction or p.thrust_lag or p.thrust_turning_lag:
            raise InputError(
                "a batch estimates no friction (estimate_friction=False) and knows no lag",
                name="parameters",
                value=p,
            )
        condensed = condensed_record(robot, p.weights, p.limits)
        record: Any = tasks_record(gait, p, CondensedTasksRecord, condensed=condensed)
        record["tasks"]["double_support"] = checks.number(
            "double_support", double_support, low=0.0, high=0.9
        )
        self._threads = Threads(n, threads)
        pieces = len(self._threads.cuts) - 1
        record["condensed"]["mu"] = np.inf  # that of each robot counts
        self._records = [record.copy() for _ in range(pieces)]
        self._target_records = [gait.target._record_.copy() for _ in range(pieces)]
        motors = joint_targets_record(robot, p, gait.initial_state()[0])
        if motors is None:
            gains, sizes = np.zeros((2, 0)), {**robot.sizes, "joints": 0}
            motors = make_record(
                JointTargetsRecord, sizes, period=p.period, share=0.0, lead=0.0, gains=gains
            )
        self._motors = [motors.copy() for _ in range(pieces)]
        tree = record["dynamics"]["tree"]
        self._body = make_record(BodyRecord, mass=tree["mass"][0, 0], inertia=tree["inertia"][0, 0])
        feet, joints = len(robot.feet), len(robot.joints)
        shapes = ((9,), (3,), *[(feet, 3)] * 3, (feet,), (feet,))
        self._targets = tuple(lasting(np.zeros((n, *shape), self.dtype)) for shape in shapes)
        self.targets.fill(gait.update(0.0))
        self.mu, self.mass_error = np.full(n, p.limits.mu), np.zeros(n)
        self.torque, self.law = (
            np.zeros((n, joints), self.dtype),
            np.zeros((n, 4, joints), self.dtype),
        )
        self.thrust = np.zeros((n, len(robot.thrusters), 3), self.dtype)
        self.force = np.zeros((n, feet, 3), self.dtype)
        self.status = np.zeros(n, dtype=np.int64)
        ends = [np.zeros((n, size), np.int64) for size in (feet, feet, joints, joints)]
        multiplier, target = np.zeros((n, joints)), np.zeros((n, *motors["target"].shape[1:]))
        self._memory = (*ends, np.zeros(n, np.int64), multiplier, np.zeros(n, np.int64), target)
        self._shapes = {"q": (n, robot.nq), "v": (n, robot.nv), "foot_force": (n, feet, 3)}

    @property
    def targets(self) -> BatchTargets:
        """Targets of all robots, to be written in place; standing at the origin until then."""
        return BatchTargets(*(array[...] for array in self._targets))

    def reset(self, which: ArrayLike | None = None) -> None:
        """Forget where the searches ended, and joint targets.

        Args:
            which: indices or mask of the robots; all by default.
        """
        chosen = selection("which", which, self.n)
        for memory in self._memory:
            memory[chosen] = 0

    def step(self, q: Any, v: Any, foot_force: Any) -> tuple[Array, Array]:
        """One tick of every robot, for :attr:`targets`.

        Arrays of the batch's type are read where they are, from NumPy or through DLPack; others are
        copied first.

        Args:
            q: (n, nq) configurations.
            v: (n, nv) generalised velocities.
            foot_force: (n, feet, 3) measured contact forces, world axes, N.

        Returns:
            :attr:`torque` and :attr:`thrust` themselves, overwritten by the next step.

        Raises:
            InputError: an array has the wrong shape.
        """
        given = tuple(
            self._array(name, value)
            for name, value in (("q", q), ("v", v), ("foot_force", foot_force))
        )
        checks.number("least mu", checks.vector("mu", self.mu, self.n).min(), low=0.0)
        errors = checks.vector("mass_error", self.mass_error, self.n)
        checks.number("least mass_error", errors.min(), low=-1.0, strict=True)
        targets, robots = self._targets, (self.mu, self.mass_error)
        results = (self.torque, self.thrust, self.force, self.law, self.status)

        def piece(k: int, begin: int, end: int) -> None:
            parts = (self._records[k], self._target_records[k], self._motors[k], self._body)
            step_batch(begin, end, parts, self._memory, robots, given, targets, results)

        self._threads.run(piece)
        return self.torque, self.thrust

    def close(self) -> None:
        """End the threads."""
        self._threads.close()

    def _array(self, name: str, value: Any) -> Array:
        """An argument as an array of the batch's type, without a copy where it is one."""
        foreign = hasattr(value, "__dlpack__") and not isinstance(value, np.ndarray)
        try:
            value = np.from_dlpack(value) if foreign else value
        except Exception as error:  # of whoever exports it
            raise InputError(
                f"{name} must be an array of numbers: {reason(error)}", name=name, value=value
            ) from error
        if type(value) is not np.ndarray or value.dtype != self.dtype:
            value = checks.array(name, value, None)
        array: Array = np.ascontiguousarray(value, dtype=self.dtype)
        if array.shape != self._shapes[name]:
            raise InputError(
                f"{name} must have shape {self._shapes[name]}, got {array.shape}",
                name=name,
                value=value,
            )
        return array


@kernel(release=True)
def step_batch(
    begin: int,
    end: int,
    parts: tuple[
        Records[CondensedTasksRecord],
        Records[GaitTargetRecord],
        Records[JointTargetsRecord],
        Records[BodyRecord],
    ],
    memory: tuple[
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.int64],
        Vector,
        NDArray[np.int64],
        Vector,
    ],
    robots: tuple[Vector, Vector],
    given: tuple[Vector, Vector, Vector],
    targets: tuple[Vector, ...],
    results: tuple[Vector, Vector, Vector, Vector, NDArray[np.int64]],
) -> None:
    """Robots from ``begin`` to ``end``, one after the other; the order of the arrays is that of
    :meth:`step`.
    """
    record, gait, motors, body = parts
    free_piece, limited_piece, bound, limit_piece, limits, multiplier, follows, target = memory
    mu, mass_error = robots
    q, v, foot_force = given
    torque, thrust, force, law, status = results
    r, d, p, m, b = record[0], record[0].dynamics, record[0].condensed, motors[0], body[0]
    s = p.newton
    for i in range(begin, end):
        _take_targets(gait[0], targets, i)
        p.free_piece[:], p.limited_piece[:] = free_piece[i], limited_piece[i]
        p.limits.bound[:], s.limit_piece[:], s.limits = bound[i], limit_piece[i], limits[i]
        s.multiplier[6:] = multiplier[i]
        d.tree.mass[0] = (1.0 + mass_error[i]) * b.mass
        d.tree.inertia[0] = (1.0 + mass_error[i]) * b.inertia
        r.targets.friction[:] = mu[i]
        m.follows = follows[i]
        m.target[:] = target[i]
        if measured_terms(r, gait[0], q[i], v[i], foot_force[i]) == GOOD:
            set_tasks(r, gait[0], q[i], v[i], foot_force[i])
            solve_condensed(d, r.targets, p, v[i])
            forces_in_world(r.targets, p.force)
            status[i] = p.status_and_steps[0]
            move_targets(m, p.system.acceleration, status[i] & TORQUE_CLIPPED == 0, q[i], v[i])
        else:
            p.inputs[:] = p.force[:] = m.law[:] = 0.0
            m.follows = 0
            status[i] = BAD_STATE
        free_piece[i], limited_piece[i] = p.free_piece, p.limited_piece
        bound[i], limit_piece[i], limits[i] = p.limits.bound, s.limit_piece, s.limits
        multiplier[i] = s.multiplier[6:]
        follows[i] = m.follows
        target[i] = m.target
        write_thrusts(d, p.inputs, thrust[i])
        torque[i] = p.inputs[d.thruster_jacobian.shape[0] :]
        law[i, :, : m.law.shape[1]] = m.law
        force[i] = p.force.reshape((force.shape[1], 3))


@kernel
def _take_targets(g: GaitTargetRecord, targets: tuple[Vector, ...], i: int) -> None:
    """The targets of robot i."""
    body, heading, foot_position, foot_velocity, foot_acceleration, stance, phase = targets
    g.body[:] = body[i]
    g.heading[:] = heading[i]
    g.foot_position[:] = foot_position[i]
    g.foot_velocity[:] = foot_velocity[i]
    g.foot_acceleration[:] = foot_acceleration[i]
    g.stance[:] = stance[i]
    g.phase[:] = phase[i]
