"""The plant that steps in MuJoCo.

**Contact.** MuJoCo's constraint on the gap r of a contact reads A f + a₀ + R f = −b ṙ − k r, where
A f + a₀ is the acceleration of the gap. ``solref`` and ``solimp`` make R = 1 / ((d + k' Δt) Δt), b
= 1 / Δt and k = k' R. Then

    f = −k' (r + Δt ṙ⁺) − d ṙ⁺

the spring k' and the damper d of the ground at the *end* of the step, as in this library's own
plant. The same b brings a sticking foot to rest within a step, up to the creep that ``impratio``
leaves.

**Terrain.** On ground that is not flat every foot has a plane of its own, which lies before each
step where the tangent plane of the ground below the foot is: all plants walk on the same surface.

**Points.** A contact lies half-way between the plane and the deepest point of the sphere, so that a
leg rolls over the sphere's radius and over half the penetration. Every step therefore moves the
contacts to the feet's points before the constraints are made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.simulation.actuators import Actuators
from harpy_pin.simulation.mujoco.conventions import from_mujoco
from harpy_pin.simulation.mujoco.mujoco_model import MujocoModel
from harpy_pin.simulation.mujoco.soft_contact import SoftContact, write_contact
from harpy_pin.simulation.stepped_plant import SteppedPlant, tangent_planes

FOOT_RADIUS = 1e-4  # radius of the spheres that find the contacts, m
IMPRATIO = 1e4  # ratio of the regularisation of the normal force to that of friction
ITERATIONS = 100
TOLERANCE = 1e-12


class MujocoPlant(SteppedPlant):
    """A robot in MuJoCo: elliptic friction cones, Newton's solver, Euler steps that are implicit in
    the joint damping.

    Args:
        robot: any that :func:`harpy_pin.model.loading.load_robot` takes.
        ground: stiffness, damping and static friction coefficients, on strips too; see
            :func:`harpy_pin.simulation.mujoco.preset_ground`. MuJoCo has no other friction: what
            slides does so at μ_s.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s².
        actuators: motors, joint friction and thrusters; those of the model by default. MuJoCo's
            Coulomb friction (``frictionloss``) creeps a little under a torque that it holds.
        contact: MuJoCo's own contact instead of the ground's stiffness and damping; :attr:`ground`
            then has those that the robot's weight finds.
        foot_radius: of spheres that roll over the ground, m; feet are points by default.

    Attributes:
        model: ``mujoco.MjModel``.
        data: ``mujoco.MjData``.
        inverse_mass: (feet,) of each foot as MuJoCo estimates it, 1/kg.

    Raises:
        InputError: MuJoCo is not installed, the ground's cone is not circular, or as
            :class:`harpy_pin.simulation.plant.Plant`.
        RobotError: MuJoCo refuses the robot.
    """

    name = "mujoco"
    _rebuilt = ("_geom_position",)

    @checked
    def __init__(
        self,
        robot: Robot,
        ground: Ground | None = None,
        *,
        dt: float = 5e-4,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY),
        actuators: Actuators | None = None,
        contact: SoftContact | None = None,
        foot_radius: float = 0.0,
    ) -> None:
        ground = ground if ground is not None else Ground()
        if ground.cone != "circular":
            raise InputError(
                "MuJoCo's friction cone is circular, not per_axis", name="ground", value=ground
            )
        if (ground.surface is not None or ground.stiffness_strips) and (
            contact is not None or foot_radius
        ):
            raise InputError(
                "on terrain or strips feet are points with the ground's own contact: no "
                "contact, no foot_radius",
                name="ground",
                value=ground,
            )
        feet = len(robot.feet)
        super().__init__(robot, ground, dt=dt, gravity=gravity, actuators=actuators)
        self._flat = bool(self._terrain["level"][0])
        self.contact, self.foot_radius = (
            contact,
            checks.number("foot_radius", foot_radius, low=0.0, high=1.0),
        )
        self._inside = inside = MujocoModel(
            self.robot,
            friction=ground.mu_s,
            dt=self.dt,
            gravity=self.gravity,
            foot_radius=self.foot_radius or FOOT_RADIUS,
            own_planes=not self._flat,
        )
        self.model, self.data = inside.model, inside.data
        self.model.dof_frictionloss[inside.joint_places] = self.actuators.coulomb(self.robot)
        self._found = np.zeros(6)
        self._rebuild()
        self._planes = np.zeros((feet, 7))
        self.model.geom_sameframe[inside.planes] = 0  # they are where the plant puts them
        self._foot_of = {geom: k for k, geom in enumerate(inside.feet)}
        self.inverse_mass: Vector = self.model.body_invweight0[
            self.model.geom_bodyid[inside.feet], 0
        ].copy()
        self._rolled, self._turning = np.zeros((feet, 3)), np.zeros(6)
        if contact is None:
            _set_options(inside.mujoco, self.model.opt)
            for pair in range(feet):
                self._set_stiffness(pair, ground.stiffness, ground.damping)
        else:
            write_contact(contact, inside.mujoco, self.model)
            self._find_ground(contact)

    def _rebuild(self) -> None:
        """See :class:`MujocoModel`."""
        self._geom_position = self.data.geom_xpos

    def describe(self) -> Mapping[str, Any]:
        """Version, and the contact's numbers."""
        model, contact = self.model, {}
        if model.npair:
            contact = {
                "solref": model.pair_solref[0].tolist(),
                "impedance": float(model.pair_solimp[0, 0]),
            }
        about = {
            "name": self.name,
            "version": self._inside.mujoco.__version__,
            **contact,
            "impratio": float(model.opt.impratio),
        }
        if self.contact is not None:
            about |= {"solimp": list(self.contact.solimp), "cone": self.contact.cone}
        return about | ({"foot_radius": self.foot_radius} if self.foot_radius else {})

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.reset`; the contact solver starts cold."""
        super().reset(q, v, t=t)
        self._inside.reset(self.q, self.v)
        self._rolled[:] = 0.0

    def _step(self, torque: Vector, push: Vector | None) -> bool:
        """What ``mj_step`` does, with the contacts at the feet's points; returns whether it makes
        sense to go on.
        """
        inside, model, data = self._inside, self.model, self.data
        mj = inside.mujoco
        if self.ground.friction_strips:
            model.pair_friction[:, :2] = self.ground.friction(self.dynamics.foot_position[:, 0])[
                :, None
            ]
        if self.ground.stiffness_strips:
            self._follow_stiffness()
        if not self._flat:
            self._move_planes()
        mj.mj_fwdPosition(model, data)
        contacts = data.ncon
        if contacts and not self.foot_radius:
            self._move_contacts()
        mj.mj_fwdVelocity(model, data)
        self._drive(torque)
        inside.apply(self._record_["motors"]["mean_torque"][0], self._forces, push)
        mj.mj_fwdActuation(model, data)
        mj.mj_fwdAcceleration(model, data)
        mj.mj_fwdConstraint(model, data)
        self._read_forces(contacts)
        mj.mj_Euler(model, data)
        from_mujoco(inside.conventions._record_, inside.qpos, inside.qvel, self._q_, self._v_)
        self.dynamics.update(self._q_, self._v_)
        position = self.dynamics._foot_position_
        if self.foot_radius:
            self._roll()
            position = position + self._rolled
        return self._note(position)

    def _roll(self) -> None:
        """Add what the contacts moved against the spheres' centres, so that rolling is no slip."""
        inside, model, data = self._inside, self.model, self.data
        mj = inside.mujoco
        for update in (mj.mj_kinematics, mj.mj_comPos, mj.mj_comVel):
            update(model, data)
        for foot, geom in enumerate(inside.feet):
            # Half-way between the plane and the lowest point.
            way = self.dt * (
                self.foot_radius + 0.5 * min(self.dynamics.foot_position[foot, 2], 0.0)
            )
            mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_GEOM, geom, self._turning, 0)
            self._rolled[foot, 0] -= way * self._turning[1]
            self._rolled[foot, 1] += way * self._turning[0]

    def _set_stiffness(self, pair: int, stiffness: float, damping: float | None) -> None:
        """Spring, N/m, and damper, N·s/m, of a foot's contact, as ``solref`` and the impedance d of
        ``solimp``.

        MuJoCo takes R = (1 − d)/d A₀, with A₀ its own estimate of the inverse mass, 1/kg. A
        negative ``solref`` gives it the rates k = −solref₀ / d and b = −solref₁ / d where d is
        constant.
        """
        assert damping is not None
        inverse, model = float(self.inverse_mass[pair]), self.model
        regularisation = 1.0 / ((damping + stiffness * self.dt) * self.dt)
        impedance = inverse / (inverse + regularisation)
        solref = (-stiffness * regularisation * impedance, -impedance / self.dt)
        model.pair_solref[pair] = model.pair_solreffriction[pair] = solref
        model.pair_solimp[pair] = (impedance, impedance, 1.0, 0.5, 1.0)

    def _follow_stiffness(self) -> None:
        """The stiffness of the place where each foot is, with the ground's damping ratio."""
        assert self.ground.damping is not None
        for pair, stiffness in enumerate(
            self.ground.stiffness_at(self.dynamics.foot_position[:, 0]).tolist()
        ):
            damping = self.ground.damping * float(np.sqrt(stiffness / self.ground.stiffness))
            self._set_stiffness(pair, stiffness, damping)

    def _find_ground(self, contact: SoftContact) -> None:
        """Take the stiffness and the damping that the weight finds, shared by the feet."""
        load = self.robot.mass * max(-float(self.gravity[2]), 0.0)
        if len(self.inverse_mass) and load > 0.0:
            inverse = float(self.inverse_mass.mean())
            share = load / len(self.inverse_mass)
            stiffness, damping = contact.ground(
                share, inverse_mass=inverse, friction=self.ground.mu_s
            )
            self.ground = replace(self.ground, stiffness=stiffness, damping=damping)

    def _move_planes(self) -> None:
        """Put the plane of every foot where the ground's tangent plane below the foot is."""
        below = self.foot_radius or FOOT_RADIUS
        tangent_planes(
            self._record_, self._terrain, self.dynamics.foot_position, below, self._planes
        )
        planes = self._inside.planes
        self.model.geom_pos[planes], self.model.geom_quat[planes] = (
            self._planes[:, :3],
            self._planes[:, 3:],
        )

    def _move_contacts(self) -> None:
        """Put every contact where its foot's point is, and make the constraints anew."""
        contact = self.data.contact
        contact.pos[:] = self._geom_position[contact.geom2]
        self._inside.mujoco.mj_makeConstraint(self.model, self.data)

    def _read_forces(self, contacts: int) -> None:
        """Forces on the feet, summed over their contacts, world axes."""
        data, force, found = self.data, self._foot_force, self._found
        force[:] = 0.0
        if contacts:
            geoms, frames = data.contact.geom2.tolist(), data.contact.frame
            for i in range(contacts):
                self._inside.mujoco.mj_contactForce(self.model, data, i, found)
                force[self._foot_of[geoms[i]]] += found[:3] @ frames[i].reshape(3, 3)
            iterations = int(data.solver_niter[0])
            self._counts_[0] = max(self._counts_[0], iterations)
            self._counts_[1] += iterations >= ITERATIONS


def _set_options(mujoco: Any, option: Any) -> None:
    """Solver settings of the plant."""
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.impratio = IMPRATIO
    option.iterations = ITERATIONS
    option.tolerance = TOLERANCE
    # One robot is one island. REFSAFE would bound the rates that are set on purpose.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND) | int(
        mujoco.mjtDisableBit.mjDSBL_REFSAFE
    )
