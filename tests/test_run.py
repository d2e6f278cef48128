"""The log on disk: round trip, damage, and files that cannot be written."""

from __future__ import annotations

import io
import json
import os
import stat

import numpy as np
import pinocchio as pin
import pytest

from harpy_pin import InputError, Run, RunFileError, Simulator
from harpy_pin.model.state import Command
from harpy_pin.plant.run import Recorder, check_writable

REQUIRED = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force", "torque", "thrust")


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
    signals["tick_ns"] = np.arange(rows)
    signals["held"] = np.arange(rows) % 2 == 0
    return Run(signals, {"ending": "completed", "dt": 5e-4, "nested": {"mu": [0.25, 0.8]}, **metadata})


def same(one, two):
    assert one.signals.keys() == two.signals.keys()
    for name, array in one.signals.items():
        np.testing.assert_array_equal(two[name], array, err_msg=name)
        assert two[name].dtype == array.dtype


def pack(path, signals, metadata):
    entries = dict(signals)
    if metadata is not None:
        entries["__metadata__"] = np.array(metadata if isinstance(metadata, str) else json.dumps(metadata))
    np.savez_compressed(path, **entries)
    return path


# --- Round trip -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["run.npz", "run", "läuft – schön.npz"])
@pytest.mark.parametrize("rows", [1, 7])
def test_round_trip(tmp_path, name, rows):
    run = make_run(rows)
    run.save(tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == [name]  # nothing added, nothing left over
    loaded = Run.load(str(tmp_path / name))
    same(run, loaded)
    assert len(loaded) == rows
    assert {**run.metadata, "format": 1} == loaded.metadata
    loaded.save(tmp_path / "again.npz")
    same(run, Run.load(tmp_path / "again.npz"))


def test_round_trip_of_a_real_run(robot, tmp_path):
    class Idle:
        def step(self, state):
            return Command(np.zeros(6), np.zeros((2, 3)))

    simulator = Simulator(robot)
    simulator.reset(pin.neutral(robot.model), np.zeros(12))
    run = simulator.run(Idle(), 0.01)
    run.save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    same(run, loaded)
    assert {**json.loads(json.dumps(run.metadata)), "format": 1} == loaded.metadata
    assert loaded.ending == run.ending


def test_run_that_ended_before_its_first_tick_is_kept_on_disk(robot, tmp_path):
    class Stopped:
        def step(self, state):
            raise KeyboardInterrupt

    simulator = Simulator(robot)
    simulator.reset(pin.neutral(robot.model), np.zeros(12))
    run = simulator.run(Stopped(), 0.01)
    assert len(run) == 0
    run.save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    assert loaded.ending == "interrupted"
    assert len(loaded) == 0


def test_signals_by_name():
    run = make_run()
    assert "torque" in run
    assert "noise" not in run
    with pytest.raises(InputError, match=r"'noise'.*torque"):
        run["noise"]


def test_ending():
    assert make_run(ending="fell").fell
    assert make_run(ending="diverged").fell
    assert not make_run(ending="interrupted").fell
    assert Run(make_run().signals, {}).ending == "unknown"


# --- Damage ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "run.npz"
    make_run().save(path)
    return path.read_bytes()


def test_every_truncation_is_refused(tmp_path, content):
    path = tmp_path / "cut.npz"
    path.write_bytes(content)
    for length in range(len(content) - 1, -1, -1):
        os.truncate(path, length)
        with pytest.raises(RunFileError) as caught:
            Run.load(path)
        assert caught.value.path == path


@pytest.mark.parametrize("pattern", [0xFF, 0x01, 0x20])
def test_corrupted_byte_is_refused_or_harmless(tmp_path, content, pattern):
    """Any byte of the file flipped: RunFileError, or (bytes nobody reads, such as dates) the very same log."""
    path, whole, refused = tmp_path / "flipped.npz", make_run(), 0
    for position in range(pattern % 7, len(content), 7):
        damaged = bytearray(content)
        damaged[position] ^= pattern
        path.write_bytes(damaged)
        try:
            loaded = Run.load(path)
        except RunFileError:
            refused += 1
        else:
            same(whole, loaded)
            assert loaded.ending == "completed"
    assert refused > len(content) // 7 // 2


def test_overwritten_stretch_is_refused(tmp_path, content):
    path, rng = tmp_path / "scratched.npz", np.random.default_rng(1)
    for _ in range(300):
        damaged = bytearray(content)
        start = int(rng.integers(0, len(content) - 64))
        damaged[start : start + 64] = rng.bytes(64)
        path.write_bytes(damaged)
        with pytest.raises(RunFileError):
            Run.load(path)


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "data",
    [b"", b"PK", b"PK\x03\x04", b"PK\x05\x06" + bytes(18), b"hello", npy(np.zeros(3)), bytes(1000), b"\x80\x04."],
    ids=["empty", "PK", "zip start", "empty zip", "text", "npy", "zeros", "pickle"],
)
def test_not_an_archive(tmp_path, data):
    path = tmp_path / "other.npz"
    path.write_bytes(data)
    with pytest.raises(RunFileError, match=r"other\.npz"):
        Run.load(path)


