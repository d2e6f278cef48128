"""What a page may send for its controls, and where its camera is put."""

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from live_client import CAMERA, connected

import harpy_pin as hp
from harpy_pin.contrib.live.drive import WISHES
from harpy_pin.contrib.live.live_page import EYE, MIDDLE, followed
from harpy_pin.contrib.live.live_session import LiveSession

pytest.importorskip("viser", reason="viser is an extra")
msgspec = pytest.importorskip("msgspec", reason="viser brings it")


class Page:
    """A page whose session takes nothing by itself: what it says is kept."""

    def __init__(self, robot: hp.Robot) -> None:
        from harpy_pin.contrib.live.live_page import LivePage

        self.session = LiveSession(robot=robot)
        self.page = LivePage("127.0.0.1", 0, self.session)
        self.url, self.panel = self.page.url, self.page._panel
        self.controls = dict(self.page.server.gui._gui_input_handle_from_uuid)

    def said(self) -> list[Any]:
        """What it has said to the session since the last time."""
        said = []
        while not self.page.wishes.empty():
            said.append(self.page.wishes.get())
        return said


@pytest.fixture(scope="module")
def page(robot: hp.Robot) -> Iterator[Page]:
    page = Page(robot)
    yield page
    page.page.close()


def send(
    page: Page, messages: list[dict[str, Any]], *, camera: dict[str, Any] | None = None
) -> None:
    """As one page, and wait until all of it was taken."""
    with connected(page.url) as browser:
        for message in (camera or CAMERA, *messages):
            browser.send(msgspec.msgpack.encode(message))
        time.sleep(0.2)


def wait_until(holds: Callable[[], object], seconds: float = 60.0) -> None:
    """The server has threads of its own, which a busy machine keeps waiting."""
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.02)


def update(uuid: str, value: Any) -> dict[str, Any]:
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def test_values_that_are_no_option_are_refused(
    page: Page, capfd: pytest.CaptureFixture[str], fuzz: int
) -> None:
    """The session refuses them in a sentence, or they are settings all the same; nothing prints a
    traceback.
    """
    rng = np.random.default_rng(3)
    odd: list[Any] = [None, "x", "", [], {}, [1, 2], {"a": 1}, float("nan"), float("inf")]
    odd += [-1e308, 1e308, 2**63 - 1, b"\x00", "1e5", "real time\n", -1, 3.5, "x" * 5000]
    odd += [float(value) for value in rng.standard_cauchy(5 * fuzz) * 1e3]
    assert {type(handle).__name__ for handle in page.controls.values()} >= {
        "GuiDropdownHandle",
        "GuiButtonGroupHandle",
        "GuiSliderHandle",
        "GuiCheckboxHandle",
    }
    session, refused = page.session, 0
    for uuid in page.controls:
        send(page, [update(uuid, value) for value in odd])
        for kind, value in page.said():
            try:
                WISHES[kind](session, value)
            except hp.errors.InputError:
                refused += 1
    assert refused > 50
    assert session.settings == replace(session.settings)  # which checks them once more
    standing = {"settings": asdict(session.settings), "paused": False, "ending": "", "busy": ""}
    page.page.take({**standing, "note": "", "refused": True})
    for name, handle in page.panel._handles.items():
        assert handle.value == page.panel._shown[name](getattr(session.settings, name)), name
    printed = capfd.readouterr()
    assert "Traceback" not in printed.err + printed.out
    assert "exception" not in printed.err


def test_what_controls_have_is_taken(page: Page) -> None:
    pace, walk = (
        next(
            uuid for uuid, handle in page.controls.items() if getattr(handle, "label", "") == label
        )
        for label in ("Pace", "Step")
    )
    friction = page.panel._handles["friction"]._impl.uuid
    send(page, [update(pace, "1/2"), update(walk, "10 ms"), update(friction, 0.4)])
    said: list[Any] = []
    wait_until(lambda: said.extend(page.said()) or len(said) == 3)
    assert len(said) == 3
    for word in (
        ("change", {"pace": 0.5}),
        ("step", 10),
        ("change", {"friction": 0.4}),
    ):  # from threads of their own
        assert word in said


