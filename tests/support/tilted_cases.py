"""Harpy near standing on feet whose grounds have normals of their own, and a gait that says so."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
from whole_body_oracle import NV, ROBOT, STANDING, SUPPORTS, WEIGHTS, oracle

import harpy_pin as hp
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.model.state import State
from harpy_pin.wbc import WholeBodyLimits

LOAD = 20.0
"""Measured on a foot that is held, along its normal, N."""


class GivenTargets(hp.Gait):
    """A gait that has the targets that it was given."""

    double_support = 1.0

    def __init__(self, robot: hp.Robot = ROBOT) -> None:
        super().__init__(robot)

    def update(self, t: float) -> GaitTarget:
        return self.target

    def initial_state(self, *, penetration: float = 0.0):
        return STANDING.copy(), np.zeros(NV)

    def describe(self):
        return {}


def smallest_rotation(normal: np.ndarray) -> np.ndarray:
    """The rotation from the vertical to a normal, by Pinocchio."""
    return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()


def random_normal(rng: np.random.Generator, steepest: float) -> np.ndarray:
    angle, heading = rng.uniform(0.0, steepest), rng.uniform(-np.pi, np.pi)
    return np.array(
        [np.sin(angle) * np.cos(heading), np.sin(angle) * np.sin(heading), np.cos(angle)]
    )


def fill(
    target: GaitTarget, rng: np.random.Generator, *, steepest: float = 0.7, size: float = 2.0
) -> None:
    """Random targets of the body, and random normals; which feet carry, too."""
    target.body[:] = 0.0
    target.body[:3] = STANDING[:3]
    target.body[6:] = rng.uniform(-size, size, 3)
    target.foot_acceleration[:] = rng.uniform(-size, size, (2, 3))
    target.stance[:] = (*SUPPORTS[:3], SUPPORTS[0])[rng.integers(4)]
    target.phase[:] = np.where(target.stance > 0.0, 0.5, 0.2)
    target.ground_height[:] = -10.0  # what touches is said by the forces
    for normal in target.normal:
        normal[:] = random_normal(rng, steepest)
    target.force[:] = rng.spawn(1)[0].uniform(-LOAD, LOAD, (2, 3))


def random_state(rng: np.random.Generator, target: GaitTarget, *, spread: float = 0.1) -> State:
    """A state near standing, with a load along the normal of every foot that carries."""
    q = pin.integrate(ROBOT.model, STANDING, spread * rng.standard_normal(NV))
    v = 3.0 * spread * rng.standard_normal(NV)
    force = LOAD * target.stance[:, None] * target.normal
    return State(0.1, q, v, np.zeros((2, 3)), np.zeros((2, 3)), force)


def parameters(limits: WholeBodyLimits, **settings) -> WholeBodyParameters:
    return WholeBodyParameters.for_gait(
        hp.make_gait(ROBOT), weights=WEIGHTS, limits=limits, **settings
    )


def sloped_case(controller, rng: np.random.Generator, *, spread: float = 0.1):
    """A random state on random normals, the command at it, and the independent program that it
    should solve.
    """
    target = controller.gait.target
    fill(target, rng)
    state = random_state(rng, target, spread=spread)
    controller.reset()
    command = controller.step(state)
    frames = np.array([smallest_rotation(normal) for normal in target.normal])
    own, given = controller.targets, controller.parameters
    feet = np.einsum("kij,kj->ki", frames, own.feet)
    others = {
        name: getattr(own, name)
        for name in ("body", "orientation", "joints", "held", "force_range")
    }
    world = SimpleNamespace(feet=feet, force=target.force, **others)
    return (
        state,
        command,
        oracle(state.q, state.v, world, given.limits, given.weights, frames=frames),
    )
