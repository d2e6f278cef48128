"""Walks on soles: the body's target acceleration gives the centre of mass the demanded one, by Pinocchio's terms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from long import long_but
from needs import needs_robots
from walks import walk

import harpy_pin as hp
from harpy_pin.gaits.walking.body import demand_acceleration, write_targets
from harpy_pin.gaits.walking.measuring import measure

pytestmark = needs_robots

SIDES = [45 * k for k in range(8)]


def whole_body_acceleration(gait, q, v, feet):
    """Accelerations of base and joints if every task gets what it asks for."""
    robot, model, body = gait.robot, gait.robot.model, gait.target.body
    data, p = model.createData(), gait.parameters
    rotation = pin.Quaternion(*q[[6, 3, 4, 5]]).toRotationMatrix()
    error = pin.log3(pin.utils.rotate("z", gait.target.heading[0]).T @ rotation)
    a = np.zeros(model.nv)
    a[:3] = rotation.T @ body[6:9] - np.cross(v[3:6], v[:3])
    a[3:6] = -p["orientation"][0] * error - p["orientation"][1] * v[3:6]
    rest = gait.initial_state()[0][7:]
    a[6:] = p["posture"][0] * (rest - q[7:]) - p["posture"][1] * v[6:]
    legs, rows, wanted = [], [], []
    pin.computeJointJacobians(model, data, q)
    pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
    pin.updateFramePlacements(model, data)
    for name, acceleration in zip(robot.feet, feet, strict=True):
        frame = robot.frame_id(name)
        legs.extend(model.joints[j].idx_v for j in model.supports[model.frames[frame].parentJoint] if j > 1)
        rows.append(pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3])
        drift = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
        wanted.append(acceleration - drift)
    legs = sorted(set(legs))
    a[legs] = 0.0
    jacobian = np.vstack(rows)
    a[legs] = np.linalg.lstsq(jacobian[:, legs], np.concatenate(wanted) - jacobian @ a, rcond=1e-6)[0]
    return a


@pytest.mark.parametrize("name", ["icub", "g1"])
@pytest.mark.parametrize("in_air", [False, True])
def test_the_centre_of_mass_gets_what_the_pendulum_demands(name, in_air):
    robot, rng = hp.load_robot(name), np.random.default_rng(0)
    gait, data = hp.WalkingGait(robot), robot.model.createData()
    p, kp, kd = gait.record[0], *gait.parameters["swing"]
    starts = dict(zip(robot.feet, np.repeat(np.arange(2), robot.corners), strict=True))
    for _ in range(5):
        change = np.concatenate((np.zeros(3), 0.02 * rng.standard_normal(robot.model.nv - 3)))
        q = pin.integrate(robot.model, gait.initial_state()[0], change)
        v = np.concatenate((0.05 * rng.standard_normal(3), 0.05 * rng.standard_normal(robot.model.nv - 3)))
        assert measure(gait.record, q, v, np.zeros((len(robot.feet), 3)))
        middle, path = p["measured"]["place"][0], 0.01 * rng.standard_normal((3, 3))
        if in_air:
            p["in_air"][0] = 1.0
            p["swing"][0][:, :2] = path[:, :2]
            p["swing"][0][0, :2] += middle[:2]
            p["swing"][0][:, 2] = 0.0
            p["lift"][0][:] = path[:, 2]
            p["lift"][0][0] += middle[2]
        demand_acceleration(gait.record)
        write_targets(gait.record, gait.target.record)

        first = [robot.frame_id(foot) for foot in robot.feet if starts[foot] == 0]
        pin.computeJointJacobians(robot.model, data, q)
        pin.updateFramePlacements(robot.model, data)
        mean = np.mean([pin.getFrameJacobian(robot.model, data, i, pin.LOCAL_WORLD_ALIGNED)[:3] @ v for i in first], 0)
        swing = path[2] + kp * path[0] + kd * (path[1] - mean)
        a = whole_body_acceleration(
            gait, q, v, [swing if in_air and starts[f] == 0 else np.zeros(3) for f in robot.feet]
        )
        pin.centerOfMass(robot.model, data, q, v, a)
        np.testing.assert_allclose(data.acom[0][:2], p["demand"], atol=0.01)
        assert np.linalg.norm(gait.target.body[6:8] - p["demand"]) > 0.05


@pytest.mark.parametrize("degrees", long_but(SIDES, (0, 135)))
def test_icub_that_stands_takes_a_push_without_a_step(degrees):
    gait, angle = hp.WalkingGait(hp.load_robot("icub")), np.deg2rad(degrees)
    push = (0.15 * np.cos(angle), 0.15 * np.sin(angle), 0.0)
    run = walk(gait, pushes=((1.0, push),), duration=2.5)
    assert run.ending == "completed"
    assert int(run["steps"][-1]) == 0
    assert hp.measure(run).tilt_max_rad < 0.15
    assert abs(run["v"][-1]).max() < 0.1
