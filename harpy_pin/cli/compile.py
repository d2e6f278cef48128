"""The command ``harpy compile``: kernels of robots compiled ahead, so that no first tick waits for them."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from time import perf_counter
from typing import Annotated

import typer

from harpy_pin.cli.output import console, stderr
from harpy_pin.errors import HarpyError

__all__ = ["compile_ahead"]

HARPY = "harpy"
DURATION = 0.6
"""Of each walk, s: longer ones have a loop of their own, of many ticks in one call."""
Part = tuple[str, Callable[[], None]]
"""A name, and what compiles it."""


def compile_ahead(
    robots: Annotated[
        list[str] | None, typer.Argument(metavar="[ROBOT]...", help="harpy (default), or names from harpy robots.")
    ] = None,
    clear: Annotated[
        bool,
        typer.Option("--clear", help="Remove the compiled libraries; only robots that are named are compiled again."),
    ] = False,
) -> None:
    """Compile what these robots need to walk, stand or hover.

    For Harpy that is the condensed controller, the whole-body QP, the governors, the commanded gait and the simulator;
    for other robots both whole-body controllers with standing, stepping in place or hovering. Libraries are kept in
    the user's cache, or in $HARPY_PIN_CACHE; without this command each is compiled when it is first needed.

    \b
    harpy compile
    harpy compile solo12 g1
    harpy compile --clear
    """
    logging.getLogger("harpy_pin.compiling").setLevel(logging.ERROR)  # this command says it better
    from harpy_pin.compiled import BACKEND, compiler
    from harpy_pin.compiled.kernels import wait_for_all
    from harpy_pin.model.catalogue import check_robot_name

    for name in robots or ():
        check_robot_name(name)
    if clear:
        console.print(f"removed {_count(compiler.clear())} from {compiler.folder()}", highlight=False, soft_wrap=True)
        if not robots:
            return
    if BACKEND != "c":
        raise HarpyError("there is nothing to compile ahead without a C compiler: install gcc, clang or the extra 'cc'")
    begin = perf_counter()
    with _told(parts := _parts(robots or [HARPY])) as done, ThreadPoolExecutor(os.cpu_count()) as threads:
        work = {threads.submit(make): name for name, make in parts}
        try:
            for future in as_completed(work):
                future.result()
                done(work[future], len(compiler.MADE), perf_counter() - begin)
            wait_for_all()
        except BaseException:
            with compiler.ending():
                threads.shutdown(cancel_futures=True)
            raise
    folder = compiler.MADE[-1].parent if compiler.MADE else compiler.folder()
    message = f"{_count(len(compiler.MADE))} compiled in {perf_counter() - begin:.1f} s; they are in {folder}"
    console.print(message, highlight=False, soft_wrap=True)


def _count(libraries: int) -> str:
    return "1 library" if libraries == 1 else f"{libraries} libraries"


@contextmanager
def _told(parts: Sequence[Part]) -> Iterator[Callable[[str, int, float], None]]:
    """Report the parts that are done: on a terminal by a progress bar, otherwise by a line for each."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task("compiling", total=len(parts))

        def done(name: str, libraries: int, seconds: float) -> None:
            bar.update(task, advance=1, description=f"compiling; done: {name}")
            if not stderr.is_terminal:
                console.print(f"{name}: done after {seconds:.1f} s, {_count(libraries)}", highlight=False)

        yield done


def _parts(robots: Sequence[str]) -> list[Part]:
    """What there is to compile for these robots, the longest first."""
    from harpy_pin.controllers.named_controllers import GOVERNORS

    parts: list[Part] = []
    for name in dict.fromkeys(robots):
        if name == HARPY:
            parts += [
                ("harpy, condensed controller", partial(_walk, "condensed")),
                ("harpy, whole-body QP", partial(_walk, "wbc")),
                ("harpy, commanded gait", partial(_walk, "condensed", "commanded")),
                *(
                    (f"harpy, governor '{governor}'", partial(_walk, {"name": "governed", "governor": governor}))
                    for governor in GOVERNORS
                ),
            ]
        else:
            parts += [
                (f"{name}, condensed controller", partial(_stay, name, "condensed")),
                (f"{name}, whole-body QP", partial(_stay, name, "wbc")),
            ]
    return parts


def _walk(controller: str | dict[str, str], gait: str = "hand") -> None:
    """Some ticks of a walk of Harpy."""
    from harpy_pin.scenario import Scenario, walk

    walk(Scenario(controller=controller, gait=gait, duration=DURATION))


def _stay(name: str, controller: str) -> None:
    """Some ticks of a robot of the catalogue where it stays: standing, stepping in place or hovering."""
    from harpy_pin.scenario import Scenario, gaits_of, walk

    gait = next(kind for kind in gaits_of(name) if kind != "walking")
    walk(Scenario(robot=name, gait=gait, controller=controller, duration=DURATION))
