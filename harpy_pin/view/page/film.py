"""Pictures and films of a replay, taken by headless Chromium through Playwright."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError, install_line
from harpy_pin.files import check_writable, replacing
from harpy_pin.view.page.replay import write_html
from harpy_pin.view.page.shown import Runs

if TYPE_CHECKING:
    from PIL.Image import Image
    from playwright.sync_api import Page

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SWITCHES = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)
"""Software rendering, and no network."""
TIMEOUT = 90.0
"""s; software rendering of a first picture is slow on a busy machine."""
OVERSAMPLING = 2
"""Pixels drawn per pixel of a picture and axis."""
Result = TypeVar("Result")


class _Kind(NamedTuple):
    """A kind of film."""

    rate: float  # frames per second
    size: tuple[int, int]  # width and height by default, pixels
    step: int  # that both are a multiple of
    oversampling: int  # pixels drawn per pixel and axis
    options: dict[str, Any]  # of the encoder


ONE_PALETTE = (
    "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=none:diff_mode=rectangle"
)
"""All frames share their colours: what does not move stays as it is, and costs nothing."""
GIF = {
    "codec": "gif",
    "pix_fmt_out": "pal8",
    "quality": None,
    "output_params": ["-vf", ONE_PALETTE, "-loop", "0"],
}
KINDS = {  # GIF counts in hundredths of a second
    ".gif": _Kind(12.5, (640, 400), 1, OVERSAMPLING, GIF),
    ".mp4": _Kind(25.0, (1200, 675), 2, 1, {"quality": 7}),
}


def find_chromium() -> str:
    """Path of a Chromium or Chrome on the search path.

    Raises:
        HarpyError: there is none; the message lists the names that were tried.
    """
    for name in NAMES:
        if (found := shutil.which(name)) is not None:
            return found
    raise HarpyError(
        f"no Chromium on PATH (tried {', '.join(NAMES)}); install one to take pictures of a replay"
    )


class Film(AbstractContextManager["Film"]):
    """Takes pictures of a page of runs; ends with its ``with`` block.

    Its Chromium is Playwright's own where that is installed, else the one on the search path.
    Playwright works in a thread of its own: beside a running event loop, as in a notebook, it would
    refuse.

    Args:
        runs: as of :func:`harpy_pin.view.replay_html`.
        charts: show the charts and measures, too, not the scenes alone.
        words: show heading and key of a scene; without them the scene fills the picture.

    Raises:
        HarpyError: there is no Chromium or no Playwright, or it could not show the page.
        InputError: as :func:`harpy_pin.view.replay_html`.
    """

    def __init__(self, runs: Runs, *, charts: bool = False, words: bool = True) -> None:
        try:
            from playwright.sync_api import Error
        except ImportError:
            raise HarpyError(
                f"pictures and films need Playwright: {install_line('film')}"
            ) from None
        self._error = Error
        self._thread = ThreadPoolExecutor(1, "playwright")
        self._playwright: Any = None
        self._folder = tempfile.TemporaryDirectory(prefix="harpy_view_", ignore_cleanup_errors=True)
        try:
            html = write_html(runs, Path(self._folder.name) / "replay.html")
            self._url = html.as_uri() + ("" if charts else "#still" if words else "#still&bare")
            self._browser = self._do(self._launch)
            page = self._do(self._load, (640, 400), 1)
            numbers = (
                "[replay.content.runs[0].start, replay.content.duration, "
                "replay.content.moment.time]"
            )
            self._start, self._duration, self._moment = map(float, self._do(page.evaluate, numbers))
            self._do(page.close)
        except BaseException:
            self.close()
            raise

    def pictures(
        self,
        path: str | Path,
        times: Sequence[float] | None = None,
        *,
        size: tuple[int, int] = (1200, 675),
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
        times = [self._start + self._moment] if times is None else times
        moments = [checks.number("time", time) for time in times]
        several = len(moments) > 1
        paths = [
            target.with_stem(f"{target.stem}-{time:g}") if several else target for time in moments
        ]
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
        """Save a film that plays in real time: an animated GIF, for ever, or an MP4 (H.264), by the
        file's ending.

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
            raise InputError(
                f"a film's name must end in {' or '.join(KINDS)}, got '{target}'",
                name="path",
                value=path,
            )
        check_writable(target)
        try:
            import imageio_ffmpeg
        except ImportError:
            raise HarpyError(f"a film needs an encoder: {install_line('film')}") from None
        width, height = kind.size if size is None else size
        size = (width // kind.step * kind.step, height // kind.step * kind.step)
        times = self._clock(begin, end, kind.rate)
        part = Path(self._folder.name) / f"film{target.suffix.lower()}"
        writer: Any = imageio_ffmpeg.write_frames(
            str(part),
            size,
            fps=kind.rate,
            macro_block_size=kind.step,
            ffmpeg_log_level="error",
            **kind.options,
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
        if self._playwright is not None:
            with suppress(self._error):
                self._thread.submit(self._playwright.stop).result()
        self._thread.shutdown()
        self._folder.cleanup()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _clock(self, begin: float | None, end: float | None, rate: float) -> list[float]:
        """Times of the frames of a film, s."""
        last = self._start + self._duration
        first = (
            self._start
            if begin is None
            else checks.number("begin", begin, low=self._start, high=last)
        )
        final = last if end is None else min(checks.number("end", end), last)
        if final <= first:
            raise InputError(
                f"a film must end after its beginning, got {first:g} to {final:g} s", name="end"
            )
        return [first + k / rate for k in range(int((final - first) * rate + 1e-6) + 1)]

    def _images(self, times: Sequence[float], size: tuple[int, int], scale: int) -> Iterator[Image]:
        """Pictures of moments."""
        from PIL import Image

        width, height = (int(checks.number("size", side, low=16, high=8192)) for side in size)
        page = self._do(self._load, (width, height), scale)
        for time in times:
            # The page draws at once; two frames later what it drew is on the screen.
            self._do(
                page.evaluate,
                f"new Promise((done) => {{ replay.show({time - self._start!r});"
                " requestAnimationFrame(() => requestAnimationFrame(() => done(true))); })",
            )
            with Image.open(io.BytesIO(self._do(page.screenshot))) as shot:
                image = shot.convert("RGB")
            if image.size != (width, height):
                image = image.resize((width, height), Image.Resampling.LANCZOS)
            yield image
        self._do(page.close)

    def _launch(self) -> Any:
        from playwright.sync_api import sync_playwright

        self._playwright = sync_playwright().start()
        launch = self._playwright.chromium.launch
        try:
            return launch(args=SWITCHES, handle_sigint=False)
        except self._error:
            return launch(args=SWITCHES, handle_sigint=False, executable_path=find_chromium())

    def _load(self, size: tuple[int, int], scale: float) -> Page:
        """A page of so many pixels, each of which is drawn by ``scale`` squared, with the replay at
        its first moment.

        Raises:
            HarpyError: a script of the page failed.
        """
        viewport = {"width": size[0], "height": size[1]}
        page: Page = self._browser.new_page(
            viewport=viewport, device_scale_factor=scale, offline=True
        )
        page.set_default_timeout(1e3 * TIMEOUT)
        page.goto(self._url)
        page.wait_for_function("document.documentElement.dataset.state !== 'loading'")
        if page.evaluate("document.documentElement.dataset.state") == "fault":
            raise HarpyError(f"Chromium could not show the page: {page.text_content('#fault')}")
        return page

    def _do(self, act: Callable[..., Result], *arguments: Any, **options: Any) -> Result:
        """Call something of Playwright's in its thread."""
        try:
            return self._thread.submit(act, *arguments, **options).result()
        except self._error as error:
            raise HarpyError(f"Chromium: {str(error).strip().partition(chr(10))[0]}") from error
