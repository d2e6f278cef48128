"""Prints, as a JSON list, the kernels that a controller compiles or loads after its first tick, at
states of any size.

Arguments: the controller, its parameters as JSON, and ``added`` if a task is added to its program.
"""

import json
import sys

import numpy as np
from hostile_states import draw_hostile
from random_states import draw

import harpy_pin as hp
from harpy_pin.kernels.kernels import _KERNELS, wait_for_all

STATES = 1500

robot = hp.load_harpy()
gait = hp.make_gait(robot)
controller = hp.make_controller(sys.argv[1], gait, mu=0.25, **json.loads(sys.argv[2]))
if "added" in sys.argv:
    controller.add(hp.CentreOfMassTask(), lower=-100.0, upper=100.0)
q, v = gait.initial_state()
none = np.zeros((2, 3))
controller.step(
    hp.State(0.0, q, v, none, none, np.full((2, 3), (0.0, 0.0, 0.5 * 9.81 * robot.mass)))
)
wait_for_all()
known = {kernel: set(kernel._versions) for kernel in _KERNELS}
rng = np.random.default_rng(1)
for k in range(STATES):
    controller.step(draw_hostile(robot, rng) if k % 3 else draw(robot, rng))
print(
    json.dumps(
        sorted(
            kernel.__name__
            for kernel in _KERNELS
            if set(kernel._versions) - known.get(kernel, set())
        )
    )
)
