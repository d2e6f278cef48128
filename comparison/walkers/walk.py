"""One walk of Go1 in MuJoCo: the policy's actuators and rate, or torques of the condensed WBC at every step."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time_ns
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.walkers.policy import PERIOD, Policy, package_in
from harpy_pin import MujocoBridge, Robot, State, WalkingGait, make_controller
from harpy_pin.errors import ControlError
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import import_mujoco

SCENE = Path("_src", "locomotion", "go1", "xmls", "scene_mjx_feetonly_flat_terrain.xml")
FEET = ("FR", "FL", "RR", "RL")
"""Names of the feet's spheres, and of the sites at their centres."""


def described(package: Path) -> Any:
    """``mujoco.MjSpec`` of robot and floor, without what is only drawn.

    The floor lies one radius of a foot lower than the wheel has it: the centres of feet on the ground are at height
    zero, as the gait expects of points.

    Args:
        package: folder of ``mujoco_playground``.
    """
    mujoco = import_mujoco()
    spec = mujoco.MjSpec.from_file(str(package / SCENE))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    radius = spec.compile().geom(FEET[0]).size[0]
    spec.geom("floor").pos = (0.0, 0.0, -radius)
    for key in spec.keys:
        key.qpos[2] -= radius
    return spec


def robot_of(spec: Any) -> Robot:
    """The robot that MuJoCo has: kinematics, masses, armature and damping of the joints, torque limits, posture.

    Dry friction in the joints is left to be found out.

    Args:
        spec: as :func:`described`; the first keyframe is the posture.
    """
    model = spec.compile()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        file.write_text(spec.to_xml(), encoding="utf-8")
        read = pin.buildModelFromMJCF(str(file))
    driven = {model.joint(joint).name: k for k, joint in enumerate(model.actuator_trnid[:, 0])}
    limit = np.array(read.effortLimit)
    limit[6:] = [model.actuator_forcerange[driven[name], 1] for name in list(read.names)[2:]]
    read.effortLimit = limit
    return Robot(read, file, FEET, (), np.inf, posture=np.array(model.key_qpos[0, 7:])).with_joints(friction=0.0)


def torque_driven(model: Any) -> None:
    """Make every actuator one that takes a torque, with the limits that it had.

    Args:
        model: ``mujoco.MjModel``, changed in place.
    """
    model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :3] = 1.0, 0.0
    model.actuator_ctrllimited[:] = 0


AIR = 0.05
"""A foot that was off the ground for so long has made a step when it lands, s."""
SETTLED = 2.0
"""After a new command, s."""
LOWEST, UPRIGHT = 0.5, 0.5
"""Share of the first height, and cosine of the tilt, below which the robot fell."""
GRAVITY = 9.81


