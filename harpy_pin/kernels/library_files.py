"""Compiled kernels on disk.

A library is kept under a name that follows from everything that decides it, so that nothing out of
date is ever found. Files appear whole or not at all, and carry a checksum of their content and
name; a damaged one is made again. Nothing is loaded that others can write. Where nothing can be
kept, libraries live in a temporary folder of the process. Without a compiler those are used that
the wheel brings, if it is one for this platform (hatch_build.py).
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import os
import platform
import re
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from harpy_pin.errors import HarpyError, KernelError
from harpy_pin.kernels import compiler

FORMAT = "2"  # of a library's file
MAX_SIZE = 1 << 26  # of a library's file, bytes
PATIENCE = 300.0  # how long a process waits for another that makes the same library, s
UNUSED_FOR = 60 * 24 * 3600  # time after which a library that nobody loaded is removed, s
BROUGHT = Path(__file__).with_name("libraries")  # where a wheel for one platform has its libraries
KEPT_FILE = re.compile(r"\w+-[0-9a-f]{32}.*\.(so|lock|part)")
"""Names of what is kept, and of what is being made."""
MADE: list[Path] = []  # libraries that this process has compiled


@cache
def _machine() -> str:
    """What decides a library besides its source: compiler, flags and processor; of a portable one
    the platform.
    """
    if compiler.portable():
        return repr((platform.machine(), platform.system()))
    command = compiler.compiler() or ()
    with suppress(OSError, IndexError):
        status = os.stat(os.path.realpath(command[0]))
        command = (*command, str(status.st_size), str(status.st_mtime_ns))
    features = platform.processor()
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as info:
        lines = [line for line in info if line.startswith(("flags", "Features", "model name"))]
        features = "".join(sorted(set(lines)))
    return repr(
        (command, compiler.FLAGS, compiler.SHARED, platform.machine(), platform.system(), features)
    )


@cache
def folder() -> Path:
    """Where libraries are kept: ``$HARPY_PIN_CACHE``, or a folder in the user's cache."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    given = os.environ.get("HARPY_PIN_CACHE")
    path = Path(given or Path(home) / "harpy_pin")
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not given and not _is_mine(path.stat()):
            path.chmod(0o700)
        if not _is_mine(path.stat()):
            raise PermissionError(errno.EACCES, "it is another user's, or others can write to it")
        with tempfile.TemporaryFile(dir=path) as probe:
            probe.write(b"x" * 4096)
            probe.flush()
    except OSError as error:
        compiler.say(
            f"compiled kernels are not kept, for '{path}' cannot be used: {error.strerror or error}"
        )
        return compiler.own_folder()
    return path


def _is_mine(status: os.stat_result) -> bool:
    """Whether a file or folder is this user's, and nobody else can write to it."""
    return not hasattr(os, "geteuid") or (
        status.st_uid == os.geteuid() and not status.st_mode & 0o022
    )


def key_of(*parts: bytes | str) -> str:
    """A name for a library that these parts decide, together with compiler and machine."""
    digest = hashlib.sha256((FORMAT + _machine()).encode())
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()[:32]


def library(name: str, key: str, source: Callable[[], str]) -> ctypes.PyDLL:
    """A library, from its file or compiled from the C that ``source`` makes; a person may recognise
    its name.

    Raises:
        KernelError: the compiler fails; the message has what it says.
        HarpyError: there is none, and the wheel does not have it.
    """
    if compiler.compiler() is None:
        return _brought(f"{name}-{key}.so")
    path = folder() / f"{name}-{key}.so"
    if not _whole(path):
        with _alone(path):
            if not _whole(path):
                path = _make(path, source())
    for anew in _places(path):  # on some file systems nothing can be run
        with suppress(OSError):
            return ctypes.PyDLL(str(path))
        with suppress(OSError):
            path.unlink()
        path = _make(anew, source())
    try:
        return ctypes.PyDLL(str(path))
    except OSError as error:
        raise KernelError(f"the compiled kernel '{path}' cannot be loaded: {error}") from error


