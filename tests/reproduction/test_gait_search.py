"""The search for a planar gait, and the files that keep one."""

import json
import sys

import numpy as np
import pytest

from harpy_pin.errors import HarpyError, InputError, RunFileError
from reproduction.gait import optimise
from reproduction.gait.optimise import optimise_gait
from reproduction.gait.planar_gait import OptimisedGait, PlanarGait, load_gait
from reproduction.gait.search import SEARCHES, PlanarTask


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """So that a short search, too, comes to CMA-ES, with seven candidates at a time."""
    monkeypatch.setattr(optimise, "DRAWS", 10)


def task(model, **changes):
    return PlanarTask(model=model, **{"search": "paper", "duration": 0.9, **changes})


def test_search_is_seeded(robot, model):
    np.random.seed(1)  # noqa: NPY002 - the search must not look at it
    first = optimise_gait(robot, task=task(model), seed=4, budget=40)
    before = np.random.random()  # noqa: NPY002
    second = optimise_gait(robot, task=task(model), seed=4, budget=40)
    other = optimise_gait(robot, task=task(model), seed=5, budget=40)
    assert first.gait == second.gait
    assert first.record == second.record
    assert other.gait != first.gait
    np.random.seed(1)  # noqa: NPY002
    assert np.random.random() == before  # noqa: NPY002 - nor move it


@pytest.mark.parametrize(
    "start", [None, PlanarGait(half_step=0.05)], ids=["everywhere", "around a gait"]
)
def test_resumed_search_is_the_uninterrupted_one(robot, model, tmp_path, start):
    path = tmp_path / "search.json"
    whole = optimise_gait(robot, task=task(model), seed=2, budget=45, start=start)
    optimise_gait(robot, task=task(model), seed=2, budget=25, start=start, resume=path)
    seen = []
    resumed = optimise_gait(
        robot,
        task=task(model),
        seed=2,
        budget=45,
        start=start,
        resume=path,
        on_progress=seen.append,
    )
    assert resumed == whole
    assert [p.evaluations for p in seen] == list(range(26, 46))
    assert seen[-1].cost == whole.record["cost"]


def test_search_improves_and_reports(robot, model):
    seen = []
    found = optimise_gait(robot, task=task(model), seed=0, budget=35, on_progress=seen.append)
    costs = [p.cost for p in seen]
    assert costs == sorted(costs, reverse=True)
    assert found.record["cost"] == costs[-1] < costs[0]
    assert task(model).evaluate(found.gait) == costs[-1]
    both = task(model, friction=(0.25, 0.8))
    each = [both.cost(summary, found.gait) for summary in both.walk(found.gait)]
    assert both.evaluate(found.gait) == max(each)
    assert each[0] == costs[-1]
    for name, (low, high) in SEARCHES["paper"].items():
        assert low <= getattr(found.gait, name) <= high


def test_interrupted_search_keeps_the_best(robot, model, tmp_path):
    path = tmp_path / "search.json"

    def stop(progress):
        if progress.evaluations == 5:
            raise KeyboardInterrupt

    found = optimise_gait(robot, task=task(model), budget=50, resume=path, on_progress=stop)
    assert found.record["ending"] == "interrupted"
    assert len(json.loads(path.read_text())["costs"]) == 5


def test_resume_refuses_other_searches_and_damage(robot, model, tmp_path):
    path = tmp_path / "search.json"
    optimise_gait(robot, task=task(model), seed=1, budget=3, resume=path)
    with pytest.raises(RunFileError, match="seed is 1, desired 2"):
        optimise_gait(robot, task=task(model), seed=2, budget=3, resume=path)
    for text in ("not json", "[]", '{"costs": ["x"]}', "{}"):
        path.write_text(text)
        with pytest.raises(RunFileError, match="damaged"):
            optimise_gait(robot, task=task(model), budget=3, resume=path)


@pytest.mark.parametrize(
    "bad",
    [{"budget": 0}, {"budget": 1.5}, {"budget": "many"}, {"seed": -1}, {"seed": 0.5}],
    ids=str,
)
def test_bad_search(robot, model, bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        optimise_gait(robot, task=task(model), **bad)


@pytest.mark.parametrize(
    "bad",
    [
        {"search": "lucky"},
        {"duration": 0.0},
        {"friction": (0.0,)},
        {"friction": ()},
        {"fixed": {"leg": 1.0}},
    ],
    ids=str,
)
def test_bad_task(model, bad):
    with pytest.raises(InputError):
        task(model, **bad)


def test_search_without_its_library(robot, model, monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(HarpyError, match=r"pip install .*gait"):
        optimise_gait(robot, task=task(model), budget=3)


def test_file_round_trip(tmp_path):
    path = tmp_path / "gait.toml"
    gait = OptimisedGait(
        PlanarGait(lift_x=0.02, land_z=0.02),
        {"command": 'harpy "gait"\n\\', "seed": 3, "cost": 1.25, "fell": False, "mu": [0.25, 0.8]},
    )
    gait.save(path)
    assert load_gait(path) == gait


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format = ", "not a TOML"),
        ("format = 1", "no gait of format"),
        ("format = 9\n[gait]", "no gait of format"),
        ("format = 1\n[gait]\nhalf_step = -1", "half_step"),
        ('format = 1\n[gait]\nspeed = "0.3"', "speed"),
        ("format = 1\n[gait]\nspeed = true", "speed"),
        ("format = 1\n[gait]\nspeed = nan", "speed"),
        ("format = 1\n[gait]\nspeed = 2020-01-01", "speed"),
        (f"format = 1\n[gait]\nspeed = 1{'0' * 400}", "strange"),
        (f"format = 1\n[gait]\nspeed = 1{'0' * 5000}", "strange"),
        (f"format = 1\na = {'[' * 50_000}", "strange"),
        ("format = 1\ngait = 3", "strange"),
        ("format = []\n[gait]", "strange"),
    ],
    ids=lambda text: text[:40],
)
def test_bad_files_are_refused_by_name(tmp_path, text, message):
    path = tmp_path / "strange.toml"
    path.write_text(text)
    with pytest.raises(RunFileError, match=message) as caught:
        load_gait(path)
    assert "strange.toml" in str(caught.value)
    assert len(str(caught.value)) < 400


def test_an_unknown_number_in_a_file_is_told(tmp_path):
    path = tmp_path / "gait.toml"
    path.write_text("format = 1\n[gait]\nstride = 1")
    with pytest.raises(RunFileError, match=r"stride.*step_duration"):
        load_gait(path)


def test_missing_files(tmp_path):
    with pytest.raises(RunFileError, match="cannot read"):
        load_gait(tmp_path / "none.toml")
    with pytest.raises(RunFileError, match="cannot write"):
        OptimisedGait(PlanarGait()).save(tmp_path / "no" / "gait.toml")
