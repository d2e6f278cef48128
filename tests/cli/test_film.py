"""The command that films a walk."""

from __future__ import annotations

import sys

import pytest
from needs import needs_robots

from harpy_pin.cli.app import main
from harpy_pin.errors import HarpyError
from harpy_pin.view.page.chromium import find_chromium

SMALL = ("--duration", "1", "--size", "200x150")


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["harpy", "film", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


@needs_robots
def test_film_of_a_robot(tmp_path, monkeypatch):
    try:
        find_chromium()
    except HarpyError as missing:
        pytest.skip(str(missing))
    from PIL import Image

    path = tmp_path / "dog.gif"
    code = run(
        monkeypatch,
        str(path),
        "--robot",
        "Solo",
        "--set",
        "gait.schedule=crawl",
        "--duration",
        "1",
        "--size",
        "200x150",
    )
    assert not code
    with Image.open(path) as film:
        assert film.size == (200, 150)
        assert film.n_frames >= 6


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["dog.avi"], ".gif"),
        (["dog.gif", "--robot", "go9"], "did you mean"),
        (["dog.gif", "--duration", "0.1"], "duration"),
        (["dog.gif", "--size", "big"], "--size"),
        (["dog.gif", "--set", "gait.velocity=fast"], "velocity"),
        (["dog.gif", "--robot", "harpy", "--set", "gait.schedule=trot"], "schedule"),
    ],
)
def test_what_is_refused_in_one_line(words, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *words) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert said.count("\n") == 1
