"""Live: the session by a made-up clock, its times, its board and its log; no browser and no
page.
"""

from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.contrib.live.drive import Drive, LiveLog
from harpy_pin.contrib.live.live_session import PERIOD, LiveSession
from harpy_pin.contrib.live.settings import LiveSettings, usual_settings
from harpy_pin.contrib.live.snapshots import snapshot
from harpy_pin.contrib.live.times import RealTimePacer, TickTimes
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.log.run import Run
from harpy_pin.view import replay_html
from harpy_pin.view.identity import CONTROLLERS
from harpy_pin.view.scene.frames import Frames


def make(robot: hp.Robot, **settings: Any) -> LiveSession:
    return LiveSession(LiveSettings(**{"forward": 0.3, "friction": 0.6} | settings), robot=robot)


def walk(session: LiveSession, duration: float) -> LiveSession:
    for _ in range(round(duration / PERIOD / 50)):
        session.step(50)
    return session


def test_clock_decides_how_far_it_walks(robot: hp.Robot) -> None:
    session = make(robot)
    assert session.advance(100.0) == 1  # the clock starts now
    for now in np.arange(100.0, 101.0001, 0.01):
        session.advance(float(now))
    assert session.time == pytest.approx(1.0, abs=2 * PERIOD)
    assert session.pacer.factor == pytest.approx(1.0, abs=0.01)
    assert session.pacer.lost == 0.0
    assert not session.ending
    slow = make(robot, pace=0.2)
    for now in np.arange(0.0, 1.0001, 0.01):
        slow.advance(float(now))
    assert slow.time == pytest.approx(0.2, abs=2 * PERIOD)


def test_time_that_is_missed_is_lost_and_said(robot: hp.Robot) -> None:
    keeper = RealTimePacer(PERIOD, most_late=0.1)
    done = 0
    for now in np.arange(0.0, 4.0, 0.002):  # time for one tick every 2 ms
        done += keeper.is_due(float(now), 1.0)
    assert done == 2000
    assert keeper.factor == pytest.approx(0.5, abs=0.01)
    assert keeper.lost == pytest.approx(1.9, abs=0.01)


def test_less_friction_makes_it_slip(robot: hp.Robot) -> None:
    kept, iced = walk(make(robot, assumed=0.6), 1.5), walk(make(robot, assumed=0.6), 1.5)
    assert np.array_equal(kept.simulator.q, iced.simulator.q)
    iced.change({"friction": 0.05})
    before = float(kept.slip[:, 0].sum())
    walk(kept, 1.5)
    walk(iced, 1.5)
    assert float(iced.slip[:, 0].sum()) - before > 10.0 * (float(kept.slip[:, 0].sum()) - before)
    assert iced.simulator.ground.friction(0.0) == 0.05


def test_ice_lies_ahead_and_goes(robot: hp.Robot) -> None:
    session = walk(make(robot), 1.0)
    x = float(session.simulator.q[0])
    session.lay_strip(0.1)
    ((begin, end, mu),) = session.settings.friction_strips
    assert x < begin < end < x + 1.0
    assert mu == 0.1
    assert session.simulator.ground.friction(0.5 * (begin + end)) == 0.1
    session.change({"friction_strips": ()})
    assert session.simulator.ground.friction(0.5 * (begin + end)) == 0.6


def test_controllers_take_over_in_mid_walk(robot: hp.Robot) -> None:
    """From each to each other, at moments that fall on all parts of a step: nobody falls, nothing
    jumps.
    """
    session = walk(make(robot), 2.0)
    begin = float(session.simulator.q[0])
    names = list(CONTROLLERS)
    order = [
        *(name for k, a in enumerate(names) for b in names[k + 1 :] for name in (a, b)),
        names[0],
    ]
    assert sorted(pairwise(order)) == sorted(permutations(names, 2))
    assert session.settings.controller == names[0]
    for number, name in enumerate(order[1:]):
        q = session.simulator.q.copy()
        assert session.change({"controller": name}) == ""
        assert np.array_equal(session.simulator.q, q)
        walk(session, 0.4 + 0.05 * (number % 7))
        assert not session.ending, (order[number], name, session.time)
    assert session.walks == 1
    walked = float(session.simulator.q[0]) - begin
    assert walked == pytest.approx(0.3 * (session.time - 2.0), rel=0.05)


