"""The whole-body optimum of any robot, with any contacts and tasks, from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import dynamics_record
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.condensed.gait_tasks import COMPLIANCE
from harpy_pin.wbc.condensed.structure import (
    elimination_record,
    foot_bodies,
    limbs_record,
    limits_record,
    tree_paths,
)
from harpy_pin.wbc.condensed.task_memory import AnyTask, adopt_tasks, known_tasks, task_records
from harpy_pin.wbc.condensed.tasks import MOMENTA, ContactsRecord
from harpy_pin.wbc.condensed.whole_body_solve import (
    WRONG_HELD,
    WRONG_SHAPE,
    WholeBodyRecord,
    solve_whole_body,
)
from harpy_pin.wbc.newton import newton_record
from harpy_pin.wbc.weights import WholeBodyLimits, thrust_box

FORCE_WEIGHT = 2e-4
"""Weight of the square of a contact force over the robot's mass, (m/s²)²."""


class WholeBodyStatus(IntEnum):
    """How a solve ended."""

    OPTIMAL = 0
    SUBOPTIMAL = 1
    """The search ended at its bound: forces are in their cones and torques in their ranges. The
    motion belongs to the forces, and to the torques but for those that were clipped.
    """
    INVALID = 2
    """State or targets were not possible numbers: the solution is that of the last good tick."""
    CONTACTS_YIELDED = 3
    """No motion within the limits keeps the feet where they are wanted: the optimum in which they
    give way, with the weight 1000 of the squares of their accelerations.
    """


STATUS = tuple(WholeBodyStatus)


@fixed_arrays("acceleration", "torque", "force", "thrust")
class WholeBodySolution:
    """What :meth:`WholeBodySolver.solve` found; overwritten by the next solve.

    Args:
        record: of the solver.

    Attributes:
        acceleration: (nv,) generalised acceleration.
        torque: (joints,) torques of the joints, N·m.
        force: (feet, 3) force of the ground on each contact point, world axes, N; zero where it is
            not held.
        thrust: (thrust variables,) N; see :mod:`harpy_pin.model.rotor`.
        status: how the solve ended.
    """

    acceleration: Vector
    torque: Vector
    force: Vector
    thrust: Vector

    def __init__(self, record: Records[WholeBodyRecord]) -> None:
        for name in ("acceleration", "torque", "thrust"):
            setattr(self, name, field(record, name))
        self.force = field(record, "force").reshape(-1, 3)
        self.status = WholeBodyStatus.INVALID


