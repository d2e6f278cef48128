"""The measures of a run in words, with their units."""

from __future__ import annotations

__all__ = ["WORDS"]

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
    "cost_of_transport": "cost of transport: positive joint work over weight times path",
    "velocity_rms_m_s": "velocity less the commanded one, over two steps, m/s rms",
    "turning_rms_rad_s": "turning less the commanded one, over two steps, rad/s rms",
    "pressure_margin_mm": "centre of pressure from the edge of a loaded sole in 95 % of the time, mm",
}
"""Of the attributes of :class:`harpy_pin.log.measures.Measures`."""
