"""The geoms of a robot's MJCF file that MuJoCo's viewer shows, as shapes on its links."""

from typing import Any

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin

from harpy_pin.model.mjcf import compile_mjcf
from harpy_pin.model.mjcf_loops import body_name, import_mujoco
from harpy_pin.model.robot import Robot

SHOWN_GROUPS = 2
"""Last group of geoms that MuJoCo's viewer shows from the start: collision shapes are in later
ones.
"""


def mujoco_visuals(robot: Robot) -> list[pin.GeometryObject]:
    """The shapes of a robot whose file is MJCF."""
    assert robot.urdf is not None
    model, shapes = compile_mjcf(robot.urdf), []
    for number in np.flatnonzero(model.geom_group <= SHOWN_GROUPS).tolist():
        link = body_name(model, int(model.geom_bodyid[number]))
        geometry = _geometry(model, number)
        if geometry is None or not robot.model.existFrame(link, pin.FrameType.BODY):
            continue
        index = robot.model.getFrameId(link, pin.FrameType.BODY)
        frame = robot.model.frames[index]
        place = frame.placement * pin.XYZQUATToSE3(
            np.concatenate((model.geom_pos[number], np.roll(model.geom_quat[number], -1)))
        )
        shape = pin.GeometryObject(f"{link}_{number}", frame.parentJoint, index, place, geometry)
        material = int(model.geom_matid[number])
        shape.meshColor = np.array(
            model.geom_rgba[number] if material < 0 else model.mat_rgba[material], float
        )
        shape.overrideMaterial = True
        shapes.append(shape)
    return shapes


def _geometry(model: Any, number: int) -> coal.CollisionGeometry | None:
    """The shape of a geom in its frame; None of a plane and others that no robot has."""
    kind = import_mujoco().mjtGeom(model.geom_type[number]).name
    a, b, c = (float(size) for size in model.geom_size[number])
    mesh = int(model.geom_dataid[number])
    if kind == "mjGEOM_MESH":
        first, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        drawn = coal.BVHModelOBBRSS()
        drawn.beginModel(int(model.mesh_facenum[mesh]), int(model.mesh_vertnum[mesh]))
        drawn.addVertices(model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float))
        drawn.addTriangles(
            model.mesh_face[faces : faces + model.mesh_facenum[mesh]].astype(np.uint64)
        )
        drawn.endModel()
        return drawn
    made = {
        "mjGEOM_SPHERE": lambda: coal.Sphere(a),
        "mjGEOM_CAPSULE": lambda: coal.Capsule(a, 2.0 * b),
        "mjGEOM_CYLINDER": lambda: coal.Cylinder(a, 2.0 * b),
        "mjGEOM_BOX": lambda: coal.Box(2.0 * a, 2.0 * b, 2.0 * c),
        "mjGEOM_ELLIPSOID": lambda: coal.Ellipsoid(a, b, c),
    }
    return made[kind]() if kind in made else None
