"""The campaign: which walks, what they are, their file, and what is said of them."""

import json
import subprocess
import sys
from collections import Counter
from dataclasses import asdict, replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import harpy_pin as hp
from comparison.campaign import walks
from comparison.campaign.plan import (
    FACTORS,
    JOINT_DAMPING,
    KINDS,
    CampaignSettings,
    Task,
    code_digest,
    code_files,
    level_key,
    plan,
)
from comparison.campaign.store import Store, read_rows
from comparison.campaign.summary import (
    exceptions_of,
    summarise_rows,
    summary_tables,
    variants_table,
)
from comparison.campaign.walks import exceptions_table, scenario, walk_task
from comparison.contenders import (
    CONTENDERS,
    HARSH,
    OWN,
    PAPER,
    TRUSTING,
    controller_part,
    label,
    short_name,
)

WIDE = CampaignSettings.of("wide")
PLAIN = Task(
    **{
        "contender": "governed/none",
        "friction": 0.6,
        "stiffness": 8e3,
        "damping": 1.0,
        "plant": "compliant",
    },
    **dict.fromkeys(
        ("push", "mass_error", "friction_error", "noise", "delay", "ice", "jitter"), 0.0
    ),
    **{"speed": 0.3, "seed": 3, "duration": 1.5},
)


def walked(task: Task) -> dict[str, Any]:
    return walk_task(task)


def scenarios_of(settings: CampaignSettings) -> list[Task]:
    """What each scenario is, without who walks it."""
    return [
        replace(task, contender="")
        for task in plan(settings)
        if task.contender == settings.contenders[0]
    ]


def shares(factor: str) -> dict[float | str, float]:
    """How often each level of the wide campaign is to be drawn, of all draws; one given twice twice
    as often.
    """
    given = getattr(WIDE, FACTORS[factor].levels)
    return {level: count / len(given) for level, count in Counter(given).items()}


def test_every_contender_meets_the_same_balanced_scenarios() -> None:
    tasks = plan(WIDE)
    assert (
        len({t.key("x") for t in tasks}) == len(tasks) == WIDE.walks == 210 * len(WIDE.contenders)
    )
    assert {task.contender for task in tasks} == {*CONTENDERS, *TRUSTING}
    first = scenarios_of(WIDE)
    for name in WIDE.contenders:
        assert [replace(task, contender="") for task in tasks if task.contender == name] == first
    for factor in FACTORS:
        drawn = Counter(getattr(task, factor) for task in first)
        assert drawn == {level: 210 * share for level, share in shares(factor).items()}, factor
    variants = CampaignSettings.of("variants")
    assert scenarios_of(variants) == first
    assert {"paper/tracked/feedforward", "paper/measured/pid/tuned", "condensed/tuned"} <= set(
        variants.contenders
    )


def test_a_longer_campaign_contains_a_shorter_one() -> None:
    assert plan(CampaignSettings(walks=100))[:20] == plan(CampaignSettings(walks=20))[:20]
    assert plan(CampaignSettings.of("wide", walks=810)) == plan(CampaignSettings.of("wide"))[:810]
    assert plan(CampaignSettings(walks=20, seed=1))[0] != plan(CampaignSettings(walks=20))[0]


def test_the_key_tells_every_field_and_the_code() -> None:
    changed = [PLAIN.key("b")]
    for name, value in vars(PLAIN).items():
        changed.append(
            replace(PLAIN, **{name: value + (1 if not isinstance(value, str) else "x")}).key("a")
        )
    assert len({PLAIN.key("a"), *changed}) == len(changed) + 1
    assert replace(PLAIN).key("a") == PLAIN.key("a")


@pytest.mark.parametrize("factor", FACTORS)
def test_no_factor_depends_on_another(factor: str) -> None:
    """Levels of one factor may come and go: all others are drawn as before."""
    levels = getattr(WIDE, FACTORS[factor].levels)
    fewer = scenarios_of(CampaignSettings.of("wide", **{FACTORS[factor].levels: levels[:1]}))
    for task, other in zip(scenarios_of(WIDE), fewer, strict=True):
        assert {**asdict(task), factor: levels[0]} == asdict(other)


