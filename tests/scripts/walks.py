"""Walk, push, save, load, measure."""

from pathlib import Path
from tempfile import mkdtemp
from typing import Any, assert_type

import numpy as np
from numpy.typing import NDArray

import harpy_pin as hp

path = Path(mkdtemp()) / "walk.npz"
scenario = hp.Scenario(
    controller="condensed",
    ground=hp.Ground(mu_s=0.3),
    duration=0.05,
    disturbances=hp.Disturbances(
        pushes=(hp.Push(0.01, (0.0, 1.0, 0.0)),), noise=hp.Noise.typical(0.1)
    ),
)
run = hp.walk(scenario, save=path)
assert_type(run, hp.Run)
assert_type(run.ending, str)
assert_type(run.metadata, dict[str, Any])
assert_type(run["q"], NDArray[Any])
again = hp.Run.load(path)
assert_type(again, hp.Run)
assert_type(hp.Scenario.of(again), hp.Scenario)
measures = hp.measure(again)
assert_type(measures, hp.log.Measures)
assert_type(measures.slip_mm_per_step, float)
height: float = float(run["q"][:, 2].mean())

robot = hp.load_harpy()
assert_type(robot, hp.Robot)
assert_type(robot.torque_limit, NDArray[np.float64])
gait = hp.make_gait(robot, speed=0.2)
assert_type(gait, hp.gaits.StraightGait)
simulator = hp.Simulator(robot, hp.Ground(mu_s=0.25))
simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
controller = hp.make_controller("wbc", gait, mu=0.25)
parts = simulator.run(controller, duration=0.01)
assert_type(parts, hp.Run)

try:
    hp.Scenario(controller="lqr")
except hp.InputError as error:
    assert_type(error.name, str)
else:
    raise AssertionError
