"""The log on disk: round trip, damage, and files that cannot be written."""

import json
import os
import stat

import numpy as np
import pinocchio as pin
import pytest
from run_files import make_run, npy, same

from harpy_pin import InputError, Interrupted, Run, RunFileError, Simulator
from harpy_pin.files import check_writable

REQUIRED = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force", "torque", "thrust")


def pack(path, signals, metadata):
    entries = dict(signals)
    if metadata is not None:
        entries["__metadata__"] = np.array(
            metadata if isinstance(metadata, str) else json.dumps(metadata)
        )
    np.savez_compressed(path, **entries)
    return path


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


def test_run_that_ended_before_its_first_tick_is_kept_on_disk(robot, tmp_path):
    class Stopped:
        def step(self, state):
            raise KeyboardInterrupt

    simulator = Simulator(robot)
    simulator.reset(pin.neutral(robot.model), np.zeros(12))
    with pytest.raises(Interrupted) as caught:
        simulator.run(Stopped(), 0.01)
    run = caught.value.run
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


def test_corrupted_byte_is_refused_or_harmless(tmp_path, content):
    """Any byte of the file flipped: RunFileError, or (bytes nobody reads, such as dates) the very
    same log.
    """
    path, whole, refused = tmp_path / "flipped.npz", make_run(), 0
    for number, position in enumerate(range(0, len(content), 7)):
        damaged = bytearray(content)
        damaged[position] ^= (0xFF, 0x01, 0x20)[number % 3]
        path.write_bytes(damaged)
        try:
            loaded = Run.load(path)
        except RunFileError:
            refused += 1
        else:
            same(whole, loaded)
            assert loaded.ending == "completed"
    assert refused > len(content) // 7 // 2


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PK",
        b"PK\x03\x04",
        b"PK\x05\x06" + bytes(18),
        b"hello",
        npy(np.zeros(3)),
        bytes(1000),
        b"\x80\x04.",
    ],
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


def test_unwritable_paths_are_found_beforehand(tmp_path):
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder").mkdir()
    for path in (
        tmp_path / "absent" / "run.npz",
        tmp_path / "file" / "run.npz",
        tmp_path / "folder",
        tmp_path,
    ):
        with pytest.raises(RunFileError) as caught:
            check_writable(path)
        assert caught.value.path == path
        with pytest.raises(RunFileError):
            make_run().save(path)


def test_name_that_is_too_long(tmp_path):
    """The name of the temporary file is longer than the target's: both must fit, or the check must
    say no.
    """
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


def failing(error, after=3):
    """NumPy's function, until some arrays are written."""
    original, calls = np.lib.format.write_array, []

    def write(*arguments, **options):
        calls.append(1)
        if len(calls) > after:
            raise error
        original(*arguments, **options)

    return write


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (OSError(28, "No space left on device"), RunFileError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ],
)
def test_saving_that_fails_or_is_interrupted_keeps_the_old_run(
    tmp_path, monkeypatch, error, raised
):
    path = tmp_path / "run.npz"
    make_run(3).save(path)
    before = path.read_bytes()
    monkeypatch.setattr(np.lib.format, "write_array", failing(error))
    with pytest.raises(raised, match="No space left" if raised is RunFileError else None):
        make_run(7).save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_saving_replaces_and_respects_the_umask(tmp_path):
    path = tmp_path / "run.npz"
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

    def spy(*arguments, **options):
        original(*arguments, **options)
        seen.add(len(Run.load(path)))

    monkeypatch.setattr(np.lib.format, "write_array", spy)
    make_run(7).save(path)
    assert seen == {3}
    assert len(Run.load(path)) == 7
