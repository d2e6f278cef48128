"""Compiled libraries on disk: edits are noticed, damage is mended, and no place to write to is no
obstacle.
"""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from needs import needs_compiler
from oracle import run_plain

from harpy_pin.errors import KernelError
from harpy_pin.kernels import compiler, kernel, library_files, unit

pytestmark = needs_compiler
MODULE = """
from harpy_pin.kernels import kernel
from constants import OFFSET

@kernel
def inner(x):
    return {factor} * x

@kernel
def outer(x: float):
    return inner(x) + OFFSET
"""
SCRIPT = "from edited import outer; print(outer(3.0))"


@kernel
def root(x: float):
    low, high = 0.0, 1.0 + abs(x)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle * middle > abs(x):
            high = middle
        else:
            low = middle
    return low


@kernel
def half_root(x: float):
    return 0.5 * root(x)


@kernel
def up(x):
    for i in range(x.shape[0]):
        x[i] += 3.0 * half_root(x[i]) + root(x[i]) - 0.1 * half_root(x[0]) * root(x[0])


@kernel
def down(x):
    for i in range(x.shape[0]):
        x[i] -= 2.0 * half_root(x[i]) + root(x[i]) + 0.3 * half_root(x[0]) * root(x[0])


@kernel
def up_and_down(x):
    up(x)
    down(x)


def run(script, folder, **environment):
    """What a process prints, and its notices."""
    known = {name: value for name, value in os.environ.items() if not name.startswith("HARPY_PIN")}
    known |= {
        "HARPY_PIN_CACHE": str(folder / "cache"),
        "PYTHONPATH": f"{folder}:{Path.cwd()}",
        **environment,
    }
    # an edit within a second, of the same size, is not seen by Python itself
    known["PYTHONDONTWRITEBYTECODE"] = "1"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=known, cwd=folder
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr


def write(folder, *, factor=2.0, offset=0.5):
    (folder / "edited.py").write_text(MODULE.format(factor=factor))
    (folder / "constants.py").write_text(f"OFFSET = {offset}\n")


def libraries(folder, name="outer"):
    return sorted((folder / "cache").glob(f"{name}-*.so"))


def test_every_edit_is_noticed(tmp_path):
    """In the kernel's own file, in a kernel that it calls, and in a number that it takes from
    elsewhere.
    """
    write(tmp_path)
    printed, notice = run(SCRIPT, tmp_path)
    assert (printed, notice.count("compiling kernels")) == ("6.5", 1)
    assert run(SCRIPT, tmp_path) == ("6.5", "")  # from the disk, without a notice
    assert len(libraries(tmp_path)) == 1
    write(tmp_path, factor=4.0)
    assert run(SCRIPT, tmp_path)[0] == "12.5"
    write(tmp_path, offset=1.5)
    assert run(SCRIPT, tmp_path)[0] == "7.5"
    write(tmp_path)
    assert run(SCRIPT, tmp_path) == ("6.5", "")
    assert len(libraries(tmp_path)) == 3


EDITED_MEANWHILE = """
from pathlib import Path
from edited import outer
file = Path("edited.py")
file.write_text("\\n\\n" + file.read_text().replace("2.0", "8.0"))
print(outer(3.0))
"""


def test_an_edit_after_loading_changes_nothing(tmp_path):
    """What runs is what was loaded, as of any function of Python."""
    write(tmp_path)
    assert run(EDITED_MEANWHILE, tmp_path)[0] == "6.5"
    assert run(SCRIPT, tmp_path)[0] == "24.5"


def test_a_folder_that_cannot_be_made(tmp_path):
    write(tmp_path)
    (tmp_path / "cache").write_text("in the way")
    assert run(SCRIPT, tmp_path)[0] == "6.5"
    assert run(SCRIPT, tmp_path, HARPY_PIN_CACHE="/proc/nowhere")[0] == "6.5"
    assert (tmp_path / "cache").read_text() == "in the way"


def test_a_disk_that_is_full(tmp_path, monkeypatch):
    """What cannot be written where it belongs lives as long as the process."""
    full = tmp_path / "full"
    full.mkdir()
    monkeypatch.setattr(library_files, "folder", lambda: full)
    make = library_files.tempfile.mkstemp

    def refuse(*arguments, **how):
        if Path(how["dir"]) == full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return make(*arguments, **how)

    monkeypatch.setattr(library_files.tempfile, "mkstemp", refuse)

    @kernel
    def double(x: float):
        return 2.0 * x

    assert double(2.0) == 4.0
    assert list(full.iterdir()) == []


