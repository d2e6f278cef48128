"""Where the time goes: measured without changing the run."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.profile import profile_run


def prepared(robot):
    gait = hp.make_gait(robot)
    simulator = hp.Simulator(robot, hp.Ground(mu_s=0.25))
    simulator.reset(*gait.initial_state(sink=simulator.static_sink))
    return simulator, hp.make_controller("governed", gait, mu=0.25)


def test_profile_changes_nothing_and_agrees_with_the_log(robot):
    simulator, controller = prepared(robot)
    plain = simulator.run(controller, 0.1)
    simulator, controller = prepared(robot)
    run, profile = profile_run(simulator, controller, 0.1)
    for name in plain.signals:
        if name != "tick_ns":
            np.testing.assert_array_equal(run[name], plain[name])
    assert profile.ticks == 100
    assert profile.simulated == pytest.approx(0.1)
    # What each tick took by the log's own clock is the controller's part, but for the wrapper.
    ticks = 1e-9 * run["tick_ns"].sum()
    assert 0.5 * ticks < profile.parts["controller"] <= ticks
    assert min(profile.parts.values()) > 0.0
    assert list(profile.calls.values()) == [100, 200, 200, 100]
    # Everything is as it was: a second run is not measured.
    assert "advance" not in vars(simulator)
    assert "step" not in vars(controller)
    assert "update" not in vars(simulator.dynamics)


def test_profile_leaves_the_controller_as_it_was(robot):
    simulator, _ = prepared(robot)
    command = hp.Command(np.zeros(6), np.zeros((2, 3)))
    step = lambda state: command  # noqa: E731
    controller = SimpleNamespace(step=step)
    profile_run(simulator, controller, 0.005)
    assert controller.step is step

    class Slotted:
        __slots__ = ()

        def step(self, state):
            return command

    with pytest.raises(hp.InputError, match="cannot be profiled"):
        profile_run(simulator, Slotted(), 0.005)


def test_profile_lets_errors_through(robot):
    simulator, _ = prepared(robot)

    class Broken:
        def step(self, state):
            raise RuntimeError("no")

    with pytest.raises(hp.ControlError):
        profile_run(simulator, Broken(), 0.1)
    assert "advance" not in vars(simulator)
