"""The rival of the estimator, a complementary filter: exact without feet on exact readings, and
near the truth on a walk.
"""

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.measure.estimates import complementary
from harpy_pin.contrib.drift import off


def test_it_follows_a_walk():
    run = hp.walk(hp.Scenario(sensors=hp.Imu(), ground=hp.Ground(mu_s=0.8), duration=1.0))
    error = off(run["q"], run["v"], *complementary(run, hp.load_harpy()), period=1e-3)
    assert error["drift"] < 5.0
    assert error["velocity_cm_s"] < 5.0
    assert error["tilt_deg"] < 1.0


def test_it_is_exact_in_the_air():
    robot, t = hp.load_harpy(), 1e-4 * np.arange(4000)
    q, v, force = (
        np.tile(pin.neutral(robot.model), (len(t), 1)),
        np.zeros((len(t), robot.model.nv)),
        np.zeros((len(t), 3)),
    )
    q[:, 0], v[:, 0], force[:, 0] = (
        0.05 * np.sin(8.0 * t),
        0.4 * np.cos(8.0 * t),
        -3.2 * np.sin(8.0 * t),
    )
    force[:, 2] = 9.81
    signals = {
        "t": t,
        "q": q,
        "v": v,
        "estimated_q": q,
        "estimated_v": v,
        "contact_probability": np.zeros((len(t), 2)),
    }
    run = hp.Run({**signals, "gyroscope": np.zeros_like(force), "accelerometer": force}, {})
    error = off(q, v, *complementary(run, robot), period=float(t[1] - t[0]))
    assert error["trajectory_mm"] < 0.5
    assert error["velocity_cm_s"] < 0.5
    assert error["tilt_deg"] < 0.1
