"""The one place where states and forces change from this library's conventions to MuJoCo's and
back.

| | here (:class:`harpy_pin.model.state.State`) | MuJoCo |
|---|---|---|
| quaternion | x, y, z, w | w, x, y, z |
| linear velocity of the body, and force on it | body axes | world axes |
| angular velocity of the body, and moment | body axes | body axes |
| joint that turns without end | cosine and sine | angle |
| order of the joints | of Pinocchio's model | depth first |
"""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.kernels import kernel
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.mjcf import find_joints, free_joint
from harpy_pin.model.mjcf_loops import import_mujoco as import_mujoco
from harpy_pin.model.mjcf_rods import set_hinges
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.model.terms import joint_angles, set_joint_angles
from harpy_pin.model.vectors import rotation_matrix
from harpy_pin.simulation.mujoco.differences import ROOT, AtZero, tree_joints

OF_BODIES = ("body_parentid", "jnt_type", "jnt_bodyid", "geom_bodyid", "site_bodyid", "sensor_adr")
OF_ACTUATORS = (
    "actuator_trnid",
    "actuator_ctrladr",
    "actuator_gear",
    "actuator_gainprm",
    "actuator_biasprm",
)
"""Arrays of a model by which its data are read and written."""


def installed_version() -> str | None:
    """Version of MuJoCo; None where it is not installed."""
    return version("mujoco") if find_spec("mujoco") is not None else None


class ConventionsRecord(RecordOf):
    """Places of the base and of the joints in Pinocchio's arrays and in MuJoCo's."""

    base_position: int  # of the free joint in MuJoCo's ``qpos``
    base_velocity: int  # of the free joint in MuJoCo's ``qvel``
    place: NDArray[np.int64]  # (joints,) in q
    column: NDArray[np.int64]  # (joints,) in v
    # (joints,) 1 for a joint without limits, whose q is a cosine and a sine
    unbounded: NDArray[np.int64]
    position: NDArray[np.int64]  # (joints,) in MuJoCo's ``qpos``
    velocity: NDArray[np.int64]  # (joints,) in MuJoCo's ``qvel``
    q: Vector
    v: Vector
    qpos: Vector  # of MuJoCo's data
    qvel: Vector


