"""Snapshots of a session: what is logged, and what only the page shows."""

from typing import Any

import numpy as np

from harpy_pin.contrib.live.live_session import LiveSession, Tick
from harpy_pin.log.power import PRESETS
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.frames import about_normals


def power_of(tick: Tick) -> Vector:
    """(2,) of a tick: of the joints without braking, and of the thrusters at 1 kW for 18 N, W."""
    joints = np.maximum(tick.command.torque * tick.state.v[6:], 0.0).sum()
    return np.array(
        (joints, PRESETS["fan"].electrical(np.linalg.norm(tick.command.thrust, axis=1)).sum())
    )


def snapshot(session: LiveSession) -> dict[str, Any]:
    """A copy of the present state: arrays and numbers by name."""
    state, times, pacer = session.last.state, session.times, session.pacer
    force, velocity = (
        about_normals(session.plane, state.foot_position, v)
        for v in (state.foot_force, state.foot_velocity)
    )
    values = {
        **session.signals,
        "contact_force": force,
        "contact_velocity": velocity,
        "below": session.simulator.ground_below,
        "power": power_of(session.last),
        "falls": session.falls,
        "p50": times.percentile(50.0),
        "p99": times.percentile(99.0),
        "factor": pacer.factor,
        "lost": pacer.lost,
        "moving": not (session.paused or session.ending),
    }
    return {name: np.array(value, dtype=np.float64)[()] for name, value in values.items()}
