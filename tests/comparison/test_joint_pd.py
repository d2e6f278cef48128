"""The joint PD controller that walks beside law and QP: kinematics, feedforward, and the search for
its gains.
"""

from dataclasses import asdict

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from comparison.joint_pd.__main__ import SPACE, search_gains
from comparison.joint_pd.controller import JointPD, JointPDGains, found_gains
from comparison.studies.walking import PD_ROBOTS, job_of, scenario, walked

pytestmark = needs_robots


def standing(name: str, **gains: float) -> tuple[JointPD, hp.State]:
    """A controller, and the posture with every foot loaded."""
    gait = hp.WalkingGait(hp.load_robot(name), "stand" if name != "bolt" else None)
    q, v = gait.initial_state()
    feet = np.zeros((len(gait.robot.feet), 3))
    force = feet.copy()
    force[:, 2] = gait.robot.mass * 9.81 / len(feet)
    return JointPD(gait, JointPDGains(**gains), mu=0.6), hp.State(0.0, q, v, feet, feet, force)


@pytest.mark.parametrize("name", ["solo12", "anymal_c", "g1"])
def test_feedforward_alone_holds_the_robot_that_stands(name):
    """Without stiffness: the body accelerates as the gait asks under its torques and the forces
    that go with them.
    """
    pd, state = standing(name, stance_p=0.0, stance_d=0.0)
    for t in (0.0, 1e-3):
        state.t = t
        torque = pd.step(state).torque
    model, data = pd.robot.model, pd.robot.model.createData()
    pin.computeJointJacobians(model, data, state.q)
    pin.updateFramePlacements(model, data)
    force = pd._record["force"][0].reshape(-1, 3)
    wanted = np.concatenate((pd.gait.target.body[6:8], np.zeros(model.nv - 2)))
    total = pin.rnea(model, data, state.q, state.v, wanted)
    for k, foot in enumerate(pd.robot.feet):
        rows = pin.getFrameJacobian(model, data, pd.robot.frame_id(foot), pin.LOCAL_WORLD_ALIGNED)[
            :3
        ]
        total -= rows.T @ force[k]
    weight = pd.robot.mass * 9.81
    np.testing.assert_allclose(total[6:], torque, atol=1e-9)
    np.testing.assert_allclose(total[:3], 0.0, atol=1e-3 * weight)
    np.testing.assert_allclose(force[:, 2].sum(), weight, rtol=1e-3)


@pytest.mark.parametrize("name", ["solo12", "bolt", "g1"])
def test_joint_targets_are_the_inverse_kinematics_of_the_feet(name):
    """A body that hangs too low and is tilted: the targets set it upright, at its height, above
    feet that stay.
    """
    pd, state = standing(name)
    state.q[2] -= 0.01
    state.q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.03, -0.02, 0.0)).coeffs()
    robot, data = pd.robot, pd.robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, state.q)
    feet = [data.oMf[robot.frame_id(foot)].translation.copy() for foot in robot.feet]
    pd.step(state)
    for _ in range(2000):
        pd.step(
            state
        )  # at the same time: nothing moves but Newton's method, and a body that is to go down
    upright = np.concatenate(
        (
            state.q[:2],
            pd.gait.record["build"]["height"],
            (0.0, 0.0, 0.0, 1.0),
            pd._record["planned"][0][7:],
        )
    )
    pin.framesForwardKinematics(robot.model, data, upright)
    for k, foot in enumerate(robot.feet):
        if pd.gait.target.stance[k]:
            np.testing.assert_allclose(
                data.oMf[robot.frame_id(foot)].translation, feet[k], atol=2e-4
            )


def test_joints_of_no_leg_hold_and_light_ones_have_smaller_gains():
    """Of G1's waist and arms; a motor's damping stops no joint at more than 500 1/s."""
    pd, state = standing("g1")
    pd.step(state)
    before = pd.step(state).torque.copy()
    joint = pd.robot.joints.index("left_elbow_joint")
    state.v[6 + joint] = 1e-3
    damping = -(pd.step(state).torque - before)[joint] / 1e-3
    robot, data = pd.robot, pd.robot.model.createData()
    inertia = 1.0 / pin.computeMinverse(robot.model, data, state.q)[6 + joint, 6 + joint]
    assert 0.0 < damping < 500.0 * inertia * (1.0 + 1e-3)
    with pytest.raises(
        ValueError,
        match=r"3 joints on point feet, or of 6 on soles; those of 'solo8.*\[2, 2, 2, 2\]",
    ):
        JointPD(hp.WalkingGait(hp.load_robot("solo8"), "stand"), JointPDGains(), mu=0.6)


def test_loop_in_c_and_loop_in_python_give_the_same_bits():
    course = scenario(job_of("solo12", "course", 0.8, 3))

    def make(gait):
        return JointPD(gait, JointPDGains(), mu=course.mu)

    compiled = hp.walk(course, controller=make)
    python = hp.walk(course, controller=make, on_tick=lambda state: None)
    for name in ("q", "torque", "stance", "path"):
        np.testing.assert_array_equal(compiled[name], python[name])


def test_the_search_finds_the_least_of_a_known_cost():
    at = {"stance_p": 5.0, "stance_d": 0.1, "swing_p": 1.0, "swing_d": 1.0, "follow": 0.2}
    tried = []

    def cost(gains: JointPDGains, most: float) -> float:
        tried.append(asdict(gains))
        return float(sum(np.log(value / at[name]) ** 2 for name, value in asdict(gains).items()))

    best, least = search_gains(cost)
    assert len(tried) == 60
    assert least == cost(best, np.inf) < 0.2 * cost(JointPDGains(), np.inf)
    default = asdict(JointPDGains())
    for name, span in SPACE.items():
        assert all(
            0.999 * span.low <= gains[name] / default[name] <= 1.001 * span.high for gains in tried
        )
    best, least = search_gains(cost, start=JointPDGains(**at))
    assert asdict(best) == pytest.approx(at)
    assert least < 1e-20


def test_every_robot_has_gains_and_stands_a_walk_with_them():
    assert set(found_gains()) == set(PD_ROBOTS)
    row = walked(job_of("solo12", "pushed", 3.0, 4, controller="joint_pd"))
    assert not row["fell"]
    assert row["slip_mm_per_step"] < 10.0