@pytest.mark.filterwarnings("ignore:.viser.:UserWarning")
def test_drags_that_are_none_are_refused(page: Page, capfd: pytest.CaptureFixture[str]) -> None:
    node = page.page._scene.handles[0].name
    drag = {
        "type": "SceneNodeDragMessage",
        "phase": "start",
        "name": node,
        "instance_index": None,
        "start_screen_pos": [0.0, 0.0],
        "end_screen_pos": [0.0, 0.0],
        "button": "left",
        "modifier": None,
    }
    for place in ([], [1.0], [float("nan")] * 3):
        page.panel._standing |= {"note": "", "refused": False}
        send(page, [{**drag, "start_position": place, "end_position": place}])
        wait_until(lambda: page.panel.note)
        assert page.page._grip is None
        assert page.panel.note, place
    assert "Traceback" not in capfd.readouterr().err


def test_the_camera_follows() -> None:
    """Wherever the keys have moved it, it looks at the robot again, from the same side and
    distance.
    """
    eye, middle = np.array(EYE), np.array(MIDDLE)
    assert followed(eye, middle, middle) is None
    for move in ([3.0, 0.0, 0.0], [0.0, -40.0, 0.0], [0.0, 0.0, 7.0]):
        place = followed(eye + move, middle + move, middle)
        assert place is not None
        np.testing.assert_allclose(place, eye, atol=1e-12)
    for below in (-0.5, -1.5):  # under the ground, and straight below
        away = np.array([np.cos(below), 0.0, np.sin(below)]) * 2.0
        place = followed(middle + away, middle, middle)
        assert place is not None
        assert place[2] > middle[2]
        assert np.linalg.norm(place - middle) == pytest.approx(2.0)
    place = followed(middle + np.array([0.0, 0.0, 2.0]), middle, middle)
    assert place is not None
    assert np.hypot(*(place - middle)[:2]) > 0.1
    assert followed(place, middle, middle) is None


@pytest.mark.parametrize("follows", [True, False])
def test_a_page_whose_keys_move_the_camera_gets_it_back(page: Page, follows: bool) -> None:
    """As a minute of driving moves it, and from the distance of its driver; unless the driver does
    not want that.
    """
    middle, away, twice = (
        np.array(MIDDLE),
        np.array([40.0, 0.0, 0.0]),
        2.0 * (np.array(EYE) - MIDDLE),
    )
    moved = {
        **CAMERA,
        "position": (middle + away + twice).tolist(),
        "look_at": (middle + away).tolist(),
    }
    assert page.panel.follows
    page.panel._follows.value = follows
    wait_until(lambda: not page.page.server.get_clients())  # those of tests before have gone
    with connected(page.url) as browser:
        browser.send(msgspec.msgpack.encode(CAMERA))
        wait_until(page.page.server.get_clients)
        (client,) = page.page.server.get_clients().values()
        wait_until(lambda: client.camera._state.camera_cb)
        browser.send(msgspec.msgpack.encode(moved))
        expected = middle + twice + (not follows) * away
        wait_until(lambda: np.allclose(client.camera.position, expected))
        np.testing.assert_allclose(client.camera.position, expected)
    page.panel._follows.value = True


ODD_CAMERAS: list[dict[str, Any]] = [
    {"image_height": 0, "image_width": 0},
    {"position": [float("nan")] * 3, "wxyz": [float("nan")] * 4},
    {"position": [float("inf")] * 3, "look_at": [float("-inf")] * 3},
    {"position": [], "look_at": [1.0]},
    {"position": [0.0] * 3, "look_at": [0.0] * 3, "up_direction": [0.0] * 3, "wxyz": [0.0] * 4},
    {"position": [1e308] * 3, "look_at": [-1e308] * 3},
]


@pytest.mark.filterwarnings("ignore:.viser.:UserWarning", "ignore::RuntimeWarning")
@pytest.mark.parametrize("odd", ODD_CAMERAS, ids=str)
def test_cameras_that_are_nowhere_print_nothing(
    page: Page, capfd: pytest.CaptureFixture[str], odd: Any
) -> None:
    turned = {**CAMERA, **odd, "fov": 0.8}
    send(page, [{**CAMERA, **odd}, CAMERA, turned], camera={**CAMERA, **odd})
    send(page, [turned, CAMERA, turned])
    printed = capfd.readouterr()
    assert "Traceback" not in printed.err + printed.out
    nowhere = {"position": EYE, "look_at": MIDDLE} | odd
    place = followed(np.array(nowhere["position"]), np.array(nowhere["look_at"]), np.array(MIDDLE))
    assert place is None or np.linalg.norm(place - MIDDLE) == pytest.approx(
        np.linalg.norm(np.subtract(EYE, MIDDLE))
    )
