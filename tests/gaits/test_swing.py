"""The way of a swing foot beside polynomials of fifth order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial

from harpy_pin.gaits import swing


def quintic(begin, end, span):
    """Of least degree with a position, velocity and acceleration at both ends."""
    powers = np.array([[Polynomial.basis(n).deriv(d)(x) if d else x**n for n in range(6)]
                       for x in (0.0, span) for d in range(3)])  # fmt: skip
    return Polynomial(np.linalg.solve(powers, np.concatenate((begin, end))))


def test_swing_is_made_of_the_quintics():
    rng = np.random.default_rng(1)
    foot, goal = rng.normal(size=(3, 3)), rng.normal(size=3)
    ways = [quintic(foot[:, i], (goal[i], 0.0, 0.0), 0.3) for i in range(2)]
    up = quintic(foot[:, 2], (1.5, 0.0, 0.0), 0.1)
    down = quintic((1.5, 0.0, 0.0), (goal[2], 0.0, 0.0), 0.2)
    ticked, ticks = foot, np.linspace(0.0, 0.3, 61)
    for last, t in pairwise(ticks):
        found = swing(foot, goal, t, left=0.3, rise=0.1, apex=1.5)
        height = (up, t) if t < 0.1 else (down, t - 0.1)
        for i, (way, at) in enumerate(((ways[0], t), (ways[1], t), height)):
            expected = [(way.deriv(d) if d else way)(at) for d in range(3)]
            np.testing.assert_allclose(found[:, i], expected, atol=1e-9 * 1e3)
        ticked = swing(
            ticked, goal, t - last, left=0.3 - last, rise=0.1 - last, apex=1.5
        )  # begun anew at every tick it is the same
        np.testing.assert_allclose(ticked[0], found[0], atol=1e-6)
    np.testing.assert_array_equal(found[0], goal)
    np.testing.assert_array_equal(
        swing(foot[0], goal, 0.1, left=0.2, apex=2.0)[:, 2], [2.0, 0.0, 0.0]
    )


def test_swing_that_lands_early_and_going_down():
    """x and y by the quintic of a shorter time; z by the one in axes that come down."""
    rng = np.random.default_rng(4)
    foot, goal = rng.normal(size=(3, 3)), rng.normal(size=3)
    kind = {"early": 0.05, "descent": 0.4}
    ways = [quintic(foot[:, i], (goal[i], 0.0, 0.0), 0.25) for i in range(2)]
    up = quintic(foot[:, 2], (1.5, 0.0, 0.0), 0.1)
    down = quintic((1.5, 0.0, 0.0), (goal[2], -0.4, 0.0), 0.2)
    ticked, ticks = foot, np.linspace(0.0, 0.3, 61)
    for last, t in pairwise(ticks):
        found = swing(foot, goal, t, left=0.3, rise=0.1, apex=1.5, **kind)
        height = (up, t) if t < 0.1 else (down, t - 0.1)
        for i, (way, at) in enumerate(((ways[0], min(t, 0.25)), (ways[1], min(t, 0.25)), height)):
            expected = [(way.deriv(d) if d else way)(at) for d in range(3)]
            np.testing.assert_allclose(found[:, i], expected, atol=1e-6)
        begun = {"left": 0.3 - last, "rise": 0.1 - last, "apex": 1.5}
        ticked = swing(ticked, goal, t - last, **begun, **kind)
        np.testing.assert_allclose(ticked[0], found[0], atol=1e-6)
    later = swing(foot, goal, 0.35, left=0.3, rise=0.1, apex=1.5, **kind)
    np.testing.assert_allclose(later, [goal - [0, 0, 0.02], [0, 0, -0.4], [0, 0, 0]], atol=1e-12)
