"""A controller of this library in a MuJoCo simulation of one's own: its state in, a command out."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.estimation.imu import Imu
from harpy_pin.estimation.readings import Readings
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord, dynamics_record
from harpy_pin.model.entry import as_command
from harpy_pin.model.loops import residual_of
from harpy_pin.model.mjcf import plain_name, sphere_radius
from harpy_pin.model.mjcf_loops import driven_joints, read_ties, refuse_loops
from harpy_pin.model.mjcf_options import enabled_actuators
from harpy_pin.model.mjcf_rods import hinge_names
from harpy_pin.model.record import RecordOf, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.model.terms import all_finite, place_bodies, point_terms
from harpy_pin.simulation.actuators import (
    Actuators,
    MotorsRecord,
    drive_motors,
    motors_of,
    motors_record,
)
from harpy_pin.simulation.mujoco.conventions import (
    Conventions,
    ConventionsRecord,
    from_mujoco,
    import_mujoco,
)
from harpy_pin.simulation.mujoco.differences import ROOT, AtZero, differences

DEPTH = 0.02
"""How deep a foot may be in soft ground, m: contacts so far from its point are its, however small
its shape.
"""
MAX_OPEN = 1e-3
"""Residual of the model's loops where the robot's are closed, m or rad."""
HIGH = 100.0
"""Height above that of a configuration at which a robot's contacts with itself are looked for,
m.
"""


class BridgeRecord(RecordOf):
    """What reading and writing need, and work space."""

    conventions: ConventionsRecord
    dynamics: DynamicsRecord
    motors: MotorsRecord
    link: NDArray[np.int64]  # (geoms, feet) 1 where a geom is on the link of a foot
    reach: Vector  # (feet,) distance from a foot's point within which contacts are its, m
    # (joints,) of each joint's actuator in ``ctrl``, or of the joint in ``qfrc_applied``
    entry: NDArray[np.int64]
    output: NDArray[np.int64]  # (joints,) of each joint's actuator among the gears
    number: NDArray[np.int64]  # (joints,) of each joint's actuator
    affine: NDArray[np.int64]  # (joints,) 1 where the force has a bias
    control: Vector  # of MuJoCo's data: ``ctrl`` or ``qfrc_applied``
    gear: Vector  # (outputs, 6) torque per force of the actuator
    gain: Vector  # (actuators, 10) force per control, first
    # (actuators, 10) force at no control, N; per length, and per velocity of the actuator
    bias: Vector


class MujocoBridge(Conventions):
    """Reads states from a MuJoCo simulation of a robot, and writes commands into it; made once for
    a model.

    Joints are found by name, as :class:`~harpy_pin.simulation.mujoco.Conventions` says. Contacts on
    a link count for its nearest foot. Where a point foot has geometry of its own (a sphere around
    its point, or what has its name), only those within twice its size do, so that a knee is no
    foot.

    Actuators are motors or servos of position or velocity; without any, torques are written into
    ``qfrc_applied``. Their gears and gains are those that the model has when a command is written.
    Data may be of the model, or of a copy of it; several threads may use one bridge, each with data
    of its own.

    Args:
        model: ``mujoco.MjModel`` of the robot.
        robot: as the controller knows it.
        prefix: of the robot's joints in the model, where there are several robots, such as
            ``"a/"``.

    Attributes:
        foot_radius: (feet,) of the spheres around the feet's points, m; 0 where there is none.

    Raises:
        InputError: MuJoCo is not installed, or the model is another robot's: without its joints,
            with closed loops that are active in it, or with actuators that are missing or not
            supported.
    """

    @checked
    def __init__(self, model: Any, robot: Robot, *, prefix: str = "") -> None:
        self._mujoco = import_mujoco()
        super().__init__(model, robot, prefix=prefix)
        self._check_joints()
        self._check_loops()
        nq, nv, self.foot_radius = robot.nq, robot.nv, np.zeros(len(robot.feet))
        self._record = make_record(
            BridgeRecord,
            robot.sizes,
            conventions=self._record_,
            dynamics=dynamics_record(robot),
            motors=motors_record(Actuators(), **motors_of(robot)),
            **self._find_feet(),
            **self._find_actuators(),
        )
        self._shapes = (nq, nv, (len(robot.feet), 3))
        self._no_law = np.zeros((4, len(robot.joints)))

    @property
    def differences(self) -> str:
        """What the model has otherwise than the robot, as it is now, one line each; empty where
        they agree.

        What the model's options disable has no effect, and is left out. Compared are masses,
        centres and inertias of the links, places and axes of the joints with all angles at zero,
        their ends, armature, damping, dry friction and largest torques. Named is what the robot has
        not: gravity of another size, springs, weights that are compensated, air, tendons, actuators
        with a delay or whose range of control cuts torques off, contacts with a margin, trees that
        sleep, and solvers that are wrong.
        """
        here = AtZero(self._mujoco, self.model, self.robot, self._tree, self.free)
        return differences(here, self._record["link"][0], self._actuators)

    def self_contacts(self, q: ArrayLike) -> dict[tuple[str, str], float]:
        """Which of the robot's own geoms push each other apart in a configuration, and how hard, N.

        The robot is at rest there, high above the ground. Controllers know nothing of such forces.

        Args:
            q: (nq,) configuration, such as that of a gait's ``initial_state()``.

        Returns:
            Sum of the normal forces by the names of the two geoms; of one without a name its
            body's.
        """
        model, data, force = self.model, self._mujoco.MjData(self.model), np.zeros(6)
        lifted = checks.vector("q", q, self._shapes[0]).copy()
        lifted[2] += HIGH
        self.place((lifted, np.zeros(self._shapes[1])), data)
        self._mujoco.mj_forward(model, data)
        root, found = model.body_rootid[model.jnt_bodyid[self.free]], dict[tuple[str, str], float]()
        for number, pair in enumerate(data.contact.geom.tolist() if data.ncon else ()):
            self._mujoco.mj_contactForce(model, data, number, force)
            if force[0] > 0.0 and all(
                k >= 0 and model.body_rootid[model.geom_bodyid[k]] == root for k in pair
            ):
                one, other = (
                    model.geom(k).name or model.body(model.geom_bodyid[k]).name for k in pair
                )
                found[one, other] = found.get((one, other), 0.0) + float(force[0])
        return found

    def read(self, data: Any) -> State:
        """The state of MuJoCo's data.

        Feet are placed by the robot's kinematics. Forces are those of the last ``mj_step`` or
        ``mj_forward``.

        Args:
            data: ``mujoco.MjData`` of the model.

        Raises:
            InputError: data of another model.
        """
        model = self._check_data(data)
        nq, nv, feet = self._shapes
        q, v, position, velocity, force = (
            np.empty(nq),
            np.empty(nv),
            np.empty(feet),
            np.empty(feet),
            np.zeros(feet),
        )
        read_state(self._record, data.qpos, data.qvel, q, v, position, velocity)
        if count := data.ncon:
            wrench, contact, contact_force = (
                np.empty((count, 6)),
                data.contact,
                self._mujoco.mj_contactForce,
            )
            for number, row in enumerate(wrench):
                contact_force(model, data, number, row)
            geoms, frames, places = (
                contact.geom.astype(np.int64),
                contact.frame.copy(),
                contact.pos.copy(),
            )
            read_contacts(self._record, geoms, frames, places, wrench, position, force)
        return State(data.time, q, v, position, velocity, force)

    @cached_property
    def imu(self) -> Imu:
        """The place of the model's gyroscope and accelerometer on the robot's body, with the noise
        of :class:`Imu`.

        Raises:
            InputError: the model has not one of each there, or the two are apart.
        """
        return self._sensors[0]

    def readings(self, data: Any) -> Readings:
        """What gyroscope, accelerometer, encoders and motors of MuJoCo's data say, of the last
        step, without noise.

        Args:
            data: ``mujoco.MjData`` of the model.

        Raises:
            InputError: as of :attr:`imu`, or data of another model.
        """
        self._check_data(data)
        (gyroscope, accelerometer), places = (
            self._sensors[1],
            self._record["conventions"]["position"][0],
        )
        turning, felt = (data.sensordata[n : n + 3].copy() for n in (gyroscope, accelerometer))
        torque = (data.qfrc_actuator if len(self._actuators) else data.qfrc_applied)[self.velocity]
        return Readings(
            data.time, turning, felt, data.qpos[places], data.qvel[self.velocity], torque
        )

    @cached_property
    def _sensors(self) -> tuple[Imu, list[int]]:
        """The inertial unit, and where its two sensors are in ``sensordata``."""
        here, kinds = self._at_zero, self._mujoco.mjtSensor
        model, found = here.model, list[int]()
        for what, kind in (
            ("gyroscope", kinds.mjSENS_GYRO),
            ("accelerometer", kinds.mjSENS_ACCELEROMETER),
        ):
            numbers = np.flatnonzero(model.sensor_type == int(kind))
            own = numbers[
                here.link[model.site_bodyid[model.sensor_objid[numbers]]] == ROOT
            ].tolist()
            if len(own) != 1:
                raise InputError(
                    f"the MuJoCo model has {len(own) or 'no'} {what} on the robot's body",
                    name="model",
                )
            if model.sensor_delay[own[0]] or model.sensor_interval[own[0]].any():
                raise InputError(
                    f"the {what} '{model.sensor(own[0]).name}' of the MuJoCo model has a "
                    f"delay or an interval: "
                    "readings are of one step",
                    name="model",
                )
            found += own
        first, second = (here.place("site", site) for site in model.sensor_objid[found])
        if not np.allclose(first.homogeneous, second.homogeneous, atol=1e-3):
            raise InputError(
                "gyroscope and accelerometer of the MuJoCo model are apart", name="model"
            )
        unit = Imu(
            position=tuple(first.translation.tolist()),
            orientation=tuple(pin.rpy.matrixToRpy(first.rotation).tolist()),
        )
        return unit, model.sensor_adr[found].tolist()

    def write(self, command: Command, data: Any) -> None:
        """Write a command into the controls of MuJoCo's data.

        The motors' law is evaluated at the data's present state, within the robot's peak torques:
        with one, call this in every physics step. What is beyond the range of a control is cut off
        by MuJoCo.

        Args:
            command: torques, and the motors' law if there is one; thrusts are not written.
            data: ``mujoco.MjData`` of the model.

        Raises:
            InputError: a command of another robot, with thrusts, or that is not finite; or data of
                another model.
        """
        self._check_data(data)
        try:
            law, out = command.law, data.ctrl if len(self._actuators) else data.qfrc_applied
            given = (command.torque, self._no_law if law is None else law, law is not None)
            fits = write_controls(self._record, *given, data.qpos, data.qvel, *self._gains, out)
        except (AttributeError, TypeError, HarpyError):
            fit = as_command(command, self.robot)
            if fit is command:
                raise
            return self.write(fit, data)
        if not fits:
            raise InputError(
                "the command is not finite, or a gear or gain of the model is zero",
                name="command",
                value=command,
            )
        if len(command.thrust) and np.any(command.thrust):
            raise InputError(
                "thrusts are not written into MuJoCo's data", name="command", value=command
            )
        return None

    def _check_joints(self) -> None:
        """The robot's joints are all joints of its tree."""
        of_tree = np.flatnonzero(np.isin(self.model.jnt_bodyid, self._at_zero.bodies))
        more = [
            self.model.joint(number).name
            for number in np.setdiff1d(of_tree, [self.free, *self._tree, *self._at_zero.resting])
        ]
        if more:
            raise InputError(
                f"the MuJoCo model has joints that the robot has not: {', '.join(more)}",
                name="model",
            )

    def _check_loops(self) -> None:
        """The loops of the model are the robot's: closed where the robot's are, and as many."""
        here, robot = self._at_zero, self.robot
        refuse_loops(here.model, here.bodies)
        ties = read_ties(here.model, here.built, here.held)
        own, rows, left = robot.loops, 0, 0.0
        if own is not None:
            rows = len(residual_of(robot.model, own.ties, robot.closed(robot.reference))[0])
        if ties and own is not None:
            names = hinge_names(here.model, self._tree)
            order = [here.built.getJointId(name) - ROOT - 1 for name in names]
            q, spread = pin.neutral(here.built), np.zeros((here.built.nv, robot.nv))
            q[7:][order] = own.angles
            spread[6:][order] = robot.velocity_map(robot.reference)[6:]
            residual, slope = residual_of(here.built, ties, q)
            rows -= len(residual)
            left = max(np.abs(residual).max(), np.abs(slope @ spread).max())
        if rows != 0 or left > MAX_OPEN or bool(ties) != (own is not None):
            raise InputError("the MuJoCo model has other closed loops than the robot", name="model")

    def _find_actuators(self) -> dict[str, NDArray[Any]]:
        """Each joint's actuator, its place in the controls, and gears, gains and biases of all."""
        model, size = self.model, len(self.joints)
        driven = np.where(enabled_actuators(model), driven_joints(model), -1)
        found = [np.flatnonzero(driven == joint) for joint in self.joints]
        if not any(map(len, found)):
            if model.nu and size:
                raise InputError(
                    "no actuator of the MuJoCo model drives a joint of the robot, or all are "
                    "disabled",
                    name="model",
                )
            self._actuators, numbers = np.zeros(0, np.int64), np.arange(size)
            self._gains = np.ones((size, 6)), np.ones((size, 10)), np.zeros((size, 10))
            entry, output, affine, control = (
                self.velocity,
                numbers,
                np.zeros(size, np.int64),
                np.zeros(model.nv),
            )
        else:
            for name, own in zip(self.robot.joints, found, strict=True):
                if len(own) != 1:
                    raise InputError(
                        f"joint '{name}' has {len(own) or 'no'} actuators that are enabled "
                        f"in the MuJoCo model; "
                        "it needs one",
                        name="model",
                    )
            self._actuators = numbers = np.concatenate(found).astype(np.int64)
            self._gains = model.actuator_gear, model.actuator_gainprm, model.actuator_biasprm
            entry, output = model.actuator_ctrladr[numbers], model.actuator_outadr[numbers]
            kind, control = model.actuator_biastype[numbers], np.zeros(model.nu)
            affine = (kind == 1).astype(np.int64)
            factor = model.actuator_gear[output, 0] * model.actuator_gainprm[numbers, 0]
            other = (
                (model.actuator_dyntype[numbers] != 0)
                | (model.actuator_gaintype[numbers] != 0)
                | (kind > 1)
            )
            for number in numbers[other | (factor == 0.0)]:
                raise InputError(
                    f"actuator '{model.actuator(number).name}' of the MuJoCo model is "
                    f"neither motor nor servo: "
                    "with a fixed gain, a constant or affine bias, no state",
                    name="model",
                )
        places = {"entry": entry, "output": output, "number": numbers, "affine": affine}
        gear, gain, bias = self._gains
        return places | {"control": control, "gear": gear, "gain": gain, "bias": bias}

    def _find_feet(self) -> dict[str, NDArray[Any]]:
        """Radii of the feet's spheres, reach of each foot, and which geoms are on its link."""
        robot, here = self.robot, self._at_zero
        model = here.model
        moved = [robot.model.frames[robot.frame_id(name)].parentJoint for name in robot.feet]
        link, reach = np.zeros((model.ngeom, len(moved)), np.int64), np.zeros(len(moved))
        for k, name in enumerate(robot.feet):
            own = np.flatnonzero(here.link[model.geom_bodyid] == moved[k]).tolist()
            link[own, k] = 1
            places = [here.place("geom", geom).translation for geom in own]
            self.foot_radius[k] = sphere_radius(model, own, places, here.foot[k])
            for geom, place in zip(own, places, strict=True):
                names = {
                    plain_name(item.name)
                    for item in (model.geom(geom), model.body(model.geom_bodyid[geom]))
                }
                size, apart = model.geom_rbound[geom], np.linalg.norm(place - here.foot[k])
                is_sphere = apart <= size and size == self.foot_radius[k]
                if name in names or is_sphere:
                    reach[k] = max(reach[k], 2.0 * (apart + size), DEPTH)
            if reach[k] == 0.0 or moved.count(moved[k]) > 1:
                reach[k] = np.inf
        return {"link": link, "reach": reach}


