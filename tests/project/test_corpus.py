"""Inputs that once broke something, used again."""

import contextlib
import shutil
from pathlib import Path

import pytest
from entrances import ENTRANCES
from hostile_lines import nothing_works

CORPUS = Path(__file__).parent / "corpus"
KEPT = sorted(path for path in CORPUS.rglob("*") if path.is_file())


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kept", KEPT, ids=lambda path: f"{path.parent.name} {path.name}")
def test_is_answered_in_one_line(kept, tmp_path):
    kind = kept.parent.name
    given = shutil.copy(kept, tmp_path / f"input.{kind}")
    with nothing_works(tmp_path) if kind == "command" else contextlib.nullcontext():
        ENTRANCES[kind](Path(given))


def test_every_kind_is_there_and_small():
    assert {path.parent.name for path in KEPT} == set(ENTRANCES)
    assert max(path.stat().st_size for path in KEPT) < 50_000
