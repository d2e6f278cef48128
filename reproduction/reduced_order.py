"""What the reduced-order model expects of the ground, along a run of the full robot."""

from __future__ import annotations

import numpy as np

from harpy_pin.errors import InputError
from harpy_pin.governors.point_mass import Law, axial_force, model_record
from harpy_pin.governors.rows import ForceRows
from harpy_pin.log.run import Run
from harpy_pin.model.kinematics import body_rotation
from harpy_pin.model.state import Vector
from harpy_pin.simulation.simulator import GRAVITY

__all__ = ["body_velocity", "model_force", "model_rows"]


def body_velocity(run: Run) -> Vector:
    """(n, 3) velocity of the body's origin, world axes, m/s."""
    velocity, rotation = np.empty((len(run), 3)), np.empty((3, 3))
    for q, v, out in zip(run["q"], run["v"], velocity, strict=True):
        body_rotation(q, rotation)
        out[:] = rotation @ v[:3]
    return velocity


def _measured(run: Run) -> Vector:
    """(n, 9) [c; ċ; u] along the run."""
    for name in ("centre_of_pressure", "x_r", "x_w"):
        if name not in run:
            raise InputError(f"the run has no signal '{name}': it was not made by the governed controller", name="run")
    return np.concatenate((run["q"][:, :3], body_velocity(run), run["centre_of_pressure"]), axis=1)


def model_rows(run: Run, *, mu: float, reference: str = "x_w") -> Vector:
    """(n, 5) force rows at the measured state (equations.md R1) for a logged reference, N.

    Args:
        run: of the governed controller.
        mu: friction coefficient of the rows.
        reference: signal to evaluate at, ``x_w`` or ``x_r``.

    Raises:
        InputError: the run lacks a signal.
    """
    rows = ForceRows(mass=float(run.metadata["mass"]), mu=mu, g=GRAVITY)
    out, jacobian = np.empty((len(run), len(rows.names))), np.empty((len(rows.names), 6))
    for x, w, h in zip(_measured(run), run[reference], out, strict=True):
        rows.evaluate(x, w, h, jacobian)
    return out


def model_force(run: Run, *, reference: str = "x_w") -> Vector:
    """(n, 3) contact force that the reduced-order model expects for a logged reference, world axes, N.

    Args:
        run: of the governed controller.
        reference: signal to evaluate at, ``x_w`` or ``x_r``.

    Raises:
        InputError: the run lacks a signal.
    """
    model = model_record(mass=float(run.metadata["mass"]), g=GRAVITY, gains=None, law=Law.FULL)[0]
    out, jacobian = np.empty((len(run), 3)), np.empty(6)
    for x, w, force in zip(_measured(run), run[reference], out, strict=True):
        r = x[:3] - x[6:]
        d = axial_force(r, x[:3], x[3:6], model, jacobian)
        force[:] = (jacobian @ w + d) * r / np.linalg.norm(r)
    return out
