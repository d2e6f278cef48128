"""What the estimator says of its readings: a name for each status, and a sentence with its
cause.
"""

from __future__ import annotations

from harpy_pin.estimation import plausibility as status

STATUS = {
    status.GOOD: "good",
    status.NO_SAMPLE: "no sample",
    status.STUCK: "stuck gyroscope",
    status.SATURATED: "saturated",
    status.INCONSISTENT: "readings contradict each other",
    status.BACKWARDS: "time does not go on",
    status.GAP: "steps are missing",
    status.CLOCK: "clock in other units",
    status.WEIGHTLESS: "gravity is not felt",
    status.UPSIDE_DOWN: "gravity upside down",
    status.UNLOADED: "feet do not bear the weight",
    status.TURNING: "gyroscope contradicts the legs",
    status.ENCODERS: "angles contradict velocities",
    status.NO_FOOTHOLD: "no foothold",
    status.UNSURE: "velocity is uncertain",
    status.BAD_TARGET: "bad target",
}
"""What :attr:`~harpy_pin.estimation.estimator.Estimator.status` says, by code."""
EXPLANATIONS = {
    status.GOOD: "the velocity is within {twice:.2g} m/s with a probability of 0.95",
    status.NO_SAMPLE: "a reading is missing, not a number or beyond 1e6",
    status.STUCK: "the gyroscope has said the same 50 times",
    status.SATURATED: "gyroscope or accelerometer is at its range",
    status.INCONSISTENT: "innovations or biases are far beyond their covariance, as those of a "
    "wrongly mounted inertial unit, or loaded feet agree with each other and not with the estimate",
    status.BACKWARDS: "the time goes back, stays, or goes on by less than a twentieth of the "
    "period "
    "of {period:g} s; it must be in s",
    status.GAP: "more than one and a half periods of {period:g} s have passed",
    status.CLOCK: "each step is more than 100 periods of {period:g} s after the last one; the time "
    "must be in s, and may be in ms or ns; steps are taken to be a period apart",
    status.WEIGHTLESS: "over a second the accelerometer's mean is {felt:.3g} m/s² and not "
    "9.81; near 1 it is in units of g, near 0 gravity was taken off, near 96 it was "
    "multiplied by g twice; or the robot falls",
    status.UPSIDE_DOWN: "over a second the accelerometer feels gravity upwards, or the legs pull "
    "the "
    "body down; it must say (0, 0, +9.81) m/s² at rest, upright, and torques must have the sign of "
    "the joints' axes",
    status.UNLOADED: "over a second feet and thrusters bore {borne:.0%} of the weight; the robot "
    "is "
    "carried or lies, or torques or foot sensors are wrong; the velocity's standard deviation is "
    "{deviation:.2g} m/s",
    status.TURNING: "by the gyroscope feet move that stand without it; it must be in rad/s, and "
    "may be in degrees per second",
    status.ENCODERS: "angles of joints change otherwise than their velocities say, by more than "
    "{mismatch:g} rad in half a second, and are not used; encoders are stuck, or one of the two is "
    "in degrees or has another sign",
    status.NO_FOOTHOLD: "no foot has held for so long that the velocity's standard deviation is "
    "{deviation:.2g} m/s",
    status.UNSURE: "samples were missing, or the estimate began anew, and feet have not held long "
    "enough since; the velocity's standard deviation is {deviation:.2g} m/s",
    status.BAD_TARGET: "the target's stance, phase or ground height is not a number",
}
"""What :attr:`~harpy_pin.estimation.estimator.Estimator.explanation` says, by code."""
