"""Names of the release before work, with a warning that says the new one; files that use them are read in silence."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.deprecated import NAMES, PACKAGES, new_entries


@pytest.mark.parametrize("old", sorted(NAMES.keys() & {"ContactForceGovernor", "ExplicitController", "Patch"}))
def test_a_class_by_its_old_name(old):
    with pytest.warns(DeprecationWarning, match=NAMES[old]):
        assert getattr(hp, old) is getattr(hp, NAMES[old])


def test_packages_by_their_old_names():
    """They are imported in silence; each of their names says where it is now."""
    script = f"""
import importlib, warnings
warnings.simplefilter("error")
for old in {tuple(PACKAGES)}:
    assert importlib.import_module("harpy_pin." + old).__name__ == "harpy_pin." + old
"""
    subprocess.run([sys.executable, "-c", script], check=True)
    from harpy_pin import plant

    for name, now in (("Simulator", "simulation"), ("Run", "log")):
        with pytest.warns(DeprecationWarning, match=rf"harpy_pin\.{now}\.{name}"):
            assert getattr(plant, name) is getattr(hp, name)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = plant.nonsense


def test_arguments_and_values():
    with pytest.warns(DeprecationWarning, match="friction_strips"):
        ground = hp.Ground(patches=((0.0, 1.0, 0.1),))
    assert ground == hp.Ground(friction_strips=((0.0, 1.0, 0.1),))
    with pytest.warns(DeprecationWarning, match="condensed"):
        assert hp.Scenario(controller="explicit") == hp.Scenario(controller="condensed")
    with pytest.warns(DeprecationWarning, match="evaluate_at"):
        assert hp.Scenario(reading="tracked").evaluate_at == "tracked"
    with pytest.warns(DeprecationWarning, match="penetration_offset"):
        assert hp.GaitParameters(press=0.01).penetration_offset == 0.01


def test_a_gait_of_ones_own_with_the_old_argument():
    class Old:
        def __init__(self):
            self.inner = hp.make_gait(hp.load_harpy())

        def __getattr__(self, name):
            return getattr(self.inner, name)

        def initial_state(self, *, sink=0.0):
            return self.inner.initial_state(penetration=sink)

    with pytest.warns(DeprecationWarning, match="penetration"):
        built = hp.build(hp.Scenario(duration=0.1), gait=Old())
    np.testing.assert_array_equal(built.simulator.q, hp.build(hp.Scenario(duration=0.1)).simulator.q)


FLAT = {
    "robot": "harpy",
    "controller": "explicit",
    "governor": "paper",
    "reading": "measured",
    "limits": False,
    "thrust": True,
    "parameters": {"solver": "daqp"},
    "assumed_friction": 0.4,
    "assumed_stiffness": None,
    "gait": "commanded",
    "speed": 0.25,
    "command": [],
    "urdf": None,
    "mass_error": 0.1,
    "ground": {"mu_s": 0.5, "mu_c": 0.45, "patches": [[0.5, 1.0, 0.1]]},
    "plant": "mujoco",
    "plant_preset": "stiff",
    "start_velocity": [0.0] * 6,
    "pushes": [{"time": 0.01, "impulse": [0.0, 1.0, 0.0], "duration": 0.02}],
    "noise": {"position": 0.001},
    "delay": 0.0,
    "duration": 0.05,
    "period": 0.001,
    "dt": 0.0005,
    "seed": 3,
}
"""The scenario of a file from before 0.2."""


def test_a_file_with_old_names_is_read_in_silence(tmp_path):
    ground = hp.Ground(mu_s=0.5, mu_c=0.45, friction_strips=((0.5, 1.0, 0.1),))
    scenario = hp.Scenario(
        controller=hp.Condensed(mu=0.4, parameters={"solver": "daqp"}),
        gait=hp.Commanded(velocity=(0.25, 0.0, 0.0)),
        plant=hp.Mujoco("stiff"),
        ground=ground,
        disturbances=hp.Disturbances(
            mass_error=0.1, pushes=(hp.Push(0.01, (0.0, 1.0, 0.0), 0.02),), noise=hp.Noise(position=0.001), seed=3
        ),
        duration=0.05,
    )
    run = hp.walk(hp.Scenario(duration=0.05))
    back = {"condensed_status": "law_status", "desired_force": "wanted_force"}
    assert back.keys() <= run.signals.keys()
    signals = {back.get(name, name): array for name, array in run.signals.items()}
    hp.Run(signals, {**run.metadata, "scenario": FLAT}).save(tmp_path / "old.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loaded = hp.Run.load(tmp_path / "old.npz")
        assert hp.Scenario.of(loaded) == scenario
    assert loaded.signals.keys() == run.signals.keys()


ATTITUDE, COMMAND = {"attitude": {"k_p": 1.0}}, [(0.0, 0.1, 0.0, 0.2)]
SETTINGS = [
    ({"speed": 0.2}, {"gait": hp.Straight(speed=0.2)}, ""),
    ({"speed": 0.0, "gait": "optimised"}, {"gait": hp.Optimised(speed=0.0)}, "gait=Optimised(speed=...)"),
    ({"assumed_stiffness": 9e3}, {"gait": hp.Straight(stiffness=9e3)}, ""),
    ({"gait": "commanded", "speed": 0.1}, {"gait": hp.Commanded(velocity=(0.1, 0.0, 0.0))}, "gait=Commanded(velocity="),
    ({"gait": "commanded", "command": COMMAND}, {"gait": hp.Commanded(velocity=COMMAND)}, "gait=Commanded(velocity="),
    ({"robot": "go2", "command": COMMAND}, {"robot": "go2", "gait": hp.Walking(velocity=COMMAND)}, "gait=Walking("),
    ({"governor": "filter"}, {"controller": hp.Governed(governor="filter")}, ""),
    ({"limits": True, "thrust": False}, {"controller": hp.Governed(limits=True, thrust=False)}, ""),
    ({"reading": "tracked"}, {"controller": hp.Governed(evaluate_at="tracked")}, "controller=Governed(evaluate_at="),
    ({"parameters": ATTITUDE}, {"controller": hp.Governed(parameters=ATTITUDE)}, "controller=Governed(parameters="),
    (
        {"parameters": {"solver": "daqp"}},
        {"controller": hp.Condensed(parameters={"solver": "daqp"})},
        "controller=Condensed(parameters=",
    ),
    (
        {"controller": "wbc", "governor": "none", "assumed_friction": 0.3},
        {"controller": hp.WholeBody(mu=0.3)},
        "controller=WholeBody(mu=...)",
    ),
    ({"plant": "mujoco", "plant_preset": "stiff"}, {"plant": hp.Mujoco("stiff")}, "plant=Mujoco(preset=...)"),
    (
        {"delay": 0.002, "seed": 4, "mass_error": 0.1, "noise": hp.Noise(position=0.1)},
        {"disturbances": hp.Disturbances(delay=0.002, seed=4, mass_error=0.1, noise=hp.Noise(position=0.1))},
        "disturbances=Disturbances(",
    ),
]
"""Settings of a scenario before it had parts, the scenario that they make, and the part that the warning names."""


@pytest.mark.parametrize(("flat", "parts", "advice"), SETTINGS)
def test_settings_of_a_scenario_find_their_part(flat, parts, advice):
    with pytest.warns(DeprecationWarning, match=r"Scenario\(") as said:
        old = hp.Scenario(**flat)
    assert old == hp.Scenario(**parts)
    assert {str(warning.filename) for warning in said} == {__file__}
    assert any(f"is now 'Scenario({advice}" in str(warning.message) for warning in said)
    for name in flat.keys() & {"speed", "governor", "delay", "seed", "plant_preset"}:
        if hasattr(old.gait, name) or name != "speed":
            with pytest.warns(DeprecationWarning, match=f"scenario.{name}"):
                assert getattr(old, name) in (flat[name], None)


def test_a_setting_that_the_part_does_not_have_is_refused():
    for flat in ({"controller": "wbc", "governor": "paper"}, {"gait": "optimised", "assumed_stiffness": 1.0}):
        with (
            pytest.warns(DeprecationWarning, match="governor|stiffness"),
            pytest.raises(hp.InputError, match="has no '"),
        ):
            hp.Scenario(**flat)
    with pytest.raises(TypeError, match="no argument 'colour'"):
        hp.Scenario(colour="red")


def test_new_entries_keep_what_they_do_not_know():
    assert new_entries({"reading": "tracked", "a": [{"patches": ()}]}) == {
        "evaluate_at": "tracked",
        "a": [{"friction_strips": ()}],
    }
