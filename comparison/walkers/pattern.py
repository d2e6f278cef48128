"""A biped on soles that follows a walk which placo planned: joint PD about inverse kinematics, with feedforward.

placo's walk pattern generator plans footsteps, and a centre of mass whose zero moment point stays inside the soles; its
inverse kinematics makes joint angles of them. Fed forward is the inverse dynamics of these. Nothing is planned anew.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from comparison.peers.environment import interpreter
from comparison.peers.worker import run_worker
from harpy_pin import Command, Robot, State, WalkingGait
from harpy_pin.model.state import Vector

__all__ = ["SETTLE", "Follower", "Pattern", "named_feet", "planned"]

WORKER = Path(__file__).with_name("pattern_worker.py")
SETTLE = 1.0
"""Time in which it goes from its posture to the first one of the plan, s."""
DT = 4e-3
SMOOTH = 5
"""Samples over which accelerations are averaged."""


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Of the walk and of the PD; the best of 26 tries at 0.36 m/s and friction 0.6.

    Attributes:
        single: duration of a step on one foot, s.
        double: time on both, as a share of it.
        stiffness: N·m/rad, for each N·m of the joint's torque limit.
        damping: over stiffness, s.
    """

    single: float = 0.5
    double: float = 0.3
    stiffness: float = 10.0
    damping: float = 0.015


def named_feet(robot: Robot) -> tuple[str, Vector]:
    """A URDF without shapes in which placo finds trunk and feet, and the (2, 3) centres of the soles in its posture.

    Args:
        robot: with two flat feet, the left one first.
    """
    model, data, q = robot.model, robot.model.createData(), pin.neutral(robot.model)
    q[7:] = robot.posture
    pin.framesForwardKinematics(model, data, q)
    root = ET.parse(robot.urdf).getroot()
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    links = {
        joint.get("name"): child.get("link") for joint in root.findall("joint") for child in joint.findall("child")
    }
    base = next(name for link in root.findall("link") if (name := link.get("name")) not in links.values())
    corners = np.split(np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet]), 2)
    places = [corner.mean(axis=0) for corner in corners]
    _fix(root, "trunk", str(base), pin.SE3.Identity())
    for name, place, corner in zip(("left_foot", "right_foot"), places, robot.feet[:: len(corners[0])], strict=True):
        joint = model.frames[robot.frame_id(corner)].parentJoint
        _fix(root, name, str(links[model.names[joint]]), data.oMi[joint].actInv(pin.SE3(np.eye(3), place)))
    return ET.tostring(root, encoding="unicode"), np.array(places)


def _fix(root: ET.Element, name: str, parent: str, place: pin.SE3) -> None:
    """Add a link."""
    ET.SubElement(root, "link", name=name)
    joint = ET.SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=name)
    numbers = {"xyz": place.translation, "rpy": pin.rpy.matrixToRpy(place.rotation)}
    ET.SubElement(joint, "origin", {key: " ".join(map(str, value)) for key, value in numbers.items()})


def planned(robot: Robot, folder: Path, pattern: Pattern, *, speed: float, duration: float) -> dict[str, Vector]:
    """``q``, in this library's order, ``com`` and ``share`` of the load on the left foot, every 4 ms.

    Args:
        robot: with two flat feet.
        folder: of the peers' environments.
        pattern: durations of its steps.
        speed: forward, m/s.
        duration: of the walk, s.

    Raises:
        WorkerError: placo is not installed, or does not plan it.
    """
    text, places = named_feet(robot)
    q, data = pin.neutral(robot.model), robot.model.createData()
    q[7:] = robot.posture
    height = pin.centerOfMass(robot.model, data, q)[2] - places[0, 2]
    pin.framesForwardKinematics(robot.model, data, q)
    sole = np.ptp([data.oMf[robot.frame_id(name)].translation for name in robot.feet[:4]], axis=0)
    legs = {
        k for foot in robot.feet for k in robot.model.supports[robot.model.frames[robot.frame_id(foot)].parentJoint]
    }
    posture = dict(zip(robot.joints, map(float, robot.posture), strict=True))  # type: ignore[arg-type]
    step = pattern.single * (1.0 + pattern.double)
    settings = {
        "posture": posture,
        "upper": {name: posture[name] for name in robot.joints if robot.model.getJointId(name) not in legs},
        "dt": DT,
        "length": speed * step,
        "steps": max(round(duration / step), 2),
        "parameters": {
            "single_support_duration": pattern.single,
            "single_support_timesteps": 10,
            "double_support_ratio": pattern.double,
            "startend_double_support_ratio": 2.0,
            "planned_timesteps": 100,
            "walk_com_height": float(height - 0.01),
            "walk_foot_height": 0.05,
            "walk_foot_rise_ratio": 0.2,
            "walk_trunk_pitch": 0.0,
            "foot_length": float(sole[0]),
            "foot_width": float(sole[1]),
            "feet_spacing": float(places[0, 1] - places[1, 1]),
            "zmp_margin": 0.02,
            "walk_max_dx_forward": 1.0,
        },
    }
    with TemporaryDirectory() as here:
        problem, result, urdf = (Path(here) / name for name in ("problem.npz", "result.npz", "robot.urdf"))
        urdf.write_text(text, encoding="utf-8")
        np.savez(problem, settings=json.dumps({**settings, "urdf": str(urdf)}))
        run_worker(interpreter(folder, "placo"), WORKER, problem, result)
        with np.load(result) as file:
            order = [7 + list(file["joints"]).index(name) for name in robot.joints]
            return {"q": file["q"][:, [*range(7), *order]], "com": file["com"], "share": file["share"]}


