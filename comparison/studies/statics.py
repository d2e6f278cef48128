"""What statics allows on a slope: a linear program of its own.

Forces in the friction cones about the normal and thrusts within their limits balance the robot, with joint torques
within the motors' limits, wherever its body is along x. Robots on four feet lean with the slope, others are upright.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq, linprog

from harpy_pin import Robot, Standing, load_harpy, load_robot, make_gait
from harpy_pin.gaits import OnTerrain
from harpy_pin.ground import Plane
from harpy_pin.model.state import Vector
from harpy_pin.wbc import WholeBodyLimits
from harpy_pin.wbc.weights import thrust_box

FACES = 32
"""Of the pyramid inside Coulomb's cone: its cone is half a per cent narrower."""
REACH, PLACES = 0.4, 41
"""How far ahead of the feet or behind them the body may be, m, and how many places are looked at."""
STEPS, DAMPING, FOUND = 50, 1e-8, 1e-3
"""Of the iteration that brings feet to their places, and how far they may be away, m."""


@cache
def static_bound(degrees: float, friction: float, name: str = "harpy") -> tuple[bool, float | None]:
    """What statics allows, wherever the body is along x above the feet.

    Args:
        degrees: angle of the ground, which rises along x.
        friction: static coefficient.
        name: of the robot.

    Returns:
        Whether the robot stands without thrust, and the least sum of its thrusts' components, N; none where it cannot
        stand with thrust either.
    """
    robot, normal = _robot(name), Plane(slope=float(np.radians(degrees))).normal(0.0, 0.0)
    found: dict[bool, list[float]] = {False: [], True: []}
    for q in _postures(name, degrees):
        for thrust in (False, True) if robot.thrusters else (False,):
            least = _least_thrust(robot, q, normal, friction, thrust=thrust)
            if least is not None:
                found[thrust].append(least)
    possible = found[True] if robot.thrusters else found[False]
    return bool(found[False]), min(possible) if possible else None


@cache
def _robot(name: str) -> Robot:
    return load_harpy() if name == "harpy" else load_robot(name)


@cache
def _postures(name: str, degrees: float) -> list[Vector]:
    """The standing posture with the body at several places along x, level and along the slope, as far as legs reach."""
    robot, slope = _robot(name), float(np.radians(degrees))
    gait = make_gait(robot, speed=0.0) if name == "harpy" else Standing(robot)
    start = OnTerrain(gait, Plane(slope=slope)).initial_state()[0]
    feet = _feet(robot, start)[0]

    def above(x: float) -> float:
        """How far the centre of mass is ahead of the feet, m."""
        q = _moved(robot, start, x, 0.0)
        return float(pin.centerOfMass(robot.model, robot.model.createData(), q)[0] - feet[:, 0].mean())

    places = [(x, rise) for x in np.linspace(-REACH, REACH, PLACES).tolist() for rise in (0.0, x * np.tan(slope))]
    if len(robot.feet) == 2:  # on two points there is one place for the centre of mass
        places.append((float(brentq(above, -REACH, REACH)), 0.0))
    postures = []
    for x, rise in places:
        q = _moved(robot, start, x, rise)
        reached = np.abs(_feet(robot, q)[0] - feet).max() < FOUND
        if reached and (q[7:] >= robot.joint_lower).all() and (q[7:] <= robot.joint_upper).all():
            postures.append(q)
    return postures


def _moved(robot: Robot, start: Vector, x: float, rise: float) -> Vector:
    """A posture with the body moved ahead and up, and the feet where they are."""
    goal, q = _feet(robot, start)[0], start.copy()
    q[:3] += (x, 0.0, rise)
    for _ in range(STEPS):
        feet, jacobian = _feet(robot, q)
        legs = jacobian[:, 6:]
        step = legs.T @ np.linalg.solve(legs @ legs.T + DAMPING * np.eye(len(legs)), (goal - feet).ravel())
        q[7:] += step
    return q


def _feet(robot: Robot, q: Vector) -> tuple[Vector, Vector]:
    """Places of the feet, and their Jacobian, world axes."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    places = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
    return places, np.vstack(_jacobians(robot, q, robot.feet))


def _jacobians(robot: Robot, q: Vector, frames: tuple[str, ...]) -> list[Vector]:
    """(3, nv) of each frame, world axes."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    return [pin.getFrameJacobian(model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[:3] for name in frames]


def _least_thrust(robot: Robot, q: Vector, normal: Vector, friction: float, *, thrust: bool) -> float | None:
    """Least sum of the thrusts' components with which a posture is in balance, N; none where there is none."""
    model, data = robot.model, robot.model.createData()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    rows = _jacobians(robot, q, (*robot.feet, *robot.thrusters))
    # Forces on the feet, then thrusts as differences of positive parts; torques are what is left of the balance.
    jacobian = np.vstack((*rows, *(-row for row in rows[len(robot.feet) :])))
    feet = 3 * len(robot.feet)
    frame = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), normal).matrix()
    angle = 2.0 * np.pi * (np.arange(FACES) + 0.5) / FACES  # an edge of the cone along x
    inscribed = np.full(FACES, -friction * np.cos(np.pi / FACES))
    pyramid = np.column_stack((np.cos(angle), np.sin(angle), inscribed)) @ frame.T
    cones = np.zeros((len(robot.feet) * FACES, len(jacobian)))
    for k in range(len(robot.feet)):
        cones[FACES * k : FACES * (k + 1), 3 * k : 3 * k + 3] = pyramid
    legs, limit = (
        jacobian[:, 6:].T,
        thrust_box(robot, WholeBodyLimits())[1] * thrust if robot.thrusters else np.zeros(0),
    )
    found = linprog(
        np.concatenate((np.zeros(feet), np.ones(2 * len(limit)))),
        A_ub=np.vstack((cones, -legs, legs)),
        b_ub=np.concatenate((np.zeros(len(cones)), robot.torque_limit - gravity[6:], robot.torque_limit + gravity[6:])),
        A_eq=jacobian[:, :6].T,
        b_eq=gravity[:6],
        bounds=[(None, None)] * feet + [(0.0, most) for most in (*limit, *limit)],
    )
    return float(found.fun) if found.status == 0 else None
