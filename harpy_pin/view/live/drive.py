"""Driving: the walk goes on in this process, and its page in another, so that looking never slows control.

The two share a board of snapshots, written fifty times a second, and a pipe for what the driver wants. Every tick is
logged.
"""

from __future__ import annotations

import ipaddress
import multiprocessing
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError, RunFileError
from harpy_pin.files import Shield, check_writable, replaceable, without_interrupts
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import Recorder
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import FORMAT
from harpy_pin.model.robot import Robot
from harpy_pin.simulation.loop import keep_run, run_metadata
from harpy_pin.view.identity import CONTROLLERS
from harpy_pin.view.live.live_session import PERIOD, LiveSession, Tick
from harpy_pin.view.live.settings import LiveSettings
from harpy_pin.view.live.shared_snapshots import SharedSnapshots
from harpy_pin.view.live.times import TickTimes

SNAPSHOT_PERIOD = 0.02  # time between snapshots, s
NAP = 2e-3  # longest sleep, s: ticks that have come due meanwhile are made up for
PAGE_ENDED = "the process of the page ended; what was driven until then is kept"
READY_WITHIN = 120.0  # time that the page's process may take to start, s
WISHES: Mapping[str, Callable[[LiveSession, Any], str | None]] = {
    "change": LiveSession.change,
    "strip": LiveSession.lay_strip,
    "pull": LiveSession.pull,
    "push": LiveSession.push,
    "pause": LiveSession.pause,
    "step": LiveSession.step,
    "reset": lambda session, nothing: session.reset(),
}
"""What a driver may want of a session, which returns what the driver should know of it."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens on an address.

    An :class:`InputError` for a port or a host that is none, a :class:`RunFileError` for a port that is taken or not
    free to use.
    """
    checks.whole("port", port, high=65535)
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise InputError(f"host must be an address such as 127.0.0.1, got '{host}'", name="host", value=host) from None
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    try:
        return socket.create_server((str(address), port), family=family)
    except OSError as error:
        raise RunFileError(f"cannot serve the page on {host}, port {port}: {error.strerror or error}") from error


@dataclass
class DriveSummary:
    """How a drive went."""

    run: Run | None = None  # the log; None where none was saved
    simulated: float = 0.0  # time of all walks, s
    elapsed: float = 0.0  # time of the clock, s
    falls: int = 0  # how many
    slip: float = 0.0  # path of all feet on the ground, m
    factor: float = 1.0  # simulated time per time that it should have taken
    most_viewers: int = 0  # pages that were open at once
    signal: int | None = None  # that ended it (Ctrl-C or SIGTERM); None where it ended by itself
    times: dict[int, TickTimes] = field(default_factory=dict)  # of ticks, by the number of pages that were open

    def as_dict(self) -> dict[str, Any]:
        """Its numbers."""
        return {
            "simulated_s": self.simulated,
            "elapsed_s": self.elapsed,
            "real_time_factor": self.factor,
            "falls": self.falls,
            "slip_m": self.slip,
            "most_viewers": self.most_viewers,
            "tick_us": {
                str(viewers): {
                    "ticks": times.count,
                    "p50": times.percentile(50.0),
                    "p99": times.percentile(99.0),
                    "p99.9": times.percentile(99.9),
                    "longest": times.longest * 1e-3,
                }
                for viewers, times in sorted(self.times.items())
            },
        }


