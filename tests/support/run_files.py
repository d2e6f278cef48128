"""Logs made by hand."""

import io

import numpy as np
import pytest

from harpy_pin import Run, RunFileError


def make_run(rows=7, **metadata):
    rng = np.random.default_rng(0)
    shapes = {
        "t": (),
        "q": (13,),
        "v": (12,),
        "foot_position": (2, 3),
        "foot_velocity": (2, 3),
        "foot_force": (2, 3),
        "torque": (6,),
        "thrust": (2, 3),
    }
    signals = {name: rng.normal(size=(rows, *shape)) for name, shape in shapes.items()}
    signals["t"] = 0.5 + 1e-3 * np.arange(rows)
    signals["tick_ns"] = np.arange(rows)
    signals["held"] = np.arange(rows) % 2 == 0
    return Run(
        signals, {"ending": "completed", "dt": 5e-4, "nested": {"mu": [0.25, 0.8]}, **metadata}
    )


def same(one, two):
    assert one.signals.keys() == two.signals.keys()
    for name, array in one.signals.items():
        np.testing.assert_array_equal(two[name], array, err_msg=name)
        assert two[name].dtype == array.dtype


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def refused(path):
    """The one line that says why."""
    with pytest.raises(RunFileError) as caught:
        Run.load(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    assert len(message) < len(str(path)) + 200
    return message