@kernel(
    qpos="r.conventions.qpos", qvel="r.conventions.qvel", q="r.conventions.q", v="r.conventions.v"
)
def read_state(
    r: BridgeRecord,
    qpos: Vector,
    qvel: Vector,
    q: Vector,
    v: Vector,
    position: Vector,
    velocity: Vector,
) -> None:
    """The state q, v of MuJoCo's arrays, and places and velocities of the feet (feet, 3)."""
    c, first = r.conventions, r.conventions.base_position + 3
    c.qpos[:] = qpos
    quaternion = c.qpos[first : first + 4]
    quaternion /= np.sqrt(quaternion @ quaternion)
    from_mujoco(c, c.qpos, qvel, q, v)
    place_bodies(r.dynamics.tree, q, v)
    point_terms(r.dynamics, q)
    position[:] = r.dynamics.foot_position
    velocity[:] = r.dynamics.foot_velocity


@kernel
def read_contacts(
    r: BridgeRecord,
    geoms: NDArray[np.int64],
    frames: Vector,
    places: Vector,
    wrench: Vector,
    position: Vector,
    force: Vector,
) -> None:
    """Add to forces on the feet (feet, 3), N, those of contacts: their two geoms (contacts, 2), −1
    for none, axes (contacts, 9) with the normal first, places (contacts, 3), and wrenches (contacts
    or more, 6) on the second geom.
    """
    for n in range(geoms.shape[0]):
        for side in range(2):
            nearest, least = -1, np.inf
            if geoms[n, side] >= 0:
                for k in range(position.shape[0]):
                    away = position[k, :3] - places[n, :3]
                    apart = float(away @ away)
                    if (
                        r.link[geoms[n, side], k] != 0
                        and apart < least
                        and apart <= r.reach[k] * r.reach[k]
                    ):
                        nearest, least = k, apart
            if nearest >= 0:
                sign = 1.0 if side == 1 else -1.0
                force[nearest, :3] += sign * (frames[n].reshape((3, 3)).T @ wrench[n, :3])


