"""Walks whose controllers are wrong about the friction of the ground."""

from comparison.studies.assumption import STUDY


def test_a_wrong_friction_makes_feet_slip_beyond_the_margin():
    """The margin of 0.4 covers an error of 150 %; an estimate brings most of what is beyond it back."""
    rows = STUDY.run(quick=True, walkers=("governed/none", "condensed"), errors=(0.0, 1.5, 4.0))
    slip = {(row["walker"], row["estimate"], row["error"]): row["slip_mm_per_step"] for row in rows}
    right, within, wrong = (slip["condensed", False, error] for error in (0.0, 1.5, 4.0))
    estimated = slip["condensed", True, 4.0]
    assert within < 3.0 * right < wrong
    assert estimated < 0.5 * wrong
    assert slip["governed/none", False, 0.0] == slip["governed/none", False, 4.0]  # it assumes nothing
