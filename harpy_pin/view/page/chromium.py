"""A session with Chromium without a window: load a page, run scripts in it, take pictures, click.

It speaks the Chrome DevTools protocol over two pipes (``--remote-debugging-pipe``), so it needs no other package and
opens no port. Systems without POSIX pipes are not supported.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from typing import Any

from harpy_pin.errors import HarpyError
from harpy_pin.view.page.closing import Closing

__all__ = ["Chromium", "find_chromium"]

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)
TIMEOUT = 90.0
"""s; software rendering of a first picture is slow on a busy machine."""


def find_chromium() -> str:
    """Path of a Chromium or Chrome on the search path.

    Raises:
        HarpyError: there is none; the message lists the names that were tried.
    """
    for name in NAMES:
        found = shutil.which(name)
        if found:
            return found
    raise HarpyError(f"no Chromium on PATH (tried {', '.join(NAMES)}); install one to take pictures of a replay")


class Chromium(Closing):
    """Headless Chromium with a fresh profile, software rendering and no network; ends with its ``with`` block.

    Attributes:
        messages: what the page's console said that is a warning or worse, uncaught exceptions included.
        requested: addresses that the page asked for.

    Raises:
        HarpyError: there is no Chromium, or it cannot be run here.
    """

    def __init__(self) -> None:
        program = find_chromium()
        if os.name != "posix":
            raise HarpyError("pictures and films need a system with POSIX pipes to talk to Chromium")
        self.messages: list[str] = []
        self.requested: list[str] = []
        self._program = program
        self._profile = tempfile.TemporaryDirectory(prefix="harpy_view_", ignore_cleanup_errors=True)
        self._buffer, self._number, self._session = b"", 0, ""
        self._loaded = False
        command = [
            program,
            *SWITCHES,
            f"--user-data-dir={self._profile.name}",
            "--remote-debugging-pipe",
            "about:blank",
        ]
        try:
            self._process, self._read, self._write = _start(command)
        except OSError as error:
            self._profile.cleanup()
            raise HarpyError(f"cannot run {program}: {error.strerror or error}") from error
        try:
            self._attach()
            self.resize(1280, 800)
        except BaseException:
            self.close()
            raise

    def _attach(self) -> None:
        targets = self._call("Target.getTargets", session=False)["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self._call("Target.attachToTarget", {"targetId": page, "flatten": True}, session=False)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")
        offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
        self._call("Network.emulateNetworkConditions", offline)

    def resize(self, width: int, height: int, *, scale: float = 1.0, mobile: bool = False) -> None:
        """Size of the page, and pixels of a picture for each of its own, along both axes; ``mobile`` as a phone."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": mobile}
        self._call("Emulation.setDeviceMetricsOverride", metrics)

    def open(self, url: str) -> None:
        """Load a page, and wait until it is loaded.

        Raises:
            HarpyError: it cannot be loaded.
        """
        self._loaded = False
        # From an empty page: an address that differs by what follows # alone would not be loaded again.
        self._call("Page.navigate", {"url": "about:blank"})
        self._wait(lambda: self._loaded)
        self.messages.clear()
        self.requested.clear()
        self._loaded = False
        error = self._call("Page.navigate", {"url": url}).get("errorText")
        if error:
            raise HarpyError(f"{self._program} could not load the page: {error}")
        self._wait(lambda: self._loaded)

    def open_replay(self, url: str) -> None:
        """Load a page of a replay, and wait until it shows its first moment.

        Raises:
            HarpyError: a script of the page failed, or it took too long.
        """
        self.open(url)
        deadline = time.monotonic() + TIMEOUT
        while (state := self.run("document.documentElement.dataset.state")) == "loading":
            if time.monotonic() > deadline:
                raise HarpyError(f"{self._program} did not show the page within {TIMEOUT:g} s")
            time.sleep(0.02)
        if state == "fault" or self.messages:
            reason = (self.messages or [self.run("document.getElementById('fault').textContent")])[0]
            raise HarpyError(f"{self._program} could not show the page: {reason}")

    def run(self, script: str) -> Any:
        """Value of an expression in the page; a promise is waited for.

        Raises:
            HarpyError: the script raised an exception.
        """
        answer = self._call("Runtime.evaluate", {"expression": script, "returnByValue": True, "awaitPromise": True})
        if "exceptionDetails" in answer:
            raise HarpyError(f"a script of the page failed: {_exception(answer['exceptionDetails'])}")
        return answer["result"].get("value")

    def picture(self) -> bytes:
        """The page as it looks, as PNG."""
        answer = self._call("Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True})
        return base64.b64decode(answer["data"])

    def mouse(self, kind: str, x: float, y: float) -> None:
        """One event of the left mouse button: ``mousePressed``, ``mouseMoved`` or ``mouseReleased``."""
        event = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
        self._call("Input.dispatchMouseEvent", event | {"buttons": 0 if kind == "mouseReleased" else 1})

    def click(self, x: float, y: float) -> None:
        """Press and release the left mouse button."""
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def close(self) -> None:
        """End the browser."""
        for handle in (self._write, self._read):
            os.close(handle)
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._profile.cleanup()

    def _call(self, method: str, parameters: dict[str, Any] | None = None, *, session: bool = True) -> dict[str, Any]:
        """One command of the protocol, and its answer."""
        self._number += 1
        number = self._number
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters or {}}
        if session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        try:
            while data:
                data = data[os.write(self._write, data) :]
        except OSError as error:
            raise HarpyError(f"{self._program} has ended") from error
        answers: list[dict[str, Any]] = []

        def answered() -> bool:
            return bool(answers)

        self._wait(answered, number, answers)
        if "error" in answers[0]:
            raise HarpyError(f"{self._program} refused {method}: {answers[0]['error'].get('message')}")
        result: dict[str, Any] = answers[0]["result"]
        return result

    def _wait(self, done: Any, number: int = 0, answers: list[dict[str, Any]] | None = None) -> None:
        """Read messages until something is true."""
        deadline = time.monotonic() + TIMEOUT
        while not done():
            message = self._receive(deadline)
            if answers is not None and message.get("id") == number:
                answers.append(message)
            self._note(message)

    def _receive(self, deadline: float) -> dict[str, Any]:
        """The next message."""
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(deadline - time.monotonic(), 0.0))
            if not ready:
                raise HarpyError(f"{self._program} did not answer within {TIMEOUT:g} s")
            piece = os.read(self._read, 1 << 20)
            if not piece:
                raise HarpyError(f"{self._program} ended before it answered")
            self._buffer += piece
        text, _, self._buffer = self._buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        """Keep what an event says."""
        method, parameters = message.get("method"), message.get("params", {})
        if method == "Page.loadEventFired":
            self._loaded = True
        elif method == "Runtime.exceptionThrown":
            self.messages.append(_exception(parameters["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
            self.messages.append(" ".join(str(a.get("value", a.get("description"))) for a in parameters["args"]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.messages.append(parameters["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requested.append(parameters["request"]["url"])


def _exception(details: dict[str, Any]) -> str:
    """First line of an exception in the page."""
    text = details.get("exception", {}).get("description") or details.get("text", "exception")
    return str(text).splitlines()[0]


def _start(command: list[str]) -> tuple[subprocess.Popen[bytes], int, int]:
    """Run Chromium with pipes at the descriptors 3 and 4, where it looks for them.

    Returns:
        The process, and the descriptors to read its messages from and to write to it.
    """
    import fcntl  # not on every system

    ends = [*os.pipe(), *os.pipe()]
    # Out of the way of 3 and 4.
    commands, write, read, answers = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in ends)
    for end in ends:
        os.close(end)

    def place() -> None:
        os.dup2(commands, 3)
        os.dup2(answers, 4)

    try:
        process = subprocess.Popen(
            command,
            close_fds=False,  # all that Python opens is closed there anyway; 3 and 4 must not be
            preexec_fn=place,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        os.close(write)
        os.close(read)
        raise
    finally:
        os.close(commands)
        os.close(answers)
    return process, read, write
