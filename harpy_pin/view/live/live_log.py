"""What was driven, as a run on disk: the same signals whatever controller drives."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, replaceable
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import Recorder
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import FORMAT
from harpy_pin.simulation.loop import keep_run, run_metadata
from harpy_pin.view.identity import CONTROLLERS
from harpy_pin.view.live.live_session import PERIOD, LiveSession

__all__ = ["LiveLog"]


class LiveLog:
    """Writes every tick; its rows leave the memory every second, and are read back from disk at the end.

    Walks follow each other in the log: a robot that begins anew jumps back to the origin, and time goes on. It holds
    :attr:`LiveSession.signals`: beside those of every log, what was set at each tick (``controller`` and ``schedule``
    as numbers, whose names are in the metadata ``live``), and ``push``, the force on the body from outside, N.

    Args:
        session: that is logged.
        path: of the log; it must be a file that can be replaced.

    Raises:
        RunFileError: it cannot be written.
    """

    def __init__(self, session: LiveSession, path: str | Path) -> None:
        check_writable(path)
        if not replaceable(path):
            raise RunFileError(f"cannot write '{path}': a drive is saved as a file", path=path)
        self.path = Path(path)
        self._session = session
        self._journal = Journal(path, {**self._metadata("unfinished"), "format": FORMAT})
        self._recorder = Recorder(self._journal)

    def append(self) -> None:
        """Keep a tick, right after it."""
        self._recorder.append(self._session.signals)

    def close(self, ending: str) -> Run:
        """Write the log in its place.

        Args:
            ending: of the run, see :attr:`harpy_pin.log.run.Run.ending`.

        Raises:
            RunFileError: it cannot be written; its rows are in the journal beside it, which the message names.
        """
        simulator = self._session.simulator
        run, unsaved = keep_run(simulator, self._recorder, self._metadata(ending), self._journal, self.path)
        if unsaved is not None:
            raise unsaved
        return run

    def _metadata(self, ending: str) -> dict[str, Any]:
        """How the drive came about and how it ended."""
        session = self._session
        return {
            **run_metadata(session.simulator, session.controller, ending, PERIOD, ()),
            "end_time": session.time,
            "controller": "driven live",
            "parameters": {"gait": dict(session.gait.describe())},
            "live": {
                "controllers": list(CONTROLLERS),
                "schedules": list(session.ranges.schedules),
                "settings": asdict(session.settings),
                "falls": session.falls,
            },
        }
