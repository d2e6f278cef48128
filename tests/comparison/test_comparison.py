"""The whole comparison: its document and its command line."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from comparison.cli import main
from comparison.cli.studies import STUDIES
from comparison.sections.timing import ROWS
from harpy_pin.errors import install_line

ROOT = Path(__file__).resolve().parents[2]


def test_document_has_its_schema(whole_document: dict[str, Any]) -> None:
    document = whole_document
    timing = document["timing"]
    assert all(timing[part]["samples"] > 0 for part in ROWS)
    for measures in document["walk"].values():
        for share in ("sliding", "low_force", "no_contact"):
            assert 0.0 <= measures[share] <= 1.0
    checks = document["checks"]
    assert checks["passed"] is True
    for activity in document["activity"].values():
        assert activity["strained_rows_violated"] > 0.9
    differing = checks["commands_differing_by_controller"]
    assert not any(count for name, count in differing.items() if name != "wbc")
    assert checks["commands_compared"] == 2 * 2 * 8 * 250  # repetitions, sequences, replays, ticks
    for solver in ("proxqp", "own"):
        assert checks[f"{solver}_solves"] == 2 * 250
        assert (
            checks[f"{solver}_fallbacks"]
            == checks[f"{solver}_failures"]
            == checks[f"{solver}_not_optimal"]
            == 0
        )
    assert document["settings"]["friction"] == 0.25
    assert document["machine"]["cpu"]
    assert document["versions"]["pin"] != "not installed"
    assert len(document["limitations"]) > 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--json", "{tmp}/missing/x.json"), "no folder"),
        (("--json", "{tmp}"), "it is a folder"),
        (("--friction", "-0.5"), "friction must be finite"),
        (("--duration", "nan"), "duration must be finite"),
        (("--duration", "0.01"), "duration must be finite and"),
        (("--seed", "-1"), "seed must be"),
    ],
)
def test_command_line_errors_are_one_line(
    arguments: Sequence[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(
        sys, "argv", ["comparison", *(a.replace("{tmp}", str(tmp_path)) for a in arguments)]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


WITHOUT = """
import contextlib, io, json, runpy, sys
sys.modules |= dict.fromkeys(('pandas', 'piqp', 'matplotlib'))
done = []
for arguments in json.loads(sys.argv[1]):
    sys.argv[1:], out, err, code = arguments, io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            runpy.run_module('comparison', run_name='__main__')
        except SystemExit as end:
            code = end.code
    done.append((code, out.getvalue(), err.getvalue()))
print(json.dumps(done))
"""


def test_without_extras_there_is_the_help_and_what_is_missing_is_one_line() -> None:
    lines = [(), ("slip", "--quick"), ("--help",), ("slip", "--help")]
    command = [sys.executable, "-c", WITHOUT, json.dumps(lines)]
    ended = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=True
    )
    *refused, (code, out, _), (_, of_slip, _) = json.loads(ended.stdout)
    needed = "'pandas' and 'piqp'"
    assert refused == 2 * [
        [1, "", f"error: the comparison needs {needed}: {install_line('compare')}\n"]
    ]
    assert code == 0
    assert all(f"  {name} " in out for name in STUDIES)
    assert install_line("compare") in " ".join(out.split())
    assert "Walk every controller on ever more slippery ground." in of_slip
