"""The wide campaign: what it draws, that each draw reaches the walk, and that MuJoCo's absence is told first."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, replace
from itertools import combinations, product
from pathlib import Path

import pandas as pd
import pytest

import harpy_pin as hp
from comparison.campaign import execute, reasons
from comparison.campaign.campaign_run import run_campaign
from comparison.campaign.exceptions import exceptions_of, exceptions_table
from comparison.campaign.levels import FACTOR_TEXTS, level_key, level_text
from comparison.campaign.plan import Task, code_digest, plan
from comparison.campaign.settings import FACTORS, JOINT_DAMPING, KINDS, CampaignSettings
from comparison.campaign.store import Store, read_rows
from comparison.campaign.summary import summarise_rows
from comparison.campaign.variants_table import variants_table
from comparison.campaign.walks import scenario, walk_task
from comparison.contenders import CONTENDERS, ESTIMATES, FORCES, HARSH, controller_part, label, short_name
from comparison.tuning.variants import PAPER
from harpy_pin import HarpyError, load_harpy
from harpy_pin.controllers import CondensedController, WholeBodyController

WIDE = CampaignSettings.wide()
SHORT = {"duration": 1.5, "plants": ("compliant",)}


def scenarios_of(settings: CampaignSettings) -> list[Task]:
    """What each scenario is, without who walks it."""
    tasks = plan(settings)
    return [replace(task, contender="") for task in tasks if task.contender == settings.contenders[0]]


def shares(levels: str) -> dict[float | str, float]:
    """How often each level of the wide campaign is to be drawn, of all draws; one given twice twice as often."""
    given = getattr(WIDE, levels)
    return {level: count / len(given) for level, count in Counter(given).items()}


def test_every_level_is_walked_equally_often_by_everyone() -> None:
    tasks = plan(WIDE)
    assert len(tasks) == WIDE.walks >= 1200
    assert {task.contender for task in tasks} == {*CONTENDERS, *ESTIMATES} - {"governed/cone"}
    for factor, levels in FACTORS.items():
        for name in WIDE.contenders:
            drawn = Counter(getattr(task, factor) for task in tasks if task.contender == name)
            assert drawn == {level: 210 * share for level, share in shares(levels).items()}, factor


@pytest.mark.parametrize("factor", FACTORS)
def test_no_factor_depends_on_another(factor: str) -> None:
    """Levels of one factor may come and go: all others are drawn as before."""
    levels = getattr(WIDE, FACTORS[factor])
    fewer = scenarios_of(CampaignSettings.wide(**{FACTORS[factor]: levels[:1]}))
    for task, other in zip(scenarios_of(WIDE), fewer, strict=True):
        assert {**asdict(task), factor: levels[0]} == asdict(other)


def test_factors_do_not_go_together() -> None:
    """Of 210 scenarios, no pair of levels is drawn much more often than by chance (six standard deviations)."""
    drawn = scenarios_of(WIDE)
    for one, two in combinations(FACTORS, 2):
        pairs = Counter((getattr(t, one), getattr(t, two)) for t in drawn)
        for a, b in product(shares(FACTORS[one]), shares(FACTORS[two])):
            expected = shares(FACTORS[one])[a] * shares(FACTORS[two])[b] * len(drawn)
            assert abs(pairs[a, b] - expected) < 6.0 * expected**0.5, (one, a, two, b)


def test_kinds_of_campaign_have_no_scenario_in_common() -> None:
    seeds = {kind: {task.seed for task in plan(make())} for kind, make in KINDS.items()}
    assert not seeds["wide"] & (seeds["plain"] | seeds["hard"])
    assert not seeds["hard"] & seeds["plain"]
    assert FORCES in CampaignSettings.hard().contenders
    assert FORCES not in CampaignSettings().contenders


def test_older_plans_are_drawn_as_they_were() -> None:
    """Further factors come last: the first scenarios of the plain and of the hard campaign, as published."""
    first, hard = scenarios_of(CampaignSettings())[0], scenarios_of(CampaignSettings.hard())[0]
    assert (first.friction, first.push, first.mass_error, first.friction_error) == (0.2, 0.0, -0.2, 0.0)
    assert (hard.friction, hard.push, hard.mass_error, hard.friction_error) == (0.5, 0.0, 0.1, 0.2)
    assert (hard.noise, hard.delay) == (0.5, 1e-3)
    assert (first.stiffness, first.damping, first.plant, first.speed) == (8000.0, 1.0, "compliant", 0.3)


def test_what_is_drawn_reaches_the_walk() -> None:
    task = next(t for t in plan(WIDE) if t.plant == "mujoco" and t.damping == 2.0)
    drawn = scenario(replace(task, contender=FORCES, stiffness=40e3, speed=0.5))
    assert drawn.ground.stiffness == drawn.stiffness == drawn.felt_ground.stiffness == 40e3
    assert drawn.ground.damping == pytest.approx(2.0 * 268.3 * 5.0**0.5)  # twice that of the same damping ratio
    assert (drawn.plant.name, drawn.gait.speed, drawn.controller.name) == ("mujoco", 0.5, "wbc")
    pytest.importorskip("mujoco")
    built = hp.build(drawn)
    assert built.simulator.describe()["name"] == "mujoco"
    assert isinstance(built.controller, WholeBodyController)
    assert built.controller.parameters.formulation == "contact_force"
    estimating = hp.build(scenario(replace(task, contender="condensed/estimate"))).controller
    assert isinstance(estimating, CondensedController)
    assert estimating.parameters.estimate_friction


def test_the_joints_damping_is_that_of_plant_and_controller() -> None:
    """5 N·m·s/rad as in the authors' own model, in both engines; else the packaged robot's."""
    task = replace(plan(WIDE)[0], contender="condensed", plant="compliant")
    assert scenario(task).urdf is None
    assert load_harpy().model.damping[6:] == pytest.approx(JOINT_DAMPING)
    for plant in ("compliant", "mujoco"):
        pytest.importorskip("mujoco")
        built = hp.build(scenario(replace(task, plant=plant, joint_damping=5.0)))
        assert built.gait.robot.model.damping[6:] == pytest.approx(5.0)
        assert built.simulator.robot.model.damping[6:] == pytest.approx(5.0)


def test_variants_walk_the_wide_scenarios() -> None:
    variants = CampaignSettings.variants()
    assert scenarios_of(variants) == scenarios_of(WIDE)
    assert len(variants.contenders) * 210 == variants.walks
    assert {"paper/tracked/feedforward", "paper/measured/pid/tuned", "condensed/tuned"} <= set(variants.contenders)


def test_the_table_of_variants_counts_falls_by_delay() -> None:
    """The published measured PID variant is the paper's governor of all other tables, walk by walk."""
    names = ("governed/paper", "paper/measured/pid", "none/feedforward")
    settings = CampaignSettings.wide(walks=18, contenders=names, **SHORT)
    tasks, code = plan(settings), code_digest()
    rows = {task.key(code): {"measures": walk_task(task, code)} for task in tasks}
    table = variants_table(summarise_rows(tasks, rows))
    printed = {row: {c: table.get(row, c).value for c in table.columns} for row in map(label, names)}  # type: ignore[union-attr]
    assert printed["paper's governor"] == printed["paper's governor, measured, PID"]
    for name in names:
        found = [(task.delay, rows[task.key(code)]["measures"]["fell"]) for task in tasks if task.contender == name]
        for delay in (0.0, 1e-3, 2e-3):
            fell = sum(fall for level, fall in found if level == delay)
            assert printed[label(name)][f"fell, delay {1e3 * delay:g} ms"] == fell