def test_missing_and_folder(tmp_path):
    with pytest.raises(RunFileError, match=r"no run log at.*absent"):
        Run.load(tmp_path / "absent.npz")
    with pytest.raises(RunFileError):
        Run.load(tmp_path)


@pytest.mark.parametrize("name", REQUIRED)
def test_missing_signal_is_named(tmp_path, name):
    signals = make_run().signals
    del signals[name]
    with pytest.raises(RunFileError, match=rf"\b{name}\b"):
        Run.load(pack(tmp_path / "run.npz", signals, {"format": 1}))


@pytest.mark.parametrize(
    "metadata",
    [None, "{", "", "[]", "3", "null", {}, {"format": 2}, {"format": "1"}, {"format": None}],
    ids=str,
)
def test_wrong_format(tmp_path, metadata):
    with pytest.raises(RunFileError):
        Run.load(pack(tmp_path / "run.npz", make_run().signals, metadata))


def test_signals_of_different_length(tmp_path):
    signals = make_run().signals
    signals["torque"] = signals["torque"][:-1]
    with pytest.raises(RunFileError, match="length"):
        Run.load(pack(tmp_path / "run.npz", signals, {"format": 1}))


@pytest.mark.parametrize("name", ["t", "gain"])
def test_signal_that_is_no_series(tmp_path, name):
    signals = {**make_run().signals, name: np.array(3.0)}
    with pytest.raises(RunFileError):
        Run.load(pack(tmp_path / "run.npz", signals, {"format": 1}))


def test_objects_are_never_unpickled(tmp_path):
    signals = {**make_run().signals, "evil": np.array([print] * 7, dtype=object)}
    with pytest.raises(RunFileError):
        Run.load(pack(tmp_path / "run.npz", signals, {"format": 1}))


# --- Writing --------------------------------------------------------------------------------------------------------


def test_check_writable_leaves_no_trace(tmp_path):
    check_writable(tmp_path / "new.npz")
    assert list(tmp_path.iterdir()) == []
    old = tmp_path / "old.npz"
    old.write_bytes(b"precious")
    check_writable(old)
    assert old.read_bytes() == b"precious"


def test_unwritable_paths_are_found_beforehand(tmp_path):
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "absent" / "run.npz", tmp_path / "file" / "run.npz", tmp_path / "folder", tmp_path):
        with pytest.raises(RunFileError) as caught:
            check_writable(path)
        assert caught.value.path == path
        with pytest.raises(RunFileError):
            make_run().save(path)


