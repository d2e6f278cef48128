"""The paper's full model as it is written, with Pinocchio's ABA and explicit steps.

    a = ABA(q, v, S τ − B v + J_tᵀ u_t + J_fᵀ f)

The forces f on the feet are E1 and E2 of docs/equations.md at q and v: a spring, a damper while the
foot goes down, and Stribeck friction against the motion (:func:`contact_force`). Nothing is solved
for.

**Friction at rest** needs a motion here. E2 is discontinuous at rest, so it is made smooth: below a
speed ε, the *stiction tolerance*, friction falls to zero with the speed. A foot that holds the
share r of its largest friction therefore creeps at ε r / √(1 − r²). It holds at most 0.96 of μ_s
for ε = 1 mm/s, as the Stribeck curve has begun to fall where the friction is whole.

**Steps.** This friction is stiff: near rest it is a damper of μ f_z / ε, some 30,000 N·s/m under
Harpy, on a foot of 0.1 kg. A Runge–Kutta–Legendre step of s stages is stable for decay rates up to
s (s + 1) / Δt, where s steps of Euler reach 2 s / Δt, and the classical Runge–Kutta method with as
many evaluations 0.7 s / Δt. Stages are as many as the robot needs where it begins. The method is of
first order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground, local_friction, local_stiffness
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.simulation.actuators import Actuators
from harpy_pin.simulation.joint_ends import hold_at_ends, joint_ends_record
from harpy_pin.simulation.stepped_plant import SteppedPlant, tangent_planes

STICTION_TOLERANCE = 1e-3
"""Default of the speed below which a foot creeps rather than slides, m/s."""
TOLERANCES: dict[str, Any] = {"low": 1e-6, "high": 1.0}
"""Bounds of it, m/s."""
JOINT_TOLERANCE = 1e-2
"""The same of Coulomb friction in the joints, rad/s."""
LOAD = 2.0
"""Weights of the robot on one foot, at touchdown, for which stages are chosen."""
PHASE = 0.2
"""Most of a foot's oscillation on the ground's spring in a step of the method, rad.