@fixed_arrays(
    "held",
    "contact_acceleration",
    "contact_frame",
    "friction",
    "force_range",
    "reference_force",
    "torque_range",
    "record",
)
class WholeBodySolver:
    """The whole-body optimum of any robot with a free base: any limbs, tasks and contacts.

    The contacts are the robot's feet, points and soles; name any frames as feet when the robot is
    loaded, hands too. A weight w of a task adds ½ Σ w e² of its rows' errors e to what is
    minimised, in (m/s²)² and (rad/s²)² (docs/whole_body.md has weights to begin with). After this,
    tasks keep their references in the solver's memory: ``task.position[:] = ...`` is all that a
    change takes. Gains are read here, once.

    Args:
        robot: any.
        tasks: each with its weight, one number or one for each row. Frames, joints, one centre of
            mass, one angular momentum.
        limits: friction of the ground, faces of the pyramids, largest thrusts, share of the motors'
            peak torques.
        period: of the ticks, s: with it joints keep the ranges of their positions and velocities.
        deceleration: of which every joint is capable, rad/s²: so early it brakes before its end.
        contact_damping: of the velocity of a foot on the ground, 1/s.
        regularisation: weight of the square of each acceleration, besides all tasks: where no task
            says anything.
        force_weight: of the square of each contact force, 1/N²; by default 2e-4 over the square of
            the robot's mass.
        thrust_weight: of the square of each thrust, 1/N².

    Attributes:
        contacts: names of the feet: points, or the first corners of soles.
        held: (contacts,) 1 where a foot is on the ground, else 0; all of them to begin with.
        contact_acceleration: (contacts, 6) of each foot on the ground, world axes; zero to begin
            with.
        contact_frame: (feet, 3, 3) axes of each contact point in the world; the third is the
            normal. Friction and range of its force are in them. Upright to begin with.
        friction: (feet,) slope of the pyramids' faces, not negative. What is written in place is
            not checked.
        force_range: (feet, 2) least and largest normal force of each contact point that is held, N;
            0 ≤ least ≤ largest.
        reference_force: (feet, 3) of a plan, from which differences are weighed, world axes, N;
            zero to begin with.
        torque_range: (joints, 2) least and largest torque of each joint, N·m.
        weights: of each task, an array with one for each of its rows; it may be overwritten in
            place.
        solution: of the last solve.
        steps: Newton's steps of the last solve.

    Raises:
        InputError: tasks of another kind, unknown frames or joints, or numbers out of their
            domains.
    """

    _record_: Records[WholeBodyRecord]

    @checked
    def __init__(
        self,
        robot: Robot,
        tasks: Mapping[AnyTask, ArrayLike],
        *,
        limits: WholeBodyLimits | None = None,
        period: float | None = None,
        deceleration: float = 100.0,
        contact_damping: float = 20.0,
        regularisation: float = 1e-4,
        force_weight: float | None = None,
        thrust_weight: float = 5e-3,
    ) -> None:
        self.robot = robot
        limits = limits if limits is not None else WholeBodyLimits()
        self.contacts = tuple(robot.feet[first] for first in np.cumsum((0, *robot.corners))[:-1])
        settings = {
            "contact_damping": checks.number("contact_damping", contact_damping, low=0.0),
            "regularisation": checks.number("regularisation", regularisation, low=0.0, strict=True),
            "force_weight": FORCE_WEIGHT / robot.mass**2 if force_weight is None else force_weight,
            "thrust_weight": checks.number("thrust_weight", thrust_weight, low=0.0, strict=True),
            "deceleration": checks.number("deceleration", deceleration, low=0.0, strict=True),
            "period": checks.number("period", period or 0.0, low=0.0),
        }
        checks.number("force_weight", settings["force_weight"], low=0.0, strict=True)
        self.record = _record(robot, known_tasks([*tasks]), limits, settings)
        self.solution = WholeBodySolution(self._record_)
        self.weights = adopt_tasks(tasks, self._record_, self._record_["newton"])
        self.held: Vector = field(self._record_["contacts"], "held")
        self.contact_acceleration: Vector = field(self._record_["contacts"], "acceleration")
        self.contact_frame: Vector = field(self._record_["contacts"], "frame")
        self.friction: Vector = field(self._record_["newton"], "friction")
        self.force_range: Vector = field(self._record_["newton"], "force_range")
        self.reference_force: Vector = field(self._record_, "reference_force").reshape(-1, 3)
        self.torque_range: Vector = field(self._record_["limits"], "torque_range")

    def solve(self, state: State) -> WholeBodySolution:
        """One optimum.

        Args:
            state: as measured; q and v are read.

        Returns:
            :attr:`solution` itself.

        Raises:
            InputError: no state, arrays of another shape, or that are no numbers at all; a foot
                that is neither held nor not.
        """
        checks.instance("state", state, State)
        try:
            found = solve_whole_body(self._record_, state.q, state.v)
        except TypeError:  # lists, integers, or arrays that are not contiguous
            found = WRONG_SHAPE
        if found == WRONG_SHAPE:
            q, v = (
                as_array("q", state.q, (self.robot.nq,)),
                as_array("v", state.v, (self.robot.nv,)),
            )
            found = solve_whole_body(self._record_, q, v)
        if found == WRONG_HELD:
            held = self.held.tolist()
            raise InputError(
                f"held must be 0 or 1 of each foot, got {held}", name="held", value=held
            )
        self.solution.status = STATUS[found]
        return self.solution

    @property
    def steps(self) -> int:
        """Newton's steps of the last solve."""
        return int(self._record_["newton"]["steps"][0])


def _record(
    robot: Robot, tasks: Sequence[AnyTask], limits: WholeBodyLimits, settings: dict[str, float]
) -> Records[WholeBodyRecord]:
    """A new :class:`WholeBodyRecord`; arguments and errors as of :class:`WholeBodySolver`."""
    model, points = robot.model, len(robot.feet)
    corners = [model.frames[robot.frame_id(name)] for name in robot.feet]
    firsts = np.cumsum((0, *robot.corners))
    own = task_records(robot, tasks, width=tree_paths(robot)[1].shape[1])
    system, first_row = elimination_record(
        robot, {}, task_bodies=own.filling, relative=own.relative
    )
    sizes = {**robot.sizes, "contacts": len(robot.corners), "relative": own.relative}
    places = np.split(
        np.array([corner.placement.translation for corner in corners]).reshape(-1, 3), firsts[1:-1]
    )
    newton = newton_record(
        {**sizes, "momenta": MOMENTA},
        limits,
        force_weight=settings["force_weight"],
        thrust_weight=settings["thrust_weight"],
    )
    newton["force_range"][0, :, 1] = 1e4
    newton["thrust_range"][0] = np.column_stack(thrust_box(robot, limits))
    return make_record(
        WholeBodyRecord,
        sizes,
        dynamics=dynamics_record(robot),
        frames=own.frames,
        joints=own.joints,
        momentum=own.momentum,
        contacts=make_record(
            ContactsRecord,
            sizes,
            body=foot_bodies(robot),
            offset=np.array([place.mean(axis=0) for place in places if len(place)]).reshape(-1, 3),
            first_point=firsts,
            first_row=first_row,
            row_count=np.array([3 if n == 1 else 6 for n in robot.corners], dtype=np.int64),
            frame=np.tile(np.eye(3), (points, 1, 1)),
            damping=settings["contact_damping"],
            compliance=COMPLIANCE,
        ),
        regularisation=settings["regularisation"],
        limbs=limbs_record(robot, {}, relative=own.relative),
        system=system,
        newton=newton,
        limits=limits_record(
            robot, limits, period=settings["period"], deceleration=settings["deceleration"]
        ),
    )
