"""The preview's program: its optimum beside a dense oracle, and the motion that its forces give
beside Newton and Euler.
"""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import harpy_pin as hp
from harpy_pin.contrib.preview.model import SingleBody, falling, sums
from harpy_pin.contrib.preview.program import force_program, solved

go2 = cache(lambda: hp.load_robot("go2"))
pytestmark = needs_robots


def body_at(seed: int) -> tuple[SingleBody, hp.State]:
    """Go2 as one body, at a random state near to its posture."""
    robot, rng = go2(), np.random.default_rng(seed)
    q, _ = hp.Standing(robot).initial_state()
    body = SingleBody(robot, q)
    q = pin.integrate(robot.model, q, 0.2 * rng.standard_normal(robot.model.nv))
    v = 0.5 * rng.standard_normal(robot.model.nv)
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    foot = dynamics.foot_position.copy()
    state = hp.State(0.0, q, v, foot, np.zeros((4, 3)), np.zeros((4, 3)))
    body.measure(state)
    return body, state


def program_of(seed: int, mu: float = 0.5, most: float = 30.0):
    """A program of eight stances in six intervals, its gains and what is missing."""
    rng = np.random.default_rng(seed)
    body, state = body_at(seed)
    times = np.cumsum(np.append(0.0, rng.uniform(0.01, 0.03, 6)))
    interval = np.array([0, 0, 1, 1, 3, 3, 4, 5])
    foot = (state.foot_position[rng.integers(4, size=8)] - body.place) @ body.turn
    gain = body.acceleration(foot, np.zeros((8, 3)))
    wanted = np.zeros((2, 6, 6))
    wanted[1, :, 0] = 1.0
    program = force_program(
        gain,
        interval,
        times,
        wanted - falling(body.motion, times),
        weights=rng.uniform(0.1, 100.0, (2, 6)),
        force_weight=1e-3,
        mu=mu,
        most=most,
    )
    return program, body, gain, interval, times


@pytest.mark.parametrize("seed", range(4))
def test_optimum_beside_a_dense_oracle(seed):
    program, *_ = program_of(seed)
    found = solved(program).ravel()
    scale = np.abs(program.hessian).max()
    rows = np.vstack((-program.rows, program.rows[4::5]))
    least = np.concatenate((-program.upper, program.lower[4::5]))
    oracle = minimize(
        lambda f: (0.5 * f @ program.hessian @ f + program.gradient @ f) / scale,
        np.tile((0.0, 0.0, 10.0), 8),
        jac=lambda f: (program.hessian @ f + program.gradient) / scale,
        constraints={"type": "ineq", "fun": lambda f: rows @ f - least, "jac": lambda f: rows},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-14},
    )
    np.testing.assert_allclose(found, oracle.x, atol=2e-2)
    # And its own conditions: no force within the cones is better, to first order
    slope = program.hessian @ found + program.gradient
    rng = np.random.default_rng(seed)
    for _ in range(200):
        other = rng.uniform((-15.0, -15.0, 0.0), (15.0, 15.0, 30.0), (8, 3))
        other[:, :2] = np.clip(other[:, :2], -0.5 * other[:, 2:], 0.5 * other[:, 2:])
        assert slope @ (other.ravel() - found) > -1e-2 * scale**0.5


@pytest.mark.parametrize(("mu", "most"), [(0.1, 30.0), (0.5, 12.0), (1.0, 100.0)])
def test_forces_are_inside_their_cones(mu, most):
    for seed in range(8):
        forces = solved(program_of(seed, mu, most)[0])
        assert (np.abs(forces[:, :2]) <= mu * forces[:, 2:] + 1e-3).all()
        assert forces[:, 2].min() > -1e-3
        assert forces[:, 2].max() < most + 1e-3


def test_motion_is_that_of_the_integrated_forces():
    """Momentum and place beside an integration of Newton's and Euler's equations, arms held."""
    program, body, gain, interval, times = program_of(5)
    forces = solved(program)
    motion = falling(body.motion, times) + program.effect @ forces.ravel()

    def rate(t, x):
        k = min(int(np.searchsorted(times, t, side="right")) - 1, 5)
        a = np.zeros(6)
        for one, force in zip(gain[interval == k], forces[interval == k], strict=True):
            a += one @ force
        a[2] -= 9.81
        return np.concatenate((x[6:], a))

    x = body.motion.ravel()
    for k in range(6):
        span = (times[k] + 1e-12, times[k + 1] - 1e-12)
        x = solve_ivp(rate, span, x, rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(motion[:, k].ravel(), x, atol=1e-7)
    impulse = sum(np.diff(times)[interval, None] * forces)
    weight = times[-1] * np.array([0.0, 0.0, 9.81])
    np.testing.assert_allclose(
        motion[1, -1, :3] - body.motion[1, :3], impulse - weight, atol=1e-9
    )  # momentum per mass


def test_accelerations_are_those_of_a_rigid_body():
    """Beside Pinocchio's centroidal inertia: moments about the centre of mass turn the body."""
    robot, rng = go2(), np.random.default_rng(6)
    q, v = hp.Standing(robot).initial_state()
    body = SingleBody(robot, q)
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    body.measure(hp.State(0.0, q, v, dynamics.foot_position, np.zeros((4, 3)), np.zeros((4, 3))))
    data = robot.model.createData()
    pin.ccrba(robot.model, data, q, v)
    centre = pin.centerOfMass(robot.model, data, q)
    foot, force = rng.normal(size=(2, 3, 3))
    gain = body.acceleration(foot - q[:3], np.zeros((3, 3)))
    for one, place, f in zip(gain, foot, force, strict=True):
        expected = np.linalg.solve(data.Ig.inertia, np.cross(place - centre, f))
        np.testing.assert_allclose(one @ f, [*f, *(robot.mass * expected)], atol=1e-9)


def test_sums_are_the_double_integral():
    times = np.array([0.0, 0.1, 0.25, 0.3])
    place, velocity = sums(times)
    a = np.array([2.0, -1.0, 3.0])
    np.testing.assert_allclose(velocity @ a, np.cumsum(np.diff(times) * a))
    x = v = 0.0
    for k, span in enumerate(np.diff(times)):
        x, v = x + span * v + 0.5 * a[k] * span**2, v + span * a[k]
        assert (place @ a)[k] == pytest.approx(x)


def test_no_stance_needs_no_forces():
    body, _ = body_at(7)
    program = force_program(
        np.zeros((0, 6, 3)),
        np.zeros(0, dtype=np.int64),
        np.array([0.0, 0.1]),
        np.zeros((2, 1, 6)),
        weights=np.ones((2, 6)),
        force_weight=1e-3,
        mu=0.5,
        most=30.0,
    )
    assert solved(program).shape == (0, 3)
    falls = falling(body.motion, np.array([0.0, 0.1]))
    np.testing.assert_allclose(falls[1, 0, 2], body.motion[1, 2] - 0.981)


def test_a_program_without_solution_is_refused():
    program, *_ = program_of(8)
    with pytest.raises(hp.HarpyError, match="no solution"):
        solved(program._replace(gradient=np.full_like(program.gradient, np.nan)))