def test_a_walk_that_turned_begins_anew_where_the_controller_faces_x(robot: hp.Robot) -> None:
    session = walk(make(robot, turning=0.5), 2.0)
    note = session.change({"controller": "paper"})
    assert "began anew" in note
    assert session.walks == 2
    assert float(np.hypot(*session.simulator.q[:2])) < 0.01
    walk(session, 3.0)
    assert not session.ending
    assert abs(float(session.controller.target.heading[0])) < 1e-9  # turning is set, and not heard
    session.change({"controller": "condensed"})
    walk(session, 2.0)
    assert session.walks == 2
    assert float(session.controller.target.heading[0]) > 0.3


def test_push_moves_it(robot: hp.Robot) -> None:
    kept, pushed = walk(make(robot), 1.0), walk(make(robot), 1.0)
    pushed.push((0.0, 4.0, 0.0))
    most = 0.0
    for _ in range(3):
        walk(kept, 0.05)
        walk(pushed, 0.05)
        most = max(most, float((pushed.simulator.v - kept.simulator.v)[1]))
    # Free, the robot would move by impulse over mass; legs and thrusters hold against it.
    assert 0.1 * 4.0 / robot.mass < most < 4.0 / robot.mass
    walk(pushed, 2.0)
    assert not pushed.ending


def test_pull_lasts_as_long_as_it_is_renewed(robot: hp.Robot) -> None:
    session = walk(make(robot, forward=0.0), 0.5)
    session.pull((0.0, 1000.0, 0.0))
    session.step(1)
    assert session.last.push == pytest.approx([0.0, session.ranges.pull, 0.0])
    session.pull((0.0, 5.0, 0.0))
    session.step(240)
    assert session.last.push == pytest.approx([0.0, 5.0, 0.0])
    session.step(20)
    assert not session.last.push.any()


def test_pause_step_and_reset(robot: hp.Robot) -> None:
    session = walk(make(robot), 1.0)
    session.pause(True)
    q = session.simulator.q.copy()
    for now in (0.0, 1.0, 2.0):
        assert session.advance(now) == 0
    assert np.array_equal(session.simulator.q, q)
    session.step(10)
    assert session.time == pytest.approx(1.01)
    assert not np.array_equal(session.simulator.q, q)
    session.pause(False)
    assert session.advance(1000.0) == 1  # what was paused is not made up for
    slip = session.slip.copy()
    session.reset()
    first = make(robot)
    assert np.array_equal(session.simulator.q, first.simulator.q)
    assert session.slip == pytest.approx(slip)
    assert session.time == pytest.approx(1.011)
    walk(session, 1.0)
    assert np.array_equal(session.simulator.q, walk(first, 1.0).simulator.q)


def test_a_fall_waits_for_a_reset(robot: hp.Robot) -> None:
    session = walk(make(robot), 1.0)
    session.push((0.0, 30.0, 0.0))
    walk(session, 2.0)
    assert session.ending == "fell"
    assert session.falls == 1
    q = session.simulator.q.copy()
    assert session.advance(0.0) == 0
    session.step(5)
    assert np.array_equal(session.simulator.q, q)
    session.reset()
    assert not walk(session, 1.0).ending


def test_stiffness_changes_gently(robot: hp.Robot) -> None:
    session = walk(make(robot), 1.0)
    session.change({"stiffness": 80e3})
    session.step(1)
    assert session.simulator.ground.stiffness < 8500.0
    walk(session, 1.0)
    assert session.simulator.ground.stiffness == 80e3
    session.change({"stiffness": 4e3})
    walk(session, 2.0)
    assert session.simulator.ground.stiffness == 4e3
    assert not session.ending


def test_delay_noise_and_estimate_act(robot: hp.Robot) -> None:
    session = walk(make(robot), 0.5)
    session.change({"delay": 2, "noise": 1.0, "estimate": True, "friction": 0.3, "assumed": 0.6})
    assert not walk(session, 2.0).ending
    clean = walk(make(robot), 2.5)
    assert not np.array_equal(session.simulator.q, clean.simulator.q)
    session.change({"controller": "none", "estimate": False})
    walk(session, 2.0)
    assert session.ending == "fell"  # joint PIDs do not survive 2 ms of delay (docs/delay.md)


