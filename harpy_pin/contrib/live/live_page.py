"""The live page: a thread that shows snapshots and says what the driver wants.

Viser moves the camera by the same keys that drive. Whoever drives would soon see nothing of the
robot, so the point that the camera looks at is put back; the mouse still turns the view about the
robot, nearer and further away.
"""

import contextlib
import io
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict
from queue import SimpleQueue
from typing import Any

import numpy as np
import viser

from harpy_pin import checks
from harpy_pin.contrib.live.live_scene import LiveScene
from harpy_pin.contrib.live.live_session import LiveSession
from harpy_pin.contrib.live.panel import Panel
from harpy_pin.contrib.live.snapshots import snapshot
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

PLACES = 256
"""Snapshots that the page may be late by: five seconds."""
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


class Server(viser.ViserServer):
    """Viser without its tunnel to the outside."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Refuse: a robot is driven from here."""


class LivePage:
    """Server, scene and panel.

    Args:
        host: address to serve it on.
        port: of it; any free one for 0.
        session: that is shown.

    Attributes:
        url: of the page.
        wishes: of the driver: the kind of each and its value.
    """

    def __init__(self, host: str, port: int, session: LiveSession) -> None:
        for name in ("websockets.server", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self.wishes: SimpleQueue[tuple[str, Any]] = SimpleQueue()
        self._snapshots: deque[dict[str, Any]] = deque(maxlen=PLACES)
        self._over = threading.Event()
        self._spring = session.ranges.spring
        with contextlib.redirect_stdout(io.StringIO()):  # viser says there that it starts
            self.server = Server(host=host, port=port, label="harpy live", verbose=False)
        name = f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self.server.get_port()}/"
        settings = asdict(session.settings)
        self._scene = LiveScene(self.server, session.robot)
        self._panel = Panel(self.server.gui, session.robot, session.ranges, settings, self._send)
        self._lay_ground(settings)
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
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def viewers(self) -> int:
        """How many browsers show it."""
        return len(self.server.get_clients())

    def show(self, session: LiveSession) -> None:
        """Show the present state."""
        self._snapshots.append(snapshot(session))

    def take(self, standing: Mapping[str, Any]) -> None:
        """How things stand with the session."""
        self._panel.take(standing)
        self._lay_ground(standing["settings"])

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def _run(self) -> None:
        """Draw snapshots until the page is closed."""
        last = None
        numbers = charts = 0.0
        while not self._over.wait(FRAME):
            begin, fresh = time.monotonic(), list[dict[str, Any]]()
            while self._snapshots:
                fresh.append(self._snapshots.popleft())
            self._panel.charts.add(fresh)
            last = fresh[-1] if fresh else last
            if last is None or not self.viewers:
                continue
            with self.server.atomic():
                if fresh:
                    self._scene.update(last)
                self._pull()
            if begin - numbers >= NUMBERS:
                numbers = begin
                self._panel.show(last)
            if begin - charts >= CHARTS and last["moving"]:
                charts = begin
                self._panel.charts.draw()
                self._scene.draw_trails()

    def _lay_ground(self, settings: Mapping[str, Any]) -> None:
        self._scene.lay_ground(settings["friction"], tuple(settings["friction_strips"]))

    def _send(self, kind: str, value: Any) -> None:
        """Say what the driver wants; viser calls from many threads."""
        self.wishes.put((kind, value))

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
