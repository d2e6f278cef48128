"""Nodes and motions as Meshcat's viewer takes them: commands of MessagePack, and keyframes as
32-bit numbers.
"""

import base64
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from harpy_pin.errors import HarpyError, install_line
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import as_int
from harpy_pin.view.scene.nodes import Box, Cylinder, Lines, Look, Motions, Node, Sphere

try:
    import umsgpack
    from meshcat import geometry as g
except ImportError as error:
    raise HarpyError(
        f"replays and viewers need Meshcat ({error}): {install_line('view')}"
    ) from error

ROOT = "/meshcat/walk"
"""Path of the node that stands for the world's frame."""
FIELD_OF_VIEW = 32.0
"""Vertical field of view of the camera, degrees."""
LIGHTS = (
    ("/Grid", "visible", False),
    ("/Axes", "visible", False),
    ("/Background", "top_color", [0.80, 0.87, 0.95]),
    ("/Background", "bottom_color", [0.97, 0.98, 0.99]),
    ("/Lights/AmbientLight/<object>", "intensity", 0.62),
    ("/Lights/FillLight/<object>", "intensity", 0.18),
    ("/Lights/PointLightNegativeX", "visible", False),
    ("/Lights/PointLightPositiveX", "visible", False),
    ("/Lights/SpotLight", "visible", True),
    ("/Lights/SpotLight/<object>", "position", [1.2, -2.2, 5.0]),
    ("/Lights/SpotLight/<object>", "intensity", 0.55),
    ("/Lights/SpotLight/<object>", "angle", 0.5),
    ("/Lights/SpotLight/<object>", "penumbra", 1.0),
    ("/Lights/SpotLight/<object>", "castShadow", True),
)
"""Bright background, soft light all round, and one lamp that casts the robot's shadow."""
Y_TO_Z = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Turns the axis of Meshcat's cylinders, y, to z."""
IDENTITY = (0.0, 0.0, 0.0, 1.0)
"""Quaternion of a node that does not turn."""
KINDS = {
    "position": "vector3",
    "quaternion": "quaternion",
    "scale": "vector3",
    "visible": "boolean",
}


def stage_commands(size: float) -> list[dict[str, Any]]:
    """Light, background, and a view from the robot's right front in which a height, m, fits."""
    distance = 0.5 * size / np.tan(0.5 * np.radians(FIELD_OF_VIEW))
    x, y, z = distance * np.array([0.62, -0.74, 0.26]) / np.linalg.norm([0.62, -0.74, 0.26])
    camera = "/Cameras/default/rotated/<object>"
    commands = [_property(*light) for light in LIGHTS]
    # Meshcat's camera has its own axes: y up, z towards the world's −y.
    eye = [float(x), float(z), float(-y)]
    return [*commands, _property(camera, "fov", FIELD_OF_VIEW), _property(camera, "position", eye)]


def node_commands(nodes: Iterable[Node], motions: Motions) -> list[dict[str, Any]]:
    """Commands that draw nodes, at the first moment of their motions."""
    commands = []
    for node in nodes:
        path = f"{ROOT}/{node.path}"
        commands.append({"type": "set_object", "path": path, "object": _object(node).lower()})
        placement = node.placement @ Y_TO_Z if isinstance(node.shape, Cylinder) else node.placement
        if not np.array_equal(placement, np.eye(4)):
            commands.append(
                {"type": "set_transform", "path": path, "matrix": placement.T.ravel().tolist()}
            )
        if node.look.light != "body":
            commands.append(_property(f"{path}/<object>", "castShadow", False))
        if node.look.in_front:
            commands.append(_property(f"{path}/<object>", "renderOrder", node.look.in_front))
    for path, name, values in _tracks(motions):
        commands.append(_property(path, name, values[0].tolist()))
    return commands


