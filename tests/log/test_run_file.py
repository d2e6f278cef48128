"""Run files from strangers: types, shapes, times, names and headers that no walk has are refused in
one line.
"""

import io
import json
import math
import warnings
import zipfile

import numpy as np
import pytest
from run_files import make_run, npy, refused, same

from harpy_pin import Run, RunFileError


def header(shape, descr="<f8"):
    """NumPy's header of an array that is not there."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": descr, "fortran_order": False, "shape": shape}
    )
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
        np.array([print] * 7, dtype=object),  # never unpickled
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
        ("q", np.zeros((7, 3)), "q has shape"),
        ("v", np.zeros((7, 5)), "v has shape"),
        ("torque", np.zeros((6, 6)), "length"),
        ("t", np.array(3.0), ""),
        ("gain", np.array(3.0), ""),
        ("foot_force", np.zeros((7, 2, 2)), ""),
        ("foot_force", np.zeros((7, 3, 3)), ""),
        ("t", np.zeros((7, 1)), ""),
        ("t", np.where(np.arange(7) == 3, np.nan, EVEN), "times"),
        ("t", np.where(np.arange(7) == 6, np.inf, EVEN), "times"),
        ("t", 1e9 + EVEN, "times"),  # late
        ("t", -1e9 - EVEN, "times"),  # early
        ("t", EVEN[::-1], "times"),
        ("t", np.zeros(7), "times"),
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
        *((name, 10**400) for name in ("mass", "dt", "end_time", "control_period")),
    ],
)
def test_metadata_of_odd_types(tmp_path, name, value):
    assert name in refused(repack(tmp_path / "run.npz", {}, metadata={name: value}))


@pytest.mark.parametrize(
    "name", ["<script>", "[red]x", "a/b", "../q", "a\nb", "__class__", "", "x" * 101, "a\x1b[0m"]
)
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
    """A hundred megabytes of zeros in a hundred kilobytes: refused by what it declares, before
    anything is read.
    """
    path = tmp_path / "run.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("t.npy", "w") as entry,
    ):
        entry.write(header((100 << 17,)))
        for _ in range(100):
            entry.write(bytes(1 << 20))
    assert path.stat().st_size < 200_000
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_, **__: pytest.fail("unpacked"))
    assert "too many" in refused(path)


def test_column_order_of_a_foreign_writer(tmp_path):
    q = np.asfortranarray(np.random.default_rng(3).normal(size=(7, 13)))
    np.testing.assert_array_equal(Run.load(repack(tmp_path / "run.npz", {"q": npy(q)}))["q"], q)


def test_plain_numpy_reads_a_log(tmp_path):
    run = make_run()
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        assert set(archive.files) == {*run.signals, "__metadata__"}
        for name, array in run.signals.items():
            np.testing.assert_array_equal(archive[name], array)
