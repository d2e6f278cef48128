"""Tasks: rows A x ≈ b in x = [a; f], accelerations and contact forces, of joints, frames, momentum
and feet.

Every task of a whole-body problem is of this kind: those that every problem has, and those that
users add (:mod:`harpy_pin.wbc.tasks.added`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.state import State, Vector

AXES = ("world", "local")
PARTS = {"position": slice(0, 3), "orientation": slice(3, 6), "both": slice(0, 6)}
MOMENTA = {"linear": slice(0, 3), "angular": slice(3, 6), "both": slice(0, 6)}


class Task(Protocol):
    """What a whole-body problem asks of a task; the number of its rows never changes."""

    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """Rows A x ≈ b at a state.

        Args:
            dynamics: terms at the state; ``dynamics.robot`` and ``dynamics.model`` are there, too.
            state: as measured.

        Returns:
            A and b, of shapes (m, nv) and (m,) where the task is on the generalised acceleration a
            alone, in the order of the state's v; or (m, nv + 3 feet) and (m,) with the contact
            forces f behind it, world axes.
        """
        ...


class MotionTask(ABC):
    """A task that follows a reference; its rows are in the classes derived from it.

        desired = acceleration + k_p (position − measured) + k_d (velocity − measured)

    The references may be overwritten between ticks.

    Args:
        size: number of components.
        velocity: (size,) reference; zero by default.
        acceleration: (size,) reference; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Raises:
        InputError: a reference of another size, or a negative gain.
    """

    def __init__(
        self,
        size: int,
        velocity: ArrayLike | None,
        acceleration: ArrayLike | None,
        gains: tuple[float, float],
    ) -> None:
        self.velocity = reference("velocity", velocity, size)
        self.acceleration = reference("acceleration", acceleration, size)
        k_p, k_d = checks.gains("gains", gains, 2)
        self.gains = (float(k_p), float(k_d))

    @abstractmethod
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""

    def desired(self, error: Vector | None, velocity: Vector) -> Vector:
        """Acceleration that the references ask for.

        Args:
            error: (size,) reference less measured position; None without a reference.
            velocity: (size,) as measured.

        Raises:
            InputError: arrays of another size.
        """
        k_p, k_d = self.gains
        velocity = checks.array("velocity", velocity, len(self.velocity))
        error = None if error is None else checks.array("error", error, len(self.velocity))
        desired: Vector = self.acceleration + k_d * (self.velocity - velocity)
        return desired if error is None else desired + k_p * error


def reference(name: str, given: ArrayLike | None, size: int) -> Vector:
    """A reference of a task, (size,); zero where none is given. For one component a number will
    do.
    """
    if given is None:
        return np.zeros(size)
    one = size == 1 and isinstance(given, int | float | np.number)
    return checks.vector(name, np.array([given]) if one else given, size)


def reference_position(
    given: ArrayLike | None, size: int, gains: tuple[float, float]
) -> Vector | None:
    """The reference position, which a stiffness needs, and which needs a stiffness.

    Raises:
        InputError: there is none, and k_p is not zero; or there is one, and k_p is zero.
    """
    if given is not None:
        position = reference("position", given, size)
        check_stiffness("position", gains)
        return position
    if gains[0] != 0.0:
        raise InputError("a gain k_p needs a position to go to", name="position")
    return None


def check_stiffness(name: str, gains: tuple[float, float]) -> None:
    """Refuse a position or a rotation that nothing pulls towards.

    Raises:
        InputError: k_p is zero.
    """
    if gains[0] == 0.0:
        raise InputError(
            f"a {name} needs a gain k_p, such as gains=(100, 20)", name="gains", value=gains
        )


@fixed_arrays("acceleration", "position", "velocity")
class JointTask(MotionTask):
    """Accelerations of joints.

    Args:
        joints: their names, or one name. The references below have their order; for one joint a
            number will do.
        position: (m,) angles to go to, rad.
        velocity: (m,) reference, rad/s; zero by default.
        acceleration: (m,) reference, rad/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, velocity, acceleration, gains: as given; they may be overwritten between ticks.

    Raises:
        InputError: no joint; a k_p without positions, or positions without a k_p; references of
            another length than ``joints``. Unknown joints are refused when the task is added.
    """

    def __init__(
        self,
        joints: str | Sequence[str],
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.joints = (joints,) if isinstance(joints, str) else checks.names("joints", joints)
        if not self.joints:
            raise InputError("a task of joints needs one at least", name="joints", value=joints)
        super().__init__(len(self.joints), velocity, acceleration, gains)
        self.position = reference_position(position, len(self.joints), self.gains)
        self._robot: Any = None
        self._columns: list[int] = []

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        if self._robot is not dynamics.robot:
            names = dynamics.robot.joints
            for name in self.joints:
                checks.one_of("joint", name, names)
            self._robot, self._columns = (
                dynamics.robot,
                [6 + names.index(name) for name in self.joints],
            )
        columns = np.array(self._columns, dtype=np.int64)
        matrix = np.zeros((len(columns), len(state.v)))
        matrix[np.arange(len(columns)), columns] = 1.0
        error = None if self.position is None else self.position - state.q[columns + 1]
        return matrix, self.desired(error, state.v[columns])


@fixed_arrays("acceleration", "position", "rotation", "velocity")
class FrameTask(MotionTask):
    """Acceleration of a frame of the robot: of its origin, of its axes, or of both (linear first).

    It is that in the world, or that of the pose relative to another frame, ``root``, such as of one
    hand in the axes of the other.

    Args:
        frame: its name in the model: a link, a joint, a foot, a thruster.
        part: ``position``, ``orientation`` or ``both``.
        root: name of the frame in whose axes positions, rotations and ``world`` axes are; None for
            the world.
        axes: in which the rows are written: ``world``, or ``local`` for those of the frame.
        position: (3,) where the origin should be, world, m.
        rotation: (3, 3) frame to world as it should be.
        velocity: (3,) or (6,) reference in ``axes``, m/s and rad/s; zero by default.
        acceleration: (3,) or (6,) reference in ``axes``, m/s² and rad/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, rotation, velocity, acceleration, gains: as given; they may be overwritten between
            ticks.

    Raises:
        InputError: an unknown part or axes; a frame as its own root; a k_p without the reference
            it needs; a position or a rotation without a k_p; a rotation that is none. An unknown
            frame is refused when the task is added.
    """

    def __init__(
        self,
        frame: str,
        *,
        part: str = "position",
        root: str | None = None,
        axes: str = "world",
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        checks.one_of("part", part, PARTS)
        checks.one_of("axes", axes, AXES)
        if isinstance(frame, str) and isinstance(root, str) and root == frame:
            raise InputError(
                f"the root must be another frame than '{frame}'", name="root", value=root
            )
        self.frame, self.part, self.root, self.axes = frame, part, root, axes
        self._rows = PARTS[part]
        super().__init__(self._rows.stop - self._rows.start, velocity, acceleration, gains)
        if part != "orientation":
            self.position = reference_position(position, 3, self.gains)
        else:  # which reads none
            self.position = None if position is None else checks.vector("position", position, 3)
        if rotation is None and part != "position" and self.gains[0] != 0.0:
            raise InputError("a gain k_p needs a rotation to go to", name="rotation")
        self.rotation = None if rotation is None else checks.rotation("rotation", rotation)
        if self.rotation is not None and part != "position":
            check_stiffness("rotation", self.gains)
        self._model: Any = None
        self._data: Any = None
        self._frames: list[int] = []

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        model = dynamics.model
        if self._model is not model:
            names = (self.frame,) if self.root is None else (self.frame, self.root)
            self._frames = [dynamics.robot.frame_id(name) for name in names]
            self._model, self._data = model, model.createData()
        if dynamics.robot.loops is not None:
            message = f"rows in Python of a task of a frame: '{dynamics.robot.name}' has loops"
            raise InputError(f"{message}, which only the condensed controller's tasks know")
        data, world = self._data, pin.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(model, data, state.q)
        pin.forwardKinematics(model, data, state.q, state.v, np.zeros(model.nv))
        place, *roots = (pin.updateFramePlacement(model, data, frame) for frame in self._frames)
        jacobian, *others = (
            pin.getFrameJacobian(model, data, frame, world) for frame in self._frames
        )
        drift, *drifts = (
            pin.getFrameClassicalAcceleration(model, data, frame, world).vector
            for frame in self._frames
        )
        root = pin.SE3.Identity()
        for root, other, moved in zip(roots, others, drifts, strict=True):  # at the frame's origin
            arm, turning = place.translation - root.translation, other[3:] @ state.v
            jacobian = jacobian - other
            jacobian[:3] += pin.skew(arm) @ other[3:]
            linear, angular = (jacobian @ state.v).reshape(2, 3)
            drift = drift - moved
            drift[:3] += np.cross(arm, moved[3:]) - np.cross(turning, np.cross(turning, arm))
            drift[:3] -= 2.0 * np.cross(turning, linear)
            drift[3:] -= np.cross(turning, angular)
        error = np.zeros(6)
        if self.position is not None:
            error[:3] = root.act(self.position) - place.translation
        if self.rotation is not None:
            error[3:] = root.rotation @ pin.log3(self.rotation @ place.rotation.T @ root.rotation)
        stacked = np.column_stack((jacobian, jacobian @ state.v, drift, error))
        axes = place.rotation if self.axes == "local" else root.rotation
        stacked = (axes.T @ stacked.reshape(2, 3, -1)).reshape(6, -1)
        stacked = stacked[self._rows]
        velocity, drift, error = stacked[:, -3:].T
        return stacked[:, :-3], self.desired(error, velocity) - drift


@fixed_arrays("acceleration", "position", "velocity")
class CentreOfMassTask(MotionTask):
    """Acceleration of the centre of mass, world axes.

    Args:
        position: (3,) where it should be, m.
        velocity: (3,) reference, m/s; zero by default.
        acceleration: (3,) reference, m/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, velocity, acceleration, gains: as given; they may be overwritten between ticks.

    Raises:
        InputError: a k_p without a position.
    """

    def __init__(
        self,
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        super().__init__(3, velocity, acceleration, gains)
        self.position = reference_position(position, 3, self.gains)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        rotation, mass = dynamics.rotation, dynamics.mass_matrix[0, 0]
        matrix = rotation @ dynamics.mass_matrix[:3] / mass
        drift = rotation @ dynamics.bias[:3] / mass + dynamics.model.gravity.linear
        error = None
        if self.position is not None:
            error = self.position - state.q[:3] - dynamics.rotation @ _centre(dynamics)
        return matrix, self.desired(error, matrix @ state.v) - drift


@fixed_arrays("momentum", "rate")
class MomentumTask:
    """Rate of the robot's momentum, the angular one about the centre of mass, world axes.

    Args:
        part: ``linear``, ``angular`` or ``both`` (linear first).
        momentum: (3,) or (6,) reference, kg·m/s and kg·m²/s; zero by default.
        rate: (3,) or (6,) reference of its rate, N and N·m; zero by default.
        gain: of the difference of momentum, 1/s.

    Attributes:
        momentum, rate, gain: as given; they may be overwritten between ticks.

    Raises:
        InputError: an unknown part, or a negative gain.
    """

    def __init__(
        self,
        *,
        part: str = "angular",
        momentum: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        gain: float = 0.0,
    ) -> None:
        checks.one_of("part", part, MOMENTA)
        self._rows = MOMENTA[part]
        size = self._rows.stop - self._rows.start
        self.part = part
        self.momentum = reference("momentum", momentum, size)
        self.rate = reference("rate", rate, size)
        self.gain = checks.number("gain", gain, low=0.0)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        matrix, drift = _momentum_rows(dynamics)
        matrix, drift = matrix[self._rows], drift[self._rows]
        return matrix, self.rate + self.gain * (self.momentum - matrix @ state.v) - drift


def _centre(dynamics: Dynamics) -> Vector:
    """(3,) centre of mass from the body's origin, body axes, m: the mass matrix has −m [c]× beside
    m I.
    """
    m = dynamics.mass_matrix
    return np.array((-m[2, 4], -m[0, 5], -m[1, 3]), dtype=np.float64) / float(m[0, 0])


def _momentum_rows(dynamics: Dynamics) -> tuple[Vector, Vector]:
    """(6, nv) A and (6,) d with ḣ = A a + d and h = A v, h the linear and angular momentum, world
    axes.

    The floating base's six rows of M a + n are the wrench on the robot about the base's origin
    without gravity, in body axes. About the centre of mass c its moment is less by c × force, and
    gravity has none.
    """
    rotation, matrix = (
        dynamics.rotation,
        np.column_stack((dynamics.mass_matrix[:6], dynamics.bias[:6])),
    )
    matrix[3:] -= pin.skew(_centre(dynamics)) @ matrix[:3]
    matrix = (rotation @ matrix.reshape(2, 3, -1)).reshape(6, -1)
    matrix[:3, -1] += dynamics.mass_matrix[0, 0] * dynamics.model.gravity.linear
    return matrix[:, :-1], matrix[:, -1]


@fixed_arrays("force")
class FootForceTask:
    """Force of the ground on a foot, world axes. In swing the task is inactive.

    Args:
        foot: its name.
        force: (3,) desired, N; zero by default.

    Attributes:
        force: as given; it may be overwritten between ticks.

    Raises:
        InputError: a force that is not a vector of three numbers. An unknown foot is refused when
            the task is added.
    """

    def __init__(self, foot: str, *, force: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.foot = foot
        self.force = checks.vector("force", force, 3)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        feet, nv = dynamics.robot.feet, len(state.v)
        checks.one_of("foot", self.foot, feet)
        first = nv + 3 * feet.index(self.foot)
        matrix = np.zeros((3, nv + 3 * len(feet)))
        matrix[:, first : first + 3] = np.eye(3)
        return matrix, self.force.copy()
