"""A run for Foxglove: an MCAP with the robot's frames, forces in their friction cones, and its
sensors.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, install_line
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot

FPS = 60.0
"""Frames and forces in a second, at most."""
HEIGHT, WIDTH = 0.12, 0.01
"""Height of a friction cone and diameter of an arrow, m."""
LENGTH = 0.5
"""Arrow of a force of the robot's weight, m."""
WORLD = "world"


@checked
def write_mcap(run: Run, path: str | Path, robot: Robot) -> None:
    """Write an MCAP that Foxglove opens: frames, forces in their friction cones, URDF, joints and
    sensors.

    :func:`~harpy_pin.contrib.bag.read_log` reads it back. Cones are drawn on level ground.

    Args:
        run: to write.
        path: of the file; one of that name is replaced.
        robot: whose run it is.

    Raises:
        InputError: the extra ``mcap`` is not installed.
    """
    try:
        import foxglove
        from foxglove import channels
        from foxglove import messages as m
    except ImportError as error:
        raise InputError(
            f"foxglove cannot be imported ({error}): {install_line('mcap')}", name="mcap"
        ) from error
    model, context = robot.model, foxglove.Context()
    data, t = model.createData(), run["t"]
    links = [(k, frame.name) for k, frame in enumerate(model.frames) if frame.type == pin.BODY]
    ground = run.metadata.get("ground", {})
    mu = 0.0 if ground.get("slope") or ground.get("terrain") else float(ground.get("mu_s", 0.0))
    file = str(robot.source.get("file", ""))
    shown = np.searchsorted(t, np.arange(t[0], t[-1] + 0.5 / FPS, 1.0 / FPS)).clip(max=len(t) - 1)

    def channel(topic: str, kind: str) -> Any:
        return foxglove.Channel(topic, schema={"type": "object", "title": kind}, context=context)

    def point(k: int, foot: int) -> Any:
        return m.Vector3(**dict(zip("xyz", run["foot_position"][k, foot].tolist(), strict=True)))

    def turned(axis: Any, to: Any) -> Any:
        turn = pin.Quaternion.FromTwoVectors(np.array(axis), np.array(to))
        return m.Quaternion(x=turn.x, y=turn.y, z=turn.z, w=turn.w)

    def scene(k: int) -> Any:
        entities = []
        for foot, name in enumerate(robot.feet):
            force = run["foot_force"][k, foot]
            size, place = float(np.linalg.norm(force)), point(k, foot)
            arrows, cones = [], []
            if size > 0.01 * robot.mass:
                pose = m.Pose(position=place, orientation=turned([1.0, 0.0, 0.0], force))
                shaft = LENGTH * size / (9.81 * robot.mass)
                red = m.Color(r=0.85, g=0.2, b=0.1, a=1.0)
                arrows = [
                    m.ArrowPrimitive(
                        pose=pose,
                        shaft_length=shaft,
                        shaft_diameter=WIDTH,
                        head_length=3.0 * WIDTH,
                        head_diameter=2.0 * WIDTH,
                        color=red,
                    )
                ]
                if mu > 0.0:
                    x, y, z = run["foot_position"][k, foot].tolist()
                    middle = m.Pose(
                        position=m.Vector3(x=x, y=y, z=z + 0.5 * HEIGHT),
                        orientation=m.Quaternion(w=1.0),
                    )
                    wide = 2.0 * mu * HEIGHT
                    blue = m.Color(r=0.2, g=0.4, b=0.9, a=0.3)
                    box = m.Vector3(x=wide, y=wide, z=HEIGHT)
                    cones = [
                        m.CylinderPrimitive(
                            pose=middle, size=box, bottom_scale=0.0, top_scale=1.0, color=blue
                        )
                    ]
            entities.append(m.SceneEntity(frame_id=WORLD, id=name, arrows=arrows, cylinders=cones))
        return m.SceneUpdate(entities=entities)

    def frames(k: int) -> Any:
        pin.framesForwardKinematics(model, data, robot.closed(run["q"][k]))
        found = []
        for number, name in links:
            x, y, z, *turn = pin.SE3ToXYZQUAT(data.oMf[number]).tolist()
            place, rotation = (
                m.Vector3(x=x, y=y, z=z),
                m.Quaternion(**dict(zip("xyzw", turn, strict=True))),
            )
            found.append(
                m.FrameTransform(
                    parent_frame_id=WORLD, child_frame_id=name, translation=place, rotation=rotation
                )
            )
        return m.FrameTransforms(transforms=found)

    def xyz(vector: Any) -> dict[str, float]:
        return dict(zip("xyzw", vector.tolist(), strict=False))

    target = checks.path("path", path)
    with foxglove.open_mcap(target, allow_overwrite=True, context=context):
        times = [round(1e9 * float(time)) for time in t]
        if file.endswith(".urdf"):
            text = {"data": Path(file).read_text(encoding="utf-8")}
            channel("/robot_description", "std_msgs/String").log(text, log_time=times[0])
        moving = channels.FrameTransformsChannel("/tf", context=context)
        forces = channels.SceneUpdateChannel("/forces", context=context)
        for k in shown.tolist():
            moving.log(frames(k), log_time=times[k])
            forces.log(scene(k), log_time=times[k])
        joints, truth = (
            channel("/joint_states", "sensor_msgs/JointState"),
            channel("/odom", "nav_msgs/Odometry"),
        )
        unit = channel("/imu", "sensor_msgs/Imu")
        places = [joint.idx_q for joint in list(model.joints)[2:]]
        for k, time in enumerate(times):
            q, v = run["q"][k], run["v"][k]
            legs = {
                "position": q[places].tolist(),
                "velocity": v[6:].tolist(),
                "effort": run["torque"][k].tolist(),
            }
            joints.log({"name": list(robot.joints), **legs}, log_time=time)
            pose = {"pose": {"position": xyz(q[:3]), "orientation": xyz(q[3:7])}}
            twist = {"twist": {"linear": xyz(v[:3]), "angular": xyz(v[3:6])}}
            truth.log({"child_frame_id": robot.name, "pose": pose, "twist": twist}, log_time=time)
            if "gyroscope" in run and "accelerometer" in run:
                felt = {"angular_velocity": xyz(run["gyroscope"][k])}
                unit.log(
                    {**felt, "linear_acceleration": xyz(run["accelerometer"][k])}, log_time=time
                )