@kernel(
    torque="r.motors.mean_torque",
    law="r.motors.law",
    qpos="r.conventions.qpos",
    qvel="r.conventions.qvel",
    gear="r.gear",
    gain="r.gain",
    bias="r.bias",
    out="r.control",
)
def write_controls(
    r: BridgeRecord,
    torque: Vector,
    law: Vector,
    has_law: bool,
    qpos: Vector,
    qvel: Vector,
    gear: Vector,
    gain: Vector,
    bias: Vector,
    out: Vector,
) -> bool:
    """Controls that bring about torques (joints,), N·m, and a law (4, joints); whether these are
    finite and can be.
    """
    c, m = r.conventions, r.motors
    m.has_law = has_law
    if has_law:
        m.law[:] = law
        from_mujoco(c, qpos, qvel, c.q, c.v)
    drive_motors(m, torque, c.q, c.v, 1.0)
    drives = np.all(gear[r.output, 0] * gain[r.number, 0] != 0.0)
    if not drives or not all_finite(m.mean_torque):
        return False
    for j in range(torque.shape[0]):
        ratio, number, force = gear[r.output[j], 0], r.number[j], 0.0
        if r.affine[j]:
            length, speed = ratio * qpos[c.position[j]], ratio * qvel[c.velocity[j]]
            force = bias[number, 0] + bias[number, 1] * length + bias[number, 2] * speed
        out[r.entry[j]] = (m.mean_torque[j] / ratio - force) / gain[number, 0]
    return True
