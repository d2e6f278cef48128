"""Half an hour of the exported estimator, in single precision: as good as in double precision, all
the time, and so is the place. The covariance stays positive.

The readings of a motion are repeated by a loop in C.
"""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from needs import needs_compiler, needs_robots

import harpy_pin as hp
from harpy_pin.export.code import controller_code, lengths
from harpy_pin.export.exported_controllers import exportable
from harpy_pin.export.recording import _library, record

MINUTES = 30
DURATION = 7.0
"""Of the motion, whose end is then repeated, s."""
LAP = """
int lap(struct $name_state *state, int from, int to, const real *target, $given,
        real *place, real *velocity, real *covariance)
{
    int bad = 0;
    $made
    for (int n = from; n < to; n++) {
        bad += 0 != $name_step(state, (const void *)(target + n * $target), $args, $outs);
        memcpy(place + 3 * n, out_q, 3 * sizeof(real));
        memcpy(velocity + 3 * n, out_v, 3 * sizeof(real));
    }
    memcpy(covariance, state->filter.covariance, sizeof state->filter.covariance);
    return bad;
}
"""


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


def with_lap(code, what):
    """The C, with a function that goes through recorded ticks."""
    given, made = lengths(what.inputs), lengths(what.outputs)
    texts = {
        "given": ", ".join(f"const real *{own}" for own in given),
        "made": " ".join(f"real out_{own}[{n}];" for own, n in made.items()),
        "target": str(sum(what.target[own][0].size for own in what.target.dtype.names)),
        "args": ", ".join(f"{own} + n * {n}" for own, n in given.items()),
        "outs": ", ".join(f"out_{own}" for own in made),
    }
    text = LAP.replace("$name", code.name)
    for own, value in texts.items():
        text = text.replace(f"${own}", value)
    return replace(code, source=code.source + text)


def laps(code, folder, what, given, first, count):
    """Of each lap on the same readings: velocities, m/s, the way, m, how many statuses are not
    good, and the least eigenvalue of the covariance at its end.
    """
    folder.mkdir()
    library = ctypes.CDLL(str(_library(with_lap(code, what), folder)))
    kind = np.dtype(code.real if code.real == "double" else "f4")
    state = ctypes.create_string_buffer(code.ram)
    getattr(library, f"{code.name}_init")(state)
    arrays = [given.target, *(given.inputs[name] for name in what.inputs)]
    columns = [np.ascontiguousarray(array, kind).reshape(len(given), -1) for array in arrays]
    place, velocity = np.zeros((2, len(given), 3), kind)
    covariance = np.zeros((15 + 3 * len(what.robot.feet),) * 2, kind)
    columns = [column for column in columns if column.size] + [place, velocity, covariance]
    pointers = [ctypes.c_void_p(column.ctypes.data) for column in columns]
    for n in range(count):
        bad = library.lap(state, first if n else 0, len(given), *pointers)
        known = np.flatnonzero(np.diag(covariance))
        least = np.linalg.eigvalsh(covariance[np.ix_(known, known)].astype(float))[0]
        yield velocity[first:].copy(), np.linalg.norm(place[-1] - place[first]), bad, least


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
    given, errors, ways = record(motion, what), {}, {}
    first = seam(run)
    true, count = (
        run["v"][first : len(given), :3],
        round(60.0 * MINUTES / (DURATION - 1e-3 * first)),
    )
    for single in (True, False):
        code = controller_code(what, f"{name}_estimator", single=single)
        walked = [*laps(code, tmp_path / code.real, what, given, first, count)]
        assert not sum(bad for _, _, bad, _ in walked)
        assert min(least for *_, least in walked) > 0.0
        errors[code.real] = np.array([np.sqrt(np.mean((v - true) ** 2)) for v, *_ in walked])
        ways[code.real] = np.array([way for _, way, _, _ in walked])
    for part in (slice(None), slice(-20, None)):
        float_, double = (np.sqrt(np.mean(errors[name][part] ** 2)) for name in ("float", "double"))
        np.testing.assert_allclose(float_, double, rtol=0.01)
        way, same = (ways[name][part].mean() for name in ("float", "double"))
        np.testing.assert_allclose(way, same, rtol=0.01 if moves else np.inf, atol=1e-4)
