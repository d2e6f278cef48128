"""Closed loops of a URDF on the command line, in the log of a walk, and in the hint of who forgot
them.
"""

import warnings

import numpy as np
import pytest
from looped_robots import four_bar

import harpy_pin as hp
from harpy_pin.view.identity import robot_of

LOOPS = ",".join(f"{side}_rod_end:{side}_lever:point" for side in ("left", "right"))
POSTURE = "0,-0.4,0.74"
OPTIONS = ("--feet", "left_foot,right_foot", "--posture", POSTURE, "--loops", LOOPS)


@pytest.fixture
def biped(tmp_path):
    return four_bar(tmp_path).urdf


def test_a_walk_with_loops_is_walked_again(biped, tmp_path, command):
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    code, _, err = command(
        *("walk", "--robot", biped, *OPTIONS, "--duration", 0.3, "--save", first)
    )
    assert (code, err) == (0, "")
    run = hp.Run.load(first)
    assert run["q"].shape[1] == 13  # six joints have a motor
    assert len(robot_of(run).loops.ties) == 2
    assert command("walk", "--again", first, "--save", second)[0] == 0
    np.testing.assert_array_equal(hp.Run.load(second)["q"], run["q"])
    assert command("view", first, "--html", tmp_path / "a.html")[0] == 0


def test_other_commands_know_loops(biped, command):
    code, out, err = command("info", "--robot", biped, *OPTIONS)
    assert (code, err) == (0, "")
    assert "nq 13, nv 12" in out
    table, _, loops = out.partition("2 closed loops move ")
    assert "left_knee" in table
    assert "left_knee" not in loops


@pytest.mark.parametrize(
    ("loops", "says"),
    [
        ("left_rod_end:left_lever", "--loops takes FRAME:FRAME:point or FRAME:FRAME:length"),
        ("left_rod_end:left_lever:weld", "unknown kind of loop 'weld'"),
        ("left_rod_end:nose:point", "unknown frame of a loop 'nose'"),
        ("", "--loops takes"),
    ],
)
def test_loops_that_are_none(biped, command, loops, says):
    robot = ("--robot", biped, "--feet", "left_foot,right_foot")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        code, _, err = command("walk", *robot, "--loops", loops)
    assert (code, says in err, len(err.strip().splitlines())) == (2, True, 1), err


def test_loops_are_of_a_robot_that_is_named(command):
    code, _, err = command("walk", "--loops", LOOPS)
    assert (code, "of a robot that --robot names" in err) == (2, True)


def test_who_forgets_loops_gets_a_hint(biped):
    with pytest.warns(UserWarning, match="of effort 0, .* no closed loop .loops=, --loops. moves"):
        hp.load_robot(biped, feet=("left_foot", "right_foot"))
