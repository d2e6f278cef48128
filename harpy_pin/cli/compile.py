"""The commands ``harpy compile``, by which no first tick waits for a compiler, and ``harpy
export``, portable C.
"""

from __future__ import annotations

import logging
import os
import shlex
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from shlex import quote
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from harpy_pin.cli import walk_options as options
from harpy_pin.cli.output import Force, console, say_next
from harpy_pin.errors import InputError

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from harpy_pin.scenario import Scenario

HARPY = "harpy"
DURATION = 0.6
"""Duration of each walk, s: longer ones have a loop of their own, of many ticks in one call."""


def compile_ahead(
    robots: Annotated[
        list[str] | None, typer.Argument(metavar="[ROBOT]...", help=options.ROBOTS)
    ] = None,
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    posture: options.PostureOption = None,
    clear: Annotated[
        bool,
        typer.Option(
            "--clear",
            help="Remove compiled libraries; only robots that are named are compiled again.",
        ),
    ] = False,
) -> None:
    """Compile what these robots need to walk, stand or hover.

    For Harpy also the governors. Libraries are kept in the user's cache, or in $HARPY_PIN_CACHE;
    without this command each is compiled when it is first needed.

    \b
    harpy compile
    harpy compile solo12 g1
    harpy compile --clear
    """
    logging.getLogger("harpy_pin.compiling").setLevel(logging.ERROR)  # this command says it better
    from harpy_pin.kernels import compiler, library_files
    from harpy_pin.kernels.kernels import wait_for_all
    from harpy_pin.scenario import walk

    walkers = [
        options.read_robot_options(name, feet, posture, flat_feet, loops)
        for name in dict.fromkeys(robots or [HARPY])
    ]
    if clear:
        console.print(
            f"removed {_count(library_files.clear())} from {library_files.folder()}", soft_wrap=True
        )
        if not robots:
            return
    compiler.command()
    begin, refused = perf_counter(), list[InputError]()
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        work = {threads.submit(walk, scenario): name for name, scenario in _scenarios(walkers)}
        try:
            for future in as_completed(work):
                try:
                    future.result()
                except InputError as error:  # this controller cannot have this robot
                    refused.append(error)
                    console.print(f"{work[future]}: {error}", soft_wrap=True)
                    continue
                seconds, made = perf_counter() - begin, _count(len(library_files.MADE))
                console.print(f"{work[future]}: done after {seconds:.1f} s, {made}")
            if len(refused) == len(work):
                raise refused[-1]
            wait_for_all()
        except BaseException:
            with compiler.ending():
                threads.shutdown(cancel_futures=True)
            raise
    folder = library_files.MADE[-1].parent if library_files.MADE else library_files.folder()
    console.print(
        f"{_count(len(library_files.MADE))} compiled in {perf_counter() - begin:.1f} s; they are "
        f"in {folder}",
        soft_wrap=True,
    )
    given = {"feet": feet, "flat-feet": flat_feet, "loops": loops, "posture": posture}
    said = (f"--{name}={quote(text)}" for name, text in given.items() if text is not None)
    say_next(" ".join(["harpy walk --robot", quote((robots or [HARPY])[0]), *said]))


def _count(libraries: int) -> str:
    return "1 library" if libraries == 1 else f"{libraries} libraries"


def _scenarios(robots: Sequence[str | Robot]) -> Iterator[tuple[str, Scenario]]:
    """Name and scenario of each walk of some ticks that compiles what these robots need, the
    longest first.
    """
    from harpy_pin.controllers.named_controllers import GOVERNORS
    from harpy_pin.scenario import Condensed, Governed, Scenario, WholeBody, gaits_of

    for robot in robots:
        for gait in gaits_of(robot):
            for controller, title in (
                (Condensed(), "condensed controller"),
                (WholeBody(), "whole-body QP, ProxQP"),
                (WholeBody(parameters={"solver": "active_set"}), "whole-body QP, own search"),
            ):
                scenario = Scenario(
                    robot=robot, gait=gait, controller=controller, duration=DURATION
                )
                yield f"{scenario.robot_name}, {title}, gait '{gait}'", scenario
        if robot == HARPY:
            for governor in GOVERNORS:
                scenario = Scenario(controller=Governed(governor=governor), duration=DURATION)
                yield f"harpy, governor '{governor}'", scenario


def export(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help=options.ROBOTS)],
    to: Annotated[
        str,
        typer.Option("--to", metavar="DIR", help="Output folder: new, empty, or an exported one."),
    ],
    controller: Annotated[
        str, typer.Option(metavar="NAME", help="condensed, walk, wbc, paper, filter or estimator.")
    ] = "condensed",
    precision: Annotated[str, typer.Option("--precision", help="float or double.")] = "float",
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    posture: options.PostureOption = None,
    force: Force = False,
) -> None:
    """Write a controller as C99 for a microcontroller.

    With recorded ticks to check it with. walk is the condensed controller with a walking gait,
    which takes a velocity; paper (its governor) and filter (the contact-force filter) are for
    Harpy; estimator is the state from IMU and encoders. The code allocates no memory and needs only
    the C mathematical library. Where gcc-arm-none-eabi and qemu-system-arm are installed, the
    README in the folder gives the cost of a tick.
    """
    from harpy_pin.export import export as write

    walker = options.read_robot_options(robot, feet, posture, flat_feet, loops)
    done = write(walker, to, controller=controller, precision=precision, force=force)
    name, folder = done.code.name, done.folder
    console.print(
        f"{folder}/{name}.h, {name}.c, {name}.hpp: {done.what.title}, in {precision}",
        soft_wrap=True,
    )
    console.print(
        f"{done.code.ram} bytes of RAM; {done.ticks} recorded ticks; README.md says more",
        soft_wrap=True,
    )
    source, build, check = (
        shlex.quote(os.path.join(".", folder, own)) for own in ("", "b", "b/check")
    )
    print(f"cmake -S {source} -B {build} && cmake --build {build} && {check}")