Where nothing damps it, it grows by 1 % in such a step."""
MAX_EVALUATIONS = 2000
"""Most evaluations of ABA in a physics step."""
WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioPlant(SteppedPlant):
    """A robot on compliant ground by Pinocchio's ABA.

    Feet are points, soles the points at their corners. A physics step has constant torques and
    thrusts. Its contact forces are the means over the step. A foot feels the tangent plane and the
    strip below it at the beginning of the step.

    Args:
        robot: what to simulate.
        ground: contact parameters.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s².
        actuators: motors, joint friction and thrusters; those of the model by default. A joint
            creeps under its Coulomb friction, as a foot does.
        stiction_tolerance: speed below which friction falls to zero, m/s. Halving it halves the
            creep, and takes 1.4 times as long.

    Attributes:
        model: ``pinocchio.Model`` with this gravity.
        data: ``pinocchio.Data``.
        substeps: steps of the method in a physics step, since the last reset.
        stages: of each.

    Raises:
        InputError: as :class:`harpy_pin.simulation.plant.Plant`; from :meth:`reset`, the ground is
            so stiff that a physics step takes more than 2000 evaluations.
    """

    name = "pinocchio"

    @checked
    def __init__(
        self,
        robot: Robot,
        ground: Ground | None = None,
        *,
        dt: float = 5e-4,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY),
        actuators: Actuators | None = None,
        stiction_tolerance: float = STICTION_TOLERANCE,
    ) -> None:
        if checks.instance("robot", robot, Robot).loops is not None:
            raise InputError(
                f"'{robot.name}' has closed loops, which Pinocchio's plant does not know: take "
                "another plant",
                name="robot",
            )
        super().__init__(robot, ground, dt=dt, gravity=gravity, actuators=actuators)
        self.stiction_tolerance = checks.number(
            "stiction_tolerance", stiction_tolerance, **TOLERANCES
        )
        self.model: pin.Model = self.dynamics.model
        self.data: pin.Data = self.model.createData()
        self.substeps = self.stages = 0
        self._feet = [self.robot.frame_id(name) for name in self.robot.feet]
        self._thrusters = [self.robot.frame_id(name) for name in self.robot.thrusters]
        self._drag = np.zeros(len(self._thrusters))
        free = len(self._thrusters) - len(self.robot.rotors)
        self._drag[free:] = [rotor.drag for rotor in self.robot.rotors]
        self._coulomb = self.actuators.coulomb(self.robot)
        self._dry = bool(self._coulomb.any())
        self._ends = joint_ends_record(robot, self.dt)
        self._level = bool(self._terrain["level"][0])
        self._strips = bool(self.ground.friction_strips or self.ground.stiffness_strips)
        self._planes = np.zeros((len(self._feet), 7))
        names = ("stiffness", "damping", "mu_s", "mu_c")
        numbers = [float(self._ground[name][0]) for name in names]
        self._spring = numbers[:2]
        self._contact = [numbers] * len(self._feet)

    def describe(self) -> Mapping[str, Any]:
        """Version, and how it steps."""
        steps = {"substeps": self.substeps, "stages": self.stages}
        about = {"version": pin.__version__, "stiction_tolerance": self.stiction_tolerance}
        return {"name": self.name, **about, **steps}

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.reset`."""
        super().reset(q, v, t=t)
        self._choose_stages()

    def _choose_stages(self) -> None:
        """Stages and substeps that are stable, by the fastest decay and oscillation of a foot."""
        ground, (stiffness, damping) = self.ground, self._spring
        inverse, jacobian = np.linalg.inv(self.dynamics.mass_matrix), self.dynamics.foot_jacobian
        mobility = jacobian @ inverse @ jacobian.T  # of the feet, 1/kg
        feet = [mobility[i : i + 3, i : i + 3] for i in range(0, len(mobility), 3)]
        together = float(np.linalg.norm(mobility, 2)) if feet else 0.0
        alone = max((float(np.linalg.norm(foot, 2)) for foot in feet), default=0.0)
        mu = max([ground.mu_s, *(strip[2] for strip in ground.friction_strips)])
        stiffest = max([stiffness, *(strip[2] for strip in ground.stiffness_strips)])
        # Friction, however the feet share the load; the ground's dampers; friction of the joints.
        weight = self.robot.mass * float(np.linalg.norm(self.gravity))
        rate = alone * (LOAD * mu * weight / self.stiction_tolerance + ground.mu_v)
        rate += together * damping * math.sqrt(stiffest / stiffness)
        joints = np.sqrt(self.model.damping[6:] + self._coulomb / JOINT_TOLERANCE)
        rate += float(np.linalg.norm(np.outer(joints, joints) * inverse[6:, 6:]))
        phase = self.dt * math.sqrt(together * stiffest)
        self.substeps = max(math.ceil(phase / PHASE), 1)
        decay = self.dt / self.substeps * rate  # at most stages (stages + 1)
        self.stages = max(math.ceil(math.sqrt(0.25 + decay) - 0.5), 2)
        if self.substeps * self.stages > MAX_EVALUATIONS:
            needed = (
                f"{self.substeps * self.stages:,} evaluations in a physics step of {self.dt:g} s"
            )
            raise InputError(
                f"feet are too light, or the ground too stiff, for explicit steps: {needed}",
                name="ground",
                value=ground,
            )

    def _feet_at(self, q: Vector) -> tuple[Vector, Vector]:
        """Jacobian (3 feet, nv) and positions (feet, 3) of the feet, world axes."""
        jacobian = np.empty((3 * len(self._feet), self.model.nv))
        position = np.empty((len(self._feet), 3))
        for k, frame in enumerate(self._feet):
            found = pin.computeFrameJacobian(self.model, self.data, q, frame, WORLD_AXES)
            jacobian[3 * k : 3 * k + 3] = found[:3]
            position[k] = self.data.oMf[frame].translation
        return jacobian, position

    def _feel_ground(self) -> None:
        """The ground below each foot, for this step."""
        position = self.dynamics._foot_position_
        if not self._level:
            tangent_planes(self._record_, self._terrain, position, 0.0, self._planes)
        if self._strips:
            for k, x in enumerate(position[:, 0].tolist()):
                stiffer = local_stiffness(x, self._ground)
                spring = stiffer * self._spring[0], math.sqrt(stiffer) * self._spring[1]
                self._contact[k] = [*spring, *local_friction(x, self._ground)]

    def _foot_forces(self, position: Vector, velocity: Vector) -> Vector:
        """Forces on feet at positions, m, with velocities, m/s, (feet, 3), world axes, N."""
        height, frame = position[:, 2], self._record_["frame"][0]
        if not self._level:
            height = np.einsum("kc,kc->k", position - self._planes[:, :3], frame[:, :, 2])
            velocity = np.einsum("kci,kc->ki", frame, velocity)
        feet = zip(height.tolist(), velocity.tolist(), self._contact, strict=True)
        how = self.ground, self.stiction_tolerance
        force = np.array([contact_force(*foot, *how) for foot in feet]).reshape(-1, 3)
        if not self._level:
            force = np.einsum("kci,ki->kc", frame, force)
        return force

    def _acceleration(self, q: Vector, v: Vector, given: Vector) -> tuple[Vector, Vector]:
        """Acceleration (nv,) under generalised forces (nv,), and forces on the feet, N."""
        jacobian, position = self._feet_at(q)
        force = self._foot_forces(position, (jacobian @ v).reshape(-1, 3))
        tau = given - self.model.damping * v + force.ravel() @ jacobian
        if self._dry:
            tau[6:] -= self._coulomb * v[6:] / np.hypot(v[6:], JOINT_TOLERANCE)
        return pin.aba(self.model, self.data, q, v, tau), force

    def _given(self, push: Vector | None) -> Vector:
        """(nv,) generalised forces of motors, joints' ends, thrusters and a push, constant over a
        step.
        """
        given, ends = np.zeros(self.model.nv), np.zeros(self.model.nv)
        hold_at_ends(self._ends, self._q_, self._v_, ends)
        given[6:] = self._record_["motors"]["mean_torque"][0]
        if push is not None:
            given[:3] = push @ self.dynamics._rotation_
        for frame, force, drag in zip(self._thrusters, self._forces, self._drag, strict=True):
            jacobian = pin.computeFrameJacobian(self.model, self.data, self._q_, frame, WORLD_AXES)
            given += np.concatenate((force, drag * force)) @ jacobian
        return given - ends

    def _step(self, torque: Vector, push: Vector | None) -> bool:
        self._drive(torque)
        self._feel_ground()
        given, nv, h = self._given(push), self.model.nv, self.dt / self.substeps
        impulse = np.zeros_like(self._foot_force)
        for _ in range(self.substeps):
            start = self._q_.copy()

            # Of the displacement from there, the velocity, and the impulses of the feet. The
            # displacement's rate is the velocity, but for terms of the second order in the step.
            def rate(z: Vector, start: Vector = start) -> Vector:
                v = z[nv : 2 * nv]
                q = pin.integrate(self.model, start, z[:nv])
                acceleration, force = self._acceleration(q, v, given)
                return np.concatenate((v, acceleration, force.ravel()))

            z = np.concatenate((np.zeros(nv), self._v_, np.zeros(impulse.size)))
            z = legendre_step(rate, z, h, self.stages)
            self._q_[:] = pin.integrate(self.model, start, z[:nv])
            self._v_[:] = z[nv : 2 * nv]
            impulse += z[2 * nv :].reshape(-1, 3)
        self._foot_force[:] = impulse / self.dt
        self.dynamics.update(self._q_, self._v_)
        return self._note(self.dynamics._foot_position_)


