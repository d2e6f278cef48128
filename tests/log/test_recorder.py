"""The rows of a run while it goes on: names, shapes, copies, pieces."""

import tracemalloc

import numpy as np
import pytest

from harpy_pin import InputError
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import Recorder


@pytest.mark.parametrize(
    "value", [1.0, [1.0], np.ones(1), np.ones(2), [1.0, 2.0], np.ones(6)[::2][:2]]
)
def test_recorder_refuses_other_sizes(value):
    """Also those that NumPy would repeat until they fit."""
    recorder = Recorder()
    recorder.append({"a": np.zeros(3), "n": 1})
    with pytest.raises(InputError, match="changed shape: a"):
        recorder.append({"a": value, "n": 2})
    recorder.append({"a": [4, 5, 6], "n": 3})
    assert len(recorder) == 2
    np.testing.assert_array_equal(recorder.take()["a"], [[0.0, 0.0, 0.0], [4.0, 5.0, 6.0]])


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"a": np.zeros(2), "b": np.zeros(3)}, "changed shape: a, b"),
        ({"a": np.zeros(3), "c": np.zeros(2)}, ""),
    ],
    ids=["as long as before", "other names"],
)
def test_recorder_refuses_other_rows(row, message):
    recorder, first = Recorder(), {"a": np.zeros(3), "b": np.ones(2)}
    recorder.append(first)
    with pytest.raises(InputError) as caught:
        recorder.append(row)
    assert message in str(caught.value)
    for name, array in recorder.take().items():
        np.testing.assert_array_equal(array, [first[name]])


def test_recorder_takes_any_layout_and_type():
    recorder, table = Recorder(), np.arange(12.0).reshape(3, 4)
    for i in range(3):
        recorder.append(
            {"turned": table.T, "every other": table[:, ::2], "whole": np.arange(2), "yes": i == 1}
        )
    arrays = recorder.take()
    np.testing.assert_array_equal(arrays["turned"], [table.T] * 3)
    np.testing.assert_array_equal(arrays["every other"], [table[:, ::2]] * 3)
    np.testing.assert_array_equal(arrays["whole"], [[0.0, 1.0]] * 3)
    assert arrays["yes"].dtype == np.bool_
    assert arrays["yes"].tolist() == [False, True, False]


def test_recorder_keeps_names_with_their_values():
    recorder = Recorder()
    recorder.append({"a": 1.0, "b": 2.0})
    recorder.append({"b": 4.0, "a": 3.0})
    with pytest.raises(InputError, match="changed shape: b"):
        recorder.append({"a": 5.0, "b": np.zeros(2)})
    with pytest.raises(InputError, match="changed shape: a"):
        recorder.append({"a": np.zeros(1), "b": 6.0})  # as many bytes
    assert {name: array.tolist() for name, array in recorder.take().items()} == {
        "a": [1.0, 3.0],
        "b": [2.0, 4.0],
    }


@pytest.mark.parametrize("on_disk", [False, True])
@pytest.mark.parametrize("rows", [0, 1, 4, 5, 11])
def test_blocks_hold_the_rows(tmp_path, on_disk, rows):
    """The same numbers, wherever the blocks end and lie."""
    journal = Journal(tmp_path / "run.npz", {}) if on_disk else None
    recorder, rng = Recorder(journal, block=5), np.random.default_rng(0)
    t, force, held = np.arange(float(rows)), rng.normal(size=(rows, 2, 3)), rng.random(rows) > 0.5
    row = np.zeros((2, 3))
    for k in range(rows):
        row[:] = force[k]  # the next row is written over this one
        recorder.append({"t": t[k], "force": row, "held": bool(held[k])})
    assert len(recorder) == rows
    whole = {"t": t, "force": force, "held": held} if rows else {}
    arrays = recorder.take()
    assert arrays.keys() == whole.keys()
    for name, array in whole.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype
    assert len(recorder) == 0


def test_rows_on_disk_leave_the_memory(tmp_path):
    recorder = Recorder(Journal(tmp_path / "run.npz", {}), block=100)
    row = {"a": np.zeros(100)}
    recorder.append(row)
    tracemalloc.start()
    try:
        for _ in range(20_000):
            recorder.append(row)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1_000_000
    assert (tmp_path / "run.npz.part").stat().st_size >= 800 * 20_000


@pytest.mark.parametrize("name", ["__metadata__", "__", "<b>", "a/b", ""])
def test_names_that_no_signal_can_have(name):
    with pytest.raises(InputError, match="no signal can be called"):
        Recorder().append({name: 1.0})
