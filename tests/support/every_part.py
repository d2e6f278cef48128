"""One short use of every part of the library that has kernels, beside the walks of ``harpy
compile``.

    python tests/support/every_part.py [ROBOT]...

hatch_build.py compiles with it what a wheel for one platform holds; in an environment with that
wheel alone it shows that nothing is missing. It prints a line for each part, and ends with 1 where
one fails. What a robot cannot have is no failure.
"""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.gym import HarpyEnv, HarpyVectorEnv, RobotEnv
from harpy_pin.errors import HarpyError, InputError, reason
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.source import loaded_robot
from harpy_pin.scenario import gaits_of

TARGETS = {"joint_stiffness": 1.0, "joint_damping": 0.3}
"""Parameters of a controller whose commands have joint targets."""
DURATION = 0.6
"""Of each walk, s, as of ``harpy compile``."""


def parts(name: str) -> Iterator[tuple[str, Callable[[], object]]]:
    """Uses of a robot, by what they are."""
    for gait in gaits_of(name):
        for words, given in (
            ("MuJoCo", {"plant": "mujoco"}),
            ("estimator", {"state": "estimated"}),
            ("joint targets", {"controller": hp.Condensed(parameters=TARGETS)}),
            ("joint targets of the QP", {"controller": hp.WholeBody(parameters=TARGETS)}),
            (
                "joint targets in MuJoCo",
                {"controller": hp.Condensed(parameters=TARGETS), "plant": "mujoco"},
            ),
            (
                "friction estimate",
                {"controller": hp.Condensed(parameters={"estimate_friction": True})},
            ),
        ):
            scenario = {"robot": name, "gait": gait, "duration": DURATION, **given}
            yield f"{words}, gait '{gait}'", lambda given=scenario: hp.walk(hp.Scenario(**given))
    yield "bridge", lambda: cross_bridge(name)
    yield "batch", lambda: step_batch(name)
    for action in ("velocity", "joints"):
        yield (
            f"environment, {action}",
            lambda action=action: step_environment(RobotEnv(name, action=action)),
        )
    if name == "harpy":
        for shield in (False, True):
            yield (
                f"environment, shield {shield}",
                lambda shield=shield: step_environment(HarpyEnv(shield=shield)),
            )
        yield "environments", lambda: step_environment(HarpyVectorEnv(2))


def cross_bridge(name: str) -> None:
    """A step of a controller in a simulation of one's own, of the model that the MuJoCo plant
    has.
    """
    walk = hp.build(hp.Scenario(robot=name, plant="mujoco"))
    model, controller = walk.simulator.model, walk.controller
    state, bridge = controller.gait.initial_state(), hp.MujocoBridge(model, loaded_robot(name))
    data = mujoco.MjData(model)
    bridge.place(state, data)
    bridge.write(controller.step(bridge.read(data)), data)
    bridge.self_contacts(state[0])


def step_batch(name: str) -> None:
    """Two robots of one kind."""
    robot, state = (
        loaded_robot(name),
        hp.build(hp.Scenario(robot=name)).controller.gait.initial_state(),
    )
    batch = CondensedBatch(robot, 2)
    batch.step(*(np.tile(part, (2, 1)) for part in state), np.zeros((2, len(robot.feet), 3)))


def step_environment(env: HarpyEnv | HarpyVectorEnv | RobotEnv) -> None:
    """Some steps."""
    env.reset(seed=0)
    for _ in range(3):
        env.step(0.1 * np.ones(env.action_space.shape, np.float32))
    env.close()


def use(name: str, words: str, part: Callable[[], object]) -> bool:
    """Use a part; says whether it did what it should."""
    try:
        part()
    except InputError as error:
        print(f"{name}, {words}: not for it: {error}", flush=True)
    except HarpyError as error:
        print(f"{name}, {words}: FAILED: {reason(error)}", flush=True)
        return False
    else:
        print(f"{name}, {words}: done", flush=True)
    return True


def use_all(robots: list[str]) -> bool:
    """Use all parts of these robots; says whether all did."""
    with ThreadPoolExecutor() as threads:
        work = [threads.submit(use, name, *part) for name in robots for part in parts(name)]
        return all([one.result() for one in work])


if __name__ == "__main__":
    sys.exit(0 if use_all(sys.argv[1:] or ["harpy", *CATALOGUE]) else 1)