def test_factors_do_not_go_together() -> None:
    """Of 210 scenarios, no pair of levels is drawn much more often than by chance (six standard
    deviations).
    """
    drawn = scenarios_of(WIDE)
    for one, two in combinations(FACTORS, 2):
        pairs = Counter((getattr(t, one), getattr(t, two)) for t in drawn)
        for (a, p), (b, q) in product(shares(one).items(), shares(two).items()):
            expected = p * q * len(drawn)
            assert abs(pairs[a, b] - expected) < 6.0 * expected**0.5, (one, a, two, b)


def test_every_contender_and_every_level_has_a_name_of_its_own() -> None:
    names = tuple(dict.fromkeys((*CONTENDERS, *TRUSTING)))
    assert (
        len({label(name) for name in names})
        == len({short_name(name) for name in names})
        == len(names)
    )
    made = [hp.Scenario(controller=controller_part(name)) for name in names]
    assert len({str(scenario.to_dict()) for scenario in made}) == len(names)
    levels = [
        (f, level)
        for kind in KINDS
        for f in FACTORS
        for level in getattr(CampaignSettings.of(kind), FACTORS[f].levels)
    ]
    texts = {(f, level): FACTORS[f].text(level_key(level)) for f, level in levels}
    assert len(set(texts.values())) == len(texts)
    assert (texts["push", 2.0], texts["ice", 0.0]) == ("push 2 N·s", "no ice")


BAD: dict[str, Any] = {
    **{
        "walks": 0,
        "duration": 1.0,
        "seed": -1,
        "frictions": (-0.1,),
        "mass_errors": (-1.0,),
        "jitter": np.nan,
    },
    **{
        "plants": ("gazebo",),
        "contenders": ("wbc/full",),
        "stiffnesses": (0.0,),
        "dampings": (-1.0,),
    },
    "speeds": (0.0,),
}


@pytest.mark.parametrize("name", BAD)
def test_settings_out_of_their_domain(name: str) -> None:
    with pytest.raises(hp.InputError, match=name.rstrip("s").split("_")[0][:8]):
        CampaignSettings(**{name: BAD[name]})


def test_a_walk_is_what_its_task_says() -> None:
    run = hp.walk(
        scenario(replace(PLAIN, push=2.0, mass_error=0.25, friction_error=0.5, contender="wbc"))
    )
    assert run.metadata["ground"]["mu_s"] == 0.6
    assert run.metadata["mass"] == pytest.approx(
        hp.load_harpy().mass + 0.25 * hp.load_harpy().model.inertias[1].mass
    )
    assert "0.9" in json.dumps(run.metadata["parameters"])  # 0.6 · 1.5: what the controller assumes
    (push,) = run.metadata["pushes"]
    assert push["impulse"][0] == push["impulse"][2] == 0.0
    assert abs(push["impulse"][1]) == 2.0
    target = hp.make_gait(hp.load_harpy()).update(push["time"] + 0.5 * push["duration"])
    assert sorted(target.stance) == [0.0, 1.0]
    assert target.phase[int(np.argmin(target.stance))] == pytest.approx(
        0.5
    )  # the other foot is half-way


def test_the_same_task_gives_the_same_row_and_a_fall_its_time() -> None:
    task = replace(PLAIN, contender="governed/paper", push=2.0, jitter=0.01)
    row = walked(task)
    assert walked(task) == row
    assert walked(replace(task, seed=4)) != row
    assert (row["fell"], row["fall_time_s"]) == (False, None)
    json.dumps(row, allow_nan=False)
    row = walked(
        replace(task, jitter=0.0, friction=0.15, friction_error=-0.3, push=3.5, duration=4.0)
    )
    assert row["fell"] is True
    assert 0.0 < row["fall_time_s"] < 4.0


