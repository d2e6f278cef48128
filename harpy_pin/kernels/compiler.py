"""The C compiler: which one, with which flags, and what runs it. What it makes is kept by
:mod:`harpy_pin.kernels.library_files`.

Compilers, and the folders in which they work, end with this process.
"""

from __future__ import annotations

import logging
import os
import platform
import re
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
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
GCC_ONLY = ("-fvect-cost-model=cheap", "-fno-ipa-ra")
"""Flags that Clang refuses."""
FOR_A_WHEEL = bool(os.environ.get("HARPY_PIN_FOR_A_WHEEL"))
"""Whether what is compiled is for other machines, too: processors since 2009, which NumPy's wheels
need as well.
"""
BASELINE = ("-march=x86-64-v2",) if platform.machine() == "x86_64" else ()
FLAGS = (
    *EXACT,
    "-O2",
    *GCC_ONLY,
    "-fpeel-loops",
    "-fno-gcse",
    *(BASELINE if FOR_A_WHEEL else ("-march=native", "-g1")),
)
"""Loops over rows become vector instructions, also where their length is known at run time only:
with that the general QP's tick takes 0.7 of the time. Sums keep their order, so no digit changes.
Without a search for common expressions across blocks GCC compiles in 0.87 of the time, and no tick
takes longer. What a function leaves in registers is not looked at by its callers: where it is,
GCC 12 leaves vector registers in use before calls of the mathematical library, which then takes
several times as long.
"""
SHARED = ("-shared", "-fPIC", "-w")
WATCHED = (
    """exec 3<&0 0</dev/null; { read x <&3; kill -TERM 0; } >/dev/null 2>&1 & exec "$@" 3<&-"""
)
"""A shell's words: run a command, and end its process group as soon as nobody writes to the
standard input any more.
"""
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
        raise HarpyError(f"there is no C compiler: {how_to_install()}")
    return found


def how_to_install() -> str:
    """What to install for a compiler."""
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
def own_folder() -> Path:
    """A folder of this process, removed at its end."""
    holder = tempfile.TemporaryDirectory(prefix="harpy_pin_")
    _KEPT.append(holder)
    return Path(holder.name)


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


def compiled(source: str, work: str, name: str) -> bytes:
    """A library of this C; its parts, where it has several, are compiled at once, the longest ones
    first.
    """
    file, made = f"{work}/{name}.c", f"{work}/made.so"
    Path(file).write_text(source, encoding="utf-8")
    flags = [flag for flag in FLAGS if flag not in GCC_ONLY or "clang" not in version()]
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
