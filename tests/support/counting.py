"""A controller that counts its ticks, and what its log must hold."""

import numpy as np

import harpy_pin as hp


class Counting:
    """Commands that say which tick they are of; does something at one of them."""

    period = 1e-3

    def __init__(self, at=-1, action=lambda: None):
        self.tick, self.at, self.action = 0, at, action

    def step(self, state):
        if self.tick == self.at:
            self.action()
        command = hp.Command(np.full(6, float(self.tick)), np.zeros((2, 3)))
        self.tick += 1
        return command


def check(run, rows):
    np.testing.assert_array_equal(run["torque"][:, 0], np.arange(rows))
    np.testing.assert_allclose(run["t"], 1e-3 * np.arange(rows), atol=1e-12)


def names(folder):
    return sorted(path.name for path in folder.iterdir())