def test_what_is_drawn_reaches_the_walk() -> None:
    task = next(t for t in plan(WIDE) if t.plant == "mujoco" and t.damping == 2.0)
    drawn = scenario(replace(task, contender=OWN, stiffness=40e3, speed=0.5, noise=0.5, delay=2e-3))
    assert drawn.ground.stiffness == drawn.stiffness == drawn.felt_ground.stiffness == 40e3
    assert drawn.ground.damping == pytest.approx(
        2.0 * 268.3 * 5.0**0.5
    )  # twice that of the same damping ratio
    assert (drawn.plant.name, drawn.gait.speed, drawn.controller.name) == ("mujoco", 0.5, "wbc")
    disturbances = drawn.disturbances
    assert (disturbances.noise, disturbances.delay, disturbances.seed) == (
        hp.Noise.typical(0.5),
        2e-3,
        task.seed,
    )
    pytest.importorskip("mujoco")
    built = hp.build(drawn)
    assert built.simulator.describe()["name"] == "mujoco"
    assert built.sensors is not None
    assert built.sensors.delay == 2
    assert isinstance(built.controller, hp.WholeBodyController)
    assert built.controller.parameters.solver == "active_set"
    plain = hp.build(scenario(replace(PLAIN, contender="condensed/trusting")))
    assert plain.sensors is None
    assert isinstance(plain.controller, hp.CondensedController)
    assert not plain.controller.parameters.estimate_friction


def test_the_joints_damping_is_that_of_plant_and_controller() -> None:
    """5 N·m·s/rad as in the authors' own model, in both engines; else the packaged robot's."""
    assert scenario(PLAIN).urdf is None
    assert hp.load_harpy().model.damping[6:] == pytest.approx(JOINT_DAMPING)
    for plant in ("compliant", "mujoco"):
        pytest.importorskip("mujoco")
        built = hp.build(
            scenario(replace(PLAIN, contender="condensed", plant=plant, joint_damping=5.0))
        )
        assert built.gait.robot.model.damping[6:] == pytest.approx(5.0)
        assert built.simulator.robot.model.damping[6:] == pytest.approx(5.0)


def test_a_strip_of_ice_lies_in_mid_walk() -> None:
    icy = replace(PLAIN, friction=0.5, friction_error=0.3, speed=0.4, duration=5.0, ice=0.15)
    ((begin, end, mu),) = scenario(icy).ground.friction_strips
    assert (begin, end, mu) == pytest.approx((0.8, 1.4, 0.15))
    assert scenario(icy).controller.mu == 0.65  # the controller knows nothing of it
    assert scenario(replace(icy, friction=0.12)).ground.friction_strips[0][2] == 0.12
    assert scenario(replace(icy, ice=0.0)).ground.friction_strips == ()


def test_motors_and_contact_of_the_harsh_campaign_reach_the_walk() -> None:
    """Who has limits knows the share to which the plant clips; without a share nothing is
    clipped.
    """
    pytest.importorskip("mujoco")
    tasks = [
        t
        for t in plan(CampaignSettings.of("harsh"))
        if t.plant == "mujoco default" and t.torque_share == 0.3
    ]
    assert (
        {t.contender for t in tasks}
        == set(HARSH)
        >= {f"{name}{end}" for name in PAPER for end in ("", "/tuned")}
    )
    for task in tasks[: len(HARSH)]:
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


