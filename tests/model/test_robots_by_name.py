"""Robots as users name them: the list, other spellings, typing errors, and arguments that were meant otherwise."""

from __future__ import annotations

import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.model.catalogue import CATALOGUE, known_name


@needs_robots
def test_all_robots_at_a_glance():
    known = hp.robots()
    assert list(known) == ["harpy", *CATALOGUE]
    assert known["harpy"].mass == pytest.approx(4.02)
    go2, g1, iris = known["go2"], known["g1"], known["iris"]
    assert go2.feet == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    assert (go2.joints, go2.flat, g1.flat, iris.feet, iris.rotors) == (12, False, True, (), 4)
    assert go2.mass == pytest.approx(hp.load_robot("go2").mass)
    assert (go2.licence, g1.licence) == ("MPL-2.0", "BSD-3-Clause")


def test_without_their_files_names_are_known(monkeypatch):
    monkeypatch.setattr("harpy_pin.model.known_robots.installed_data", lambda: None)
    go2 = hp.robots()["go2"]
    assert (go2.mass, go2.joints, go2.licence) == (None, None, None)
    assert len(go2.feet) == 4


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("go2", "go2"),
        ("Go2", "go2"),
        ("unitree_g1", "g1"),
        ("ANYmal-C", "anymal_c"),
        ("anymal", "anymal_c"),
        ("solo", "solo12"),
        ("Solo 12", "solo_12"),
        ("Harpy", "harpy"),
    ],
)
def test_other_spellings(said, meant):
    expected = meant if meant in (*CATALOGUE, "harpy") else said
    assert known_name(said) == expected


@needs_robots
def test_they_are_understood_everywhere():
    assert hp.load_robot("Solo").name == "solo12"
    assert hp.Scenario(robot="ANYmal-C").robot == "anymal_c"
    assert hp.load_robot("go2").name == "go2"


@pytest.mark.parametrize(("said", "meant"), [("goo2", "go2"), ("laikag", "laikago"), ("anymal_d", "anymal_")])
def test_typing_errors_get_a_suggestion(said, meant):
    for make in (hp.load_robot, lambda name: hp.Scenario(robot=name)):
        with pytest.raises(hp.InputError, match=f"did you mean '{meant}"):
            make(said)
    with pytest.raises(hp.InputError) as caught:
        hp.Scenario(robot="xyzzyx")
    assert "did you mean" not in str(caught.value)
    with pytest.raises(hp.InputError, match="did you mean 'condensed'"):
        hp.Scenario(controller="condenced")


@pytest.mark.parametrize(
    ("call", "said", "meant"),
    [
        (hp.Ground, {"mu": 0.5}, "mu_s"),
        (hp.Ground, {"friction": 0.5}, "mu_s"),
        (hp.Scenario, {"friction": 0.5}, "Ground"),
        (hp.Scenario, {"mu": 0.5}, "Ground"),
        (hp.Scenario, {"schedule": "crawl"}, "Walking"),
        (hp.walk, {"duration": 3.0}, "Scenario"),
        (hp.walk, {"robot": "go2"}, "Scenario"),
        (hp.walk, {"velocity": 0.3}, "Walking"),
    ],
)
def test_arguments_that_were_meant_otherwise(call, said, meant):
    """The message names what was meant, and the example in it can be run."""
    (name,) = said
    with pytest.raises(TypeError, match=f"has no argument '{name}'") as caught:
        call(**said)
    text = str(caught.value)
    assert meant in text
    if " as in " in text:
        example = text.partition(" as in ")[2].partition(";")[0]
        names = {key: getattr(hp, key) for key in ("Ground", "Scenario", "Straight", "Walking")}
        eval(example, {**names, "walk": lambda scenario: scenario})
