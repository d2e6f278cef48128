"""A simulator without physics."""

import pytest

import harpy_pin as hp


@pytest.fixture
def simulator(robot, monkeypatch):
    """A robot that hangs in the air without physics, so that runs are long and quick."""
    simulator = hp.Simulator(robot)
    simulator.reset(simulator.q, simulator.v)
    monkeypatch.setattr(simulator, "advance", lambda command, pushes=(), *, steps=1: None)
    return simulator
