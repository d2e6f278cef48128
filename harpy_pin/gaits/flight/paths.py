"""Ways of the body through the air, as functions of the time: polynomials, and a jump that is braked by thrust."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, perm, sqrt

import numpy as np

from harpy_pin.model.state import Vector

__all__: list[str] = []

GRAVITY = 9.81
"""m/s²."""
SWIFT = 10.0 / sqrt(3.0)
"""Largest acceleration of a quintic from rest to rest over one metre in one second, m/s²."""


class Quintic:
    """A polynomial of fifth order through two states.

    Args:
        start: (3, n) position, velocity and acceleration.
        end: (3, n) likewise.
        duration: s; before and after it the way stands still.
    """

    def __init__(self, start: Vector, end: Vector, duration: float) -> None:
        self.duration = duration
        rows = [
            [perm(n, d) * t ** (n - d) if n >= d else 0.0 for n in range(6)] for t in (0.0, duration) for d in range(3)
        ]
        self._way = np.linalg.solve(np.array(rows), np.vstack((start, end)))

    def at(self, t: float) -> Vector:
        """(3, n) position, velocity and acceleration.

        Args:
            t: time since its begin, s.
        """
        s = min(max(t, 0.0), self.duration)
        found = np.array([sum(perm(n, d) * s ** (n - d) * self._way[n] for n in range(d, 6)) for d in range(3)])
        if t > self.duration:
            found[0] += (t - self.duration) * found[1]
            found[2] = 0.0
        return found


def rest(place: Vector) -> Vector:
    """(3, n) position, velocity and acceleration of what stands still."""
    return np.vstack((place, np.zeros((2, len(place)))))


@dataclass(frozen=True)
class Fall:
    """Height of a body that is thrown up, falls freely, is braked, and then sinks at a constant speed.

    Thrust is switched on and off, and follows by its lag T. So the true velocity is v − T (a + g) and the true height
    z − T (v_true − v₀ + g t), with v and z those without lag and a the true acceleration.

    Attributes:
        height: where it begins, m.
        speed: upwards, there, m/s.
        ground: height at which it has the touchdown's speed, m.
        touchdown: that speed, downwards, m/s.
        brake: acceleration upwards while it is braked, m/s².
        gravity: acceleration downwards until then, g, m/s².
        lag: of the thrust, T, s.
    """

    height: float
    speed: float
    ground: float
    touchdown: float
    brake: float
    gravity: float = GRAVITY
    lag: float = 0.0

    @property
    def free(self) -> float:
        """Duration of the free flight, s: its end has just the speed that the brake takes away until touchdown."""
        g, b, v, lag = self.gravity, self.brake, self.speed, self.lag
        end = self.touchdown - lag * g  # speed without lag
        rest = v * v - end**2 - 2.0 * b * (self.height - self.ground) - 2.0 * lag * (b * self.touchdown + g * end)
        # g (g + b) (t + T)² − 2 v (g + b) (t + T) + rest = g (g + b) T², the later one
        return v / g - lag + sqrt(max((v / g) ** 2 + lag * lag - rest / (g * (g + b)), 0.0))

    @property
    def braked(self) -> float:
        """Duration of the braking, s."""
        return max(self.gravity * (self.free + self.lag) - self.speed - self.touchdown, 0.0) / self.brake

    def at(self, t: float) -> tuple[float, float, float]:
        """Height, velocity and acceleration.

        Args:
            t: time since its begin, s.
        """
        free = min(t, self.free)
        g = self.gravity
        z, v, a = self.height + (self.speed - 0.5 * g * free) * free, self.speed - g * free, -g
        if t > self.free:
            s = min(t - self.free, self.braked)
            z, v, a = z + (v + 0.5 * self.brake * s) * s, v + self.brake * s, self._follow(a, self.brake, s)
        late = t - self.free - self.braked
        if late > 0.0:
            z, a = z + late * v, self._follow(a, 0.0, late)
        true = v - self.lag * (a + g)
        return z - self.lag * (true - self.speed + g * t), true, a

    def _follow(self, start: float, goal: float, time: float) -> float:
        """An acceleration that follows another one."""
        return goal + (start - goal) * exp(-time / self.lag) if self.lag > 0.0 else goal
