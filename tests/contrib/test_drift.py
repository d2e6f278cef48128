"""How far an estimate is off, against evo (https://github.com/MichaelGrupp/evo) and against closed
forms.
"""

import numpy as np
import pinocchio as pin
import pytest
from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D

from harpy_pin.contrib.drift import off

TICKS = 400


def walk(seed: int, *, level: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """(ticks, 7) and (ticks, 6): a path of a floating body; level: at height zero, turning about
    the vertical.
    """
    rng = np.random.default_rng(seed)
    place = np.cumsum(rng.normal(0.01, 0.02, (TICKS, 3)), axis=0)
    turn = np.cumsum(rng.normal(0.0, 0.02, (TICKS, 3)), axis=0)
    if level:
        place[:, 2], turn[:, :2] = 0.0, 0.0
    q = np.hstack((place, [pin.Quaternion(pin.exp3(one)).coeffs() for one in turn]))
    return q, rng.normal(0.0, 0.3, (TICKS, 6))


def as_evo(q: np.ndarray) -> PoseTrajectory3D:
    wxyz = q[:, [6, 3, 4, 5]]
    return PoseTrajectory3D(
        positions_xyz=q[:, :3], orientations_quat_wxyz=wxyz, timestamps=np.arange(len(q)) * 0.01
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_relative_error_is_evos(seed: int) -> None:
    (q, v), (guess, speed) = walk(seed), walk(seed + 100)
    evo = metrics.RPE(
        metrics.PoseRelation.translation_part,
        delta=100,
        delta_unit=metrics.Unit.frames,
        all_pairs=True,
    )
    evo.process_data((as_evo(q), as_evo(guess)))
    found = off(q, v, guess, speed, period=0.01)["relative_mm"]
    assert found == pytest.approx(1e3 * evo.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_absolute_error_is_evos(seed: int) -> None:
    """On level paths that are near each other evo, which aligns all axes, turns about the vertical
    alone.
    """
    (q, v), (guess, speed) = walk(seed, level=True), walk(seed + 100, level=True)
    guess[:, :3] = q[:, :3] + 0.1 * guess[:, :3]
    aligned = as_evo(guess)
    aligned.align(as_evo(q))
    evo = metrics.APE(metrics.PoseRelation.translation_part)
    evo.process_data((as_evo(q), aligned))
    found = off(q, v, guess, speed, period=0.01)["trajectory_mm"]
    assert found == pytest.approx(1e3 * evo.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)


def test_place_and_heading_are_free() -> None:
    """An estimate from elsewhere, turned about the vertical, has no error but that of the
    displacement.
    """
    q, v = walk(5)
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 0.4))
    turned = q.copy()
    turned[:, :3] = q[:, :3] @ turn.toRotationMatrix().T + [3.0, -1.0, 0.5]
    turned[:, 3:7] = [(turn * pin.Quaternion(one)).coeffs() for one in q[:, 3:7]]
    error = off(q, v, turned, v, period=0.01)
    assert max(error["trajectory_mm"], error["relative_mm"], error["tilt_deg"]) < 1e-6
    moved = q[-1, :2] - q[0, :2]
    chord = 2.0 * np.sin(0.2) * np.linalg.norm(moved)
    assert error["drift"] == pytest.approx(100.0 * chord / error["way_m"], rel=1e-9)
