"""The process of a viewer's page: draws the newest moment, at most thirty times a second, where
somebody looks.

It is Meshcat's server with the drawing beside it. Meshcat's keeps every property that was ever set,
so nodes are moved by transforms, of which it keeps the last. The process ends with its parent: when
its standard input is closed.
"""

import os
import pickle
import socket
import sys
from collections.abc import Iterable
from contextlib import suppress
from html import escape
from importlib.resources import files
from time import perf_counter
from typing import Any

import numpy as np
import umsgpack
from meshcat.servers.tree import find_node, walk
from meshcat.servers.zmqserver import (
    VIEWER_ROOT,
    StaticFileHandlerNoCache,
    WebSocketHandler,
    ZMQWebSocketBridge,
)
from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError

from harpy_pin.view.palette import APPLIED, BODY, CONTACT, FRICTION, SLIDING, TARGET, THRUST
from harpy_pin.view.scene.meshcat_backend import move_commands, node_commands, stage_commands
from harpy_pin.view.viewer.loop_scene import LoopScene
from harpy_pin.view.viewer.moments import Slot

LOCAL = r"(localhost|127\.0\.0\.1|\[::1\])"
"""Names of this machine: a page of elsewhere whose name was made to lead here reads nothing."""
FRAME_RATE = 30.0
"""Frames per second, at most."""
ON_THE_WAY = 1 << 16
"""Bytes that are on their way to a browser: some frames. A slow one would otherwise see what was
seconds ago.
"""
PATIENCE = 10
"""Lower priority of this process: the loop comes first."""


class Socket(WebSocketHandler):  # type: ignore[misc]
    """A browser's connection: Meshcat's, which says nothing on the terminal.

    A message holds any number of Meshcat's commands, each after its length, so that no half of a
    frame is ever seen.
    """

    def open(self) -> None:
        """Send the scene as it is."""
        nodes = walk(self.bridge.tree)
        parts = [
            part
            for node in nodes
            for part in (node.object, *node.properties, node.transform, node.animation)
        ]
        self.write_commands(part for part in parts if part is not None)
        self.bridge.websocket_pool.add(self)

    def on_close(self) -> None:
        """Forget the browser."""
        self.bridge.websocket_pool.discard(self)

    def write_message(self, message: bytes, binary: bool = True) -> None:
        """Send one command."""
        self.write_commands([message])

    def write_commands(self, commands: Iterable[bytes]) -> None:
        """Send commands that are carried out together; nothing to a browser that is being
        closed.
        """
        together = b"".join(len(command).to_bytes(4) + command for command in commands)
        with suppress(WebSocketClosedError):
            sent = super().write_message(together, binary=True)
            sent.add_done_callback(lambda done: done.exception())

    @property
    def busy(self) -> bool:
        """Whether the browser has not yet taken what was sent to it."""
        return self.ws_connection is None or bool(self.ws_connection.stream.writing())


class Index(RequestHandler):
    """The page itself."""

    def initialize(self, text: str) -> None:
        """Keep its text."""
        self.text = text

    def get(self) -> None:
        """Send it."""
        self.write(self.text)


