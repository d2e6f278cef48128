"""Environments of the peers: their installation, and what it leaves alone."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from comparison.cli import app
from comparison.peers import environment
from comparison.peers.environment import PEERS, WORLDS, install

ALL = {**PEERS, WORLDS.name: WORLDS}


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
    placo, *others = capsys.readouterr().out.splitlines()
    assert placo == "placo: cannot be installed: not installed after 600 s"
    assert others == [f"{name}: installed" for name in ALL if name != "placo"]


def test_installation_leaves_foreign_folders_alone(tmp_path: Path) -> None:
    for name in ALL:
        (tmp_path / name.lower()).mkdir()
        (tmp_path / name.lower() / "thesis.tex").write_text("precious")
        assert "was not made by this command" in install(tmp_path, name)
        assert (tmp_path / name.lower() / "thesis.tex").read_text() == "precious"
