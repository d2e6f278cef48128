"""The C compiler: which one, with which flags, and where what it makes is kept.

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
import logging
import os
import platform
import re
import secrets
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

from harpy_pin.errors import HarpyError, KernelError, install_line

EXACT = (
    "-std=c99",
    "-ffp-contract=off",
    "-fno-tree-slp-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
)
"""No fused products, so that every compiler gives the same digits; GCC 12 makes some from
neighbouring statements (vfmaddsub) although contraction is off.
"""
VECTORS = "-fvect-cost-model=cheap"
FOR_A_WHEEL = bool(os.environ.get("HARPY_PIN_FOR_A_WHEEL"))
"""Whether what is compiled is for other machines, too: processors since 2009, which NumPy's wheels
need as well.
"""
BASELINE = ("-march=x86-64-v2",) if platform.machine() == "x86_64" else ()
FLAGS = (
    *EXACT,
    "-O2",
    VECTORS,
    "-fpeel-loops",
    "-fno-gcse",
    *(BASELINE if FOR_A_WHEEL else ("-march=native", "-g1")),
)
"""Loops over rows become vector instructions, also where their length is known at run time only:
with that the general QP's tick takes 0.7 of the time. Sums keep their order, so no digit changes.
Without a search for common expressions across blocks GCC compiles in 0.87 of the time, and no tick
takes longer.
"""
SHARED = ("-shared", "-fPIC", "-w")
FORMAT = "2"  # of a library's file
MAX_SIZE = 1 << 26  # of a library's file, bytes
PATIENCE = 300.0  # how long a process waits for another that makes the same library, s
UNUSED_FOR = 60 * 24 * 3600  # time after which a library that nobody loaded is removed, s
WATCHED = (
    """exec 3<&0 0</dev/null; { read x <&3; kill -TERM 0; } >/dev/null 2>&1 & exec "$@" 3<&-"""
)
"""A shell's words: run a command, and end its process group as soon as nobody writes to the
standard input any more.
"""
BROUGHT = Path(__file__).with_name("libraries")  # where a wheel for one platform has its libraries
KEPT_FILE = re.compile(r"\w+-[0-9a-f]{32}.*\.(so|lock|part)")
"""Names of what is kept, and of what is being made."""
MADE: list[Path] = []  # libraries that this process has compiled
LOGGER = logging.getLogger("harpy_pin.compiling")
_SAID: set[str] = set()


def say(message: str) -> None:
    """A notice, once in a process; ``logging.getLogger("harpy_pin.compiling").setLevel("ERROR")``
    silences it.
    """
    if message not in _SAID:
        _SAID.add(message)
        LOGGER.warning(message)


@cache
def compiler() -> tuple[str, ...] | None:
    """The command of the C compiler: ``$CC``, ``cc``, ``gcc``, ``clang``, ``ziglang``; None without
    any.
    """
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        words = name.split()
        if words and (found := shutil.which(words[0])):
            return (found, *words[1:])
    if find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc")
    return None


def command() -> tuple[str, ...]:
    """The same, where one is needed; a :class:`HarpyError` says that there is none."""
    found = compiler()
    if found is None:
        raise HarpyError(f"there is no C compiler: {_install()}")
    return found


def _install() -> str:
    return f"install gcc or clang, or {install_line('cc')}"


@cache
def version() -> str:
    """The compiler's name and version, in a line."""
    with suppress(OSError, subprocess.SubprocessError, IndexError):
        told = subprocess.run(
            [*(compiler() or ()), "--version"],
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
        return told.stdout.splitlines()[0]
    return "unknown compiler"


@cache
def portable() -> bool:
    """Whether libraries are those of a wheel: one is being built, or there is no compiler."""
    return FOR_A_WHEEL or compiler() is None


@cache
def _machine() -> str:
    """What decides a library besides its source: compiler, flags and processor; of a portable one
    the platform.
    """
    if portable():
        return repr((platform.machine(), platform.system()))
    command = compiler() or ()
    with suppress(OSError, IndexError):
        status = os.stat(os.path.realpath(command[0]))
        command = (*command, str(status.st_size), str(status.st_mtime_ns))
    features = platform.processor()
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as info:
        lines = [line for line in info if line.startswith(("flags", "Features", "model name"))]
        features = "".join(sorted(set(lines)))
    return repr((command, FLAGS, SHARED, platform.machine(), platform.system(), features))


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
        say(
            f"compiled kernels are not kept, for '{path}' cannot be used: {error.strerror or error}"
        )
        return _own_folder()
    return path


def _is_mine(status: os.stat_result) -> bool:
    """Whether a file or folder is this user's, and nobody else can write to it."""
    return not hasattr(os, "geteuid") or (
        status.st_uid == os.geteuid() and not status.st_mode & 0o022
    )


@cache
def _own_folder() -> Path:
    """A folder of this process, removed at its end."""
    holder = tempfile.TemporaryDirectory(prefix="harpy_pin_")
    _KEPT.append(holder)
    return Path(holder.name)


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


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
    if compiler() is None:
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
        raise HarpyError(f"{why}: {_install()}")
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
    yield _own_folder() / path.name


def _make(path: Path, source: str) -> Path:
    """Compile; the file takes its place whole. Returns where it is, another folder where it cannot
    be kept.
    """
    say("compiling kernels for this robot, for some seconds; the result is kept on disk")
    try:
        with work_folder() as work:
            data = _compiled(source, work, path.name.partition("-")[0])
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
    raise KernelError(
        f"no place to keep a compiled kernel: '{path.parent}' and '{_own_folder()}' cannot be "
        f"written"
    )


def _compiled(source: str, work: str, name: str) -> bytes:
    """A library of this C; its parts, where it has several, are compiled at once, the longest ones
    first.
    """
    file, made = f"{work}/{name}.c", f"{work}/made.so"
    Path(file).write_text(source, encoding="utf-8")
    flags = [flag for flag in FLAGS if flag != VECTORS or "clang" not in version()]  # it refuses it
    if "ziglang" in (compiler() or ()):
        flags = [
            flag.replace("x86-64-v2", "x86_64_v2") for flag in flags
        ]  # its name of the processor
    parts = re.search(r"^#define PARTS (\d+)$", source, re.MULTILINE)
    objects = [f"{work}/{n}.o" for n in range(int(parts[1]) if parts else 0)]

    def compile_part(n: int) -> None:
        run_compiler([*flags, *SHARED, f"-DPART={n}", "-c", file, "-o", objects[n]], temporary=work)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_part, reversed(range(len(objects)))))
    run_compiler([*flags, *SHARED, *(objects or [file]), "-o", made, "-lm"], temporary=work)
    return Path(made).read_bytes()


