"""What README and docs say is what the tables of the results page show."""

import re
from pathlib import Path

import pytest

from comparison.report.pages import read_blocks
from comparison.tables import number_text

ROOT = Path(__file__).parents[2]
TABLES = {
    name: cells
    for page in ("results.md", "terrain.md", "friction.md", "worlds.md")
    for name, cells in read_blocks((ROOT / "docs" / page).read_text(encoding="utf-8")).items()
}
FOUND = "paper's governor, tracked, PID, tuned"
WRONG = "assumption/assumption_0.15"
PRINTED, BEST, LAW, QP = (
    "paper's governor, as printed",
    "paper's best variant",
    "condensed WBC",
    "WBC QP, own search",
)
PID, TIMING = "no governor, PID, tuned", "comparison/timing"
ACTIVE, PROXQP = "WBC QP, own search", "WBC QP, ProxQP"


def ratio(above: str, below: str, place: str = "") -> str:
    """The place of a ratio of two medians of a tick."""
    return (
        "{" + " / ".join(f"comparison/ticks|{row}|{place}median" for row in (above, below)) + "|2}"
    )


def solve(how: str, digits: int) -> str:
    """The place of the median of a solve over that of the governor's update."""
    update = f"{TIMING}|update of the paper's governor|median"
    return f"{{{TIMING}|solve, {how}|median / {update}|{digits}}}"


OF_QP, OF_QP_C = ratio(LAW, ACTIVE), ratio(LAW, ACTIVE, "inside C, ")
OF_PAPER, OF_PAPER_C = ratio(LAW, PRINTED), ratio(LAW, PRINTED, "inside C, ")
HARSH, DAMPED = f"harsh/variants|{LAW}", "damped/variants"
DELAYED = "delay/delay_walks_0.25"
ICE = "ice/ice_compliant_0.15"

SENTENCES = {
    "README.md": [
        f"By ProxQP a tick takes {ratio(PROXQP, PRINTED)} times that of the paper's governor.",
        f'(`solver="active_set"`, own search) it takes {ratio(ACTIVE, PRINTED)} times.',
        f"The condensed WBC reaches the same optimum at {OF_PAPER} times the governor's tick.",
        f"It takes a fifteenth of the QP's time by ProxQP, {OF_QP} of its time by own search",
        f"feet slip {{variants/variants|{PID}|median slip|2}} mm per step "
        f"instead of the condensed WBC's {{wide/variants|{LAW}|median slip|2}}.",
        f"({{comparison/campaign|{LAW}|thrust, rms, N|2}} N instead of "
        "{comparison/campaign|no governor|thrust, rms, N|2})",
        f"with 30 ms of delay it slides {{{DELAYED}|{LAW}|30 ms, mm}} mm per step",
    ],
    "docs/governors.md": [
        f"It falls in {{wide/variants|{BEST}|fell}} of the [wide "
        f"campaign](results.md#wide-campaign)'s 210 walks.",
        f"feet slip {{variants/variants|{PID}|median slip|2}} mm per step at the median, against "
        f"{{wide/variants|{BEST}|median slip|2}}.",
    ],
    "docs/limitations.md": [
        "they fall where an ungoverned walk stands: in {limits/limits|condensed WBC|joint "
        "friction: fell} walks."
    ],
    "docs/friction.md": [
        f"at most {{{ICE}|filter governor, exact, estimate on|worst on ice, mm|2}} mm per step "
        f"with exact "
        "measurements.",
        "slip is at most {limits/limits|condensed WBC, joint friction estimated|joint friction: "
        "worst slip, mm} mm "
        "per step.",
        f"{{{WRONG}|{LAW}|+50%}} mm at +50 % on a ground of 0.15, and {{{WRONG}|{LAW}|+150%}} mm "
        f"at +150 %. "
        f"With the estimate the latter is {{{WRONG}|{LAW}, friction estimated|+150%}} mm.",
        f"with the estimate {{{WRONG}|contact-force filter, friction estimated|+30%}} mm on a "
        f"ground of 0.15.",
        f"the estimate costs it: {{{WRONG}|contact-force filter, friction estimated|right}} mm "
        f"instead of "
        f"{{{WRONG}|contact-force filter|right}}.",
    ],
    "docs/condensed.md": [
        f"the same optimum in {OF_QP} of the time, inside C in {OF_QP_C}",
        "Ungoverned walks stand there, too; they slip up to {limits/limits|no governor|limits: "
        "worst slip, mm} mm per "
        "step, the condensed WBC {limits/limits|condensed WBC|limits: worst slip, mm|2}.",
    ],
    "docs/embedded.md": [
        f"WBC's median tick takes {{embedded/embedded|Harpy, {LAW}|ms at 168 MHz}} to"
    ],
    "docs/steering.md": [
        "with 10 N·s {steering/steering_pushes|10 N·s, condensed|fell} walks fall, with 12 N·s "
        "{steering/steering_pushes|12 N·s, condensed|fell}."
    ],
    "docs/results.md": [
        f"takes {OF_QP} of the time of the [WBC QP](glossary.md)'s by own search, and {OF_PAPER} "
        f"times that of the "
        f"paper's governed controller; inside C {OF_QP_C} and {OF_PAPER_C}.",
        f"The solve of the WBC QP alone takes {solve('own search', 1)} times as long as the update "
        f"of the "
        f"paper's governor with an active-set warm start, {solve('DAQP from scratch', 2)} times "
        f"with DAQP from "
        f"scratch, and {solve('ProxQP, warm', 2)} times with warm ProxQP;",
        "the gentle walk creeps {contacts/contacts_0.25_brief|MuJoCo default|gentle|1} mm instead "
        "of "
        "{contacts/contacts_0.25_brief|MuJoCo default|condensed WBC|2} on the default contact.",
    ],
}
"""Sentences by their page; ``{table|row|column}`` is a figure, with ``/`` a ratio, with a digit
rounded.
"""

