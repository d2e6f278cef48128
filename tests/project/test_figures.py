"""What README and docs say in sentences is what the tables of the results page show."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from comparison.results import read_blocks
from comparison.tables import number_text

ROOT = Path(__file__).parents[2]
TABLES = read_blocks((ROOT / "docs" / "results.md").read_text(encoding="utf-8"))
FOUND = "paper's governor, tracked, PID, tuned"
PRINTED, BEST, LAW, QP = "paper's governor, as printed", "paper's best variant", "condensed WBC", "WBC QP"

SENTENCES = [
    (
        "README.md",
        f"{{wide/variants|{PRINTED}|fell}} of 210 walks fall with the paper's governor as printed, "
        f"{{wide/variants|{BEST}|fell}} in its best variant, {{wide/variants|{LAW}|fell}} with the condensed WBC and "
        f"{{wide/variants|{QP}|fell}} with the QP",
    ),
    (
        "README.md",
        "Without a governor {wide/variants|no governor|fell} fall, and {wide/variants|contact-force filter|fell} with "
        "the filter",
    ),
    (
        "README.md",
        "{harsh/variants|condensed WBC|fell} of 210 walks fall with the condensed WBC, "
        f"{{harsh/variants|whole-body QP|fell}} with the QP, {{harsh/variants|{FOUND}|fell}} with the paper's best "
        "variant, none with tuned gains and no governor. Feet slip {harsh/variants|condensed WBC|median slip|2}, "
        f"{{harsh/variants|whole-body QP|median slip|2}}, {{harsh/variants|{FOUND}|median slip|2}} and "
        "{harsh/variants|no governor, PID, tuned|median slip|2} mm per step.",
    ),
    (
        "README.md",
        "both WBCs fall in {harsh/variants|condensed WBC, tuned|fell} walk, and slip "
        "{harsh/variants|whole-body QP, tuned|median slip|1} mm.",
    ),
    ("README.md", "in all walks the condensed WBC falls in {damped/variants|condensed WBC|fell} of 48."),
    (
        "docs/governors.md",
        f"It falls in {{wide/variants|{BEST}|fell}} of the [wide campaign](results.md#wide-campaign)'s 210 walks.",
    ),
    (
        "docs/governors.md",
        "feet slip {variants/variants|no governor, PID, tuned|median slip|2} mm per step at the median, against "
        f"{{wide/variants|{BEST}|median slip|2}}.",
    ),
    ("docs/limitations.md", "the condensed WBC falls in {damped/variants|condensed WBC|fell} of 48 walks."),
    (
        "docs/friction.md",
        "at most {ice/ice_compliant_0.15|filter governor, exact, estimate on|worst on ice, mm|2} mm per step with "
        "exact measurements.",
    ),
    (
        "docs/results.md",
        "At friction 0.15, on the contacts in the order of the table, it is "
        "{contacts/contacts_0.15_brief|ours|condensed WBC|2}, "
        "{contacts/contacts_0.15_brief|MuJoCo default|condensed WBC|2}, "
        "{contacts/contacts_0.15_brief|menagerie, 20 mm|condensed WBC|2} and "
        "{contacts/contacts_0.15_brief|Drake|condensed WBC|2} mm, and the shortest of the others "
        "{contacts/contacts_0.15_brief|ours|contact-force filter|2}, "
        "{contacts/contacts_0.15_brief|MuJoCo default|paper's best variant|3}, "
        "{contacts/contacts_0.15_brief|menagerie, 20 mm|contact-force filter|3} and "
        "{contacts/contacts_0.15_brief|Drake|contact-force filter|2}.",
    ),
    (
        "docs/results.md",
        "the gentle walk creeps {contacts/contacts_0.25_brief|MuJoCo default|gentle|1} mm instead of "
        "{contacts/contacts_0.25_brief|MuJoCo default|condensed WBC|2} on the default contact.",
    ),
]
"""Sentences by their page; ``{table|row|column}`` is a figure of the results page, a last number its digits."""

ZERO = [
    ("wide/variants", "condensed WBC, friction estimated", "fell"),
    ("wide/variants", "WBC QP, friction estimated", "fell"),
    ("variants/variants", "no governor, PID, tuned", "fell of 210"),
    ("damped/variants", FOUND, "fell"),
    ("harsh/variants", "no governor, PID, tuned", "fell"),
    ("damped/variants", "no governor, PID, tuned", "fell"),
    *(
        ("wide/variants", row, delay)
        for row in ("no governor", "contact-force filter")
        for delay in ("at 0 ms", "1 ms")
    ),
]
"""Figures that README and docs call none."""


def figure(table: str, row: str, column: str, digits: str = "") -> str:
    """A figure of the results page, without its interval; of a pair the first."""
    text = TABLES[table][row, column].partition(" (")[0].partition(" / ")[0]
    return number_text(float(text), int(digits)) if digits else text


@pytest.mark.parametrize(("page", "sentence"), SENTENCES)
def test_sentences_say_what_the_tables_show(page: str, sentence: str) -> None:
    said = re.sub(r"\{([^}]*)\}", lambda match: figure(*match[1].split("|")), sentence)
    text = (ROOT / page).read_text(encoding="utf-8").replace("*", "")
    assert said in re.sub(r"\s+", " ", text)


@pytest.mark.parametrize("place", ZERO)
def test_none_is_none(place: tuple[str, str, str]) -> None:
    assert figure(*place) == "0"


def test_every_table_that_a_comment_names_is_there() -> None:
    """Made by ``python -m comparison results``: none is empty."""
    assert len(TABLES) > 5
    assert all(TABLES.values())