def test_a_strip_of_ice_lies_in_mid_walk() -> None:
    task = next(t for t in plan(WIDE) if t.ice > 0.0)
    icy = replace(task, friction=0.5, speed=0.4, duration=5.0)
    ((begin, end, mu),) = scenario(icy).ground.friction_strips
    assert (begin, end, mu) == pytest.approx((0.8, 1.4, 0.15))
    assert scenario(icy).controller.mu == 0.5 * (1.0 + task.friction_error)  # the controller knows nothing of it
    assert scenario(replace(icy, friction=0.12)).ground.friction_strips[0][2] == 0.12
    assert scenario(replace(icy, ice=0.0)).ground.friction_strips == ()


def test_every_contender_is_known_to_scenarios_and_readers() -> None:
    names = tuple(dict.fromkeys((*CONTENDERS, FORCES, *ESTIMATES)))
    assert len({label(name) for name in names}) == len({short_name(name) for name in names}) == len(names)
    made = [hp.Scenario(controller=controller_part(name)) for name in names]
    assert len({str(scenario.to_dict()) for scenario in made}) == len(names)


def test_every_level_has_a_text_of_its_own() -> None:
    assert set(FACTOR_TEXTS) == set(FACTORS)
    texts = [level_text(f, level_key(level)) for f, levels in FACTORS.items() for level in shares(levels)]
    assert len(set(texts)) == len(texts)


def test_motors_and_contact_of_the_harsh_campaign_reach_the_walk() -> None:
    """Who has limits knows the share to which the plant clips; without a share nothing is clipped."""
    pytest.importorskip("mujoco")
    tasks = [t for t in plan(CampaignSettings.harsh()) if t.plant == "mujoco default" and t.torque_share == 0.3]
    for task in tasks:
        drawn = scenario(replace(task, bandwidth=50.0))
        assert (drawn.plant.name, drawn.plant.preset) == ("mujoco", "default")
        assert drawn.disturbances.actuators == hp.Actuators(torque_share=0.3, bandwidth=50.0)
        if drawn.controller.name == "governed":
            assert drawn.controller.limits
        else:
            assert drawn.controller.parameters["limits"]["torque_scale"] == 0.3
    free = scenario(replace(tasks[0], torque_share=0.0, bandwidth=0.0))
    assert not free.disturbances.actuators
    assert not free.controller.limits
    assert {t.contender for t in tasks} == set(HARSH) >= {f"{name}{end}" for name in PAPER for end in ("", "/tuned")}


