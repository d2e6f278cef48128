"""Replay of runs: in the browser, or as one HTML file that opens anywhere without a network."""

from __future__ import annotations

import re
import threading
import webbrowser
from collections.abc import Sequence
from contextlib import AbstractContextManager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, replacing
from harpy_pin.view.page.build_page import build_page
from harpy_pin.view.page.shown import Runs, line_up

LOCAL = re.compile(r"(localhost|127\.0\.0\.1|\[::1\])(:[0-9]{1,5})?", re.IGNORECASE)
"""Names of this machine, and a port."""


@checked
def replay_html(runs: Runs, *, fps: float = 30.0, names: Sequence[str] | None = None) -> str:
    """The replay of a run as HTML text (to write or to serve; a notebook shows
    :class:`InlineReplay`).

    The page shows the robot, and charts of its forces that move with it; it opens, paused, at the
    moment that tells most (:func:`harpy_pin.view.page.shown.telling_moment`). Space plays and
    pauses, the arrow keys go frame by frame, a click on a chart goes to that time, the mouse turns
    the view about the robot. ``#t=2.1`` at the end of its address opens it at 2.1 s, ``#play``
    playing from the start. Several runs are played in step, with charts and measures that compare
    them.

    Args:
        runs: a run, or a list of up to four; in place of a run whose robot is not found from its
            log, a pair of the run and its robot.
        fps: frames per second of simulated time; between them the page interpolates.
        names: of the runs; found in their logs by default.

    Raises:
        InputError: no run or more than four, not one name for each, a run that is of another robot
            or holds nothing to draw, or a frame rate that is not positive.
    """
    return build_page(line_up(runs, fps=fps, names=names))


class InlineReplay:
    """The replay of runs in a notebook, where it is the value of a cell; the notebook holds all
    that it shows.

    Args:
        runs: as of :func:`replay_html`, whose errors it has, too.
        height: of the replay, pixels; it is as wide as the notebook.
        fps: as of :func:`replay_html`.
        names: as of :func:`replay_html`.
    """

    @checked
    def __init__(
        self,
        runs: Runs,
        *,
        height: int = 640,
        fps: float = 30.0,
        names: Sequence[str] | None = None,
    ) -> None:
        self._height = checks.whole("height", height, low=1)
        self._page = replay_html(runs, fps=fps, names=names)

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self._height}px; border: 0"
        return f'<iframe srcdoc="{escape(self._page)}" style="{style}"></iframe>'


@checked
def write_html(
    runs: Runs, path: str | Path, *, fps: float = 30.0, names: Sequence[str] | None = None
) -> Path:
    """Write :func:`replay_html` as one self-contained file; an older file goes only once the new
    one is whole.

    Args:
        runs: as of :func:`replay_html`, whose other errors it has, too.
        path: the file, which is returned.
        fps: as of :func:`replay_html`.
        names: as of :func:`replay_html`.

    Raises:
        RunFileError: the file cannot be written (found out before the work is done).
    """
    target = Path(path)
    check_writable(target)
    text = replay_html(runs, fps=fps, names=names)
    with replacing(target) as file:
        file.write(_encoded(text))
    return target


@checked
def show(
    runs: Runs, *, open_browser: bool = True, fps: float = 30.0, port: int = 0
) -> ReplayServer:
    """Play runs in the browser and print the address of the page.

    The page is served as long as the program lives; a script that ends should call
    :meth:`ReplayServer.wait`.

    Args:
        runs: as of :func:`replay_html`.
        open_browser: open the page in the default browser.
        fps: frames per second of simulated time.
        port: to serve the page on; any free one by default.

    Raises:
        InputError: as :func:`replay_html`, or no port has that number.
        RunFileError: the port is taken, or may not be used.
    """
    shown = line_up(runs, fps=fps)
    server = ReplayServer(build_page(shown), port=port)
    print(f"replay of {shown[0].frames.robot.name}: {server.url}", flush=True)
    if open_browser:
        webbrowser.open(server.url)
    return server


def _encoded(text: str) -> bytes:
    """UTF-8; what a log may hold but no text (half a surrogate pair) becomes a reference that
    browsers show as �.
    """
    return text.encode("utf-8", errors="xmlcharrefreplace")


class ReplayServer(AbstractContextManager["ReplayServer"]):
    """Serves one page to browsers on this machine, from a thread of its own.

    Only requests that call the server by a name of this machine are answered: a page of elsewhere
    whose name was made to lead here reads nothing.

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
        checks.whole("port", port, high=65535)

        class Handler(BaseHTTPRequestHandler):
            timeout = 10.0  # s; of a browser that has nothing to say

            def do_GET(self) -> None:
                if not LOCAL.fullmatch(self.headers.get("Host", "")):
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
            self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except OSError as error:
            raise RunFileError(
                f"cannot serve the replay on port {port}: {error.strerror or error}"
            ) from error
        # A closed tab is no event.
        self._server.handle_error = lambda *request: None  # type: ignore[method-assign]
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
