"""The process of the live page: it shows snapshots, and says what the driver wants."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.live.camera import FIELD_OF_VIEW, first_view, keep_in_view
from harpy_pin.view.live.guard import guarded_server
from harpy_pin.view.live.live_scene import LiveScene
from harpy_pin.view.live.panel import Panel
from harpy_pin.view.live.settings import DriveRanges
from harpy_pin.view.live.shared_snapshots import SharedSnapshots

__all__ = ["serve"]

FRAME, NUMBERS, CHARTS = 0.025, 0.25, 0.2
"""Time between frames of the scene, and between updates of numbers and charts, s."""


def serve(
    pipe: Connection, listener: socket.socket, board: SharedSnapshots, robot: Robot, settings: Mapping[str, Any]
) -> None:
    """What the process does until the pipe is closed.

    Args:
        pipe: to the session's process.
        listener: the page's socket.
        board: of snapshots.
        robot: who is driven.
        settings: as the session begins.
    """
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - viser says there when it stops
    try:
        page = _Page(pipe, listener, board, robot, settings)
    except (HarpyError, OSError, ImportError) as error:
        with contextlib.suppress(OSError):
            pipe.send(("failed", str(error)))
        return
    host, port = listener.getsockname()[:2]
    with contextlib.suppress(OSError, EOFError):
        pipe.send(("ready", f"http://{host if ':' not in host else f'[{host}]'}:{port}/"))
        page.run()
    page.server.stop()


class _Page:
    """Server, scene and panel."""

    def __init__(
        self,
        pipe: Connection,
        listener: socket.socket,
        board: SharedSnapshots,
        robot: Robot,
        settings: Mapping[str, Any],
    ) -> None:
        self._pipe, self._board = pipe, board
        self._sending = threading.Lock()
        self.server = guarded_server(listener, label="harpy live", on_refused=lambda reason: self._panel.refuse(reason))
        ranges = DriveRanges.of(robot)
        self._spring = ranges.spring
        self._scene = LiveScene(self.server, robot)
        self._panel = Panel(self.server.gui, robot, ranges, settings, self._send)
        self._lay_ground(settings)
        self._viewers = 0
        self._grip: Vector | None = None  # where the hand has the robot, relative to the body
        self._hand = np.zeros(3)
        camera = self.server.initial_camera
        camera.position, camera.look_at = first_view(self._scene.scale)
        camera.fov = float(np.radians(FIELD_OF_VIEW))
        self.server.on_client_connect(
            lambda client: keep_in_view(client, self._scene.scale, lambda: self._panel.follows)
        )
        for handle in self._scene.handles:
            handle.on_drag("left")(self._on_drag)

    def run(self) -> None:
        """Show snapshots until the pipe is closed."""
        seen, last = 0, None
        numbers = charts = 0.0
        while True:
            begin = time.monotonic()
            while self._pipe.poll():
                standing = self._pipe.recv()
                self._panel.take(standing)
                self._lay_ground(standing["settings"])
            viewers = len(self.server.get_clients())
            if viewers != self._viewers:
                self._viewers = viewers
                self._send("viewers", viewers)
            snapshots, seen = self._board.read(seen)
            if len(snapshots):
                last = snapshots[-1]
                self._panel.charts.add(snapshots)
            if last is not None and self._viewers:
                with self.server.atomic():
                    if len(snapshots):
                        self._scene.update(last)
                    self._pull()
                if begin - numbers >= NUMBERS:
                    numbers = begin
                    self._panel.show(last)
                if begin - charts >= CHARTS:
                    charts = begin
                    if last["moving"]:
                        self._panel.charts.draw()
                        self._scene.draw_trails()
            time.sleep(max(FRAME - (time.monotonic() - begin), 0.005))

    def _lay_ground(self, settings: Mapping[str, Any]) -> None:
        self._scene.lay_ground(settings["friction"], tuple(settings["friction_strips"]))

    def _send(self, kind: str, value: Any) -> None:
        """Say what the driver wants; viser calls from many threads."""
        with self._sending, contextlib.suppress(OSError):
            self._pipe.send((kind, value))

    def _on_drag(self, event: Any) -> None:
        """The hand takes the robot, moves, or lets go."""
        if event.phase == "end":
            self._grip = None
            self._send("pull", (0.0, 0.0, 0.0))
            return
        try:
            start = checks.vector("the drag's start", event.start_position, 3)
            hand = checks.vector("the drag's end", event.end_position, 3)
        except InputError as error:
            self._panel.refuse(str(error))
            return
        if event.phase == "start" or self._grip is None:
            self._grip = start - self._scene.body
        self._hand = hand

    def _pull(self) -> None:
        """A spring between the hand and the body."""
        if self._grip is not None:
            force = self._spring * (self._hand - self._scene.body - self._grip)
            self._send("pull", tuple(force.tolist()))
