"""The robot's visuals in viser: one frame per joint of the model, each with the shapes of its links."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin
import viser

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import as_rgb
from harpy_pin.view.scene.meshes import mesh_parts
from harpy_pin.view.scene.pantograph import CARBON, ROD, Pantograph, find_pantograph
from harpy_pin.view.scene.visuals import load_visuals, node_name

__all__ = ["RobotShapes", "quaternion"]


class RobotShapes:
    """The robot as it looks.

    Args:
        scene: of viser.
        robot: who is drawn.

    Attributes:
        handles: of all shapes.
    """

    def __init__(self, scene: viser.SceneApi, robot: Robot) -> None:
        self.robot, self.handles = robot, list[Any]()
        self._scene = scene
        self._data = robot.model.createData()
        self._thrusters = [robot.frame_id(name) for name in robot.thrusters]
        self._joints = [scene.add_frame(f"/robot/{node_name(name)}", show_axes=False) for name in robot.model.names]
        for number, shape in enumerate(load_visuals(robot)):
            parent = node_name(robot.model.names[shape.parentJoint])
            self._add(f"/robot/{parent}/{number}", shape)
        self._legs = [leg for leg in (find_pantograph(robot, foot) for foot in robot.feet) if leg is not None]
        self._links = [self._add_leg(leg) for leg in self._legs]

    def place(self, q: Vector, origin: Vector) -> Vector:
        """Move everything.

        Args:
            q: (nq,) configuration.
            origin: (3,) place in the world that is the scene's origin, m.

        Returns:
            (thrusters, 3) mounts, in the scene, m.
        """
        model, data = self.robot.model, self._data
        pin.framesForwardKinematics(model, data, q)
        joints = np.stack([data.oMi[j].homogeneous for j in range(model.njoints)])
        joints[:, :3, 3] -= origin
        for frame, placement in zip(self._joints, joints, strict=True):
            _put(frame, placement)
        for leg, links in zip(self._legs, self._links, strict=True):
            _place_leg(leg, links, joints)
        return np.reshape([data.oMf[frame].translation - origin for frame in self._thrusters], (-1, 3))

    def _add(self, name: str, shape: pin.GeometryObject) -> None:
        """One shape in its joint's frame, in the URDF's colour or those of its mesh file."""
        geometry, scene, colour = shape.geometry, self._scene, _bytes(shape.meshColor)
        place: dict[str, Any] = {
            "wxyz": quaternion(shape.placement.rotation),
            "position": tuple(shape.placement.translation),
        }
        handle: Any
        if isinstance(geometry, coal.Box):
            side = 2.0 * np.asarray(geometry.halfSide)
            handle = scene.add_box(name, color=colour, dimensions=side, **place)
        elif isinstance(geometry, coal.Sphere):
            handle = scene.add_icosphere(name, radius=float(geometry.radius), color=colour, **place)
        elif isinstance(geometry, coal.Cylinder | coal.Capsule):
            extra = geometry.radius if isinstance(geometry, coal.Capsule) else 0.0
            height = float(2.0 * (geometry.halfLength + extra))
            handle = scene.add_cylinder(name, float(geometry.radius), height, colour, **place)
        elif isinstance(geometry, coal.BVHModelBase):
            scene.add_frame(name, show_axes=False, **place)
            for number, part in enumerate(mesh_parts(shape)):
                handle = scene.add_mesh_simple(
                    f"{name}/{number}", part.vertices, part.faces, color=_bytes(part.colour), flat_shading=True
                )
                self.handles.append(handle)
            return
        else:
            return
        self.handles.append(handle)

    def _add_leg(self, leg: Pantograph) -> dict[str, Any]:
        """Shin, tarsus and the pins where they turn."""
        scene, root = self._scene, f"/robot/lower_leg/{node_name(leg.foot)}"
        links: dict[str, Any] = {}
        for name, length, width in (("shin", leg.shin, 0.022), ("tarsus", leg.tarsus, 0.018)):
            links[name] = scene.add_frame(f"{root}/{name}", show_axes=False)
            bar = scene.add_box(
                f"{root}/{name}/bar",
                color=as_rgb(CARBON),
                dimensions=(width, 0.014, length),
                position=(0.0, 0.0, -0.5 * length),
            )
            self.handles.append(bar)
        for name in ("ankle", "knee"):
            links[name] = scene.add_frame(f"{root}/{name}", show_axes=False)
            across = quaternion(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
            scene.add_cylinder(f"{root}/{name}/pin", 0.008, 0.05, as_rgb(ROD), wxyz=across)
        return links


def _place_leg(leg: Pantograph, links: dict[str, Any], joints: Vector) -> None:
    """The lower leg follows the joints of the equivalent chain."""
    one = joints[None]
    motor, ankle = leg.motor(one)[0], leg.ankle(one)[0]
    shank, thigh = joints[leg.shank_joint], joints[leg.thigh_joint]
    for name, joint, point in (
        ("shin", shank, motor),
        ("tarsus", thigh, ankle),
        ("ankle", thigh, ankle),
        ("knee", shank, shank[:3, 3]),
    ):
        placement = joint.copy()
        placement[:3, 3] = point
        _put(links[name], placement)


def _put(handle: Any, placement: Vector) -> None:
    handle.wxyz = quaternion(placement[:3, :3])
    handle.position = placement[:3, 3]


def quaternion(rotation: Vector) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a rotation matrix."""
    x, y, z, w = pin.Quaternion(np.ascontiguousarray(rotation)).coeffs()
    return float(w), float(x), float(y), float(z)


def _bytes(colour: Iterable[float]) -> tuple[int, int, int]:
    """A colour whose parts are between 0 and 1."""
    red, green, blue = (round(255 * float(np.clip(c, 0.0, 1.0))) for c in tuple(colour)[:3])
    return red, green, blue