def contact_force(
    height: float,
    velocity: Sequence[float],
    contact: Sequence[float],
    ground: Ground,
    stiction_tolerance: float,
) -> tuple[float, float, float]:
    """Force of the ground on a point: E1 along the normal, E2 in the tangent plane, smooth at rest.

    Args:
        height: above the ground, m.
        velocity: (3,) in the frame of the contact, whose third axis is the normal, m/s.
        contact: stiffness, N/m, damping, N·s/m, static and sliding friction coefficient of the
            ground there.
        ground: whose viscous friction, Stribeck velocity and cone these are.
        stiction_tolerance: speed at which friction is 0.71 of E2, m/s.

    Returns:
        (3,) force in the frame of the contact, N.
    """
    stiffness, damping, mu_s, mu_c = contact
    x, y, up = velocity
    if height > 0.0:
        return 0.0, 0.0, 0.0
    normal = -stiffness * height - damping * min(up, 0.0)
    if normal == 0.0:
        return 0.0, 0.0, 0.0

    def gain(speed: float) -> float:
        """Friction over speed, N·s/m."""
        ratio = speed / ground.stribeck_velocity
        mu = mu_c + (mu_s - mu_c) * math.exp(-ratio * ratio)
        friction = mu * normal + ground.mu_v * speed
        return friction / math.hypot(speed, stiction_tolerance)

    if ground.cone == "per_axis":  # the paper's form
        return -gain(abs(x)) * x, -gain(abs(y)) * y, normal
    against = -gain(math.hypot(x, y))
    return against * x, against * y, normal


def legendre_step(
    rate: Callable[[Vector], Vector], start: Vector, step: float, stages: int
) -> Vector:
    """One explicit Runge–Kutta–Legendre step of first order.

    RKL1 of Meyer, Balsara and Aslam (J. Comput. Phys. 257, 2014). Stable for decay rates up to
    stages (stages + 1) / step.

    Args:
        rate: of change of a state, 1/s.
        start: (n,) state at the beginning.
        step: its length, s.
        stages: evaluations of the rate, 1 at least.

    Returns:
        (n,) state at the end.
    """
    share = 2.0 * step / (stages * (stages + 1))
    before, now = start, start + share * rate(start)
    for j in range(2, stages + 1):
        before, now = now, ((2 * j - 1) * (now + share * rate(now)) - (j - 1) * before) / j
    return now
