"""Logs that are on disk while the run goes on: interrupts, failures, and what is found afterwards."""

from __future__ import annotations

import contextlib
import json
import os
import signal

import numpy as np
import pytest
from counting import Counting, check, names

import harpy_pin as hp
from harpy_pin.errors import Interrupted, RunFileError, RunFileWarning
from harpy_pin.log import archive as archive_module
from harpy_pin.log.journal import MAGIC, Journal, read_journal
from harpy_pin.log.recorder import Recorder
from harpy_pin.simulation import loop

# --- The whole way --------------------------------------------------------------------------------------------------


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


def test_big_run_lies_in_its_file(simulator, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "MAPPED", 1000)
    monkeypatch.setattr(archive_module, "MAPPED", 1000)
    run = simulator.run(Counting(), 2.5, save=tmp_path / "run.npz")
    check(run, 2500)
    assert not run["q"].flags.owndata
    simulator.reset(simulator.q, simulator.v)
    simulator.run(Counting(), 0.5, save=tmp_path / "run.npz")  # another in its place
    check(run, 2500)
    check(hp.Run.load(tmp_path / "run.npz"), 500)


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

    original = loop.write_archive

    def write(*arguments):
        press()
        press()
        original(*arguments)

    monkeypatch.setattr(loop, "write_archive", write)
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


# --- What an earlier run left behind --------------------------------------------------------------------------------


def leave(target, rows=5, ended=False):
    """The journal of a process that died."""
    journal = Journal(target, {"format": 1, "ending": "unfinished", "control_period": 1e-3})
    recorder = Recorder(journal, piece=2)
    for k in range(rows):
        recorder.append(
            {
                "t": 1e-3 * k,
                "q": np.zeros(13),
                "v": np.zeros(12),
                "torque": np.full(6, float(k)),
                "held": k % 2 == 0,
                **{name: np.zeros((2, 3)) for name in ("foot_position", "foot_velocity", "foot_force", "thrust")},
            }
        )
    if ended:
        recorder.flush()
        journal.end({"format": 1, "ending": "fell"})
    journal.close()
    return journal.path


def test_journal_up_to_its_last_piece(tmp_path):
    path = leave(tmp_path / "run.npz")
    for asked in (tmp_path / "run.npz", path):
        with pytest.warns(RunFileWarning, match="4 ticks"):
            run = hp.Run.load(asked)
        check(run, 4)
        assert run["held"].tolist() == [True, False, True, False]
        assert run.ending == "unfinished"


def test_journal_whose_log_was_not_written(tmp_path):
    leave(tmp_path / "run.npz", ended=True)
    with pytest.warns(RunFileWarning, match="log was not written: 5 ticks"):
        run = hp.Run.load(tmp_path / "run.npz")
    check(run, 5)
    assert run.ending == "fell"


def test_older_log_beside_a_journal(simulator, tmp_path):
    simulator.run(Counting(), 0.01, save=tmp_path / "run.npz")
    leave(tmp_path / "run.npz")
    with pytest.warns(RunFileWarning, match="an older run"):
        check(hp.Run.load(tmp_path / "run.npz"), 10)


def test_empty_journal_is_not_kept(simulator, tmp_path):
    Journal(tmp_path / "run.npz", {}).close()
    simulator.run(Counting(), 0.01, save=tmp_path / "run.npz")
    assert names(tmp_path) == ["run.npz"]


def test_next_run_sets_the_journal_aside(simulator, tmp_path):
    for k in range(2):
        leave(tmp_path / "run.npz", rows=4)
        with pytest.warns(RunFileWarning, match=rf"set aside as.*run\.npz\.part\.{k + 1}"):
            simulator.run(Counting(), 0.01, save=tmp_path / "run.npz")
    assert names(tmp_path) == ["run.npz", "run.npz.part.1", "run.npz.part.2"]
    with pytest.warns(RunFileWarning):
        check(hp.Run.load(tmp_path / "run.npz.part.1"), 4)


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
    assert lengths == {0, 1, 2, 4, 6, 8}  # the first tick is a piece of its own


@pytest.mark.parametrize("signals", [{"t": [2**62]}, {"t": ["x"]}, {"t": [-1]}, {"<t>": []}, {}, [], {"t": None}])
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
