"""Objects that keep arrays: no attribute can be bound to other memory, and a copy is a whole one of
its own.
"""

import copy
import pickle
import re
import warnings
from contextlib import suppress
from itertools import product

import numpy as np
import pytest
from in_place import CHANGES, change_all, public_arrays
from stateful import CASES, ROBOT, Q, V, assert_equal

import harpy_pin as hp
from harpy_pin.contrib.batch import BatchTargets, CondensedBatch
from harpy_pin.contrib.gym.batched_env import BatchedEnv

COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda made: pickle.loads(pickle.dumps(made)),
}


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


@pytest.mark.parametrize("name", CASES)
def test_changes_in_place_change_nothing(name):
    assert change_all(name) > 0


@pytest.mark.parametrize("name", CASES)
def test_whole_numbers_of_records_cannot_be_written(name):
    """Kernels take them for indices and counts: bodies of feet, parents in the tree, active
    rows.
    """
    make, use = CASES[name]
    made = make()
    use(made)
    for holder, attribute in public_arrays(made):
        for part in _records(getattr(holder, attribute)):
            for field in part.dtype.names:
                if part.dtype[field].base.kind != "i":
                    continue
                before = part[field].tobytes()
                for refused in (
                    lambda part=part, field=field: part.__setitem__(field, 7),
                    lambda part=part, field=field: part[0].__setitem__(field, 7),
                    lambda part=part, field=field: part[field].fill(7),
                ):
                    with pytest.raises((ValueError, TypeError)):
                        refused()
                with pytest.raises((ValueError, TypeError, hp.InputError)):
                    part[0] = part.copy()[0]
                assert part[field].tobytes() == before


def _records(array):
    """A record and those that are its parts."""
    if array.dtype.names:
        yield array
        for field in array.dtype.names:
            yield from _records(array[field])


def test_targets_of_a_batch_are_views():
    """As are its results: kernels write where they did."""
    batch, force = CondensedBatch(ROBOT, 2), np.zeros((2, 2, 3))
    given = np.tile(Q, (2, 1)), np.tile(V, (2, 1)), force
    before = batch.step(*given)[0].copy()
    for name in BatchTargets.__slots__:
        for change in CHANGES.values():
            with (
                suppress(ValueError, TypeError, AttributeError),
                warnings.catch_warnings(action="ignore"),
            ):
                change(getattr(batch.targets, name))
    batch.reset()
    np.testing.assert_array_equal(batch.step(*given)[0], before)
    batch.targets.body[:, 2] += 0.01
    batch.reset()
    assert (batch.step(*given)[0] != before).any()


@pytest.mark.parametrize(
    "idle",
    [np.zeros(3, bool), np.zeros(2), [False, False], np.zeros((2, 1), bool), None],
    ids=range(5),
)
def test_idle_worlds_are_as_many_truth_values(idle):
    worlds = BatchedEnv(2)
    with pytest.raises(hp.InputError, match="idle must be 2 truth values"):
        worlds.step(np.zeros((2, 12)), idle)
    for i in (-1, 2):
        with pytest.raises(hp.InputError, match="i must be"):
            worlds.reset(i, np.random.default_rng(0))


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
            assert_equal(name, answer, wanted)
        copied = made


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("name", CASES)
def test_arrays_of_a_copy_are_its_own_and_views_of_each_other_where_the_originals_are(name, way):
    make, use = CASES[name]
    made = make()
    use(made)
    copied = COPIES[way](made)
    ours, theirs = (
        [
            (f"{type(holder).__name__}.{array}", getattr(holder, array))
            for holder, array in public_arrays(each)
        ]
        for each in (made, copied)
    )

    def shared(these, those):
        return sorted(
            (a, b)
            for (a, one), (b, other) in product(these, those)
            if np.may_share_memory(one, other)
        )

    assert shared(theirs, theirs) == shared(ours, ours)
    assert shared(ours, theirs) == []


CONTROLLERS = [
    name
    for name in CASES
    if re.search(r"^(governed|condensed|wbc|estimating)|Controller|Filter$", name)
]


@pytest.mark.parametrize(
    "name", [*CONTROLLERS, "Shield", "ShieldBatch", "CondensedBatch", "Sensors"]
)
def test_what_is_reset_is_new(name):
    make, use = CASES[name]
    made = make()
    use(made)
    made.reset()
    for answer, wanted in zip(use(made), use(make()), strict=True):
        assert_equal(name, answer, wanted)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_samples_from_a_pickle_are_samples(name, monkeypatch):
    """Their arrays have a type that is equal to float64 and another object."""
    make, use = CASES[name]
    expected = use(make())
    monkeypatch.setattr(
        hp, "State", lambda *parts: pickle.loads(pickle.dumps(hp.model.State(*parts)))
    )
    monkeypatch.setattr(
        hp, "Command", lambda *parts: pickle.loads(pickle.dumps(hp.model.Command(*parts)))
    )
    for answer, wanted in zip(use(make()), expected, strict=True):
        assert_equal(name, answer, wanted)
