"""Command lines drawn from a seed, for all three programs: no traceback, and one line for every error.

Nothing is walked: where a command would begin to, its arguments have been accepted. ``--fuzz 20`` is 2,000 lines.
"""

from __future__ import annotations

import numpy as np
import pytest
from command_lines import commands, run_line, stop_before_work
from hostile import choose
from hostile_lines import draw, write_files

LINES = 100


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Files of the names above, good and bad, in the folder of the commands."""
    write_files(tmp_path)
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("files")
def test_hostile_lines(monkeypatch, capsys, fuzz):
    rng, table = np.random.default_rng(1), list(commands())
    assert len(table) > 25
    stop_before_work(monkeypatch)
    for _ in range(LINES * fuzz):
        line = draw(rng, choose(rng, table))
        code, out, err = run_line(line, monkeypatch, capsys)
        assert code in (None, 0, 1, 2), line
        if code and "Usage" not in out + err:
            assert len(err.strip().splitlines()) == 1, (line, err)
