"""Files that take the place of others, links and devices, and signals that wait."""

import json
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from comparison.measure.interrupts import without_interrupts
from harpy_pin import InputError, RunFileError
from harpy_pin.files import Shield, check_outputs, check_writable, replacing, write_json

ROOT = Path(__file__).resolve().parents[2]


def press(number=signal.SIGINT):
    os.kill(os.getpid(), number)


def test_links_are_followed(tmp_path):
    (tmp_path / "data").mkdir()
    target, link, chain = (
        tmp_path / "data" / "a.json",
        tmp_path / "link.json",
        tmp_path / "chain.json",
    )
    link.symlink_to("data/a.json")
    chain.symlink_to(link)
    for value, path in enumerate((link, chain, link)):  # the first time nothing is there
        write_json(path, {"x": value})
        assert json.loads(target.read_text()) == {"x": value}
        assert link.is_symlink()
        assert chain.is_symlink()
    assert [p.name for p in (tmp_path / "data").iterdir()] == ["a.json"]


def test_links_that_lead_nowhere(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    (tmp_path / "c").symlink_to("no/where.json")
    for name in "ac":
        with pytest.raises(RunFileError, match="cannot write"):
            check_writable(tmp_path / name)


@pytest.mark.parametrize("mode", [0o600, 0o664, 0o755])
def test_permissions_of_an_older_file_are_kept(tmp_path, mode):
    path = tmp_path / "a.json"
    path.write_text("{}")
    path.chmod(mode)
    write_json(path, {"x": 1})
    assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipe_is_written_to(tmp_path):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    with pytest.raises(RunFileError, match="nobody reads"):
        write_json(pipe, {"x": 1})
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    check_writable(pipe)  # takes nothing from the reader
    for _ in range(1000):
        try:
            write_json(pipe, {"x": list(range(50_000))})
            break
        except RunFileError:  # the thread has not opened it yet
            threading.Event().wait(0.01)
    reader.join(timeout=600)
    assert json.loads(got[0]) == {"x": list(range(50_000))}
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_devices_are_written_to():
    for device in ("/dev/null", "/dev/full"):
        check_writable(device)
    write_json("/dev/null", {"x": 1})
    with pytest.raises(RunFileError, match="No space left"):
        write_json("/dev/full", {"x": 1})
    assert all(stat.S_ISCHR(os.stat(device).st_mode) for device in ("/dev/null", "/dev/full"))


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="needs /dev/stdout")
def test_file_that_is_printed_to_keeps_what_was_printed(tmp_path):
    code = (
        "from harpy_pin.files import write_json; print('before', flush=True); "
        "write_json('/dev/stdout', {'x': 1})"
    )
    with (tmp_path / "out.txt").open("wb") as out:
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=out, check=True)
    assert (tmp_path / "out.txt").read_text().split() == ["before", "{", '"x":', "1", "}"]


def test_outputs_that_are_one_file(tmp_path):
    (tmp_path / "a").write_text("")
    (tmp_path / "link").symlink_to("a")
    (tmp_path / "hard").hardlink_to(tmp_path / "a")
    (tmp_path / "new link").symlink_to("new")
    (tmp_path / "folder").symlink_to(".")
    for one, two in (
        ("a", "a"),
        ("a", "link"),
        ("a", "hard"),
        ("new", "new link"),
        ("new", "folder/new"),
        ("a", "./a"),
    ):
        with pytest.raises(InputError, match="--save and --json are the same file"):
            check_outputs({"--save": tmp_path / one, "--json": f"{tmp_path}/{two}"})
    check_outputs({"--save": tmp_path / "a", "--json": tmp_path / "new", "--figure": None})
    check_outputs({"--save": os.devnull, "--json": os.devnull})


def test_output_that_is_an_input(tmp_path):
    (tmp_path / "a").write_text("")
    with pytest.raises(InputError, match="RUN and --html are the same"):
        check_outputs({"--html": tmp_path / "a"}, inputs={"RUN": tmp_path / "a"})
    check_outputs({"--html": tmp_path / "b"}, inputs={"RUN": tmp_path / "absent"})


def test_signal_waits_until_the_file_is_in_place(tmp_path):
    path = tmp_path / "a"

    def write():
        with replacing(path) as file:
            press()
            press()
            file.write(b"whole")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert path.read_bytes() == b"whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_first_signal_ends_the_work_and_the_next_waits():
    handler, steps = signal.getsignal(signal.SIGINT), []

    def work():
        with Shield() as shield:
            try:
                press()
                pytest.fail("not interrupted")
            except KeyboardInterrupt:
                steps.append("ended")
            assert shield.saving
            press()
            steps.append("kept")
        pytest.fail("not interrupted")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert steps == ["ended", "kept"]
    assert signal.getsignal(signal.SIGINT) is handler


def test_signal_that_waits_can_be_forgotten():
    with Shield(saving=True) as shield:
        press()
        assert shield.late == signal.SIGINT
        shield.late = None


def test_own_handlers_stay_in_charge():
    """A handler that raises nothing goes on being called; SIGTERM that nobody handles is left
    alone.
    """
    seen, before = [], signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        with Shield():
            assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
            press()
            press()
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [signal.SIGINT] * 2


def test_other_threads_have_no_signals(tmp_path):
    thread = threading.Thread(target=write_json, args=(tmp_path / "a", {"x": 1}))
    thread.start()
    thread.join()
    assert (tmp_path / "a").exists()


def test_an_interrupt_waits_although_another_thread_would_take_it():
    done, turns = threading.Event(), []

    def work():
        with without_interrupts():
            press()
            for turn in range(100_000):
                turns.append(turn)

    other = threading.Thread(target=done.wait)
    other.start()
    try:
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                work()
    finally:
        done.set()
        other.join()
    assert len(turns) == 300_000
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
