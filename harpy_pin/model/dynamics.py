"""Rigid-body dynamics of a Pinocchio model: M a + n = S τ + J_fᵀ f + J_tᵀ u_t.

:class:`Dynamics` evaluates every term that the simulator and the whole-body controller need in one
pass, into arrays that live as long as the object: nothing is allocated per call. Frames, order and
signs are those of :class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.entry import GOOD, MISFIT
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Record, RecordOf, Records, field, make_record, same_layout, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.model.tree import TreeRecord, tree_record


class EquationsRecord(RecordOf):
    """Terms of the equations of motion that a time step needs, of a robot in space or in the plane.

    They are attributes of :class:`Dynamics`.
    """

    mass_matrix: Vector = sized("nv", "nv")
    bias: Vector = sized("nv")
    damping: Vector
    foot_jacobian: Vector = sized("3 feet", "nv")
    foot_drift: Vector = sized("3 feet")
    foot_position: Vector = sized("feet", 3)
    thruster_jacobian: Vector = sized("thrusts", "nv")


TERMS = (*EquationsRecord.__annotations__, "foot_velocity", "rotor_axis")
"""Fields of the record that are attributes of :class:`Dynamics`, besides the rotation."""


@fixed_arrays("record", "rotation", *TERMS)
class Dynamics(KeepsViews, EquationsRecord):
    """Terms of the equations of motion at one state.

    All arrays are overwritten by :meth:`update`.

    Args:
        robot: whose terms.
        gravity: (3,) m/s²; the model's by default.
        record: where the terms are kept, a part of a larger record, made by
            :func:`dynamics_record`.

    Attributes:
        finite: whether the last state was a good one, and all terms are finite: numbers within
            :data:`~harpy_pin.model.entry.MAX_SAMPLE`, and a quaternion of length 0.7 to 1.4.
        record: all terms, for kernels; the attributes below are views of its fields, which have
            their names.
        mass_matrix: (nv, nv) M(q), armature included (CRBA).
        bias: (nv,) n(q, v): Coriolis, centrifugal and gravity terms; the damping of passive joints.
        damping: (nv,) of the joints, N·m·s/rad.
        foot_jacobian: (3 feet, nv) linear Jacobians of the feet, world axes.
        foot_drift: (3 feet,) J̇ v, acceleration of the feet at zero joint acceleration, m/s².
        foot_position: (feet, 3) world, m.
        foot_velocity: (feet, 3) world axes, m/s.
        thruster_jacobian: (thrust variables, nv) motion that each thrust variable does work on (the
            rows of J_t): of a free thruster the linear Jacobian of the mount, world axes; of a
            rotor its part along the axis, with the rotation about it times the drag
            (:mod:`harpy_pin.model.rotor`).
        rotor_axis: (rotors, 3) axes of the rotors, world.
        rotation: (3, 3) base axes to world.

    Those of a controller (``controller.dynamics``) may differ after a tick: on ground that is not
    level its feet are in contact axes, and ``bias`` has the dry friction of joints, where the
    robot's is known.

    Raises:
        RobotError: a joint of a kind that :mod:`harpy_pin.model.tree` does not know.
    """

    _record_: Records[Any]
    _rotation_: Vector
    _foot_position_: Vector
    _foot_velocity_: Vector
    foot_velocity: Vector
    rotor_axis: Vector

    @checked
    def __init__(
        self, robot: Robot, *, gravity: Vector | None = None, record: Record | None = None
    ) -> None:
        self.robot = self._robot = robot
        self.finite = False
        self.model = _model(robot, gravity)
        own = dynamics_record(robot, gravity=gravity)
        self.record = own if record is None else same_layout(record, own)
        for name in TERMS:
            setattr(self, name, field(self._record_, name))
        self.rotation: Vector = field(self._record_["tree"], "rotation")
        update_terms.prepare(self._record_, robot.neutral, np.zeros(robot.nv))

    def update(self, q: Vector, v: Vector) -> None:
        """Evaluate every term; :attr:`finite` says whether the state was good.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.

        Raises:
            InputError: wrong shapes, or entries that are no numbers at all.
        """
        try:
            verdict = update_terms(self._record_, q, v)
        except TypeError:  # lists, integers, or arrays that are not contiguous
            verdict = MISFIT
        if verdict == MISFIT:
            q, v = checks.array("q", q, self._robot.nq), checks.array("v", v, self._robot.nv)
            verdict = update_terms(self._record_, q, v)
        self.finite = verdict == GOOD


class DynamicsRecord(EquationsRecord):
    """Terms of a robot at a state: the attributes of :class:`Dynamics`, and what they are computed
    from.
    """

    foot_velocity: Vector = sized("feet", 3)
    # (feet + thrusters,) index of the body of each foot, then of each thruster
    body: NDArray[np.int64]
    offset: Vector  # (feet + thrusters, 3) their places there, m
    body_axis: Vector  # (rotors, 3) axes of the rotors in the body's frame
    rotor_axis: Vector = sized("rotors", 3)
    drag: Vector  # (rotors,) m
    rotor_lower: Vector  # (rotors,) least thrust, N
    rotor_upper: Vector  # (rotors,) most thrust, N
    tree: TreeRecord  # bodies and joints


def dynamics_record(robot: Robot, *, gravity: Vector | None = None) -> Records[DynamicsRecord]:
    """A new :class:`DynamicsRecord` of a robot; gravity (3,), m/s², is the model's by default."""
    model = _model(robot, gravity)
    rotors = robot.rotors
    frames = [model.frames[robot.frame_id(name)] for name in (*robot.feet, *robot.thrusters)]
    mounts = [model.frames[robot.frame_id(rotor.frame)].placement.rotation for rotor in rotors]
    axes = [mount @ np.array(rotor.axis) for mount, rotor in zip(mounts, rotors, strict=True)]
    limits = np.array([rotor.limit for rotor in rotors]).reshape(-1, 2)
    return make_record(
        DynamicsRecord,
        {**robot.sizes, "rotors": len(rotors)},
        damping=np.append(model.damping[:6], robot.damping),
        body=np.array([frame.parentJoint - 1 for frame in frames], dtype=np.int64),
        offset=np.array([frame.placement.translation for frame in frames]).reshape(-1, 3),
        body_axis=np.array(axes).reshape(-1, 3),
        drag=np.array([rotor.drag for rotor in rotors]),
        rotor_lower=limits[:, 0],
        rotor_upper=limits[:, 1],
        tree=tree_record(model, robot.loops),
    )


def _model(robot: Robot, gravity: Vector | None) -> pin.Model:
    """The robot's model, or a copy of it with another gravity."""
    checks.instance("robot", robot, Robot)
    if gravity is None:
        return robot.model
    model = robot.model.copy()
    model.gravity.linear = checks.vector("gravity", gravity, 3)
    return model
