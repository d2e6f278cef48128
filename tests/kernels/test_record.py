"""Records: what they keep, and that kernels read and write them."""

from __future__ import annotations

import numpy as np
import pytest

from harpy_pin.errors import InputError
from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, field, fields, make_record


def example(**more):
    return make_record(
        number=2.5,
        whole=3,
        index=np.int64(4),
        flag=True,
        rows=np.array([2, 0, 1]),
        table=[[1.0, 2.0], [3.0, 4.0]],
        nothing=np.zeros((3, 0)),
        **more,
    )


def test_types_and_shapes_are_kept():
    """A Python integer is a number like any other; those of NumPy, and booleans, stay whole."""
    record = example()
    assert record.shape == (1,)
    types = {name: record.dtype[name].base for name in record.dtype.names}
    whole = {name for name, kind in types.items() if kind == np.int64}
    assert whole == {"index", "flag", "rows"}
    assert all(kind == np.float64 for name, kind in types.items() if name not in whole)
    shapes = {name: record.dtype[name].shape for name in record.dtype.names}
    assert shapes["table"] == (2, 2)
    assert shapes["nothing"] == (3, 0)
    assert shapes["number"] == shapes["flag"] == ()
    np.testing.assert_array_equal(field(record, "table"), [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(field(record, "rows"), [2, 0, 1])


def test_equal_records_share_their_type():
    """One object, and not only an equal one, which a call compares at once."""
    assert example().dtype is example().dtype is example().copy().dtype
    assert example(further=1.0).dtype is not example().dtype
    assert make_record(a=np.zeros(2)).dtype is not make_record(a=np.zeros(3)).dtype


def test_views_write_through():
    record = example()
    table = field(record, "table")
    table[1, 0] = -7.0
    assert record["table"][0, 1, 0] == -7.0
    record["table"] = 0.5
    np.testing.assert_array_equal(table, 0.5)
    assert field(record, "nothing").shape == (3, 0)


def test_a_larger_record_holds_the_fields_of_a_smaller_one():
    larger = make_record(further=np.arange(2.0), **fields(example()))
    smaller = example()
    for name in smaller.dtype.names:
        assert larger.dtype[name] == smaller.dtype[name]
        np.testing.assert_array_equal(larger[name], smaller[name])
    np.testing.assert_array_equal(field(larger, "further"), [0.0, 1.0])


@kernel
def turn(p):
    """Write each kind of field from another, by the record's own numbers."""
    for k in range(3):
        p.rows[k] = p.rows[k] + p.index
    scale(p)
    if p.flag:
        p.number = p.table[1, 1] + p.nothing.shape[0]


@kernel
def scale(p):
    for i in range(2):
        for j in range(2):
            p.table[i, j] *= p.number


def test_kernels_read_and_write_the_memory_of_the_record():
    record = example()
    table = field(record, "table")
    turn(record)
    np.testing.assert_array_equal(table, [[2.5, 5.0], [7.5, 10.0]])
    np.testing.assert_array_equal(field(record, "rows"), [6, 4, 5])
    assert record["number"][0] == 13.0
    calm = example()
    calm["flag"] = False
    turn(calm)
    assert calm["number"][0] == 2.5
    assert len(turn._versions) == 1


def test_a_class_says_which_fields_there_are():
    class Spring(RecordOf):
        stiffness: float

    record = make_record(Spring, stiffness=2)
    assert record["stiffness"][0] == 2.0
    with pytest.raises(InputError, match=r"no fields \['damping'\], and needs \['stiffness'\]"):
        make_record(Spring, damping=1.0)


def test_records_begin_where_their_vectors_lie_well():
    for size in range(1, 40):
        assert make_record(values=np.zeros(size)).ctypes.data % 32 == 16
