"""What is measured of a walk in MuJoCo, the same for every walker, from MuJoCo's own data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import import_mujoco

AIR = 0.05
"""A foot that was off the ground for so long has made a step when it lands, s."""
SETTLED = 2.0
"""After a new command, s."""
LOWEST, UPRIGHT = 0.5, 0.5
"""Share of the first height, and cosine of the tilt, below which the robot fell."""
GRAVITY = 9.81


class Watch:
    """Sums over a walk; :meth:`look` after every step of MuJoCo.

    Args:
        model: ``mujoco.MjModel``, whose first body is the robot's.
        data: ``mujoco.MjData`` at the start.
        feet: names of the feet's spheres.
    """

    def __init__(self, model: Any, data: Any, feet: Sequence[str]) -> None:
        self._model, self._data = model, data
        self._feet = [int(model.geom(name).id) for name in feet]
        self._height = float(data.qpos[2])
        self._air = np.zeros(len(feet))
        self._all: list[float] = []
        self._settled: list[float] = []
        self._turn: list[float] = []
        self._command, self._since = np.zeros(3), 0.0
        self.slip = self.energy = self.path = self.time = 0.0
        self.steps = 0
        self.fell = False

    def look(self, command: Vector) -> None:
        """Take up the state at which the last step began, and its forces.

        Args:
            command: (3,) forward, to the left, turning, m/s and rad/s.
        """
        mujoco = import_mujoco()
        model, data, dt = self._model, self._data, float(self._model.opt.timestep)
        if not np.array_equal(command, self._command):
            self._command, self._since = np.array(command), 0.0
        speed, on = sliding(model, data, self._feet)
        self.slip += dt * float(speed.sum())
        self.steps += int(np.sum(on & (self._air >= AIR)))
        self._air = np.where(on, 0.0, self._air + dt)
        self.energy += dt * float(np.maximum(data.actuator_force * data.actuator_velocity, 0.0).sum())
        turned = data.xmat[1].reshape(3, 3)
        heading = turned[:2, 0] / np.linalg.norm(turned[:2, 0])
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, velocity, 0)
        ahead, aside = velocity[3:5] @ heading, velocity[4] * heading[0] - velocity[3] * heading[1]
        self.path += dt * float(np.hypot(velocity[3], velocity[4]))
        error = float((ahead - command[0]) ** 2 + (aside - command[1]) ** 2)
        self._all.append(error)
        if self._since >= SETTLED:
            self._settled.append(error)
            self._turn.append(float(velocity[2] - command[2]) ** 2)
        self._since, self.time = self._since + dt, self.time + dt
        self.fell = bool(data.xpos[1, 2] < LOWEST * self._height or turned[2, 2] < UPRIGHT)

    def measures(self) -> dict[str, Any]:
        """Of the walk so far; None where there was nothing to measure."""
        weight = GRAVITY * float(self._model.body_subtreemass[1])
        return {
            "fell": self.fell,
            "stood_s": self.time,
            "slip_mm_per_step": 1e3 * self.slip / max(self.steps, 1),
            "steps_per_s": self.steps / self.time,
            "error_m_s": _rms(self._all),
            "settled_error_m_s": _rms(self._settled),
            "settled_turn_error_rad_s": _rms(self._turn),
            "joint_power_w": self.energy / self.time,
            "cost_of_transport": self.energy / (weight * self.path),
        }


def sliding(model: Any, data: Any, feet: Sequence[int]) -> tuple[Vector, np.ndarray]:
    """(feet,) speed along the ground of what touches it, m/s, and whether a foot is in contact.

    A foot that rolls does not slide.

    Args:
        model: ``mujoco.MjModel``; the ground is level.
        data: ``mujoco.MjData``.
        feet: numbers of geoms.
    """
    mujoco = import_mujoco()
    speed, on = np.zeros(len(feet)), np.zeros(len(feet), dtype=bool)
    force, velocity = np.zeros(6), np.zeros(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        foot = next((geom for geom in contact.geom if geom in feet), None)
        mujoco.mj_contactForce(model, data, k, force)
        if foot is None or force[0] <= 0.0:
            continue
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, foot, velocity, 0)
        (p, q, r), (x, y, z) = velocity[:3], contact.pos - data.geom_xpos[foot]
        place = feet.index(foot)
        speed[place], on[place] = np.hypot(velocity[3] + q * z - r * y, velocity[4] + r * x - p * z), True
    return speed, on


def _rms(squares: list[float]) -> float | None:
    return float(np.sqrt(np.mean(squares))) if squares else None
