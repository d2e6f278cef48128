"""Replay of a run: in the browser, or as one HTML file that opens anywhere without a network."""

from __future__ import annotations

import re
import threading
import webbrowser
from collections.abc import Sequence
from contextlib import AbstractContextManager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.files import check_writable, replacing
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view.page.build_page import build_page

__all__ = ["ReplayServer", "replay_html", "replays_html", "serve", "show", "write_html", "write_replays"]

_LAST_PORT = 65535
_LOCAL = re.compile(r"(localhost|127\.0\.0\.1|\[::1\])(:[0-9]{1,5})?", re.IGNORECASE)


@checked
def replay_html(run: Run, robot: Robot, *, fps: float = 30.0) -> str:
    """The replay as HTML text (to write, to serve, or for a notebook's ``IFrame(srcdoc=...)``).

    The page shows the robot, and charts of its forces that move with it; it opens, paused, at the moment that tells
    most (:func:`harpy_pin.view.page.moment.telling_moment`). Space plays and pauses, the arrow keys go frame by frame,
    a click on a chart goes to that time, the mouse turns the view about the robot. ``#t=2.1`` at the end of its address
    opens it at 2.1 s, ``#play`` playing from the start.

    Args:
        run: the log.
        robot: the robot that was logged.
        fps: frames per second of simulated time; between them the page interpolates.

    Raises:
        InputError: the run is of another robot or holds nothing to draw, or the frame rate is not positive.
    """
    return build_page([(run, robot)], fps=fps)


@checked
def replays_html(runs: Sequence[tuple[Run, Robot]], *, fps: float = 30.0, names: Sequence[str] | None = None) -> str:
    """Up to four runs side by side as HTML text: played in step, with charts and measures that compare them.

    Args:
        runs: each with the robot that was logged.
        fps: frames per second of simulated time.
        names: of the runs; found in their logs by default.

    Raises:
        InputError: as :func:`replay_html`, no run or more than four, or not one name for each.
    """
    return build_page(runs, fps=fps, names=names)


@checked
def write_html(run: Run, robot: Robot, path: str | Path, *, fps: float = 30.0) -> Path:
    """Write the replay as one self-contained HTML file; an older file goes only once the new one is whole.

    Args:
        run: the log.
        robot: the robot that was logged.
        path: the file.
        fps: frames per second of simulated time.

    Returns:
        The file's path.

    Raises:
        RunFileError: the file cannot be written (found out before the work is done).
        InputError: as :func:`replay_html`.
    """
    return write_replays([(run, robot)], path, fps=fps)


@checked
def write_replays(
    runs: Sequence[tuple[Run, Robot]], path: str | Path, *, fps: float = 30.0, names: Sequence[str] | None = None
) -> Path:
    """Write runs side by side as one self-contained HTML file; see :func:`replays_html` and :func:`write_html`."""
    target = Path(path)
    check_writable(target)
    text = build_page(runs, fps=fps, names=names)
    with replacing(target) as file:
        file.write(_encoded(text))
    return target


def _encoded(text: str) -> bytes:
    """UTF-8; what a log may hold but no text (half a surrogate pair) becomes a reference that browsers show as �."""
    return text.encode("utf-8", errors="xmlcharrefreplace")


class _Server(ThreadingHTTPServer):
    """Says nothing of browsers that hang up."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A closed tab is no event."""


class ReplayServer(AbstractContextManager["ReplayServer"]):
    """Serves one page to browsers on this machine, from a thread of its own.

    Only requests that call the server by a name of this machine are answered: a page of elsewhere whose name was made
    to lead here reads nothing.

    Args:
        page: HTML text.
        port: to listen on; any free one by default.

    Attributes:
        url: address of the page.

    Raises:
        InputError: no port has that number.
        RunFileError: the port is taken, or may not be used.
    """

    def __init__(self, page: str, *, port: int = 0) -> None:
        body = _encoded(page)
        if checks.whole("port", port) > _LAST_PORT:
            raise InputError(f"port must be at most {_LAST_PORT}, got {port}", name="port", value=port)

        class Handler(BaseHTTPRequestHandler):
            timeout = 10.0  # s; of a browser that has nothing to say

            def do_GET(self) -> None:
                if not _LOCAL.fullmatch(self.headers.get("Host", "")):
                    self.send_error(403)
                    return
                if self.path.split("?")[0] not in ("/", "/index.html"):
                    self.send_error(404)
                    return
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing on the terminal."""

        try:
            self._server = _Server(("127.0.0.1", port), Handler)
        except OSError as error:
            raise RunFileError(f"cannot serve the replay on port {port}: {error.strerror or error}") from error
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/"

    def wait(self) -> None:
        """Serve until Ctrl-C, then close."""
        try:
            self._thread.join()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """Stop serving; pages that are already open keep playing."""
        self._server.shutdown()
        self._server.server_close()

    def __exit__(self, *error: object) -> None:
        self.close()


@checked
def show(run: Run, robot: Robot, *, open_browser: bool = True, fps: float = 30.0, port: int = 0) -> ReplayServer:
    """Play a run in the browser and print the address of the page.

    The page is served as long as the program lives; a script that ends should call :meth:`ReplayServer.wait`.

    Args:
        run: the log.
        robot: the robot that was logged.
        open_browser: open the page in the default browser.
        fps: frames per second of simulated time.
        port: to serve the page on; any free one by default.

    Raises:
        InputError: as :func:`replay_html`, or no port has that number.
        RunFileError: the port is taken, or may not be used.
    """
    return serve(replay_html(run, robot, fps=fps), f"replay of {robot.name}", open_browser=open_browser, port=port)


def serve(page: str, what: str, *, open_browser: bool = True, port: int = 0) -> ReplayServer:
    """Serve a page, say where, and open it in the default browser.

    Args:
        page: HTML text.
        what: the page is.
        open_browser: open it.
        port: to serve it on; any free one by default.

    Raises:
        InputError: no port has that number.
        RunFileError: the port is taken, or may not be used.
    """
    server = ReplayServer(page, port=port)
    print(f"{what}: {server.url}", flush=True)
    if open_browser:
        webbrowser.open(server.url)
    return server
