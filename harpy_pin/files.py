"""Writing files so that nothing is lost: found unwritable before the work, replaced only when
whole.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import re
import secrets
import signal
import stat
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, ClassVar, NoReturn

from harpy_pin.errors import InputError, RunFileError, shown


def replaceable(path: str | Path) -> bool:
    """Whether a new file takes the place of an old one.

    Devices, pipes, and the file that this process prints to are written to as they are.
    """
    try:
        found = os.stat(path)
    except OSError:
        return True  # nothing there yet, or what check_writable refuses
    if not stat.S_ISREG(found.st_mode):
        return False
    for printed in (1, 2):
        with suppress(OSError):
            if os.path.samestat(found, os.fstat(printed)):
                return False
    return True


def journal_path(target: str | Path) -> Path:
    """Where the journal of a log lies while its run goes on: beside the file that it becomes."""
    real = Path(os.path.realpath(target))
    return real.with_name(f"{real.name}.part")


def check_writable(path: str | Path) -> None:
    """Make sure a file can be written before the work that fills it is done.

    Raises:
        RunFileError: it cannot; the message says why.
        InputError: it is no path.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"a file needs a path, got {shown(path)}", name="path", value=path)
    target = Path(path)
    try:
        if target.is_dir():
            raise RunFileError(f"cannot write '{target}': it is a folder", path=target)
        if not replaceable(target):
            # Not opened: a reader at the other end of a pipe would take the closing for the end.
            if not os.access(target, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            return
        real = Path(os.path.realpath(target))
        if not real.parent.is_dir():
            raise RunFileError(
                f"cannot write '{target}': there is no folder '{real.parent}'", path=target
            )
        with tempfile.TemporaryFile(dir=real.parent):
            pass
        if real.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        if real.exists():
            with real.open("ab"):
                pass
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise RunFileError(f"cannot write '{target}': {_reason(error)}", path=target) from error


def check_outputs(
    outputs: Mapping[str, str | Path | None],
    *,
    inputs: Mapping[str, str | Path | None] | None = None,
) -> None:
    """Make sure that all files of a command can be written, and that no two of them are one, links
    included.

    Args:
        outputs: by what the user calls them, such as ``--save``; those that were not asked for are
            None.
        inputs: files that no output may take the place of.

    Raises:
        RunFileError: a file cannot be written.
        InputError: two names lead to the same file.
    """
    seen: dict[object, str] = {}
    for name, path in (*(inputs or {}).items(), *outputs.items()):
        if path is None:
            continue
        if name in outputs:
            check_writable(path)
        if not replaceable(path):
            continue
        found = os.stat(path) if os.path.exists(path) else None
        key = os.path.realpath(path) if found is None else (found.st_dev, found.st_ino)
        if name in outputs and key in seen:
            raise InputError(
                f"{seen[key]} and {name} are the same file '{path}'", name=name, value=path
            )
        seen[key] = name


@contextmanager
def replacing(path: str | Path) -> Iterator[IO[bytes]]:
    """A binary file that takes the place of ``path`` once the block ends without an exception.

    A symbolic link is followed, and the permissions of an older file are kept. Ctrl-C waits until
    the file is in place. A device or a pipe is written to as it is.

    Raises:
        RunFileError: the file cannot be written.
    """
    target = Path(path)
    check_writable(target)
    temporary: Path | None = None
    try:
        if not replaceable(target):
            with _open_as_it_is(target) as file:
                yield file
            return
        real = Path(os.path.realpath(target))
        mode = stat.S_IMODE(real.stat().st_mode) if real.exists() else None
        with Shield(saving=True):
            temporary = real.parent / f".harpy-{secrets.token_hex(8)}.part"
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
            with os.fdopen(
                os.open(temporary, flags, 0o666 if mode is None else mode), "w+b"
            ) as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if mode is not None:
                temporary.chmod(mode)
            temporary.replace(real)
            temporary = None
    except OSError as error:
        raise RunFileError(f"cannot write '{target}': {_reason(error)}", path=target) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _open_as_it_is(target: Path) -> IO[bytes]:
    """Open a device or a pipe; a pipe that nobody reads is an error instead of a wait."""
    try:
        handle = os.open(target, os.O_WRONLY | os.O_APPEND | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise OSError(errno.ENXIO, "nobody reads at the other end") from error
        raise
    os.set_blocking(handle, True)
    return os.fdopen(handle, "wb")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def finite(value: Any) -> Any:
    """The value, ready for JSON: NaN and infinity become null, numbers of NumPy Python's."""
    if isinstance(value, Mapping):
        return {str(key): finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if getattr(value, "shape", None) == ():
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(data: Mapping[str, Any]) -> str:
    """JSON that every reader accepts: a number that is not finite becomes null."""
    return json.dumps(finite(data), indent=2, default=str) + "\n"


def write_json(path: str | Path, data: Mapping[str, Any]) -> None:
    """Write :func:`json_text`.

    Raises:
        RunFileError: the file cannot be written.
    """
    with replacing(path) as file:
        file.write(json_text(data).encode())


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _list(files: Iterable[tuple[str, str]]) -> str:
    return "".join(f"{checksum}  {name}\n" for checksum, name in sorted(files))


class OwnFolder:
    """A folder for files of this library, in which nobody else's are touched.

    It is new or empty, or has the file :data:`LIST`, which lists what was written there with its
    checksum, so that ``sha256sum -c`` reads it. Only what is as it was written is replaced. Links
    in it are not followed.

    Args:
        path: made if it is not there.
        force: take a folder with other files, too, and replace those of the same names.

    Raises:
        InputError: it is not the name of a folder.
        RunFileError: it has other files, or cannot be written.
    """

    LIST = ".harpy_pin"

    def __init__(self, path: str | Path, *, force: bool = False) -> None:
        text = str(path)
        if text in ("", "-") or not text.isprintable():
            raise InputError(
                f"a folder needs a name of printable characters, got {shown(text)}", value=path
            )
        self.path, self.force = Path(path), force
        with self._explained():
            if os.path.lexists(path) and not self.path.is_dir():
                self._refuse("it is no folder")
            self.path.mkdir(parents=True, exist_ok=True)
            names = {
                entry.name
                for entry in self.path.iterdir()
                if not re.fullmatch(r"\.harpy-\w+\.part", entry.name)
            }
            if names and self.LIST not in names and not force:
                self._refuse(
                    "it has files that were not written here: give another folder, or --force"
                )
        self.write({})

    def place(self, name: str) -> Path:
        """Where a file is, which is not a link, nor in a folder that is one.

        Raises:
            RunFileError: something else has its name.
        """
        path = self.path / name
        with self._explained():
            for one, regular in ((path.parent, stat.S_ISDIR), (path, stat.S_ISREG)):
                if os.path.lexists(one) and one != self.path and not regular(one.lstat().st_mode):
                    self._refuse(f"'{one}' is a link, or of another kind")
        return path

    def write(self, files: Mapping[str, str | bytes]) -> None:
        """Write files, each whole or not at all; none where one of them cannot be.

        Args:
            files: contents by names, which may have one folder before them.

        Raises:
            RunFileError: a file of this name was not written here, was changed, or cannot be
                written.
        """
        contents = {
            name: data.encode() if isinstance(data, str) else data for name, data in files.items()
        }
        listed: set[tuple[str, str]] = set()
        with self._explained():
            if (listing := self.place(self.LIST)).exists():
                text = listing.read_text(encoding="utf-8", errors="replace")
                listed = set(re.findall(r"^([0-9a-f]{64})  (.+)$", text, re.M))
                if text != _list(listed) and not self.force:
                    self._refuse(f"'{listing}' was not written here: see --force")
            for name in contents:
                path = self.place(name)
                if (
                    path.exists()
                    and not self.force
                    and (_checksum(path.read_bytes()), name) not in listed
                ):
                    self._refuse(f"'{path}' has changed, or was not written here: see --force")
            made = {(_checksum(data), name) for name, data in contents.items()}
            before = {(checksum, name) for checksum, name in listed if name not in contents}
            order = [(self.LIST, _list(listed | made).encode()), *contents.items()]
            for name, data in (*order, (self.LIST, _list(before | made).encode())):
                self.place(name).parent.mkdir(exist_ok=True)
                with replacing(self.path / name) as file:
                    file.write(data)

    def _refuse(self, why: str) -> NoReturn:
        raise OSError(errno.EEXIST, why)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RunFileError(
                f"cannot write into '{self.path}': {_reason(error)}", path=self.path
            ) from error


class Shield:
    """Ctrl-C, and a SIGTERM that somebody handles, wait while results are being kept::

        with Shield() as shield:
            try:
                work()  # the first Ctrl-C ends it
            finally:
                shield.saving = True
            keep()  # the next one waits until the end of the block

    Does nothing outside the main thread, where no signal arrives.

    Args:
        saving: hold back the first one, too.

    Attributes:
        saving: whether signals wait; set by the first one that ends the work.
        late: the signal that waits; set it to None to forget it. An interruption that is on its way
            out of the block forgets it, too.
        waited: the signals that have waited so far, of all shields: for the exit code of a command.
    """

    waited: ClassVar[list[int]] = []

    def __init__(self, *, saving: bool = False) -> None:
        self.saving = saving
        self.late: int | None = None
        self._handlers: dict[int, Callable[[int, Any], Any]] = {}

    def __enter__(self) -> Shield:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(number)
                if callable(handler):
                    self._handlers[number] = handler
                    signal.signal(number, self._receive)
        return self

    def _receive(self, number: int, frame: Any) -> None:
        if self.saving:
            self.late = number
            self.waited.append(number)
            return
        try:
            self._handlers[number](number, frame)
        except BaseException:
            self.saving = True
            raise

    @contextmanager
    def whole(self) -> Iterator[None]:
        """A piece of the work that no signal cuts in two: one that comes meanwhile is received at
        its end.
        """
        before, self.saving = self.saving, True
        try:
            yield
        finally:
            self.saving = before
        if self.late is not None and not before:
            number, self.late = self.late, None
            self._receive(number, None)

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        if self.late is not None and not (kind is not None and issubclass(kind, KeyboardInterrupt)):
            signal.raise_signal(self.late)
