"""Runs that are killed, disks that are full, and two runs with one file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from counting import Counting, check, names

import harpy_pin as hp
from harpy_pin.errors import RunFileError, RunFileWarning
from harpy_pin.log.journal import Journal
from harpy_pin.simulation import loop

ROOT = Path(__file__).resolve().parents[2]


def script(code, *arguments, timeout=300):
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
    shared = np.frombuffer(mmap.mmap(-1, 8), np.int64)  # written at once: a kill leaves the old or the new number
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
        goal, deadline = random.randrange(0, 8050), time.monotonic() + 120
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
    ticks = [int(line) for line in script(KILLS, tmp_path, 6 * fuzz, timeout=300 * fuzz).split()]
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
@pytest.mark.parametrize(("room", "rows"), [(1_000_000, 1000), (100, None)])
def test_full_disk_is_told_after_the_table(tmp_path, room, rows):
    """The walk goes on in memory; what was measured is printed, then the failure; what fitted stays on disk."""
    pytest.importorskip("resource")
    out = script(FULL, tmp_path / "run.npz", room)
    assert "distance along x, m" in out
    assert out.strip().endswith("code 2")
    assert names(tmp_path) == ["run.npz.part"]
    if rows is None:
        with pytest.raises(RunFileError):
            hp.Run.load(tmp_path / "run.npz")
    else:
        assert len(hp.Run.load(tmp_path / "run.npz")) == rows


def test_full_disk_hands_over_the_run(simulator, tmp_path, monkeypatch):
    def full(*_):
        raise RunFileError("cannot write: No space left on device")

    monkeypatch.setattr(loop, "write_archive", full)
    with pytest.raises(RunFileError, match=r"No space left.*its rows are in .*run\.npz\.part") as caught:
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


def test_a_second_run_leaves_the_journal_of_the_first_alone(simulator, tmp_path):
    """The second one says so before its first tick, and the first one loses nothing."""
    second = hp.Simulator(simulator.robot)
    late = Counting()

    def begin():
        with pytest.raises(RunFileError, match=r"run\.npz': another run is writing it") as caught:
            second.run(late, 0.01, save=tmp_path / "run.npz")
        assert "\n" not in str(caught.value)

    simulator.run(Counting(1200, begin), 2.5, save=tmp_path / "run.npz")
    assert late.tick == 0
    assert names(tmp_path) == ["run.npz"]
    check(hp.Run.load(tmp_path / "run.npz"), 2500)


def test_an_empty_journal_in_use_is_not_taken(tmp_path):
    first = Journal(tmp_path / "run.npz", {})
    with pytest.raises(RunFileError, match="another run"):
        Journal(tmp_path / "run.npz", {})
    first.close()
    Journal(tmp_path / "run.npz", {}).remove()
    assert names(tmp_path) == []


def test_two_processes_with_one_file(tmp_path):
    """The second one ends with one line and exit code 2; the first one writes its whole log."""
    command = [sys.executable, "-m", "harpy_pin", "walk", "--save", str(tmp_path / "run.npz"), "--duration"]
    first = subprocess.Popen([*command, "600"], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    journal, deadline = tmp_path / "run.npz.part", time.monotonic() + 120
    while time.monotonic() < deadline and not (journal.exists() and journal.stat().st_size > 100_000):
        time.sleep(0.02)
    second = subprocess.run([*command, "1"], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (second.returncode, second.stdout) == (2, "")
    assert "another run is writing it" in second.stderr
    assert second.stderr.count("\n") == 1
    first.send_signal(signal.SIGINT)
    said = [line for line in first.communicate(timeout=60)[1].splitlines() if not line.startswith("compiling")]
    assert (len(said), first.returncode) == (1, 130)
    assert names(tmp_path) == ["run.npz"]
    assert hp.Run.load(tmp_path / "run.npz").ending == "interrupted"