def _brought(name: str) -> ctypes.PyDLL:
    """A library of the wheel."""
    if not _whole(BROUGHT / name, ours=False):
        kernel = name.partition("-")[0]
        why = (
            f"the kernel '{kernel}' for this robot or setting is not in the wheel, and there is "
            f"no C compiler"
        )
        raise HarpyError(f"{why}: {compiler.how_to_install()}")
    try:
        return ctypes.PyDLL(str(BROUGHT / name))
    except OSError as error:
        raise HarpyError(
            f"the compiled kernel '{BROUGHT / name}' cannot be loaded: {error}"
        ) from error


def _checksum(name: str, data: bytes) -> bytes:
    return hashlib.sha256(name.encode() + data).digest()


def _whole(path: Path, *, ours: bool = True) -> bool:
    """Whether the file is there as it was written, for ``ours`` by this user.

    Its last bytes are the checksum of its name and the others.
    """
    flags = (
        os.O_RDONLY
        | getattr(os, "O_NOFOLLOW", 0)
        | getattr(os, "O_NONBLOCK", 0)
        | getattr(os, "O_BINARY", 0)
    )
    with suppress(OSError), os.fdopen(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if (
            not stat.S_ISREG(status.st_mode)
            or (ours and not _is_mine(status))
            or status.st_size > MAX_SIZE
        ):
            return False
        data = file.read()
        if _checksum(path.name, data[:-32]) == data[-32:]:
            if ours and time.time() - status.st_mtime > UNUSED_FOR / 10:
                os.utime(path)
            return True
    return False


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """One process at a time makes a file; where locks cannot be had, several make the same one."""
    lock, file = path.with_suffix(".lock"), None
    with suppress(OSError, ImportError):
        import fcntl

        file = os.open(lock, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(0.05)
    try:
        yield
    finally:
        if file is not None:
            with suppress(OSError):
                lock.unlink()
            with suppress(OSError):
                fcntl.flock(
                    file, fcntl.LOCK_UN
                )  # a child that was forked meanwhile keeps the file open
            os.close(file)


def _places(path: Path) -> Iterator[Path]:
    """Where a library may be kept: its place, or a folder of this process, made where it is
    needed.
    """
    yield path
    yield compiler.own_folder() / path.name


def _make(path: Path, source: str) -> Path:
    """Compile; the file takes its place whole. Returns where it is, another folder where it cannot
    be kept.
    """
    compiler.say("compiling kernels for this robot, for some seconds; the result is kept on disk")
    try:
        with compiler.work_folder() as work:
            data = compiler.compiled(source, work, path.name.partition("-")[0])
    except OSError as error:
        raise KernelError(f"a kernel cannot be compiled: {error}") from error
    data += _checksum(path.name, data)
    for place in _places(path):
        try:
            place.unlink(missing_ok=True)
            handle, temporary = tempfile.mkstemp(dir=place.parent, prefix=path.stem, suffix=".part")
            try:
                with os.fdopen(handle, "wb") as out:
                    out.write(data)
                os.replace(temporary, place)
            except BaseException:
                with suppress(OSError):
                    os.unlink(temporary)
                raise
        except OSError:
            continue
        clear(place.parent, unused_for=UNUSED_FOR)
        MADE.append(place)
        return place
    places = f"'{path.parent}' and '{compiler.own_folder()}'"
    raise KernelError(f"no place to keep a compiled kernel: {places} cannot be written")


def clear(place: Path | None = None, *, unused_for: float = 0.0) -> int:
    """Remove libraries that nobody has loaded for a time, s, from a folder, by default
    :func:`folder`; says how many.

    What processes have loaded stays with them.
    """
    count = 0
    with suppress(OSError):
        for path in list((place or folder()).iterdir()):
            with suppress(OSError):
                if not KEPT_FILE.fullmatch(path.name):
                    continue
                if not unused_for or time.time() - path.stat().st_mtime >= unused_for:
                    path.unlink()
                    count += path.suffix == ".so"
    return count
