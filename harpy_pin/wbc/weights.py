"""What a whole-body problem is made of: weights of its tasks, limits of its constraints, targets of
a tick.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import fitting_parameters
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Record, Records, field, make_record, same_layout
from harpy_pin.model.robot import Robot, feet_moved
from harpy_pin.model.state import Vector
from harpy_pin.wbc.targets import TargetsRecord

MAX_FACES = 64
"""Most faces of a friction pyramid: its cone is less than two thousandths wider."""
MAX_WEIGHT = 1e6
"""Largest weight of a task, and largest torque scale: beyond it the Hessian loses the lesser tasks
to rounding.
"""


@dataclass(frozen=True, kw_only=True)
class WholeBodyWeights:
    """Weights of the tasks, on squared accelerations (m/s², rad/s²) and forces (N); each at most
    1e6.

    Those that fit a robot depend on its mass and legs: :meth:`for_robot` has them.

    Attributes:
        body: linear acceleration of the body.
        orientation: angular acceleration of the body.
        swing: acceleration of a swing foot.
        posture: accelerations of the joints that move one foot: legs.
        arms: accelerations of the joints that move several feet or none: waist, arms and head.
        thrust: forces of thrusters and rotors.
        force: contact forces.
    """

    body: float = 1.0
    orientation: float
    swing: float
    posture: float = 1e-6
    arms: float = 1.0
    thrust: float
    force: float

    @classmethod
    @checked
    def for_robot(cls, robot: Robot, **changes: float) -> WholeBodyWeights:
        """Weights that fit a robot (:func:`~harpy_pin.gaits.fitting.fitting_parameters`).

        Args:
            robot: any.
            changes: weights that differ, by name.
        """
        return cls(**{**fitting_parameters(robot)["weights"], **changes})

    def __post_init__(self) -> None:
        for entry in fields(self):
            checks.number(
                f"weight {entry.name}", getattr(self, entry.name), low=0.0, high=MAX_WEIGHT
            )
        if min(self.posture, self.arms, self.thrust, self.force) <= 0.0:
            message = (
                "the weights of posture, arms, thrust and force must be positive: they make "
                "the optimum unique"
            )
            raise InputError(message)


@dataclass(frozen=True, kw_only=True)
class WholeBodyLimits(checks.Checked):
    """Constraints of the problem.

    Attributes:
        mu: friction coefficient of the ground, at most 10.
        friction_share: share of μ that is used; what is left is for errors of μ, of the model, and
            for impacts.
        faces: of the friction pyramid, which is inscribed in the cone of that share; three to 64.
        lateral_thrust: share of a free thruster's limit allowed along world x and y each; the rest
            of the box goes to z, so that every point of it is within the limit.
        torque_scale: share of the motors' peak torque used, at most 1e6.
        give_way: share of a swing foot's weight that is left where motors are at their limits,
            above zero; there a stance foot may also bear less than f_min
            (:mod:`harpy_pin.wbc.giving_way`). One: nothing gives way.
    """

    mu: float = checks.setting(0.25, low=0.0, high=checks.MAX_FRICTION)
    friction_share: float = checks.setting(0.4, low=0.0, high=1.0, strict=True)
    faces: int = checks.setting(8, checks.whole, low=3, high=MAX_FACES)
    lateral_thrust: float = checks.setting(0.4, low=0.0, high=0.7)
    torque_scale: float = checks.setting(1.0, low=0.0, high=MAX_WEIGHT, strict=True)
    give_way: float = checks.setting(0.003, low=0.0, high=1.0, strict=True)

    @property
    def inscribed(self) -> float:
        """Radius of the circle inside the pyramid's section, relative to that of the cone around
        it.
        """
        return float(np.cos(np.pi / self.faces))

    @property
    def pyramid(self) -> Vector:
        """(faces, 3) rows p of the friction pyramid: it holds where p f ≥ 0."""
        angle = 2.0 * np.pi * np.arange(self.faces) / self.faces
        up = np.full(len(angle), self.friction_share * self.mu * self.inscribed)
        return np.column_stack((-np.cos(angle), -np.sin(angle), up))


def thrust_box(robot: Robot, limits: WholeBodyLimits) -> tuple[Vector, Vector]:
    """Least and largest value of each thrust variable, N: a box inside a free thruster's limit, a
    rotor's own limits.

    Returns:
        (thrust variables,) lower and upper bounds.
    """
    side = limits.lateral_thrust * robot.thrust_limit
    up = robot.thrust_limit * np.sqrt(1.0 - 2.0 * limits.lateral_thrust**2)
    box = np.tile([side, side, up], len(robot.thrusters) - len(robot.rotors))
    lower, upper = np.array([rotor.limit for rotor in robot.rotors]).reshape(-1, 2).T
    return np.concatenate((-box, lower)), np.concatenate((box, upper))


@fixed_arrays(
    "body",
    "feet",
    "force",
    "force_range",
    "frame",
    "friction",
    "held",
    "joint_share",
    "joints",
    "orientation",
    "record",
)
class WholeBodyTargets(KeepsViews):
    """What the tasks ask for, and which feet are held: at first no motion, every foot held with any
    force.

    Args:
        robot: gives the sizes.
        record: where they are kept, a part of a larger record, made by :func:`targets_record`.

    Attributes:
        body: (3,) acceleration of the body's origin, world axes, m/s²; where ``centred`` its first
            two entries are that of the centre of mass.
        orientation: (3,) angular acceleration of the body, body axes, rad/s².
        feet: (feet, 3) accelerations of the feet, world axes, m/s²: a task in swing, a constraint
            in stance.
        joints: (joints,) accelerations of the posture task, rad/s².
        joint_share: (joints,) by which the weight of each joint's task is multiplied: more near the
            end of its range.
        held: (feet,) 1 where a foot is held on the ground, else 0; the same for all corners of a
            flat foot.
        force_range: (feet, 2) f_min and f_max of each foot that is held, N.
        force: (feet, 3) planned contact forces, world axes, N, from which the weight on forces
            counts; zero to begin with.
        friction: (feet,) friction coefficient of each foot where it is below that of the limits,
            such as an estimate; infinite where there is none.
        tilted: 1 where the ground is not level at every foot; then controllers express position,
            velocity, Jacobian, drift, target and force of each foot in the frame of its contact,
            whose third axis is the normal.
        frame: (feet, 3, 3) these frames (:mod:`harpy_pin.ground.contact_frame`).
        record: all of it, for kernels; the others are views of its fields, which have their names.
    """

    _record_: Records[TargetsRecord]
    _held_: Vector

    @checked
    def __init__(self, robot: Robot, *, record: Record | None = None) -> None:
        self._robot = robot
        own = targets_record(robot)
        self.record = own if record is None else same_layout(record, own)
        self.body: Vector = field(self._record_, "body")
        self.orientation: Vector = field(self._record_, "orientation")
        self.feet: Vector = field(self._record_, "feet")
        self.joints: Vector = field(self._record_, "joints")
        self.joint_share: Vector = field(self._record_, "joint_share")
        self.held: Vector = field(self._record_, "held")
        self.force: Vector = field(self._record_, "force")
        self.force_range: Vector = field(self._record_, "force_range")
        self.friction: Vector = field(self._record_, "friction")
        self.frame: Vector = field(self._record_, "frame")

    @property
    def centred(self) -> bool:
        """Whether the horizontal part of ``body`` is the acceleration of the centre of mass."""
        return bool(self._record_["centred"][0])

    @property
    def tilted(self) -> bool:
        """Whether feet are expressed in the frames of their contacts."""
        return bool(self._record_["tilted"][0])


def check_terms(robot: Robot, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
    """Refuse terms or targets of a robot of another size: kernels would go past their arrays.

    Raises:
        InputError: they are no terms, or no targets, of this robot.
    """
    if getattr(dynamics, "_robot", None) is robot and getattr(targets, "_robot", None) is robot:
        return
    terms = checks.instance("dynamics", dynamics, Dynamics)
    tasks = checks.instance("targets", targets, WholeBodyTargets)
    nv, feet, thrusts = robot.nv, len(robot.feet), robot.n_thrust
    if (len(terms.bias), len(terms.foot_position), len(terms.thruster_jacobian)) != (
        nv,
        feet,
        thrusts,
    ):
        raise InputError(
            f"dynamics must be of '{robot.name}', got that of '{terms.robot.name}'", name="dynamics"
        )
    if (len(tasks.joints), len(tasks.held)) != (len(robot.joints), feet):
        raise InputError(
            f"targets must be of '{robot.name}', got those of another robot", name="targets"
        )


def targets_record(robot: Robot) -> Records[TargetsRecord]:
    """A new :class:`TargetsRecord`."""
    feet = len(robot.feet)
    return make_record(TargetsRecord, robot.sizes, force_range=np.tile((0.0, 1e4), (feet, 1)))


def joint_weights(robot: Robot) -> list[str]:
    """Name of the weight of each joint's acceleration: ``posture`` where it moves one foot, else
    ``arms``.

    A waist between the base and several feet holds no foot where it should be: with the small
    weight of a leg nothing would hold it against the hips.
    """
    moved = feet_moved(robot.model, robot.feet, robot.loops)
    return ["posture" if moved[j] == 1 else "arms" for j in robot.driven]