ZERO = [
    *(
        ("wide/variants", f"{who}{end}", "fell")
        for who in (LAW, QP)
        for end in ("", ", no friction estimate")
    ),
    ("variants/variants", PID, "fell of 210"),
    ("damped/variants", FOUND, "fell"),
    ("harsh/variants", PID, "fell"),
    ("damped/variants", PID, "fell"),
    *(
        ("wide/variants", row, delay)
        for row in ("no governor", "contact-force filter")
        for delay in ("at 0 ms", "1 ms")
    ),
    *(("limits/limits", row, "limits: fell") for row in ("no governor", LAW, QP)),
    ("limits/limits", "condensed WBC, joint friction estimated", "joint friction: fell"),
    *(
        (ICE, f"{who}, {what}, estimate on", "fell")
        for who in (LAW,)
        for what in ("exact", "noise, 2 ms")
    ),
    (ICE, "paper governor, exact, estimate off", "fell"),
    *(
        ("steering/steering_commands", f"{what}, compliant, {who}", "fell")
        for what in ("course", "random", "absurd")
        for who in ("condensed", "QP")
    ),
]
"""Figures that README and docs call none."""

RATIOS = [
    ("docs/results.md", "slip 2 times as far", f"{HARSH}, no friction estimate", HARSH, 2.0),
    ("docs/limitations.md", "slide 20 times as far", f"{DAMPED}|{PID}", f"{DAMPED}|{LAW}", 20.0),
]
"""What words say of two median slips: the page, the words, the rows, and their ratio within a
tenth.
"""

FELL = [
    *((DELAYED, f"PID, {who}", "2 ms, mm") for who in ("none", "paper", "filter")),
    (ICE, "paper governor, exact, estimate on", "fell"),
    *(
        ("grounds/grounds_0.15_path", "paper's governor", f"{stiffness} kN/m")
        for stiffness in (4, 8, 80)
    ),
]
STOOD = [
    *((DELAYED, who, "30 ms, mm") for who in (LAW, "QP")),
    *((DELAYED, f"feedforward, {who}", "3 ms, mm") for who in ("none", "paper", "filter")),
]
"""Walks of which docs say that they fell, or did not."""


def figure(table: str, row: str, column: str) -> str:
    """A figure of the results page, without its interval; of a pair the first."""
    return TABLES[table][row, column].partition(" (")[0].partition(" / ")[0]


def said(place: str) -> str:
    """The text of a figure, or of the ratio of two."""
    digits = re.search(r"\|(\d)$", place)
    parts = (place[: digits.start()] if digits else place).split(" / ")
    texts = [figure(*part.split("|")) for part in parts]
    if not digits:
        return texts[0]
    value = float(texts[0]) / (float(texts[1]) if len(texts) > 1 else 1.0)
    return number_text(value, int(digits[1]))


@pytest.mark.parametrize(
    ("page", "sentence"), [(page, text) for page, texts in SENTENCES.items() for text in texts]
)
def test_sentences_say_what_the_tables_show(page: str, sentence: str) -> None:
    filled = re.sub(r"\{([^}]*)\}", lambda match: said(match[1]), sentence)
    text = (ROOT / page).read_text(encoding="utf-8").replace("*", "")
    assert filled in re.sub(r"\s+", " ", text)


@pytest.mark.parametrize("place", ZERO)
def test_none_is_none(place: tuple[str, str, str]) -> None:
    assert figure(*place).partition(" of ")[0] == "0"


@pytest.mark.parametrize(("page", "words", "above", "below", "ratio"), RATIOS)
def test_words_say_what_the_tables_show(
    page: str, words: str, above: str, below: str, ratio: float
) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert words in re.sub(r"\s+", " ", text)
    shown = float(figure(*above.split("|"), "median slip")) / float(
        figure(*below.split("|"), "median slip")
    )
    assert shown == pytest.approx(ratio, rel=0.1)


@pytest.mark.parametrize("place", [*FELL, *STOOD])
def test_who_fell(place: tuple[str, str, str]) -> None:
    text = figure(*place)
    fell = not text.startswith("0 of") if " of " in text else text.startswith("fell")
    assert fell == (place in FELL)


def test_a_fifteenth_is_a_fifteenth() -> None:
    """README's word for the condensed WBC's tick over that of the QP by ProxQP."""
    assert 0.06 < float(said(ratio(LAW, PROXQP)[1:-1])) < 0.073


@pytest.mark.parametrize("page", ["README.md", "docs/worlds.md"])
def test_falls_of_torques_alone_are_those_of_all_models(page: str) -> None:
    table = TABLES["worlds/worlds_falls"]
    cells = [text.split(" of ") for (row, _), text in table.items() if row == "torque alone"]
    fell, walks = (sum(map(int, numbers)) for numbers in zip(*cells, strict=True))
    text = re.sub(r"[\s*]+", " ", (ROOT / page).read_text(encoding="utf-8"))
    assert f"torques alone of the condensed WBC fall in {fell} of {walks} walks" in text


def test_every_table_that_a_comment_names_is_there() -> None:
    """Made by ``python -m comparison results``: none is empty."""
    assert len(TABLES) > 5
    assert all(TABLES.values())
