"""The compiled loop of many ticks: the same log as the loop in Python, and Python's where there is something to say."""

from dataclasses import replace

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.compiled import BACKEND
from harpy_pin.scenario import Commanded, Condensed, Disturbances, Governed, Scenario, Straight, WholeBody, build
from harpy_pin.simulation.ticks import CompiledLoop

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="compiled loops are C")
PUSH = (hp.Push(time=0.35, impulse=(0.0, 4.0, 0.0)), hp.Push(time=0.8, impulse=(2.0, 0.0, 0.0)))
COMMAND = ((0.0, 0.3, 0.0, 0.0), (0.4005, 0.1, 0.05, 0.4), (0.9, 0.0, 0.0, 0.0))
MOTORS = {"joint_stiffness": 1.0, "joint_damping": 0.3}
WALKS = {
    "straight": Scenario(controller="condensed", ground=hp.Ground(mu_s=0.25), disturbances=Disturbances(pushes=PUSH)),
    "standing": Scenario(controller="condensed", gait=Straight(speed=0.0), disturbances=Disturbances(pushes=PUSH[:1])),
    "commanded": Scenario(controller="condensed", gait=Commanded(velocity=COMMAND)),
    "slippery": Scenario(controller=Condensed(parameters={"estimate_friction": True}), ground=hp.Ground(mu_s=0.1)),
    "paper": Scenario(controller=Governed(limits=True), ground=hp.Ground(mu_s=0.25)),
    "filter": Scenario(controller=Governed(governor="filter"), ground=hp.Ground(mu_s=0.15)),
    "no governor": Scenario(controller=Governed(governor="none")),
    "motors": Scenario(controller=Condensed(parameters=MOTORS), disturbances=Disturbances(pushes=PUSH)),
    "motors of the QP": Scenario(controller=WholeBody(parameters=MOTORS), disturbances=Disturbances(pushes=PUSH)),
    "clipped": Scenario(
        controller="condensed", disturbances=Disturbances(pushes=(hp.Push(time=0.3, impulse=(0.0, 12.0, 0.0)),))
    ),
    "fell": Scenario(
        controller="condensed", disturbances=Disturbances(pushes=(hp.Push(time=0.2, impulse=(0.0, 30.0, 0.0)),))
    ),
}


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
    scenario = replace(WALKS[name], duration=3.0 if name == "fell" else 1.2)
    build(scenario).run(save=tmp_path / "walk.npz")
    compiled = hp.Run.load(tmp_path / "walk.npz")
    assert sum(ticks_in_c) > 0.9 * len(compiled)
    made = len(ticks_in_c)
    python = build(scenario).run(on_tick=lambda state: None)
    assert len(ticks_in_c) == made
    assert ("motor_law" in compiled.signals) == name.startswith("motors")
    assert compiled.ending == python.ending == ("fell" if name == "fell" else "completed")
    assert compiled.signals.keys() == python.signals.keys()
    for signal in python.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(compiled[signal], python[signal], err_msg=signal)
    for entry in ("end_time", "contact_sweeps_max", "contact_unconverged", "thrusts_projected"):
        assert compiled.metadata.get(entry) == python.metadata.get(entry)
    assert (compiled["tick_ns"] > 0).all()


def test_progress_is_told(ticks_in_c):
    times = []
    build(Scenario(controller="condensed", duration=2.5)).run(on_piece=times.append)
    assert times == sorted(times)
    assert len(times) >= 2
    assert times[-1] == pytest.approx(2.5, abs=0.01)


def test_python_makes_every_tick_where_it_has_something_to_say(ticks_in_c):
    class Own(hp.controllers.CondensedController):
        """A controller of one's own."""

    for how in ({"controller": Own}, {"gait": hp.gaits.CommandedGait(hp.load_harpy(), lambda t: (0.1, 0.0, 0.0))}):
        build(Scenario(controller="condensed", duration=0.7), **how).run()
    noisy = Scenario(controller="condensed", duration=0.7, disturbances=Disturbances(delay=0.001))
    build(noisy).run()
    assert ticks_in_c == []


def test_steps_of_another_state_go_on(ticks_in_c):
    """A simulator may be run again from where it is."""
    runs = []
    for on_tick in (None, lambda state: None):
        walk = build(Scenario(controller="condensed", duration=0.8))
        first = walk.run(on_tick=on_tick)
        second = walk.simulator.run(walk.controller, 0.8, on_tick=on_tick)
        runs.append(np.concatenate((first["q"], second["q"])))
    np.testing.assert_array_equal(*runs)