@pytest.mark.parametrize(
    "changes",
    [
        {"state": "guessed"},
        {"state": "estimated", "noise": 1.0},
        {"state": "estimated", "delay": 2},
        {"forward": float("nan")},
        {"forward": "fast"},
        {"turning": float("inf")},
        {"friction": -0.1},
        {"friction": None},
        {"stiffness": 0.0},
        {"assumed": -1.0},
        {"estimate": 1},
        {"delay": 1.5},
        {"delay": -1},
        {"noise": -1.0},
        {"pace": 0.0},
        {"controller": "best"},
        {"controller": ["condensed"]},
        {"friction_strips": ((1.0, 0.0, 0.1),)},
        {"estimate": True, "controller": "none"},
        {"speed": 0.3},
        {"friction": 0.1, "sideways": float("nan")},
        ["friction"],
        None,
    ],
)
def test_bad_settings_change_nothing(robot: hp.Robot, shared: LiveSession, changes: Any) -> None:
    settings, controller, ground = shared.settings, shared.controller, shared.simulator.ground
    with pytest.raises(InputError):
        shared.change(changes)
    assert (shared.settings, shared.controller, shared.simulator.ground) == (
        settings,
        controller,
        ground,
    )
    shared.step(20)
    assert not shared.ending


@pytest.fixture(scope="module")
def shared(robot: hp.Robot) -> LiveSession:
    return make(robot)


def test_bad_events_are_refused(shared: LiveSession) -> None:
    for push in ((0.0, np.nan, 0.0), (0.0, 31.0, 0.0), (1.0, 2.0), "left", None):
        with pytest.raises(InputError):
            shared.push(push)  # type: ignore[arg-type]
        if push != (0.0, 31.0, 0.0):
            with pytest.raises(InputError):
                shared.pull(push)  # type: ignore[arg-type]
    for ticks in (0, -1, 1001, 1.5, None):
        with pytest.raises(InputError):
            shared.step(ticks)  # type: ignore[arg-type]
    with pytest.raises(InputError):
        shared.pause("yes")  # type: ignore[arg-type]
    with pytest.raises(InputError):
        shared.lay_strip(float("nan"))
    shared.step(20)
    assert not shared.ending


