"""The replay page in a real browser, from disk and without a network: what is seen, scrubbed,
clicked and filmed.
"""

import asyncio
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pages import ATTACKS, make_run
from PIL import Image

from harpy_pin.errors import HarpyError, InputError, install_line
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view import write_html
from harpy_pin.view.page import film as film_module
from harpy_pin.view.page.film import Film

SLIDES = 0.6
"""From this time on the left foot slides whenever it is on the ground, s."""
FPS = 50.0
"""Frames per second of the page."""


@pytest.fixture(scope="module")
def run(robot: Robot) -> Run:
    velocity = np.zeros((1001, 2, 3))
    velocity[round(1e3 * SLIDES) :, 0, 0] = 0.2
    return make_run(robot, foot_velocity=velocity)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory, run: Run, robot: Robot) -> str:
    return write_html(
        [(run, robot)], tmp_path_factory.mktemp("page") / "walk.html", fps=FPS
    ).as_uri()


def show(browser: Any, address: str, *, width: int = 1000, height: int = 640) -> Any:
    """A page at its first moment; ``said`` is what its console complains about, and what it asks
    for.
    """
    viewport = {"width": width, "height": height}
    page = browser.new_page(viewport=viewport, is_mobile=width < 500, offline=True)
    page.set_default_timeout(90e3)
    page.said, page.asked = [], []
    page.on(
        "console",
        lambda said: page.said.append(said.text) if said.type in ("error", "assert") else None,
    )
    page.on("pageerror", lambda error: page.said.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(address)
    page.wait_for_function("document.documentElement.dataset.state !== 'loading'")
    return page


@pytest.fixture(scope="module")
def page(browser: Any, address: str) -> Iterator[Any]:
    """One page, which the tests use one after the other."""
    page = show(browser, address)
    yield page
    assert page.asked == [address]
    assert page.said == []
    page.close()


@pytest.fixture(scope="module")
def film(browser: Any, run: Run, robot: Robot) -> Iterator[Film]:
    """Made beside the running loop of ``browser``, as in a notebook."""
    assert asyncio.get_running_loop()
    with Film([(run, robot)]) as film:
        yield film


def go(page: Any, time: float) -> None:
    """Show a moment, and wait until it is on the screen."""
    page.evaluate(
        f"new Promise((done) => {{ replay.show({time});"
        " requestAnimationFrame(() => requestAnimationFrame(() => done(true))); })"
    )


def place(page: Any, selector: str, share: float = 0.5) -> tuple[float, float]:
    """A point of an element, pixels: at a share of its width, in the middle of its height."""
    box = page.locator(selector).first.bounding_box()
    return box["x"] + share * box["width"], box["y"] + 0.5 * box["height"]


def seen(page: Any) -> np.ndarray[Any, np.dtype[np.int64]]:
    """(rows, columns, 3) pixels of the scene."""
    with Image.open(io.BytesIO(page.locator(".pane").screenshot())) as image:
        return np.asarray(image.convert("RGB"), dtype=np.int64)


def node(path: str) -> str:
    """Script for an object of the scene."""
    parts = ["meshcat", "walk", *path.split("/")]
    return f"replay.scenes[0].viewer.scene_tree.find({parts}).object"


def test_page_loads_nothing_and_opens_paused_at_its_moment(page: Any, address: str) -> None:
    """The first test of the page."""
    assert page.asked == [address]
    assert page.said == []
    assert page.evaluate("document.documentElement.dataset.state") == "paused"
    assert page.evaluate("replay.time") == pytest.approx(
        page.evaluate("replay.content.moment.time")
    )
    assert page.evaluate("replay.time") >= SLIDES
    assert "left foot slides at 200 mm/s" in page.evaluate(
        "document.getElementById('moment').textContent"
    )
    assert page.evaluate("document.querySelectorAll('.chart canvas').length") >= 8


def test_scene_is_not_blank_and_moves(page: Any) -> None:
    go(page, 0.1)
    before = seen(page)
    red, green, blue = np.moveaxis(before, -1, 0)
    assert np.sum((red > 150) & (green < 110) & (blue < 110)) > 300  # the robot's shell
    assert before.reshape(-1, 3).std(axis=0).min() > 10.0
    go(page, 0.5)
    assert np.abs(seen(page) - before).max(axis=2).mean() > 0.5


def test_cone_is_red_where_the_log_says_that_the_foot_slides(page: Any, run: Run) -> None:
    page.evaluate(
        f"{node('robot')}.visible = {node('reference')}.visible = {node('slip')}.visible = false"
    )

    def reddish() -> int:
        red, green, blue = np.moveaxis(seen(page), -1, 0)
        return int(np.sum((red - green > 35) & (np.abs(green - blue) < 30)))

    for time in (0.2, 0.9):
        row = round(1e3 * time)
        assert run["foot_force"][row, 0, 2] > 0.0
        slides = bool(run["foot_velocity"][row, 0, 0] > 0.01)
        assert slides == (time > SLIDES)
        go(page, time)
        for kind, desired in (("sliding", slides), ("sticking", not slides)):
            assert page.evaluate(f"{node('friction_cone/left_foot/' + kind)}.visible") is desired
        assert (reddish() > 200) is slides
        assert (
            "slides"
            in page.evaluate(
                "document.getElementById('key').textContent.split('friction cone')[1]"
            )[:12]
        ) is (slides)
    page.evaluate(
        f"{node('robot')}.visible = {node('reference')}.visible = {node('slip')}.visible = true"
    )


def check_together(page: Any, run: Run, time: float) -> None:
    """Robot, charts, slider, clock and numbers show the frame next to this time."""
    assert page.evaluate("replay.time") == pytest.approx(time, abs=0.5 / FPS + 0.003)
    row = round(1e3 * page.evaluate("replay.time"))
    place = page.evaluate(
        f"(() => {{ const p = {node('robot/root_joint')}.position; return [p.x, p.y, p.z]; }})()"
    )
    np.testing.assert_allclose(place, run["q"][row, :3], atol=0.002)
    slider = page.evaluate("Number(document.getElementById('time').value)")
    assert slider == pytest.approx(page.evaluate("replay.time"), abs=1e-3)
    sideways = page.locator(".chart", has_text="sideways").locator("output").first.text_content()
    frame = round(1e3 * np.floor(page.evaluate("replay.time") * FPS + 1e-3) / FPS)
    assert float(sideways) == pytest.approx(1e3 * run["q"][frame, 1], rel=5e-3, abs=1e-3)
    assert (
        page.evaluate("document.getElementById('clock').textContent")
        == f"{page.evaluate('replay.time'):.2f} s"
    )
    heads = page.evaluate(
        "replay.charts.plots.map((u) => [u.over.querySelector('.head').getBoundingClientRect().left"
        " - u.over.getBoundingClientRect().left, u.valToPos(replay.time, 'x')])"
    )
    assert len(heads) >= 8
    for shown, desired in heads:
        assert shown == pytest.approx(desired, abs=1.5)


def test_scrubbing_moves_robot_and_charts_together(page: Any, run: Run) -> None:
    page.mouse.move(*place(page, "#time", 0.1))
    page.mouse.down()
    for share in (0.3, 0.5, 0.75):
        page.mouse.move(*place(page, "#time", share))
        time = page.evaluate("Number(document.getElementById('time').value)")
        assert time == pytest.approx(share, abs=0.03)
        check_together(page, run, time)
    page.mouse.up()


def test_click_and_drag_on_a_chart_move_the_time(page: Any, run: Run) -> None:
    chart, end = (
        ".chart:nth-of-type(2) .u-over",
        page.evaluate("replay.charts.plots[0].scales.x.max"),
    )
    page.mouse.click(*place(page, chart, 0.25))
    check_together(page, run, 0.25 * end)
    page.mouse.move(*place(page, chart, 0.3))
    page.mouse.down()
    page.mouse.move(*place(page, chart, 0.6))
    check_together(page, run, 0.6 * end)
    page.mouse.up()


def test_all_charts_zoom_together_and_follow_the_time(page: Any, run: Run) -> None:
    go(page, 0.5)
    page.evaluate("document.querySelector('.zoom button').click()")
    spans = page.evaluate("replay.charts.plots.map((u) => [u.scales.x.min, u.scales.x.max])")
    assert len({tuple(span) for span in spans}) == 1
    assert spans[0][0] < 0.5 < spans[0][1]
    assert spans[0][1] - spans[0][0] == pytest.approx(0.5, rel=0.01)
    go(page, 0.95)
    low, high = page.evaluate(
        "[replay.charts.plots[0].scales.x.min, replay.charts.plots[0].scales.x.max]"
    )
    assert low < 0.95 < high
    check_together(page, run, 0.95)
    page.evaluate("document.querySelector('.zoom button:last-child').click()")
    assert (
        page.evaluate("replay.charts.plots[0].scales.x.max - replay.charts.plots[0].scales.x.min")
        > 0.9
    )


def test_playing_goes_on_and_pausing_stops(page: Any) -> None:
    go(page, 0.1)
    page.locator("#play").click()
    assert page.evaluate("document.documentElement.dataset.state") == "playing"
    page.evaluate("new Promise((done) => setTimeout(done, 500))")
    assert page.evaluate("replay.time") != pytest.approx(0.1, abs=0.01)
    page.evaluate("replay.pause()")
    time = page.evaluate("replay.time")
    page.evaluate("new Promise((done) => setTimeout(done, 100))")
    assert page.evaluate("replay.time") == time


LAYOUT = """(() => {
  const names = ["header", "#scenes", "#key", "#scores", "#charts", "#bar"];
  const boxes = {};
  for (const name of names) {
    const b = document.querySelector(name).getBoundingClientRect();
    boxes[name] = [b.left, b.top, b.right, b.bottom];
  }
  const some = "#bar > *, #key > *, .chart p > *, figcaption > *, #scores th, #scores td";
  const words = [...document.querySelectorAll(some)]
    .filter((e) => e.offsetParent !== null)
    .map((e) => e.getBoundingClientRect()).map((b) => [b.left, b.right]);
  const panes = [...document.querySelectorAll(".pane")].map((pane) => {
    const b = pane.getBoundingClientRect();
    let free = 0, all = 0;
    for (let i = 1; i < 10; i++) for (let j = 1; j < 10; j++) {
      const x = b.left + i / 10 * b.width, y = b.top + j / 10 * b.height;
      if (y > document.querySelector("#bar").getBoundingClientRect().top) continue;
      all += 1;
      free += pane.contains(document.elementFromPoint(x, y)) ? 1 : 0;
    }
    return [b.width, b.height, free / all];
  });
  const wide = document.documentElement.scrollWidth;
  return { boxes, words, panes, wide, width: innerWidth, height: innerHeight };
})()"""


def check_layout(page: Any, size: tuple[int, int], runs: int) -> None:
    found = page.evaluate(LAYOUT)
    assert found["wide"] <= found["width"] == size[0]
    # What scrolls is cut by the bar: it goes on below, but is not seen there.
    edge = found["boxes"]["#bar"][1]
    boxes = [(name, b) for name, b in found["boxes"].items() if b[2] > b[0] and b[3] > b[1]]
    for k, (name, one) in enumerate(boxes):
        for other_name, other in boxes[k + 1 :]:
            across = min(one[2], other[2]) - max(one[0], other[0])
            bottoms = [
                b[3] if n in ("#bar", "header") else min(b[3], edge)
                for n, b in ((name, one), (other_name, other))
            ]
            along = min(bottoms) - max(one[1], other[1])
            assert min(across, along) < 1.0, (name, other_name)
    assert found["boxes"]["#bar"][3] <= size[1] + 0.5
    for left, right in found["words"]:
        assert left >= -0.5
        assert right <= size[0] + 0.5
    assert len(found["panes"]) == runs
    for width, height, free in found["panes"]:
        assert min(width, height) > 120
        assert free == 1.0  # nothing lies over the robot
    if size[0] < 500:
        assert found["boxes"]["#charts"][1] >= found["boxes"]["#scenes"][3]


DESK, TABLET, PHONE = (1280, 800), (800, 1100), (390, 844)


def check_layouts(page: Any, runs: int) -> None:
    """On a desk, and in a window that is made narrower."""
    for size in (DESK, TABLET):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        go(page, 0.5)
        check_layout(page, size, runs)


def check_on_a_phone(browser: Any, address: str, runs: int) -> None:
    page = show(browser, address, width=PHONE[0], height=PHONE[1])
    check_layout(page, PHONE, runs)
    page.close()


def test_nothing_overlaps(browser: Any, page: Any, address: str) -> None:
    before = page.viewport_size
    check_layouts(page, 1)
    page.set_viewport_size(before)
    check_on_a_phone(browser, address, 1)


def test_runs_side_by_side_play_in_step_and_nothing_overlaps(
    browser: Any, run: Run, robot: Robot, tmp_path: Path
) -> None:
    short = Run(
        {name: signal[:501] for name, signal in run.signals.items()},
        run.metadata | {"ending": "fell"},
    )
    names = ["long", "short", "long again"]
    path = write_html(
        [(run, robot), (short, robot), (run, robot)], tmp_path / "three.html", names=names
    )
    page = show(browser, path.as_uri(), width=DESK[0], height=DESK[1])
    go(page, 0.8)
    places = [
        page.evaluate(f"{node('robot/root_joint').replace('scenes[0]', f'scenes[{k}]')}.position.x")
        for k in range(3)
    ]
    np.testing.assert_allclose(places, [0.3 * 0.8, 0.3 * 0.5, 0.3 * 0.8], atol=0.002)
    captions = page.evaluate(
        "[...document.querySelectorAll('figcaption')].map((c) => c.textContent)"
    )
    assert captions[0].startswith("long")
    assert captions[1] == "shortfell"
    rows = page.evaluate("[...document.querySelectorAll('#scores tr')].map((r) => r.textContent)")
    assert any("walked to the end" in row and "fell at 0.50 s" in row for row in rows)
    check_layouts(page, 3)
    page.close()
    check_on_a_phone(browser, path.as_uri(), 3)


def test_text_of_a_log_stays_text(browser: Any, robot: Robot, tmp_path: Path) -> None:
    """Of every name and entry that a page shows; half a surrogate pair is shown as �."""
    attack = " ".join(ATTACKS)
    metadata = {
        "ending": attack,
        "robot": attack,
        "controller": attack,
        "scenario": {"controller": attack, "governor": attack},
        "parameters": {"governor": attack, "gait": {attack: attack, "speed": 0.3}},
        "ground": {"mu_s": 0.25, "cone": attack},
        attack: attack,
    }
    bad = make_run(robot, 100, metadata=metadata, **{attack: np.zeros(100)})
    for runs, names, shown in (
        ([bad] * 2, [attack, attack + "2"], "figcaption"),
        ([bad], None, "#facts"),
    ):
        path = write_html([(run, robot) for run in runs], tmp_path / "page.html", names=names)
        page = show(browser, path.as_uri())
        assert attack.replace("\ud800", "\ufffd") in page.locator(
            shown
        ).first.text_content().replace("\ud800", "\ufffd")
        assert page.locator("img, header b b").count() == 0
        assert page.locator("script").count() == 5
        assert page.said == []
        page.close()


def test_fault_in_a_page_is_reported(
    browser: Any, run: Run, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(runs: Any, path: Path) -> Path:
        page = write_html(runs, path)
        page.write_text(page.read_text().replace("\nstart();", "\nnonsense();"))
        return page

    monkeypatch.setattr(film_module, "write_html", broken)
    with pytest.raises(HarpyError, match=r"could not show the page: .*nonsense"):
        Film([(run, robot)])


def test_pictures_and_films(film: Film, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = film.pictures(tmp_path / "walk.png", [0.2, 0.9], size=(300, 200))
    assert [path.name for path in pictures] == ["walk-0.2.png", "walk-0.9.png"]
    images = [np.asarray(Image.open(path).convert("RGB"), dtype=int) for path in pictures]
    assert all(image.shape == (200, 300, 3) for image in images)
    assert np.abs(images[0] - images[1]).mean() > 0.5
    (alone,) = film.pictures(tmp_path / "moment.png", size=(300, 200))
    assert alone == tmp_path / "moment.png"
    with Image.open(film.save(tmp_path / "walk.gif", begin=0.2, end=0.6, size=(200, 200))) as gif:
        assert (gif.size, gif.n_frames, gif.info["duration"], gif.info["loop"]) == (
            (200, 200),
            6,
            80,
            0,
        )
    with pytest.raises(InputError, match="end after its beginning"):
        film.save(tmp_path / "none.gif", begin=0.5, end=0.5)
    assert not (tmp_path / "none.gif").exists()
    encoder = pytest.importorskip("imageio_ffmpeg")
    path = film.save(tmp_path / "walk.mp4", begin=0.0, end=0.2, size=(201, 161))
    about = next(encoder.read_frames(str(path)))
    assert (about["codec"], about["size"], about["fps"]) == ("h264", (200, 160), 25.0)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(HarpyError, match=re.escape(install_line("film"))):
        film.save(tmp_path / "walk.mp4")


def test_no_browser_is_a_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run, robot: Robot
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    with pytest.raises(HarpyError, match="no Chromium on PATH"):
        Film([(run, robot)])


def test_no_playwright_is_a_clear_error(
    monkeypatch: pytest.MonkeyPatch, run: Run, robot: Robot
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "playwright.sync_api", None)
    with pytest.raises(HarpyError, match=re.escape(install_line("film"))):
        Film([(run, robot)])


def test_long_walk_is_a_small_page(robot: Robot, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = 20_001
    noise = {
        "foot_force": rng.normal(size=(rows, 2, 3)) * 9.0 + (0.0, 0.0, 20.0),
        "tick_ns": rng.integers(5_000, 20_000, rows),
    }
    run = make_run(robot, rows, **noise, desired_force=rng.normal(size=(rows, 2, 3)))
    assert write_html([(run, robot)], tmp_path / "walk.html", fps=50.0).stat().st_size < 6e6
