"""The compiled loop of many ticks: the same log as the loop in Python, and Python's where there is
something to say.
"""

from dataclasses import replace

import numpy as np
import pytest
from needs import needs_compiler
from walks import assert_same, scenario, walked

import harpy_pin as hp
from harpy_pin.model.catalogue import installed_data
from harpy_pin.simulation.ticks import CompiledLoop

pytestmark = needs_compiler
PUSH = (hp.Push(time=0.35, impulse=(0.0, 4.0, 0.0)), hp.Push(time=0.8, impulse=(2.0, 0.0, 0.0)))
COMMAND = ((0.0, 0.3, 0.0, 0.0), (0.4005, 0.1, 0.05, 0.4), (0.9, 0.0, 0.0, 0.0))
MOTORS = {"joint_stiffness": 1.0, "joint_damping": 0.3}
WALKS = {
    "straight": scenario(pushes=PUSH),
    "standing": scenario(gait=hp.Straight(speed=0.0), pushes=PUSH[:1]),
    "commanded": scenario(gait=hp.Commanded(velocity=COMMAND)),
    "slippery": scenario(controller=hp.Condensed(parameters={"estimate_friction": True}), mu_s=0.1),
    "paper": scenario(controller=hp.Governed(limits=True)),
    "filter": scenario(controller=hp.Governed(governor="filter"), mu_s=0.15),
    "no governor": scenario(controller=hp.Governed(governor="none")),
    "motors": scenario(controller=hp.Condensed(parameters=MOTORS), pushes=PUSH),
    "motors of the QP": scenario(
        controller=hp.WholeBody(parameters=MOTORS | {"solver": "active_set"}), pushes=PUSH
    ),
    "clipped": scenario(pushes=(hp.Push(time=0.3, impulse=(0.0, 12.0, 0.0)),)),
    "fell": scenario(pushes=(hp.Push(time=0.2, impulse=(0.0, 30.0, 0.0)),)),
    "slope": scenario(slope=0.2, mu_s=0.6),
}
if installed_data() is not None:
    WALKS["solo12"] = scenario(
        robot="solo12", gait=hp.Walking(velocity=((0.0, 0.3, 0.1, 0.3), (0.6, 0.0, 0.1, 0.0)))
    )


@pytest.fixture
def ticks_in_c(monkeypatch):
    """How many ticks loops in C made."""
    made = []
    run = CompiledLoop.run

    def counted(self, *arguments):
        done, ending = run(self, *arguments)
        made.append(done)
        return done, ending

    monkeypatch.setattr(CompiledLoop, "run", counted)
    return made


@pytest.mark.parametrize("name", WALKS)
def test_every_digit_is_that_of_the_loop_in_python(name, ticks_in_c, tmp_path):
    """Also in the log on disk."""
    walk = replace(WALKS[name], duration=3.0 if name == "fell" else 1.2)
    hp.walk(walk, save=tmp_path / "walk.npz")
    compiled = hp.Run.load(tmp_path / "walk.npz")
    assert sum(ticks_in_c) > 0.9 * len(compiled)
    made = len(ticks_in_c)
    python = hp.walk(walk, on_tick=lambda state: None)
    assert len(ticks_in_c) == made
    assert ("motor_law" in compiled.signals) == name.startswith("motors")
    assert compiled.ending == python.ending == ("fell" if name == "fell" else "completed")
    assert_same(compiled, python)
    for entry in ("end_time", "contact_sweeps_max", "contact_unconverged", "thrusts_projected"):
        assert compiled.metadata.get(entry) == python.metadata.get(entry)
    assert (compiled["tick_ns"] > 0).all()


def test_progress_is_told():
    times = []
    hp.build(hp.Scenario(duration=2.5)).run(on_piece=times.append)
    assert times == sorted(times)
    assert len(times) >= 2
    assert times[-1] == pytest.approx(2.5, abs=0.01)


def test_python_makes_every_tick_where_it_has_something_to_say(ticks_in_c):
    class Own(hp.controllers.CondensedController):
        """A controller of one's own."""

    for how in (
        {"controller": Own},
        {"gait": hp.gaits.CommandedGait(hp.load_harpy(), lambda t: (0.1, 0.0, 0.0))},
    ):
        hp.walk(hp.Scenario(duration=0.7), **how)
    walked(duration=0.7, delay=0.001)
    assert ticks_in_c == []


def test_steps_of_another_state_go_on():
    """A simulator may be run again from where it is."""
    runs = []
    for on_tick in (None, lambda state: None):
        walk = hp.build(hp.Scenario(duration=0.8))
        first = walk.run(on_tick=on_tick)
        second = walk.simulator.run(walk.controller, 0.8, on_tick=on_tick)
        runs.append(np.concatenate((first["q"], second["q"])))
    np.testing.assert_array_equal(*runs)
