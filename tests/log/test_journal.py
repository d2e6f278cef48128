"""Logs that are on disk while the run goes on: interrupts, failures, and what is found
afterwards.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.errors import Interrupted, RunFileError, RunFileWarning
from harpy_pin.log.journal import MAGIC, Journal, read_journal
from harpy_pin.log.recorder import Recorder


class Counting:
    """Commands that say which tick they are of; does something at one of them."""

    period = 1e-3

    def __init__(self, at=-1, action=lambda: None):
        self.tick, self.at, self.action = 0, at, action

    def step(self, state):
        if self.tick == self.at:
            self.action()
        command = hp.Command(np.full(6, float(self.tick)), np.zeros((2, 3)))
        self.tick += 1
        return command


def check(run, rows):
    np.testing.assert_array_equal(run["torque"][:, 0], np.arange(rows))
    np.testing.assert_allclose(run["t"], 1e-3 * np.arange(rows), atol=1e-12)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("rows", [3, 1000, 2345])
def test_saved_run_is_the_run(simulator, tmp_path, rows):
    run = simulator.run(Counting(), rows * 1e-3, save=tmp_path / "run.npz")
    check(run, rows)
    loaded = hp.Run.load(tmp_path / "run.npz")
    for name in run.signals.keys() | loaded.signals.keys():
        np.testing.assert_array_equal(loaded[name], run[name])
        assert loaded[name].dtype == run[name].dtype
    assert loaded.metadata == {**json.loads(json.dumps(run.metadata)), "format": 1}
    assert run.ending == "completed"
    assert names(tmp_path) == ["run.npz"]


def test_rows_are_on_disk_every_second(simulator, tmp_path):
    seen = []

    def look():
        with pytest.warns(RunFileWarning, match=r"run\.npz\.part.*has not ended: 2000 ticks"):
            seen.append(hp.Run.load(tmp_path / "run.npz"))

    simulator.run(Counting(2999, look), 3.5, save=tmp_path / "run.npz")
    check(seen[0], 2000)
    assert seen[0].ending == "unfinished"
    assert not seen[0].fell
    assert seen[0].metadata["end_time"] == pytest.approx(2.0)
    assert hp.measure(seen[0]).duration_s == pytest.approx(2.0)


@pytest.mark.parametrize("error", [ZeroDivisionError("out of ideas"), KeyboardInterrupt()])
def test_failures_and_interrupts_are_saved(simulator, tmp_path, error):
    def fail():
        raise error

    with pytest.raises((hp.ControlError, Interrupted)) as caught:
        simulator.run(Counting(1500, fail), 3.0, save=tmp_path / "run.npz")
    check(caught.value.run, 1500)
    loaded = hp.Run.load(tmp_path / "run.npz")
    check(loaded, 1500)
    assert loaded.ending == caught.value.run.ending
    assert loaded.ending == "interrupted" or "out of ideas" in loaded.ending
    assert names(tmp_path) == ["run.npz"]


def test_error_in_the_simulator_leaves_the_journal(simulator, tmp_path, monkeypatch):
    def broken(command, pushes=(), *, steps=1):
        if simulator.t > 1.1:
            raise MemoryError

    monkeypatch.setattr(simulator, "advance", broken)
    with pytest.raises(MemoryError):
        simulator.run(Counting(), 3.0, save=tmp_path / "run.npz")
    with pytest.warns(RunFileWarning):
        check(hp.Run.load(tmp_path / "run.npz"), 1102)


def test_nothing_logged_nothing_replaced(simulator, tmp_path):
    simulator.run(Counting(), 0.01, save=tmp_path / "run.npz")
    before = (tmp_path / "run.npz").read_bytes()

    def stop():
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        simulator.run(Counting(0, stop), 0.01, save=tmp_path / "run.npz")
    assert (tmp_path / "run.npz").read_bytes() == before
    assert names(tmp_path) == ["run.npz"]


@pytest.mark.parametrize("during", ["run", "save"])
def test_second_interrupt_waits_until_the_log_is_written(simulator, tmp_path, monkeypatch, during):
    def press():
        os.kill(os.getpid(), signal.SIGINT)

    original = hp.Run.save

    def write(*arguments):
        press()
        press()
        original(*arguments)

    monkeypatch.setattr(hp.Run, "save", write)
    handler = signal.getsignal(signal.SIGINT)
    controller = Counting(700, press) if during == "run" else Counting()
    with pytest.raises(Interrupted) as caught:
        simulator.run(controller, 1.0, save=tmp_path / "run.npz")
    assert signal.getsignal(signal.SIGINT) is handler
    run = hp.Run.load(tmp_path / "run.npz")
    check(run, len(caught.value.run))
    assert len(run) in ((700, 701) if during == "run" else (1000,))
    assert run.ending == ("interrupted" if during == "run" else "completed")


def test_a_loop_over_walks_ends_with_the_first_that_is_interrupted(simulator):
    done = []

    def press():
        raise KeyboardInterrupt

    def study():
        for k in range(5):
            with contextlib.suppress(Exception):  # lives with errors
                simulator.run(Counting(3, press) if k == 2 else Counting(), 0.01)
            done.append(k)

    with pytest.raises(KeyboardInterrupt):
        study()
    assert done == [0, 1]


def leave(target, rows=5):
    """The journal of a process that died."""
    journal = Journal(target, {"format": 1, "ending": "unfinished", "control_period": 1e-3})
    recorder = Recorder(journal, block=2)
    for k in range(rows):
        recorder.append(
            {
                "t": 1e-3 * k,
                "q": np.zeros(13),
                "v": np.zeros(12),
                "torque": np.full(6, float(k)),
                "held": k % 2 == 0,
                **{
                    name: np.zeros((2, 3))
                    for name in ("foot_position", "foot_velocity", "foot_force", "thrust")
                },
            }
        )
    journal.close()
    return journal.path


def test_journal_up_to_its_last_block(tmp_path):
    path = leave(tmp_path / "run.npz")
    for asked in (tmp_path / "run.npz", path):
        with pytest.warns(RunFileWarning, match="4 ticks"):
            run = hp.Run.load(asked)
        check(run, 4)
        assert run["held"].tolist() == [True, False, True, False]
        assert run.ending == "unfinished"


def test_older_log_beside_a_journal(simulator, tmp_path):
    simulator.run(Counting(), 0.01, save=tmp_path / "run.npz")
    leave(tmp_path / "run.npz")
    with pytest.warns(RunFileWarning, match="an older run"):
        check(hp.Run.load(tmp_path / "run.npz"), 10)


def test_the_journal_of_a_run_that_died_is_not_written_over(simulator, tmp_path):
    path, controller = leave(tmp_path / "run.npz", rows=4), Counting()
    with pytest.raises(
        RunFileError, match=r"another run is writing it, or died: .*run\.npz\.part.* another name"
    ):
        simulator.run(controller, 0.01, save=tmp_path / "run.npz")
    assert controller.tick == 0
    with pytest.warns(RunFileWarning):
        check(hp.Run.load(tmp_path / "run.npz"), 4)
    path.rename(tmp_path / "first.part")
    simulator.run(controller, 0.01, save=tmp_path / "run.npz")
    assert names(tmp_path) == ["first.part", "run.npz"]
    with pytest.warns(RunFileWarning):
        check(hp.Run.load(tmp_path / "first.part"), 4)


def test_two_runs_that_begin_at_once_spoil_nothing(tmp_path):
    """The second one finds the file when its first row comes, and keeps its rows in memory."""
    first, second = (Recorder(Journal(tmp_path / "run.npz", {}), block=2) for _ in range(2))
    for k in range(5):
        first.append({"a": 1.0 * k})
        second.append({"a": -1.0 * k})
    assert first.take()["a"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert second.take()["a"].tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]


@pytest.mark.filterwarnings("ignore::harpy_pin.errors.RunFileWarning")
def test_damaged_journals(tmp_path, fuzz):
    """Cut or changed anywhere: a whole beginning of the run, or one clear line."""
    path = leave(tmp_path / "run.npz", rows=8)
    content, rng = path.read_bytes(), np.random.default_rng(4)
    cases = [content[:length] for length in range(0, len(content), 97)]
    for _ in range(300 * fuzz):
        damaged = bytearray(content)
        for place in rng.integers(0, len(content), rng.integers(1, 4)):
            damaged[place] = rng.integers(256)
        cases.append(bytes(damaged))
    lengths = set()
    for case in cases:
        path.write_bytes(case)
        try:
            run = hp.Run.load(path)
        except RunFileError:
            continue
        check(run, len(run))
        lengths.add(len(run))
    assert lengths == {0, 1, 2, 4, 6, 8}  # the first tick is a block of its own


@pytest.mark.parametrize(
    "signals", [{"t": [2**62]}, {"t": ["x"]}, {"t": [-1]}, {"<t>": []}, {}, [], {"t": None}]
)
def test_journals_that_lie(tmp_path, signals):
    import struct
    import zlib

    head = json.dumps({"signals": signals, "flags": [], "metadata": {}}).encode()
    path = tmp_path / "run.npz.part"
    path.write_bytes(MAGIC + struct.pack("<4sQI", b"HEAD", len(head), zlib.crc32(head)) + head)
    with pytest.raises(RunFileError, match=r"run\.npz\.part"):
        read_journal(path)


def test_metadata_that_are_no_json_are_found_before_the_run(simulator, tmp_path):
    controller = Counting()
    with pytest.raises(RunFileError, match="no JSON"):
        simulator.run(controller, 0.01, metadata={"own": {(1, 2): 3}}, save=tmp_path / "run.npz")
    assert controller.tick == 0
    assert names(tmp_path) == []


ROOT = Path(__file__).resolve().parents[2]


def script(code, *arguments, timeout=600):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


KILLS = """
    import mmap, os, random, signal, sys, time
    import numpy as np
    import harpy_pin as hp
    folder, cases = sys.argv[1], int(sys.argv[2])
    random.seed(5)
    simulator = hp.Simulator(hp.load_harpy())
    simulator.reset(simulator.q, simulator.v)
    simulator.advance = lambda command, pushes=(), *, steps=1: None
    q, v = simulator.q, simulator.v
    # Written at once: a kill leaves the old or the new number.
    shared = np.frombuffer(mmap.mmap(-1, 8), np.int64)
    class Counting:
        period, tick = 1e-3, 0
        def step(self, state):
            shared[0] = self.tick
            self.tick += 1
            return hp.Command(np.full(6, self.tick - 1.0), np.zeros((2, 3)))
    simulator.run(Counting(), 0.01)
    for case in range(cases):
        simulator.reset(q, v)
        shared[0] = -1
        child = os.fork()
        if child == 0:
            simulator.run(Counting(), 8.0, save=f"{folder}/{case}.npz")
            os._exit(0)
        goal, deadline = random.randrange(0, 8050), time.monotonic() + 600
        while shared[0] < min(goal, 7999) and time.monotonic() < deadline:
            time.sleep(1e-4)
        time.sleep(0.05 * random.random() if goal > 7900 else 0.0)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        print(shared[0])
