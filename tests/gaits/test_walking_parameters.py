"""The tuned numbers of a walk: each is said, checked, read, and does what it says."""

import ast
import inspect
import re
from dataclasses import fields, replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from walks import made_state

import harpy_pin as hp
from harpy_pin.gaits import WalkingParameters, walking

DEFAULTS = vars(WalkingParameters())
DOMAINS = {entry.name: entry.metadata["check"].keywords for entry in fields(WalkingParameters)}
SOURCES = set(
    [
        "choice",
        "bound",
        "walks",
        "fast",
        "landing",
        "points",
        "soles",
        "pushed",
        "slippery",
        "stairs",
        "unknown",
    ]
)
FACTORS = st.dictionaries(st.sampled_from(sorted(DEFAULTS)), st.floats(0.8, 1.2), max_size=20)


def heights(gait, duration=1.2, h=1e-3):
    """World heights of the feet's targets in a walk; feet are loaded while none swings."""
    gait.command[:3] = 0.1, 0.0, 0.0
    loaded, free, found = made_state(gait, force=30.0), made_state(gait), []
    for tick in range(round(duration / h)):
        swings = (gait.target.stance == 0.0).any()
        gait.observe(free if swings else loaded)
        o = gait.update(tick * h)
        assert np.isfinite(
            np.concatenate([np.ravel(getattr(o, n)) for n in ("body", "load")])
        ).all()
        assert np.isfinite(o.foot_position).all()
        found.append(o.body[2] + o.foot_position[:, 2])
    return np.array(found)


def test_a_number_says_what_it_is():
    """Its unit and its source, after what it means."""
    text = inspect.cleandoc(WalkingParameters.__doc__ or "")
    entries = text.partition("Attributes:")[2].partition("Raises:")[0]
    said = re.findall(r"(\w+): ([^\[\]]+) \[([^;\]]+);\s+(\w+)\]\.\n", entries)
    assert [name for name, *_ in said] == [*DEFAULTS]
    assert {source for *_, source in said} <= SOURCES


@pytest.mark.parametrize("name", DOMAINS)
def test_a_number_is_refused_beyond_its_domain(name):
    high, zero = DOMAINS[name]["high"], not DOMAINS[name].get("strict")
    for value in (nan, inf, -1.0, "x", None, 1.01 * high, *(() if zero else (0.0,))):
        with pytest.raises(hp.InputError, match=rf"^{name} must be"):
            replace(WalkingParameters(), **{name: value})


def test_every_number_is_read_by_the_walk():
    read = set()
    for path in Path(walking.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and path.stem != "parameters":
                owner = ast.unparse(node.value)
                read |= {node.attr} if owner == "w" or owner.endswith(".tuned") else set()
            elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
                read |= {node.slice.value} if ast.unparse(node.value) == "w" else set()
    assert set(DEFAULTS) <= read


@needs_robots
def test_numbers_are_given_by_name_or_whole(solo12):
    named = hp.WalkingGait(solo12, parameters={"clearance": 0.12, "max_turn": 1.0})
    whole = hp.WalkingGait(solo12, parameters=WalkingParameters(clearance=0.12, max_turn=1.0))
    assert named.record.tobytes() == whole.record.tobytes()
    assert named.describe()["parameters"] == {"clearance": 0.12, "max_turn": 1.0}
    assert named.record.dtype is hp.WalkingGait(solo12).record.dtype  # no kernel is compiled anew
    with pytest.raises(hp.InputError, match="unknown parameter 'clearence'"):
        hp.WalkingGait(solo12, parameters={"clearence": 0.12})
    with pytest.raises(hp.InputError, match="parameters must be"):
        hp.WalkingGait(solo12, parameters=0.12)
    with pytest.raises(hp.InputError, match="slippery must be"):
        hp.WalkingGait(solo12, parameters={"slippery": 0.3})


@needs_robots
@pytest.mark.parametrize("clearance", [0.05, 0.075, 0.15])
def test_a_foot_rises_by_the_clearance(clearance):
    gait = hp.WalkingGait(hp.load_robot("solo12"), "crawl", parameters={"clearance": clearance})
    way = heights(gait)
    rise = (way - way[0]).max()
    assert rise == pytest.approx(clearance * gait._build.leg, abs=1e-5)


@needs_robots
@given(FACTORS)
@settings(max_examples=15, deadline=None)
def test_targets_are_finite_whatever_the_numbers(factors):
    changes = {
        name: min(factor * DEFAULTS[name], DOMAINS[name]["high"])
        for name, factor in factors.items()
    }
    for robot in ("solo12", "bolt"):
        heights(hp.WalkingGait(hp.load_robot(robot), parameters=changes), duration=0.6)
