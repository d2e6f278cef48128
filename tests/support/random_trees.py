"""Random trees with each kind of joint, and their states."""

import numpy as np
import pinocchio as pin

BODIES = 9
KINDS = ("revolute", "oblique", "continuous", "prismatic", "prismatic oblique")


def unit(rng):
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis)


def joint(kind, rng):
    if kind == "revolute":
        return (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)[rng.integers(3)]()
    if kind == "oblique":
        return pin.JointModelRevoluteUnaligned(unit(rng))
    if kind == "continuous":
        return (pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ)[rng.integers(3)]()
    if kind == "prismatic":
        return (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)[rng.integers(3)]()
    return pin.JointModelPrismaticUnaligned(unit(rng))


def random_model(seed):
    """A free flyer that carries a random tree with each kind of joint; their order, and so all
    sizes, are the same.
    """
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.name = "tree"
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
    for i in range(1, BODIES):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        parent = int(
            rng.choice(model.supports[i].tolist()[1:])
        )  # depth first, as Pinocchio wants it
        number = model.addJoint(parent, joint(KINDS[i % len(KINDS)], rng), place, f"joint{i}")
        root = rng.normal(size=(3, 3))
        inertia = pin.Inertia(
            rng.uniform(0.1, 3.0), rng.normal(size=3), root @ root.T + 0.1 * np.eye(3)
        )
        model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
    model.armature = np.concatenate((np.zeros(6), rng.uniform(0.0, 0.5, model.nv - 6)))
    model.gravity.linear = rng.uniform(-10, 10, 3)
    return model, rng


def random_state(model, rng, *, far=1.0):
    lower, upper = np.full(model.nq, -3.0), np.full(model.nq, 3.0)
    q = pin.randomConfiguration(model, lower, upper)
    q[:3] = far * rng.normal(size=3)
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    return pin.normalize(model, q), rng.normal(size=model.nv)