class Drive:
    """A session with its page.

    Args:
        settings: to begin with, see :class:`LiveSession`.
        robot: who walks, see :class:`LiveSession`.
        save: file of the log of :attr:`LiveSession.signals`; none is kept without it. Walks follow each other in it: a
            robot that begins anew jumps back to the origin, and time goes on.
        listener: the page's socket; no page without one.
        on_page: called with the page's address when it can be opened. The robot stands there; controllers are compiled
            only then, which takes some seconds the first time.

    Raises:
        HarpyError: the page cannot be started.
        InputError: the robot does not walk, or not with these settings.
        RunFileError: the log cannot be written.
    """

    def __init__(
        self,
        settings: LiveSettings | None = None,
        *,
        robot: Robot | None = None,
        save: str | Path | None = None,
        listener: socket.socket | None = None,
        on_page: Callable[[str], None] = lambda url: None,
    ) -> None:
        self.viewers, self.url, self._over = 0, "", False  # pages that are open; address of the page, empty without one
        self._listener, self._on_page = listener, on_page
        self._pipe: Connection | None = None
        self._page: Any = None
        self._save, self._journal = save, None
        self._recorder: Recorder | None = None
        self.driven = DriveSummary()
        try:
            self.session = LiveSession(settings, robot=robot, on_standing=self._open_page)
            if save is not None:
                check_writable(save)
                if not replaceable(save):
                    raise RunFileError(f"cannot write '{save}': a drive is saved as a file", path=save)
                self._journal = Journal(save, {**self._metadata("unfinished"), "format": FORMAT})
                self._recorder = Recorder(self._journal)
            self.session.on_tick = self._after
        except BaseException:
            self.close()
            raise
        self._answer("")

    def _open_page(self, session: LiveSession) -> None:
        """Show the robot as it stands, and say that its controllers are being compiled."""
        self.session = session
        context = multiprocessing.get_context("spawn")
        self._board = SharedSnapshots(context, session)
        if self._listener is None:
            return
        from harpy_pin.view.live.live_page import serve

        self._pipe, other = context.Pipe()
        arguments = (other, self._listener, self._board, session.robot, asdict(session.settings))
        self._page = context.Process(target=serve, args=arguments, daemon=True)
        with without_interrupts():
            self._page.start()
        other.close()
        self._listener.close()
        try:
            kind, text = self._pipe.recv() if self._pipe.poll(READY_WITHIN) else ("failed", "it did not start")
        except EOFError:
            kind, text = "failed", "its process ended"
        if kind != "ready":
            raise HarpyError(f"cannot serve the page: {text}")
        self.url = text
        self._board.write(session)
        self._answer("", busy="Compiling the controllers: some seconds, the first time")
        self._on_page(self.url)

    def run(self, duration: float | None = None) -> DriveSummary:
        """Drive until Ctrl-C, or for a duration by the clock, s.

        Raises:
            HarpyError: the page's process ended; the log is kept.
            RunFileError: the log cannot be written.
        """
        if duration is not None:
            duration = checks.number("duration", duration, low=0.0, strict=True)
        trouble, unsaved, begin = None, None, time.monotonic()
        with Shield(saving=True) as shield:  # a signal waits for the end of a tick
            try:
                self._loop(begin, duration, shield)
            except HarpyError as error:
                trouble = error
            self.driven.signal = shield.late
            self._summarise(time.monotonic() - begin)
            self.close()
            if self._recorder is not None:
                metadata = self._metadata(self.session.ending or "completed")
                plant, recorder = self.session.simulator, self._recorder
                self.driven.run, unsaved = keep_run(plant, recorder, metadata, self._journal, self._save)
            shield.late = None
        if unsaved is not None:
            raise unsaved
        if trouble is not None and self.driven.signal is None:  # a signal to all processes ends the page's first
            raise trouble
        return self.driven

    def stop(self) -> None:
        """Let :meth:`run` end; from any thread."""
        self._over = True

    def close(self) -> None:
        """End the page."""
        if self._pipe is not None:
            self._pipe.close()
        if self._page is not None:
            self._page.join(3.0)
            if self._page.is_alive():
                self._page.kill()
                self._page.join()

    def _loop(self, begin: float, duration: float | None, shield: Shield) -> None:
        session = self.session
        published = checked = begin
        while True:
            now = time.monotonic()
            if self._over or shield.late is not None or (duration is not None and now - begin >= duration):
                return
            self._listen()
            session.advance(time.monotonic())
            if now - published >= SNAPSHOT_PERIOD:
                published = now
                self._board.write(session)
                if self._known != (session.settings, session.paused, session.ending):
                    self._answer("")
            if now - checked >= 1.0:
                checked = now
                if self._page is not None and not self._page.is_alive():
                    raise HarpyError(PAGE_ENDED)
            wait = session.pacer.until_due(time.monotonic())
            if wait > 0.0 or session.paused or session.ending:
                time.sleep(NAP)

    def _after(self, tick: Tick) -> None:
        """Count a tick, and log it."""
        self.driven.times.setdefault(self.viewers, TickTimes()).add(tick.elapsed)
        if self._recorder is not None:
            self._recorder.append(self.session.signals)

    def _listen(self) -> None:
        """Do what the page asks for; what cannot be done is said in the page."""
        try:
            while self._pipe is not None and self._pipe.poll():
                kind, value = self._pipe.recv()
                if kind == "viewers":
                    self.viewers = value
                    self.driven.most_viewers = max(self.driven.most_viewers, value)
                    continue
                try:
                    note, refused = WISHES[kind](self.session, value) or "", False
                except InputError as error:
                    note, refused = str(error), True
                if kind != "pull" or refused:
                    self._answer(note, refused=refused)
        except (EOFError, OSError):
            raise HarpyError(PAGE_ENDED) from None

    def _answer(self, note: str, *, refused: bool = False, busy: str = "") -> None:
        """Say in the page how things stand."""
        session = self.session
        self._known = session.settings, session.paused, session.ending
        if self._pipe is None:
            return
        standing = {"settings": asdict(session.settings), "paused": session.paused, "ending": session.ending}
        try:
            self._pipe.send({**standing, "note": note, "refused": refused, "busy": busy})
        except OSError:
            raise HarpyError(PAGE_ENDED) from None

    def _summarise(self, elapsed: float) -> None:
        session, driven = self.session, self.driven
        driven.simulated, driven.elapsed = session.time, elapsed
        driven.falls, driven.slip = session.falls, float(session.slip[:, 0].sum())
        driven.factor = 1.0 - min(session.pacer.lost / elapsed, 1.0) if elapsed > 0.0 else 1.0

    def _metadata(self, ending: str) -> dict[str, Any]:
        """How the drive came about and how it ended."""
        session = self.session
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
