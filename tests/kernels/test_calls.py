"""Calls from Python: what is taken, what is refused, and that nothing else is touched."""

import gc
import pickle
import subprocess
import sys
import threading
import time
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from needs import needs_compiler

from harpy_pin.errors import HarpyError, KernelError
from harpy_pin.kernels import bridge, compiler, kernel
from harpy_pin.kernels.bridge import MAX_RESULTS
from harpy_pin.kernels.calls import Call, Chain
from harpy_pin.simulation import ticks

pytestmark = needs_compiler
RECORD = np.dtype(
    [("mass", np.float64), ("force", np.float64, (2,)), ("count", np.int64)], align=True
)


@kernel
def change(a, x: float, n: int, flag: bool):
    a[0] += x
    return a[1] + n, flag, n


@kernel
def look(a):
    return a[0]


@kernel
def note(p):
    p.mass += p.force[1]
    p.count += 1
    return p.mass


@kernel
def nothing(a):
    a[0] = 1.0


@kernel(release=True)
def slow(a, rounds):
    for _ in range(rounds):
        for i in range(a.shape[0]):
            a[i] = 0.5 * a[i] + 1.0


@kernel
def layered(a, i):
    total = 0.0
    for j in range(a.shape[3]):
        total += a[1, 0, i, j]
    return total


def numbers():
    return np.arange(4.0)


def test_kinds_of_arguments():
    for x in (1.5, 1, True, np.float64(1.5), np.float32(1.5), np.int64(1)):
        for n in (2, np.int64(2), np.int32(2)):
            for flag in (True, np.bool_(True)):
                a = numbers()
                result = change(a, x, n, flag)
                assert result == (3.0, True, 2)
                assert [type(value) for value in result] == [float, bool, int]
                assert a[0] == float(x)
    assert change(x=0.5, a=numbers(), n=0, flag=False) == (1.0, False, 0)
    assert change(numbers(), flag=False, n=-1, x=1e300) == (0.0, False, -1)
    assert change(numbers(), 10**30, 1, True)[0] == 2.0
    assert nothing(numbers()) is None


class Own(np.ndarray):
    """A subclass."""


def test_arrays_that_look_different_and_are_not():
    base = np.zeros(9)
    base[4:8] = numbers()
    for a in (
        numbers().view(Own),
        pickle.loads(pickle.dumps(numbers())),
        numbers().view(np.dtype(np.float64).newbyteorder("=")),
        base[4:8],
        np.asfortranarray(numbers()),
        np.lib.stride_tricks.as_strided(np.repeat(numbers(), 2), (4,), (16,)),
    ):
        assert change(a, 2.0, 1, True)[0] == 2.0
        assert a[0] == 2.0
    np.testing.assert_array_equal(base, [0, 0, 0, 0, 2, 1, 2, 3, 0])


def pickled(array):
    """The same with a type of its own, which is not the process's."""
    made = pickle.loads(pickle.dumps(array))
    assert made.dtype is not array.dtype
    return made


def test_pickled_arrays_are_taken_in_one_crossing(monkeypatch):
    """By the versions that there are; what has other elements, or another order of bytes, is
    not.
    """
    change(numbers(), 2.0, 1, True)
    slow = []
    monkeypatch.setattr(type(change), "slowly", lambda self, *arguments: slow.append(arguments))
    a = pickled(numbers())
    assert change(a, 2.0, 1, True)[0] == 2.0
    assert a[0] == 2.0
    assert slow == []
    for kind in (">f8", np.int64, np.uint64, np.complex128, "m8[s]"):
        change(np.zeros(4, dtype=kind), 1.0, 1, True)
    assert len(slow) == 5


@kernel
def summed(a):
    return int(a[0] + a[1])


def test_a_chain_takes_pickled_samples():
    memory = np.zeros(2)
    chain = Chain([Call(summed, memory)], {"q": memory}, longest=10.0)
    for q in (np.array([1.0, 2.0]), pickled(np.array([3.0, 4.0]))):
        assert chain(SimpleNamespace(t=0.0, q=q)) == q.sum()
    for kind in (">f8", np.int64, np.complex128):
        assert chain(SimpleNamespace(t=0.0, q=np.ones(2, dtype=kind))) is None


def test_records():
    one = np.zeros(3, RECORD)
    one["force"] = 3.0
    other = pickle.loads(pickle.dumps(one))
    assert other.dtype is not one.dtype
    for records in (one, other, one.view(np.recarray)):
        before = float(records["mass"][1])
        assert note(records[1]) == before + 3.0
        assert records["mass"].tolist() == [0.0, before + 3.0, 0.0]
    assert note(one[1:2].reshape(())) == 9.0
    assert one["count"].tolist() == [0, 3, 0]


