"""Commands that are refused, interrupted or killed: one clear line, and nothing that looks whole and is not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import ROOT

import harpy_pin as hp
from harpy_pin.cli import walk as walk_command


def truncated_urdf(tmp_path):
    path = tmp_path / "cut.urdf"
    text = (ROOT / "urdf" / "harpy.urdf").read_text()
    path.write_text(text[: len(text) // 2])
    return path


def footless_urdf(tmp_path):
    path = tmp_path / "footless.urdf"
    path.write_text((ROOT / "urdf" / "harpy.urdf").read_text().replace("_foot", "_paw"))
    return path


def corrupted_log(tmp_path):
    path = tmp_path / "bad.npz"
    path.write_bytes(b"PK\x03\x04" + bytes(range(256)) * 4)
    return path


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (lambda p: ("walk", "--set", f"urdf={p / 'none.urdf'}"), "no URDF"),
        (lambda p: ("walk", "--set", f"urdf={truncated_urdf(p)}"), "well-formed"),
        (lambda p: ("walk", "--set", f"urdf={footless_urdf(p)}"), "no foot frame 'left_foot'"),
        (lambda p: ("info", "--urdf", p), "no URDF"),
        (lambda p: ("walk", "--set", "ground.friction_strips=0.6,1.2"), "strip"),
        (lambda p: ("walk", "--set", "ground.friction_strips=[[1.2,0.6,0.1]]"), "strip"),
        (lambda p: ("walk", "--set", "ground.friction_strips=[0,1,0.1],[0.5,2,0.1]"), "strips"),
        (lambda p: ("walk", "--set", "controller"), "such as controller.mu=0.4, got 'controller'; harpy settings"),
        (lambda p: ("walk", "--set", "colour=red"), "valid names: controller, disturbances, dt, duration, gait"),
        (lambda p: ("walk", "--set", "controler.mu=0.3"), "did you mean 'controller'?"),
        (lambda p: ("walk", "--set", "controller.weight.swing=1"), "did you mean 'weights'?"),
        (lambda p: ("walk", "--set", "controller.weights.swng=1"), "did you mean 'swing'?"),
        (lambda p: ("walk", "--set", "ground=hills"), "unknown entry of the ground 'name'"),
        (lambda p: ("walk", "--set", "ground.slope=1.4"), "slope must be finite"),
        (lambda p: ("walk", "--set", "ground.terrain=hills"), "unknown terrain 'hills'"),
        (
            lambda p: ("walk", "--set", "controller=wbc", "--set", "controller.governor=none"),
            "setting of the controller 'governed'",
        ),
        (lambda p: ("walk", "--robot", "go2", "--set", "gait.schedule=walk"), "valid names: bound, crawl, pace"),
        (lambda p: ("walk", "--robot", "g1", "--set", "gait.schedule=trot"), "valid names: stand, step, walk"),
        (lambda p: ("walk", "--robot", "solo8", "--speed", "0.2"), "two joints in each leg"),
        (lambda p: ("walk", "--push", "2.0"), "TIME:X,Y,Z (s and N·s), got '2.0'"),
        (lambda p: ("walk", "--push", "2.0:1,2"), "TIME:X,Y,Z"),
        (lambda p: ("walk", "--push", "soon:0,5,0"), "TIME:X,Y,Z"),
        (lambda p: ("walk", "--push", "9:0,5,0"), "outside the run"),
        (lambda p: ("walk", "--set", "controller=wbc", "--set", "controller.thrust=false"), "'thrust'"),
        (lambda p: ("walk", "--again", p / "none.npz"), "no run log"),
        (lambda p: ("walk", "--set", "controller=lqr"), "valid names: condensed, governed, wbc"),
        (lambda p: ("walk", "--set", "controller.governor=best"), "valid names: filter, none"),
        (lambda p: ("walk", "--set", "ground.cone=square"), "valid names"),
        (lambda p: ("walk", "--json", p), "is a folder"),
        (lambda p: ("walk", "--set", "gait=trot"), "hand, hovering, standing"),
        (
            lambda p: ("walk", "--set", "gait=trot"),
            "'trot' is a schedule: Walking(schedule='trot'), --set gait.schedule=trot",
        ),
        (lambda p: ("walk", "--set", "gait.schedule=crawl"), "it is a setting of the gait 'walking'"),
        (
            lambda p: ("walk", "--speed", 0.2, "--set", "gait.velocity=0.3,0,0"),
            "it is a setting of the gait 'commanded'",
        ),
        (lambda p: ("walk", "--set", "controller=paper"), "it is Governed(governor='paper')"),
        (lambda p: ("walk", "--robot", "x.urdf"), "hp.load_robot(path, feet=...)"),
        (lambda p: ("gait", "--search", "everything"), "valid names"),
        (lambda p: ("gait", "--load", p / "none.toml"), "none.toml"),
        (lambda p: ("gait", "--search", "paper", "--out", p / "no" / "where.toml"), "no folder"),
        (lambda p: ("paper", "--out", corrupted_log(p)), "cannot write"),
        (lambda p: ("vlip", "--evaluate-at", "guessed"), "valid names"),
        (lambda p: ("view", p / "none.npz"), "no run log"),
        (lambda p: ("view", corrupted_log(p)), "damaged"),
        (lambda p: ("view", corrupted_log(p), "--html", p / "bad.npz"), "same file"),
        (lambda p: ("view", p / "a.npz", "--gif", p / "a.png"), "ends in .gif"),
        (lambda p: ("view", p / "a.npz", "--png", p / "a.png", "--times", "1,x"), "takes numbers"),
        (lambda p: ("view", p / "a.npz", "--times", "1"), "give --png"),
        (lambda p: ("view", p / "a.npz", "--size", "100"), "two numbers"),
        (lambda p: ("view", p / "a.npz", "--span", "2"), "two numbers"),
        (lambda p: ("view", p / "a.npz", "--figures", p / "a.bmp"), "must end in .png, .pdf, .svg"),
        (lambda p: ("view", *[p / f"{k}.npz" for k in range(5)]), "at most 4"),
        (lambda p: ("demo", "--html", p / "no" / "where.html"), "no folder"),
        (lambda p: ("walk", "--save", p / "a", "--json", p / "a"), "--save and --json are the same file"),
        (lambda p: ("walk", "--save", p / "a", "--json", p / "a.part"), "the journal of --save and --json"),
        (lambda p: ("walk", "--again", corrupted_log(p), "--json", p / "bad.npz"), "same file"),
        (lambda p: ("gait", "--search", "paper", "--out", p / "a", "--resume", p / "a"), "same file"),
    ],
)
def test_bad_input_is_one_clear_line(command, tmp_path, arguments, says):
    code, out, err = command(*arguments(tmp_path))
    assert code not in (0, None)
    assert says in err
    assert err.startswith(("harpy: ", "reproduction: "))
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in out + err


def test_unwritable_file_is_found_before_the_run(command, tmp_path, monkeypatch):
    monkeypatch.setattr(walk_command, "_run", lambda *_, **__: pytest.fail("the walk was run"))
    code, _, err = command("walk", "--save", tmp_path / "no" / "where.npz")
    assert code == 2
    assert "cannot write" in err
    assert "no folder" in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "number", "code"),
    [
        (lambda p: ("paper", "--out", p / "report"), signal.SIGTERM, 143),
        (lambda p: ("walk", "--json", p / "out.json", "--save", p / "out.npz"), signal.SIGINT, 130),
        (lambda p: ("walk", "--json", p / "out.json", "--save", p / "out.npz"), signal.SIGTERM, 143),
    ],
    ids=["paper", "walk", "walk by SIGTERM"],
)
def test_interrupted_command_stops(command, tmp_path, monkeypatch, number, code, arguments):
    """At the fifth tick of the first walk: no other walk is begun, and none is shown as if it were whole."""
    log, ticks = hp.Simulator.log, []
    before = signal.getsignal(signal.SIGTERM)

    def logged(self, *parts):
        log(self, *parts)
        ticks.append(self.t)
        if len(ticks) == 5:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(hp.Simulator, "log", logged)
    monkeypatch.setattr(hp.Simulator, "compile_loop", lambda self, *_, **__: None)  # every tick is logged in Python
    ending, out, err = command(*arguments(tmp_path))
    assert ending == code
    assert "harpy: interrupted" in err
    assert "Traceback" not in out + err
    assert 5 <= len(ticks) <= 6
    assert signal.getsignal(signal.SIGTERM) is before
    written = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    if arguments(tmp_path)[0] == "walk":
        assert written == {"out.json", "out.npz"}
        assert hp.Run.load(tmp_path / "out.npz").ending == "interrupted"
    else:
        assert out == ""
        assert written == set()
        assert "nothing more was written" in err


def wait_for_log(path):
    """Until a walk in another process has written some seconds of its log."""
    for _ in range(3000):
        if path.exists() and path.stat().st_size > 2_000_000:
            return
        time.sleep(0.05)


def test_killed_walk_is_viewed(command, tmp_path):
    log = tmp_path / "cut.npz"
    arguments = ("walk", "--duration", "600", "--save", str(log))
    with subprocess.Popen([sys.executable, "-m", "harpy_pin", *arguments], cwd=ROOT) as process:
        wait_for_log(tmp_path / "cut.npz.part")
        process.kill()
    code, out, err = command("view", log, "--html", tmp_path / "cut.html")
    assert code == 0
    assert err.startswith(("harpy: ", "reproduction: "))
    assert "has not ended" in err
    assert len(err.splitlines()) == 1
    assert "wrote" in out
    assert "unfinished" in (tmp_path / "cut.html").read_text()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments", [("vlip", "--duration", 0.2, "--json"), ("walk", "--duration", 0.02, "--json")], ids=["vlip", "walk"]
)
def test_results_are_shown_before_they_are_written(command, arguments):
    code, out, err = command(*arguments, "/dev/full")
    assert code == 2
    assert "measure" in out
    assert err.split(": ", 1)[1] == "cannot write '/dev/full': No space left on device\n"
