"""The command line."""

import pytest
from command_line import harpy


@pytest.fixture
def command(monkeypatch, capsys):
    return lambda *arguments: harpy(monkeypatch, capsys, *arguments)