@fixed_arrays("record")
class Conventions:
    """Turns states and forces of one robot from one convention into the other, in any MuJoCo model
    of it.

    Joints are found by name. A prefix that ends in ``:`` or ``/``, as MuJoCo gives it to attached
    models, does not count, unless it is given. The free joint is that of the joints' tree; the
    frame of its body has to be that of the URDF's root link. Pickles and copies are made anew.

    Args:
        model: ``mujoco.MjModel`` of the robot; its joints have the names of the URDF.
        robot: whose states these are.
        prefix: of the robot's joints in the model, where there are several robots, such as
            ``"a/"``.

    Attributes:
        model: the MuJoCo model.
        robot: the robot.
        prefix: of its joints in the model.
        record: where base and joints are, for :func:`to_mujoco` and :func:`from_mujoco`.
        joints: (joints,) numbers of the robot's joints in the model.
        free: that of the free joint.
        velocity: (joints,) places of the robot's joints in MuJoCo's ``qvel``.
        passive: those of joints that closed loops move.

    Raises:
        InputError: the model has no free joint, lacks a joint, or has one of another kind, axis,
            direction or zero.
    """

    _record_: Records[ConventionsRecord]
    model = property(attrgetter("_model"))
    robot = property(attrgetter("_robot"))
    prefix = property(attrgetter("_prefix"))

    @checked
    def __init__(self, model: Any, robot: Robot, *, prefix: str = "") -> None:
        self._model, self._robot, self._prefix = model, robot, prefix
        self.joints = find_joints(model, [prefix + name for name in robot.joints])
        self.free = free_joint(model, self.joints)
        mujoco = import_mujoco()
        self._data_kind, self._seen, self._arrays = mujoco.MjData, model, _arrays_of(model)
        self._tree = find_joints(model, [prefix + name for name in tree_joints(robot)])
        self._at_zero = AtZero(mujoco, model, robot, self._tree, self.free)
        self._at_zero.check_joints()
        place, unbounded = robot.layout
        self.velocity = model.jnt_dofadr[self.joints].astype(np.int64)
        loops = () if robot.loops is None else robot.loops.passive
        self._passive = self._tree[np.array(loops, dtype=np.int64) - ROOT - 1]
        self.passive = model.jnt_dofadr[self._passive]
        self.record = make_record(
            ConventionsRecord,
            base_position=np.int64(model.jnt_qposadr[self.free]),
            base_velocity=np.int64(model.jnt_dofadr[self.free]),
            place=place,
            column=np.arange(6, robot.nv),
            unbounded=unbounded,
            position=model.jnt_qposadr[self.joints].astype(np.int64),
            velocity=self.velocity,
            q=np.zeros(robot.nq),
            v=np.zeros(robot.nv),
            qpos=np.zeros(model.nq),
            qvel=np.zeros(model.nv),
        )
        q, v, qpos, qvel = (self._record_[name][0] for name in ("q", "v", "qpos", "qvel"))
        to_mujoco.prepare(self._record_, q, v, qpos, qvel)
        from_mujoco.prepare(self._record_, qpos, qvel, q, v)

    def place(self, state: State | tuple[Vector, Vector], data: Any) -> None:
        """Write configuration, velocity and time into MuJoCo's data; ``mujoco.mj_forward`` is the
        caller's.

        Args:
            state: of the robot; or q and v, as a gait's ``initial_state()`` has them.
            data: ``mujoco.MjData``, written in place.

        Raises:
            InputError: the state is of another robot, or the data are of another model.
        """
        self._check_data(data)
        q, v = state if isinstance(state, tuple) else (state.q, state.v)
        q, v = (checks.vector("q", q, self._robot.nq), checks.vector("v", v, self._robot.nv))
        self.assemble(q, v, data.qpos, data.qvel)
        data.time = data.time if isinstance(state, tuple) else state.t

    def assemble(self, q: Vector, v: Vector, qpos: Vector, qvel: Vector) -> None:
        """Write a state into MuJoCo's arrays, passive joints, too.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
            qpos: of MuJoCo's data, written in place.
            qvel: the same.

        Raises:
            InputError: the loops of the robot cannot be closed there.
        """
        to_mujoco(self._record_, q, v, qpos, qvel)
        if self._robot.loops is not None:
            moved = [self._robot.model.joints[j] for j in self._robot.loops.passive]
            tree, speed = self._robot.closed(q), self._robot.velocity_map(q) @ v
            angles, speeds = tree[[j.idx_q for j in moved]], speed[[j.idx_v for j in moved]]
            set_hinges(self._model, self._passive, angles, speeds, qpos, qvel)
        qpos[self._model.jnt_qposadr[self._at_zero.resting]] = self._model.qpos_spring[
            self._model.jnt_qposadr[self._at_zero.resting]
        ]
        qvel[self._model.jnt_dofadr[self._at_zero.resting]] = 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), prefix=self.prefix), (self.model, self.robot)

    def _check_data(self, data: Any) -> Any:
        """The model of data; refuses one that is not this model, nor has its bodies and actuators,
        as its pickle.
        """
        if not isinstance(data, self._data_kind):
            raise InputError(
                f"data must be a mujoco.MjData, got {shown(data)}", name="data", value=data
            )
        model = data.model
        if model is not self._seen:
            if _arrays_of(model) != self._arrays:
                raise InputError(
                    "the data are of another MuJoCo model than the bridge: make a bridge to "
                    "that model",
                    name="data",
                    value=data,
                )
            self._seen = model
        return model


def _arrays_of(model: Any) -> list[bytes]:
    """Names of a model, and what places its state and its controls."""
    return [model.names, *(getattr(model, name).tobytes() for name in (*OF_BODIES, *OF_ACTUATORS))]


@kernel(q="r.q", v="r.v", qpos="r.qpos", qvel="r.qvel")
def to_mujoco(r: ConventionsRecord, q: Vector, v: Vector, qpos: Vector, qvel: Vector) -> None:
    """Write a state q (nq,), v (nv,) into MuJoCo's arrays."""
    base, moving = (
        qpos[r.base_position : r.base_position + 7],
        qvel[r.base_velocity : r.base_velocity + 6],
    )
    base[:3] = q[:3]
    base[3], base[4:] = q[6], q[3:6]
    moving[:3], moving[3:] = rotation_matrix(q[3:7]) @ v[:3], v[3:6]
    qpos[r.position] = joint_angles(q, r.place, r.unbounded)
    qvel[r.velocity] = v[r.column]


@kernel(q="r.q", v="r.v", qpos="r.qpos", qvel="r.qvel")
def from_mujoco(r: ConventionsRecord, qpos: Vector, qvel: Vector, q: Vector, v: Vector) -> None:
    """Read a state q (nq,), v (nv,) from MuJoCo's arrays."""
    base, moving = (
        qpos[r.base_position : r.base_position + 7],
        qvel[r.base_velocity : r.base_velocity + 6],
    )
    q[:3] = base[:3]
    q[3:6], q[6] = base[4:], base[3]
    v[:3], v[3:6] = rotation_matrix(q[3:7]).T @ moving[:3], moving[3:]
    set_joint_angles(q, r.place, r.unbounded, qpos[r.position])
    v[r.column] = qvel[r.velocity]
