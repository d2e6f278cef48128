"""Commands that are refused, interrupted or killed: one clear line, and nothing that looks whole
and is not.
"""

import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import ROOT

import harpy_pin as hp
from harpy_pin.cli import walk as walk_command
from harpy_pin.errors import install_line


@pytest.fixture
def files(tmp_path):
    """A folder with files that are not as they should be."""
    text = (ROOT / "urdf" / "harpy.urdf").read_text()
    (tmp_path / "cut.urdf").write_text(text[: len(text) // 2])
    (tmp_path / "footless.urdf").write_text(text.replace("_foot", "_paw"))
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04" + bytes(range(256)) * 4)
    return tmp_path


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("walk --set urdf=OUT/none.urdf", "no URDF"),
        ("walk --set urdf=OUT/cut.urdf", "well-formed"),
        ("walk --set urdf=OUT/footless.urdf", "no foot frame 'left_foot'"),
        ("info --robot OUT", "unknown robot"),
        ("walk --set ground.friction_strips=0.6,1.2", "strip"),
        ("walk --set ground.friction_strips=[[1.2,0.6,0.1]]", "strip"),
        ("walk --set controller", "such as controller.mu=0.4, got 'controller'; harpy settings"),
        ("walk --set colour=red", "valid names: controller, disturbances, dt, duration, gait"),
        ("walk --set controler.mu=0.3", "did you mean 'controller'?"),
        ("walk --set controller.weight.swing=1", "did you mean 'weights'?"),
        ("walk --set controller.weights.swng=1", "did you mean 'swing'?"),
        ("walk --set ground.slope=1.4", "slope must be finite"),
        ("walk --set ground.terrain=hills", "unknown terrain 'hills'"),
        (
            "walk --set controller=wbc --set controller.governor=none",
            "setting of the controller 'governed'",
        ),
        ("walk --robot go2 --set gait.schedule=walk", "valid names: bound, crawl, pace"),
        ("walk --robot solo8 --speed 0.2", "a leg of fewer than three joints"),
        ("walk --push 2.0", "TIME:X,Y,Z (s and N·s), got '2.0'"),
        ("walk --push 2.0:1,2", "TIME:X,Y,Z"),
        ("walk --again OUT/none.npz", "no run log"),
        ("walk --json OUT", "is a folder"),
        (
            "walk --set gait=trot",
            "'trot' is a schedule: Walking(schedule='trot'), --set gait.schedule=trot",
        ),
        ("walk --set gait.schedule=crawl", "it is a setting of the gait 'walking'"),
        ("walk --speed 0.2 --set gait.velocity=0.3,0,0", "it is a setting of the gait 'commanded'"),
        ("walk --set 'gait.velocity=0.3 0'", "must look like"),
        ("walk --set 'gait.velocity=0.3 0 0; 0.1 0 0'", "must look like"),
        ("walk --set 'gait.velocity=0.3 0 0; 2 0 0 0'", "must look like"),
        ("walk --set 'gait.velocity=0.3 0 nan'", "velocity must be finite"),
        ("walk --set 'gait.velocity=2s 0 0 0; 1s 0 0 0'", "must grow"),
        ("walk --set 'gait.velocity=0.3 0 0' --set gait=hand", "velocity"),
        ("walk --set 'gait.velocity=0.3 0 0' --set controller=governed", "commanded"),
        ("walk --robot x.urdf", "no URDF at 'x.urdf'"),
        (
            "walk --feet left_foot",
            "--feet, --flat-feet, --loops and --posture are of a robot that --robot names",
        ),
        ("walk --robot go2 --posture 0,up,0", "--posture takes angles in rad"),
        ("walk --robot go2 --posture 0,0.8,-5", "beyond its limits"),
        ("gait --search everything", "valid names"),
        ("gait --load OUT/none.toml", "none.toml"),
        ("gait --search paper --out OUT/no/where.toml", "no folder"),
        ("paper --out OUT/bad.npz", "cannot write"),
        ("vlip --evaluate-at guessed", "valid names"),
        ("view OUT/none.npz", "no run log"),
        ("view OUT/bad.npz", "damaged"),
        ("view OUT/bad.npz --html OUT/bad.npz", "same file"),
        ("view OUT/a.npz --gif OUT/a.png", "ends in .gif"),
        ("view OUT/a.npz --png OUT/a.png --times 1,x", "takes numbers"),
        ("view OUT/a.npz --times 1", "give --png"),
        ("view OUT/a.npz --size 100", "2 numbers"),
        ("view OUT/a.npz --span 2", "2 numbers"),
        ("view OUT/a.npz --figures OUT/a.bmp", "ends in .png or .pdf or .svg"),
        ("view 0.npz 1.npz 2.npz 3.npz 4.npz", "at most 4"),
        ("film OUT/dog.avi", ".gif"),
        ("film OUT/dog.gif --robot go9", "did you mean"),
        ("film OUT/dog.gif --duration 0.1", "duration"),
        ("film OUT/dog.gif --size big", "--size"),
        ("film OUT/dog.gif --set gait.velocity=fast", "velocity"),
        ("film OUT/dog.gif --robot harpy --set gait.schedule=trot", "schedule"),
        ("live --no-browser --port 70000", "port"),
        ("live --no-browser --port -1", "port"),
        ("live --no-browser --host nowhere", "host"),
        ("live --no-browser --host 127.0.0.1:80", "host"),
        ("live --no-browser --friction -1", "friction"),
        ("live --no-browser --set controller=best", "condensed"),
        ("live --no-browser --save /nowhere/drive.npz", "folder"),
        ("live --no-browser --port TAKEN", "in use"),
        ("demo --html OUT/no/where.html", "no folder"),
        ("walk --save OUT/a --json OUT/a", "--save and --json are the same file"),
        ("walk --save OUT/a --json OUT/a.part", "the journal of --save and --json"),
        ("walk --again OUT/bad.npz --json OUT/bad.npz", "same file"),
        ("gait --search paper --out OUT/a --resume OUT/a", "same file"),
    ],
)
def test_bad_input_is_one_clear_line(command, files, line, says):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        line = line.replace("OUT", str(files)).replace("TAKEN", str(taken.getsockname()[1]))
        code, out, err = command(*shlex.split(line))
    assert code not in (0, None)
    assert says in err
    assert err.startswith(("harpy: ", "reproduction: "))
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in out + err


