"""Chromium without a window: opens a page from disk, without a network."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence

from harpy_pin.errors import HarpyError

__all__ = ["NAMES", "find_chromium", "run_chromium"]

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_SWITCHES = (
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
    "--enable-logging=stderr",
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


def run_chromium(url: str, switches: Sequence[str], *, timeout: float = 90.0) -> str:
    """Open a page in a fresh profile, with software rendering and no network.

    Args:
        url: of the page; ``file://`` for a file on disk.
        switches: more command-line switches (what to do with the page).
        timeout: s.

    Returns:
        What the browser wrote to its standard output.

    Raises:
        HarpyError: no browser, it failed or took too long, or a script of the page raised an error.
    """
    program = find_chromium()
    with tempfile.TemporaryDirectory(prefix="harpy_view_", ignore_cleanup_errors=True) as profile:
        command = [program, *_SWITCHES, f"--user-data-dir={profile}", *switches, url]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
        except subprocess.TimeoutExpired as error:
            raise HarpyError(f"{program} did not finish within {timeout:g} s") from error
        except OSError as error:
            raise HarpyError(f"cannot run {program}: {error.strerror or error}") from error
    faults = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "Uncaught" in line]
    if done.returncode != 0 or faults:
        reason = faults[0] if faults else (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise HarpyError(f"{program} could not show the page: {reason}")
    return done.stdout
