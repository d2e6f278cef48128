"""Who breaks first: counts, ranks and tables of a campaign made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from comparison.campaign.breaking import breaking_tables
from comparison.campaign.plan import code_digest, plan
from comparison.campaign.ranking import falls_less, slip_median, slips_less
from comparison.campaign.settings import CampaignSettings
from comparison.campaign.summary import summarise_rows

SETTINGS = CampaignSettings.wide(
    walks=180,
    contenders=("governed/none", "condensed", "wbc"),
    frictions=(0.12, 0.55),
    pushes=(0.0, 8.0),
    plants=("compliant", "mujoco"),
)
"""Sixty scenarios."""
SLIP = {"governed/none": 3.0, "condensed": 0.200, "wbc": 0.215}
"""mm per step of every walk; the last two differ by less than 0.02 mm and by less than a tenth."""


def by_hand() -> dict[str, Any]:
    """Without a governor all fall at a push in MuJoCo, the QP in one scenario only, the condensed controller never."""
    tasks = plan(SETTINGS)
    first = tasks[0].seed
    rows: dict[str, dict[str, Any]] = {}
    for task in tasks:
        fell = task.contender == "governed/none" and task.plant == "mujoco" and task.push > 0.0
        fell = fell or (task.contender == "wbc" and task.seed == first)
        measures: dict[str, Any] = {"fell": fell, "fall_time_s": 1.0 if fell else None, "solver_failures": 0}
        measures |= {"slip_mm_per_step": 999.0 if fell else SLIP[task.contender]}
        measures |= {"net_slip_mm_per_step": 999.0 if fell else 0.5 * SLIP[task.contender]}
        measures |= dict.fromkeys(
            ("late_slip_mm_per_step", "sliding", "low_force", "tracking_rms_mm", "thrust_rms_n"), 1.0
        )
        rows[task.key(code_digest())] = {"measures": measures}
    return summarise_rows(tasks, rows)


@pytest.fixture(scope="module")
def summary() -> dict[str, Any]:
    return by_hand()


def test_counts_are_those_of_the_rows(summary: dict[str, Any]) -> None:
    drawn = [task for task in plan(SETTINGS) if task.contender == "wbc"]
    pushed = [task for task in drawn if task.plant == "mujoco" and task.push > 0.0]
    assert 0 < len(pushed) < len(drawn) // 2
    whole = summary["whole"]
    assert [whole[name]["fell"] for name in SETTINGS.contenders] == [len(pushed), 0, 1]
    assert whole["governed/none"]["falls"]["value"] == len(pushed) / 60
    for name, slip in SLIP.items():  # walks that fell have no part in mean and largest, and do not reach the median
        assert whole[name]["slip_median_mm"] == whole[name]["slip_largest_mm"] == slip
        assert whole[name]["slip_mean_mm"] == pytest.approx(slip)
        assert whole[name]["net_slip_median_mm"] == 0.5 * slip
    levels = summary["factors"]
    assert levels["push"]["0"]["governed/none"]["falls"]["value"] == 0.0
    assert levels["push"]["8"]["governed/none"]["falls"]["value"] == len(pushed) / 30
    assert levels["plant"]["compliant"]["governed/none"]["falls"]["value"] == 0.0
    assert levels["plant"]["mujoco"]["governed/none"]["falls"]["value"] == len(pushed) / 30
    at = {level: [t for t in drawn if t.friction == level] for level in SETTINGS.frictions}
    for level, tasks in at.items():
        share = sum(task in pushed for task in tasks) / len(tasks)
        assert levels["friction"][f"{level:g}"]["governed/none"]["falls"]["value"] == pytest.approx(share)


def test_ranks_are_told_side_by_side(summary: dict[str, Any]) -> None:
    engines = summary["engines"]
    assert [engines["compliant"][name]["falls_rank"] for name in SETTINGS.contenders] == [1, 1, 1]
    assert [engines["mujoco"][name]["falls_rank"] for name in SETTINGS.contenders] == [3, 1, 1]  # one fall is chance
    for plant in ("compliant", "mujoco"):
        assert [engines[plant][name]["slip_rank"] for name in SETTINGS.contenders] == [3, 1, 1]
        assert sum(engines[plant][name]["walks"] for name in SETTINGS.contenders) == 90


def test_a_contender_of_which_half_fell_slips_most() -> None:
    part = pd.DataFrame({"slip_mm_per_step": [0.1, 0.2, 0.1, 0.3], "fell": [False, False, True, True]})
    assert slip_median(part) == np.inf
    assert slip_median(part[:3]) == 0.2
    assert slip_median(part[:2]) == pytest.approx(0.15)
    assert np.isnan(slip_median(part[:0]))


@pytest.mark.parametrize(
    ("a", "b", "less"),
    [
        (0.001, 0.019, False),  # both below what the measure can tell
        (0.001, 0.0205, False),
        (0.001, 0.022, True),
        (1.0, 1.1, False),  # less than a tenth of the larger
        (1.0, 1.12, True),
        (1.12, 1.0, False),
        (1.0, np.inf, True),
        (np.inf, np.inf, False),
        (np.nan, 1.0, False),
        (1.0, np.nan, False),
    ],
)
def test_what_the_measure_cannot_tell_is_no_difference(a: float, b: float, less: bool) -> None:
    assert slips_less(a, b) is less


def test_few_falls_more_are_chance() -> None:
    """Sign test: of 5 scenarios in which only one of two fell all are its own, p = 2/32; of 6, p = 2/64."""

    def fell(count: int) -> pd.DataFrame:
        return pd.DataFrame({"seed": range(20), "fell": [True] * 3 + [i < count for i in range(17)]})

    assert not falls_less(fell(0), fell(5))
    assert falls_less(fell(0), fell(6))
    assert not falls_less(fell(6), fell(0))
    assert not falls_less(fell(6), fell(6))
    assert not falls_less(fell(0), fell(6)[:7])  # of the others nothing is known


def test_tables_fit_80_columns_and_end_with_who_falls_most(summary: dict[str, Any]) -> None:
    tables = {table.name: table for table in breaking_tables(summary)}
    assert list(tables) == ["breaking_slip", "breaking_falls", "breaking_engines", "breaking"]
    assert all(len(line) <= 80 for table in tables.values() for line in table.to_string(80).splitlines())
    whole = tables["breaking"]
    assert whole.rows == ["none", "QP", "condensed"]
    fell = summary["whole"]["governed/none"]["fell"]
    assert whole.number("none", "fell") == fell
    cell = whole.get("none", "most at")
    assert cell is not None
    assert str(cell.value) in {f"push 8 N·s ({100 * fell / 30:.0f})", f"MuJoCo ({100 * fell / 30:.0f})"}
    assert tables["breaking_falls"].number("MuJoCo", "none") == pytest.approx(100.0 * fell / 30)
    assert tables["breaking_slip"].number("compliant engine", "condensed") == 0.2


def test_a_campaign_of_eight_fits_as_well() -> None:
    """The widest texts that there are, every median unknown or long."""
    settings = CampaignSettings.wide(walks=210)
    measures = dict.fromkeys(
        ("late_slip_mm_per_step", "sliding", "low_force", "tracking_rms_mm", "thrust_rms_n"), 0.0123456
    ) | {"solver_failures": 0, "net_slip_mm_per_step": 0.0123456, "slip_mm_per_step": 1234.5678}
    tasks = plan(settings)
    rows = {
        task.key(code_digest()): {"measures": measures | {"fell": (hit := i % 3 == 0), "fall_time_s": 1.0 * hit}}
        for i, task in enumerate(tasks)
    }
    for table in breaking_tables(summarise_rows(tasks, rows)):
        text = table.to_string(80)
        assert all(len(line) <= 80 for line in text.splitlines())
        assert "\\" not in text  # nothing goes on below