class Page(ZMQWebSocketBridge):  # type: ignore[misc]
    """Meshcat's server, and what draws for it.

    Args:
        listener: socket that browsers connect to.
        scene: what is drawn.
        slot: where the loop writes.
    """

    def __init__(self, listener: socket.socket, scene: LoopScene, slot: Slot) -> None:
        self._scene, self._slot = scene, slot
        self._number = 0  # of the moment that is drawn
        self._drawn = -np.inf  # when it was, s
        self._moves: dict[
            tuple[str, str], bytes
        ] = {}  # what is drawn, by path and kind of the command
        self._late: set[Socket] = set()  # browsers that missed a frame
        super().__init__("tcp://127.0.0.1:*", port=listener.getsockname()[1])
        HTTPServer(self.app).add_socket(listener)
        self.zmq_url = self.zmq_socket.last_endpoint.decode()
        for command in stage_commands(scene.size) + node_commands(scene.nodes, {}):
            self._keep(command, umsgpack.packb(command))
        self.draw()

    def make_app(self) -> Application:
        """What answers browsers; it listens on the given socket only."""

        class Local(Application):
            def listen(self, *_: Any, **__: Any) -> None:  # type: ignore[override]
                """Not on all interfaces, as Meshcat would."""

        rules: list[Any] = [
            (r"/static/(?:index\.html)?", Index, {"text": page_text(self._scene)}),
            (r"/static/(.*)", StaticFileHandlerNoCache, {"path": VIEWER_ROOT}),
            (r"/", Socket, {"bridge": self}),
        ]
        app = Local(log_function=lambda handler: None)
        app.add_handlers(LOCAL, rules)
        return app

    def handle_zmq(self, frames: list[bytes]) -> None:
        """Answer a client of Meshcat's: a scene is that of the newest moment."""
        if frames[0] == b"get_scene":
            self.draw()
        super().handle_zmq(frames)

    def draw_if_seen(self) -> None:
        """Draw for browsers, where there are any."""
        if self.websocket_pool:
            self.draw()

    def draw(self) -> None:
        """Draw the newest moment, and send what has changed; a slow browser misses frames, and no
        other does.
        """
        changed: list[bytes] = []
        read = self._slot.read(self._number)
        if read is not None:
            moment, self._number = read
            passed, self._drawn = perf_counter() - self._drawn, perf_counter()
            for command in move_commands(self._scene.motions(moment, passed)):
                key, data = (command["path"], command["type"]), umsgpack.packb(command)
                if self._moves.get(key) != data:
                    self._moves[key] = data
                    self._keep(command, data)
                    changed.append(data)
        self._late &= self.websocket_pool
        for browser in self.websocket_pool:
            if browser.busy:
                self._late.add(browser)
                continue
            commands = self._moves.values() if browser in self._late else changed
            self._late.discard(browser)
            if commands:
                browser.write_commands(commands)

    def _keep(self, command: dict[str, Any], data: bytes) -> None:
        """Have a command in the scene that later browsers get."""
        node = find_node(self.tree, [name for name in command["path"].split("/") if name])
        if command["type"] == "set_object":
            node.object = data
        elif command["type"] == "set_transform":
            node.transform = data
        else:
            kept = [
                old
                for old in node.properties
                if umsgpack.unpackb(old)["property"] != command["property"]
            ]
            node.properties = [*kept, data]


def page_text(scene: LoopScene) -> str:
    """HTML of the page."""
    newtons = f"{scene.scales.force:g} N per metre"
    rows = [("contact force", CONTACT)]
    rows += [("friction cone", FRICTION), ("slides", SLIDING)] if scene.cones else []
    rows += [("thrust", THRUST)] if scene.robot.thrusters else []
    rows += [("target", TARGET), ("applied", APPLIED), ("body", BODY)]
    key = "".join(
        f'<span><i style="background: {colour}"></i>{name}</span>' for name, colour in rows
    )
    text = files("harpy_pin.view.viewer").joinpath("page.html").read_text(encoding="utf-8")
    return text.replace("{{title}}", escape(scene.robot.name)).replace(
        "{{key}}", f"{key}<span>{newtons}</span>"
    )


def serve(slot_file: int, listener_file: int) -> None:
    """Serve until the standard input ends."""
    os.nice(PATIENCE)
    robot, ground, first = pickle.load(sys.stdin.buffer)
    scene = LoopScene(robot, ground, first)
    slot = Slot(slot_file, first.dtype)
    listener = socket.socket(fileno=listener_file)
    listener.setblocking(False)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ON_THE_WAY)
    page = Page(listener, scene, slot)
    page.ioloop.add_handler(sys.stdin.fileno(), lambda *_: page.ioloop.stop(), page.ioloop.READ)
    PeriodicCallback(page.draw_if_seen, 1e3 / FRAME_RATE).start()
    print(page.zmq_url, flush=True)
    sys.stdout = sys.stderr  # nobody reads further lines
    page.run()


if __name__ == "__main__":
    serve(*map(int, sys.argv[1:]))