def test_two_processes_at_once(tmp_path):
    write(tmp_path)
    known = os.environ | {
        "HARPY_PIN_CACHE": str(tmp_path / "cache"),
        "PYTHONPATH": f"{tmp_path}:{Path.cwd()}",
    }
    both = [
        subprocess.Popen(
            [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, env=known, cwd=tmp_path
        )
        for _ in range(2)
    ]
    assert [process.communicate()[0].strip() for process in both] == [b"6.5", b"6.5"]
    assert len(libraries(tmp_path)) == 1
    assert not list((tmp_path / "cache").glob("*.part"))


def test_without_a_compiler_a_call_says_what_to_install(tmp_path):
    """Nothing is compiled, nor missed, before the first call."""
    write(tmp_path)
    empty = tmp_path / "bin"
    empty.mkdir()
    script = (
        "import sys\nsys.modules['ziglang'] = None\nfrom edited import outer\nprint('imported')\n"
        "from harpy_pin import HarpyError\ntry:\n    outer(3.0)\nexcept HarpyError as error:\n    "
        "print(error)"
    )
    printed, notice = run(script, tmp_path, PATH=str(empty), CC="")
    assert printed.startswith("imported\nthe kernel 'outer' ")
    assert "there is no C compiler: install gcc or clang, or pip install" in printed
    assert notice == ""
    assert not (tmp_path / "cache").exists()


def test_a_compiler_that_does_not_work(tmp_path):
    write(tmp_path)
    caught = "try:\n    outer(3.0)\nexcept KernelError as error:\n    print(error)"
    script = f"from edited import outer\nfrom harpy_pin.errors import KernelError\n{caught}"
    assert run(script, tmp_path, CC="false")[0].endswith("/false failed:")


def test_clang_gets_no_flags_that_it_refuses(tmp_path):
    write(tmp_path)
    clang = tmp_path / "clang"
    refuses = (
        f"case $1 in --version) echo clang version 14 ;; esac\ncase $* in "
        f"*{compiler.GCC_ONLY[0]}*|*{compiler.GCC_ONLY[1]}*) exit 1 ;; esac"
    )
    clang.write_text(f'#!/bin/sh\n{refuses}\nexec {" ".join(compiler.compiler())} "$@"\n')
    clang.chmod(0o700)
    assert run(SCRIPT, tmp_path, CC=str(clang))[0] == "6.5"
    assert len(libraries(tmp_path)) == 1


def test_a_library_in_parts(monkeypatch, tmp_path):
    """A long function, and a short one, are called from several parts; the short one calls another
    long one.
    """
    monkeypatch.setattr(library_files, "folder", lambda: tmp_path)
    monkeypatch.setattr(unit, "PART", 250)
    monkeypatch.setattr(unit, "SHORT", 120)
    x = np.random.default_rng(0).normal(size=5)
    expected = x.copy()
    run_plain(up_and_down, expected)
    assert int(re.search(r"#define PARTS (\d+)", up_and_down.c_source(x))[1]) > 2
    up_and_down(x)
    assert np.array_equal(x, expected)


def test_what_the_compiler_says_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(library_files, "folder", lambda: tmp_path)
    monkeypatch.setattr(compiler, "FLAGS", ("-O2", "-Dreal=nonsense+"))

    @kernel
    def triple(x: float):
        return 3.0 * x

    with pytest.raises(KernelError, match="failed"):
        triple(1.0)
    monkeypatch.undo()
    monkeypatch.setattr(library_files, "folder", lambda: tmp_path)
    assert triple(1.0) == 3.0  # the next call tries again


def test_old_libraries_go(tmp_path):
    write(tmp_path)
    run(SCRIPT, tmp_path)
    (old,) = libraries(tmp_path)
    mine = tmp_path / "cache" / "notes.txt"
    mine.write_text("not of the library")
    long_ago = old.stat().st_mtime - library_files.UNUSED_FOR - 10.0
    os.utime(old, (long_ago, long_ago))
    os.utime(mine, (long_ago, long_ago))
    write(tmp_path, factor=5.0)
    run(SCRIPT, tmp_path)
    assert old not in libraries(tmp_path)
    assert len(libraries(tmp_path)) == 1
    assert mine.exists()


def test_results_do_not_depend_on_where_they_come_from(tmp_path):
    """A kernel of arrays: compiled, and loaded from the disk."""
    (tmp_path / "edited.py").write_text(
        "import numpy as np\nfrom harpy_pin.kernels import kernel\n\n@kernel\ndef outer(x, out):\n"
        "    for i in range(x.shape[0]):\n        out[i] = np.sin(x[i]) / (1.0 + x[i] * x[i]) - "
        "0.1\n"
    )
    script = (
        "import numpy as np\nfrom edited import outer\nx = np.linspace(-3, 3, 50)\ny = "
        "np.zeros(50)\n"
        "outer(x, y)\nprint(y.tobytes().hex())"
    )
    found = run(script, tmp_path)[0]
    assert found == run(script, tmp_path)[0]
    x = np.linspace(-3.0, 3.0, 50)
    exact = np.frombuffer(bytes.fromhex(found))
    np.testing.assert_allclose(exact, np.sin(x) / (1.0 + x * x) - 0.1, rtol=0, atol=1e-15)


def _forged(path, data):
    """With the checksum that belongs to the name, as somebody would make it who reads the
    source.
    """
    path.write_bytes(data + library_files._checksum(path.name, data))


ATTACKS = {
    "garbage": lambda path, data, other: path.write_bytes(b"\x7fELF" + bytes(1000)),
    "garbage with its checksum": lambda path, data, other: _forged(path, b"\x7fELF" + bytes(1000)),
    "truncated": lambda path, data, other: path.write_bytes(data[: len(data) // 2]),
    "flipped": lambda path, data, other: path.write_bytes(data.replace(b"outer", b"inner")),
    "another library": lambda path, data, other: path.write_bytes(other.read_bytes()),
    "nothing": lambda path, data, other: path.write_bytes(b""),
    "a folder": lambda path, data, other: path.mkdir(),
    "a pipe": lambda path, data, other: os.mkfifo(path),
    "a link to a device": lambda path, data, other: path.symlink_to("/dev/zero"),
    "a link to another library": lambda path, data, other: path.symlink_to(other),
    "a file without an end": lambda path, data, other: os.truncate(
        os.open(path, os.O_CREAT | os.O_RDWR), 1 << 40
    ),
    "writable by others": lambda path, data, other: (path.write_bytes(data), path.chmod(0o666)),
    "a lock that is a pipe": lambda path, data, other: os.mkfifo(path.with_suffix(".lock")),
    "a lock that is a link": lambda path, data, other: path.with_suffix(".lock").symlink_to(
        "/dev/zero"
    ),
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A library in its folder, its content, and the library of another kernel."""
    folder = tmp_path_factory.mktemp("attacked")
    write(folder)
    run(SCRIPT, folder)
    run("from edited import inner; inner(1.0)", folder)
    (path,), (other,) = libraries(folder), libraries(folder, "inner")
    return folder, path, path.read_bytes(), other


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_is_no_library_of_ours_is_made_again(attack, compiled):
    """In bounded time; the next process finds the new one."""
    folder, path, data, other = compiled
    path.unlink()
    path.with_suffix(".lock").unlink(missing_ok=True)
    ATTACKS[attack](path, data, other)
    printed, notice = run(SCRIPT, folder)
    assert (printed, notice.count("compiling kernels")) == ("6.5", 1)
    if attack == "a folder":
        path.rmdir()
        path.write_bytes(data)
        path.chmod(0o600)
    assert run(SCRIPT, folder) == ("6.5", "")
    assert path.lstat().st_mode & 0o077 == 0


@pytest.mark.parametrize("mode", [0o777, 0o775])
def test_a_folder_that_others_can_write_to_is_not_used(mode, tmp_path):
    """One line says why; one in the user's own cache is closed instead."""
    write(tmp_path)
    (tmp_path / "cache" / "harpy_pin").mkdir(parents=True)
    for folder in (tmp_path / "cache", tmp_path / "cache" / "harpy_pin"):
        folder.chmod(mode)
    printed, notice = run(SCRIPT, tmp_path)
    assert printed == "6.5"
    assert notice.count("are not kept") == 1
    assert "others can write to it" in notice
    assert libraries(tmp_path) == []
    printed, notice = run(
        SCRIPT, tmp_path, HARPY_PIN_CACHE="", XDG_CACHE_HOME=str(tmp_path / "cache")
    )
    assert "are not kept" not in notice
    assert (tmp_path / "cache" / "harpy_pin").stat().st_mode & 0o777 == 0o700


def test_a_lock_that_nobody_releases(tmp_path, monkeypatch):
    import fcntl

    monkeypatch.setattr(library_files, "PATIENCE", 0.2)
    monkeypatch.setattr(library_files, "folder", lambda: tmp_path)
    with (tmp_path / "held-0.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with library_files._alone(tmp_path / "held-0.so"):
            pass
