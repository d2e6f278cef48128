"""The search for settings: who is tuned, on which walks, what counts, and that a stopped search
goes on.
"""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import comparison.tuning.tune as tuning
import harpy_pin as hp
from comparison.campaign.plan import CampaignSettings, plan
from comparison.campaign.store import read_rows
from comparison.contenders import (
    BEST,
    OWN,
    PAPER,
    TUNED,
    VARIANTS,
    WHOLE_BODY,
    Range,
    best_paper,
    controller_part,
    label,
    published_parameters,
    searched,
    tuned,
)
from comparison.tuning.tune import (
    JUDGING_SEED,
    TRAINING_SEED,
    Outcome,
    TuneSettings,
    propose,
    scenario_with,
    score_of,
    tasks_of,
    tune,
    tuning_tables,
    walk_scenario,
)
from harpy_pin.scenario import CONTROLLER_PARTS
from harpy_pin.scenario.parts import read_part


@pytest.mark.parametrize("name", VARIANTS)
def test_the_published_point_changes_nothing(name: str) -> None:
    variant = VARIANTS[name]
    assert variant.settings(variant.published) == dict(variant.part)
    made = hp.Scenario(controller=variant.controller(variant.published))
    whole_body = name in WHOLE_BODY
    parameters = hp.build(made).controller.parameters  # type: ignore[attr-defined]
    own = {"solver": "active_set"} if name == OWN else {}
    legs = name.rpartition("/")[2]
    expected = (
        replace(published_parameters(), **own)
        if whole_body
        else hp.controllers.GovernedParameters(legs=legs)
    )
    if isinstance(expected, hp.controllers.WholeBodyParameters):
        parameters = hp.controllers.WholeBodyParameters(
            **{**vars(parameters), "limits": expected.limits}
        )
    assert parameters == expected


def test_factors_multiply_what_is_published() -> None:
    variant = VARIANTS["paper/tracked/feedforward"]
    factors = {"parameters.feedforward.swing_p": 0.5, "governor_parameters.alpha_n": 3.0}
    part = variant.controller(
        {**variant.published, **factors, "governor_parameters.conditions": "equation"}, mu=0.3
    )
    controller = hp.build(hp.Scenario(controller=part)).controller
    assert isinstance(controller, hp.controllers.GovernedController)
    assert controller.parameters.feedforward.swing_p == (100.0, 100.0, 30.0)
    assert (
        controller.parameters.feedforward.swing_d
        == hp.controllers.GovernedParameters().feedforward.swing_d
    )
    governor = controller.governor
    assert isinstance(governor, hp.ExplicitReferenceGovernor)
    rates = [float(governor._record[name][0]) for name in ("alpha_n", "alpha_r")]
    assert (rates, governor.conditions) == ([60.0, 10.0], "equation")
    assert isinstance(governor.rows, hp.governors.ForceRows)
    assert governor.rows.record["tracked"] == 1


@pytest.mark.parametrize("name", VARIANTS)
def test_proposals_keep_to_their_ranges(name: str) -> None:
    variant, best = VARIANTS[name], VARIANTS[name].published
    for index in range(40):
        point = propose(variant, index, 40, best, np.random.default_rng(index))
        assert point == propose(variant, index, 40, best, np.random.default_rng(index))
        assert point.keys() == variant.space.keys()
        for path, span in variant.space.items():
            if isinstance(span, Range):
                assert min(span.low, 1.0) <= point[path] <= max(span.high, 1.0)
            else:
                assert point[path] in span.values
        variant.controller(point)  # every one can be made
        best = point
    assert propose(variant, 0, 40, best, np.random.default_rng(0)) == variant.published


def test_gains_that_were_found_without_a_governor_are_tried_second() -> None:
    variant, gains = VARIANTS["paper/tracked/pid"], {"parameters.joints.k_p": 0.5}
    rng = np.random.default_rng(0)
    assert propose(variant, 0, 40, variant.published, rng, gains) == variant.published
    assert propose(variant, 1, 40, variant.published, rng, gains) == {**variant.published, **gains}
    for name in VARIANTS:
        if name not in WHOLE_BODY:
            assert (
                VARIANTS[name].space.keys()
                >= VARIANTS[f"none/{name.rpartition('/')[2]}"].space.keys()
            )
    assert list(VARIANTS)[:2] == ["none/pid", "none/feedforward"]


def test_walks_that_train_never_judge() -> None:
    training, judging = tasks_of(TRAINING_SEED, 60, 5.0), tasks_of(JUDGING_SEED, 60, 5.0)
    campaign = plan(CampaignSettings.of("wide"))
    seeds = [{task.seed for task in tasks} for tasks in (training, judging, campaign)]
    assert len(set.union(*seeds)) == sum(map(len, seeds))
    assert {task.plant for task in training} == {"compliant"}
    assert {task.plant for task in judging} == {"compliant", "mujoco"}


def test_the_scenario_is_the_tasks_own_but_for_the_controller() -> None:
    task = next(
        task
        for task in tasks_of(TRAINING_SEED, 30, 3.0)
        if task.friction_error == -0.3 and task.push > 0.0
    )
    part = VARIANTS["filter/feedforward"].controller(VARIANTS["filter/feedforward"].published)
    made = scenario_with(task, part)
    assert made.controller.mu == pytest.approx(0.7 * task.friction)
    assert (made.ground.mu_s, made.ground.stiffness) == (task.friction, task.stiffness)
    assert made.disturbances.delay == task.delay
    assert made.disturbances.pushes
    assert asdict(made.controller)["parameters"] == {"legs": "feedforward"}


