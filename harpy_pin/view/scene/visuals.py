"""The visual shapes of a robot's file, on its links."""

import re
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot
from harpy_pin.model.urdf import read_xml

HINT = "meshes are looked for in the folders above the file and those of $ROS_PACKAGE_PATH"
Y_UP = pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3))
"""Placement of a mesh whose y axis points up."""
HEADER = 1 << 14
"""Bytes of a COLLADA file within which it names its axis."""


def load_visuals(robot: Robot) -> list[pin.GeometryObject]:
    """Visual shapes of a robot's URDF, or of its MJCF file: those that MuJoCo's viewer shows.

    Files of meshes are looked for in the folders above the URDF, also by the names of the packages
    that these are. A mesh that cannot be read is left out, with a warning; without any shape there
    are none.
    """
    if robot.urdf is None:
        return []
    root = read_xml(robot.urdf)
    if root.tag == "mujoco":
        from harpy_pin.view.scene.mujoco_visuals import mujoco_visuals

        return mujoco_visuals(robot)
    folders = list(robot.urdf.resolve().parents)
    packages = {name: folder for folder in reversed(folders) if (name := _package_in(folder))}
    for mesh in root.iter("mesh"):
        mesh.set("filename", _file_of(mesh.get("filename", ""), folders[0], packages))
    for geometry in root.iter("geometry"):
        for capsule in geometry.findall("capsule"):  # which Pinocchio's reader does not know
            radius, length = (float(capsule.get(name, "0")) for name in ("radius", "length"))
            geometry.remove(capsule)
            ElementTree.SubElement(
                geometry, "cylinder", radius=str(radius), length=str(length + 2.0 * radius)
            )
    try:
        shapes = _urdf_shapes(robot.model, root, folders)
    except (ValueError, RuntimeError):
        missing = _drop_unreadable(root, folders)
        shapes = _urdf_shapes(robot.model, root, folders)
        names = f"'{missing[0]}'{f' and {len(missing) - 1} more' if len(missing) > 1 else ''}"
        instead = "" if shapes else "; drawing a skeleton"
        warnings.warn(
            f"'{robot.urdf}' without meshes that cannot be read: {names}{instead}; {HINT}",
            stacklevel=2,
        )
    _stand_up(robot.model, shapes)
    return shapes


def _urdf_shapes(
    model: pin.Model, root: ElementTree.Element, folders: Sequence[Path]
) -> list[pin.GeometryObject]:
    """Visual shapes of a URDF; Pinocchio's error where a mesh cannot be read."""
    text, where = (
        ElementTree.tostring(root, encoding="unicode"),
        [str(folder) for folder in folders],
    )
    return list(
        pin.buildGeomFromUrdfString(
            model, text, pin.GeometryType.VISUAL, package_dirs=where
        ).geometryObjects
    )


def _drop_unreadable(root: ElementTree.Element, folders: Sequence[Path]) -> list[str]:
    """Remove the visuals whose meshes cannot be read; returns the names of their files."""
    missing: list[str] = []
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            alone = ElementTree.Element("robot", name="alone")
            ElementTree.SubElement(alone, "link", name="link").append(visual)
            try:
                _urdf_shapes(
                    pin.buildModelFromXML(ElementTree.tostring(alone, encoding="unicode")),
                    alone,
                    folders,
                )
            except (ValueError, RuntimeError):
                link.remove(visual)
                missing += [mesh.get("filename", "") for mesh in visual.iter("mesh")]
    return list(dict.fromkeys(missing))


def _package_in(folder: Path) -> str | None:
    """Name of the ROS package in a folder; None where there is none."""
    file = folder / "package.xml"
    found = (
        re.search(r"<name>\s*(.*?)\s*</name>", file.read_text(errors="replace"))
        if file.is_file()
        else None
    )
    return found[1] if found else None


def _file_of(name: str, folder: Path, packages: Mapping[str, Path]) -> str:
    """Path of a mesh file; its name in the URDF, which Pinocchio looks for, where it is not
    there.
    """
    package, _, rest = name.removeprefix("package://").partition("/")
    if name.startswith("package://"):
        found = packages.get(package, folder / "nowhere") / rest
    else:
        found = folder / name.removeprefix("file://")
    return str(found) if found.is_file() else name


def _stand_up(model: pin.Model, shapes: list[pin.GeometryObject]) -> None:
    """Turn the meshes of COLLADA files whose y axis points up, if the links' centres of mass lie
    nearer to them then.

    Some URDFs are written for readers that turn such files (Gazebo), some for those that do not
    (RViz, Pinocchio); none says for which.
    """
    files = [shape for shape in shapes if _has_y_up(shape.meshPath)]
    apart = np.zeros(2)
    for shape in files:
        centre = shape.placement.actInv(model.inertias[shape.parentJoint].lever)
        corners = np.asarray(shape.geometry.vertices())
        for k, turned in enumerate((corners, corners @ Y_UP.rotation.T)):
            apart[k] += np.linalg.norm(
                np.clip(centre, turned.min(axis=0), turned.max(axis=0)) - centre
            )
    if apart[1] < apart[0]:
        for shape in files:
            shape.placement = shape.placement * Y_UP


def _has_y_up(path: str) -> bool:
    """Whether a mesh file says that its y axis points up."""
    return Path(path).suffix.lower() == ".dae" and b"Y_UP" in Path(path).read_bytes()[:HEADER]
