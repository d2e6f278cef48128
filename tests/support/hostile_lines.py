"""Command lines of all three programs, drawn from a table of their options, and run up to where
work begins.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import command_lines
import numpy as np
import pytest
from hostile import choose

import harpy_pin as hp

VALUES: tuple[str, ...] = (
    *(
        "nan",
        "inf",
        "-1",
        "0",
        "1",
        "2",
        "0.3",
        "1e300",
        "1e-300",
        "1e999",
        "9" * 400,
        "x",
        "",
        "=",
        "0x10",
        "1,5",
    ),
    *(
        "1:2",
        "1:0,1,0",
        "0:1:0.1",
        "nan:nan:nan",
        "1:2:3:4",
        "0.3 0 0",
        "0.3 0 0; 2s 0 0 0.1",
        "1e308s 0 0 0",
    ),
    *(
        "harpy",
        "go2",
        "iris",
        "condensed",
        "wbc",
        "governed",
        "paper",
        "filter",
        "none",
        "hand",
        "commanded",
        "mujoco",
    ),
    *(
        "stiff",
        "per_axis",
        "feedforward",
        "tracked",
        "middle",
        "polar",
        "double",
        "run.npz",
        "bad.npz",
        "bad.json",
    ),
    *(
        "bad.urdf",
        "dir",
        "dir/x.npz",
        "nodir/x",
        "/dev/null",
        "x.png",
        "x.gif",
        "x.html",
        "0:1",
        "1:0",
        "10x10",
        "0x0",
    ),
    *(
        "99999x99999",
        "1,2,nan",
        ".",
        "..",
        "/",
        "[bold]",
        "\udcff",
        "ü",
        "a" * 300,
        "--",
        "-",
        "x" * 5000,
        "tcp://x:1",
    ),
)


def draw(
    rng: np.random.Generator, command: tuple[str, tuple[str, ...], list[command_lines.Option], int]
) -> list[str]:
    """A command line."""
    program, name, declared, arguments = command
    options = [(text, option.kind is bool) for option in declared for text in option.names]
    line = [program, *name]
    for _ in range(int(rng.integers(0, 3)) if arguments else 0):
        line.append(choose(rng, VALUES))
    for _ in range(int(rng.integers(0, 4)) if options else 0):
        option, switch = choose(rng, options)
        value = choose(rng, VALUES)
        if switch and rng.integers(8):
            line.append(option)
        else:
            line += [f"{option}={value}"] if rng.integers(2) else [option, value]
    return line if rng.integers(15) else [*line, choose(rng, VALUES)]


def write_files(folder: Path) -> None:
    """Files of the names in :data:`VALUES`, good and bad."""
    hp.walk(
        hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01), save=folder / "run.npz"
    )
    (folder / "bad.npz").write_bytes(b"PK\x03\x04junk")
    (folder / "bad.json").write_text(
        '{"timing": 1, "walk": [], "settings": {}, "machine": {}, "versions": {}}'
    )
    (folder / "bad.urdf").write_text("<robot")
    (folder / "dir").mkdir()


@contextlib.contextmanager
def nothing_works(folder: Path) -> Iterator[None]:
    """Within a folder that has a run and some damaged files, where no command gets beyond the begin
    of its work.
    """
    write_files(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        command_lines.stop_before_work(patch)
        yield


def run_line(line: list[str]) -> None:
    """Run a command line up to its work.

    Raises:
        AssertionError: its exit code is none that is documented, or its error is not one line.
    """
    code, out, err = command_lines.run_line(line)
    assert code in (None, 0, 1, 2), line
    if code and "Usage" not in out + err:
        assert len(err.strip().splitlines()) == 1, (line, err)
