"""Driving: the walk goes on in the thread that drives, and its page in another.

The page gets a snapshot fifty times a second, and says what the driver wants. Every tick is logged.
"""

from __future__ import annotations

import ipaddress
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harpy_pin import checks
from harpy_pin.contrib.live.live_session import PERIOD, LiveSession, Tick
from harpy_pin.contrib.live.settings import LiveSettings
from harpy_pin.contrib.live.times import TickTimes
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.files import Shield, check_writable, replaceable
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.simulation.loop import RunLog, run_metadata
from harpy_pin.view.identity import CONTROLLERS

if TYPE_CHECKING:
    from harpy_pin.contrib.live.live_page import LivePage

SNAPSHOT_PERIOD = 0.02
"""Time between snapshots, s."""
NAP = 2e-3
"""Longest sleep, s: ticks that have come due meanwhile are made up for."""
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


def check_address(host: str, port: int) -> None:
    """Refuse where no page can be served.

    Raises:
        InputError: no port has that number, or the host is none.
        RunFileError: the port is taken, or may not be used.
    """
    checks.whole("port", port, high=65535)
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise InputError(
            f"host must be an address such as 127.0.0.1, got '{host}'", name="host", value=host
        ) from None
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    try:
        socket.create_server((host, port), family=family).close()
    except OSError as error:
        raise RunFileError(
            f"cannot serve the page on {host}, port {port}: {error.strerror or error}"
        ) from error


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
    times: dict[int, TickTimes] = field(
        default_factory=dict
    )  # of ticks, by the number of pages that were open

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
        save: file of the log; none is kept without it.
        address: host and port of the page; no page without one.
        on_page: called with the page's address when it can be opened. The robot stands there;
            controllers are compiled only then, which takes some seconds the first time.

    Attributes:
        session: what is driven.
        url: of the page; empty without one.
        viewers: how many pages are open.

    Raises:
        InputError: the robot does not walk, or not with these settings, or the address is none.
        RunFileError: the log cannot be written, or the page not be served.
    """

    def __init__(
        self,
        settings: LiveSettings | None = None,
        *,
        robot: Robot | None = None,
        save: str | Path | None = None,
        address: tuple[str, int] | None = None,
        on_page: Callable[[str], None] = lambda url: None,
    ) -> None:
        self.viewers, self.url, self._over = 0, "", False
        self._address, self._on_page = address, on_page
        self._page: LivePage | None = None
        self.driven = DriveSummary()
        if address is not None:
            check_address(*address)
        try:
            self.session = LiveSession(settings, robot=robot, on_standing=self._open_page)
            self._log = None if save is None else LiveLog(self.session, save)
        except BaseException:
            self.close()
            raise
        self._answer("")

    def _open_page(self, session: LiveSession) -> None:
        """Show the robot as it stands, and say that its controllers are being compiled."""
        self.session = session
        if self._address is None:
            return
        from harpy_pin.contrib.live.live_page import LivePage

        self._page = LivePage(*self._address, session)
        self.url = self._page.url
        self._page.show(session)
        self._answer("", busy="Compiling the controllers: some seconds, the first time")
        self._on_page(self.url)

    def run(self, duration: float | None = None) -> DriveSummary:
        """Drive until Ctrl-C, or for a time of the clock.

        Args:
            duration: s.

        Raises:
            RunFileError: the log cannot be written.
        """
        if duration is not None:
            duration = checks.number("duration", duration, low=0.0, strict=True)
        begin = time.monotonic()
        with Shield(saving=True) as shield:  # a signal waits for the end of a tick
            self._loop(begin, duration, shield)
            self.driven.signal = shield.late
            self._summarise(time.monotonic() - begin)
            self.close()
            if self._log is not None:
                self.driven.run = self._log.close(self.session.ending or "completed")
            shield.late = None
        return self.driven

    def stop(self) -> None:
        """Let :meth:`run` end; from any thread."""
        self._over = True

    def close(self) -> None:
        """End the page."""
        if self._page is not None:
            self._page.close()

    def _loop(self, begin: float, duration: float | None, shield: Shield) -> None:
        session, self.session.on_tick = self.session, self._after
        published = begin
        while True:
            now = time.monotonic()
            if (
                self._over
                or shield.late is not None
                or (duration is not None and now - begin >= duration)
            ):
                return
            self._listen()
            session.advance(time.monotonic())
            if now - published >= SNAPSHOT_PERIOD:
                published = now
                if self._page is not None:
                    self._page.show(session)
                if self._known != (session.settings, session.paused, session.ending):
                    self._answer("")
            wait = session.pacer.until_due(time.monotonic())
            if wait > 0.0 or session.paused or session.ending:
                time.sleep(NAP)

    def _after(self, tick: Tick) -> None:
        """Count a tick, and log it."""
        self.driven.times.setdefault(self.viewers, TickTimes()).add(tick.elapsed)
        if self._log is not None:
            self._log.append()

    def _listen(self) -> None:
        """Do what the page asks for; what cannot be done is said in the page."""
        if self._page is None:
            return
        self.viewers = self._page.viewers
        self.driven.most_viewers = max(self.driven.most_viewers, self.viewers)
        while not self._page.wishes.empty():
            kind, value = self._page.wishes.get()
            try:
                note, refused = WISHES[kind](self.session, value) or "", False
            except InputError as error:
                note, refused = str(error), True
            if kind != "pull" or refused:
                self._answer(note, refused=refused)

    def _answer(self, note: str, *, refused: bool = False, busy: str = "") -> None:
        """Say in the page how things stand."""
        session = self.session
        self._known = session.settings, session.paused, session.ending
        if self._page is not None:
            standing = {
                "settings": asdict(session.settings),
                "paused": session.paused,
                "ending": session.ending,
            }
            self._page.take({**standing, "note": note, "refused": refused, "busy": busy})

    def _summarise(self, elapsed: float) -> None:
        session, driven = self.session, self.driven
        driven.simulated, driven.elapsed = session.time, elapsed
        driven.falls, driven.slip = session.falls, float(session.slip[:, 0].sum())
        driven.factor = 1.0 - min(session.pacer.lost / elapsed, 1.0) if elapsed > 0.0 else 1.0


class LiveLog(RunLog):
    """What was driven, as a run on disk: its rows leave the memory every second, and are read back
    at the end.

    Walks follow each other in the log: a robot that begins anew jumps back to the origin, and time
    goes on. It holds :attr:`LiveSession.signals`, the same whatever controller drives.

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
        self._session = session
        super().__init__(session.simulator, path, self._metadata)

    def append(self) -> None:
        """Keep a tick."""
        self.recorder.append(self._session.signals)

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
