"""A page of films: each manoeuvre once, with what it reached."""

from __future__ import annotations

import base64
import io
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image, ImageSequence

from comparison.measure.walking import Progress, silent, tracked
from comparison.studies.flights import FIRST_SEED, FLIGHTS, FRICTION, flown
from comparison.tables import number_text
from harpy_pin.files import check_writable, replacing
from harpy_pin.log.run import Run
from harpy_pin.view.page.film import KINDS, Film

FILMS = {
    "walk without thrust": "Walk without thrust",
    "walk": "Walk with thrust",
    "jump 0.4 m": "Jump",
    "hover 10 s": "Hover",
    "fly 2 m, walk on": "Flight of 2 m",
    "fly 2 m to 15° up, walk on": "Landing on 15°",
    "half a fan, found": "Half a fan lost, and found",
}
"""Titles of the films, by the names of :data:`~comparison.studies.flights.FLIGHTS`."""
LONGEST = 9.0
"""Of a film, s."""
SIZE = (360, 300)
"""Pixels."""
QUALITY = 60
"""Of the pictures, of 100."""
LAST = 1500
"""For how long the last one is shown, ms."""


def film_flights(path: Path, names: Sequence[str] = tuple(FILMS), progress: Progress = silent) -> None:
    """Film manoeuvres under the condensed controller, and save the page.

    Args:
        path: of the page.
        names: of :data:`FILMS`.
        progress: is told how many are done.

    Raises:
        RunFileError: the page cannot be written.
        HarpyError: no Chromium on PATH.
    """
    check_writable(path)
    films = []
    for name in tracked(names, progress):
        run, measures = flown({"flight": name, "controller": "condensed", "plant": "compliant", "seed": FIRST_SEED})
        films.append({"title": FILMS[name], "caption": caption(name, measures), "source": _filmed(run)})
    folder = FileSystemLoader(Path(__file__).parent)
    environment = Environment(loader=folder, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    page = environment.get_template("flight_films.html.j2").render(
        films=films, friction=FRICTION, width=SIZE[0], height=SIZE[1]
    )
    with replacing(path) as file:
        file.write(page.encode())


def caption(name: str, measures: Mapping[str, Any]) -> list[str]:
    """What a try reached, what it cost, and how hard it landed.

    Args:
        name: of :data:`~comparison.studies.flights.FLIGHTS`.
        measures: of the try.
    """
    if not measures["stands"]:
        return [f"falls after {number_text(measures['fell_s'], 2)} s"]
    flight = FLIGHTS[name].flight
    found = []
    if flight is not None and measures["hover_mm"] is not None and flight.forward == 0.0:
        found.append(f"hovers within {number_text(measures['hover_mm'], 2)} mm")
    else:
        high = f"{number_text(measures['height_m'], 2)} m high, " if flight is not None else ""
        found.append(f"{high}{number_text(measures['distance_m'], 2)} m far")
    if measures["cost"] is not None:
        found.append(f"{number_text(measures['cost'], 2)} J per newton and metre")
    return [
        *found,
        f"{number_text(measures['power_w'], 2)} W",
        f"peak load {number_text(measures['peak'], 2)} × weight",
    ]


def _filmed(run: Run) -> str:
    """The film of a run, as an address that holds it: WebP takes a seventh of GIF."""
    with tempfile.TemporaryDirectory() as folder, Film(run, words=False) as film:
        path = film.save(Path(folder) / "film.gif", end=float(run["t"][0]) + LONGEST, size=SIZE)
        packed = io.BytesIO()
        with Image.open(path) as frames:
            images = [image.copy() for image in ImageSequence.Iterator(frames)]
            times = [round(1e3 / KINDS[".gif"].rate)] * (len(images) - 1) + [LAST]
        images[0].save(packed, "WEBP", save_all=True, append_images=images[1:], quality=QUALITY, duration=times, loop=0)
    return f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"
