"""Budgets of the house: statements of each part and of a file, words of the docs, and public names.

A count is a thermometer. Where one statement more reads better, write it, and raise the number.
"""

import ast
import json
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

import harpy_pin

ROOT = Path(__file__).resolve().parents[2]
CONTRIB = "harpy_pin/contrib/"
STATEMENTS = {
    "harpy_pin": 26_240,
    CONTRIB: 5_285,
    "reproduction": 1_990,
    "comparison": 7_200,
    "tests": 29_060,
}
"""Most statements of the Python files that Git tracks in a folder; ``harpy_pin`` is without
contrib.
"""
LONGEST_FILE = 350
"""Most statements of a file."""
MOST_PUBLIC_NAMES = 73
MOST_WORDS = 20_000
"""Of prose in README, docs and notebooks, without tables, code, formulas and comments."""


def statements_of(folder: str) -> dict[str, int]:
    listed = subprocess.run(
        ["git", "ls-files", "-z", folder], cwd=ROOT, capture_output=True, text=True
    )
    if listed.returncode:
        pytest.skip("not a checkout")
    names = [
        name
        for name in listed.stdout.split("\0")
        if name.endswith(".py") and (ROOT / name).is_file()
    ]
    return {name: statements(ROOT / name) for name in names}


@cache
def statements(path: Path) -> int:
    return sum(isinstance(node, ast.stmt) for node in ast.walk(ast.parse(path.read_bytes())))


@pytest.mark.parametrize("folder", STATEMENTS)
def test_statements_of_a_folder(folder):
    found = {
        name: count
        for name, count in statements_of(folder).items()
        if folder == CONTRIB or CONTRIB not in name
    }
    assert sum(found.values()) <= STATEMENTS[folder]


def test_no_file_is_long():
    assert {name: count for name, count in statements_of(".").items() if count > LONGEST_FILE} == {}


def test_words_of_the_docs():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    texts = [page.read_text() for page in pages]
    for path in (ROOT / "docs").rglob("*.ipynb"):
        cells = json.loads(path.read_text())["cells"]
        texts += ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    texts = [
        re.sub(r"```.*?```|\$\$.*?\$\$|<!--.*?-->|^ *\|[^\n]*$", "", text, flags=re.S | re.M)
        for text in texts
    ]
    assert sum(len(text.split()) for text in texts) <= MOST_WORDS


def test_public_names():
    assert len(harpy_pin.__all__) <= MOST_PUBLIC_NAMES
