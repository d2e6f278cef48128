"""What a browser gets from a viewer's page, without a browser."""

import asyncio
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from typing import Any

import umsgpack
from tornado.websocket import websocket_connect

from harpy_pin.view import Viewer

Commands = list[dict[str, Any]]


def commands_in(message: bytes) -> Iterator[dict[str, Any]]:
    """The commands of a message, each after its length."""
    at = 0
    while at < len(message):
        length = int.from_bytes(message[at : at + 4])
        yield umsgpack.unpackb(message[at + 4 : at + 4 + length])
        at += 4 + length


def messages(
    viewer: Viewer, count: int, meanwhile: Callable[[], None] = lambda: None
) -> list[Commands]:
    """The first messages that a browser gets: the whole scene, then frames; something else is done
    between them.
    """

    async def listen() -> list[Commands]:
        address = viewer.url.replace("http", "ws", 1).removesuffix("static/")
        page = await websocket_connect(address, max_message_size=1 << 28)
        found: list[Commands] = []
        for _ in range(count):
            coming = asyncio.ensure_future(page.read_message())
            while not (await asyncio.wait({coming}, timeout=0.005))[0]:
                if found:
                    meanwhile()
            message = coming.result()
            assert isinstance(message, bytes)
            found.append(list(commands_in(message)))
        page.close()
        return found

    return asyncio.run(listen())


class SlowBrowser(AbstractContextManager["SlowBrowser"]):
    """A connection whose messages are not read for a while, with little room for them on their
    way.
    """

    def __init__(self, viewer: Viewer) -> None:
        host, _, port = viewer.url.split("/")[2].partition(":")
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._socket.connect((host, int(port)))
        upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        self._socket.sendall(
            f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\n{upgrade}{key}\r\n".encode()
        )
        self._socket.recv(1)

    def read_until_quiet(self) -> list[Commands]:
        """All messages, until none has come for a second."""
        self._socket.settimeout(1.0)
        data = bytearray()
        with suppress(TimeoutError):
            while more := self._socket.recv(1 << 16):
                data += more
        at, found = data.index(b"\r\n\r\n") + 4, []
        while at < len(data):
            length, size = data[at + 1], {126: 2, 127: 8}.get(data[at + 1], 0)
            length = int.from_bytes(data[at + 2 : at + 2 + size]) if size else length
            at += 2 + size
            found.append(list(commands_in(bytes(data[at : at + length]))))
            at += length
        return found

    def __exit__(self, *error: object) -> None:
        self._socket.close()
