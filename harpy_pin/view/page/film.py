"""Pictures and films of a replay: one browser session that goes from moment to moment."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.files import check_writable, replacing
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view.page.chromium import Chromium
from harpy_pin.view.page.replay import write_replays
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, PRESSURE, SLIDING, SLIP, TARGET, THRUST

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["Film"]

GIF_RATE = 12.5
"""Frames per second: GIF counts in hundredths of a second."""
MP4_RATE = 25.0
OVERSAMPLING = 2
"""Pixels drawn per pixel of a picture and axis."""
SWATCHES = (CONTACT, FRICTION, SLIDING, THRUST, TARGET, APPLIED, PRESSURE, SLIP, "#e6453a")
MIXES = (("#ffffff", 0.0), ("#cfe0ec", 0.4), ("#cfe0ec", 0.6), ("#cfe0ec", 0.75), ("#000000", 0.3))
"""What the colours are mixed with, and how much of it."""
SAMPLES = 8
"""Frames of a GIF that its colours are taken from."""


class Film(AbstractContextManager["Film"]):
    """Takes pictures of a page of runs, through headless Chromium; ends with its ``with`` block.

    Args:
        runs: one to four, each with the robot that was logged.
        charts: show the charts and measures, too, not the scenes alone.
        words: show heading and key of a scene; without them the scene fills the picture.

    Raises:
        HarpyError: there is no Chromium or no Playwright, or it could not show the page.
        InputError: as :func:`harpy_pin.view.replays_html`.
    """

    def __init__(self, runs: Sequence[tuple[Run, Robot]], *, charts: bool = False, words: bool = True) -> None:
        self._browser = Chromium()
        self._folder = tempfile.TemporaryDirectory(prefix="harpy_view_", ignore_cleanup_errors=True)
        try:
            page = write_replays(runs, Path(self._folder.name) / "replay.html")
            self._browser.open_replay(page.as_uri() + ("" if charts else "#still" if words else "#still&bare"))
            self._start = float(self._browser.run("replay.content.runs[0].start"))
            self._duration = float(self._browser.run("replay.content.duration"))
            self._moment = self._start + float(self._browser.run("replay.content.moment.time"))
        except BaseException:
            self.close()
            raise

    def pictures(
        self, path: str | Path, times: Sequence[float] | None = None, *, size: tuple[int, int] = (1200, 675)
    ) -> list[Path]:
        """Save PNG pictures.

        Args:
            path: of the file; with several times, each has its time before the ending of its name.
            times: of the moments, s; the most telling one by default.
            size: width and height, pixels.

        Returns:
            The paths.

        Raises:
            HarpyError: the browser failed.
            RunFileError: a file cannot be written.
            InputError: a time or a size is out of its domain.
        """
        target = Path(path)
        moments = [self._moment] if times is None else [checks.number("time", time) for time in times]
        several = len(moments) > 1
        paths = [target.with_stem(f"{target.stem}-{time:g}") if several else target for time in moments]
        for each in paths:
            check_writable(each)
        for each, image in zip(paths, self._images(moments, size, OVERSAMPLING), strict=True):
            with replacing(each) as file:
                image.save(file, format="PNG", optimize=True)
        return paths

    def gif(
        self,
        path: str | Path,
        *,
        begin: float | None = None,
        end: float | None = None,
        size: tuple[int, int] = (640, 400),
    ) -> Path:
        """Save an animated GIF that plays in real time, for ever.

        Args:
            path: of the file.
            begin: of the part that is filmed, s; the run's beginning by default.
            end: of it, s; the run's end by default.
            size: width and height, pixels.

        Raises:
            HarpyError: the browser failed.
            RunFileError: the file cannot be written.
            InputError: a time or a size is out of its domain.
        """
        from PIL import Image

        target = Path(path)
        check_writable(target)
        images = list(self._images(self._clock(begin, end, GIF_RATE), size, OVERSAMPLING))
        # All frames share their colours: what does not move then stays as it is, and costs nothing.
        palette = _palette(images)
        frames = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        with replacing(target) as file:
            frames[0].save(
                file,
                format="GIF",
                save_all=True,
                append_images=frames[1:],
                duration=round(1e3 / GIF_RATE),
                loop=0,
                optimize=False,
            )
        return target

    def mp4(
        self,
        path: str | Path,
        *,
        begin: float | None = None,
        end: float | None = None,
        size: tuple[int, int] = (1200, 675),
    ) -> Path:
        """Save a film (H.264) that plays in real time; for arguments and errors see :meth:`gif`.

        Raises:
            HarpyError: the extra ``film`` is not installed, or the encoder failed.
        """
        target = Path(path)
        check_writable(target)
        try:
            import imageio_ffmpeg
        except ImportError:
            raise HarpyError("an MP4 needs an encoder: pip install 'harpy-pin[film]'") from None
        size = (size[0] // 2 * 2, size[1] // 2 * 2)  # as the format wants it
        part = Path(self._folder.name) / "film.mp4"
        writer: Any = imageio_ffmpeg.write_frames(str(part), size, fps=MP4_RATE, quality=7, macro_block_size=2)
        try:
            writer.send(None)
            for image in self._images(self._clock(begin, end, MP4_RATE), size, 1):
                writer.send(np.ascontiguousarray(image))
        except OSError as error:
            raise HarpyError(f"the encoder failed: {error}") from error
        finally:
            writer.close()
        with replacing(target) as file:
            file.write(part.read_bytes())
        return target

    def close(self) -> None:
        """End the browser."""
        self._browser.close()
        self._folder.cleanup()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _clock(self, begin: float | None, end: float | None, rate: float) -> list[float]:
        """Times of the frames of a film, s."""
        last = self._start + self._duration
        first = self._start if begin is None else checks.number("begin", begin, low=self._start, high=last)
        final = last if end is None else min(checks.number("end", end), last)
        if final <= first:
            raise InputError(f"a film must end after its beginning, got {first:g} to {final:g} s", name="end")
        return [first + k / rate for k in range(int((final - first) * rate + 1e-6) + 1)]

    def _images(self, times: Sequence[float], size: tuple[int, int], scale: int) -> Iterator[Image]:
        """Pictures of moments."""
        from PIL import Image

        width, height = (int(checks.number("size", side, low=16, high=8192)) for side in size)
        self._browser.resize(width, height, scale=scale)
        for time in times:
            # The page draws at once; two frames later what it drew is on the screen.
            self._browser.run(
                f"new Promise((done) => {{ replay.show({time - self._start!r});"
                " requestAnimationFrame(() => requestAnimationFrame(() => done(true))); })"
            )
            with Image.open(io.BytesIO(self._browser.picture())) as shot:
                image = shot.convert("RGB")
            if image.size != (width, height):
                image = image.resize((width, height), Image.Resampling.LANCZOS)
            yield image


def _palette(images: Sequence[Image]) -> Image:
    """Colours for pictures: those of a few of them, and those of the scene's small things, exactly."""
    from PIL import Image, ImageColor

    # The scene draws them translucent and in light and shade, too.
    exact = [
        round(a + share * (b - a))
        for colour in SWATCHES
        for other, share in MIXES
        for a, b in zip(ImageColor.getrgb(colour), ImageColor.getrgb(other), strict=True)
    ]
    chosen = [images[k] for k in np.unique(np.linspace(0, len(images) - 1, SAMPLES).astype(int))]
    width, height = chosen[0].size
    sheet = Image.new("RGB", (width, height * len(chosen)))
    for k, image in enumerate(chosen):
        sheet.paste(image, (0, k * height))
    found = sheet.quantize(256 - len(exact) // 3, method=Image.Quantize.MEDIANCUT).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette((found + exact)[-3 * 256 :])
    return palette