class Watch:
    """Sums over a walk; :meth:`look` after every step of MuJoCo.

    Args:
        model: ``mujoco.MjModel``, whose first body is the robot's.
        data: ``mujoco.MjData`` at the start.
        feet: names of the feet's spheres.
    """

    def __init__(self, model: Any, data: Any, feet: Sequence[str]) -> None:
        self._model, self._data = model, data
        self._feet = [int(model.geom(name).id) for name in feet]
        self._height = float(data.qpos[2])
        self._air = np.zeros(len(feet))
        self._all: list[float] = []
        self._settled: list[float] = []
        self._turn: list[float] = []
        self._command, self._since = np.zeros(3), 0.0
        self.slip = self.energy = self.path = self.time = 0.0
        self.steps = 0
        self.fell = False

    def look(self, command: Vector) -> None:
        """Take up the state at which the last step began, and its forces.

        Args:
            command: (3,) forward, to the left, turning, m/s and rad/s.
        """
        mujoco = import_mujoco()
        model, data, dt = self._model, self._data, float(self._model.opt.timestep)
        if not np.array_equal(command, self._command):
            self._command, self._since = np.array(command), 0.0
        speed, on = sliding(model, data, self._feet)
        self.slip += dt * float(speed.sum())
        self.steps += int(np.sum(on & (self._air >= AIR)))
        self._air = np.where(on, 0.0, self._air + dt)
        self.energy += dt * float(np.maximum(data.actuator_force * data.actuator_velocity, 0.0).sum())
        turned = data.xmat[1].reshape(3, 3)
        heading = turned[:2, 0] / np.linalg.norm(turned[:2, 0])
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, velocity, 0)
        ahead, aside = velocity[3:5] @ heading, velocity[4] * heading[0] - velocity[3] * heading[1]
        self.path += dt * float(np.hypot(velocity[3], velocity[4]))
        error = float((ahead - command[0]) ** 2 + (aside - command[1]) ** 2)
        self._all.append(error)
        if self._since >= SETTLED:
            self._settled.append(error)
            self._turn.append(float(velocity[2] - command[2]) ** 2)
        self._since, self.time = self._since + dt, self.time + dt
        self.fell = bool(data.xpos[1, 2] < LOWEST * self._height or turned[2, 2] < UPRIGHT)

    def measures(self) -> dict[str, Any]:
        """Of the walk so far; None where there was nothing to measure."""
        weight = GRAVITY * float(self._model.body_subtreemass[1])
        return {
            "fell": self.fell,
            "stood_s": self.time,
            "slip_mm_per_step": 1e3 * self.slip / max(self.steps, 1),
            "steps_per_s": self.steps / self.time,
            "error_m_s": _rms(self._all),
            "settled_error_m_s": _rms(self._settled),
            "settled_turn_error_rad_s": _rms(self._turn),
            "joint_power_w": self.energy / self.time,
            "cost_of_transport": self.energy / (weight * self.path),
        }


def sliding(model: Any, data: Any, feet: Sequence[int]) -> tuple[Vector, np.ndarray]:
    """(feet,) speed along the ground of what touches it, m/s, and whether a foot is in contact.

    A foot that rolls does not slide.

    Args:
        model: ``mujoco.MjModel``; the ground is level.
        data: ``mujoco.MjData``.
        feet: numbers of geoms.
    """
    mujoco = import_mujoco()
    speed, on = np.zeros(len(feet)), np.zeros(len(feet), dtype=bool)
    force, velocity = np.zeros(6), np.zeros(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        foot = next((geom for geom in contact.geom if geom in feet), None)
        mujoco.mj_contactForce(model, data, k, force)
        if foot is None or force[0] <= 0.0:
            continue
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, foot, velocity, 0)
        (p, q, r), (x, y, z) = velocity[:3], contact.pos - data.geom_xpos[foot]
        place = feet.index(foot)
        speed[place], on[place] = np.hypot(velocity[3] + q * z - r * y, velocity[4] + r * x - p * z), True
    return speed, on


def _rms(squares: list[float]) -> float | None:
    return float(np.sqrt(np.mean(squares))) if squares else None


NETWORK, LAW, LEARNING = "policy", "condensed", "condensed, joint friction"
WALKERS = (NETWORK, LAW, LEARNING)
PLANTS: dict[str, dict[str, float]] = {
    "MuJoCo as trained": {"timestep": 4e-3},
    "MuJoCo, elliptic cones": {"timestep": 1e-3, "iterations": 100, "ls_iterations": 50, "cone": 1, "impratio": 100.0},
}
"""Options of MuJoCo that differ from the wheel's model. It has pyramids as friction cones and one iteration a step;
MuJoCo Menagerie has elliptic cones and this ``impratio`` for the same robot."""
CALLS = 200
PUSH = 0.1
"""Duration, s."""


