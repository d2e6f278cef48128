"""A velocity beyond what the legs walk is said to be limited, once the gait is made, and no other."""

from __future__ import annotations

import warnings

import pytest
from needs import needs_robots

import harpy_pin as hp


@needs_robots
def test_a_walking_gait_says_to_what_it_limits_the_velocity() -> None:
    robot = hp.load_robot("go2")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        most = hp.WalkingGait(robot).max_speed
        hp.WalkingGait(robot, velocity=(most, 0.0, 0.0))
    for velocity in ((9.0, 0.0, 0.0), ((0.0, 0.1, 0.0, 0.0), (1.0, 9.0, 0.0, 0.0))):
        with pytest.warns(UserWarning, match=rf"velocity \(9, 0, 0\) .* limited to \({most:.3g}, 0, 0\)") as said:
            gait = hp.WalkingGait(robot, velocity=velocity)
        assert [warning.filename for warning in said] == [__file__]
        assert gait.max_speed == most


@needs_robots
def test_what_is_said_is_what_is_walked() -> None:
    gait = hp.Walking(velocity=(9.0, 0.0, 0.0))
    with pytest.warns(UserWarning, match="limited to") as said:
        run = hp.walk(hp.Scenario(robot="go2", gait=gait, duration=4.0))
    limited = float(str(said[0].message).partition("limited to (")[2].partition(",")[0])
    assert run["applied_velocity"][:, 0].max() == pytest.approx(limited, abs=0.005)


def test_commanded_harpy_says_so_too() -> None:
    with pytest.warns(UserWarning, match=r"velocity \(0, 3, 0\) .* limited to \(0, 0.2, 0\)"):
        hp.gaits.CommandedGait(hp.load_harpy(), ((0.0, 0.0, 3.0, 0.0),))
