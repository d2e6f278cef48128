"""Where the time of a run goes: the parts, their sum, and that looking changes nothing. No time is ever asserted."""

from __future__ import annotations

import json
from contextlib import suppress

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin import Command, ControlError, Ground, InputError, Simulator
from harpy_pin.cli.output import profile_table
from harpy_pin.simulation.profile import TIMED, Profiler

TICKS = 120
PARTS = ("controller tick", *TIMED.values(), "first calls", "clocks", "rest")


def scene(robot, governor="paper"):
    gait = hp.make_gait(robot)
    simulator = Simulator(robot, Ground(mu_s=0.8))
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    return simulator, hp.make_controller("governed", gait, mu=0.8, governor=governor)


@pytest.fixture(scope="module")
def profiled(robot):
    simulator, controller = scene(robot)
    with Profiler(simulator) as profiler:
        run = simulator.run(controller, TICKS * 1e-3)
    return simulator, run, profiler.profile(run)


def test_parts_sum_to_the_total(profiled):
    _, run, profile = profiled
    assert tuple(part.name for part in profile.parts) == PARTS
    assert sum(part.seconds for part in profile.parts) == pytest.approx(profile.total)
    # What was timed lies within the total and does not overlap: the clocks' cost is the only estimate.
    timed = sum(profile[name].seconds for name in (*PARTS[:-2],))
    assert 0.0 < timed <= profile.total
    assert all(profile[name].seconds > 0.0 for name in ("controller tick", "first calls"))
    assert profile["controller tick"].seconds == pytest.approx(1e-9 * run["tick_ns"][1:].sum())
    assert profile.simulated == pytest.approx(TICKS * 1e-3)
    assert profile.real_time_factor > profile.simulated / profile.total


def test_every_call_is_counted_once(profiled):
    _, run, profile = profiled
    assert profile.ticks == len(run) == TICKS
    assert profile["controller tick"].calls == profile["log"].calls == TICKS - 1
    assert profile["physics steps"].calls == TICKS - 1


@pytest.mark.parametrize("governor", ["none", "paper", "filter"])
def test_profiled_run_is_the_run(robot, governor):
    simulator, controller = scene(robot, governor)
    plain = simulator.run(controller, 0.2)
    simulator, controller = scene(robot, governor)
    with Profiler(simulator):
        profiled = simulator.run(controller, 0.2)
    assert plain.signals.keys() == profiled.signals.keys()
    for name in plain.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(profiled[name], plain[name], err_msg=name)
    assert profiled.metadata == plain.metadata


def test_profiler_takes_itself_away(robot):
    simulator, controller = scene(robot)
    before = set(vars(simulator))
    with Profiler(simulator):
        assert set(vars(simulator)) - before == set(TIMED)
    assert set(vars(simulator)) == before
    with suppress(ZeroDivisionError), Profiler(simulator):
        raise ZeroDivisionError
    assert set(vars(simulator)) == before
    assert simulator.run(controller, 0.01).ending == "completed"


def test_profiler_leaves_a_method_of_the_objects_own(robot):
    simulator, controller = scene(robot)
    moves, move = [], simulator.advance

    def counted(*arguments, **options):
        moves.append(1)
        move(*arguments, **options)

    simulator.advance = counted
    with Profiler(simulator) as profiler:
        run = simulator.run(controller, 0.01)
    assert simulator.advance is counted
    assert len(moves) == 10
    assert profiler.profile(run)["physics steps"].calls == 9


def test_controller_with_slots_is_profiled(robot):
    class Slotted:
        __slots__ = ()

        def step(self, state):
            return Command(np.zeros(6), np.zeros((2, 3)))

    simulator, _ = scene(robot)
    with Profiler(simulator) as profiler:
        run = simulator.run(Slotted(), 0.01)
    assert profiler.profile(run)["controller tick"].calls == 9


def test_profiler_is_used_again(robot):
    simulator, controller = scene(robot)
    profiler = Profiler(simulator)
    for ticks in (30, 20):
        with profiler:
            run = simulator.run(controller, ticks * 1e-3)
        assert profiler.profile(run)["log"].calls == ticks - 1


def test_run_that_failed_is_profiled(robot):
    class Failing:
        ticks = 0

        def step(self, state):
            self.ticks += 1
            if self.ticks > 5:
                raise ZeroDivisionError
            return Command(np.zeros(6), np.zeros((2, 3)))

    simulator, _ = scene(robot)
    with pytest.raises(ControlError) as caught, Profiler(simulator) as profiler:
        simulator.run(Failing(), 1.0)
    profile = profiler.profile(caught.value.run)
    assert profile.ticks == 5
    assert profile["physics steps"].calls == 4


def test_unknown_part(profiled):
    with pytest.raises(InputError, match="rest"):
        profiled[2]["lunch"]


def test_profile_is_json_and_a_table(profiled):
    from rich.console import Console

    _, _, profile = profiled
    written = json.loads(json.dumps(profile.as_dict()))
    assert written["total"] == profile.total
    assert [part["name"] for part in written["parts"]] == list(PARTS)
    console = Console(record=True, width=80)
    console.print(profile_table(profile))
    text = console.export_text()
    for desired in (*PARTS, "total", "× real time"):
        assert desired in text
    assert "…" not in text
