"""The filter against its equations, written down once more with complex numbers, and against a
dense Kalman filter.
"""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

import harpy_pin as hp
from harpy_pin.estimation import EstimatorSettings
from harpy_pin.estimation import invariant_filter as filters
from harpy_pin.kernels import kernel
from harpy_pin.model.vectors import exp

NAMES = ("rotation", "velocity", "position", "gyroscope_bias", "accelerometer_bias", "foothold")
FEET, N = 2, 21
GRAVITY = np.array([0.0, 0.0, -9.81])
STEP = 1e-20


def make(**how):
    robot = hp.load_harpy()
    return hp.Estimator(robot, settings=EstimatorSettings(**how))._record_["filter"]


def cross(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def exp3(w):
    """By its series: complex numbers pass through."""
    term = out = np.eye(3, dtype=np.asarray(w).dtype)
    for n in range(1, 25):
        term = term @ cross(w) / n
        out = out + term
    return out


def draw(rng):
    size = {"rotation": None, "foothold": (FEET, 3)}
    values = {
        name: 0.5 * rng.standard_normal(size.get(name, 3)) for name in NAMES if name != "rotation"
    }
    return {"rotation": exp3(rng.standard_normal(3)), **values}


def put(f, state):
    for name, value in state.items():
        f[name] = value
    f["held"] = 1


def rates(state, gyroscope, accelerometer):
    """The right sides of the differential equations."""
    w, a = gyroscope - state["gyroscope_bias"], accelerometer - state["accelerometer_bias"]
    return {
        "rotation": state["rotation"] @ cross(w),
        "velocity": state["rotation"] @ a + GRAVITY,
        "position": state["velocity"],
        "gyroscope_bias": np.zeros(3),
        "accelerometer_bias": np.zeros(3),
        "foothold": np.tile(-state["velocity"], (FEET, 1)),
    }


def erroneous(state, x):
    """The estimate whose errors are x."""
    turn = exp3(x[:3])
    return {
        "rotation": turn @ state["rotation"],
        "velocity": turn @ state["velocity"] + x[3:6],
        "position": state["position"] + x[6:9],
        "gyroscope_bias": state["gyroscope_bias"] + x[9:12],
        "accelerometer_bias": state["accelerometer_bias"] + x[12:15],
        "foothold": state["foothold"] @ turn.T + x[15:].reshape(FEET, 3),
    }


def error_rates(state, estimate, sample):
    """Rates of the errors, from those of state and estimate; to first order in the errors they are
    linear in them.
    """
    own, other = rates(state, *sample), rates(estimate, *sample)
    turn = estimate["rotation"] @ state["rotation"].T
    spin = other["rotation"] @ state["rotation"].T + estimate["rotation"] @ own["rotation"].T

    def moved(name):
        return other[name] - own[name] @ turn.T - state[name] @ spin.T

    out = [
        np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2
    ]
    out += [
        moved("velocity"),
        other["position"] - own["position"],
        np.zeros(6),
        moved("foothold").ravel(),
    ]
    return np.concatenate(out)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_linear_errors_are_the_derivative_by_complex_step(seed):
    rng = np.random.default_rng(seed)
    f, state = make(), draw(rng)
    sample = rng.standard_normal((2, 3))
    derivative = np.empty((N, N))
    for i in range(N):
        x = np.zeros(N, complex)
        x[i] = STEP * 1j
        derivative[:, i] = error_rates(state, erroneous(state, x), sample).imag / STEP
    put(f, state)
    moved = np.eye(N)
    filters._advance_rows(f, moved)
    period = f["period"][0]
    np.testing.assert_allclose((moved - np.eye(N)) / period, derivative, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_covariance_and_correction_are_those_of_a_dense_filter(seed):
    rng = np.random.default_rng(seed)
    f, state = make(height_noise=np.inf), draw(rng)
    root = 0.01 * rng.standard_normal((N, N))
    before = root @ root.T
    noise = np.diag(rng.uniform(1e-6, 1e-4, 3))
    place = state["rotation"].T @ state["foothold"][1] + 1e-3 * rng.standard_normal(3)
    put(f, state)
    f["covariance"], f["gate"] = before, np.inf
    assert filters.take_kinematics(f, 1, place, noise)
    h = np.zeros((3, N))
    h[:, 18:] = -np.eye(3)
    innovation = state["rotation"] @ place - state["foothold"][1]
    gain = before @ h.T @ np.linalg.inv(h @ before @ h.T + noise)
    rest = np.eye(N) - gain @ h
    np.testing.assert_allclose(
        f["covariance"][0], rest @ before @ rest.T + gain @ noise @ gain.T, atol=1e-12
    )
    x = gain @ innovation
    back = pin.exp3(-x[:3])
    np.testing.assert_allclose(f["rotation"][0], back @ state["rotation"], atol=1e-12)
    np.testing.assert_allclose(f["velocity"][0], back @ (state["velocity"] - x[3:6]), atol=1e-12)
    np.testing.assert_allclose(
        f["foothold"][0], (state["foothold"] - x[15:].reshape(2, 3)) @ back.T, atol=1e-12
    )
    np.testing.assert_allclose(
        f["gyroscope_bias"][0], state["gyroscope_bias"] - x[9:12], atol=1e-12
    )


def test_prediction_converges_to_the_exact_motion():
    """Constant angular velocity and acceleration in the body: the closed form is a series of
    exponentials.
    """
    spin, push = np.array([0.3, -1.0, 0.7]), np.array([1.0, 2.0, 9.0])
    f = make()
    filters.begin_filter(f)
    f["velocity"] = 0.0
    for _ in range(1000):
        filters.predict(f, spin, push, np.zeros((FEET, 3)))
    times = np.linspace(0.0, 1.0, 100_001)
    middle = 0.5 * (times[1:] + times[:-1])
    rotations = np.array([pin.exp3(spin * t) @ push for t in middle])
    np.testing.assert_allclose(f["rotation"][0], pin.exp3(spin), atol=1e-12)
    np.testing.assert_allclose(f["velocity"][0], rotations.mean(axis=0) + GRAVITY, atol=1e-6)


def test_errors_are_as_large_as_the_covariance_says():
    """The mean normalised squared error of 50 runs, drawn as the filter believes, is inside its
    band of 95 %.
    """
    errors = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        f = make(height_noise=np.inf, tilt=0.03, velocity=0.1, gate=1e6)
        filters.begin_filter(f)
        period, feet = f["period"][0], np.array([[0.1, 0.2, 0.0], [-0.1, -0.2, 0.0]])
        truth = {
            "rotation": np.eye(3),
            "velocity": np.zeros(3),
            "position": np.array([0.0, 0.0, 0.5]),
        }
        biases = [
            density * rng.standard_normal(3) for density in (f["start"][0, 9], f["start"][0, 12])
        ]
        start = f["start"][0] * rng.standard_normal(15)
        f["rotation"] = pin.exp3(start[:3])
        f["velocity"], f["position"] = start[3:6], truth["position"]
        f["gyroscope_bias"] = f["accelerometer_bias"] = 0.0
        noise = 1e-6 * np.eye(3)
        deviations = [
            f[name][0] / np.sqrt(period) for name in ("gyroscope_density", "accelerometer_density")
        ]
        for n in range(400):
            t = n * period
            spin = np.array([0.5 * np.sin(7 * t), 0.4 * np.cos(5 * t), 0.6 * np.sin(3 * t)])
            force = np.array([2.0 * np.sin(9 * t), np.cos(11 * t), 9.81 + np.sin(13 * t)])
            half = pin.exp3(0.5 * period * spin)
            middle = truth["rotation"] @ half
            speed = truth["velocity"] + period * (middle @ force + GRAVITY)
            truth["position"] = truth["position"] + 0.5 * period * (truth["velocity"] + speed)
            truth["velocity"], truth["rotation"] = speed, middle @ half
            sensors = zip((spin, force), deviations, biases, strict=True)
            said = [a + d * rng.standard_normal(3) + b for a, d, b in sensors]
            said[0] -= f["gyroscope_bias"][0]
            said[1] -= f["accelerometer_bias"][0]
            filters.predict(f, *said, np.zeros((FEET, 3)))
            for k in range(FEET):
                place = truth["rotation"].T @ (
                    feet[k] - truth["position"]
                ) + 1e-3 * rng.standard_normal(3)
                if f["held"][0, k]:
                    filters.slide(f, k, 1e-6)
                    filters.take_kinematics(f, k, place, noise)
                else:
                    filters.touch_down(f, k, place, noise)
        turn = f["rotation"][0] @ truth["rotation"].T
        parts = [
            pin.log3(turn),
            f["velocity"][0] - turn @ truth["velocity"],
            f["position"][0] - truth["position"],
        ]
        x = np.concatenate(
            [*parts, f["gyroscope_bias"][0] - biases[0], f["accelerometer_bias"][0] - biases[1]]
        )
        seen = [
            0,
            1,
            3,
            4,
            5,
            8,
            9,
            10,
            12,
            13,
            14,
        ]  # heading and what moves with it is as at the start
        covariance = f["covariance"][0][np.ix_(seen, seen)]
        errors.append(x[seen] @ np.linalg.solve(covariance, x[seen]))
    low, high = chi2.ppf([0.025, 0.975], 50 * 11) / 50
    assert low < np.mean(errors) < high


@kernel(w=(3,), out=(3, 3))
def rotation_into(w, out):
    out[:] = exp(w)


@pytest.mark.parametrize("angle", [0.3, 2.0, 3.141592653589793])
def test_rotation_vectors(angle):
    axis = np.array([0.6, -0.48, 0.64])
    out = np.empty((3, 3))
    rotation_into(angle * axis, out)
    np.testing.assert_allclose(out, pin.exp3(angle * axis), atol=1e-14)