@pytest.mark.parametrize(
    "arguments",
    [
        ([0.0, 1.0], 1.0, 1, True),
        (None, 1.0, 1, True),
        (1.0, 1.0, 1, True),
        (np.zeros((4, 1)), 1.0, 1, True),
        (np.zeros(4, dtype=np.float32), 1.0, 1, True),
        (np.zeros(4, dtype=np.int64), 1.0, 1, True),
        (np.zeros(4, dtype=np.complex128), 1.0, 1, True),
        (np.zeros(4, dtype=">f8"), 1.0, 1, True),
        (np.zeros(4, dtype=object), 1.0, 1, True),
        (np.zeros(1, RECORD), 1.0, 1, True),
        (numbers(), "1.0", 1, True),
        (numbers(), 1j, 1, True),
        (numbers(), None, 1, True),
        (numbers(), np.zeros(1), 1, True),
        (numbers(), 1.0, 10**30, True),
        (numbers(), 1.0, [1], True),
        (numbers(), 1.0),
        (numbers(), 1.0, 1, True, 1),
        (),
    ],
    ids=lambda arguments: ", ".join(map(repr, arguments))[:40],
)
def test_what_does_not_fit_is_refused(arguments):
    assert change(numbers(), 1.0, 1, True)[2] == 1
    with pytest.raises((TypeError, KernelError)):
        change(*arguments)


def test_unknown_names_are_refused():
    with pytest.raises(TypeError, match="missing a required argument"):
        change(numbers(), y=1.0)
    with pytest.raises(TypeError):
        change(numbers(), 1.0, 1, True, a=numbers())


def test_read_only_arrays_are_read_and_not_written():
    a = numbers()
    a.flags.writeable = False
    assert look(a) == 0.0
    with pytest.raises(TypeError):
        change(a, 1.0, 1, True)
    record = np.zeros(1, RECORD)
    record.flags.writeable = False
    with pytest.raises(TypeError):
        note(record[0:1].reshape(()))
    assert a[0] == record["mass"][0] == 0.0


def test_arrays_of_four_axes():
    a = np.arange(120.0).reshape(2, 3, 4, 5)
    assert layered(a, 2) == a[1, 0, 2].sum()
    with pytest.raises((TypeError, KernelError)):
        layered(a[None], 2)


def test_too_many_numbers_are_refused():
    """They would not fit into the memory that a call has for them."""

    @kernel
    def first(t):
        return t[0]

    assert first(tuple(map(float, range(100)))) == 0.0
    with pytest.raises(KernelError, match="at most"):
        first(tuple(map(float, range(300))))

    @kernel
    def most(x):
        return x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x

    @kernel
    def more(x):
        return x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x

    assert most(1.0) == (1.0,) * MAX_RESULTS
    with pytest.raises(KernelError, match="at most"):
        more(1.0)


def test_no_reference_is_lost_or_kept():
    a, x = numbers(), 1e9 + 0.5
    refused = np.zeros(4, dtype=np.int64)

    def calls(count):
        for _ in range(count):
            change(a, x, 10**6, True)
            look(a)
            nothing(a)
            with pytest.raises(TypeError):
                change(refused, x, 1, True)

    calls(100)
    watched = (a, x, refused, None, True, change, a.dtype)
    gc.collect()
    before = [sys.getrefcount(one) for one in watched]
    tracemalloc.start()
    calls(3000)  # what Python keeps of tracebacks is full then
    base = tracemalloc.get_traced_memory()[0]
    calls(3000)
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - base
    tracemalloc.stop()
    after = [sys.getrefcount(one) for one in watched]
    assert all(abs(b - c) < 50 for b, c in zip(before, after, strict=True)), list(
        zip(before, after, strict=True)
    )
    assert grown < 30_000


def test_other_threads_go_on_meanwhile():
    """A kernel that releases Python's lock runs beside another thread, which counts."""
    a = np.zeros(50)
    slow(a, 1)
    counted = []

    def count():
        while not finished.is_set():
            counted.append(1)
            time.sleep(1e-4)

    finished = threading.Event()
    other = threading.Thread(target=count)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)  # nothing but the kernel itself lets the other thread go on
    try:
        other.start()
        before = len(counted)
        for _ in range(1000):  # a busy machine may have other things to do than to count
            slow(a, 2_000_000)
            if len(counted) > before:
                break
        during = len(counted) - before
    finally:
        sys.setswitchinterval(interval)
        finished.set()
        other.join()
    assert during > 0
    np.testing.assert_allclose(a, 2.0)


def test_many_threads_compile_and_call():
    @kernel
    def fresh(a, x):
        a[0] += x
        return a[0]

    results = []
    threads = [
        threading.Thread(target=lambda: results.append(fresh(np.zeros(2), 1.5))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [1.5] * 8


@pytest.mark.parametrize("file", [bridge.__file__, ticks.__file__])
def test_what_calls_kernels_compiles_without_a_warning(file, tmp_path):
    command = compiler.compiler()
    assert command is not None
    head, source = Path(bridge.__file__).with_name("calls.h"), Path(file).with_suffix(".c")
    warnings = (
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Werror",
        "-c",
        "-o",
        str(tmp_path / "made.o"),
    )
    done = subprocess.run(
        [*command, *warnings, "-include", head, source], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


class Wider:
    __slots__ = ("A", "_address")


def test_objects_that_lie_otherwise_are_refused(monkeypatch):
    """As those of a Python without its global lock do, or those of a Python that is not known
    yet.
    """
    with monkeypatch.context() as known:
        known.setattr(bridge, "Caller", Wider)
        with pytest.raises(HarpyError, match=r"cannot be called from Python [\d.]+ with NumPy"):
            bridge.bridge.__wrapped__()
    monkeypatch.setattr(bridge.sysconfig, "get_config_var", lambda name: name == "Py_GIL_DISABLED")
    with pytest.raises(HarpyError, match="without its global lock"):
        bridge.bridge.__wrapped__()
