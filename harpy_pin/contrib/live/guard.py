"""What stands before viser's server: one port and no other, and no page from elsewhere.

Viser answers whoever reaches its port. A page of another site could reach it through the browser of
the person who drives, by its address or by a name that is made to point there (DNS rebinding). So a
request must name this server as its host, and where it says what page it comes from, that must be
ours.
"""

from __future__ import annotations

import http
import ipaddress
import logging
import re
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import viser
import websockets.asyncio.server
from viser import (
    GuiButtonGroupHandle,
    GuiCheckboxHandle,
    GuiDropdownHandle,
    GuiSliderHandle,
    _messages,
)
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError

HOST = re.compile(r"(\[[0-9a-f:.]*\]|[^:]*)(?::([0-9]{1,5}))?", re.IGNORECASE)
"""A Host header: a name or an address, and a port."""
MAX_BYTES = 1 << 16
"""Longest message from a page, whose own have a few hundred."""


def guarded_server(
    listener: socket.socket, *, label: str, on_refused: Callable[[str], None] = lambda reason: None
) -> viser.ViserServer:
    """A viser server on a socket that listens already, and whose address says who may be served.

    Args:
        listener: bound and listening; on the loopback address it serves this machine only.
        label: title of the panel.
        on_refused: called with the reason where a page sends a value that its control cannot have.

    Raises:
        HarpyError: this viser is another than the one that the guard is made for.
    """
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    host, port = listener.getsockname()[:2]
    with _guard(listener) as used:
        server = _Server(host=host, port=port, label=label, verbose=False)
    if not used:
        raise HarpyError(
            f"viser {viser.__version__} starts its server in another way than expected; install 1.1"
        )
    _take_values_only(server, on_refused)
    return server


def allowed(host: list[str], origin: list[str], *, bound: str, port: int) -> bool:
    """Whether a request is for this server, and from a page of its own.

    Args:
        host: its Host headers, well-formed.
        origin: its Origin headers; programs other than browsers send none.
        bound: address that the server listens on.
        port: that it listens on.
    """
    if len(host) != 1 or len(origin) > 1 or (parts := HOST.fullmatch(host[0])) is None:
        return False
    name, number = parts.groups(default="80")
    if int(number) != port or not _is_ours(name.strip("[]").lower(), bound):
        return False
    return not origin or origin[0].lower() == f"http://{host[0].lower()}"


def _is_ours(name: str, bound: str) -> bool:
    """Whether a name can be meant for this server: a name that somebody else gives to its address
    is none.
    """
    if name == "localhost":
        return True
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return not ipaddress.ip_address(bound).is_loopback and name == socket.gethostname().lower()
    return address.is_loopback or not ipaddress.ip_address(bound).is_loopback


class _Server(viser.ViserServer):
    """Viser without its tunnel to the outside."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Refuse: a robot is driven from here."""


@contextmanager
def _guard(listener: socket.socket) -> Iterator[list[bool]]:
    """While viser starts, its websocket server gets our socket, and asks us first; says whether it
    did.
    """
    serve, used = websockets.asyncio.server.serve, []
    bound, port = listener.getsockname()[:2]

    def guarded(
        handler: Any, *place: Any, process_request: Callable[..., Any], **options: Any
    ) -> Any:
        used.append(True)

        def check(connection: ServerConnection, request: Request) -> Response | None:
            headers = request.headers
            if not all(map(HOST.fullmatch, headers.get_all("Host"))):
                return connection.respond(
                    http.HTTPStatus.BAD_REQUEST, "this Host header names no host and port\n"
                )
            if not allowed(
                headers.get_all("Host"), headers.get_all("Origin"), bound=bound, port=port
            ):
                return connection.respond(
                    http.HTTPStatus.FORBIDDEN, "this page is for its own machine\n"
                )
            answer: Response | None = process_request(connection, request)
            return answer

        options |= {"max_size": MAX_BYTES, "sock": listener}
        return serve(handler, process_request=check, **options)

    websockets.asyncio.server.serve = guarded  # type: ignore[misc, assignment]
    try:
        yield used
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _take_values_only(server: viser.ViserServer, on_refused: Callable[[str], None]) -> None:
    """Take nothing from a page but values that its controls can have: viser would set any attribute
    to anything.
    """
    handlers = server._websock_server._incoming_handlers
    controls = server.gui._gui_input_handle_from_uuid

    def only_values(handler: Callable[..., Any]) -> Callable[..., Any]:
        async def checked(client: Any, message: _messages.GuiUpdateMessage) -> None:
            handle = controls.get(message.uuid)
            if handle is None or set(message.updates) != {"value"}:
                return
            try:
                check_value(handle, message.updates["value"])
            except InputError as error:
                on_refused(str(error))
                shown = _messages.GuiUpdateMessage(message.uuid, {"value": handle.value})
                server.gui._websock_interface.queue_message(shown)
                return
            await handler(client, message)

        return checked

    update = _messages.GuiUpdateMessage
    handlers[update] = [only_values(handler) for handler in handlers[update]]
    for kind in (
        _messages.FileTransferStartUpload,
        _messages.FileTransferPart,
        _messages.ShareUrlRequest,
    ):
        handlers.pop(kind, None)


def check_value(handle: Any, value: object) -> None:
    """Refuse a value from a page that a control of viser's cannot have.

    Raises:
        InputError: no option of the control, no number within its ends, or neither true nor false.
    """
    label = handle.label or "control"
    if isinstance(handle, GuiDropdownHandle | GuiButtonGroupHandle):
        if not isinstance(value, str):
            raise InputError(f"{label} must be a name, got {value!r:.60}", name=label, value=value)
        checks.one_of(f"option of {label}", value[:60], handle.options)
    elif isinstance(handle, GuiSliderHandle):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(
                f"{label} must be a number, got {value!r:.60}", name=label, value=value
            )
        number = checks.number(label, value, low=handle.min, high=handle.max)
        if isinstance(handle.value, int):
            checks.whole(label, int(number) if number.is_integer() else value)
    elif isinstance(handle, GuiCheckboxHandle) and not isinstance(value, bool):
        raise InputError(
            f"{label} must be true or false, got {value!r:.60}", name=label, value=value
        )