"""


@pytest.mark.filterwarnings("ignore::harpy_pin.errors.RunFileWarning")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_runs_are_there_up_to_their_last_second(tmp_path, fuzz):
    ticks = [int(line) for line in script(KILLS, tmp_path, 6 * fuzz, timeout=600 * fuzz).split()]
    assert len(ticks) == 6 * fuzz
    for case, tick in enumerate(ticks):
        try:
            run = hp.Run.load(tmp_path / f"{case}.npz")
        except RunFileError:
            assert tick <= 0
            continue
        check(run, len(run))
        if run.ending == "completed":
            assert len(run) == 8000
        else:
            assert run.ending == "unfinished"
            assert len(run) % 1000 == 0 or len(run) == 8000
            assert tick - 1000 <= len(run) <= tick + 1
    assert any(ticks)


FULL = """
    import resource, sys
    import harpy_pin as hp
    from harpy_pin.cli.app import main
    hp.walk(hp.Scenario(duration=0.002))
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
    sys.argv = ["harpy", "walk", "--duration", "2.5", "--save", sys.argv[1]]
    try:
        main()
    except SystemExit as ending:
        print("code", ending.code)
    sys.stderr.flush()
"""


@pytest.mark.filterwarnings("ignore::harpy_pin.errors.RunFileWarning")
def test_full_disk_is_told_after_the_table(tmp_path):
    """The walk goes on in memory; what was measured is printed, then the failure; what fitted stays
    on disk.
    """
    pytest.importorskip("resource")
    out = script(FULL, tmp_path / "run.npz", 1_000_000)
    assert "distance along x, m" in out
    assert out.strip().endswith("code 2")
    assert names(tmp_path) == ["run.npz.part"]
    assert len(hp.Run.load(tmp_path / "run.npz")) == 1000


def test_full_disk_hands_over_the_run(simulator, tmp_path, monkeypatch):
    def full(*_):
        raise RunFileError("cannot write: No space left on device")

    monkeypatch.setattr(hp.Run, "save", full)
    with pytest.raises(
        RunFileError, match=r"No space left.*its rows are in .*run\.npz\.part"
    ) as caught:
        simulator.run(Counting(), 1.5, save=tmp_path / "run.npz")
    check(caught.value.run, 1500)
    with pytest.warns(RunFileWarning, match="log was not written"):
        loaded = hp.Run.load(tmp_path / "run.npz")
    check(loaded, 1500)
    assert loaded.ending == "completed"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_device_that_is_full(simulator):
    with pytest.raises(RunFileError, match="No space left") as caught:
        simulator.run(Counting(), 0.01, save="/dev/full")
    check(caught.value.run, 10)
    assert not Path("/dev/full.part").exists()
