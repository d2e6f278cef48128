"""Pictures and films of a replay: one browser session that goes from moment to moment."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.files import check_writable, replacing
from harpy_pin.view.page.chromium import Chromium
from harpy_pin.view.page.replay import write_html
from harpy_pin.view.page.shown import Runs

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["Film"]

OVERSAMPLING = 2
"""Pixels drawn per pixel of a picture and axis."""


class _Kind(NamedTuple):
    """A kind of film.

    Attributes:
        rate: frames per second.
        size: width and height by default, pixels.
        step: that both are a multiple of.
        oversampling: pixels drawn per pixel and axis.
        options: of the encoder.
    """

    rate: float
    size: tuple[int, int]
    step: int
    oversampling: int
    options: dict[str, Any]


ONE_PALETTE = "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=none:diff_mode=rectangle"
"""All frames share their colours: what does not move stays as it is, and costs nothing."""
GIF = {"codec": "gif", "pix_fmt_out": "pal8", "quality": None, "output_params": ["-vf", ONE_PALETTE, "-loop", "0"]}
KINDS = {  # GIF counts in hundredths of a second
    ".gif": _Kind(12.5, (640, 400), 1, OVERSAMPLING, GIF),
    ".mp4": _Kind(25.0, (1200, 675), 2, 1, {"quality": 7}),
}


class Film(AbstractContextManager["Film"]):
    """Takes pictures of a page of runs, through headless Chromium; ends with its ``with`` block.

    Args:
        runs: as of :func:`harpy_pin.view.replay_html`.
        charts: show the charts and measures, too, not the scenes alone.
        words: show heading and key of a scene; without them the scene fills the picture.

    Raises:
        HarpyError: there is no Chromium or no Playwright, or it could not show the page.
        InputError: as :func:`harpy_pin.view.replay_html`.
    """

    def __init__(self, runs: Runs, *, charts: bool = False, words: bool = True) -> None:
        self._browser = Chromium()
        self._folder = tempfile.TemporaryDirectory(prefix="harpy_view_", ignore_cleanup_errors=True)
        try:
            page = write_html(runs, Path(self._folder.name) / "replay.html")
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

    def save(
        self,
        path: str | Path,
        *,
        begin: float | None = None,
        end: float | None = None,
        size: tuple[int, int] | None = None,
    ) -> Path:
        """Save a film that plays in real time: an animated GIF, for ever, or an MP4 (H.264), by the file's ending.

        Args:
            path: of the file.
            begin: of the part that is filmed, s; the run's beginning by default.
            end: of it, s; the run's end by default.
            size: width and height, pixels; 640 by 400 for a GIF, 1200 by 675 otherwise.

        Raises:
            HarpyError: the extra ``film`` is not installed, or the browser or the encoder failed.
            RunFileError: the file cannot be written.
            InputError: another ending, or a time or a size is out of its domain.
        """
        target = Path(path)
        kind = KINDS.get(target.suffix.lower())
        if kind is None:
            raise InputError(f"a film's name must end in {' or '.join(KINDS)}, got '{target}'", name="path", value=path)
        check_writable(target)
        try:
            import imageio_ffmpeg
        except ImportError:
            raise HarpyError("a film needs an encoder: pip install 'harpy-pin[film]'") from None
        width, height = kind.size if size is None else size
        size = (width // kind.step * kind.step, height // kind.step * kind.step)
        times = self._clock(begin, end, kind.rate)
        part = Path(self._folder.name) / f"film{target.suffix.lower()}"
        writer: Any = imageio_ffmpeg.write_frames(
            str(part), size, fps=kind.rate, macro_block_size=kind.step, ffmpeg_log_level="error", **kind.options
        )
        try:
            writer.send(None)
            for image in self._images(times, size, kind.oversampling):
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