def test_without_viser_it_says_how_to_install(command, monkeypatch):
    monkeypatch.setattr("harpy_pin.contrib.live.command.find_spec", lambda name: None)
    says = f"harpy: driving needs viser, which is not installed: {install_line('live')}\n"
    assert command("live")[2] == says


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
        (
            lambda p: ("walk", "--json", p / "out.json", "--save", p / "out.npz"),
            signal.SIGTERM,
            143,
        ),
    ],
    ids=["paper", "walk", "walk by SIGTERM"],
)
def test_interrupted_command_stops(command, tmp_path, monkeypatch, number, code, arguments):
    """At the fifth tick of the first walk: no other walk is begun, and none is shown as if it were
    whole.
    """
    log, ticks = hp.Simulator.log, []
    before = signal.getsignal(signal.SIGTERM)

    def logged(self, *parts):
        log(self, *parts)
        ticks.append(self.t)
        if len(ticks) == 5:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(
        "reproduction.report.study_vlip", lambda: None
    )  # without walks, before them
    monkeypatch.setattr(hp.Simulator, "log", logged)
    monkeypatch.setattr(
        hp.Simulator, "compile_loop", lambda self, *_, **__: None
    )  # every tick is logged in Python
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
        assert written == {".harpy_pin"}  # by which the folder is known again
        assert "nothing more was written" in err


def wait_for_log(path):
    """Until a walk in another process has written a second of its log."""
    for _ in range(3000):
        if path.exists() and path.stat().st_size > 300_000:
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
    "arguments",
    [("vlip", "--duration", 0.2, "--json"), ("walk", "--duration", 0.02, "--json")],
    ids=["vlip", "walk"],
)
def test_results_are_shown_before_they_are_written(command, arguments):
    code, out, err = command(*arguments, "/dev/full")
    assert code == 2
    assert "measure" in out
    assert err.split(": ", 1)[1] == "cannot write '/dev/full': No space left on device\n"
