"""The process of the live page: it shows snapshots, and says what the driver wants.

Viser moves the camera by the same keys that drive. Whoever drives would soon see nothing of the
robot, so the point that the camera looks at is put back; the mouse still turns the view about the
robot, nearer and further away.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import viser

from harpy_pin import checks
from harpy_pin.contrib.live.guard import guarded_server
from harpy_pin.contrib.live.live_scene import LiveScene
from harpy_pin.contrib.live.panel import Panel
from harpy_pin.contrib.live.settings import DriveRanges
from harpy_pin.contrib.live.shared_snapshots import SharedSnapshots
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

FRAME, NUMBERS, CHARTS = 0.025, 0.25, 0.2
"""Time between frames of the scene, and between updates of numbers and charts, s."""
EYE, MIDDLE = (1.2, -1.42, 0.87), (0.0, 0.0, 0.33)
"""Where the camera is, and what it looks at, m; for a robot of Harpy's size."""
FIELD_OF_VIEW = 42.0
"""Its angle, degrees."""
UPRIGHT = 0.8
"""Aspect below which a screen is upright, with the panel below."""
TOLERANCE = 0.01
"""Distance that the camera may be off, m."""
ARRIVES_WITHIN = 20
"""Moves of a new page's camera until it is where it was put."""
FARTHEST = 1e6
"""Largest coordinate of a camera, m."""
LOWEST, HIGHEST = 0.03, 1.4
"""Elevation of the camera over the robot, rad: not below the ground, and not from straight
above.
"""


def serve(
    pipe: Connection,
    listener: socket.socket,
    board: SharedSnapshots,
    robot: Robot,
    settings: Mapping[str, Any],
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
        self.server = guarded_server(
            listener, label="harpy live", on_refused=lambda reason: self._panel.refuse(reason)
        )
        ranges = DriveRanges.of(robot)
        self._spring = ranges.spring
        self._scene = LiveScene(self.server, robot)
        self._panel = Panel(self.server.gui, robot, ranges, settings, self._send)
        self._lay_ground(settings)
        self._viewers = 0
        self._grip: Vector | None = None  # where the hand has the robot, relative to the body
        self._hand = np.zeros(3)
        camera, scale = self.server.initial_camera, self._scene.scale
        camera.position, camera.look_at = scale * np.array(EYE), scale * np.array(MIDDLE)
        camera.fov = float(np.radians(FIELD_OF_VIEW))
        self.server.on_client_connect(
            lambda client: _keep_in_view(client, scale, lambda: self._panel.follows)
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


def _keep_in_view(client: viser.ClientHandle, scale: float, follows: Callable[[], bool]) -> None:
    """Put the camera of a new page in its place for a robot of a size, and keep it in its middle
    while it follows.
    """
    begin, middle = scale * np.array(EYE), scale * np.array(MIDDLE)
    upright = client.camera.image_width < UPRIGHT * client.camera.image_height
    if upright:  # from further away, and the robot in the upper half
        begin = middle + 2.1 * (begin - middle) - scale * np.array((0.0, 0.0, 0.6))
        middle = middle - scale * np.array((0.0, 0.0, 0.75))
    tries = 0 if _is_at(client.camera, begin) else ARRIVES_WITHIN
    if upright:
        _put(client.camera, begin, middle)

    def put_back(camera: viser.CameraHandle) -> None:
        nonlocal tries
        if tries > 0:  # a slow page still reports the place where its camera was before
            there = _is_at(camera, begin)
            tries = 0 if there else tries - 1
            eye = None if there else begin
        else:
            eye = followed(camera.position, camera.look_at, middle) if follows() else None
        if eye is not None:
            with client.atomic():
                _put(camera, eye, middle)

    client.camera.on_update(put_back)


def _is_at(camera: viser.CameraHandle, eye: Vector) -> bool:
    """Whether a camera is in a place."""
    return bool(
        np.shape(camera.position) == (3,)
        and np.allclose(camera.position, eye, rtol=0.0, atol=TOLERANCE)
    )


def _put(camera: viser.CameraHandle, eye: Vector, look_at: Vector) -> None:
    """Put a camera in a place; one without directions, whose page has sent zeros for them, stays as
    it is.
    """
    with contextlib.suppress(ValueError):
        camera.position = eye
    with contextlib.suppress(ValueError):
        camera.look_at = look_at


def followed(eye: Vector, look_at: Vector, middle: Vector) -> Vector | None:
    """Where a camera belongs that has been moved: where it looks at the middle as it has looked,
    over the ground.

    Args:
        eye: (3,) where it is, m.
        look_at: (3,) what it looks at, m; one that looks at its own place belongs where it was
            first.
        middle: (3,) what it should look at, m.

    Returns:
        (3,) its place; None where it is there already, or where what the page has sent is no place.
    """
    if not (_is_place(eye) and _is_place(look_at)):
        return None
    away = eye - look_at if np.linalg.norm(eye - look_at) > TOLERANCE else np.array(EYE) - MIDDLE
    distance = float(np.linalg.norm(away))
    flat = float(np.hypot(away[0], away[1]))
    elevation = float(np.arctan2(away[2], flat))
    elevation_kept = min(max(elevation, LOWEST), HIGHEST)
    if elevation_kept != elevation:
        forward = away[:2] / flat if flat > 1e-6 * distance else np.array([0.0, -1.0])
        away = distance * np.array([*(np.cos(elevation_kept) * forward), np.sin(elevation_kept)])
    place: Vector = middle + away
    return None if np.allclose(place, eye, rtol=0.0, atol=TOLERANCE) else place


def _is_place(point: Vector) -> bool:
    """Whether what a page has sent is a point in space."""
    return point.shape == (3,) and bool(np.all(np.abs(point) <= FARTHEST))
