"""Arguments of another kind: an error of ours that names them, never one of Python's or NumPy's."""

import math
import resource
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hostile import VALUES, outcome
from public_calls import calls as calls_of
from public_calls import public_names
from walks import started

import harpy_pin as hp
from harpy_pin import checks
from harpy_pin.contrib.shield_batch import ShieldBatch
from harpy_pin.contrib.threads import selection
from harpy_pin.errors import shown


class Unshowable:
    def __repr__(self):
        raise RuntimeError("no repr")


class Yaw:
    """A task that may return what no rows are."""

    def __init__(self, returned=None):
        self.returned = returned

    def rows(self, dynamics, state):
        honest = np.eye(6, len(state.v))[5:], -5.0 * state.v[5:6]
        return honest if self.returned is None else self.returned


CHANGED = (np.zeros((2, 12)), np.zeros(2)), (np.zeros((1, 12)), np.array([np.inf]))


@pytest.mark.parametrize(
    "returned", [None, 5, (1,), ([[1, 2], [3]], [1]), ([["x"]], [1]), *CHANGED], ids=range(7)
)
def test_rows_that_a_task_returns_later(gait, robot, returned):
    controller, task = hp.make_controller("wbc", gait, mu=0.25), Yaw()
    controller.add(task, weight=0.1)
    task.rows = lambda dynamics, state: returned
    simulator = started(hp.Simulator(robot), gait)
    with pytest.raises(hp.InputError, match="rows"):
        controller.step(simulator.state)


def test_rows_that_a_task_returns_at_first(gait):
    controller = hp.make_controller("wbc", gait, mu=0.25)
    for value in HOSTILE:
        outcome(controller.add, Yaw(value), weight=0.1)


@pytest.mark.parametrize(
    ("which", "says"),
    [([100], "from 0 to 1"), (1.5, "which"), ("x", "which"), ([True] * 3, "mask of 2")],
    ids=str,
)
def test_selections_of_a_batch(robot, which, says):
    with pytest.raises(hp.InputError, match=says):
        ShieldBatch(robot, 2, mu=0.25).reset(which)
    np.testing.assert_array_equal(selection("which", [False, True], 2), [1])
    np.testing.assert_array_equal(selection("which", None, 2), [0, 1])
    np.testing.assert_array_equal(selection("which", 1, 2), [1])
    assert len(selection("which", [], 2)) == 0


def test_one_name_is_not_its_letters(robot):
    with pytest.raises(
        hp.InputError, match=r"feet must be a tuple of names, got the name 'left_foot' alone"
    ):
        hp.load_robot(robot.urdf, feet="left_foot")


@pytest.mark.parametrize("value", ["0.3", b"0.3"])
def test_text_is_no_number(value):
    with pytest.raises(hp.InputError, match="must be a number"):
        checks.number("speed", value)


def test_values_in_messages_are_short_and_on_one_line():
    assert shown(np.zeros((9, 9))).count("\n") == 0
    assert len(shown("a" * 10_000)) == 60
    assert shown(10**5000) == "a value of type int"
    assert shown(Unshowable()) == "a value of type Unshowable"


SECONDS = 60
"""Of the process's CPU time in which a call has to end, and ten times as many by the clock;
compiling takes some.
"""
MEMORY = 3_000_000_000
"""Bytes beyond those of the process that a call may ask for."""
HOSTILE = (
    *(
        value for value in VALUES if not (isinstance(value, str) and len(value) > 1000)
    ),  # a path is shown as it is
    *(
        1 + 2j,
        b"x",
        [5],
        [100],
        [math.nan] * 3,
        [[1, 2], [3]],
        (1, 2),
        {"a"},
        {1: 2},
        range(3),
        "\0",
        Path("/nowhere"),
    ),
    *(
        np.zeros(3),
        np.zeros((2, 2)),
        np.zeros(97),
        np.zeros(0),
        np.zeros((0, 3)),
        np.array(1.0),
        np.array(["a"]),
    ),
    *(np.array([1 + 2j]), np.array(np.nan), np.array([1, 2], object), np.array([1, None], object)),
    *(np.zeros(6, np.float32), np.zeros((2, 3), order="F"), np.zeros(12)[::2], np.full(6, 1e300)),
    *(
        np.full((2, 3), np.nan),
        object(),
        int,
        Unshowable,
        Unshowable(),
        math,
        lambda: None,
        lambda a, b, c: None,
    ),
)
THOROUGHLY = {
    *(
        "Scenario",
        "Ground",
        "Push",
        "Disturbances",
        "simulation.Sensors",
        "load_robot",
        "load_harpy",
        "Simulator",
    ),
    *(
        "make_gait",
        "make_controller",
        "CondensedController",
        "controllers.GovernedController",
        "Dynamics",
        "build",
    ),
    *("WholeBodyController.add", "JointTask", "FrameTask", "Run.load", "measure"),
    *("contrib.shield_batch.ShieldBatch.reset", "gaits.StraightGait", "gaits.StraightGait.update"),
    "gaits.StraightGait.initial_state",
}
"""What most scripts call: all values for each argument, in every run."""


class Hangs(BaseException):
    """A call that does not end."""


@contextmanager
def bounded():
    """A call has some seconds and some memory."""

    def stop(*_):
        raise Hangs

    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    former = {kind: signal.signal(kind, stop) for kind in (signal.SIGPROF, signal.SIGALRM)}
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, before[1]))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.alarm(10 * SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for kind, handler in former.items():
            signal.signal(kind, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_what_most_scripts_call_is_there():
    named = {
        label for name, public in public_names().items() for label, _, _ in calls_of(name, public)
    }
    assert named >= THOROUGHLY


@pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="needs Linux: it bounds the memory of a call"
)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", public_names())
def test_every_argument_of_every_public_name(name, fuzz, tmp_path, monkeypatch):
    """Some hostile values for each argument, all of them for :data:`THOROUGHLY`; and for all with
    ``--fuzz 25``.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "harpy_pin.export.folder.missing_tools", lambda: "boards are emulated elsewhere"
    )
    rng = np.random.default_rng(sum(name.encode()))
    for label, function, given in calls_of(name, public_names()[name]):
        for argument in given:
            some = len(HOSTILE) if label in THOROUGHLY else 3 * fuzz
            for k in sorted(rng.permutation(len(HOSTILE))[:some]):
                if argument in ("controller", "solver") and callable(HOSTILE[k]):
                    continue  # a function of the user's: what it raises is passed on
                try:
                    with bounded():
                        outcome(function, **{**given, argument: HOSTILE[k]})
                except BaseException as error:
                    error.add_note(f"{label}({argument}=HOSTILE[{k}])")
                    raise
