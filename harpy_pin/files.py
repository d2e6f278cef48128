"""Writing files so that nothing is lost: found unwritable before the work, replaced only when whole."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from harpy_pin.errors import RunFileError

__all__ = ["check_writable", "replacing", "write_json"]


def check_writable(path: str | Path) -> None:
    """Make sure a file can be written before the work that fills it is done.

    Raises:
        RunFileError: it cannot; the message says why.
    """
    target = Path(path)
    folder = target.parent
    try:
        if target.is_dir():
            raise RunFileError(f"cannot write '{target}': it is a folder", path=target)
        if not folder.is_dir():
            raise RunFileError(f"cannot write '{target}': there is no folder '{folder}'", path=target)
        with tempfile.TemporaryFile(dir=folder):
            pass
        if target.exists():
            with target.open("ab"):
                pass
    except OSError as error:
        raise RunFileError(f"cannot write '{target}': {error.strerror or error}", path=target) from error


@contextmanager
def replacing(path: str | Path) -> Iterator[IO[bytes]]:
    """A binary file that takes the place of ``path`` once the block ends without an exception.

    Raises:
        RunFileError: the file cannot be written.
    """
    target = Path(path)
    check_writable(target)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".harpy-", suffix=".part")
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            yield file
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    except OSError as error:
        raise RunFileError(f"cannot write '{target}': {error.strerror or error}", path=target) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def write_json(path: str | Path, data: Mapping[str, Any]) -> None:
    """Write JSON that every reader accepts: a number that is not finite becomes null.

    Raises:
        RunFileError: the file cannot be written.
    """

    def clean(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {str(key): clean(entry) for key, entry in value.items()}
        if isinstance(value, list | tuple):
            return [clean(entry) for entry in value]
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return value

    with replacing(path) as file:
        file.write((json.dumps(clean(data), indent=2, default=str) + "\n").encode())
