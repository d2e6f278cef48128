"""Random trees with contacts and tasks for the whole-body optimum."""

import numpy as np
import pinocchio as pin
from random_trees import random_model

import harpy_pin as hp
from comparison.measure.optimum_cases import Case


def random_tree(seed):
    """A tree with joints of all kinds, point feet and a sole anywhere on it, and tasks of any
    frames and joints.
    """
    model, rng = random_model(seed)
    bodies = rng.integers(2, model.njoints, size=3)
    feet = []
    for n, joint in enumerate(bodies):
        turn = pin.exp3(rng.normal(size=3))
        for corner in (
            ((0.1, 0.1), (0.1, -0.1), (-0.1, 0.1), (-0.1, -0.1)) if n == 2 else ((0.0, 0.0),)
        ):
            feet.append(f"foot{len(feet)}")
            place = pin.SE3(turn, turn @ np.array((*corner, 0.3)))
            model.addFrame(pin.Frame(feet[-1], int(joint), 0, place, pin.FrameType.OP_FRAME))
    for n, joint in enumerate(rng.integers(1, model.njoints, size=2)):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        model.addFrame(pin.Frame(f"task{n}", int(joint), 0, place, pin.FrameType.OP_FRAME))
    tasks = {
        hp.FrameTask("task0", part="both", axes="local"): rng.uniform(0.1, 2.0, 6),
        hp.FrameTask("task1"): rng.uniform(0.1, 2.0, 3),
        hp.FrameTask("task1", root="task0", part="both"): rng.uniform(0.1, 2.0, 6),
        hp.FrameTask("foot0", root="task1", axes="local"): rng.uniform(0.1, 2.0, 3),
        hp.CentreOfMassTask(): rng.uniform(0.1, 5.0, 3),
        hp.JointTask(tuple(model.names)[2::2]): rng.uniform(0.01, 1.0, 4),
    }
    robot = hp.Robot(model, None, tuple(feet), (), np.inf, flat_feet=(1, 1, 4))
    case = Case(robot, pin.neutral(model), tasks, tuple(rng.integers(0, 2, 3)), 1e-2, 1e-3)
    return case, rng
