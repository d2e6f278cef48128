"""Logs and requests from strangers: no text becomes markup, and the server answers this machine alone."""

from __future__ import annotations

import contextlib
import socket
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pages import ATTACKS, make_run

from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view import ReplayServer, replay_html, write_html


@pytest.fixture(scope="module")
def run(robot: Robot) -> Run:
    return make_run(robot)


def test_no_text_of_a_log_becomes_markup(robot: Robot, run: Run, tmp_path: Path) -> None:
    harmless = replay_html(make_run(robot, 20), robot)
    for attack in ATTACKS:
        metadata = {
            "ending": attack,
            "robot": attack,
            "controller": attack,
            "parameters": {"governor": attack, "gait": {attack: attack, "speed": 0.3}},
            "ground": {"mu_s": 0.25, "cone": attack},
            attack: attack,
        }
        bad = make_run(robot, 20, metadata=metadata, **{attack: np.zeros(20)})
        text = write_html(bad, robot, tmp_path / "page.html").read_text(encoding="utf-8")
        for piece in ("<script", "</script", "<img", "onerror=attack"):
            escaped = text.count("&#x27;&gt;&lt;img src=x onerror=attack") if piece.startswith("onerror") else 0
            assert text.count(piece) - escaped == harmless.count(piece)
        scripts = text.partition("</style>")[2].split("<script>")[1:]
        assert len(scripts) == 5
        assert not any("attack" in script.partition("</script>")[0] for script in scripts)


@pytest.mark.parametrize("name", ["t", "q", "foot_force", "thrust", "torque", "x_r"])
def test_signals_of_other_kinds_are_refused(robot: Robot, name: str) -> None:
    signal = make_run(robot, 20)[name]
    for strange in (np.full(signal.shape, "x"), signal.astype(complex), np.zeros((20, 2, 2, 2))):
        strange_run = make_run(robot, 20, **{name: strange})
        with pytest.raises(InputError):
            replay_html(strange_run, robot)


def test_metadata_and_times_of_other_kinds_are_refused(robot: Robot) -> None:
    for metadata in (
        {"ground": "x"},
        {"parameters": [1]},
        {"parameters": {"gait": 3}},
        {"feet": 3},
        {"control_period": "x"},
    ):
        with pytest.raises(InputError, match="metadata"):
            replay_html(make_run(robot, 20, metadata=metadata), robot)
    with pytest.raises(InputError, match="times"):
        replay_html(make_run(robot, 20, t=np.linspace(0.0, 1e8, 20)), robot)


def ask(server: ReplayServer, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", int(server.url.rstrip("/").rsplit(":", 1)[1])), timeout=10) as line:
        line.sendall(request)
        with contextlib.suppress(OSError):  # the server may have hung up on nonsense already
            line.shutdown(socket.SHUT_WR)
        answer = b""
        try:
            while piece := line.recv(65536):
                answer += piece
        except ConnectionResetError:
            pass
        return answer


def test_only_this_machine_is_answered(capfd: pytest.CaptureFixture[str]) -> None:
    with ReplayServer("<p>page</p>") as server:
        for host in ("localhost", "127.0.0.1:80", "[::1]:9000", "LOCALHOST:1"):
            assert b"<p>page</p>" in ask(server, f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        for host in (
            "evil.example",
            "localhost.evil.example",
            "127.0.0.1.nip.io",
            "localhost@evil",
            "",
            "[::1",
            "0.0.0.0",
        ):
            answer = ask(server, f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            assert answer.startswith(b"HTTP/1.0 403")
            assert b"page</p>" not in answer
        assert b"403" in ask(server, b"GET / HTTP/1.0\r\n\r\n")
        assert b"404" in ask(server, b"GET /../../etc/hostname HTTP/1.0\r\nHost: localhost\r\n\r\n")
    assert capfd.readouterr().err == ""


def test_nonsense_and_closed_tabs_leave_the_server_alive(capfd: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(5)
    good = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with ReplayServer("x" * 5_000_000) as server:
        port = int(server.url.rstrip("/").rsplit(":", 1)[1])
        requests = [b"", b"\r\n" * 50, b"GET", b"GET / HTTP/9.9\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n", b"G" * 100_000]
        requests += [
            b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 500 + b"\r\n",
            b"GET /<script> HTTP/1.1\r\nHost: \xff\r\n\r\n",
        ]
        for _ in range(100):
            noise = bytearray(good)
            for at in rng.integers(0, len(good), 4):
                noise[at] = rng.integers(0, 256)
            requests.append(bytes(noise))
        for request in requests:
            assert b"<script>" not in ask(server, request)
        for _ in range(5):  # tabs that are closed while the page is on its way
            line = socket.create_connection(("127.0.0.1", port))
            line.sendall(good)
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.close()
        assert ask(server, good).endswith(b"x" * 1000)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("port", [70000, -1, 80.5, True])
def test_no_such_port(port: Any) -> None:
    with pytest.raises(InputError, match="port"):
        ReplayServer("", port=port)
