"""A robot from a file, its kinematics and dynamics."""

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import harpy_pin as hp

Vector = NDArray[np.float64]

urdf: Path = hp.model.harpy_urdf()
robot = hp.load_robot(urdf, feet=("left_foot", "right_foot"))
assert_type(robot.feet, tuple[str, ...])
assert_type(robot.mass, float)
assert_type(robot.posture, Vector | None)
q, v = hp.make_gait(robot, speed=0.0).initial_state()
result = hp.model.solve_ik(robot, {"left_foot": (0.05, 0.125, 0.02)}, q)
assert_type(result, hp.model.IKResult)
assert_type(result.q, Vector)
assert_type(result.converged, bool)
leg = hp.model.LegGeometry.from_robot(robot, "left_foot")
assert_type(hp.model.leg_inverse_kinematics(leg, (0.0, 0.15, -0.5)), Vector)
dynamics = hp.Dynamics(robot)
dynamics.update(q, v)
assert_type(dynamics.mass_matrix, Vector)
standing: hp.Gait = hp.Standing(robot, q[7:], shift=(0.0, 0.01, 0.0))
try:
    hp.load_robot("none.urdf", feet=())
except hp.RobotError as error:
    assert_type(error.path, object)
