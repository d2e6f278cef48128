"""Live: robots other than Harpy. The session by a made-up clock, and its log."""

from typing import Any

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.contrib.live.charts import WholeFeet
from harpy_pin.contrib.live.drive import LiveLog
from harpy_pin.contrib.live.live_session import PERIOD, LiveSession
from harpy_pin.contrib.live.settings import DriveRanges, usual_settings
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.view.identity import robot_of

pytestmark = needs_robots


def make(robot: hp.Robot, **settings: Any) -> LiveSession:
    return LiveSession(usual_settings(robot).changed(settings), robot=robot)


def walk(session: LiveSession, duration: float) -> LiveSession:
    for _ in range(round(duration / PERIOD / 50)):
        session.step(50)
    return session


def test_it_goes_where_it_is_told(go2: hp.Robot) -> None:
    session = walk(make(go2, forward=0.5), 3.0)
    begin = session.simulator.q[:2].copy()
    walk(session, 2.0)
    assert session.simulator.q[:2] - begin == pytest.approx([1.0, 0.0], abs=0.05)
    session.change({"forward": 0.0, "turning": 0.5, "height": -0.04})
    walk(session, 3.0)
    assert float(session.gait.target.heading[0]) == pytest.approx(1.4, abs=0.15)
    assert float(session.simulator.q[2]) < 0.29
    session.change({"turning": 0.0, "controller": "wbc"})
    walk(session, 1.5)
    assert not session.ending
    assert np.abs(session.simulator.v[:3]).max() < 0.02
    assert session.gait.applied[:3].shape == (3,)


def test_schedules_change_while_it_goes_on(go2: hp.Robot) -> None:
    """It stops first; the settings stay, and the new gait goes on with them from where the robot
    stands.
    """
    session = walk(make(go2, forward=0.3), 1.0)
    for name in ("crawl", "pace", "trot"):
        assert name in session.change({"schedule": name})
        moved = float(session.simulator.q[0])
        walk(session, 3.0)
        assert not session.ending, name
        assert session.gait.schedule == name  # type: ignore[union-attr]
        assert float(session.simulator.q[0]) > moved + 0.05
    assert session.walks == 1
    session.reset()
    assert session.gait.schedule == "trot"  # type: ignore[union-attr]
    assert float(np.hypot(*session.simulator.q[:2])) < 0.01


def test_a_robot_that_always_steps_changes_its_schedule(go2: hp.Robot) -> None:
    bolt = make(hp.load_robot("bolt"))
    assert bolt.settings.schedule == "walk"
    bolt.change({"schedule": "step"})
    walk(bolt, 2.0)
    assert bolt.gait.schedule == "step"  # type: ignore[union-attr]
    assert not bolt.ending


def test_pushes_grow_with_the_mass(go2: hp.Robot) -> None:
    ranges = DriveRanges.of(go2)
    assert ranges.impulse == pytest.approx(30.0 * go2.mass / 4.0, abs=1.0)
    session = walk(make(go2, forward=0.3), 1.0)
    session.push((0.0, 0.4 * go2.mass, 0.0))
    most = 0.0
    for _ in range(6):
        walk(session, 0.05)
        most = max(most, float(session.simulator.v[1]))
    assert most > 0.15
    walk(session, 2.0)
    assert not session.ending
    with pytest.raises(InputError, match="at most"):
        session.push((0.0, 10.0 * go2.mass, 0.0))


def test_what_a_robot_does_not_have_is_refused(robot: hp.Robot, go2: hp.Robot) -> None:
    session = make(go2)
    before = session.settings
    for changes, reason in (
        ({"controller": "paper"}, "condensed, wbc"),
        ({"schedule": "walk"}, "trot"),
        ({"schedule": "gallop"}, "trot"),
        ({"height": 2.0}, "height"),
    ):
        with pytest.raises(InputError, match=reason):
            session.change(changes)
    assert session.settings is before
    harpy = LiveSession(robot=robot)
    for changes in ({"schedule": "trot"}, {"height": 0.01}):
        with pytest.raises(InputError, match="Harpy's gait"):
            harpy.change(changes)
    for name in ("solo8", "iris"):
        with pytest.raises(InputError):
            LiveSession(robot=hp.load_robot(name))


def test_a_drive_is_logged_and_replayed(go2: hp.Robot, tmp_path: Any) -> None:
    session = make(go2, forward=0.4)
    log = LiveLog(session, tmp_path / "drive.npz")
    session.on_tick = lambda tick: log.append()
    walk(session, 0.5)
    session.change({"schedule": "crawl"})
    walk(session, 2.0)
    log.close("completed")
    run = Run.load(tmp_path / "drive.npz")
    names = run.metadata["live"]["schedules"]
    assert names[int(run["schedule"][0])] == "trot"
    assert names[int(run["schedule"][-1])] == "crawl"
    assert robot_of(run).name == go2.name
    assert hp.measure(run).steps > 0


def test_corners_count_as_one_foot(go2: hp.Robot) -> None:
    g1 = WholeFeet(hp.load_robot("g1"))
    assert g1.names == ("left_sole", "right_sole")
    points = np.arange(24.0).reshape(8, 3)
    np.testing.assert_array_equal(
        g1.force(points), [points[:4].sum(axis=0), points[4:].sum(axis=0)]
    )
    np.testing.assert_array_equal(g1.least(points[:, 0]), [0.0, 12.0])
    whole = WholeFeet(go2)
    assert whole.names == go2.feet
    np.testing.assert_array_equal(whole.force(points[:4]), points[:4])
