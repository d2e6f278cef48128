"""The measures of a run in words, with their units."""

from __future__ import annotations

__all__ = ["OF_SOME_WALKS", "OF_THRUSTERS", "WORDS"]

WORDS = {
    "fell": "fell",
    "ending": "ending",
    "duration_s": "simulated time, s",
    "distance_m": "distance along x, m",
    "steps": "steps",
    "slip_mm_per_step": "slip, mm per step",
    "net_slip_mm_per_step": "net slip, mm per step",
    "late_slip_mm_per_step": "slip later than 50 ms after touchdown, mm per step",
    "sliding": "share of contact time sliding",
    "low_force": "share of time with normal force under 20 N",
    "no_contact": "share of time without contact",
    "tracking_rms_mm": "distance from the target, mm rms",
    "thrust_rms_n": "sum of the thrusts, N rms",
    "thrust_max_n": "largest thrust, N",
    "torque_max_nm": "largest joint torque, N·m",
    "roll_max_rad": "largest roll, rad",
    "pitch_max_rad": "largest pitch, rad",
    "yaw_max_rad": "largest yaw, rad",
    "solver_failures": "ticks without a QP solution",
    "tilt_max_rad": "largest tilt, rad",
    "stumbled": "stumbled",
    "bad_samples": "ticks with invalid measurements",
    "cost_of_transport": "cost of transport (positive work / weight / path)",
    "joint_power_w": "power of the joints without braking, W",
    "thrust_power_w": "power of the thrusters at 1 kW for 18 N, W",
    "velocity_rms_m_s": "error of the velocity over two steps, m/s rms",
    "turning_rms_rad_s": "error of turning over two steps, rad/s rms",
    "pressure_margin_mm": "centre of pressure inside a sole for 95 % of the time, mm",
}
"""Of the attributes of :class:`harpy_pin.log.measures.Measures`."""
OF_SOME_WALKS = ("tracking_rms_mm", "cost_of_transport", "velocity_rms_m_s", "turning_rms_rad_s", "pressure_margin_mm")
"""Measures that are shown where there are any: of a target, a path, a command, or flat feet."""
OF_THRUSTERS = ("thrust_rms_n", "thrust_max_n", "thrust_power_w")
"""Measures that are shown of robots with thrusters."""
