"""Code in README, docs and tutorials: every Python block runs, in the order of its page, and prints
what is shown.

No line of it is wider than a page of the site shows.
"""

import contextlib
import io
import linecache
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pytest

import harpy_pin as hp

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHOWN = [*PAGES[1:], ROOT / "CONTRIBUTING.md", ROOT / "examples" / "embedded" / "README.md"]
"""Pages whose code is at most ``WIDTH`` wide; each of README's commands is one line, which the site
wraps.
"""
WIDTH = 100
"""Columns of code that a page of the site shows at 1,280 pixels."""
NEEDS = re.compile(r"<!-- needs (.+) -->")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass
class Block:
    """A fenced block: where it begins, its language, its text, and the package or file of the
    reader that it needs.
    """

    line: int
    language: str
    text: str
    needs: str | None


def blocks(page: Path) -> list[Block]:
    found, lines = [], page.read_text().splitlines()
    begin: int | None = None
    for number, line in enumerate(lines):
        if line.startswith("```"):
            if begin is None:
                begin = number
            else:
                needs = NEEDS.fullmatch(lines[begin - 1]) if begin else None
                text = "\n".join(lines[begin + 1 : number]) + "\n"
                found.append(
                    Block(begin + 1, lines[begin][3:].strip(), text, needs[1] if needs else None)
                )
                begin = None
    assert begin is None, f"{page}: a block is not closed"
    return found


def wide_lines(text: str) -> list[int]:
    """Numbers of lines of code over ``WIDTH``: in fences, but those of formulas, or indented by
    four spaces.
    """
    found, fence = [], ""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("```"):
            fence = "" if fence else line
        elif len(line) > WIDTH and fence != "```math" and (fence or line.startswith("    ")):
            found.append(number)
    return found


def same(printed: str, shown: str) -> bool:
    """Equal words, and numbers equal to a tenth or to one of their last digit."""
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", shown).split():
        return False
    for a, b in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
        digit = 10.0 ** -len(b.partition(".")[2]) if "." in b else 0.0
        if abs(float(a) - float(b)) > max(1.01 * digit, 0.1 * abs(float(b)) if digit else 0.0):
            return False
    return True


WITH_CODE = [page for page in PAGES if any(block.language == "python" for block in blocks(page))]


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: str(page.relative_to(ROOT)))
def test_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"hp": hp, "np": np, "__name__": "page"}  # guides may leave their imports out
    if page.parent.name == "tutorials":
        names = {"__name__": "page"}
    printed = ""
    for block in blocks(page):
        if block.language == "python":
            if block.needs:
                try:
                    distribution(block.needs)
                except PackageNotFoundError:
                    printed = ""
                    continue
            out, text = io.StringIO(), "\n" * block.line + block.text
            lines = text.splitlines(keepends=True)
            linecache.cache[str(page)] = (
                len(text),
                None,
                lines,
                str(page),
            )  # from which kernels are translated
            with contextlib.redirect_stdout(out):
                exec(compile(text, str(page), "exec"), names)
            printed = out.getvalue()
        elif block.language == "text" and printed:
            assert same(printed, block.text), (
                f"{page.name}:{block.line} shows\n{block.text}\nand printed\n{printed}"
            )


QUOTED = re.compile(r"<!-- from (.+) -->\n```py\n(.*?)```", re.DOTALL)
"""Lines of a kernel beside their formula, and the file that they are from."""


def test_quoted_lines_are_those_of_the_source() -> None:
    quotes = [quote for page in PAGES for quote in QUOTED.findall(page.read_text())]
    assert len(quotes) >= 3
    for file, text in quotes:
        lines = [line.strip() for line in (ROOT / file).read_text().splitlines()]
        assert "\n".join(map(str.strip, text.splitlines())) in "\n".join(lines), (
            f"not in {file}:\n{text}"
        )


def test_what_is_compared() -> None:
    assert same("slip 0.081 mm, 2000 rows", "slip 0.08 mm, 2000 rows")
    assert not same("slip 0.12 mm, 2000 rows", "slip 0.08 mm, 2000 rows")
    assert not same("slip 0.08 mm, 2001 rows", "slip 0.08 mm, 2000 rows")
    assert not same("slip of 0.08 mm, 2000 rows", "slip 0.08 mm, 2000 rows")
    assert len(WITH_CODE) >= 8


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs" / "tutorials").glob("*.md")), ids=lambda page: page.stem
)
def test_what_a_tutorial_shows_follows_its_code(page: Path) -> None:
    """A block of output belongs to the Python block before it, so none is left unchecked."""
    languages = [block.language for block in blocks(page)]
    for before, after in zip(["", *languages], languages, strict=False):
        assert after in ("python", "text", "bash")
        assert after != "text" or before == "python"


@pytest.mark.parametrize("page", SHOWN, ids=lambda page: str(page.relative_to(ROOT)))
def test_lines_of_code_are_as_wide_as_a_page_shows(page: Path) -> None:
    wide = [f"{page.relative_to(ROOT)}:{number}" for number in wide_lines(page.read_text())]
    assert not wide, f"more than {WIDTH} columns of code: {', '.join(wide)}"


def test_what_is_wide() -> None:
    full, wide = "x" * WIDTH, "x" * (WIDTH + 1)
    assert wide_lines(
        f"{wide}\n```text\n{full}\n{wide}\n```\n{wide}\n    {full}\n    {full[4:]}"
    ) == [4, 7]
    assert wide_lines(f"```math\n{wide}\n    {wide}\n```\n```\n{wide}\n```") == [6]
