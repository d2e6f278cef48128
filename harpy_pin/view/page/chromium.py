"""Chromium without a window, through Playwright: load a page, run scripts in it, take pictures.

Playwright works in a thread of its own: where an event loop runs already, as in a notebook, it would refuse.
"""

from __future__ import annotations

import base64
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from typing import TYPE_CHECKING, Any, TypeVar

from harpy_pin.errors import HarpyError

if TYPE_CHECKING:
    from playwright.sync_api import ConsoleMessage, Page

__all__ = ["Chromium", "find_chromium"]

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SWITCHES = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)
TIMEOUT = 90.0
"""s; software rendering of a first picture is slow on a busy machine."""
Result = TypeVar("Result")


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


class Chromium(AbstractContextManager["Chromium"]):
    """Headless Chromium with a fresh profile, software rendering and no network; ends with its ``with`` block.

    It is Playwright's own Chromium where that is installed, else the one on the search path.

    Attributes:
        messages: errors on the page's console, uncaught exceptions included.
        requested: addresses that the page asked for.

    Raises:
        HarpyError: there is no Chromium or no Playwright, or Chromium cannot be run here.
    """

    def __init__(self) -> None:
        try:
            from playwright.sync_api import Error
        except ImportError:
            raise HarpyError("pictures and films need Playwright: pip install 'harpy-pin[film]'") from None
        self._error = Error
        self.messages: list[str] = []
        self.requested: list[str] = []
        self._thread = ThreadPoolExecutor(1, "playwright")
        self._playwright: Any = None
        try:
            self._thread.submit(self._start).result()
            self.resize(1280, 800)
        except BaseException as error:
            self.close()
            if isinstance(error, Error):
                raise HarpyError(f"cannot run Chromium: {_first_line(error)}") from error
            raise

    def _start(self) -> None:
        from playwright.sync_api import sync_playwright

        self._playwright = sync_playwright().start()
        launch = self._playwright.chromium.launch
        try:
            browser = launch(args=SWITCHES, handle_sigint=False)
        except self._error:
            browser = launch(args=SWITCHES, handle_sigint=False, executable_path=find_chromium())
        context = browser.new_context(offline=True, no_viewport=True)
        context.set_default_timeout(1e3 * TIMEOUT)
        self._page = page = context.new_page()
        self._protocol = context.new_cdp_session(page)
        page.on("console", self._note)
        page.on("pageerror", lambda error: self.messages.append(_first_line(error)))
        page.on("request", lambda request: self.requested.append(request.url))

    def do(self, act: Callable[[Page], Result]) -> Result:
        """Do something with Playwright's page, in its thread.

        Args:
            act: called with the page; it returns plain data.

        Raises:
            HarpyError: Playwright could not do it.
        """
        try:
            return self._thread.submit(act, self._page).result()
        except self._error as error:
            raise HarpyError(f"Chromium: {_first_line(error)}") from error

    def resize(self, width: int, height: int, *, scale: float = 1.0, mobile: bool = False) -> None:
        """Size of the page, and pixels of a picture for each of its own, along both axes; ``mobile`` as a phone."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": mobile}
        self.do(lambda page: self._protocol.send("Emulation.setDeviceMetricsOverride", metrics))

    def open(self, url: str) -> None:
        """Load a page, and wait until it is loaded.

        Raises:
            HarpyError: it cannot be loaded.
        """
        # From an empty page: an address that differs by what follows # alone would not be loaded again.
        self.do(lambda page: page.goto("about:blank"))
        self.messages.clear()
        self.requested.clear()
        try:
            self.do(lambda page: page.goto(url))
        except HarpyError as error:
            self.do(lambda page: page.wait_for_url("chrome-error:**"))  # Chromium's own page, which it shows instead
            raise HarpyError(f"Chromium could not load the page: {_first_line(error)}") from error

    def open_replay(self, url: str) -> None:
        """Load a page of a replay, and wait until it shows its first moment.

        Raises:
            HarpyError: a script of the page failed, or it took too long.
        """
        self.open(url)
        self.do(lambda page: page.wait_for_function("document.documentElement.dataset.state !== 'loading'"))
        if self.messages or self.run("document.documentElement.dataset.state") == "fault":
            reason = (self.messages or [self.run("document.getElementById('fault').textContent")])[0]
            raise HarpyError(f"Chromium could not show the page: {reason}")

    def run(self, script: str) -> Any:
        """Value of an expression in the page; a promise is waited for.

        Raises:
            HarpyError: the script raised an exception.
        """
        try:
            return self.do(lambda page: page.evaluate(script))
        except HarpyError as error:
            raise HarpyError(f"a script of the page failed: {_first_line(error)}") from error

    def picture(self) -> bytes:
        """The page as it looks, as PNG."""
        form = {"format": "png", "optimizeForSpeed": True}
        return base64.b64decode(self.do(lambda page: self._protocol.send("Page.captureScreenshot", form))["data"])

    def close(self) -> None:
        """End the browser."""
        if self._playwright is not None:
            with suppress(self._error):
                self._thread.submit(self._playwright.stop).result()
        self._thread.shutdown()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _note(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "assert"):
            self.messages.append(message.text)


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
