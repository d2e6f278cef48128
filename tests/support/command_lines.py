"""The three programs, their commands and options as they are declared, and what begins the work of
a command.
"""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator
from types import UnionType
from typing import Any, NamedTuple, get_args, get_type_hints

import pytest
import typer
from typer.models import ArgumentInfo, OptionInfo

from comparison import cli as comparison
from harpy_pin.cli import app as harpy
from reproduction import cli as reproduction

PROGRAMS = {"harpy": harpy, "comparison": comparison, "reproduction": reproduction}
WORK = (
    "harpy_pin.simulation.plant.Plant.run",
    "harpy_pin.simulation.simulator.Simulator.run",
    "reproduction.gait.planar_walk.PlanarWalk.run",
    "harpy_pin.view.page.film.Film.__enter__",
    "harpy_pin.view.page.replay.show",
    "harpy_pin.contrib.live.live_session.LiveSession.__init__",
    "harpy_pin.contrib.identify.motion.find_posture",
    "harpy_pin.contrib.identify.identification.identify",
    "harpy_pin.kernels.library_files.clear",
    "harpy_pin.cli.compile._scenarios",
    "harpy_pin.export.export",
    "webbrowser.open",
    "reproduction.vlip_simulation.simulate_vlip",
    "reproduction.report.reproduce",
    "reproduction.gait.optimise.optimise_gait",
    "comparison.cli.commands.compare",
    "comparison.cli.commands.compare_peers",
    "comparison.cli.commands._install",
    "comparison.cli.commands.run_campaign",
    "comparison.cli.commands.search_settings",
    "comparison.study.Study.run",
)
"""Functions with which a command begins its work, once its arguments have been accepted."""


class Accepted(BaseException):
    """The command has begun its work."""


class Option(NamedTuple):
    """An option of a command: its names (two of a switch), and its type."""

    names: tuple[str, ...]
    kind: type | UnionType


def commands() -> Iterator[tuple[str, tuple[str, ...], list[Option], int]]:
    """Program, command, its options, and how many arguments it has."""
    for program, module in PROGRAMS.items():
        app: typer.Typer = module.app
        known = [
            ((entry.name or entry.callback.__name__,), entry.callback)
            for entry in app.registered_commands
        ]
        if app.registered_callback is not None:
            known.append(((), app.registered_callback.callback))
        for command, function in known:
            options, arguments = [], 0
            for parameter, hint in get_type_hints(function, include_extras=True).items():
                kind, *more = get_args(hint) or (hint,)
                arguments += any(isinstance(entry, ArgumentInfo) for entry in more)
                for info in (entry for entry in more if isinstance(entry, OptionInfo)):
                    given = [text for text in info.param_decls or () if text.startswith("--")]
                    names = (given or [f"--{parameter.replace('_', '-')}"])[0].split("/")
                    options.append(Option(tuple(names), kind))
            yield program, command, options, arguments


def stop_before_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on a command ends with :class:`Accepted` where it would begin its work."""

    def work(*arguments: Any, **options: Any) -> None:
        raise Accepted

    for place in WORK:
        monkeypatch.setattr(place, work)


def run_line(line: list[str]) -> tuple[int | str | None, str, str]:
    """Run a command line: exit code, None where its work was reached, and both outputs."""
    code: int | str | None = None
    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)
    )
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", line)
        try:
            PROGRAMS[line[0]].main()
        except SystemExit as ending:
            code = ending.code or 0
        except Accepted:
            pass
    buffers = (stream.buffer for stream in (out, err))
    said, told = (buffer.getvalue().decode() for buffer in buffers)  # type: ignore[attr-defined]
    return code, said, told
