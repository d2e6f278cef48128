"""Half an hour of the exported estimator, in single precision: as good as in double precision, all
the time.
"""

import ctypes

import numpy as np
import pytest
from needs import needs_compiler, needs_robots

import harpy_pin as hp
from harpy_pin.export.code import controller_code
from harpy_pin.export.exported_controllers import exportable
from harpy_pin.export.recording import _library, record

MINUTES = 30
DURATION = 7.0
"""Of the motion, whose end is then repeated, s."""


def seam(run):
    """The tick after the first second and before the fourth after which the motion goes on as after
    the last one.
    """
    moving = np.hstack([run["q"][1000:4000, 7:], 0.1 * run["v"][1000:4000, 6:]])
    last = np.concatenate([run["q"][-1, 7:], 0.1 * run["v"][-1, 6:]])
    return 1001 + int(np.argmin(np.linalg.norm(moving - last, axis=1)))


def gait_of(robot, moves):
    if robot.name == "harpy":
        return hp.make_gait(robot, speed=0.3 * moves)
    return hp.WalkingGait(robot, velocity=(0.2, 0.0, 0.0)) if moves else hp.Standing(robot)


def laps(code, folder, what, given, first, count):
    """The velocities, m/s, and whether every status is good, of each lap on the same readings."""
    folder.mkdir()
    library, kind = (
        ctypes.CDLL(str(_library(code, folder))),
        np.dtype(code.real if code.real == "double" else "f4"),
    )
    state, step = ctypes.create_string_buffer(code.ram), getattr(library, f"{code.name}_step")
    getattr(library, f"{code.name}_init")(state)
    arrays = [given.target, *(given.inputs[name] for name in what.inputs)]
    columns = [np.ascontiguousarray(array, kind) for array in arrays]
    columns = [column.reshape(len(given), -1) for column in columns]
    outputs = [np.zeros(int(np.prod(shape)), kind) for shape in what.outputs.values()]
    ends = [ctypes.c_void_p(output.ctypes.data) for output in outputs]
    velocity = outputs[list(what.outputs).index("v")]
    found = np.zeros((len(given), 3))
    for lap in range(count):
        ticks, statuses = range(first if lap else 0, len(given)), []
        for n in ticks:
            begins = [
                ctypes.c_void_p(c.ctypes.data + n * c.strides[0]) for c in columns if c.shape[1]
            ]
            statuses.append(step(state, *begins, *ends))
            found[n] = velocity[:3]
        yield found[first:].copy(), not any(statuses[first - len(given) :])


@needs_robots
@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize("moves", [False, True], ids=["stands", "steps"])
@pytest.mark.parametrize("name", ["harpy", "go2", "g1"])
def test_half_an_hour_in_single_precision(name, moves, tmp_path):
    robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
    scenario = hp.Scenario(
        robot=name, sensors=hp.Imu(), ground=hp.Ground(mu_s=0.6), duration=DURATION
    )
    motion, run = (
        hp.build(scenario, gait=gait_of(robot, moves)),
        hp.walk(scenario, gait=gait_of(robot, moves)),
    )
    what = exportable(motion.sensors.estimator)
    given, errors = record(motion, what), {}
    first = seam(run)
    true, count = (
        run["v"][first : len(given), :3],
        round(60.0 * MINUTES / (DURATION - 1e-3 * first)),
    )
    for single in (True, False):
        code = controller_code(what, f"{name}_estimator", single=single)
        walked = laps(code, tmp_path / code.real, what, given, first, count if single else 30)
        results = [(np.sqrt(np.mean((v - true) ** 2)), good) for v, good in walked]
        assert all(good for _, good in results)
        errors[code.real] = np.array([error for error, _ in results])
    np.testing.assert_allclose(
        np.median(errors["float"][5:]), np.median(errors["double"][5:]), rtol=0.01
    )
    assert errors["float"].max() < 1.1 * errors["double"].max()
