"""A standing robot, and controllers that follow a script."""

import numpy as np
from walks import started

import harpy_pin as hp
from harpy_pin import Command, Ground, Simulator

NO_COMMAND = Command(np.zeros(0), np.zeros((0, 3)))


def idle():
    return Command(np.zeros(6), np.zeros((2, 3)))


class Script:
    """A controller that does what a function of (tick, state) says."""

    def __init__(self, function, period=1e-3):
        self.function, self.period, self.tick = function, period, -1

    def step(self, state):
        self.tick += 1
        return self.function(self.tick, state)


def standing(robot, dt=5e-4, mu=0.8):
    gait = hp.make_gait(robot, speed=0.0)
    return started(Simulator(robot, Ground(mu_s=mu), dt=dt), gait), gait