def walked(job: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Measures of a walk.

    Args:
        job: ``walker``, ``plant``, ``friction`` and ``duration``, s; ``commands``, each with the time from which on it
            holds, s, forward, to the left and turning; ``push``, its time, s, and impulse over mass, m/s, or None.
        folder: of the peers' environments.

    Raises:
        WorkerError: the policy does not run.
    """
    spec = described(package_in(folder))
    model = spec.compile()
    for name, value in PLANTS[job["plant"]].items():
        setattr(model.opt, name, value)
    model.geom("floor").friction[0] = job["friction"]
    if job["walker"] == NETWORK:
        with Policy(folder) as network:
            measures, call_us = followed(job, model, network.act, PERIOD), network.call_us()
    else:
        law = Law(robot_of(spec), model, job["friction"], learning=job["walker"] == LEARNING)
        measures, call_us = followed(job, model, law.act, law.period), law.call_us()
    return {**measures, "call_us": call_us}


class Law:
    """The gait and the condensed WBC on a model that takes torques.

    Args:
        robot: the same as MuJoCo's.
        model: ``mujoco.MjModel``; its actuators are changed in place.
        mu: friction coefficient of the ground.
        learning: whether it estimates the friction in the joints.

    Attributes:
        period: of the ticks: MuJoCo's step, s.
    """

    def __init__(self, robot: Robot, model: Any, mu: float, *, learning: bool) -> None:
        torque_driven(model)
        self.robot, self.period, self.gait = robot, float(model.opt.timestep), WalkingGait(robot)
        self._states = MujocoBridge(model, robot)
        how: dict[str, Any] = {"mu": mu, "period": self.period, "estimate_joint_friction": learning}
        self._controller = make_controller("condensed", self.gait, **how)
        driven = {model.joint(joint).name: k for k, joint in enumerate(model.actuator_trnid[:, 0])}
        self._actuators = [driven[name] for name in robot.joints]
        self._recent: deque[State] = deque(maxlen=CALLS)

    def act(self, model: Any, data: Any, command: Vector) -> None:
        """Set the torques in MuJoCo's data.

        Raises:
            ControlError: it has none.
        """
        state = self._states.read(data)
        self._recent.append(state)
        self.gait.command[:3] = command
        data.ctrl[self._actuators] = self._controller.step(state).torque

    def call_us(self) -> float:
        """Thread time of a tick, from the state to the torques: of many in a row, at the last states once more."""
        known, after = list(self._recent), self._recent[-1].t - self._recent[0].t + self.period
        again = [State(s.t + after, s.q, s.v, s.foot_position, s.foot_velocity, s.foot_force) for s in known]
        begin = thread_time_ns()
        for state in again:
            self._controller.step(state)
        return 1e-3 * (thread_time_ns() - begin) / len(again)


def followed(job: dict[str, Any], model: Any, act: Callable[[Any, Any, Vector], None], period: float) -> dict[str, Any]:
    """Measures of a walk from the first keyframe to its end, or to the fall.

    Args:
        job: what is commanded, and the push.
        model: ``mujoco.MjModel``.
        act: sets the actuators from model, data and command.
        period: in which it is called, s.
    """
    mujoco = import_mujoco()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    watch, dt, command = Watch(model, data, FEET), float(model.opt.timestep), np.zeros(3)
    every = round(period / dt)
    for k in range(round(job["duration"] / dt)):
        t = k * dt
        command = np.array([row[1:] for row in ((0.0, 0.0, 0.0, 0.0), *job["commands"]) if row[0] <= t][-1])
        if job["push"] is not None:
            on = job["push"][0] <= t < job["push"][0] + PUSH
            mass = float(model.body_subtreemass[1])
            data.xfrc_applied[1, :2] = mass / PUSH * np.array(job["push"][1:]) if on else 0.0
        if k % every == 0:
            mujoco.mj_forward(model, data)
            try:
                act(model, data, command)
            except ControlError:
                watch.fell = True
                break
        mujoco.mj_step(model, data)
        watch.look(command)
        if watch.fell:
            break
    return watch.measures()
