"""Plants whose physics steps are made in Python.

Motors, thrusters, terrain and slip of each step are kernels.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from harpy_pin import checks
from harpy_pin.ground.contact_frame import contact_frame
from harpy_pin.ground.surface import TerrainRecord, surface_height, surface_normal
from harpy_pin.kernels import kernel
from harpy_pin.log.slip import note_slip
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.state import Command, Vector
from harpy_pin.model.terms import read_thrusts, write_thrusts
from harpy_pin.simulation.actuators import drive_motors
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.push import Push, push_forces
from harpy_pin.simulation.step import PlantRecord
from harpy_pin.simulation.thrusters import drive_thrusters

RUNAWAY = 1e6  # sum of speeds, m/s and rad/s, at which stepping on is of no use


class SteppedPlant(Plant):
    """A plant that makes one physics step after the other in Python, see :meth:`_step`."""

    def _prepare(self) -> None:
        forces = self._forces = np.zeros((len(self.robot.thrusters), 3))
        thrust, torque = self._record_["thrust"][0], np.zeros(len(self.robot.joints))
        read_thrusts.prepare(self.dynamics._record_, forces, thrust)
        drive_actuators.prepare(
            self.dynamics._record_, self._record_, torque, self.q, self.v, self.dt, forces
        )
        note_step.prepare(
            self._record_, self._terrain, self.dynamics.foot_position, self.v, self.dt
        )
        super()._prepare()

    def advance(self, command: Command, pushes: Sequence[Push] = (), *, steps: int = 1) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.advance`."""
        self._check_placed()
        steps = checks.whole("steps", steps, high=checks.MAX_TICKS)
        command = self.checked(command)
        self._take_law(command)
        self._counts_[2] += read_thrusts(
            self.dynamics._record_, command._thrust_, self._record_["thrust"][0]
        )
        push = push_forces(pushes, self.t, self.dt, steps) if pushes else None
        for n in range(steps):
            if not self._step(command._torque_, None if push is None else push[n]):
                break
        self.t += steps * self.dt

    @abstractmethod
    def _step(self, torque: Vector, push: Vector | None) -> bool:
        """A physics step; returns whether it makes sense to go on.

        It is under a command (joints,), N·m, and a push (3,), N, on the body's origin. It calls
        :meth:`_drive` at its beginning, and :meth:`_note` at its end.
        """

    def _drive(self, torque: Vector) -> None:
        """Torques of a step, and thrusts ``_forces`` (thrusters, 3), world axes, N."""
        drive_actuators(
            self.dynamics._record_, self._record_, torque, self._q_, self._v_, self.dt, self._forces
        )

    def _note(self, position: Vector) -> bool:
        """Note the slip of feet, now at (feet, 3), m; whether all speeds are within reason."""
        goes_on = bool(note_step(self._record_, self._terrain, position, self._v_, self.dt))
        for part in self.attached:
            part.after_step(self)
        return goes_on


@kernel
def drive_actuators(
    d: DynamicsRecord,
    s: PlantRecord,
    torque: Vector,
    q: Vector,
    v: Vector,
    dt: float,
    forces: Vector,
) -> None:
    """Torques and thrusts of a step under a constant command.

    Thrusts are written to ``forces`` (thrusters, 3), world axes, N.
    """
    drive_thrusters(s.thrusters, d.tree.rotation, s.thrust)
    write_thrusts(d, s.thrusters.mean_thrust, forces)
    drive_motors(s.motors, torque, q, v, dt)


@kernel
def note_step(
    s: PlantRecord, terrain: TerrainRecord, position: Vector, v: Vector, dt: float
) -> bool:
    """Take slip into account; returns whether the speeds are finite and within reason."""
    note_slip(s.slip, terrain.level, s.frame, position, s.force, dt)
    return float(np.sum(np.abs(v))) < RUNAWAY


@kernel
def tangent_planes(
    s: PlantRecord, terrain: TerrainRecord, position: Vector, below: float, out: Vector
) -> None:
    """Frames of the contacts, into ``s``, and the ground's tangent planes at the feet.

    The planes lie ``below`` the ground, m; positions (feet, 3) of the feet in m.

    ``out`` (feet, 7) is a point of each plane, m, and its quaternion w, x, y, z.
    """
    for k in range(position.shape[0]):
        x, y = position[k, 0], position[k, 1]
        nx, ny, nz = surface_normal(terrain, x, y)
        contact_frame(nx, ny, nz, s.frame[k])
        size = np.sqrt(2.0 * (1.0 + nz))
        out[k, :3] = x - below * nx, y - below * ny, surface_height(terrain, x, y) - below * nz
        out[k, 3:] = 0.5 * size, -ny / size, nx / size, 0.0
