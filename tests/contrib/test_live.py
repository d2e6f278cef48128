"""Live: the page's server against garbage, and the page itself in headless
Chromium.
"""

import io
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_client import CAMERA, connected
from needs import needs_robots
from PIL import Image

import harpy_pin as hp
from harpy_pin.contrib.live.drive import Drive
from harpy_pin.contrib.live.settings import LiveSettings
from harpy_pin.files import journal_path
from harpy_pin.log.run import Run

viser = pytest.importorskip("viser", reason="viser is an extra")
msgspec = pytest.importorskip("msgspec", reason="viser brings it")
LOOPBACK = ("127.0.0.1", 0)
COARSE = "?fixedDpr=0.4"
"""Few pixels, since they are drawn by software."""
PATIENCE = 600.0
"""For what a browser with software rendering does, s; nothing measures it."""


@pytest.fixture(scope="module")
def drive(robot: hp.Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drive]:
    """A robot that is driven, in a thread."""
    save = tmp_path_factory.mktemp("live") / "drive.npz"
    drive = Drive(LiveSettings(forward=0.2, friction=0.6), robot=robot, save=save, address=LOOPBACK)
    thread = threading.Thread(target=drive.run)
    thread.start()
    try:
        yield drive
    finally:
        drive.stop()
        thread.join(PATIENCE)
    assert not thread.is_alive()
    assert drive.session.ending == ""
    run = Run.load(save)
    assert len(run) == drive.session.ticks


def soon(true: Callable[[], Any]) -> None:
    """Wait until something holds."""
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def port_of(drive: Drive) -> int:
    return int(drive.url.rstrip("/").rpartition(":")[2])


def ask(drive: Drive, *headers: str) -> bytes:
    """First line of what the server answers to a request with these headers."""
    with socket.create_connection(("127.0.0.1", port_of(drive)), timeout=600) as connection:
        connection.sendall(
            "\r\n".join(("GET / HTTP/1.1", *headers, "Connection: close", "", "")).encode()
        )
        return connection.recv(4096).split(b"\r\n")[0]


def test_only_this_machine_is_served(drive: Drive) -> None:
    assert drive.url.startswith("http://127.0.0.1:")
    assert b" 200 " in ask(drive, f"Host: 127.0.0.1:{port_of(drive)}")
    with pytest.raises(ConnectionRefusedError):  # by another address of the machine
        socket.create_connection(("127.0.0.2", port_of(drive)))


def test_garbage_does_not_kill_the_server(drive: Drive, fuzz: int) -> None:
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    rng = np.random.default_rng(7)
    odd: list[Any] = [
        None,
        1,
        "x",
        [],
        {},
        {"type": "none"},
        {"type": 3},
        {"type": "GuiUpdateMessage"},
    ]
    odd += [
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": update}
        for update in (None, {"value": 1}, 7)
    ]
    odd += [
        {"type": name}
        for name in ("ViewerCameraMessage", "ShareUrlRequest", "FileTransferStartUpload", "Message")
    ]
    messages: list[bytes | str] = [msgspec.msgpack.encode(value) for value in odd]
    messages += [rng.bytes(int(size)) for size in rng.integers(0, 300, 20 * fuzz)]
    messages += ["text", b"", b"\xc1", b"\x00" * 100_000]
    settings = drive.session.settings
    for message in messages:
        with connected(drive.url) as page:
            try:
                page.send(message)
                page.recv(timeout=0.02)
            except (ConnectionClosed, TimeoutError):
                pass
    another_version = connect(drive.url.replace("http", "ws"))
    with another_version as page, pytest.raises(ConnectionClosed):
        page.recv(timeout=PATIENCE)
    with socket.create_connection(("127.0.0.1", port_of(drive))) as connection:
        connection.sendall(rng.bytes(5000))
    assert b" 200 " in ask(drive, f"Host: 127.0.0.1:{port_of(drive)}")
    assert drive.session.settings == settings
    soon(lambda: not drive.viewers)


def open_page(
    browser: Any, drive: Drive, complaints: list[str], *, shows: str, width: int = 780
) -> Any:
    """The page, once it shows a text; what it complains about, and addresses elsewhere that it asks
    for, are kept.
    """
    page = browser.new_page(viewport={"width": width, "height": 480})
    page.set_default_timeout(1e3 * PATIENCE)
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "request",
        lambda request: complaints.append(request.url) if is_foreign(request.url, drive) else None,
    )
    page.goto(drive.url + COARSE)
    page.get_by_text(shows).first.wait_for()
    return page


def is_foreign(url: str, drive: Drive) -> bool:
    return not url.startswith((drive.url, drive.url.replace("http", "ws"), "data:", "blob:"))


def number_of(page: Any, label: str) -> Any:
    """The field of numbers beside a slider."""
    above = "ancestor::div[contains(@class,'mantine-Flex-root')][1]"
    row = f"xpath=//label[normalize-space(.)='{label}']/{above}"
    return page.locator(f"{row}//input[@inputmode='decimal']")


def leave_field(page: Any) -> None:
    """Keys go to the page, not to a field."""
    page.evaluate("document.activeElement.blur()")


