"""Environments and workers of the peers."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from comparison.cli import app
from comparison.peers import environment, replaying
from comparison.peers.environment import PEERS, PLAYGROUND, default_folder, install
from comparison.walkers import pattern

ALL = {**PEERS, PLAYGROUND.name: PLAYGROUND}
WORKERS = [*(peer.worker for peer in ALL.values()), pattern.WORKER, Path(replaying.__file__)]


@pytest.mark.parametrize("script", WORKERS, ids=str)
def test_workers_import_nothing_of_ours(script: Path) -> None:
    allowed = {"numpy", "onnxruntime", "placo", "pinocchio", "tsid"} | set(sys.stdlib_module_names)
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {alias.name.split(".")[0] for alias in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert (node.module or "").split(".")[0] in allowed


def test_default_folder_is_in_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "harpy_pin" / "peers"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert default_folder() == tmp_path / "home" / ".cache" / "harpy_pin" / "peers"


def test_failed_installation_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked = []

    def run(command: list[str], **options: Any) -> Any:
        asked.append(command)
        text = "ERROR: No matching distribution found\n\n[notice] a new release of pip\n"
        raise subprocess.CalledProcessError(1, command, "", text)

    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.EnvBuilder, "create", lambda self, folder: None)
    for name, peer in ALL.items():
        assert install(tmp_path, name) == "ERROR: No matching distribution found"
        assert {"--only-binary=:all:", *peer.requirements} <= set(asked[-1])
        pinned = {*peer.requirements, *peer.libraries, *peer.alone} - {"numpy"}
        assert all("==" in requirement for requirement in pinned)


def test_installation_ends_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(command: list[str], **options: Any) -> Any:
        if any("placo" in word for word in command):
            raise subprocess.TimeoutExpired(command, options["timeout"])
        return subprocess.CompletedProcess(command, 0, str(tmp_path), "")

    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.EnvBuilder, "create", lambda self, folder: None)
    with pytest.raises(SystemExit) as ended:
        app(["peers", "--install", "--folder", str(tmp_path)])
    assert ended.value.code == 1
    assert capsys.readouterr().out.splitlines() == [
        "placo: cannot be installed: not installed after 600 s",
        "TSID: installed",
        "TSID-C++: installed",
        "Playground: installed",
    ]


def test_installation_leaves_foreign_folders_alone(tmp_path: Path) -> None:
    for name in ALL:
        (tmp_path / name.lower()).mkdir()
        (tmp_path / name.lower() / "thesis.tex").write_text("precious")
        assert "no virtual environment" in install(tmp_path, name)
        assert (tmp_path / name.lower() / "thesis.tex").read_text() == "precious"
