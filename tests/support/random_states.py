"""States that no walk comes near."""

import numpy as np
import pinocchio as pin

import harpy_pin as hp

LEGS = ("anyhow", "straight", "nearly straight", "folded", "beyond the limits")
KNEES = [2, 5]


def draw(robot, rng, *, legs=None, feet=None):
    """A state that no walk comes near; ``feet`` says which of them measure a force."""
    q = np.concatenate((rng.uniform(-1.0, 1.0, 3), rng.standard_normal(4), np.zeros(6)))
    q[3:7] /= np.linalg.norm(q[3:7])
    if rng.random() < 0.3:
        q[3:7] = pin.Quaternion(pin.exp3(0.3 * rng.standard_normal(3))).coeffs()
    legs = legs if legs is not None else LEGS[rng.integers(len(LEGS))]
    joints = rng.uniform(robot.joint_lower, robot.joint_upper)
    if legs == "straight":
        joints[:] = 0.0
    elif legs == "nearly straight":
        joints[KNEES] = 10.0 ** rng.uniform(-9.0, -1.0, 2)
    elif legs == "folded":
        joints[KNEES] = np.pi - 10.0 ** rng.uniform(-9.0, -1.0, 2)
    elif legs == "beyond the limits":
        joints = rng.uniform(-np.pi, np.pi, 6)
    q[7:] = joints
    v = 10.0 ** rng.uniform(-2.0, 1.6) * rng.standard_normal(12)
    force = np.zeros((2, 3))
    for k in range(2):
        if (rng.random() < 0.7) if feet is None else feet[k]:
            force[k] = 10.0 ** rng.uniform(0.5, 4.0) * rng.uniform((-1.0, -1.0, 0.5), 1.0)
    return hp.State(
        rng.uniform(0.0, 10.0),
        q,
        v,
        rng.standard_normal((2, 3)),
        rng.standard_normal((2, 3)),
        force,
    )
