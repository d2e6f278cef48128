"""Command lines of all three programs, drawn from a table of their options, and run up to where work begins."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
import typer
from hostile import choose
from typer.models import ArgumentInfo, OptionInfo

import harpy_pin as hp
from comparison import cli as comparison
from harpy_pin.cli import app as harpy
from reproduction.cli import app as reproduction

PROGRAMS = {"harpy": harpy, "comparison": comparison, "reproduction": reproduction}
VALUES: tuple[str, ...] = (
    *("nan", "inf", "-1", "0", "1", "2", "0.3", "1e300", "1e-300", "1e999", "9" * 400, "x", "", "=", "0x10", "1,5"),
    *("1:2", "1:0,1,0", "0:1:0.1", "nan:nan:nan", "1:2:3:4", "0.3 0 0", "0.3 0 0; 2s 0 0 0.1", "1e308s 0 0 0"),
    *("harpy", "go2", "iris", "condensed", "wbc", "governed", "paper", "filter", "none", "hand", "commanded", "mujoco"),
    *("stiff", "per_axis", "feedforward", "tracked", "middle", "polar", "double", "run.npz", "bad.npz", "bad.json"),
    *("bad.urdf", "dir", "dir/x.npz", "nodir/x", "/dev/null", "x.png", "x.gif", "x.html", "0:1", "1:0", "10x10", "0x0"),
    *("99999x99999", "1,2,nan", ".", "..", "/", "[bold]", "\udcff", "ü", "a" * 300, "--", "-", "x" * 5000, "tcp://x:1"),
)
WORK = (
    "harpy_pin.simulation.plant.Plant.run",
    "harpy_pin.gaits.planar.planar_walk.PlanarWalk.run",
    "harpy_pin.view.page.film.Film.__enter__",
    "harpy_pin.view.page.replay.serve",
    "harpy_pin.view.live.drive.listen",
    "harpy_pin.compiled.compiler.clear",
    "harpy_pin.cli.compile._told",
    "harpy_pin.export.export",
    "webbrowser.open",
    "reproduction.vlip_simulation.simulate_vlip",
    "reproduction.report.reproduce",
    "reproduction.gait.optimise_gait",
    "comparison.cli.whole.compare",
    "comparison.cli.peers.compare_peers",
    "comparison.cli.peers.install_peers",
    "comparison.cli.walks.run_campaign",
    "comparison.cli.tuning.search_settings",
    "comparison.cli.studies.walk_engines",
    "comparison.cli.studies._study",
    "comparison.cli.studies.measure_jitter",
)
Command = tuple[str, tuple[str, ...], list[tuple[str, bool]], int]
"""Program, command, its options (whether each is a switch), and how many arguments it has."""


class Accepted(BaseException):
    """The command has begun its work."""


def commands() -> Iterator[Command]:
    for program, module in PROGRAMS.items():
        app: typer.Typer = module.app
        known = [((entry.name or entry.callback.__name__,), entry.callback) for entry in app.registered_commands]
        if app.registered_callback is not None:
            known.append(((), app.registered_callback.callback))
        for name, function in known:
            options, arguments = [], 0
            for parameter, hint in get_type_hints(function, include_extras=True).items():
                kind, *more = get_args(hint) or (hint,)
                arguments += any(isinstance(entry, ArgumentInfo) for entry in more)
                for info in (entry for entry in more if isinstance(entry, OptionInfo)):
                    given = [text for text in info.param_decls or () if text.startswith("--")]
                    names = (given or [f"--{parameter.replace('_', '-')}"])[0].split("/")
                    options += [(text, kind is bool) for text in names]
            yield program, name, options, arguments


def draw(rng: np.random.Generator, command: Command) -> list[str]:
    """A command line."""
    program, name, options, arguments = command
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


def _work(*arguments: Any, **options: Any) -> None:
    raise Accepted


@contextlib.contextmanager
def nothing_works(folder: Path) -> Iterator[None]:
    """Within a folder that has a run and some damaged files, where no command gets beyond the begin of its work."""
    hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01), save=folder / "run.npz")
    (folder / "bad.npz").write_bytes(b"PK\x03\x04junk")
    (folder / "bad.json").write_text('{"timing": 1, "walk": [], "settings": {}, "machine": {}, "versions": {}}')
    (folder / "bad.urdf").write_text("<robot")
    (folder / "dir").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for place in WORK:
            patch.setattr(place, _work)
        yield


def run_line(line: list[str]) -> None:
    """Run a command line up to its work.

    Raises:
        AssertionError: its exit code is none that is documented, or its error is not one line.
    """
    code: Any = None
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", line)
        try:
            PROGRAMS[line[0]].main()
        except SystemExit as ending:
            code = ending.code or 0
        except Accepted:
            pass
    assert code in (None, 0, 1, 2), line
    said, told = (stream.buffer.getvalue().decode() for stream in (out, err))  # type: ignore[attr-defined]
    if code and "Usage" not in said + told:
        assert len(told.strip().splitlines()) == 1, (line, told)
