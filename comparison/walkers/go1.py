"""Go1 as the policy was trained on it: MuJoCo's model from the wheel, and a robot of this library with the same masses.

The wheel lacks the meshes. They are only drawn, so the model is compiled without them.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import Robot
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
    return Robot(read, file, FEET, (), np.inf, posture=np.array(model.key_qpos[0, 7:]))


def torque_driven(model: Any) -> None:
    """Make every actuator one that takes a torque, with the limits that it had.

    Args:
        model: ``mujoco.MjModel``, changed in place.
    """
    model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :3] = 1.0, 0.0
    model.actuator_ctrllimited[:] = 0