def test_page_drives(browser: Any, drive: Drive) -> None:
    session, complaints = drive.session, list[str]()
    page = open_page(browser, drive, complaints, shows="condensed controller")
    soon(lambda: drive.viewers == 1)

    number_of(page, "Forward, m/s").fill("0.3")
    page.keyboard.press("Enter")
    soon(lambda: session.settings.forward == 0.3)
    leave_field(page)
    page.keyboard.press("a")
    page.keyboard.press("ArrowUp")
    soon(lambda: session.settings.turning == 0.2 and session.settings.forward == 0.4)
    soon(lambda: session.gait.applied[2] > 0.1)  # it turns
    page.keyboard.press("x")
    soon(lambda: session.settings.turning == session.settings.forward == 0.0)
    soon(lambda: number_of(page, "Forward, m/s").input_value() == "0")

    page.get_by_role("tab", name="Ground").click()
    number_of(page, "Friction").fill("0.4")
    page.keyboard.press("Enter")
    soon(lambda: session.simulator.ground.mu_s == 0.4)
    page.get_by_role("button", name="Friction strip ahead").click()
    soon(lambda: session.simulator.ground.friction_strips)
    page.get_by_role("button", name="No friction strip").click()
    soon(lambda: not session.simulator.ground.friction_strips)
    number_of(page, "Slope, °").fill("4")
    page.keyboard.press("Enter")
    soon(lambda: session.plane.slope == pytest.approx(np.radians(4.0)))

    page.get_by_role("tab", name="Control").click()
    page.get_by_role("combobox").filter(visible=True).first.click()
    page.get_by_role("option", name="whole-body QP").click()
    soon(lambda: type(session.controller).__name__ == "WholeBodyController")
    page.get_by_text("whole-body QP").first.wait_for()

    pushed = list[float]()
    keep, session.on_tick = session.on_tick, None

    def note(tick: Any) -> None:
        pushed.append(float(tick.push[1]))
        assert keep is not None
        keep(tick)

    session.on_tick = note
    page.get_by_role("tab", name="Push").click()
    page.get_by_role("button", name="left").click()
    soon(lambda: max(pushed, default=0.0) > 1.0)
    soon(lambda: pushed[-1] == 0.0)
    session.on_tick = keep

    leave_field(page)
    page.keyboard.press("p")
    soon(lambda: session.paused)
    page.get_by_text("Paused").first.wait_for()
    ticks = session.ticks
    page.keyboard.press("n")
    soon(lambda: session.ticks == ticks + 10)
    picture = page.locator("canvas").first.screenshot()
    assert colours(picture) > 500  # a blank scene has a handful
    page.keyboard.press("p")
    soon(lambda: not session.paused)
    assert not session.ending

    page.keyboard.press("w")
    soon(lambda: session.settings.forward == 0.1)
    with connected(drive.url) as another:
        another.send(msgspec.msgpack.encode(CAMERA))
        soon(lambda: drive.viewers == 2)
    soon(lambda: drive.viewers == 1)
    page.close()
    soon(lambda: drive.viewers == 0)
    ticks = session.ticks
    soon(lambda: session.ticks > ticks + 50)  # the walk does not care
    # Who comes back finds all as it was.
    page = open_page(browser, drive, complaints, shows="whole-body QP", width=390)
    soon(lambda: drive.viewers == 1)
    soon(lambda: number_of(page, "Forward, m/s").input_value() == "0.1")
    page.keyboard.press("w")
    soon(lambda: session.settings.forward == 0.2)
    page.close()
    soon(lambda: drive.viewers == 0)
    assert not complaints


@needs_robots
def test_page_of_another_robot(browser: Any) -> None:
    """As wide as a phone: buttons and keys of the schedules, and the robot in the picture."""
    drive = Drive(robot=hp.load_robot("go2"), address=LOOPBACK)
    thread = threading.Thread(target=drive.run)
    thread.start()
    session, complaints = drive.session, list[str]()
    try:
        page = open_page(browser, drive, complaints, shows="trot", width=390)
        number_of(page, "Forward, m/s").fill("0.4")
        page.keyboard.press("Enter")
        soon(lambda: session.settings.forward == 0.4)
        page.get_by_role("button", name="crawl").click()
        soon(lambda: session.gait.schedule == "crawl")  # type: ignore[union-attr]
        leave_field(page)
        page.keyboard.press("1")
        soon(lambda: session.gait.schedule == "trot")  # type: ignore[union-attr]
        page.keyboard.press("p")
        soon(lambda: session.paused)
        assert (
            colours(page.locator("canvas").first.screenshot()) > 500
        )  # a blank scene has a handful
        page.close()
    finally:
        drive.stop()
        thread.join(PATIENCE)
    assert not complaints
    assert not session.ending


def colours(picture: bytes) -> int:
    with Image.open(io.BytesIO(picture)) as image:
        return len(np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0))


def test_command_ends_with_its_log(tmp_path: Path) -> None:
    """By SIGTERM, in a process of its own."""
    root = str(Path(__file__).resolve().parents[2])
    command = [sys.executable, "-m", "harpy_pin", "live", "--no-browser", "--speed", "0.2"]
    save, numbers = tmp_path / "drive.npz", tmp_path / "times.json"
    arguments = [*command, "--save", str(save), "--json", str(numbers)]
    running = subprocess.Popen(
        arguments, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout is not None
    assert "http://127.0.0.1:" in running.stdout.readline()  # while controllers are compiled
    assert running.stdout.readline().startswith("drive harpy: http://127.0.0.1:")
    journal = journal_path(save)
    soon(lambda: journal.exists() and journal.stat().st_size > 100_000)  # a second of it
    running.send_signal(signal.SIGTERM)
    out, err = running.communicate(timeout=PATIENCE)
    assert (running.returncode, err) == (143, "")
    ticks = len(Run.load(save))
    assert ticks > 100
    assert str(save) in out
    assert json.loads(numbers.read_text())["tick_us"]["0"]["ticks"] == ticks