def test_a_controller_that_fails_stops_the_walk_only(
    robot: hp.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = walk(make(robot), 0.2)

    def fail(state: hp.State) -> hp.Command:
        raise ArithmeticError("no force")

    monkeypatch.setattr(session.controller, "step", fail)
    session.step(5)
    assert session.ending == "controller failed: ArithmeticError: no force"
    session.reset()
    assert not walk(session, 0.5).ending


def test_tick_times_are_percentiles() -> None:
    times, samples = TickTimes(), np.random.default_rng(1).lognormal(9.5, 0.5, 20_001).astype(int)
    for sample in samples:
        times.add(int(sample))
    for percent in (1.0, 50.0, 99.0, 99.9):
        assert times.percentile(percent) == pytest.approx(
            np.percentile(samples, percent) * 1e-3, abs=0.11, rel=0.002
        )
    assert times.longest == samples.max()
    assert np.isnan(TickTimes().percentile(50.0))
    late = TickTimes()
    late.add(10**9)
    assert late.percentile(50.0) == pytest.approx(1e6)


def test_log_is_a_run_at_every_moment(robot: hp.Robot, tmp_path: Path) -> None:
    path = tmp_path / "drive.npz"
    session = make(robot)
    log = LiveLog(session, path)
    session.on_tick = lambda tick: log.append()
    session.step(700)
    session.change({"controller": "paper", "friction": 0.3})
    session.step(700)
    with pytest.warns(hp.errors.RunFileWarning):
        part = Run.load(path)
    assert len(part) >= 1000  # of a process that would be killed now, but for the last second
    session.reset()
    session.change({"controller": "condensed"})
    session.step(600)
    log.close("completed")
    run = Run.load(path)
    assert list(tmp_path.iterdir()) == [path]
    assert len(run) == 2000
    assert np.all(np.diff(run["t"]) > 0.0)
    assert np.unique(run["controller"]).tolist() == [0.0, 3.0]
    assert run.metadata["live"]["controllers"][3] == "paper"
    assert run["foot_friction"][699].tolist() == [0.6, 0.6]
    assert run["foot_friction"][-1].tolist() == [0.3, 0.3]
    assert np.isnan(run["x_w"][600]).all()
    assert np.isfinite(run["x_w"][1200]).all()
    assert np.all(np.diff(run["slip_path"], axis=0) >= 0.0)
    frames = Frames(run, robot)
    mu = frames.contacts[frames.rows].mu
    assert mu is not None
    assert [mu[n, 0] for n in (0, 20, 22, -1)] == [
        0.6,
        0.6,
        0.3,
        0.3,
    ]  # the change was after 0.7 s, at 21 frames
    assert "harpy" in replay_html([(run, robot)])


def test_log_refuses_what_is_no_file(shared: LiveSession, tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none" / "drive.npz", Path("/dev/null")):
        with pytest.raises(RunFileError):
            LiveLog(shared, path)


def test_drive_without_a_page(robot: hp.Robot, tmp_path: Path) -> None:
    drive = Drive(LiveSettings(forward=0.2), robot=robot, save=tmp_path / "drive.npz")
    driven = drive.run(0.6)
    assert driven.run is not None
    assert len(driven.run) == round(driven.simulated / PERIOD) > 0
    numbers = driven.as_dict()
    assert list(numbers["tick_us"]) == ["0"]
    assert numbers["tick_us"]["0"]["ticks"] == len(driven.run)
    assert numbers["falls"] == 0


def test_robot_stands_before_controllers_are_made(robot: hp.Robot) -> None:
    """What a page shows while kernels are compiled: the robot at rest, on its feet, and where it is
    to be.
    """
    seen: list[tuple[float, float, bool]] = []

    def look(session: LiveSession) -> None:
        s = snapshot(session)
        seen.append((s["q"][2], s["x_r"][2], isinstance(session.controller, GaitController)))

    session = LiveSession(LiveSettings(controller="paper"), robot=robot, on_standing=look)
    ((height, target, controlled),) = seen
    assert (
        height == session.gait.initial_state(penetration=session.simulator.static_penetration)[0][2]
    )
    assert abs(height - target) < 0.02
    assert not controlled
    assert isinstance(session.controller, GaitController)


@pytest.mark.parametrize("name", ["harpy", "go2"])
def test_the_ground_tilts_about_the_place_below_the_body(robot: hp.Robot, name: str) -> None:
    """Far from the origin, too: the ground below it stays where it was, and it walks on up the
    slope and down again.
    """
    driven = robot if name == "harpy" else hp.load_robot("go2")
    session = LiveSession(usual_settings(driven).changed({"forward": 0.3}), robot=driven)
    walk(session, 2.0)
    for degrees, wait in ((12.0, 3.0), (-12.0, 5.0)):
        before, (x, y) = session.simulator.ground_below, session.simulator.q[:2].tolist()
        session.change({"slope": np.radians(degrees)})
        walk(session, 0.05)
        assert float(session.plane.height(x, y)) == pytest.approx(before, abs=3e-4)
        walk(session, wait)
        assert not session.ending
        assert session.plane.slope == pytest.approx(np.radians(degrees))
        assert session.simulator.q[0] > x + 0.4
        feet = session.simulator.state.foot_position
        below = session.plane.height(feet[:, 0].copy(), feet[:, 1].copy())
        assert np.abs(feet[:, 2] - below).min() < 0.01
    s = snapshot(session)
    assert s["ground_slope"] == session.plane.slope
    angle = session.plane.slope
    normal = np.array((-np.sin(angle), 0.0, np.cos(angle)))
    np.testing.assert_allclose(s["contact_force"][:, 2], s["foot_force"] @ normal, atol=1e-9)


def test_it_begins_on_the_slope_that_is_set(robot: hp.Robot) -> None:
    session = make(robot, slope=0.2, controller="paper")
    assert session.plane.slope == 0.2
    walk(session, 2.0)
    assert not session.ending
    x, _, z = session.simulator.q[:3]
    assert x > 0.3
    assert z - np.tan(0.2) * x == pytest.approx(0.6, abs=0.05)


def test_power_is_that_of_the_last_tick(robot: hp.Robot) -> None:
    """Of the joints that do not brake, and of two fans of 18 N from 1 kW."""
    session = make(robot)
    before = snapshot(session)
    walk(session, 0.5)
    joints = sum(
        max(t * w, 0.0)
        for t, w in zip(session.last.command.torque, session.last.state.v[6:], strict=True)
    )
    fans = sum(
        1000.0 * (float(np.linalg.norm(force)) / 18.0) ** 1.5
        for force in session.last.command.thrust
    )
    np.testing.assert_allclose(snapshot(session)["power"], [joints, fans])
    np.testing.assert_array_equal(before["power"], [0.0, 0.0])  # a copy: it stays as it was
