"""What the estimator says of its readings: a name for each status, and a sentence with its cause."""

from __future__ import annotations

from harpy_pin.estimation import tick

STATUS = {
    tick.GOOD: "good",
    tick.NO_SAMPLE: "no sample",
    tick.STUCK: "stuck gyroscope",
    tick.SATURATED: "saturated",
    tick.INCONSISTENT: "readings contradict each other",
    tick.BACKWARDS: "time does not go on",
    tick.GAP: "steps are missing",
    tick.CLOCK: "clock in other units",
    tick.WEIGHTLESS: "gravity is not felt",
    tick.UPSIDE_DOWN: "gravity upside down",
    tick.UNLOADED: "feet do not bear the weight",
    tick.TURNING: "gyroscope contradicts the legs",
    tick.NO_FOOTHOLD: "no foothold",
    tick.UNSURE: "velocity is uncertain",
    tick.BAD_TARGET: "bad target",
}
"""What :attr:`~harpy_pin.estimation.estimator.Estimator.status` says, by code."""
EXPLANATIONS = {
    tick.GOOD: "the velocity is within {twice:.2g} m/s with a probability of 0.95",
    tick.NO_SAMPLE: "a reading is missing, not a number or beyond 1e6",
    tick.STUCK: "the gyroscope has said the same 50 times",
    tick.SATURATED: "gyroscope or accelerometer is at its range",
    tick.INCONSISTENT: "innovations or biases are far beyond their covariance, as those of a "
    "wrongly mounted inertial unit, or loaded feet agree with each other and not with the estimate",
    tick.BACKWARDS: "the time goes back, stays, or goes on by less than a twentieth of the period "
    "of {period:g} s; it must be in s",
    tick.GAP: "more than one and a half periods of {period:g} s have passed",
    tick.CLOCK: "each step is more than 100 periods of {period:g} s after the last one; the time "
    "must be in s, and may be in ms or ns; steps are taken to be a period apart",
    tick.WEIGHTLESS: "over a second the accelerometer's mean is {felt:.3g} m/s² and not "
    "9.81; near 1 it is in units of g, near 0 gravity was taken off, near 96 it was "
    "multiplied by g twice; or the robot falls",
    tick.UPSIDE_DOWN: "over a second the accelerometer feels gravity upwards, or the legs pull the "
    "body down; it must say (0, 0, +9.81) m/s² at rest, upright, and torques must have the sign of "
    "the joints' axes",
    tick.UNLOADED: "over a second feet and thrusters bore {borne:.0%} of the weight; the robot is "
    "carried or lies, or torques or foot sensors are wrong; the velocity's standard deviation is "
    "{deviation:.2g} m/s",
    tick.TURNING: "by the gyroscope feet that stand move against each other, by the encoders they "
    "do not; it must be in rad/s, and may be in degrees per second",
    tick.NO_FOOTHOLD: "no foot has held for so long that the velocity's standard deviation is {deviation:.2g} m/s",
    tick.UNSURE: "samples were missing, or the estimate began anew, and feet have not held long "
    "enough since; the velocity's standard deviation is {deviation:.2g} m/s",
    tick.BAD_TARGET: "the target's stance, phase or ground height is not a number",
}
"""What :attr:`~harpy_pin.estimation.estimator.Estimator.explanation` says, by code."""
