"""The command that measures other libraries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from comparison.benchmark import FRICTION, Settings
from comparison.cli.output import NumbersFile, print_tables, stages, writing
from comparison.peers.compare import compare_peers
from comparison.peers.environment import PEERS, PLAYGROUND, default_folder
from comparison.peers.environment import install as install_peer
from comparison.peers.growth_of_peers import ROBOTS
from comparison.peers.peer_tables import peer_tables


def peers(
    install: Annotated[
        bool,
        typer.Option(
            "--install",
            help="Download and install the peers in their virtual environments, then exit: with 1 if one of them "
            "cannot be installed.",
        ),
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder",
            metavar="DIR",
            help="Folder of these environments.  [default: in the user's cache]",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter walks, fewer repetitions, one robot.")] = False,
    json: NumbersFile = None,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the walks.")] = FRICTION,
) -> None:
    """Time other libraries' controllers.

    They get the same states as our whole-body controllers. placo and TSID need other versions of Pinocchio than this
    library: each runs in a virtual environment of its own, which --install makes once. Each is given our program and
    has to find our solution before its times count. A library that is not installed, fails, or finds another solution
    is reported without times.
    """
    folder = default_folder() if folder is None else folder
    if install:
        _install(folder)
        return
    settings = Settings.quick(friction=friction) if quick else Settings(friction=friction)
    with writing(json) as document, stages() as progress:
        document |= compare_peers(
            progress,
            friction=friction,
            duration=settings.duration,
            timing=settings.timing,
            folder=folder,
            growth=tuple(ROBOTS)[: 1 if quick else None],
        )
    print_tables(peer_tables(document["peers"]))


def _install(folder: Path) -> None:
    """Install every peer, and say of each how it ended."""
    failed = False
    for name in (*PEERS, PLAYGROUND.name):
        typer.echo(f"{name}: installing in {folder / name.lower()}", err=True)
        reason = install_peer(folder, name)
        typer.echo(f"{name}: {f'cannot be installed: {reason}' if reason else 'installed'}")
        failed |= bool(reason)
    if failed:
        raise typer.Exit(1)
