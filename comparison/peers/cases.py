"""The cases: robots that stand and are pushed, and that walk, recorded in the closed loop of the
condensed WBC.

A robot that stands shifts its weight all the time. One that walks begins to do so after some tenths
of a second, from which on its ticks count: they go through touchdown and lift-off. G1 on points has
the states of G1 on its soles, and a point in the middle of each.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.measure.walking import StateSequence, record_states, recorded_walk, standing_ground
from comparison.peers.peer_problem import Case, common_program

FRICTION = 0.6
"""Of the ground of all but Harpy."""
HARPY = ("governed/paper", "condensed")
"""Whose walks give Harpy's states."""
SHIFT_PERIOD = 2.0
"""Time in which the weight is shifted and comes back, s."""
SHIFT = 0.3
"""Share of the way from above the middle to above the first foot."""
PUSHES = ((0.5, (0.0, 1.0)), (1.0, (1.0, 0.0)), (1.5, (0.0, -1.0)))
"""Times, s, and horizontal directions."""
PUSH = 0.05
"""Impulse of a push over the mass, m/s."""
FREE_ANKLES = 10.0
"""Weight of the legs' joints on points: only that cost decides the accelerations of the ankles."""


def _harpy(duration: float, warm_up: int, friction: float) -> Case:
    robot = replace(hp.load_harpy(), thrust_limit=np.inf)
    gait = hp.make_gait(robot)
    runs = {name: recorded_walk(name, friction=friction, duration=duration) for name in HARPY}
    sequences = tuple(record_states(name, run, least=warm_up + 50) for name, run in runs.items())
    return Case("harpy, walks", gait, sequences, common_program(gait, friction), warm_up)


def _stands(name: str, contacts: str, duration: float, warm_up: int) -> Case:
    gait = _standing(hp.load_robot(name))
    sequence = _recorded(name, gait, duration, warm_up, PUSH)
    return Case(
        f"{name}{contacts}, stands", gait, (sequence,), common_program(gait, FRICTION), warm_up
    )


def _standing(robot: hp.Robot) -> hp.Standing:
    return hp.Standing(robot, shift=SHIFT * hp.Standing(robot).over(0), shift_period=SHIFT_PERIOD)


def _stands_on_points(name: str, duration: float, warm_up: int) -> Case:
    """The states of :func:`_stands` on soles, with a point in the middle of each."""
    soles = _standing(hp.load_robot(name))
    q, _ = soles.initial_state()
    feet = hp.model.CATALOGUE[name].feet
    robot, shift = hp.load_robot(name, feet=feet), SHIFT * soles.over(0)
    gait = hp.Standing(robot, q[7:], shift=shift, shift_period=SHIFT_PERIOD)
    dynamics = hp.Dynamics(robot)
    states = []
    for state in _recorded(name, soles, duration, warm_up, PUSH).states:
        dynamics.update(state.q, state.v)
        force = state.foot_force.reshape(len(feet), -1, 3).sum(axis=1)
        points = dynamics.foot_position.copy(), dynamics.foot_velocity.copy()
        states.append(hp.State(state.t, state.q, state.v, *points, force))
    sequence = StateSequence(name, tuple(states))
    program = common_program(gait, FRICTION, posture=FREE_ANKLES)
    return Case(f"{name} on points, stands", gait, (sequence,), program, warm_up, ankles=True)


def _walks(name: str, contacts: str, speed: float, duration: float, warm_up: int) -> Case:
    gait = hp.WalkingGait(hp.load_robot(name), velocity=(speed, 0.0, 0.0))
    sequence = _recorded(name, gait, duration, warm_up, 0.0)
    first = np.flatnonzero(
        [is_lifted(gait.robot, state) for state in sequence.states[warm_up:]]
    )  # it stands before
    begin = warm_up + int(first[0]) if len(first) else warm_up
    return Case(
        f"{name}{contacts}, walks", gait, (sequence,), common_program(gait, FRICTION), begin
    )


def is_lifted(robot: hp.Robot, state: hp.State) -> bool:
    """Whether a foot bears nothing: of a sole, all its corners."""
    load = np.add.reduceat(state.foot_force[:, 2], np.cumsum((0, *robot.corners))[:-1])
    return bool((load <= 0.0).any())


def _recorded(name: str, gait: hp.Gait, duration: float, least: int, push: float) -> StateSequence:
    """The states of a walk, or of a stand with impulses of ``push`` over the mass, m/s."""
    robot, times = gait.robot, [pushed for pushed in PUSHES if push and pushed[0] < duration]
    pushes = tuple(
        hp.Push(t, (robot.mass * push * x, robot.mass * push * y, 0.0)) for t, (x, y) in times
    )
    scenario = hp.Scenario(
        controller="condensed",
        ground=standing_ground(robot, FRICTION) if push else hp.Ground(mu_s=FRICTION),
        disturbances=hp.Disturbances(pushes=pushes),
        duration=duration,
    )
    run = hp.walk(scenario, gait=gait)
    if run.ending != "completed":
        raise hp.HarpyError(
            f"{name} {run.ending} at {run['t'][-1]:.2f} s: its states are those of no robot that "
            f"walks"
        )
    return record_states(name, run, least=least)


def cases(*, friction: float, duration: float, warm_up: int) -> dict[str, Callable[[], Case]]:
    """What makes each case, by its name.

    Args:
        friction: coefficient of Harpy's ground.
        duration: of a recording, s.
        warm_up: ticks at the start of each recording that are not counted.
    """
    how: dict[str, Any] = {"duration": duration, "warm_up": warm_up}
    made: dict[str, Callable[[], Case]] = {
        "harpy, walks": partial(_harpy, friction=friction, **how)
    }
    for name, speed in (("solo12", 0.3), ("go2", 0.5)):
        made[f"{name}, stands"] = partial(_stands, name, "", **how)
        made[f"{name}, walks"] = partial(_walks, name, "", speed, **how)
    made["g1 on points, stands"] = partial(_stands_on_points, "g1", **how)
    for name in ("g1", "talos"):
        made[f"{name} on soles, stands"] = partial(_stands, name, " on soles", **how)
        made[f"{name} on soles, walks"] = partial(_walks, name, " on soles", 0.3, **how)
    return made