@contextmanager
def work_folder() -> Iterator[str]:
    """A folder that is gone after the block, and where the process ends meanwhile
    (:func:`ending`).
    """
    path = os.path.join(tempfile.gettempdir(), f"harpy_pin_{secrets.token_hex(8)}")
    with _STARTING:
        if _ENDING:
            raise KernelError("nothing is compiled while the process ends")
        _WORK.add(path)
        os.mkdir(path, 0o700)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        _WORK.discard(path)


def run_program(
    command: list[str], *, temporary: str | None = None, timeout: float | None = None
) -> tuple[str, int]:
    """Run a compiler, or what it made, which ends with this process; returns what it said, and its
    exit code.

    It has a process group of its own: Ctrl-C in a terminal ends what this process decides, not the
    compilers first.
    """
    known = os.environ if temporary is None else {**os.environ, "TMPDIR": temporary}
    pipes: dict[str, Any] = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.STDOUT,
        "process_group": 0,
    }
    watched, ours = os.pipe()  # ours is closed, too, where this process is killed
    with os.fdopen(ours, "wb"):
        with os.fdopen(watched) as end, _STARTING:
            if _ENDING:
                raise KernelError("nothing is compiled while the process ends")
            words = ["/bin/sh", "-c", WATCHED, "sh", *command]
            process = subprocess.Popen(words, text=True, env=known, stdin=end, **pipes)
            _RUNNING.add(process)
        with process:
            try:
                said = process.communicate(timeout=timeout)[0]
            finally:
                _end(process)
                _RUNNING.discard(process)
    return said, process.returncode


def run_compiler(arguments: list[str], *, temporary: str | None = None) -> None:
    """Run the C compiler; a :class:`HarpyError` says that there is none, or what it says.

    ``temporary`` is a folder for its temporary files, which an end by :func:`ending` leaves behind.
    """
    words = command()
    said, code = run_program([*words, *arguments], temporary=temporary)
    if code != 0:
        why = "was ended" if code < 0 else f"failed:\n{said[:4000]}"
        raise KernelError(f"{' '.join(words)} {why}")


def _end(process: subprocess.Popen[str]) -> None:
    """End a compiler with the processes that it has started."""
    if process.poll() is None:
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGTERM)


_RUNNING: set[subprocess.Popen[str]] = set()
_WORK: set[str] = set()  # folders in which compilers work
_ENDING: list[bool] = []
_STARTING = Lock()


@contextmanager
def ending() -> Iterator[None]:
    """A block before which the compilers of all threads are ended and their folders removed; in it
    none is begun.
    """
    with _STARTING:
        _ENDING.append(True)
    _abandon()
    try:
        yield
    finally:
        _ENDING.pop()


def begin_anew() -> None:
    """In a forked child, which has none of its parent's threads: their compilers and folders are
    the parent's.
    """
    global _STARTING
    _STARTING = Lock()
    _RUNNING.clear()
    _WORK.clear()
    _ENDING.clear()


def leave() -> None:
    """End compilers and remove their folders before the process ends at once; takes no lock, so
    that signals may.
    """
    _ENDING.append(True)
    _abandon()
    for holder in _KEPT:
        holder.cleanup()


def _abandon() -> None:
    """End the compilers of all threads and remove their folders."""
    running = list(_RUNNING)
    for process in running:
        _end(process)
    for process in running:
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)
    for path in list(_WORK):
        shutil.rmtree(path, ignore_errors=True)


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
