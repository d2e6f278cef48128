"""Command lines drawn from a seed, for all three programs: no traceback, and one line for every error.

Nothing is walked: where a command would begin to, its arguments have been accepted. ``--fuzz 20`` is 2,000 lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from command_lines import commands, run_line, stop_before_work
from hostile import choose

import harpy_pin as hp

LINES = 100
VALUES = (
    *("nan", "inf", "-1", "0", "1", "2", "0.3", "1e300", "1e-300", "1e999", "9" * 400, "x", "", "=", "0x10", "1,5"),
    *("1:2", "1:0,1,0", "0:1:0.1", "nan:nan:nan", "1:2:3:4", "0.3 0 0", "0.3 0 0; 2s 0 0 0.1", "1e308s 0 0 0"),
    *("harpy", "go2", "iris", "condensed", "wbc", "governed", "paper", "filter", "none", "hand", "commanded", "mujoco"),
    *("stiff", "per_axis", "feedforward", "tracked", "middle", "polar", "double", "run.npz", "bad.npz", "bad.json"),
    *("bad.urdf", "dir", "dir/x.npz", "nodir/x", "/dev/null", "x.png", "x.gif", "x.html", "0:1", "1:0", "10x10", "0x0"),
    *("99999x99999", "1,2,nan", ".", "..", "/", "[bold]", "\udcff", "ü", "a" * 300, "--", "-", "x" * 5000, "tcp://x:1"),
)


def draw(rng: np.random.Generator, table: list[Any]) -> list[str]:
    """A command line."""
    program, name, declared, arguments = choose(rng, table)
    options = [(text, option.kind is bool) for option in declared for text in option.names]
    line = [program, *name]
    for _ in range(int(rng.integers(0, 3)) if arguments else 0):
        line.append(choose(rng, VALUES))
    for _ in range(int(rng.integers(0, 4)) if options else 0):
        option, switch = choose(rng, options)
        value = choose(rng, VALUES)
        if switch and rng.integers(8):
            line.append(option)
        else:
            line += [f"{option}={value}"] if rng.integers(2) else [option, value]
    return line if rng.integers(15) else [*line, choose(rng, VALUES)]


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Files of the names above, good and bad, in the folder of the commands."""
    hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01), save=tmp_path / "run.npz")
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04junk")
    (tmp_path / "bad.json").write_text('{"timing": 1, "walk": [], "settings": {}, "machine": {}, "versions": {}}')
    (tmp_path / "bad.urdf").write_text("<robot")
    (tmp_path / "dir").mkdir()
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("files")
def test_hostile_lines(monkeypatch, capsys, fuzz):
    rng, table = np.random.default_rng(1), list(commands())
    assert len(table) > 25
    stop_before_work(monkeypatch)
    for _ in range(LINES * fuzz):
        line = draw(rng, table)
        code, out, err = run_line(line, monkeypatch, capsys)
        assert code in (None, 0, 1, 2), line
        if code and "Usage" not in out + err:
            assert len(err.strip().splitlines()) == 1, (line, err)
