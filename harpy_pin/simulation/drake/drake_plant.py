"""The plant that steps in Drake: a discrete ``MultibodyPlant`` with point contact.

**Contact.** A foot that is x deep has the normal force k x (1 + D ẋ) by the law of Hunt and Crossley, which the ``sap``
approximation replaces by k (x + ẋ d / k). D is such that a foot at its depth at rest feels the ground's damping d.

**Friction.** By ``lagged`` a foot that slides at speed s has μ N s / √(s² + s₀²) against it, with Drake's default
s₀ = 0.1 mm/s. So a foot creeps with s₀ x / √(1 − x²) under the share x of its friction. By ``sap`` it creeps with some
0.2 µm/s per newton of a body of 2 kg, and a sliding foot is lifted, as in MuJoCo.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.log.slip import ContactRecord, note_slip, slip_record
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.rotor import read_thrusts, write_thrusts
from harpy_pin.model.state import Command, Vector
from harpy_pin.simulation.actuators import Actuators, MotorsRecord, drive_motors, motors_record
from harpy_pin.simulation.battery import battery_record, draw_power, reset_battery
from harpy_pin.simulation.drake.drake_model import DrakeModel, drake_version
from harpy_pin.simulation.forces import checked_forces
from harpy_pin.simulation.ground import Ground
from harpy_pin.simulation.plant import GRAVITY, Plant
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.thrusters import drive_thrusters, settle_thrusters, thrusters_record

__all__ = ["APPROXIMATIONS", "DrakePlant"]

APPROXIMATIONS = ("lagged", "sap")
"""Drake's discrete contact models: its default, and its convex one."""
STICTION = 1e-4
"""s₀, m/s."""
FOOT_RADIUS = 1e-4
"""Of the spheres that find the contacts, m."""
FULL = 0.999
"""Share of the friction from which on a foot slides."""
RUNAWAY = 1e6
"""Sum of speeds, m/s and rad/s, at which stepping on is of no use."""