def test_falls_come_first_then_slip_then_tracking() -> None:
    def cost(*outcomes: tuple[bool, float, float]) -> float:
        return float(score_of(Outcome(*one) for one in outcomes)["cost"])

    fallen = (True, 0.0, 0.0)
    terrible = (False, 1e9, 1e9)
    assert cost(*[terrible] * 100) < cost(fallen, *[(False, 0.0, 0.0)] * 99)
    assert cost((False, 1.0, 100.0)) < cost((False, 2.0, 10.0))
    assert cost((False, 1.0, 10.0)) < cost((False, 1.0, 100.0))
    score = score_of([Outcome(True, 1.0, 5.0), Outcome(False, 3.0, 7.0), Outcome(False, 2.0, 9.0)])
    assert score == {
        "walks": 3,
        "falls": 1,
        "slip_median": 3.0,
        "tracking_median": 8.0,
        "cost": score["cost"],
    }
    assert score_of([Outcome(True, 1.0, 5.0)])["slip_median"] is None


def test_a_walk_is_measured_as_by_the_library() -> None:
    scenario = hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.25), duration=1.5)
    measures = hp.measure(hp.walk(scenario))
    assert walk_scenario(scenario) == Outcome(
        False, measures.slip_mm_per_step, measures.tracking_rms_mm
    )


SMALL = TuneSettings(
    budget=30, train=4, judge=3, duration=1.5, variants=("paper/tracked/pid", "none/pid")
)


def distance(scenario: hp.Scenario) -> Outcome:
    """Slip that is least at k_pt = 800 and k_dt = 20: where a search has to arrive."""
    centre = scenario.controller.parameters.get("centre", {})
    gains = (centre.get("k_pt", 400.0) / 800.0, centre.get("k_dt", 40.0) / 20.0)
    return Outcome(False, 10.0 * float(np.abs(np.log(gains)).sum()), 0.0)


def test_the_search_finds_what_is_better_and_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walked = []

    def count(scenario: hp.Scenario) -> Outcome:
        walked.append(scenario)
        return distance(scenario)

    monkeypatch.setattr(tuning, "walk_scenario", count)
    whole = tune(SMALL, tmp_path / "whole.jsonl")
    entry = whole["variants"]["none/pid"]
    assert entry["training"]["cost"] < 0.6 * entry["published, training"]["cost"]
    assert entry["judging"]["walks"] == 3
    assert whole["best_paper"] == "paper/tracked/pid/tuned"
    full = len(walked)
    assert full < 2 * SMALL.budget * SMALL.train  # settings that are worse are given up

    lines = (tmp_path / "whole.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "half.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]) + lines[-1][:20])
    walked.clear()
    assert tune(SMALL, tmp_path / "half.jsonl") == whole
    assert 0 < len(walked) < full
    assert read_rows(tmp_path / "half.jsonl")[0] == read_rows(tmp_path / "whole.jsonl")[0]
    assert {cell.column for table in tuning_tables(whole)[:2] for cell in table.cells} >= {
        "falls, found",
        "slip, found",
    }


def test_of_each_governor_the_variant_that_slips_least_is_shown() -> None:
    """Also of what is packaged; a variant of which half of the walks fell is none."""
    document = tuned()
    slip = {name: entry["judging"]["slip_median"] for name, entry in document["variants"].items()}
    table = {table.name: table for table in tuning_tables(document)}["tuning_least"]
    assert table.number("paper's governor", "slip") == min(
        slip[name] for name in PAPER if slip[name] is not None
    )
    assert table.number("condensed WBC", "slip") == slip["condensed"]
    name = next(name for name in PAPER if slip[name] == table.number("paper's governor", "slip"))
    changed = {**document["variants"], name: {**document["variants"][name]}}
    changed[name]["judging"] = {**changed[name]["judging"], "slip_median": None}
    table = {table.name: table for table in tuning_tables({**document, "variants": changed})}[
        "tuning_least"
    ]
    assert table.number("paper's governor", "slip") > slip[name]


def test_what_is_packaged_is_what_the_search_wrote() -> None:
    document = tuned()
    assert document["variants"].keys() == VARIANTS.keys()
    for name, entry in document["variants"].items():
        variant = VARIANTS[name]
        assert entry["controller"] == variant.settings(entry["factors"])
        assert entry["training"]["cost"] <= entry["published, training"]["cost"]
    for name in VARIANTS:
        settings = {
            **document["variants"][searched(name)]["controller"],
            "name": VARIANTS[name].part["name"],
        }
        settings["parameters"] = {
            **settings.get("parameters", {}),
            **VARIANTS[name].part.get("parameters", {}),
        }
        assert controller_part(f"{name}/tuned") == read_part(
            CONTROLLER_PARTS, "controller", settings
        )
    assert best_paper().removesuffix("/tuned") in PAPER
    assert controller_part(BEST) == controller_part(best_paper())
    assert len({label(name) for name in TUNED}) == len(TUNED)


def test_whole_body_controllers_share_the_better_settings_of_their_searches() -> None:
    """They have one optimum. All others have their own."""
    costs = {name: tuned()["variants"][name]["training"]["cost"] for name in WHOLE_BODY}
    best = min(costs, key=lambda name: costs[name])
    assert {searched(name) for name in costs} == {best}
    assert all(searched(name) == name for name in VARIANTS if name not in costs)
    one, other = (controller_part(f"{name}/tuned") for name in costs)
    assert {**one.parameters, "solver": "active_set"} == {
        **other.parameters,
        "solver": "active_set",
    }
