"""Where Chromium is, and how it is started: without a window, without a network."""

from __future__ import annotations

import shutil

from harpy_pin.errors import HarpyError

__all__ = ["NAMES", "SWITCHES", "find_chromium"]

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