class DrakePlant(Plant):
    """A robot in Drake.

    Args:
        robot: any that :func:`harpy_pin.model.robot.load_robot` takes.
        ground: stiffness, damping and static friction coefficient. Drake has no other friction: what slides does so at
            μ_s.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s².
        actuators: motors, viscous joint friction and thrusters; those of the model by default.
        approximation: one of :data:`APPROXIMATIONS`.

    Raises:
        InputError: Drake is not installed, the ground has a terrain, strips or a cone that is not circular, joints have
            Coulomb friction, or as :class:`harpy_pin.simulation.plant.Plant`.
        RobotError: Drake refuses the robot.
    """

    name = "drake"

    @checked
    def __init__(
        self,
        robot: Robot,
        ground: Ground | None = None,
        *,
        dt: float = 5e-4,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY),
        actuators: Actuators | None = None,
        approximation: str = APPROXIMATIONS[0],
    ) -> None:
        ground = ground if ground is not None else Ground()
        self.actuators = actuators = Actuators() if actuators is None else actuators
        check_drake(ground, actuators)
        checks.one_of("approximation", approximation, APPROXIMATIONS)
        robot, feet = actuators.damped(robot), len(robot.feet)
        self.approximation = approximation
        self._motors = motors_record(actuators, robot.torque_limit)
        kinds = {"count": len(robot.thrusters), "variables": robot.n_thrust}
        self._cells = battery_record(actuators.battery)
        self._thrusters = thrusters_record(actuators.thrusters, **kinds, dt=checks.number("dt", dt, low=1e-6))
        self._thrust, self._thrust_force = np.zeros(robot.n_thrust), np.zeros((len(robot.thrusters), 3))
        record = make_record(ContactRecord, {"feet": feet}, slip=slip_record(feet))
        super().__init__(robot, ground, record, dt=dt, gravity=gravity)
        self._lagging = field(self._thrusters, "mean_thrust") if actuators.thrusters else None
        self._battery = None if actuators.battery is None else self._cells
        assert ground.damping is not None
        depth = self.static_penetration
        self.dissipation = ground.damping / (ground.stiffness * depth) if depth > 0.0 else 0.0
        self._inside = DrakeModel(
            robot,
            ground=ground,
            approximation=approximation,
            dissipation=self.dissipation,
            dt=self.dt,
            gravity=self.gravity,
            foot_radius=FOOT_RADIUS,
        )
        self._no_force = np.zeros((feet, 3))

    def _prepare(self) -> None:
        read_thrusts.prepare(self.dynamics.record, self._thrust_force, self._thrust)
        write_thrusts.prepare(self.dynamics.record, self._thrust, self._thrust_force)
        draw_power.prepare(self._cells, self._motors, self._thrusters, self.v, self.dt)
        drive_thrusters.prepare(self._thrusters, self.dynamics.rotation, self._thrust)
        _drive.prepare(self._motors, self._motors["mean_torque"][0], self.v, self.dt)
        _note.prepare(self._contact, self.dynamics.foot_position, self.v, self.dt)
        super()._prepare()

    def describe(self) -> Mapping[str, Any]:
        """Version, and the contact's settings."""
        settings = {"approximation": self.approximation, "dissipation": self.dissipation}
        return {"name": self.name, "version": drake_version(), **settings}

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.reset`."""
        super().reset(q, v, t=t)
        self._inside.reset(self.q, self.v)
        self._motors["settled"] = 0
        settle_thrusters(self._thrusters, self.actuators.thrusters, self.dt)
        reset_battery(self._cells, self.actuators.battery)

    def advance(self, command: Command, pushes: Sequence[Push] = (), *, steps: int = 1) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.advance`."""
        self._check_placed()
        steps = checks.whole("steps", steps, high=checks.MAX_TICKS)
        torque, thrust = self._checked(command)
        push = self._push_forces(pushes, steps) if pushes else None
        for n in range(steps):
            if not self._step(torque, thrust, None if push is None else push[n]):
                break
        self.t += steps * self.dt

    @checked
    def creep(self, force: ArrayLike) -> Vector:
        """Velocity of feet that creep steadily under forces inside the friction cone by ``lagged``, m/s.

        Args:
            force: (..., 3) of the ground on the feet, N; world axes.

        Returns:
            (..., 2) along x and y; on the cone and outside that of a share of 0.999.
        """
        (force,) = checked_forces(force)
        along, most = force[..., :2], self.ground.mu_s * force[..., 2]
        norm = np.hypot(along[..., 0], along[..., 1])
        share = np.minimum(np.divide(norm, most, out=np.zeros_like(norm), where=most > 0.0), FULL)
        unit = np.divide(along, norm[..., None], out=np.zeros_like(along), where=norm[..., None] > 0.0)
        velocity: Vector = -unit * (STICTION * share / np.sqrt(1.0 - share**2))[..., None]
        return velocity

    def _step(self, torque: Vector, thrust: Vector, push: Vector | None) -> bool:
        """One step of Drake; returns whether it makes sense to go on."""
        _drive(self._motors, torque, self.v, self.dt)
        terms, mean = self.dynamics.record, self._thrusters["mean_thrust"][0]
        read_thrusts(terms, thrust, self._thrust)
        drive_thrusters(self._thrusters, self.dynamics.rotation, self._thrust)
        write_thrusts(terms, mean, self._thrust_force)
        if self._battery is not None:
            draw_power(self._cells, self._motors, self._thrusters, self.v, self.dt)
        force = self.dynamics.generalised_force(self._motors["mean_torque"][0], self._no_force, self._thrust_force)
        if push is not None:
            force[:3] += push @ self.dynamics.rotation
        self._inside.step(force, self.q, self.v)
        self._inside.read_forces(self._foot_force)
        self.dynamics.update(self.q, self.v)
        return bool(_note(self._contact, self.dynamics.foot_position, self.v, self.dt))


def check_drake(ground: Ground, actuators: Actuators | None) -> None:
    """Refuse what Drake does not have.

    Raises:
        InputError: a terrain, strips, a cone that is not circular, or Coulomb friction in joints.
    """
    if ground.cone != "circular":
        raise InputError("Drake's friction cone is circular, not per_axis", name="ground", value=ground)
    if ground.friction_strips or ground.stiffness_strips:
        raise InputError("Drake's ground has no strips", name="ground", value=ground)
    if ground.surface is not None:
        raise InputError("Drake's ground is flat, it has no terrain", name="ground", value=ground)
    if actuators is not None and actuators.coulomb_friction:
        raise InputError("Drake's joints have no Coulomb friction", name="actuators", value=actuators)


@kernel
def _drive(motors: Records[MotorsRecord], command: Vector, v: Vector, dt: float) -> None:
    drive_motors(motors[0], command, v, dt)


@kernel
def _note(contact: Records[ContactRecord], position: Vector, v: Vector, dt: float) -> bool:
    """Take slip into account; returns whether the speeds are numbers within reason."""
    note_slip(contact[0].slip, position, contact[0].force, dt)
    total = 0.0
    for i in range(v.shape[0]):
        total += abs(v[i])
    return total < RUNAWAY
