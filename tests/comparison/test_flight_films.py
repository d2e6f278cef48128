"""The page of films: what captions say, and that the page shows them on any screen, without a network."""

import pytest

from comparison.report.flight_films import FILMS, caption, film_flights
from comparison.studies.flights import FLIGHTS
from harpy_pin.errors import RunFileError

REACHED = {"stands": True, "height_m": 0.312, "distance_m": 0.423, "hover_mm": None, "peak": 1.38}
COST = {"energy_j": 2700.0, "power_w": 812.0, "cost": 163.0}


def test_captions_say_what_was_reached():
    assert FILMS.keys() <= FLIGHTS.keys()
    assert caption("jump 0.4 m", REACHED | COST) == [
        "0.31 m high, 0.42 m far",
        "163 J per newton and metre",
        "812 W",
        "peak load 1.4 × weight",
    ]
    assert caption("walk", REACHED | COST)[0] == "0.42 m far"
    assert caption("hover 10 s", REACHED | COST | {"hover_mm": 2.4, "cost": None})[:2] == [
        "hovers within 2.4 mm",
        "812 W",
    ]
    assert caption("walk without thrust", {"stands": False, "fell_s": 0.552}) == ["falls after 0.55 s"]


def test_the_page_is_whole_and_fits_a_phone(browser, tmp_path):
    path, told, complaints = tmp_path / "films.html", [], []
    film_flights(path, ("walk without thrust",), lambda *done: told.append(done))
    assert told == [(1, 1)]
    page = browser.new_page()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if request.url.startswith("http") else None)
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 800})
        page.goto(path.as_uri())
        assert page.evaluate("document.querySelector('img').decode().then(() => true)")
        assert page.evaluate("document.querySelector('img').naturalWidth") == 360
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert "falls after" in page.text_content("body")
    assert not complaints


def test_a_page_that_cannot_be_written_is_refused_before_work(tmp_path):
    with pytest.raises(RunFileError):
        film_flights(tmp_path / "none" / "films.html")
