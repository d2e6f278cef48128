"""The log on disk: round trip, damage, and files that cannot be written."""

from __future__ import annotations

import io
import json
import math
import os
import stat
import warnings
import zipfile

import numpy as np
import pinocchio as pin
import pytest

from harpy_pin import InputError, Interrupted, Run, RunFileError, Simulator
from harpy_pin.files import check_writable
from harpy_pin.log import archive as archive_module

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
    signals["t"] = 0.5 + 1e-3 * np.arange(rows)
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
    ("name", "array", "message"),
    [
        ("torque", np.zeros((6, 6)), "length"),
        ("t", np.array(3.0), None),
        ("gain", np.array(3.0), None),
        ("evil", np.array([print] * 7, dtype=object), None),
    ],
    ids=["another length", "a time alone", "a number alone", "objects, which are never unpickled"],
)
def test_what_is_no_signal_is_refused(tmp_path, name, array, message):
    with pytest.raises(RunFileError, match=message):
        Run.load(pack(tmp_path / "run.npz", make_run().signals | {name: array}, {"format": 1}))


@pytest.mark.parametrize(
    "metadata", [None, "{", "", "[]", "3", "null", {}, {"format": 2}, {"format": "1"}, {"format": None}], ids=str
)
def test_wrong_format(tmp_path, metadata):
    with pytest.raises(RunFileError):
        Run.load(pack(tmp_path / "run.npz", make_run().signals, metadata))


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


def failing(error, after=3):
    """NumPy's function, until some arrays are written."""
    original, calls = np.lib.format.write_array_header_1_0, []

    def write(file, description):
        calls.append(1)
        if len(calls) > after:
            raise error
        original(file, description)

    return write


@pytest.mark.parametrize(
    ("error", "raised"),
    [(OSError(28, "No space left on device"), RunFileError), (KeyboardInterrupt(), KeyboardInterrupt)],
)
def test_saving_that_fails_or_is_interrupted_keeps_the_old_run(tmp_path, monkeypatch, error, raised):
    path = tmp_path / "run.npz"
    make_run(3).save(path)
    before = path.read_bytes()
    monkeypatch.setattr(np.lib.format, "write_array_header_1_0", failing(error))
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
    path, original, seen = tmp_path / "run.npz", np.lib.format.write_array_header_1_0, set()
    make_run(3).save(path)

    def spy(file, description):
        original(file, description)
        seen.add(len(Run.load(path)))

    monkeypatch.setattr(np.lib.format, "write_array_header_1_0", spy)
    make_run(7).save(path)
    assert seen == {3}
    assert len(Run.load(path)) == 7


def test_signal_names_that_clash_with_numpys_arguments(tmp_path):
    """A controller may call a signal ``file``."""
    run = make_run()
    run.signals["file"] = np.arange(7.0)
    run.save(tmp_path / "run.npz")
    same(run, Run.load(tmp_path / "run.npz"))


# --- Files from strangers -------------------------------------------------------------------------------------------


