"""The peers alone, from settings to a document of their own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from comparison.machine import describe_all_versions, describe_machine
from comparison.peers.environment import PEERS
from comparison.peers.measure import RECORDED, PeerSettings, measure_peers
from comparison.states import record_states, walk
from comparison.statistics import finite
from harpy_pin.model.robot import load_harpy

if TYPE_CHECKING:
    from comparison.benchmark import Progress, Settings

__all__ = ["compare_peers"]


def compare_peers(settings: Settings, progress: Progress, *, folder: Path) -> dict[str, Any]:
    """Walk at the low friction, then measure everyone on the states.

    Args:
        settings: of the comparison.
        progress: called between pieces of work.
        folder: of the peers' environments.

    Returns:
        ``peers``, ``machine`` and ``versions``, ready for JSON.
    """
    machine, robot, friction = describe_machine(), load_harpy(), settings.low_friction
    sequences = []
    for i, name in enumerate(RECORDED):
        progress("walking", i, len(RECORDED))
        run = walk(robot, name, friction=friction, duration=settings.duration)
        sequences.append(record_states(name, run, least=settings.timing.warm_up + 50))
    progress("walking", len(RECORDED), len(RECORDED))
    done, total = 0, len(PEERS) + 3
    progress("peers", done, total)

    def step() -> None:
        nonlocal done
        done += 1
        progress("peers", done, total)

    peers = measure_peers(
        robot,
        sequences,
        friction=friction,
        settings=PeerSettings.of(settings.timing),
        folder=folder,
        on_step=step,
    )
    document: dict[str, Any] = finite({"peers": peers, "machine": machine, "versions": describe_all_versions()})
    return document
