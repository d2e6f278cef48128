"""Intervals, contacts and footholds of the preview, beside the clock and a circle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harpy_pin.contrib.preview.footholds import along, footholds
from harpy_pin.contrib.preview.schedule import horizon

PAIRS = np.array([0.0, 0.5, 0.5, 0.0])


@given(st.floats(0.0, 0.999), st.floats(0.06, 0.3), st.floats(0.1, 0.4), st.floats(0.01, 0.05))
def test_contacts_are_those_of_the_clock(phase, stance, swing, longest):
    stride, phases = stance + swing, (phase + PAIRS) % 1.0
    ahead = horizon(phases, stance=stance, swing=swing, duration=0.4, longest=longest)
    span = np.diff(ahead.times)
    assert ahead.times[0] == 0.0
    assert ahead.times[-1] == pytest.approx(0.4)
    assert (span > 0.0).all()
    assert span.max() <= longest * (1.0 + 1e-5)
    for i, (begin, end) in enumerate(zip(ahead.times, ahead.times[1:], strict=False)):
        for t in np.linspace(begin, end, 5)[1:-1]:  # no foot is lifted or set down inside
            clock = (phases + t / stride) % 1.0
            assert (ahead.contact[i] == (clock < stance / stride)).all()
    # The stance of a foot begins at its touchdown, and its number grows by one each time
    for i, k in np.argwhere(ahead.contact):
        since = 0.5 * (ahead.times[i] + ahead.times[i + 1]) - ahead.touchdown[i, k]
        assert 0.0 <= since <= stance * (1.0 + 1e-6)
    for k in range(4):
        held = ahead.stance[ahead.contact[:, k], k]
        assert (np.diff(held) >= 0).all()
        assert held[0] == (0 if ahead.contact[0, k] else held[0])


def test_a_run_flies_and_a_walk_does_not():
    run = horizon(PAIRS, stance=0.1, swing=0.2, duration=0.3, longest=0.03)
    walk = horizon(PAIRS, stance=0.22, swing=0.2, duration=0.42, longest=0.03)
    flight = np.diff(run.times)[~run.contact.any(axis=1)].sum()
    assert flight == pytest.approx(0.3 - 2 * 0.1)
    assert walk.contact.any(axis=1).all()


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.floats(0.0, 0.5))
def test_path_is_a_circle(x, y, turning, t):
    steps = np.linspace(0.0, t, 2001)
    yaw = turning * steps
    rate = np.stack((np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y))
    expected = np.trapezoid(rate, steps, axis=1)
    place, end = along(np.array([x, y, turning]), np.array(t))
    np.testing.assert_allclose(place[:2], expected, atol=1e-6)
    assert float(end) == pytest.approx(turning * t)


def test_footholds_are_below_the_hips_and_catch_what_is_not_wanted():
    hip = np.array([[0.2, 0.1, 0.0], [-0.2, -0.1, 0.0]])
    middle = np.array([[0.1, 0.3]])
    common = {"velocity": np.array([2.0, 0.0, 0.0]), "catch": 0.1, "lean": 0.0}
    feet = footholds(hip, middle, excess=np.zeros(3), **common)
    np.testing.assert_allclose(feet, [[[0.4, 0.1, 0.0], [0.4, -0.1, 0.0]]])
    pushed = footholds(hip, middle, excess=np.array([0.0, 0.5, 9.0]), **common)
    np.testing.assert_allclose(pushed - feet, [[[0.0, 0.05, 0.0]] * 2])
    common["velocity"], common["lean"] = np.array([1.0, 0.0, 2.0]), 0.03
    turned = footholds(hip, middle, excess=np.zeros(3), **common)
    inside = footholds(hip, middle, excess=np.zeros(3), **common | {"lean": 0.0})
    np.testing.assert_allclose(turned - inside, [[[0.0, -0.06, 0.0]] * 2])  # away from the centre
