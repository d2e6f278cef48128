"""Which repositories are read, and which of them a folder lacks. Nothing of theirs is part of this one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from zipfile import BadZipFile

from scipy.io.matlab import MatReadError

from harpy_pin.errors import InputError

SOURCES = {"mpc": "qpsolvers/mpc_qpbenchmark", "maros": "qpsolvers/maros_meszaros_qpbenchmark"}
"""Names on GitHub, whose folder ``data`` is read. Their licence is Apache-2.0."""


def how_to_get(names: Sequence[str], folder: Path) -> list[str]:
    """The commands that bring these repositories."""
    clones = {SOURCES[name]: folder / Path(SOURCES[name]).name for name in names}
    return [f"git clone https://github.com/{repository} '{clone}'" for repository, clone in clones.items()]


def find_sources(folder: Path) -> tuple[dict[str, Path], tuple[str, ...]]:
    """The folder that is read of each repository, and which repositories are missing.

    Raises:
        InputError: all are; the message has the commands that bring them.
    """
    paths = {name: folder / Path(repository).name / "data" for name, repository in SOURCES.items()}
    found = {name: path for name, path in paths.items() if path.is_dir()}
    missing = tuple(name for name in SOURCES if name not in found)
    if not found:
        commands = " && ".join(how_to_get(missing, folder))
        message = (
            f"'{folder}' has a clone of none of {', '.join(SOURCES.values())}; to get them from GitHub: {commands}"
        )
        raise InputError(message, name="data", value=folder)
    return found, missing


@contextmanager
def reading(path: Path, kind: str) -> Iterator[None]:
    """Whatever goes wrong while a file is read becomes one error that names it.

    Raises:
        InputError: the file is absent, or holds something else.
    """
    try:
        yield
    except InputError:
        raise
    except (OSError, EOFError, RuntimeError, ValueError, TypeError, LookupError, BadZipFile, MatReadError) as error:
        raise InputError(f"'{path}' is no {kind}: {error}", name="data", value=path) from error
