"""How far an estimate of the state is off."""

import numpy as np
import pinocchio as pin

from harpy_pin.model.state import Vector


def off(q: Vector, v: Vector, guess: Vector, speed: Vector, *, period: float) -> dict[str, float]:
    """How far an estimate (ticks, nq) and (ticks, nv) is off, with the period between ticks, s.

    Drift is the error of the displacement, level, from the first tick to the last, over the length
    of the way. The absolute trajectory error is the rms distance of the bodies' origins where the
    estimate's path is turned about the vertical and moved so that it is least. The relative pose
    error is the rms error of the displacements within one second, each in the axes of the body at
    its start, by evo's definition (https://github.com/MichaelGrupp/evo).
    """
    true, own = (
        np.array([pin.Quaternion(row[3:7]).toRotationMatrix() for row in rows])
        for rows in (q, guess)
    )
    way = float(np.linalg.norm(np.diff(q[:, :2], axis=0), axis=1).sum())
    drift = (q[-1, :2] - q[0, :2]) - (guess[-1, :2] - guess[0, :2])
    error = np.einsum("nij,nj->ni", true, v[:, :3]) - np.einsum("nij,nj->ni", own, speed[:, :3])
    tilt = np.arccos(np.clip(np.einsum("nj,nj->n", true[:, 2], own[:, 2]), -1.0, 1.0))
    a, b = q[:, :3] - q[:, :3].mean(axis=0), guess[:, :3] - guess[:, :3].mean(axis=0)
    along, across = (a[:, :2] * b[:, :2]).sum(), (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]).sum()
    ticks = min(round(1.0 / period), len(q) - 1)
    steps = [
        np.einsum("nji,nj->ni", turns[:-ticks], place[ticks:, :3] - place[:-ticks, :3])
        for turns, place in ((true, q), (own, guess))
    ]
    turned = b @ pin.rpy.rpyToMatrix(0.0, 0.0, float(np.arctan2(across, along))).T
    return {
        "way_m": way,
        "drift": float(100.0 * np.linalg.norm(drift) / way) if way > 0.1 else 0.0,
        "trajectory_mm": float(1e3 * np.sqrt(np.mean(np.sum((a - turned) ** 2, axis=1)))),
        "relative_mm": float(1e3 * np.sqrt(np.mean(np.sum((steps[0] - steps[1]) ** 2, axis=1)))),
        "velocity_cm_s": float(1e2 * np.sqrt(np.mean(np.sum(error**2, axis=1)))),
        "tilt_deg": float(np.rad2deg(np.sqrt(np.mean(tilt**2)))),
    }
