"""Processes of this machine, from Linux's /proc."""

from collections.abc import Iterator
from pathlib import Path

import pytest

needs_proc = pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="looks for processes in /proc"
)


def living(text: str, *, file: str = "cmdline") -> Iterator[str]:
    """Command lines of the processes that have a text in their command line, or in another file of
    theirs.
    """
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdecimal() and text.encode() in (folder / file).read_bytes().replace(
                b"\0", b" "
            ):
                yield (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