def walks_of(seed: int, **fell: bool) -> list[dict[str, object]]:
    """Rows of one scenario: who fell, everything else the same."""
    same = {"friction": 0.1 * seed, "fall_time_s": 1.0, "slip_mm_per_step": 2.0}
    levels = {factor: 0.0 for factor in FACTORS if factor != "friction"}
    return [{"seed": seed, "contender": name, "fell": f, **levels, **same} for name, f in fell.items()]


def test_exceptions_are_scenarios_that_only_a_whole_body_controller_loses() -> None:
    rows = [
        *walks_of(1, none=True, wbc=True, condensed=True),
        *walks_of(2, none=False, wbc=False, condensed=False),
        *walks_of(3, none=False, wbc=True, condensed=False),
        *walks_of(4, none=True, wbc=True, condensed=False) + walks_of(4, **{"condensed/estimate": False}),
        *walks_of(5, none=True, wbc=False, condensed=True) + walks_of(5, **{"paper/best": False}),
    ]
    found = exceptions_of(pd.DataFrame(rows))
    assert [entry["seed"] for entry in found] == [3, 5]
    assert found[0]["fell"] == {"wbc": 1.0}
    assert found[1]["stood"] == {"paper/best": 2.0}
    assert found[0]["levels"] == {"friction": "0.3"}
    text = exceptions_table({"exceptions": found}).to_string(80)
    assert "paper's best variant, 2 mm" in text
    assert "Scenarios in which a WBC fell and another stood: 2" in text


def test_reasons_are_the_levels_without_which_a_walk_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Walks in which who is pushed falls, unless there is no delay; the QP does not fall with fast motors either."""
    tasks = [t for t in plan(CampaignSettings.harsh()) if t.contender in ("condensed", "wbc")]
    hard = {"push": 8.0, "delay": 2e-3, "bandwidth": 20.0, "ice": 0.15, "stiffness": 8e3}
    tasks = [replace(task, **hard) for task in tasks if task.seed == tasks[0].seed]
    both = {"seed": tasks[0].seed, "fell": {"condensed": 1.0, "wbc": 2.0}}

    def walked(asked: list[Task], store: Store, **_: object) -> None:
        for task in asked:
            fell = task.push > 0.0 and task.delay > 0.0 and (task.contender == "condensed" or task.bandwidth > 0.0)
            store.append(task.key(code_digest()), {"measures": {"fell": fell}})

    monkeypatch.setattr(reasons, "execute", walked)
    (entry,) = reasons.with_reasons([both], tasks, tmp_path / "rows.jsonl")
    assert entry["reasons"] == ["push 8 N·s", "delay 2 ms"]
    only = {"seed": tasks[0].seed, "fell": {"wbc": 2.0}}
    (entry,) = reasons.with_reasons([only], tasks, tmp_path / "rows.jsonl")
    assert entry["reasons"] == ["push 8 N·s", "delay 2 ms", "motors 20 Hz"]
    usual = replace(tasks[0], **reasons.USUAL)
    assert reasons.variations(usual) == {}
    assert reasons.variations(replace(usual, ice=0.15)) == {"ice": usual}
    assert set(reasons.USUAL) == set(FACTORS) - {"friction"}


def test_without_mujoco_nothing_is_walked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def walked(*arguments: object) -> None:
        raise AssertionError("a walk was begun")

    monkeypatch.setattr(execute, "installed_version", lambda: None)
    monkeypatch.setattr(execute, "walk_task", walked)
    path = tmp_path / "rows.jsonl"
    with pytest.raises(HarpyError, match=r"MuJoCo, which is not installed: pip install 'harpy-pin\[mujoco\]'"):
        run_campaign(CampaignSettings.wide(walks=16), path)
    assert read_rows(path) == {}


def test_a_wide_campaign_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the rows given, the other half walked: the same summary as of one run, and no row is done again."""
    settings = CampaignSettings.wide(walks=8, **SHORT)
    tasks, code = plan(settings), code_digest()
    rows = {task.key(code): {"measures": walk_task(task, code)} for task in tasks}
    with Store(tmp_path / "whole.jsonl") as whole, Store(tmp_path / "half.jsonl") as half:
        for i, (key, row) in enumerate(rows.items()):
            whole.append(key, row)
            if i % 2:
                half.append(key, row)
    before = (tmp_path / "half.jsonl").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(execute, "_dask", lambda: pytest.fail("a walk is done again"))
        undisturbed = run_campaign(settings, tmp_path / "whole.jsonl")
    assert run_campaign(settings, tmp_path / "half.jsonl") == undisturbed
    assert undisturbed["done"] == undisturbed["planned"] == 8
    assert (tmp_path / "half.jsonl").read_bytes().startswith(before)
    assert read_rows(tmp_path / "half.jsonl").keys() == rows.keys()
