"""Objects that keep arrays: no attribute can be bound to other memory, and a copy is a whole one of its own."""

from __future__ import annotations

import copy
import pickle
from contextlib import suppress

import numpy as np
import pytest
from stateful import CASES

import harpy_pin as hp

COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda made: pickle.loads(pickle.dumps(made))}


def holders(made, seen):
    """An object and all objects of the library that it leads to."""
    if id(made) in seen:
        return
    seen.add(id(made))
    if isinstance(made, list | tuple):
        parts = list(made)
    elif isinstance(made, dict):
        parts = list(made.values())
    elif type(made).__module__.startswith("harpy_pin"):
        yield made
        parts = [getattr(made, name, None) for kind in type(made).__mro__ for name in getattr(kind, "__slots__", ())]
        parts += list(getattr(made, "__dict__", {}).values())
    else:
        return
    for part in parts:
        yield from holders(part, seen)


def public_arrays(made):
    for holder in holders(made, set()):
        names = {name for name in dir(holder) if not name.startswith("_")}
        for name in sorted(names):
            array = getattr(holder, name, None)
            if isinstance(array, np.ndarray) and getattr(holder, name).ctypes.data == array.ctypes.data:
                yield holder, name  # a property that makes a new one at each call has nothing to lose


@pytest.mark.parametrize("name", CASES)
def test_public_arrays_stay_where_they_are(name):
    make, use = CASES[name]
    made = make()
    use(made)
    found = list(public_arrays(made))
    for holder, attribute in found:
        before = getattr(holder, attribute)
        address, values = before.ctypes.data, before.copy()
        for other in (np.zeros(97), np.zeros((9, 9)), before.copy()):
            with suppress(AttributeError, hp.InputError):
                setattr(holder, attribute, other)
            after = getattr(holder, attribute)
            where = f"{type(holder).__name__}.{attribute}"
            assert after.ctypes.data == address, where
            assert after.shape == before.shape, where
            assert after.tobytes() == values.tobytes(), where


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("name", CASES)
def test_a_copy_goes_on_like_the_original_and_without_it(name, way):
    make, use = CASES[name]
    made = make()
    use(made)
    expected = use(copy.deepcopy(made))
    copied = COPIES[way](made)
    for _ in range(2):  # the second one after the first one has been used
        for answer, wanted in zip(use(copied), expected, strict=True):
            np.testing.assert_array_equal(answer, wanted)
        copied = made


@pytest.mark.parametrize(
    "name", [name for name in CASES if "governed" in name or "Controller" in name or "Filter" in name]
)
def test_samples_from_a_pickle_are_samples(name, monkeypatch):
    """Their arrays have a type that is equal to float64 and another object."""
    make, use = CASES[name]
    expected = use(make())
    monkeypatch.setattr(hp, "State", lambda *parts: pickle.loads(pickle.dumps(hp.model.State(*parts))))
    monkeypatch.setattr(hp, "Command", lambda *parts: pickle.loads(pickle.dumps(hp.model.Command(*parts))))
    for answer, wanted in zip(use(make()), expected, strict=True):
        np.testing.assert_array_equal(answer, wanted)