def test_rows_survive_and_are_never_doubled(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    with Store(path) as store:
        store.append("a", {"x": 1})
        store.append("a", {"x": 2})
        with pytest.raises(hp.RunFileError, match="another campaign"):
            Store(path)
    with path.open("ab") as file:
        file.write(b'{"key": "b", "x"')  # killed while writing
    assert read_rows(path)[0] == {"a": {"x": 1}}
    with Store(path) as store:
        assert store.rows == {"a": {"x": 1}}
        store.append("b", {"x": 3})
    assert read_rows(path)[0] == {"a": {"x": 1}, "b": {"x": 3}}
    assert path.read_bytes().count(b"\n") == 2


@pytest.mark.parametrize(
    "content",
    [
        *(
            b'{"key": "a"}\n' + damage + b'{"key": "b"}\n{"ke'
            for damage in (b"no\n", b"3\n", b"{}\n")
        ),
        *(b"my notes", b"row\nmy notes", b'{"key": 1}\n\x00'),
    ],
    ids=range(6),
)
def test_files_that_are_no_campaigns_are_not_touched(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_bytes(content)
    with pytest.raises(hp.RunFileError, match="is not a row of a campaign"):
        Store(path)
    assert path.read_bytes() == content


def rows_of(tasks: list[Task], slip: Any, fell: Any) -> dict[str, dict[str, Any]]:
    """Rows made by hand, of slip and falls that are functions of the task."""
    rows: dict[str, dict[str, Any]] = {}
    for task in tasks:
        measures = dict.fromkeys(
            ("late_slip_mm_per_step", "sliding", "low_force", "tracking_rms_mm"), 1.0
        )
        measures |= {"thrust_rms_n": 1.0, "solver_failures": 1, "solver_fallbacks": 2}
        measures |= {"slip_mm_per_step": 999.0 if fell(task) else slip(task)}
        measures |= {"net_slip_mm_per_step": 0.5 * measures["slip_mm_per_step"]}
        measures |= {"fell": fell(task), "fall_time_s": 2.5 if fell(task) else None}
        rows[task.key(code_digest())] = {"measures": measures}
    return rows


def test_the_summary_is_a_function_of_the_set_of_rows() -> None:
    tasks = plan(CampaignSettings(walks=12 * len(CONTENDERS)))
    place = {task: i // len(CONTENDERS) for i, task in enumerate(tasks)}
    rows = rows_of(
        tasks,
        lambda task: float(place[task]),
        lambda task: task.contender == "wbc" and task.friction < 0.2,
    )
    summary = summarise_rows(tasks, rows)
    backward = dict(reversed(list(rows.items()))) | {"of another campaign": {"measures": {}}}
    assert summarise_rows(tasks, backward) == summary
    wbc = summary["whole"]["wbc"]
    assert (wbc["slip_largest_mm"], wbc["slip_median_mm"]) == (
        11.0,
        6.5,
    )  # a walk that fell is none, or the last
    assert wbc["walks"] == wbc["solver_failures"] == 12
    assert wbc["solver_fallbacks"] == 24
    assert wbc["falls"]["value"] == pytest.approx(2 / 12)
    assert (wbc["falls"]["low"], wbc["falls"]["high"]) == pytest.approx(
        (0.0470, 0.4480), abs=1e-4
    )  # Wilson
    assert wbc["fall_time_s"] == {"value": 2.5, "low": None, "high": None}
    # Of 12 values the 3rd and the 10th: P(Binomial(12, 1/2) ≤ 2) = 1.9 %, ≤ 3: 7.3 %.
    assert summary["whole"]["condensed"]["slip_mm_per_step"] == {
        "value": 5.5,
        "low": 2.0,
        "high": 9.0,
    }
    assert summary["factors"]["friction"]["0.15"]["wbc"]["falls"]["value"] == 1.0
    assert summary["factors"]["friction"]["0.8"]["wbc"]["falls"]["value"] == 0.0
    del rows[tasks[0].key(code_digest())]
    assert summarise_rows(tasks, rows)["done"] == len(tasks) - 1
    tables = [*summary_tables(summary), variants_table(summary)]
    names_of_tables = [table.name for table in tables]
    assert len(set(names_of_tables)) == len(names_of_tables) == 10
    assert tables[-1].number("whole-body QP, ProxQP", "fell") == 2


def test_the_published_measured_variant_is_the_papers_governor_of_all_other_tables() -> None:
    task = replace(PLAIN, push=4.0, friction=0.2, delay=1e-3)
    assert walked(replace(task, contender="governed/paper")) == walked(
        replace(task, contender="paper/measured/pid")
    )


@pytest.mark.parametrize(
    "row", [{}, {"measures": 3}, {"measures": {}}, {"measures": {"fell": "no"}}], ids=str
)
def test_a_row_of_another_kind_is_one_line(row: dict[str, Any]) -> None:
    tasks = plan(CampaignSettings(walks=1))
    with pytest.raises(hp.RunFileError, match="does not hold its measures"):
        summarise_rows(tasks, {tasks[0].key(code_digest()): row})


def walks_of(seed: int, **fell: bool) -> list[dict[str, object]]:
    """Rows of one scenario: who fell, everything else the same."""
    same = {"friction": 0.1 * seed, "fall_time_s": 1.0, "slip_mm_per_step": 2.0}
    levels = {factor: 0.0 for factor in FACTORS if factor != "friction"}
    return [
        {"seed": seed, "contender": name, "fell": f, **levels, **same} for name, f in fell.items()
    ]


def test_exceptions_are_scenarios_that_only_a_whole_body_controller_loses() -> None:
    rows = [
        *walks_of(1, none=True, wbc=True, condensed=True),
        *walks_of(2, none=False, wbc=False, condensed=False),
        *walks_of(3, none=False, wbc=True, condensed=False),
        *walks_of(4, none=True, wbc=True, condensed=False)
        + walks_of(4, **{"condensed/trusting": False}),
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


def test_reasons_are_the_levels_without_which_a_walk_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Walks in which who is pushed falls, unless there is no delay; the QP does not fall with fast
    motors either.
    """
    tasks = [t for t in plan(CampaignSettings.of("harsh")) if t.contender in ("condensed", OWN)]
    hard = {"push": 8.0, "delay": 2e-3, "bandwidth": 20.0, "ice": 0.15, "stiffness": 8e3}
    tasks = [replace(task, **hard) for task in tasks if task.seed == tasks[0].seed]
    both = {"seed": tasks[0].seed, "fell": {"condensed": 1.0, OWN: 2.0}}

    def done(asked: list[Task], store: Store, **_: object) -> None:
        for task in asked:
            fell = (
                task.push > 0.0
                and task.delay > 0.0
                and (task.contender == "condensed" or task.bandwidth > 0.0)
            )
            store.append(task.key(code_digest()), {"measures": {"fell": fell}})

    monkeypatch.setattr(walks, "execute", done)
    (entry,) = walks.with_reasons([both], tasks, tmp_path / "rows.jsonl")
    assert entry["reasons"] == ["push 8 N·s", "delay 2 ms"]
    only = {"seed": tasks[0].seed, "fell": {OWN: 2.0}}
    (entry,) = walks.with_reasons([only], tasks, tmp_path / "rows.jsonl")
    assert entry["reasons"] == ["push 8 N·s", "delay 2 ms", "motors 20 Hz"]
    usual = replace(tasks[0], **walks.USUAL)
    assert walks.variations(usual) == {}
    assert walks.variations(replace(usual, ice=0.15)) == {"ice": usual}
    assert set(walks.USUAL) == set(FACTORS) - {"friction"}


def test_rows_are_kept_by_all_code_that_walks():
    """What a worker imports to walk, apart from the drawing of tables and pages, is in the
    digest.
    """
    code = (
        "import sys, comparison.campaign.walks, comparison.study; print(*(m.__file__ for m in "
        "sys.modules.values() "
    )
    code += "if m.__name__.partition('.')[0] in ('harpy_pin', 'comparison')), sep='\\n')"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split("\n")
    imported = {
        Path(name) for name in found if name.endswith(".py") and "/harpy_pin/view/" not in name
    }
    assert len(imported) > 100
    assert {path.name for path in imported - set(code_files().values())} <= {
        "__init__.py",
        "tables.py",
    }