def header(shape, descr="<f8"):
    """NumPy's header of an array that is not there."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": descr, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


def repack(path, extra, *, metadata=None, method=zipfile.ZIP_DEFLATED):
    """A good log with other or more entries: bytes by name."""
    entries = {name: npy(array) for name, array in make_run().signals.items()}
    entries["__metadata__"] = npy(np.array(json.dumps({"format": 1, **(metadata or {})})))
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", method) as archive:
        warnings.simplefilter("ignore")  # zipfile's, about names that are there twice
        for name, data in {**entries, **dict(extra)}.items():
            archive.writestr(f"{name}.npy", data)
        for name, data in extra if isinstance(extra, list) else ():
            archive.writestr(f"{name}.npy", data)
    return path


def refused(path):
    """The one line that says why."""
    with pytest.raises(RunFileError) as caught:
        Run.load(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    assert len(message) < len(str(path)) + 200
    return message


def test_repacked_log_is_good(tmp_path):
    same(make_run(), Run.load(repack(tmp_path / "run.npz", {})))


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(7, dtype=complex),
        np.array(["left"] * 7),
        np.array([b"left"] * 7),
        np.zeros(7, dtype=">f8"),
        np.zeros(7, dtype="datetime64[s]"),
        np.zeros(7, dtype=[("x", float)]),
        np.zeros(7, dtype=np.longdouble),
    ],
    ids=lambda array: str(array.dtype),
)
@pytest.mark.parametrize("name", ["gain", "t"])
def test_other_than_plain_numbers(tmp_path, name, array):
    assert "not plain numbers" in refused(repack(tmp_path / "run.npz", {name: npy(array)}))


EVEN = 1e-3 * np.arange(7)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("q", np.zeros((7, 13), np.float32), "q holds"),
        ("q", np.zeros((7, 13), np.int64), "q holds"),
        ("q", np.zeros((7, 13), np.bool_), "q holds"),
        ("q", np.zeros(7), ""),
        ("foot_force", np.zeros((7, 2, 2)), ""),
        ("foot_force", np.zeros((7, 3, 3)), ""),
        ("t", np.zeros((7, 1)), ""),
        ("t", np.where(np.arange(7) == 3, np.nan, EVEN), "times"),
        ("t", np.where(np.arange(7) == 6, np.inf, EVEN), "times"),
        ("t", 1e9 + EVEN, "times"),  # late
        ("t", -1e9 - EVEN, "times"),  # early
        ("t", EVEN[::-1], "times"),
        ("t", np.zeros(7), "times"),
        ("t", EVEN + 1.0 * (np.arange(7) > 3), "times"),  # a jump ahead
        ("t", EVEN - 2e-3 * (np.arange(7) > 3), "times"),  # a jump back
        ("t", 1e6 * EVEN, "times"),  # giant steps
    ],
)
def test_types_shapes_and_times_that_no_walk_has(tmp_path, name, array, message):
    assert message in refused(repack(tmp_path / "run.npz", {name: npy(array)}))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ending", ["fell"]),
        ("ending", None),
        ("control_period", "1 ms"),
        ("control_period", math.nan),
        ("control_period", True),
        ("end_time", math.inf),
        ("feet", "left"),
        ("feet", [1, 2]),
        ("feet", None),
        ("parameters", []),
        ("ground", 0.8),
        ("scenario", "walk"),
        ("pushes", {}),
    ],
)
def test_metadata_of_odd_types(tmp_path, name, value):
    assert name in refused(repack(tmp_path / "run.npz", {}, metadata={name: value}))


@pytest.mark.parametrize("name", ["<script>", "[red]x", "a/b", "../q", "a\nb", "__class__", "", "x" * 101, "a\x1b[0m"])
def test_names_that_mean_something_elsewhere(tmp_path, name):
    refused(repack(tmp_path / "run.npz", {name: npy(np.zeros(7))}))
    run = make_run()
    run.signals[name] = np.zeros(7)
    with pytest.raises(RunFileError):
        run.save(tmp_path / "own.npz")
    assert not (tmp_path / "own.npz").exists()


def test_entry_that_is_there_twice(tmp_path):
    assert "twice" in refused(repack(tmp_path / "run.npz", [("q", npy(np.zeros((7, 13))))]))


def test_entry_that_is_no_array(tmp_path):
    path = repack(tmp_path / "run.npz", {})
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("readme.txt", "hello")
    assert "no array" in refused(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_foreign_compression(tmp_path, method):
    assert "foreign" in refused(repack(tmp_path / "run.npz", {}, method=method))


@pytest.mark.parametrize(
    "data",
    [
        header((10**12,)),
        header((7, 10**12)),
        header((-1, -8)),
        header((7,), "<U1000000000"),
        header((7,)) + bytes(55),
        header((7,)) + bytes(57),
        b"\x93NUMPY\x02\x00\xff\xff\xff\x7f",
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535,
    ],
    ids=["8 TB", "56 TB", "negative", "long text", "short", "long", "long header", "deep header"],
)
def test_headers_that_lie(tmp_path, data):
    refused(repack(tmp_path / "run.npz", {"gain": data}))


def test_zip_bomb_is_not_unpacked(tmp_path, monkeypatch):
    """A hundred megabytes of zeros in a hundred kilobytes: refused by what it declares, before anything is read."""
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("t.npy", "w") as entry:
        entry.write(header((100 << 17,)))
        for _ in range(100):
            entry.write(bytes(1 << 20))
    assert path.stat().st_size < 200_000
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_, **__: pytest.fail("unpacked"))
    assert "too many" in refused(path)


def test_column_order_of_a_foreign_writer(tmp_path):
    q = np.asfortranarray(np.random.default_rng(3).normal(size=(7, 13)))
    np.testing.assert_array_equal(Run.load(repack(tmp_path / "run.npz", {"q": npy(q)}))["q"], q)


def test_big_logs_are_mapped(tmp_path, monkeypatch):
    run = make_run(50)
    run.save(tmp_path / "run.npz")
    monkeypatch.setattr(archive_module, "MAPPED", 1000)
    mapped = Run.load(tmp_path / "run.npz")
    same(run, mapped)
    assert all(
        array.flags.aligned and array.flags.writeable and not array.flags.owndata for array in mapped.signals.values()
    )
    content = (tmp_path / "run.npz").read_bytes()
    place = content.index(run["q"].tobytes())
    assert place % 64 == 0
    mapped["q"][:] = 0.0  # changes the copy in memory, not the file
    same(run, Run.load(tmp_path / "run.npz"))
    (tmp_path / "bad.npz").write_bytes(content[: place + 8] + b"\xff" + content[place + 9 :])
    refused(tmp_path / "bad.npz")


def test_plain_numpy_reads_a_log(tmp_path):
    run = make_run()
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        assert set(archive.files) == {*run.signals, "__metadata__"}
        for name, array in run.signals.items():
            np.testing.assert_array_equal(archive[name], array)
