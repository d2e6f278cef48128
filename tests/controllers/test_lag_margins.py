"""Lag margins, against the eigenvalues of the sampled loop and walks."""

from __future__ import annotations

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.controllers.delay_margins import DelayedLoop
from harpy_pin.controllers.lag_margins import pd_lag_margin
from harpy_pin.errors import InputError

GAINS = [(25.0, 10.0), (400.0, 40.0), (100.0, 2.0)]


def grows(lag, k_p, k_d, *, period):
    """Rate of the worst motion of a double integrator that a lagging thrust moves, sampled and held."""
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
    """On one foot only thrusts balance, and where their directions lag, legs cannot make up for it."""
    lag = share * pd_lag_margin(*hp.WholeBodyParameters().orientation, period=1e-3)
    fans = hp.Actuators(thrusters=hp.Thrusters(turning_lag=lag))
    walk = hp.Scenario(ground=hp.Ground(mu_s=0.25), disturbances=hp.Disturbances(actuators=fans), duration=6.0)
    assert hp.walk(walk).fell == (share == 1.0)


@pytest.mark.parametrize("values", [{"k_p": 0.0}, {"k_d": -1.0}, {"period": -1.0}])
def test_values_out_of_their_domain(values):
    with pytest.raises(InputError):
        pd_lag_margin(**({"k_p": 1.0, "k_d": 1.0} | values))
