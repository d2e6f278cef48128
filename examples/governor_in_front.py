"""A governor in front of any controller, with a constraint of one's own beside the paper's."""

import numpy as np

import harpy_pin as hp
from harpy_pin.model import Vector


class SpeedRow:
    """Keeps the applied velocity along x under a limit: h = v_max − ẋ_w ≥ 0."""

    names = ("forward speed",)

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        h[0] = self.limit - w[3]
        jacobian[0] = (0.0, 0.0, 0.0, -1.0, 0.0, 0.0)


robot = hp.load_harpy()
rows = hp.governors.StackedRows([hp.governors.ForceRows(mass=robot.mass, mu=0.4), SpeedRow(0.4)])
governor = hp.ExplicitReferenceGovernor(rows)

# Any controller that tracks [c; ċ] can stand behind it; here a spring and a damper on a point mass.
position, velocity, foot = np.array([0.0, 0.0, 0.6]), np.zeros(3), np.zeros(3)
governor.reset(np.concatenate((position, velocity)))
dt, fastest = 1e-3, 0.0
for k in range(2000):
    foot[0] = position[0] - 0.05  # the foot trails the body
    target = np.array([0.8 * k * dt, 0.0, 0.6, 0.8, 0.0, 0.0])  # asks for 0.8 m/s
    measured = np.concatenate((position, velocity, foot))
    applied = governor.update(measured, target, dt)
    velocity += dt * (100.0 * (applied[:3] - position) + 20.0 * (applied[3:] - velocity))
    position += dt * velocity
    fastest = max(fastest, applied[3])
print(f"asked for 0.80 m/s, applied at most {fastest:.3f} m/s")
print(f"violated by the target: {governor.status.active}")
