"""Attacks on what is public, in one table: each is refused by an error of ours, or changes nothing."""

from __future__ import annotations

import os
import sys
import threading

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.gym.batched_env import BatchedEnv
from harpy_pin.contrib.shield_batch import ShieldBatch
from harpy_pin.errors import RunFileWarning

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


@pytest.mark.parametrize("controller", ["condensed", {"name": "wbc", "solver": "quadprog"}], ids=str)
def test_a_tick_waits_for_that_of_another_thread(controller):
    """Of a controller whose gait is Python in its first ticks, and with another solver in all."""
    scenario = hp.Scenario(controller=controller, gait={"name": "commanded", "velocity": "0.3 0 0"}, duration=0.3)
    run = hp.walk(scenario)
    names = ("q", "v", "foot_position", "foot_velocity", "foot_force")
    states = [hp.State(float(t), *(run[name][i] for name in names)) for i, t in enumerate(run["t"])]
    for _ in range(5):
        made = hp.build(scenario).controller

        def work(number, made=made):
            for i in range(300):
                assert np.isfinite(made.step(states[(7 * i + 100 * number) % len(states)]).torque).all()

        assert together(work) == []


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
    assert {str(error).split(":")[0] for error in errors} == {"another thread is in a step of this batch"}


def test_a_damaged_journal_says_so(tmp_path):
    """The log of a run whose journal was cut short meanwhile."""
    motion = hp.build(hp.Scenario(duration=2.5))
    inner = motion.controller

    class Damages:
        period = inner.period

        def step(self, state):
            if abs(state.t - 1.5) < 1e-9:
                os.truncate(tmp_path / "run.npz.part", 5000)
            return inner.step(state)

    with pytest.warns(RunFileWarning, match="was damaged while the run went on: 3 blocks of its log are lost"):
        run = motion.simulator.run(Damages(), 2.5, save=tmp_path / "run.npz")
    assert len(run) < 2500
