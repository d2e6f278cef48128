"""Pushes against momentum, and what a push refuses."""

from itertools import pairwise

import numpy as np
import pytest
from walks import put, walked

import harpy_pin as hp
from harpy_pin import Command, InputError, Simulator
from harpy_pin.simulation.push import Push

IMPULSE = (0.7, -1.3, 0.4)


@pytest.mark.parametrize("duration", [1e-4, 0.0123, 0.1])
def test_the_impulse_is_whole_whatever_the_step(sled, duration):
    """A body pushed at its centre of mass gains exactly the impulse, however the push and the steps
    meet.
    """
    simulator = put(Simulator(sled, gravity=(0.0, 0.0, 0.0)), z=1.0)
    pushes = (Push(0.0102, IMPULSE, duration), Push(0.03, IMPULSE, duration))
    for _ in range(300):
        simulator.advance(Command(np.zeros(0), np.zeros((0, 3))), pushes)
    np.testing.assert_allclose(2.0 * simulator.v[:3], 2.0 * np.array(IMPULSE), rtol=1e-10)


def test_the_force_is_half_a_sine():
    push = Push(1.0, IMPULSE, 0.1)
    times = np.linspace(0.95, 1.15, 401)
    share = np.array([push.share(a, b) for a, b in pairwise(times)])
    phase = np.clip((0.5 * (times[:-1] + times[1:]) - 1.0) / 0.1, 0.0, 1.0)
    np.testing.assert_allclose(
        share, 0.5 * np.pi * np.sin(np.pi * phase) * (times[1] - times[0]) / 0.1, atol=1e-6
    )
    assert share.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_walk_is_pushed_where_it_was_asked_to_be():
    ways = {}
    for y in (-1.0, 0.0, 1.0):
        pushes = (Push(0.3, (0.0, y, 0.0)),) if y else ()
        run = walked(controller=hp.Governed(governor="none"), mu_s=0.8, duration=0.5, pushes=pushes)
        assert [p["impulse"][1] for p in run.metadata["pushes"]] == ([y] if y else [])
        ways[y] = run["q"][:, 1]
    np.testing.assert_array_equal(ways[1.0][:301], ways[0.0][:301])
    assert ways[-1.0][-1] < ways[0.0][-1] - 0.005 < ways[0.0][-1] + 0.005 < ways[1.0][-1]


@pytest.mark.parametrize("time", [0.5, 3.0])
def test_a_push_outside_the_run_is_refused(gait, robot, time):
    simulator = Simulator(robot)
    simulator.reset(*gait.initial_state())
    with pytest.raises(InputError, match="outside the run"):
        simulator.run(hp.make_controller("wbc", gait, mu=0.8), 0.5, pushes=[Push(time, IMPULSE)])
