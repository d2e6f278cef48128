"""A kernel of one's own: a damped spring that C steps through, beside the same in NumPy."""

from typing import Any

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, make_record


class SpringRecord(RecordOf):
    """A mass on a spring in space."""

    mass: float  # kg
    stiffness: float  # N/m
    damping: float  # N·s/m
    position: np.ndarray  # (3,) m
    velocity: np.ndarray  # (3,) m/s


@kernel
def swing(s: SpringRecord, dt: float, steps: int) -> float:
    """Semi-implicit Euler steps of m a = −k x − d v; returns the energy, J."""
    for _ in range(steps):
        s.velocity[:] += dt / s.mass * (-s.stiffness * s.position - s.damping * s.velocity)
        s.position[:] += dt * s.velocity
    twice = s.mass * (s.velocity @ s.velocity) + s.stiffness * (s.position @ s.position)
    return float(0.5 * twice)


def swing_in_numpy(s: Any, dt: float, steps: int) -> float:
    x, v = s["position"], s["velocity"]
    for _ in range(steps):
        v += dt / s["mass"] * (-s["stiffness"] * x - s["damping"] * v)
        x += dt * v
    return float(0.5 * (s["mass"] * (v @ v) + s["stiffness"] * (x @ x)))


start, zero = np.array([0.1, 0.0, -0.2]), np.zeros(3)
ours, numpys = (
    make_record(SpringRecord, mass=2.0, stiffness=50.0, damping=0.3, position=start, velocity=zero)
    for _ in range(2)
)
energy = swing(ours, 1e-3, 5000)
assert abs(energy - swing_in_numpy(numpys[0], 1e-3, 5000)) < 1e-15
np.testing.assert_array_equal(ours["position"], numpys["position"])
print(f"after 5 s {energy:.6f} J are left, as in NumPy; this is the C:")
print(swing.c_source(ours, 1e-3, 5000).partition("real swing")[2].partition("\n}")[0])