def move_commands(motions: Motions) -> list[dict[str, Any]]:
    """Commands that put nodes where they are at the first moment of their motions: one of each type
    for a node.
    """
    placed = {
        path: m for path, m in motions.items() if m.position is not None or m.scale is not None
    }
    turns = [m.quaternion[0] if m.quaternion is not None else IDENTITY for m in placed.values()]
    rotations = Rotation.from_quat(np.reshape(turns, (-1, 4))).as_matrix()
    commands: list[dict[str, Any]] = []
    for (path, motion), rotation in zip(placed.items(), rotations, strict=True):
        matrix = np.eye(4)
        matrix[:3, :3] = rotation if motion.scale is None else rotation * motion.scale[0]
        matrix[:3, 3] = 0.0 if motion.position is None else motion.position[0]
        commands.append(
            {"type": "set_transform", "path": _full(path), "matrix": matrix.T.ravel().tolist()}
        )
    for path, motion in motions.items():
        if motion.visible is not None:
            commands.append(_property(_full(path), "visible", bool(motion.visible[0])))
    return commands


def keyframes(motions: Motions) -> list[dict[str, Any]]:
    """Tracks of motions.

    Returns:
        For each its path, property, kind, and (n, …) values as base64 of little-endian 32-bit
        floats; one that never changes is ``still`` and has its first row alone.
    """
    tracks = []
    for path, name, values in _tracks(motions):
        numbers = np.ascontiguousarray(values, dtype="<f4")
        still = bool(np.all(numbers == numbers[0]))
        data = base64.b64encode((numbers[:1] if still else numbers).tobytes()).decode("ascii")
        tracks.append(
            {"path": path, "name": name, "kind": KINDS[name], "still": still, "values": data}
        )
    return tracks


def encoded(commands: Iterable[dict[str, Any]]) -> list[str]:
    """Commands as base64 text of MessagePack, the form the viewer reads."""
    return [base64.b64encode(umsgpack.packb(command)).decode("ascii") for command in commands]


def _tracks(motions: Motions) -> Iterable[tuple[str, str, Vector]]:
    for path, motion in motions.items():
        for name in KINDS:
            values = getattr(motion, name)
            if values is not None:
                yield _full(path), name, values


def _full(path: str) -> str:
    return f"{ROOT}/{path}" if path else ROOT


def _property(path: str, name: str, value: Any) -> dict[str, Any]:
    return {"type": "set_property", "path": path, "property": name, "value": value}


def _object(node: Node) -> Any:
    """Shape and material in Meshcat's form."""
    shape, look = node.shape, node.look
    if isinstance(shape, Lines):
        points = g.PointsGeometry(shape.points.reshape(-1, 3).T.astype(np.float32))
        return g.LineSegments(
            points, g.LineBasicMaterial(color=as_int(look.colour), opacity=look.opacity)
        )
    if isinstance(shape, Box):
        geometry: Any = g.Box(list(shape.size))
    elif isinstance(shape, Sphere):
        geometry = g.Sphere(shape.radius)
    elif isinstance(shape, Cylinder):
        geometry = g.Cylinder(shape.length, shape.radius)
    elif look.light == "body":  # unshared corners: machined edges stay sharp
        corners = shape.vertices[shape.faces].reshape(-1, 3)
        geometry = g.TriangularMeshGeometry(corners, np.arange(len(corners)).reshape(-1, 3))
    else:
        geometry = g.TriangularMeshGeometry(shape.vertices, shape.faces)
    return g.Mesh(geometry, _material(look))


def _material(look: Look) -> Any:
    given: dict[str, Any] = {"color": as_int(look.colour), "opacity": look.opacity}
    if look.in_front:
        given |= {"transparent": True, "depthTest": False}
    if look.light == "body":
        return g.MeshPhongMaterial(shininess=45, specular=0x333333, **given)
    if look.light == "ground":
        return g.MeshLambertMaterial(**given)
    if look.light == "bright":
        return g.MeshLambertMaterial(
            emissive=given["color"], emissiveIntensity=0.4, side=0, **given
        )
    if look.opacity < 1.0 and look.light != "shadow":
        given["depthWrite"] = False
    material = g.MeshBasicMaterial(**given)
    if look.light == "shadow":
        material._type = "ShadowMaterial"
    return material
