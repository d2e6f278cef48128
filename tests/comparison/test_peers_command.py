"""The command that compares with peers: what it reports, and when it fails."""

import json
from pathlib import Path
from typing import Any

import pytest

from comparison.cli import app
from comparison.cli import commands as comparison_commands
from comparison.peers import compare, measure_peer
from comparison.peers.compare import peer_tables
from comparison.peers.environment import NOT_INSTALLED
from comparison.peers.measure_peer import TOLERANCE

OURS = {"condensed WBC", "whole-body QP, own search", "whole-body QP, ProxQP"}


def command(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, reason: str = ""
) -> tuple[int, dict[str, Any]]:
    """Exit code and numbers of the command on one short case without peers; with a reason, of ours
    that alone.
    """
    for name, value in {"QUICK_CASES": ("solo12, stands",), "QUICK_RECORDING": 0.2}.items():
        monkeypatch.setattr(comparison_commands, name, value)
    if reason:
        monkeypatch.setattr(
            compare, "measure_ours", lambda *_: {"whole-body QP, ProxQP": {"reason": reason}}
        )
    file = folder / "peers.json"
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--quick", "--folder", str(folder), "--json", str(file)])
    return int(ended.value.code or 0), json.loads(file.read_text(encoding="utf-8"))


def test_the_command_reports_absent_peers_and_measures_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, document = command(tmp_path, monkeypatch)
    assert code == 0
    assert NOT_INSTALLED in capsys.readouterr().out
    assert document["machine"]
    (case,) = document["peers"]["cases"].values()
    entries = case["contenders"]
    assert (
        entries["TSID in C++"]["reason"]
        == entries["placo, equalities kept"]["reason"]
        == NOT_INSTALLED
    )
    for name in (f"{own}{processor}" for own in OURS for processor in measure_peer.PROCESSORS):
        assert entries[name]["times"]["tick"]["samples"] > 0
        assert entries[name]["difference_max"]["torque"] < TOLERANCE["torque"]
        assert ("inside" in entries[name]["times"]) == ("ProxQP" not in name)
    native, wheel = (
        entries[f"condensed WBC{p}"]["versions"]["flags"] for p in measure_peer.PROCESSORS
    )
    assert "native" in native
    assert "native" not in wheel
    tables = {table.name: table for table in peer_tables(document["peers"])}
    assert set(tables["peers"].columns) >= OURS
    assert tables["peers"].rows == ["solo12, stands"]
    assert tables["peers_solo12_stands"].number("condensed WBC", "inside C, p99") > 0.0


def test_the_command_fails_where_one_is_not_comparable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, _ = command(
        tmp_path, monkeypatch, reason="not comparable: 3 of 200 ticks differ from our solution"
    )
    told = capsys.readouterr()
    assert code == 1
    assert "solo12, stands, whole-body QP, ProxQP: not comparable: 3 of 200" in told.err
    assert "what was posed" in told.out  # after all tables
