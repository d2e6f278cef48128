"""The task of the centre of mass: its rows against Pinocchio, and the optimum against Newton's
condensed.
"""

import numpy as np
import pinocchio as pin
from forward_dynamics import demand_of_centre
from hypothesis import given
from hypothesis import strategies as st
from whole_body_oracle import NV, ROBOT, WEIGHTS, wild_case

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights
from harpy_pin.wbc.condensed import CondensedSolver
from harpy_pin.wbc.problem import body_rows


def centred_case(seed, spread=0.2):
    rng = np.random.default_rng(seed)
    q, v, targets = wild_case(rng, spread=spread)
    dynamics = hp.Dynamics(ROBOT)
    dynamics.update(q, v)
    demand_of_centre(targets, dynamics)
    return rng, q, v, targets, dynamics


@given(st.integers(0, 10_000))
def test_rows_are_pinocchios(seed):
    rng, q, v, targets, dynamics = centred_case(seed)
    a, rows, value = rng.standard_normal(NV), np.empty((3, NV)), np.empty(3)
    data = ROBOT.model.createData()
    pin.centerOfMass(ROBOT.model, data, q, v, a)
    pin.forwardKinematics(ROBOT.model, data, q, v, a)
    body = pin.getClassicalAcceleration(ROBOT.model, data, 1, pin.LOCAL_WORLD_ALIGNED).linear
    body_rows(dynamics.record, targets.record, v, dynamics.rotation, rows, value)
    drift = targets.body - value
    expected = np.array([*data.acom[0][:2], body[2]])
    assert np.all(abs(rows @ a + drift - expected) <= 1e-10 * (1.0 + abs(drift)))


@given(st.integers(0, 10_000))
def test_the_optimum_obeys_newton(seed):
    """The acceleration of the centre of mass is that of all forces on the robot, and with little
    else to weigh and nothing at a limit it is the demanded one.
    """
    _, q, v, targets, dynamics = centred_case(seed, spread=0.05)
    targets.held[:], targets.force_range[:] = 1.0, (-1e4, 1e4)
    targets.body[:] *= 0.1
    weights = WholeBodyWeights(
        **{**vars(WEIGHTS), "orientation": 1e-6, "thrust": 1e-6, "force": 1e-9}
    )
    condensed = CondensedSolver(ROBOT, weights, WholeBodyLimits(mu=10.0, torque_scale=100.0))
    inputs = condensed.solve(dynamics, v, targets)
    data = ROBOT.model.createData()
    pin.centerOfMass(ROBOT.model, data, q, v, condensed.acceleration)
    total = condensed.force.sum(axis=0) + inputs[:6].reshape(2, 3).sum(axis=0)
    expected = total / ROBOT.mass + ROBOT.model.gravity.linear
    np.testing.assert_allclose(data.acom[0], expected, atol=1e-6 * (1.0 + np.abs(expected).max()))
    if (
        int(condensed.status) == 0
        and not (condensed.limits.pyramid @ condensed.force.T < 1e-6).any()
    ):
        np.testing.assert_allclose(
            data.acom[0][:2], targets.body[:2], atol=1e-2 * (1.0 + np.abs(targets.body).max())
        )
