import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harpy_pin.governors.point_mass import Law
from harpy_pin.governors.thrust import (
    AttitudeGains,
    CentreGains,
    allocate,
    centre_feedback,
    limit_thrust,
    roll_yaw,
)

vectors = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0))
MOUNTS = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])


@given(vectors, vectors, vectors, arrays(np.float64, 6, elements=st.floats(-2.0, 2.0)))
def test_feedback_law(r, c, c_dot, reference):
    """Against the printed law with its projector (equations.md E5, E6)."""
    r = r + np.array([0.0, 0.0, 2.5])
    gains = CentreGains(k_pt=(100.0, 200.0, 300.0), k_dt=(10.0, 20.0, 30.0), k_pr=50.0, k_dr=5.0)
    e, e_dot = reference[:3] - c, reference[3:] - c_dot
    raw = np.array([100.0, 200.0, 300.0]) * e + np.array([10.0, 20.0, 30.0]) * e_dot
    projector = np.outer(r, r) / (r @ r)
    out = np.empty(3)
    u_r = centre_feedback(r, c, c_dot, reference, int(Law.PROJECTED), gains.record[0], out)
    np.testing.assert_allclose(out, (np.eye(3) - projector) @ raw, atol=1e-9)
    assert u_r == pytest.approx(r @ (50.0 * e + 5.0 * e_dot), abs=1e-9)
    centre_feedback(r, c, c_dot, reference, int(Law.FULL), gains.record[0], out)
    np.testing.assert_allclose(out, raw, atol=1e-9)


@given(vectors, st.floats(-3.0, 3.0), st.floats(-1.4, 1.4), st.floats(-3.0, 3.0), vectors)
def test_allocation_adds_up_and_rights_the_body(centre, roll, pitch, yaw, spin):
    """The sum is u_t,c; the moment about the body's axes is −40 φ − 4 φ̇ in roll and yaw, none in
    pitch (E7).
    """
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    angles, thrust = np.empty(4), np.empty((2, 3))
    roll_yaw(rotation, spin, angles)
    gains = AttitudeGains()
    allocate(centre, rotation, angles, gains.k_p, gains.k_d, thrust)
    np.testing.assert_allclose(thrust.sum(axis=0), centre, atol=1e-10)
    difference = thrust - 0.5 * centre
    moment = sum(np.cross(m, rotation.T @ f) for m, f in zip(MOUNTS, difference, strict=True))
    np.testing.assert_allclose(
        moment,
        [-40.0 * angles[0] - 4.0 * angles[2], 0.0, -40.0 * angles[1] - 4.0 * angles[3]],
        atol=1e-9,
    )


@given(st.floats(-3.0, 3.0), st.floats(-1.4, 1.4), st.floats(-3.0, 3.0), vectors)
def test_roll_and_yaw_and_their_rates(roll, pitch, yaw, spin):
    """Against Pinocchio's roll-pitch-yaw and a central difference along the motion."""
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    out = np.empty(4)
    roll_yaw(rotation, spin, out)
    expected = pin.rpy.matrixToRpy(rotation)
    np.testing.assert_allclose(np.sin(out[:2] - expected[[0, 2]]), 0.0, atol=1e-9)
    step = 1e-6
    ahead = pin.rpy.matrixToRpy(rotation @ pin.exp3(step * spin))
    behind = pin.rpy.matrixToRpy(rotation @ pin.exp3(-step * spin))
    rate = np.angle(np.exp(1j * (ahead - behind))) / (2.0 * step)
    np.testing.assert_allclose(out[2:], rate[[0, 2]], rtol=1e-4, atol=1e-4)


@given(arrays(np.float64, (2, 3), elements=st.floats(-100.0, 100.0)))
def test_limit_keeps_direction(thrust):
    limited = thrust.copy()
    any_limited = limit_thrust(limited, 53.0)
    norms = np.linalg.norm(thrust, axis=1)
    assert any_limited == bool((norms > 53.0).any())
    assert (np.linalg.norm(limited, axis=1) <= 53.0 * (1 + 1e-12)).all()
    np.testing.assert_allclose(np.cross(limited, thrust), 0.0, atol=1e-9)
    np.testing.assert_array_equal(limited[norms <= 53.0], thrust[norms <= 53.0])
