"""What was driven, as a run on disk: the same signals whatever controller drives."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, replaceable
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import Recorder
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import FORMAT
from harpy_pin.simulation.loop import keep_run, run_metadata
from harpy_pin.view.live.drive_settings import CONTROLLERS
from harpy_pin.view.live.live_session import PERIOD, LiveSession, Tick

__all__ = ["LiveLog"]


class LiveLog:
    """Writes every tick; its rows leave the memory every second, and are read back from disk at the end.

    Walks follow each other in the log: a robot that begins anew jumps back to the origin, and time goes on. Beside the
    signals of every log it holds, at each tick, what was set: ``command``, ``foot_friction`` (static, under each foot),
    ``ground_stiffness``, ``ground_slope``, ``assumed_friction``, ``controller`` and, where there are several,
    ``schedule`` (numbers; the metadata ``live`` have the names), and ``push``, the force on the body from outside, N.

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
        self._names = {name: float(number) for number, name in enumerate(CONTROLLERS)}

    def append(self, session: LiveSession, tick: Tick) -> None:
        """Keep a tick, right after it."""
        state, s = tick.state, session.settings
        target = session.controller.target
        reference = np.concatenate((session.body_reference, target.body[3:6]))
        applied = session.applied_reference
        self._recorder.append(
            {
                "t": (session.ticks - 1) * PERIOD,
                "q": state.q,
                "v": state.v,
                "foot_position": state.foot_position,
                "foot_velocity": state.foot_velocity,
                "foot_force": state.foot_force,
                "slip_path": session.slip,
                "slip_net": session.net_slip,
                "torque": tick.command.torque,
                "thrust": tick.command.thrust,
                "tick_ns": tick.elapsed,
                "x_r": reference,
                "x_w": applied,
                "stance": target.stance,
                "command": session.gait.command,
                "applied_velocity": session.applied,
                "heading": target.heading,
                "friction_estimate": session.friction_estimate,
                "foot_friction": session.simulator.ground.friction(state.foot_position[:, 0]),
                "ground_stiffness": session.simulator.ground.stiffness,
                "ground_slope": session.plane.slope,
                "assumed_friction": s.mu,
                "controller": self._names[s.controller],
                **self._schedule(),
                "push": tick.push,
            }
        )

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

    def _schedule(self) -> dict[str, float]:
        """Number of the schedule in which the robot walks, where there are several."""
        gait, schedules = self._session.gait, self._session.ranges.schedules
        return {"schedule": float(schedules.index(gait.schedule))} if isinstance(gait, WalkingGait) else {}

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
