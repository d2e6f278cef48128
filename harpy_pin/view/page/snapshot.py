"""A picture of one moment of a replay: ``python -m harpy_pin.view.page.snapshot run.npz picture.png --time 2.1``."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from harpy_pin import checks
from harpy_pin.errors import HarpyError, RunFileError
from harpy_pin.files import check_writable
from harpy_pin.model.robot import Robot, load_harpy
from harpy_pin.plant.run import Run
from harpy_pin.view.page.browser import find_chromium, run_chromium
from harpy_pin.view.page.replay import write_html

__all__ = ["snapshot"]

OVERSAMPLING = 2
"""Pixels drawn per pixel of the picture and axis."""


def snapshot(run: Run, robot: Robot, path: str | Path, *, time: float, width: int = 1200, height: int = 675) -> Path:
    """Save a picture of the replay, with its legend and without its controls, through headless Chromium.

    Args:
        run: the log.
        robot: the robot that was logged.
        path: the PNG file.
        time: simulated time of the moment, s; the nearest moment of the run where it is outside.
        width: of the picture, pixels.
        height: of the picture, pixels.

    Returns:
        The picture's path.

    Raises:
        HarpyError: no Chromium on PATH, or it could not show the page.
        RunFileError: the file cannot be written.
        InputError: as :func:`harpy_pin.view.replay_html`, or a bad time or size.
    """
    from PIL import Image

    target = Path(path)
    check_writable(target)
    find_chromium()
    time = checks.number("time", time)
    width, height = (int(checks.number(n, v, low=16, high=8192)) for n, v in (("width", width), ("height", height)))
    with tempfile.TemporaryDirectory(prefix="harpy_view_") as folder:
        page = write_html(run, robot, Path(folder) / "replay.html")
        shot = Path(folder) / "shot.png"
        run_chromium(
            f"{page.as_uri()}#t={time:g}&still",
            [
                f"--screenshot={shot}",
                f"--window-size={width},{height}",
                f"--force-device-scale-factor={OVERSAMPLING}",
                "--virtual-time-budget=2000",
            ],
        )
        if not shot.is_file():
            raise HarpyError("Chromium took no picture of the replay")
        with Image.open(shot) as image:
            picture = image.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
        try:
            picture.save(target, format="PNG", optimize=True)
        except OSError as error:
            raise RunFileError(f"cannot write '{target}': {error.strerror or error}", path=target) from error
    return target


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line of :func:`snapshot`."""
    parser = argparse.ArgumentParser(prog="python -m harpy_pin.view.page.snapshot")
    parser.description = "Save a picture of one moment of a run of Harpy's."
    parser.add_argument("run", help="log of the run, .npz")
    parser.add_argument("picture", help="file to write, .png")
    parser.add_argument("--time", type=float, default=0.0, help="moment, s (default: the start)")
    parser.add_argument("--width", type=int, default=1200, help="pixels (default: %(default)s)")
    parser.add_argument("--height", type=int, default=675, help="pixels (default: %(default)s)")
    parser.add_argument("--urdf", help="variant of Harpy that was logged (default: the packaged one)")
    given = parser.parse_args(arguments)
    try:
        run, robot = Run.load(given.run), load_harpy(given.urdf)
        snapshot(run, robot, given.picture, time=given.time, width=given.width, height=given.height)
    except HarpyError as error:
        parser.exit(1, f"error: {error}\n")


if __name__ == "__main__":
    main()
