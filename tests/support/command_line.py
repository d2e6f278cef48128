"""Commands run in this process."""

import sys
from pathlib import Path

import pytest

from harpy_pin.cli import app as cli
from reproduction import cli as reproduction

ROOT = Path(__file__).resolve().parents[2]


def harpy(monkeypatch, capsys, *arguments: object):
    """Run the command in this process: exit code, standard output, standard error."""
    app = reproduction if arguments[:1] and arguments[0] in ("gait", "paper", "vlip") else cli
    monkeypatch.setattr(sys, "argv", ["harpy", *map(str, arguments)])
    with pytest.raises(SystemExit) as ending:
        app.main()
    captured = capsys.readouterr()
    return ending.value.code or 0, captured.out, captured.err
