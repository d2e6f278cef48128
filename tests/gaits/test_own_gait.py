"""Gaits of one's own: a wrapper walks as what it wraps under every controller, and what is no gait
is refused.
"""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from walks import assert_same

import harpy_pin as hp
from harpy_pin.gaits import GaitTarget
from harpy_pin.gaits.gait import own_target

ROBOT = hp.load_harpy()
EXACT = {"solver": "daqp"}  # ProxQP's last digits depend on where its memory lies
CONTROLLERS = {
    "ungoverned": hp.Governed(governor="none"),
    "paper": hp.Governed(governor="paper"),
    "filter": hp.Governed(governor="filter"),
    "feedforward": hp.Governed(governor="filter", parameters={"legs": "feedforward"}),
    "QP": hp.WholeBody(parameters={"solver": "active_set"}),
    "QP by phases": hp.WholeBody(parameters=EXACT),
    "condensed": hp.Condensed(),
}


class Wrapped(hp.Gait):
    """Passes on what a wrapper has to, and nothing else."""

    def __init__(self, inner):
        super().__init__(inner.robot)
        self.inner = inner
        self.step_duration, self.double_support = inner.step_duration, inner.double_support
        self.controller_parameters = inner.controller_parameters

    def update(self, t):
        return self.inner.update(t)

    def initial_state(self, *, penetration=0.0):
        return self.inner.initial_state(penetration=penetration)


class Fresh(Wrapped):
    """Makes new targets at every update."""

    def update(self, t):
        target, given = GaitTarget(len(self.robot.feet)), self.inner.update(t)
        target.record[:] = given.record
        return target


class Bare(hp.Gait):
    """Two methods alone."""

    def __init__(self, inner):
        super().__init__(inner.robot)
        self.inner = inner

    update, initial_state = Wrapped.update, Wrapped.initial_state


@pytest.mark.parametrize("name", CONTROLLERS)
def test_wrapper_walks_as_the_wrapped(name):
    scenario = hp.Scenario(controller=CONTROLLERS[name], ground=hp.Ground(mu_s=0.25), duration=0.9)
    expected = hp.walk(scenario, gait=hp.make_gait(ROBOT))
    assert expected.ending == "completed"
    for kind in (Wrapped, Fresh):
        run = hp.walk(scenario, gait=kind(hp.make_gait(ROBOT)))
        assert_same(run, expected)
        assert run.metadata["parameters"]["gait"]["step_duration"] == 0.75
    assert hp.measure(run).slip_mm_per_step == hp.measure(expected).slip_mm_per_step


def test_wrapper_of_a_commanded_gait_turns():
    scenario = hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.4), duration=1.5)
    gaits = [hp.make_commanded_gait(ROBOT, [(0.1, 0.3, 0.0, 0.5)]) for _ in range(2)]
    expected, run = hp.walk(scenario, gait=gaits[0]), hp.walk(scenario, gait=Wrapped(gaits[1]))
    assert gaits[1].target.heading[0] > 0.1
    for name in run.signals.keys() - {"tick_ns"}:  # the commanded gait logs its command besides
        np.testing.assert_array_equal(run[name], expected[name])
    with pytest.raises(hp.ControlError, match="the gait turns, and this controller faces x"):
        hp.walk(replace(scenario, controller=hp.Governed()), gait=Wrapped(gaits[1]))


@pytest.mark.parametrize("controller", ["governed", "wbc", "condensed"])
def test_two_methods_are_enough(controller):
    run = hp.walk(hp.Scenario(controller=controller, duration=0.3), gait=Bare(hp.make_gait(ROBOT)))
    assert run.ending == "completed"
    assert run.metadata["parameters"]["gait"] == {"gait": "Bare", "step_duration": 1.0}
    assert run.metadata["own"] == ["gait"]


def test_a_copy_has_targets_of_its_own():
    gait = hp.OnTerrain(Bare(hp.make_gait(ROBOT)), hp.ground.Plane(slope=0.1))
    for other in (copy.copy(gait), pickle.loads(pickle.dumps(gait))):
        expected = gait.update(0.3).body.copy()
        np.testing.assert_array_equal(other.update(0.3).body, expected)
        other.update(1.0)
        np.testing.assert_array_equal(gait.target.body, expected)


def test_only_a_class_that_says_so_never_changes():
    class Steered(hp.gaits.StraightGait):
        pass

    steered, straight = Steered(ROBOT), hp.make_gait(ROBOT)
    assert own_target(steered) is steered
    assert own_target(straight).target is not straight.target


@pytest.mark.parametrize("controller", ["governed", "wbc", "condensed"])
def test_what_is_no_gait_is_refused(controller):
    class Mute(Wrapped):
        def update(self, t):
            return None

    class Quadruped(Wrapped):
        def update(self, t):
            return GaitTarget(4)

    class Lost(Wrapped):
        def update(self, t):
            target = self.inner.update(t)
            target.body[0] = np.nan
            return target

    straight = hp.make_gait(ROBOT)
    scenario = hp.Scenario(controller=controller, duration=0.1)
    with pytest.raises(hp.InputError, match=r"must be a Gait, got .*SimpleRobot"):
        hp.make_controller(controller, type("SimpleRobot", (), {"robot": ROBOT})(), mu=0.5)
    with pytest.raises(TypeError, match="abstract"):
        type("Still", (hp.Gait,), {"update": Wrapped.update})(ROBOT)
    for kind, words in (
        (Mute, "must return a GaitTarget of 2 feet, got NoneType"),
        (Quadruped, "of 2 feet, got one of 4"),
        (Lost, "targets are no numbers"),
    ):
        with pytest.raises(hp.ControlError, match=words):
            hp.walk(scenario, gait=kind(straight))
