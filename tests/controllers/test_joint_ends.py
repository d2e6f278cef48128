"""Joints on no limb come to rest before their ends."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long import long_but
from needs import needs_robots
from walks import own_search, walked

import harpy_pin as hp
from harpy_pin.controllers.tasks import BRAKE, MARGIN, NEAR, STIFFER, _stay_in_range

shares = st.floats(0.0, 1.0)


@cache
def humanoid(name="icub"):
    gait = hp.WalkingGait(hp.load_robot(name), "step")
    return hp.make_controller("condensed", gait, mu=0.6)


@needs_robots
@given(where=shares, fast=shares, up=st.booleans(), j=st.integers(0, 200))
@settings(max_examples=30)
def test_a_joint_that_follows_its_task_stays_in_its_range(where, fast, up, j):
    """From wherever a deceleration within the bound is enough, whatever the posture pulls."""
    controller = humanoid()
    tasks, targets = controller._record_["tasks"], controller._record_["targets"]
    low, high = tasks["ends"][0]
    ends = np.flatnonzero(np.isfinite(low) & (high - low > 4.0 * MARGIN))
    j = int(ends[j % len(ends)])
    angle = low[j] + MARGIN + where * (high[j] - low[j] - 2.0 * MARGIN)
    room = (high[j] - angle if up else angle - low[j]) - MARGIN
    speed = (1.0 if up else -1.0) * fast * np.sqrt(2.0 * BRAKE * max(room, 0.0))
    gains, rest = tasks["posture"][0], tasks["rest"][0, j]
    angles, speeds = tasks["rest"][0].copy(), np.zeros(len(tasks["rest"][0]))
    dt = 1e-3
    for _ in range(1500):
        targets["joints"][0, j] = gains[0] * (rest - angle) - gains[1] * speed
        angles[j], speeds[j] = angle, speed
        _stay_in_range(tasks, targets, angles, speeds)
        acceleration = targets["joints"][0, j]
        assert 1.0 <= targets["joint_share"][0, j] <= 1.0 + STIFFER
        angle += dt * (speed + 0.5 * dt * acceleration)
        speed += dt * acceleration
        assert low[j] < angle < high[j]


@needs_robots
def test_far_from_their_ends_joints_are_free():
    controller = humanoid("g1")
    tasks, targets = controller._record_["tasks"], controller._record_["targets"]
    ends = tasks["ends"][0]
    free = np.isfinite(ends[0])
    on_limbs = [
        j
        for j, name in enumerate(controller.robot.joints)
        if any(w in name for w in ("hip", "knee", "ankle"))
    ]
    assert free.sum() == len(free) - len(on_limbs)
    assert not free[on_limbs].any()
    for j, speed in enumerate(
        0.9 * NEAR * np.sqrt(2.0 * BRAKE * np.maximum(ends[1] - tasks["rest"][0] - MARGIN, 0.0))
    ):
        targets["joints"][0, j] = 3.0
        speeds = np.zeros(len(free))
        speeds[j] = min(speed, 1e3)
        _stay_in_range(tasks, targets, tasks["rest"][0], speeds)
        assert targets["joints"][0, j] == 3.0
        assert targets["joint_share"][0, j] == 1.0


@needs_robots
@pytest.mark.parametrize(
    ("kind", "side"), long_but(product(("condensed", "wbc"), (1.0, -1.0)), (("condensed", -1.0),))
)
def test_pushed_forward_and_aside_the_torso_stays_in_its_range(kind, side):
    """It would come to its ends, 0.1 rad into what stops it in MuJoCo, and fall when pushed to the
    right.
    """
    robot = hp.load_robot("icub")
    push = hp.Push(2.1, (0.28 * robot.mass, side * 0.28 * robot.mass, 0.0))
    gait = hp.Walking(schedule="step")
    run = walked(
        robot="icub",
        plant="mujoco",
        controller={"name": kind, "parameters": own_search(kind)},
        gait=gait,
        mu_s=0.6,
        pushes=(push,),
        duration=3.5,
    )
    assert run.ending == "completed"
    torso = [j for j, name in enumerate(robot.joints) if "torso" in name]
    beyond = np.maximum(robot.joint_lower - run["q"][:, 7:], run["q"][:, 7:] - robot.joint_upper)[
        :, torso
    ]
    assert beyond.max() < 0.01
