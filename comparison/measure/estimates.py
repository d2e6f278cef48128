"""How far estimates of the contacts are off; and the plain rival of the estimator, a complementary
filter of the inertial unit and the feet that touch the ground.

The gyroscope turns the body, slowly righted by the accelerometer (Mahony et al., IEEE TAC 2008);
the accelerometer moves it, righted by the velocity and the height at which the feet on the ground
would be at rest on it.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from harpy_pin.model.state import Vector

LIKELY, TOUCHES = 0.5, 1.0
"""Probability from which on an estimate has a foot in contact, and force from which on it is, N."""


def contacts(force: Vector, probability: Vector) -> dict[str, float]:
    """Precision and recall of the contacts, from normal forces (ticks, feet) and probabilities."""
    touching, held = force > TOUCHES, probability > LIKELY
    both = float((touching & held).sum())
    return {
        "precision": both / max(int(held.sum()), 1),
        "recall": both / max(int(touching.sum()), 1),
    }


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Rates at which the filter is righted, 1/s: the best of 16 on walks of another seed."""

    tilt: float = 0.01
    velocity: float = 40.0
    height: float = 10.0


def complementary(
    run: hp.Run, robot: hp.Robot, gains: Gains | None = None
) -> tuple[Vector, Vector]:
    """(ticks, nq) configurations and (ticks, nv) velocities by the readings of a run with sensors
    at the body's origin.

    Start, encoders and contacts are those of the run's own estimator.
    """
    gains, model, data = gains or Gains(), robot.model, robot.model.createData()
    feet = np.array([robot.frame_id(name) for name in robot.feet])
    q, v, held = (
        run["estimated_q"].copy(),
        run["estimated_v"].copy(),
        run["contact_probability"] > LIKELY,
    )
    dt, up, origin = (
        float(run["t"][1] - run["t"][0]),
        np.array([0.0, 0.0, 1.0]),
        pin.neutral(model)[:7],
    )
    turned, place = pin.Quaternion(run["q"][0, 3:7]).toRotationMatrix(), run["q"][0, :3].copy()
    speed = turned @ run["v"][0, :3]
    for k, (angular, force) in enumerate(zip(run["gyroscope"], run["accelerometer"], strict=True)):
        level = np.cross(force / max(float(np.linalg.norm(force)), 1.0), turned.T @ up)
        turned = turned @ pin.exp3(dt * (angular + gains.tilt * level))
        speed = speed + dt * (turned @ force - hp.model.GRAVITY * up)
        place = place + dt * speed
        pin.forwardKinematics(
            model, data, np.append(origin, q[k, 7:]), np.append(np.zeros(6), v[k, 6:])
        )
        arms, moves = np.zeros(3), np.zeros(3)
        for foot in feet[held[k]].tolist():
            arm = pin.updateFramePlacement(model, data, foot).translation.copy()
            arms += arm
            moves += pin.getFrameVelocity(
                model, data, foot, pin.LOCAL_WORLD_ALIGNED
            ).linear + np.cross(angular, arm)
        if count := int(held[k].sum()):
            speed = speed - dt * gains.velocity * (speed + turned @ moves / count)
            place[2] -= dt * gains.height * (place[2] + turned[2] @ arms / count)
        q[k, :3], q[k, 3:7] = place, pin.Quaternion(turned).coeffs()
        v[k, :3], v[k, 3:6] = turned.T @ speed, angular
    return q, v
