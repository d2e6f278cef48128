"""Names of the release before work, with a warning that says the new one; files that use them are read in silence."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.deprecated import ENTRIES, NAMES, PACKAGES, new_entries


@pytest.mark.parametrize("old", sorted(NAMES.keys() & {"ContactForceGovernor", "ExplicitController", "Patch"}))
def test_a_class_by_its_old_name(old):
    with pytest.warns(DeprecationWarning, match=NAMES[old]):
        assert getattr(hp, old) is getattr(hp, NAMES[old])


@pytest.mark.parametrize("old", PACKAGES)
def test_a_package_by_its_old_name(old):
    script = f"import warnings; warnings.simplefilter('error'); import harpy_pin.{old} as m; print(m.__name__)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"harpy_pin.{old}"


def test_what_a_package_had():
    from harpy_pin import plant

    with pytest.warns(DeprecationWarning, match=r"harpy_pin\.simulation\.Simulator"):
        assert plant.Simulator is hp.Simulator
    with pytest.warns(DeprecationWarning, match=r"harpy_pin\.log\.Run"):
        assert plant.Run is hp.Run
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


def test_a_file_with_old_names_is_read_in_silence(tmp_path):
    scenario = hp.Scenario(ground=hp.Ground(friction_strips=((0.5, 1.0, 0.1),)), duration=0.05)
    run = hp.walk(scenario)
    back = {new: old for old, new in ENTRIES.items()}
    signals = {back.get(name, name): array for name, array in run.signals.items()}
    told = run.metadata["scenario"]
    ground = {back.get(name, name): value for name, value in told["ground"].items()}
    old = {back.get(name, name): value for name, value in told.items()} | {
        "controller": "explicit",
        "governor": "paper",
    }
    hp.Run(signals, {**run.metadata, "scenario": old | {"ground": ground}}).save(tmp_path / "old.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loaded = hp.Run.load(tmp_path / "old.npz")
        assert hp.Scenario.of(loaded) == scenario
    assert loaded.signals.keys() == run.signals.keys()


def test_new_entries_keep_what_they_do_not_know():
    assert new_entries({"reading": "tracked", "a": [{"patches": ()}]}) == {
        "evaluate_at": "tracked",
        "a": [{"friction_strips": ()}],
    }
