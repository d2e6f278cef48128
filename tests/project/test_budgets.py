"""Budgets of the house: lines of each part, lines of a file, words of the docs, and public names."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

import harpy_pin

ROOT = Path(__file__).resolve().parents[2]
CONTRIB = "harpy_pin/contrib/"
LINES = {"harpy_pin": 38_764, CONTRIB: 3_059, "reproduction": 3_772, "comparison": 10_986, "tests": 31_550}
"""Most lines of the Python files that Git tracks in a folder; those of ``harpy_pin`` are counted without contrib."""
LONGEST_FILE = 450
MOST_PUBLIC_NAMES = 70
MOST_WORDS = 17_433
"""Of prose in README, docs and notebooks, without tables, code, formulas and comments."""


def lines_of(folder: str) -> dict[str, int]:
    listed = subprocess.run(["git", "ls-files", "-z", folder], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a checkout")
    names = [name for name in listed.stdout.split("\0") if name.endswith(".py") and (ROOT / name).is_file()]
    return {name: (ROOT / name).read_bytes().count(b"\n") for name in names}


@pytest.mark.parametrize("folder", LINES)
def test_lines_of_a_folder(folder):
    counted = {name: count for name, count in lines_of(folder).items() if folder == CONTRIB or CONTRIB not in name}
    assert sum(counted.values()) <= LINES[folder]


def test_no_file_is_long():
    assert {name: count for name, count in lines_of(".").items() if count > LONGEST_FILE} == {}


def test_words_of_the_docs():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    texts = [page.read_text() for page in pages]
    for path in (ROOT / "docs").rglob("*.ipynb"):
        cells = json.loads(path.read_text())["cells"]
        texts += ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    texts = [re.sub(r"```.*?```|\$\$.*?\$\$|<!--.*?-->|^ *\|[^\n]*$", "", text, flags=re.S | re.M) for text in texts]
    assert sum(len(text.split()) for text in texts) <= MOST_WORDS


def test_public_names():
    assert len(harpy_pin.__all__) <= MOST_PUBLIC_NAMES