class Follower:
    """Joint PD along a plan, with its inverse dynamics.

    Args:
        gait: of the robot; only its posture counts.
        plan: of :func:`planned`.
        pattern: stiffness and damping.
    """

    period = 1e-3

    def __init__(self, gait: WalkingGait, plan: Mapping[str, Vector], pattern: Pattern) -> None:
        self.gait, self.robot, self._q = gait, gait.robot, plan["q"]
        self._limit = self.robot.torque_limit
        self._p = pattern.stiffness * self._limit
        self._d = pattern.damping * self._p
        self._speed, self._torque = _feedforward(self.robot, self._q, plan["share"])
        self._first: Vector | None = None

    def reset(self) -> None:
        """Begin anew from the measured posture."""
        self._first = None

    def describe(self) -> Mapping[str, Any]:
        """For the log's metadata."""
        return {"controller": "placo, joint PD"}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Nothing."""
        return {}

    def step(self, state: State) -> Command:
        """Torques of one tick.

        Args:
            state: as measured.
        """
        if self._first is None:
            self._first = np.array(state.q[7:])
        k = int(np.clip(round((state.t - SETTLE) / DT), 0, len(self._q) - 1))
        blend = min(state.t / SETTLE, 1.0) ** 2 * (3.0 - 2.0 * min(state.t / SETTLE, 1.0))
        target = (1.0 - blend) * self._first + blend * self._q[k, 7:]
        torque = self._torque[k] + self._p * (target - state.q[7:]) + self._d * (self._speed[k] - state.v[6:])
        return Command(np.clip(torque, -self._limit, self._limit), np.zeros((0, 3)))


def _feedforward(robot: Robot, q: Vector, share: Vector) -> tuple[Vector, Vector]:
    """(samples, joints) velocities and torques of the inverse dynamics, with the load on the feet as planned."""
    model, data = robot.model, robot.model.createData()
    ends = [(max(k - 1, 0), min(k + 1, len(q) - 1)) for k in range(len(q))]
    v = np.array([pin.difference(model, q[a], q[b]) / ((b - a) * DT) for a, b in ends])
    v[[0, -1]] = 0.0
    window = np.ones(SMOOTH) / SMOOTH
    padded = np.pad(np.gradient(v, DT, axis=0), ((SMOOTH // 2,) * 2, (0, 0)))
    acceleration = np.apply_along_axis(np.convolve, 0, padded, window, "valid")
    frames, torque = [robot.frame_id(name) for name in robot.feet], np.zeros((len(q), len(robot.joints)))
    half = len(frames) // 2
    for k in range(len(q)):
        needed = pin.rnea(model, data, q[k], v[k], acceleration[k])
        pin.computeJointJacobians(model, data, q[k])
        pin.updateFramePlacements(model, data)
        lever = np.vstack([pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] for f in frames]).T
        load = np.repeat((share[k], 1.0 - share[k]), 3 * half)
        spread = load[:, None] * lever[:6].T
        force = spread @ np.linalg.lstsq(lever[:6] @ spread, needed[:6], rcond=None)[0]
        torque[k] = (needed - lever @ force)[6:]
    return v[:, 6:], torque
