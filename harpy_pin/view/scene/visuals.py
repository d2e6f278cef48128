"""The robot's visuals: one node per joint of the model, each with the shapes of its links.

A ``node`` is a Meshcat visualizer at the path of what is drawn, in world axes; what moves is added to ``animation``.
"""

from __future__ import annotations

import warnings
from typing import Any

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin
from meshcat import geometry as g
from meshcat.animation import Animation

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.arrows import Y_TO_Z
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.meshes import mesh_parts
from harpy_pin.view.scene.motion import from_matrices, turn_z_to

__all__ = ["draw_robot", "load_visuals", "node_name"]

_GREY = (0.4, 0.42, 0.46, 1.0)


def draw_robot(node: Any, animation: Animation, robot: Robot, frames: Frames) -> None:
    """Add a robot to a scene and its animation.

    A robot whose URDF has no visuals, or whose mesh files are missing, is drawn as a skeleton of rods between joints.
    """
    shapes = load_visuals(robot)
    if shapes:
        for number, shape in enumerate(shapes):
            place = node[node_name(robot.model.names[shape.parentJoint])][f"{number}_{node_name(shape.name)}"]
            _draw_shape(place, shape)
    else:
        _draw_skeleton(node, robot, frames)
    for j, name in enumerate(robot.model.names):
        from_matrices(frames.joints[:, j]).apply(node[node_name(name)], animation, frames.time)


def load_visuals(robot: Robot) -> list[pin.GeometryObject]:
    """Visual shapes of a robot's URDF; mesh files are looked for in the folders above it.

    Returns:
        The shapes; none, with a warning, where a mesh file cannot be read.
    """
    folders = [str(folder) for folder in robot.urdf.resolve().parents]
    try:
        shapes = pin.buildGeomFromUrdf(robot.model, str(robot.urdf), pin.GeometryType.VISUAL, package_dirs=folders)
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else "unreadable mesh"
        warnings.warn(f"visuals of '{robot.urdf}' not drawn ({reason}); drawing a skeleton", stacklevel=2)
        return []
    return list(shapes.geometryObjects)


def node_name(name: str) -> str:
    """A name without the characters that mean something in a path of the scene."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name) or "unnamed"


def _draw_shape(node: Any, shape: pin.GeometryObject) -> None:
    """One shape in its joint's frame, in the URDF's colour or those of its mesh file."""
    if isinstance(shape.geometry, coal.BVHModelBase):
        parts = mesh_parts(shape)
        for number, part in enumerate(parts):
            corners = part.vertices[part.faces].reshape(-1, 3).astype(np.float32)
            # Unshared corners give flat shading: sharp edges of machined parts stay sharp.
            triangles = g.TriangularMeshGeometry(corners, np.arange(len(corners)).reshape(-1, 3))
            place = node if len(parts) == 1 else node[str(number)]
            place.set_object(triangles, _material(part.colour))
        node.set_transform(shape.placement.homogeneous)
        return
    geometry, turn = _to_meshcat(shape.geometry)
    if geometry is None:
        warnings.warn(f"shape '{shape.name}' ({type(shape.geometry).__name__}) cannot be drawn", stacklevel=2)
        return
    node.set_object(geometry, _material(shape.meshColor))
    node.set_transform(shape.placement.homogeneous @ turn)


def _to_meshcat(shape: coal.CollisionGeometry) -> tuple[Any, Vector]:
    """Meshcat geometry of a shape that is no mesh, and the (4, 4) placement in the shape's frame; None if unknown."""
    eye = np.eye(4)
    if isinstance(shape, coal.Box):
        return g.Box([float(2.0 * side) for side in shape.halfSide]), eye
    if isinstance(shape, coal.Sphere):
        return g.Sphere(float(shape.radius)), eye
    if isinstance(shape, coal.Ellipsoid):
        return g.Sphere(1.0), np.diag([*shape.radii, 1.0])
    if isinstance(shape, coal.Cylinder):
        return g.Cylinder(float(2.0 * shape.halfLength), float(shape.radius)), Y_TO_Z
    if isinstance(shape, coal.Capsule):
        # Meshcat has no capsule: a cylinder of the same overall length.
        return g.Cylinder(float(2.0 * (shape.halfLength + shape.radius)), float(shape.radius)), Y_TO_Z
    if isinstance(shape, coal.Cone):
        return g.Cylinder(float(2.0 * shape.halfLength), radiusTop=0.0, radiusBottom=float(shape.radius)), Y_TO_Z
    return None, eye


def _material(rgba: Vector | tuple[float, ...]) -> Any:
    red, green, blue, alpha = (float(np.clip(c, 0.0, 1.0)) for c in rgba)
    colour = sum(round(255 * c) << shift for c, shift in ((red, 16), (green, 8), (blue, 0)))
    return g.MeshPhongMaterial(color=colour, opacity=alpha, shininess=45, specular=0x333333)


def _draw_skeleton(node: Any, robot: Robot, frames: Frames) -> None:
    """Rods from each joint to its child joints and feet, and a ball at each joint."""
    model = robot.model
    radius = 0.02 * max(float(np.abs(frames.q[0, 2])), 0.1)
    ends = [(model.parents[j], model.jointPlacements[j].translation) for j in range(2, model.njoints)]
    ends += [
        (model.frames[i].parentJoint, model.frames[i].placement.translation) for i in map(robot.frame_id, robot.feet)
    ]
    for number, (joint, end) in enumerate(ends):
        place = node[node_name(model.names[joint])]
        place[f"ball_{number}"].set_object(g.Sphere(1.5 * radius), _material(_GREY))
        length = float(np.linalg.norm(end))
        if length < 1e-6:
            continue
        rod = place[f"rod_{number}"]
        rod["shape"].set_object(g.Cylinder(length, radius), _material(_GREY))
        lift = np.eye(4)
        lift[2, 3] = 0.5 * length
        rod["shape"].set_transform(lift @ Y_TO_Z)
        rod.set_property("quaternion", turn_z_to((end / length)[None])[0].tolist())
