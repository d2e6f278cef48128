"""Attacks on what is public, in one table: each is refused by an error of ours, or changes
nothing.
"""

import pickle
import re
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from needs import needs_robots
from walks import own_search, states_of

import harpy_pin as hp
from harpy_pin.contrib import flight
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.flight import flying_gait
from harpy_pin.contrib.gym.batched_env import BatchedEnv
from harpy_pin.contrib.shield_batch import ShieldBatch

ROBOT = hp.load_harpy()
FEET, JOINTS = len(ROBOT.feet), len(ROBOT.joints)


def test_counts_are_not_assigned():
    for made in (CondensedBatch(ROBOT, 2), BatchedEnv(2), ShieldBatch(ROBOT, 2, mu=0.5)):
        with pytest.raises(AttributeError):
            made.n = 3
        assert made.n == 2


def together(work, count=3):
    """Errors of threads that work at a time, which Python changes as often as it can."""
    before, errors = sys.getswitchinterval(), []

    def guarded(number):
        try:
            work(number)
        except Exception as error:
            errors.append(error)

    sys.setswitchinterval(1e-6)
    threads = [threading.Thread(target=guarded, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    sys.setswitchinterval(before)
    return errors


@pytest.mark.parametrize(
    "controller", ["condensed", "wbc", {"name": "wbc", "solver": "daqp"}], ids=str
)
def test_a_tick_waits_for_that_of_another_thread(controller):
    """Of a controller whose gait is Python in its first ticks, and with another solver in all."""
    scenario = hp.Scenario(
        controller=controller, gait={"name": "commanded", "velocity": "0.3 0 0"}, duration=0.3
    )
    states = states_of(hp.walk(scenario))
    for _ in range(5):
        made = hp.build(scenario).controller

        def work(number, made=made):
            for i in range(300):
                assert np.isfinite(
                    made.step(states[(7 * i + 100 * number) % len(states)]).torque
                ).all()

        assert together(work) == []


def test_one_gait_in_two_threads():
    gait, states = hp.make_gait(ROBOT), states_of(hp.walk(hp.Scenario(duration=1.5)))[::20]

    def commands(own, offset):
        controller = hp.make_controller("governed", own, mu=0.25, governor="none")
        return [controller.step(state).torque.copy() for state in states[offset:]]

    expected = [commands(hp.make_gait(ROBOT), offset) for offset in (0, 1)]
    assert (
        together(
            lambda offset: np.testing.assert_array_equal(commands(gait, offset), expected[offset]),
            2,
        )
        == []
    )


def test_a_batch_is_stepped_by_one_thread_at_a_time():
    """Results are one array, so that waiting would not help."""
    n, rng = 200, np.random.default_rng(0)
    batch, (q, v) = CondensedBatch(ROBOT, n, threads=1), hp.make_gait(ROBOT).initial_state()
    given = np.tile(q, (n, 1)), rng.normal(size=(n, len(v))), np.zeros((n, FEET, 3))
    alone = batch.step(*given)[0].copy()

    def work(_):
        for _ in range(50):
            batch.reset()
            np.testing.assert_array_equal(batch.step(*given)[0], alone)

    errors = together(work)
    assert errors
    assert {str(error).split(":")[0] for error in errors} == {
        "another thread is in a step of this batch"
    }


class BadExporter:
    """An array of another library that cannot be read."""

    def __init__(self, answer):
        self.answer = answer

    def __dlpack_device__(self):
        return 1, 0

    def __dlpack__(self, **_):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def step_of_a_batch(q=None, *, name="go2", which="float64", **values):
    """A step of a batch of two standing robots, with other configurations, frictions or errors of
    mass.
    """
    robot = hp.load_robot(name)
    batch, (standing, v) = CondensedBatch(robot, 2, dtype=which), hp.Standing(robot).initial_state()
    for attribute, value in values.items():
        getattr(batch, attribute)[:] = value
    rows = np.tile(standing, (2, 1))
    return batch.step(
        rows if q is None else q(rows), np.zeros((2, len(v))), np.zeros((2, len(robot.feet), 3))
    )[0]


def edited(tmp_path, pattern, text, name="go2"):
    """A walking robot whose file has another text in all places."""
    robot = hp.load_robot(name)
    (tmp_path / "edited.urdf").write_text(re.sub(pattern, text, robot.urdf.read_text()))
    return hp.WalkingGait(hp.load_robot(tmp_path / "edited.urdf", feet=robot.feet)).max_speed


BATCH = {
    "text": (lambda q: q.astype(str), "must be an array of numbers"),
    "texts": (lambda q: [["1"] * 19] * 2, "must be an array of numbers"),
    "complex": (lambda q: q.astype(complex), "must be real"),
    "an exporter that raises": (lambda q: BadExporter(RuntimeError("no")), "RuntimeError: no"),
    "an exporter of something else": (lambda q: BadExporter(5), "must be an array of numbers"),
    "one row": (lambda q: q[0], "shape"),
}


@needs_robots
@pytest.mark.parametrize("attack", BATCH)
def test_a_batch_refuses_what_a_controller_does(attack):
    with pytest.raises(hp.InputError, match=BATCH[attack][1]):
        step_of_a_batch(BATCH[attack][0])


@needs_robots
@pytest.mark.parametrize(
    ("name", "value"), [("mu", -1.0), ("mu", np.nan), ("mass_error", -1.0), ("mass_error", -2.0)]
)
def test_a_batch_refuses_masses_and_frictions_that_are_none(name, value):
    with pytest.raises(hp.InputError, match=name):
        step_of_a_batch(**{name: value})


@needs_robots
def test_masked_numbers_are_not_measured(go2):
    """They count as not finite, in a batch and alone."""
    assert not step_of_a_batch(lambda q: np.ma.masked_array(q, mask=q > 0.2)).any()
    q, v = hp.Standing(go2).initial_state()
    controller = hp.make_controller("condensed", hp.Standing(go2), mu=0.5)
    controller.step(hp.State(0.0, np.ma.masked_array(q, mask=q > 0.2), v, *np.zeros((3, 4, 3))))
    assert controller.bad_samples == 1


@needs_robots
def test_targets_of_another_robot_are_refused():
    batch = CondensedBatch(hp.load_robot("go2"), 2)
    with pytest.raises(hp.InputError, match="same robot"):
        batch.targets.fill(hp.make_gait(ROBOT).update(0.0))


@needs_robots
@pytest.mark.parametrize("controller", ["condensed", "wbc"])
@pytest.mark.parametrize("name", ["q", "v", "foot_force"])
def test_a_first_sample_that_is_not_finite(go2, controller, name):
    """It is answered as by other gaits, and the walk that follows is that without it."""
    made = [
        hp.make_controller(
            controller,
            hp.WalkingGait(go2, velocity=(0.3, 0.0, 0.0)),
            mu=0.5,
            **own_search(controller),
        )
        for _ in "12"
    ]
    q, v = made[0].gait.initial_state()
    good = {"q": q, "v": v, "foot_position": np.zeros((4, 3)), "foot_velocity": np.zeros((4, 3))}
    good["foot_force"] = np.tile((0.0, 0.0, 37.0), (4, 1))
    bad = {**good, name: np.full_like(good[name], np.nan)}
    answer = made[0].step(hp.State(0.0, **bad))
    assert not answer.torque.any()
    assert made[0].bad_samples == 1
    for tick in range(1, 5):
        commands = [one.step(hp.State(1e-3 * tick, **good)).torque for one in made]
        np.testing.assert_array_equal(*commands)


@needs_robots
@pytest.mark.filterwarnings("ignore:.*effort 0")
def test_efforts_that_are_zero_or_tiny(tmp_path):
    assert (
        edited(tmp_path, 'effort="[^"]*"', 'effort="0"')
        == hp.WalkingGait(hp.load_robot("go2")).max_speed
    )
    with pytest.raises(hp.InputError, match="at no speed can the motors"):
        edited(tmp_path, 'effort="[^"]*"', 'effort="1e-6"')


@needs_robots
def test_axes_that_are_all_parallel(tmp_path):
    assert 0.0 < edited(tmp_path, '<axis xyz="[^"]*"', '<axis xyz="1 0 0"', name="solo12") < 10.0


def test_many_jumps_are_planned_once(monkeypatch):
    """And there is an upper end."""
    with pytest.raises(hp.InputError, match="at most 100"):
        flying_gait.read_flights("flights", [flight.Jump()] * 101)
    planned = []
    monkeypatch.setattr(flying_gait, "plan_jump", lambda flyer, jump: planned.append(jump))
    flight.FlyingGait(hp.make_commanded_gait(ROBOT), [flight.Jump(), flight.Fly()] * 30)
    assert planned == [flight.Jump()]


def test_a_run_without_ticks_is_a_table_without_rows(tmp_path):
    run = hp.walk(hp.Scenario(duration=0.01))
    empty = replace(run, signals={name: values[:0] for name, values in run.signals.items()})
    for made in (run, empty):
        made.to_csv(tmp_path / f"{len(made)}.csv")
    head = (tmp_path / "10.csv").read_text().splitlines()[0]
    assert (tmp_path / "0.csv").read_text().splitlines() == [head]


@needs_robots
@pytest.mark.parametrize("reward", [None, {"alive": 1.0}], ids=str)
def test_an_environment_is_pickled(reward):
    """In the middle of an episode; the copy goes on as the original does."""
    gymnasium = pytest.importorskip("gymnasium")
    made = gymnasium.make("harpy_pin.contrib.gym:Robot-v0", robot="go2", reward=reward)
    made.reset(seed=1)
    action = np.full(3, 0.5, np.float32)
    made.step(action)
    copied = pickle.loads(pickle.dumps(made))
    for one, other in zip(made.step(action)[:2], copied.step(action)[:2], strict=True):
        np.testing.assert_array_equal(one, other)
