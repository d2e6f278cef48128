"""A robot as a Drake ``MultibodyPlant``: bodies, joints, inertias, armatures and dampings of its Pinocchio model."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from types import ModuleType
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, UNBOUNDED, tree_record
from harpy_pin.simulation.ground import Ground

__all__ = ["DrakeModel", "drake_version"]

MIN_MASS, MIN_INERTIA = 1e-9, 1e-9
"""Of a body, kg and kg·m²: without any, Drake's mass matrix has no inverse."""
RIGID = 1e12
"""Stiffness of a foot's sphere, N/m. The contact then is where Drake makes the surfaces meet: at the lowest point."""


def drake_version() -> str:
    """Version of Drake, which is installed."""
    return version("drake")


def import_drake(module: str) -> ModuleType:
    """A module of ``pydrake``.

    Raises:
        InputError: Drake is not installed.
    """
    try:
        return import_module(f"pydrake.{module}")
    except ImportError as error:
        message = f"Drake cannot be imported ({error}): pip install 'harpy-pin[drake]'"
        raise InputError(message, name="plant", value="drake") from error


class DrakeModel:
    """A robot above the plane z = 0, which only its feet touch, and its state in Drake. It has no other geometry.

    A foot is a sphere about the foot's point, and the plane lies lower by its radius. Joints have no limits.

    Args:
        robot: any that :func:`harpy_pin.model.robot.load_robot` takes.
        ground: stiffness, damping and static friction.
        approximation: Drake's own name of its discrete contact model.
        dissipation: of the law of Hunt and Crossley, s/m.
        dt: step, s.
        gravity: (3,) m/s².
        foot_radius: of the spheres, m.

    Raises:
        InputError: Drake is not installed.
        RobotError: Drake refuses the robot.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        *,
        ground: Ground,
        approximation: str,
        dissipation: float,
        dt: float,
        gravity: Vector,
        foot_radius: float,
    ) -> None:
        plants, framework = import_drake("multibody.plant"), import_drake("systems.framework")
        analysis = import_drake("systems.analysis")
        builder = framework.DiagramBuilder()
        self._config = plants.MultibodyPlantConfig(
            time_step=dt, contact_model="point", discrete_contact_approximation=approximation
        )
        self.plant, self.scene = plants.AddMultibodyPlant(self._config, builder)
        self.plant.mutable_gravity_field().set_gravity_vector(checks.vector("gravity", gravity, 3))
        try:
            self._add_bodies(robot)
            self._add_contacts(robot, ground, dissipation, foot_radius)
            self.plant.Finalize()
        except RuntimeError as error:
            reason = " ".join(str(error).split())[:300]
            raise RobotError(f"Drake refuses '{robot.name}': {reason}", path=robot.urdf) from error
        with _quietly():
            self.simulator = analysis.Simulator(builder.Build())
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self._forces = self.plant.get_applied_generalized_force_input_port()
        self._output = self.plant.get_contact_results_output_port()
        joints = [self.plant.GetJointByName(f"joint:{name}") for name in robot.joints]
        self._position = [joint.position_start() for joint in joints]
        self._velocity = [joint.velocity_start() for joint in joints]
        self._base = [self._bodies[0].floating_positions_start(), self._bodies[0].floating_velocities_start_in_v()]
        self._generalised = np.zeros(self.plant.num_velocities())
        self._feet = {int(foot.index()): k for k, foot in enumerate(self._foot_bodies)}

    def _add_bodies(self, robot: Robot) -> None:
        trees, mathematics = import_drake("multibody.tree"), import_drake("math")
        model, t = robot.model, tree_record(robot.model)[0]
        self._place, self._column, self._unbounded = t["place"][1:], t["column"][1:], t["kind"][1:] == UNBOUNDED
        self._bodies: list[Any] = []
        for i, name in enumerate(list(model.names)[1:]):
            mass, centre = max(float(t["mass"][i]), MIN_MASS), np.array(t["centre"][i])
            inertia = _body_inertia(np.array(t["inertia"][i]))
            own = trees.RotationalInertia(*inertia[[0, 1, 2], [0, 1, 2]], *inertia[[0, 0, 1], [1, 2, 2]])
            spatial = trees.SpatialInertia.MakeFromCentralInertia(mass, centre, own)
            body = self.plant.AddRigidBody(f"body:{name}", spatial)
            self._bodies.append(body)
            if i == 0:
                continue
            parent = self._bodies[t["parent"][i]]
            place = mathematics.RigidTransform(
                mathematics.RotationMatrix(np.array(t["placement"][i])), np.array(t["origin"][i])
            )
            frame = self.plant.AddFrame(trees.FixedOffsetFrame(f"frame:{name}", parent.body_frame(), place))
            kind = trees.PrismaticJoint if t["kind"][i] == SLIDING else trees.RevoluteJoint
            damping = float(model.damping[t["column"][i]])
            axis = np.array(t["axis"][i])
            joint = self.plant.AddJoint(kind(f"joint:{name}", frame, body.body_frame(), axis, damping=damping))
            rotor = self.plant.AddJointActuator(f"motor:{name}", joint)
            rotor.set_default_gear_ratio(1.0)
            rotor.set_default_rotor_inertia(float(model.armature[t["column"][i]]))

    def _add_contacts(self, robot: Robot, ground: Ground, dissipation: float, radius: float) -> None:
        geometry, mathematics = import_drake("geometry"), import_drake("math")
        friction = import_drake("multibody.plant").CoulombFriction(ground.mu_s, ground.mu_s)
        assert ground.damping is not None
        relaxation = 0.5 * ground.damping / ground.stiffness  # of each surface; they add up

        def surface(stiffness: float) -> Any:
            properties = geometry.ProximityProperties()
            geometry.AddContactMaterial(dissipation, stiffness, friction, properties)
            properties.AddProperty("material", "relaxation_time", relaxation)
            return properties

        plane = mathematics.RigidTransform(np.array([0.0, 0.0, -radius]))
        half = geometry.HalfSpace()
        soft = surface(ground.stiffness)
        self.plant.RegisterCollisionGeometry(self.plant.world_body(), plane, half, "ground", soft)
        self._foot_bodies, feet = [], geometry.GeometrySet()
        for foot in robot.feet:
            frame = robot.model.frames[robot.frame_id(foot)]
            body = self._bodies[frame.parentJoint - 1]
            place = mathematics.RigidTransform(np.array(frame.placement.translation))
            sphere = geometry.Sphere(radius)
            feet.Add(self.plant.RegisterCollisionGeometry(body, place, sphere, f"foot:{foot}", surface(RIGID)))
            self._foot_bodies.append(body)
        within = geometry.CollisionFilterDeclaration().ExcludeWithin(feet)
        self.scene.collision_filter_manager().Apply(within)

    def reset(self, q: Vector, v: Vector) -> None:
        """Put the robot in a state; time begins anew.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
        """
        context = self.simulator.get_mutable_context()
        context.SetTime(0.0)
        self._steps = 0
        place, moving = np.zeros(self.plant.num_positions()), np.zeros(self.plant.num_velocities())
        b, c = self._base
        rotation = _rotation(q)
        place[b : b + 4], place[b + 4 : b + 7] = q[[6, 3, 4, 5]], q[:3]
        moving[c : c + 3], moving[c + 3 : c + 6] = rotation @ v[3:6], rotation @ v[:3]
        angle = np.where(self._unbounded, np.arctan2(q[self._place + self._unbounded], q[self._place]), q[self._place])
        place[self._position], moving[self._velocity] = angle, v[self._column]
        self.plant.SetPositionsAndVelocities(self.context, np.concatenate((place, moving)))
        self.simulator.Initialize()

    def step(self, force: Vector, q: Vector, v: Vector) -> None:
        """One step under a generalised force, which becomes Drake's; q and v are read and then overwritten.

        Args:
            force: (nv,) in this library's convention: the wrench on the body in its axes.
            q: (nq,) configuration, in and out.
            v: (nv,) generalised velocity, out.
        """
        _, c = self._base
        rotation, out = _rotation(q), self._generalised
        out[c : c + 3], out[c + 3 : c + 6] = rotation @ force[3:6], rotation @ force[:3]
        out[self._velocity] = force[self._column]
        self._forces.FixValue(self.context, out)
        self._steps += 1
        self.simulator.AdvanceTo(self._steps * self._config.time_step)
        self._read(q, v)

    def _read(self, q: Vector, v: Vector) -> None:
        place, moving = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
        b, c = self._base
        q[3:7], q[:3] = place[[b + 1, b + 2, b + 3, b]], place[b + 4 : b + 7]
        rotation = _rotation(q)
        v[3:6], v[:3] = moving[c : c + 3] @ rotation, moving[c + 3 : c + 6] @ rotation
        angle, turning = place[self._position], self._unbounded
        q[self._place] = np.where(turning, np.cos(angle), angle)
        q[self._place[turning] + 1] = np.sin(angle[turning])
        v[self._column] = moving[self._velocity]

    def read_forces(self, force: Vector) -> None:
        """Forces on the feet, of the last step, into force (feet, 3), world axes, N."""
        force[:] = 0.0
        results = self._output.Eval(self.context)
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            a, b = int(pair.bodyA_index()), int(pair.bodyB_index())
            # It is the force on B.
            if b in self._feet:
                force[self._feet[b]] += pair.contact_force()
            else:
                force[self._feet[a]] -= pair.contact_force()


@contextmanager
def _quietly() -> Iterator[None]:
    """Without Drake's warning that deformable bodies, which there are none of, would not touch a half space."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _rotation(q: Vector) -> Vector:
    """(3, 3) base axes to world."""
    x, y, z, w = (q[3:7] / np.linalg.norm(q[3:7])).tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _body_inertia(inertia: Vector) -> Vector:
    """The inertia (3, 3), with the same moment added about every axis where it is none of a body."""
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    missing = max(MIN_INERTIA - smallest, largest - smallest - middle, 0.0)
    out: Vector = inertia + 1.001 * missing * np.eye(3)
    return out
