"""A campaign is done to its end: a kill does not change the outcome."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from comparison.campaign.plan import CampaignSettings, code_digest, plan
from comparison.campaign.store import Store, read_rows
from comparison.campaign.walks import walk_task
from comparison.cli import main
from comparison.contenders import CONTENDERS
from comparison.measure import walking
from harpy_pin import HarpyError

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = {**os.environ, "COLUMNS": "140"}
WALKS = 3 * len(CONTENDERS)
SMALL = ("--walks", str(WALKS), "--duration", "1.5")


def killed(job: int) -> dict[str, Any]:
    """What a worker does that the system kills, out of memory, say."""
    if job == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"job": job}


def test_a_killed_worker_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walking, "ALONE", 1)
    with pytest.raises(HarpyError, match="was killed; the same command goes on"):
        list(walking.one_by_one(killed, [0, 1, 2]))


def command(path: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "comparison", "campaign", *SMALL, "--out", str(path), *more]


def finished(path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(path), cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, timeout=600
    )


def give_way() -> None:
    """A process that is watched gives way to the one that watches it, however busy the machine
    is.
    """
    os.nice(10)


def wait_for_rows(path: Path, count: int) -> int:
    end = time.monotonic() + 600.0
    while time.monotonic() < end:
        if path.exists() and (found := path.read_bytes().count(b"\n")) >= count:
            return found
        time.sleep(0.005)
    raise AssertionError("no rows")


def undisturbed(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> str:
    """The table of a campaign whose walks were done here, one after the other."""
    monkeypatch.setenv("COLUMNS", ENVIRONMENT["COLUMNS"])
    monkeypatch.setattr(sys, "argv", ["comparison", *command(path)[3:]])
    code = code_digest()
    with Store(path) as store:
        for task in plan(CampaignSettings(walks=WALKS, duration=1.5)):
            store.append(task.key(code), {"measures": walk_task(task)})
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    return capsys.readouterr().out


def test_a_killed_campaign_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rows.jsonl"
    process = subprocess.Popen(
        command(path), cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.DEVNULL, preexec_fn=give_way
    )
    try:
        wait_for_rows(path, 4)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = read_rows(path)[0]
    assert 4 <= len(before) < WALKS  # killed in the middle
    path.write_bytes(path.read_bytes() + b'{"key": "half a li')
    done = finished(path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == undisturbed(tmp_path / "whole.jsonl", monkeypatch, capsys)
    assert "filter" in done.stdout
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert len({line["key"] for line in lines}) == len(lines) == WALKS
    assert [line["key"] for line in lines[: len(before)]] == list(before)  # nothing was done twice
