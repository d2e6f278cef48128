"""Settings of whole-body controllers that fit a robot: one rule, from its mass and its legs.

Forces scale with the weight m g, the weight on squared forces with 1/m². With the length l of the
legs, rates scale with √(g/l) and weights on squared angular accelerations with l², so that they
count as linear ones of the feet do.

:meth:`harpy_pin.controllers.WholeBodyParameters.for_gait` takes them where a gait brings no others.
Gaits that know more about their walk refine them by ``controller_parameters``
(:class:`~harpy_pin.gaits.gait.Gait`).
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.model.legs import legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

GAINS: Mapping[str, Any] = {
    "body": (25.0, 10.0),
    "orientation": (400.0, 40.0),
    "swing": (400.0, 40.0),
    "contact_damping": 200.0,
    "limits": {"friction_share": 0.75},
    "estimate_friction": False,
}
"""Gains for any robot, and the share of friction."""
WEIGHTS: Mapping[str, float] = {
    "orientation": 0.1,
    "swing": 5.0,
    "posture": 1e-6,
    "arms": 1.0,
    "thrust": 5e-3,
}
"""Weights of the tasks for a robot that stays where it is."""
MIN_SHARE = 0.02
"""Least normal force of a contact point, as a share of its load when all are loaded alike."""
SOLE_SHARE = 0.1
"""The same of a corner of a sole: one whose centre of pressure comes to its edge tips over that
edge, so it stays inside by a twentieth of the sole."""
MAX_SHARE = 2.0
"""Largest normal force of a contact point, in weights of the robot."""
CONTACT_FORCE = 1.0
"""Normal force that counts as contact, N."""
CONTACT_SHARE = 0.2
"""And at most, for light robots, as a share of a point's load when all are loaded alike."""
FORCE_WEIGHT = 2e-4
"""Weight on contact forces times the squared mass, kg²."""
FLAT_FOOT_DAMPING = 20.0
"""Gain of the velocity of a flat foot that is held, 1/s. On compliant ground a sole rocks: with a
damping from 100 1/s on G1 does not come to rest."""
SWING_WEIGHT = 1.0
"""Weight of the acceleration of a swing foot: where motors are at their limits, the body comes
first."""
SWING_RATE = 4.2
"""Rate at which a swing foot comes back to its path, on points, in √(g / leg). Short legs step
fast, and have less time to make good what a delay costs."""
LEAST_RATE = 19.0
"""The least such rate, 1/s."""
TURN_WEIGHT = 0.2
"""Weights of the angular accelerations of body, torso and arms, times the squared height of the
centre of mass, m²."""
LOOSE_TURN_WEIGHT = 0.02
"""The same on soles, where turning holds a body that has been pushed, and where one point stands
alone. Its force holds the body upright against the swinging leg only by pushing it aside and up."""
POINT_TURN_RATE = 10.0
"""Rate at which the body comes back upright where turning weighs that little on points, in
√(g / leg)."""
POSTURE_WEIGHT = 1e-7
"""Weight of the accelerations of the legs' joints, times that squared height, m²: the WBC QP needs
it for one optimum, not for a posture."""


def fitting_parameters(
    robot: Robot, *, leg: float | None = None, rise: float | None = None
) -> dict[str, Any]:
    """Settings of whole-body controllers that fit a robot which may stand, step or walk.

    They are those of :func:`standing_parameters`, but: a foot, not each of its corners, is loaded
    with at most twice the weight, because a sole whose corners are loaded fast at touchdown slips;
    swing feet weigh less; and joints and the turning of the body weigh as the robot's size says,
    because one sole, or a line between two points, holds little moment, and what is missing must
    not lift the body. On one point turning weighs less still, and comes back the faster.

    Args:
        robot: any. One without legs has the settings of :func:`standing_parameters`.
        leg: length of its legs, m; by default that of :func:`leg_length`.
        rise: height of its centre of mass above the ground, m; by default the length of its legs.

    Returns:
        Values by the names of :class:`~harpy_pin.controllers.WholeBodyParameters`, those of a
        record inside as a mapping.
    """
    parameters = standing_parameters(robot)
    leg = leg_length(robot) if leg is None else leg
    if leg == 0.0:
        return parameters
    square, natural = (leg if rise is None else rise) ** 2, float(np.sqrt(GRAVITY / leg))
    soles = robot.on_soles
    alone = len(robot.corners) == 2 and not soles
    parameters["max_normal_force"] /= max(robot.corners)
    turn = square * (LOOSE_TURN_WEIGHT if alone or soles else TURN_WEIGHT)
    own = {"swing": SWING_WEIGHT, "orientation": turn, "arms": turn}
    posture = POSTURE_WEIGHT * square
    parameters["weights"] = {**parameters["weights"], **own, "posture": posture}
    if not soles:
        rate = max(SWING_RATE * natural, LEAST_RATE)
        parameters["swing"] = (rate * rate, 2.0 * rate)
    if alone:
        rate = POINT_TURN_RATE * natural
        parameters["orientation"] = (rate * rate, 2.0 * rate)
    return parameters


def standing_parameters(robot: Robot) -> dict[str, Any]:
    """Settings that fit a robot which stays on all its feet, or in the air; from its weight alone.

    The normal force of a contact point is between 2 % of its share of the weight (of a corner of a
    sole: 10 %) and twice the whole weight. The weight on contact forces falls with the squared
    mass. For flat feet the formulation is the one that uses the whole sole, and held feet are
    damped less.

    Args:
        robot: any.

    Returns:
        As of :func:`fitting_parameters`.
    """
    checks.instance("robot", robot, Robot)
    load, share = robot.mass * GRAVITY, SOLE_SHARE if robot.on_soles else MIN_SHARE
    points = max(len(robot.feet), 1)
    parameters: dict[str, Any] = {
        "min_normal_force": share * load / points,
        "max_normal_force": MAX_SHARE * load,
        "contact_threshold": min(CONTACT_FORCE, CONTACT_SHARE * load / points),
        "weights": {**WEIGHTS, "force": FORCE_WEIGHT / robot.mass**2},
        **GAINS,
    }
    if robot.flat_feet:
        parameters.update(formulation="full", contact_damping=FLAT_FOOT_DAMPING)
    return parameters


def leg_length(robot: Robot) -> float:
    """Length of a stretched leg from the last joint above its knee to the foot, the shortest of
    all, m; zero of a robot without legs.

    Args:
        robot: any.
    """
    posed, lengths = Posed(robot, robot.reference), []
    for leg in legs(robot):
        foot: Vector = np.mean([posed.frame(name).translation for name in leg.points], axis=0)
        way = [*(posed.joint(j) for j in leg.way), foot]
        lengths.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(way)))
    return min(lengths, default=0.0)