def test_name_that_is_too_long(tmp_path):
    """The name of the temporary file is longer than the target's: both must fit, or the check must say no."""
    for length in (255, 256, 240):
        path = tmp_path / ("a" * length)
        try:
            check_writable(path)
        except RunFileError:
            continue
        make_run().save(path)
        same(make_run(), Run.load(path))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_folder(tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        with pytest.raises(RunFileError):
            check_writable(tmp_path / "run.npz")
    finally:
        tmp_path.chmod(stat.S_IRWXU)


def test_saving_over_a_run_that_fails_keeps_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    make_run(3).save(path)
    before = path.read_bytes()

    def full_disk(file, array, **_):
        file.write(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", full_disk)
    with pytest.raises(RunFileError, match="No space left"):
        make_run(7).save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_interrupted_save_keeps_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    make_run(3).save(path)
    before = path.read_bytes()

    def interrupted(file, array, **_):
        file.write(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(np.lib.format, "write_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make_run(7).save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_saving_replaces_and_respects_the_umask(tmp_path):
    path = tmp_path / "run.npz"
    make_run(3).save(path)
    old = os.umask(0o027)
    try:
        make_run(7).save(path)
    finally:
        os.umask(old)
    assert len(Run.load(path)) == 7
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_whole_file_is_in_place_at_once(tmp_path, monkeypatch):
    """While the new log is being written the old one can be read."""
    path, original, seen = tmp_path / "run.npz", np.lib.format.write_array, set()
    make_run(3).save(path)

    def spy(file, array, **options):
        original(file, array, **options)
        seen.add(len(Run.load(path)))

    monkeypatch.setattr(np.lib.format, "write_array", spy)
    make_run(7).save(path)
    assert seen == {3}
    assert len(Run.load(path)) == 7


def test_signal_names_that_clash_with_numpys_arguments(tmp_path):
    """A controller may call a signal ``file``."""
    run = make_run()
    run.signals["file"] = np.arange(7.0)
    run.save(tmp_path / "run.npz")
    same(run, Run.load(tmp_path / "run.npz"))


# --- Recorder -------------------------------------------------------------------------------------------------------


def test_recorder_grows_and_copies():
    recorder, row = Recorder(), np.zeros(2)
    for i in range(10):
        row[:] = i
        recorder.append({"a": row, "n": i})
    arrays = recorder.arrays()
    np.testing.assert_array_equal(arrays["a"], np.repeat(np.arange(10.0)[:, None], 2, axis=1))
    np.testing.assert_array_equal(arrays["n"], np.arange(10))


@pytest.mark.parametrize("value", [1.0, [1.0], np.ones(1), np.ones(2), [1.0, 2.0], np.ones(6)[::2][:2]])
def test_recorder_refuses_other_sizes(value):
    """Also those that NumPy would repeat until they fit."""
    recorder = Recorder()
    recorder.append({"a": np.zeros(3), "n": 1})
    with pytest.raises(InputError, match="changed shape: a"):
        recorder.append({"a": value, "n": 2})
    recorder.append({"a": [4, 5, 6], "n": 3})
    assert len(recorder) == 2
    np.testing.assert_array_equal(recorder.arrays()["a"], [[0.0, 0.0, 0.0], [4.0, 5.0, 6.0]])


def test_recorder_refuses_changes_that_leave_the_row_as_long_as_before():
    recorder = Recorder()
    recorder.append({"a": np.zeros(3), "b": np.zeros(2)})
    with pytest.raises(InputError, match="changed shape: a, b"):
        recorder.append({"a": np.zeros(2), "b": np.zeros(3)})
    assert len(recorder) == 1


def test_rows_so_far_are_not_changed_by_later_ones():
    recorder = Recorder()
    recorder.append({"a": 1.0})
    before = recorder.arrays()["a"]
    recorder.append({"a": 2.0})
    np.testing.assert_array_equal(before, [1.0])


def test_recorder_refuses_other_names():
    recorder = Recorder()
    recorder.append({"a": 1.0})
    with pytest.raises(InputError):
        recorder.append({"b": 1.0})
    np.testing.assert_array_equal(recorder.arrays()["a"], [1.0])


def test_recorder_takes_any_layout_and_type():
    recorder, table = Recorder(), np.arange(12.0).reshape(3, 4)
    for i in range(3):
        recorder.append({"turned": table.T, "every other": table[:, ::2], "whole": np.arange(2), "yes": i == 1})
    arrays = recorder.arrays()
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
    assert {name: array.tolist() for name, array in recorder.arrays().items()} == {"a": [1.0, 3.0], "b": [2.0, 4.0]}
