"""Tables of README and docs: each is what its record says, and none has measured figures without a
record.
"""

import re
from pathlib import Path

import pytest

from comparison.cli.results import fill_pages, pages, recorded
from comparison.report.pages import blocks_of, filled
from comparison.report.record import FOLDER, Record
from comparison.tables import Cell, Table
from harpy_pin.errors import InputError, RunFileError

ROOT = Path(__file__).parents[2]
PAGES = {str(path.relative_to(ROOT)): text for path, text in pages(ROOT).items()}
BLOCKS = {
    f"{page}:{table}{f':{k}' if k else ''}": block
    for page, text in PAGES.items()
    for table, blocks in blocks_of(text).items()
    for k, block in enumerate(blocks)
}
"""Every table with a comment, by its place."""

NOT_MEASURED = {
    ("docs/condensed.md", "How it is solved"): "steps of a tick",
    ("docs/equations.md", "Equations, numbers and claims"): "symbols",
    ("docs/equations.md", "E8 Rates of the explicit reference governor"): "equations",
    ("docs/equations.md", "Weaknesses of Algorithm 1"): "derived on the page",
    ("docs/equations.md", "§3 Numbers"): "settings",
    ("docs/estimation.md", "On a log of your own"): "columns",
    ("docs/gaits.md", "A gait of your own"): "shapes",
    ("docs/governors.md", "Governors"): "classes",
    ("docs/governors.md", "Variants of the paper's governor"): "settings",
    ("docs/gym.md", "Any robot"): "terms of the reward",
    ("docs/identification.md", "The log"): "columns",
    ("docs/identification.md", "Which numbers to trust"): "frequencies of a motion",
    ("docs/kernels.md", "How it becomes C"): "variables of the environment",
    (
        "docs/related_work.md",
        "Whole-body control with a small program",
    ): "other people's, with their source",
    ("docs/related_work.md", "Governors and filters"): "other people's, with their source",
    ("docs/related_work.md", "The paper's laboratory"): "other people's, with their source",
    ("docs/simulation.md", "MuJoCo"): "settings",
    ("docs/terrain.md", "Kinds"): "settings",
    ("docs/thrusters.md", "Thrusters as they are"): "other people's, with their source",
    ("docs/walking.md", "Beside other walkers"): "other people's, with their source",
    ("docs/whole_body.md", "Weights to begin with"): "settings",
}
"""Tables with numbers that no command of ours prints, by page and heading, and what their numbers
are.
"""

_COMMENTED = re.compile(r"<!-- figures\n.*?\n-->\n(?:\|[^\n]*\n)*", re.DOTALL)
_PARTS = re.compile(r"^(?:```.*?^```|#+ [^\n]*|(?:\|[^\n]*\n?)+)", re.DOTALL | re.MULTILINE)
_NO_FIGURES = re.compile(r"`[^`]*`|!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)")
"""Code, what pictures show, and where links go."""


def bare_tables(page: str) -> list[str]:
    """Headings above the tables of a page with numbers and without a comment."""
    found, heading = [], ""
    for part in _PARTS.findall(_COMMENTED.sub("", page)):
        if part.startswith("#"):
            heading = part.lstrip("# ")
        elif part.startswith("|") and re.search(r"(?<!\w)\d", _NO_FIGURES.sub("", part)):
            found.append(heading)
    return found


@pytest.mark.parametrize("place", BLOCKS)
def test_each_table_is_what_its_record_says(place: str) -> None:
    assert filled(BLOCKS[place], recorded(FOLDER)) == BLOCKS[place]


@pytest.mark.parametrize("page", PAGES)
def test_no_table_has_figures_without_a_record(page: str) -> None:
    found = {(page, heading) for heading in bare_tables(PAGES[page])}
    assert found == {place for place in NOT_MEASURED if place[0] == page}


def test_which_tables_have_figures() -> None:
    page = """# A
<!-- figures
table = "s/t"
-->
| | slip |
| --- | ---: |
| a | 1 |

## B
| `8` | G1 | [x](3.md) | ![1](2.png) |
|---|---|---|---|

```text
| 5 |
```

### C
text
| a |
|---|
| 0.5 mm |
"""
    assert bare_tables(page) == ["C"]


TABLE = Table("walks", "Slip", (Cell("none", "slip", 12.5, "mm"), Cell("wbc", "slip", 0.25, "mm")))
COMMENT = '<!-- figures\ntable = "study/walks"\nrows = ["wbc", "none"]\n-->\n'


@pytest.fixture
def page(tmp_path: Path) -> Path:
    """A page that was filled from the record beside it."""
    Record.of("python -m comparison study", {}, [TABLE]).save("study", tmp_path)
    page = tmp_path / "README.md"
    page.write_text(f"# Page\n\n{COMMENT}\nText.\n", encoding="utf-8")
    fill_pages(tmp_path, tmp_path)
    return page


def test_a_changed_digit_differs_from_the_record(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "| wbc | 0.25 |" in text
    assert filled(text, recorded(page.parent)) == text
    changed = text.replace("0.25", "0.24")
    assert filled(changed, recorded(page.parent)) == text != changed


def test_a_row_that_is_not_printed_any_more_is_refused(page: Path) -> None:
    rest = Table(TABLE.name, TABLE.title, TABLE.cells[:1])
    Record.of("python -m comparison study", {}, [rest]).save("study", page.parent)
    with pytest.raises(InputError, match="the table 'walks' has no row 'wbc'"):
        filled(page.read_text(encoding="utf-8"), recorded(page.parent))


def test_a_record_that_is_gone_is_refused(page: Path) -> None:
    (page.parent / "study.json").unlink()
    with pytest.raises(RunFileError, match="nothing is recorded of 'study'"):
        filled(page.read_text(encoding="utf-8"), recorded(page.parent))
