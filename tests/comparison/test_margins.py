"""Margins of delay and lag: against simulated loops, eigenvalues, closed forms, Pinocchio, and
walks.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import harpy_pin as hp
from comparison.contenders import published_parameters
from comparison.studies.margins import (
    DelayedLoop,
    joint_loop,
    joint_mobility,
    pd_delay_margin,
    pd_lag_margin,
)

T = 1e-3


def simulated(loop, delay, x, ticks):
    """(ticks + 1, n) states at the ticks, integrated by an adaptive method, with commands that
    arrive late.
    """
    sent, states = [], [x]
    zero = np.zeros(loop.b.shape[1])
    for j in range(ticks):
        sent.append(-loop.k @ x)  # of the state at j T; it acts from j T + delay on
        begin = j * loop.period
        switches = sorted(
            {begin, begin + loop.period} | {i * loop.period + delay for i in range(j + 1)}
        )
        switches = [s for s in switches if begin <= s <= begin + loop.period]
        for start, end in pairwise(switches):
            if end - start < 1e-12:
                continue
            newest = int(np.floor((0.5 * (start + end) - delay) / loop.period))
            u = sent[newest] if newest >= 0 else zero
            x = solve_ivp(
                lambda _, y, u=u: loop.a @ y + loop.b @ u, (start, end), x, rtol=1e-10, atol=1e-12
            ).y[:, -1]
        states.append(x)
    return np.array(states)


def random_loop(seed):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 4)), int(rng.integers(1, 3))
    return DelayedLoop(
        30.0 * rng.normal(size=(n, n)),
        rng.normal(size=(n, m)),
        40.0 * rng.normal(size=(m, n)),
        2e-3,
    )


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("delay", [0.0, 0.7e-3, 2e-3, 3.1e-3, 6e-3])
def test_the_map_is_the_simulated_loop(seed, delay):
    """From rest in every command: state after state."""
    loop = random_loop(seed)
    n = len(loop.a)
    matrix, x0 = loop.matrix(delay), np.random.default_rng(seed).normal(size=n)
    desired = simulated(loop, delay, x0, 12)
    z = np.concatenate((x0, np.zeros(len(matrix) - n)))
    for state in desired:
        np.testing.assert_allclose(
            z[:n], state, rtol=1e-6, atol=1e-8 * (1.0 + np.abs(desired).max())
        )
        z = matrix @ z


@settings(max_examples=10)
@given(st.floats(20.0, 2000.0), st.floats(20.0, 100.0))
def test_the_margin_parts_decay_from_growth(k_p, k_d):
    """A simulated loop with a little less delay comes to rest, with a little more it grows."""
    loop = DelayedLoop(
        np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[k_p, k_d]]), T
    )
    margin = loop.delay_margin()
    assert 0.0 < margin < 0.1
    for share, grows in ((0.9, False), (1.1, True)):
        matrix = loop.matrix(share * margin)
        late = np.linalg.matrix_power(matrix, 4000)
        assert (np.abs(late).max() > np.abs(np.linalg.matrix_power(matrix, 2000)).max()) == grows
    # The closed form, to second order in ω_c T.
    crossover = np.sqrt(0.5 * (k_d**2 + np.sqrt(k_d**4 + 4.0 * k_p**2)))
    assert margin == pytest.approx(
        pd_delay_margin(k_p, k_d, period=T), abs=(crossover * T) ** 2 * T + 0.02 * T
    )


def test_the_closed_form_is_the_phase_margin():
    """At the margin the open loop with its delay is exactly −1 at the crossover."""
    for k_p, k_d in ((400.0, 40.0), (25.0, 10.0), (0.0, 200.0)):
        delay = pd_delay_margin(k_p, k_d)
        omega = np.sqrt(0.5 * (k_d**2 + np.sqrt(k_d**4 + 4.0 * k_p**2)))
        s = 1j * omega
        assert (k_d * s + k_p) / s**2 * np.exp(-s * delay) == pytest.approx(-1.0)
    assert pd_delay_margin(0.0, 200.0, period=T) == pytest.approx(np.pi / 400.0 - 5e-4)
    assert pd_delay_margin(0.0, 1e5, period=T) == 0.0


def test_a_loop_that_needs_no_delay_to_fall_has_no_margin():
    """equations.md's derivative gain of 40 on the inertia a hip motor feels in the air, held over 1
    ms.
    """
    loop = DelayedLoop(
        np.array([[0.0, 1.0], [0.0, 0.0]]),
        np.array([[0.0], [1.0 / 0.017]]),
        np.array([[1000.0, 40.0]]),
        T,
    )
    assert loop.delay_margin() == 0.0
    assert loop.growth(0.0) > 0.0
    steady = DelayedLoop(np.array([[-1.0]]), np.array([[1.0]]), np.array([[0.5]]), T)
    assert steady.delay_margin() == np.inf


@pytest.mark.parametrize("held", [(), ("left_foot",), ("left_foot", "right_foot")])
def test_mobility_is_pinocchios(robot, held):
    """Accelerations of the joints per torque: the equations of motion with held feet, from
    Pinocchio's terms.
    """
    q = hp.make_gait(robot).initial_state()[0]
    mobility = joint_mobility(robot, q, held=held)
    model, data = robot.model, robot.model.createData()
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    frames = [robot.frame_id(foot) for foot in held]
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    rows = [pin.computeFrameJacobian(model, data, q, frame, world)[:3] for frame in frames]
    jacobian = np.vstack(rows) if rows else np.zeros((0, model.nv))
    zero = np.zeros((len(jacobian), len(jacobian)))
    system = np.block([[mass, jacobian.T], [jacobian, zero]])
    for j in range(6):
        force = np.zeros(len(system))
        force[6 + j] = 1.0
        np.testing.assert_allclose(
            mobility[:, j], np.linalg.solve(system, force)[6:12], rtol=1e-8, atol=1e-8
        )


def test_the_margin_of_the_joint_pid_is_where_walks_fall(robot):
    """The paper's legs: the smallest margin of their joints lies between the delay that walks
    survive and the one at which they fall, at two control periods.
    """
    gains = hp.controllers.GovernedParameters().joints
    q = hp.make_gait(robot).initial_state()[0]
    for period, survives, falls in ((1e-3, 1e-3, 2e-3), (5e-4, 1e-3, 2e-3)):
        margins = [
            joint_loop(
                robot, q, k_p=gains.k_p * 2, k_d=gains.k_d * 2, held=held, period=period
            ).delay_margin()
            for held in ((), ("left_foot",), ("right_foot",))
        ]
        assert survives < min(margins) < falls
        for delay, ending in ((survives, "completed"), (falls, "fell")):
            scenario = hp.Scenario(
                controller=hp.Governed(governor="none"),
                ground=hp.Ground(mu_s=0.8),
                disturbances=hp.Disturbances(delay=delay),
                period=period,
                duration=1.0,
            )
            run = hp.walk(scenario)
            assert run.ending == ending, (period, delay)


GAINS = [(25.0, 10.0), (400.0, 40.0), (100.0, 2.0)]


def grows(lag, k_p, k_d, *, period):
    """Rate of the worst motion of a double integrator that a lagging thrust moves, sampled and
    held.
    """
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / lag]])
    b = np.array([[0.0], [0.0], [1.0 / lag]])
    k = np.array([[k_p, k_d, 0.0]])
    return DelayedLoop(a=a, b=b, k=k, period=period).growth(0.0)


@pytest.mark.parametrize(("k_p", "k_d"), GAINS)
@pytest.mark.parametrize("period", [1e-5, 1e-3])
def test_margin_is_where_the_sampled_loop_becomes_unstable(k_p, k_d, period):
    margin = pd_lag_margin(k_p, k_d, period=period)
    near = 5e-3 if period == 1e-3 else 1e-4
    assert grows(margin * (1.0 - near), k_p, k_d, period=period) < 0.0
    assert grows(margin * (1.0 + near), k_p, k_d, period=period) > 0.0


def test_margin_without_a_hold():
    assert pd_lag_margin(400.0, 40.0) == pytest.approx(0.1)
    assert pd_lag_margin(400.0, 0.0) == 0.0


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_directions_that_lag_fell_a_walk_beyond_the_margin(share):
    """On one foot only thrusts balance, and where their directions lag, legs cannot make up for
    it.
    """
    lag = share * pd_lag_margin(*published_parameters().orientation, period=1e-3)
    fans = hp.Actuators(thrusters=hp.Thrusters(turning_lag=lag))
    walk = hp.Scenario(
        ground=hp.Ground(mu_s=0.25), disturbances=hp.Disturbances(actuators=fans), duration=6.0
    )
    assert hp.walk(walk).fell == (share == 1.0)
