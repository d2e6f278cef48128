"""Joints that come to their ends, in every plant."""

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.simulation.joint_ends import hold_at_ends, joint_ends_record

PLANTS = [hp.Simulator, hp.simulation.PinocchioPlant]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_joint_swings_back_from_its_end_as_a_critically_damped_spring(side):
    """x(t) = (x₀ + (ẋ₀ + ω x₀) t) exp(−ω t) while the spring pushes; it never pulls, and inside
    nothing is felt.
    """
    robot, inertia, h = hp.load_harpy(), 0.02, 1e-7
    record = joint_ends_record(robot, 1e-3)
    omega, ends = 200.0, record["upper" if side > 0.0 else "lower"][0]
    record["stiffness"], record["damping"] = inertia * omega**2, 2.0 * inertia * omega
    q, v = np.zeros(robot.model.nq), np.zeros(robot.model.nv)
    q[7:] = 0.3  # within all ends
    place, column = record["place"][0, 0], record["column"][0, 0]
    v[column] = side * 2.0
    for k in range(20_000):
        q[place] = ends[0] + side * 1e-4 if k == 0 else q[place] + h * v[column]
        force = np.zeros(robot.model.nv)
        hold_at_ends(record, q, v, force)
        v[column] -= h * force[column] / inertia
    t = h * 20_000
    expected = (1e-4 + (2.0 + omega * 1e-4) * t) * np.exp(-omega * t)
    assert q[place] - ends[0] == pytest.approx(side * expected, rel=1e-3)
    for beyond, speed in ((1e-3, -5.0), (-1e-3, 1.0)):
        q[place], v[column], force = ends[0] + side * beyond, side * speed, np.zeros(robot.model.nv)
        hold_at_ends(record, q, v, force)
        assert not force.any()


@pytest.mark.parametrize("plant", PLANTS)
@needs_robots
def test_a_motor_does_not_drive_a_joint_through_its_end(plant):
    """In the air, without weight, under a tenth of the largest torque; with ends far away it goes
    on.
    """
    robot, wide = hp.load_robot("go2"), hp.load_robot("go2")
    wide.model.upperPositionLimit[7:], wide.model.lowerPositionLimit[7:] = 1e3, -1e3
    end, reached = robot.joint_upper[0], []
    for one in (robot, wide):
        simulator = plant(one, gravity=(0.0, 0.0, 0.0))
        q = hp.Standing(robot).initial_state()[0] + 2.0 * np.eye(robot.model.nq)[2]
        simulator.reset(q, np.zeros(robot.model.nv))
        command = hp.Command(
            0.1 * robot.torque_limit * np.eye(len(robot.joints))[0], np.zeros((0, 3))
        )
        simulator.advance(command, steps=600)
        reached.append(simulator.q[7])
    assert abs(reached[0] - end) < 0.05
    assert reached[1] > end + 0.5
