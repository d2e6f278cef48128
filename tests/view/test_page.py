"""The page without a browser: what it holds, logs and requests from strangers."""

import contextlib
import socket
import struct
from typing import Any

import numpy as np
import pytest
from needs import needs_robots
from pages import commands_of, content_of, make_run, unpack

from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.loading import load_robot
from harpy_pin.model.robot import Robot
from harpy_pin.view import ReplayServer, replay_html, robot_of
from harpy_pin.view.identity import name_of
from harpy_pin.view.page.build_page import pack
from harpy_pin.view.page.charts import Clock
from harpy_pin.view.page.shown import scoreboard, telling_moment
from harpy_pin.view.palette import ground_colour
from harpy_pin.view.scene.forces import ROUNDING
from harpy_pin.view.scene.frames import Contacts, Frames
from harpy_pin.view.scene.ground import centre_of_pressure, footholds, slip_steps


def test_thinning_keeps_the_extremes_of_every_span() -> None:
    rng = np.random.default_rng(3)
    time = 0.001 * np.arange(20_000)
    signal = rng.normal(size=20_000)
    signal[7_321], signal[15_000:15_400] = 50.0, np.nan
    clock = Clock.of([time], most=1500)
    thin = clock.thin(time, signal)
    assert len(thin) == len(clock.points) <= 3000
    share = round(clock.width / 0.001)
    for k in range(clock.count):
        rows = signal[k * share : (k + 1) * share]
        found = thin[2 * k : 2 * k + 2]
        if np.all(np.isnan(rows)):
            assert np.all(np.isnan(found))
        else:
            assert sorted(found) == [np.nanmin(rows), np.nanmax(rows)]
            assert (np.nanargmin(rows) <= np.nanargmax(rows)) == (found[0] <= found[1])
    assert np.nanmax(thin) == 50.0


def test_short_runs_are_not_thinned_and_periods_mix() -> None:
    coarse, fine = 0.002 * np.arange(50), 0.001 * np.arange(60)
    clock = Clock.of([coarse, fine])
    assert clock.width == 0.002
    np.testing.assert_array_equal(clock.thin(coarse, coarse)[::2], coarse)
    thin = clock.thin(fine, fine)
    assert np.nanmax(thin) == fine[-1]
    assert np.all(np.isnan(thin[70:]))
    assert not np.any(np.isnan(thin[:58]))


def test_page_opens_where_a_loaded_foot_slides_most(robot: Robot) -> None:
    velocity = np.zeros((1001, 2, 3))
    velocity[400:500, 0, 0] = 0.05
    velocity[800:900, 0, 1] = 0.30
    velocity[600:700, 1, 0] = 9.0  # in the air
    force = np.zeros((1001, 2, 3))
    force[:, 0] = (3.0, 0.0, 39.0)
    force[850:860, 0] = (6.0, 0.0, 39.0)
    run = make_run(robot, foot_velocity=velocity, foot_force=force)
    moment = telling_moment(Frames(run, robot, fps=1e3))
    assert 0.85 <= moment.time < 0.86
    assert moment.power == pytest.approx(0.3 * 6.0)
    assert moment.reason == "left foot slides at 300 mm/s under 39 N"
    content = content_of(replay_html([(run, robot)]))
    assert 0.8 <= content["moment"]["time"] < 0.9


def test_page_opens_where_most_friction_is_used_if_nothing_slides(robot: Robot) -> None:
    force = np.zeros((1001, 2, 3))
    force[:, 0] = (3.0, 0.0, 39.0)
    force[300:310, 0] = (0.0, -9.0, 39.0)
    force[500:510, 0] = (0.1, 0.0, 0.41)  # a foot that hardly touches
    force[500:510, 1] = (3.0, 0.0, 38.0)
    velocity = np.zeros((1001, 2, 3))
    velocity[700, 0, 0] = 3.0  # one row: a touchdown
    run = make_run(robot, foot_velocity=velocity, foot_force=force)
    moment = telling_moment(Frames(run, robot, fps=1e3))
    assert 0.3 <= moment.time < 0.31
    assert f"{100 * 9.0 / (0.25 * 39.0):.0f} %" in moment.reason
    assert moment.power == 0.0


def test_what_happens_in_a_fall_is_not_the_moment(robot: Robot) -> None:
    velocity, force = np.zeros((1001, 2, 3)), np.zeros((1001, 2, 3))
    force[:, 0] = (3.0, 0.0, 39.0)
    velocity[300:400, 0, 0], velocity[900:, 0, 0] = 0.1, 5.0
    run = make_run(robot, foot_velocity=velocity, foot_force=force)
    run["q"][800:, 3:7] = (np.sin(0.4), 0.0, 0.0, np.cos(0.4))
    assert 0.3 <= telling_moment(Frames(run, robot, fps=1e3)).time < 0.4


def walked(robot: Robot, **changes: Any) -> Run:
    """A run that says of itself what walked."""
    part = {
        "name": changes.pop("controller", "condensed"),
        "governor": changes.pop("governor", "paper"),
    }
    scenario = {"controller": part}
    return make_run(
        robot, metadata={"scenario": scenario, **changes.pop("metadata", {})}, **changes
    )


def test_runs_are_named_and_told_apart(robot: Robot) -> None:
    paper, explicit = walked(robot, controller="governed"), walked(robot)
    assert (name_of(paper), name_of(explicit)) == ("Paper's governor", "Condensed controller")
    assert name_of(walked(robot, metadata={"own": ["controller"]})) == "Test"
    content = content_of(replay_html([(paper, robot), (explicit, robot), (explicit, robot)]))
    names = [run["name"] for run in content["runs"]]
    assert names[0].startswith("Paper's governor")
    assert len(set(names)) == 3
    assert len({run["colour"] for run in content["runs"]}) == 3
    for chart in content["charts"]["charts"]:
        assert [line["label"] for line in chart["lines"]] == names
        assert all(len(line["values"]) == len(content["charts"]["time"]) for line in chart["lines"])
    for wrong in ([], [(paper, robot)] * 5):
        with pytest.raises(InputError, match="1 to 4 runs"):
            replay_html(wrong)
    with pytest.raises(InputError, match="as many names"):
        replay_html([(paper, robot)], names=["a", "b"])


def test_scoreboard_marks_the_best_that_walked(robot: Robot) -> None:
    def slipping(path: float, ending: str = "completed") -> Run:
        slip = np.linspace(0.0, path, 1001)[:, None] * np.array([1.0, 0.0])
        return make_run(robot, slip_path=slip, metadata={"ending": ending})

    scores = {
        s.label: s for s in scoreboard([slipping(0.010), slipping(0.002), slipping(0.001, "fell")])
    }
    assert scores["ending"].best == (0, 1)
    assert scores["ending"].values[2].startswith("fell at 1.00")
    assert scores["slip, mm per step"].best == (1,)
    assert scores["slip, mm per step"].values == ("7.5", "1.5", "0.7")
    assert scores["thrust, N rms"].best == ()  # all alike
    fallen = {s.label: s for s in scoreboard([slipping(0.1, "fell"), slipping(0.2, "fell")])}
    assert fallen["slip, mm per step"].best == ()


def test_packing_is_plain_letters_and_exact() -> None:
    content = {"a": [1.5, None, "</script><b>'\"\u2028\ud800{{meshcat}}"], "b": {"\x00": True}}
    text = pack(content)
    assert text.isascii()
    assert all(c.isalnum() or c in "+/=" for c in text)
    assert unpack(text) == content


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "g1"])
def test_the_robot_of_a_log_is_found(robot: Robot, name: str) -> None:
    """By its names and feet, whose corners are logged where feet are flat, or by what one says of
    it.
    """
    assert robot_of(make_run(robot, 5)).urdf == robot.urdf
    other = load_robot(name)
    run = make_run(other, 5)
    for found in (robot_of(run), robot_of(run, name)):
        assert (found.name, found.urdf, found.feet) == (name, other.urdf, other.feet)
    unknown = Run(run.signals, run.metadata | {"feet": ["a", "b", "c", "d"]})
    with pytest.raises(InputError, match="give its URDF"):
        robot_of(unknown)


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "anymal_c", "talos"])
def test_other_robots_fit_in_the_picture(name: str) -> None:
    """The camera sees a height of ``size``; the robot's is most of it, and never more."""
    from harpy_pin.view.scene.scene import picture_size

    other = load_robot(name)
    run = make_run(other, 3)
    run["q"][:, 3:7], run["q"][:, 7:] = (0.0, 0.0, 0.0, 1.0), other.posture
    lowest = {"solo12": 0.24, "anymal_c": 0.55, "talos": 1.02}[name]
    run["q"][:, 2] = lowest
    frames = Frames(run, other)
    points = np.concatenate((frames.joints[0, 1:, :3, 3], frames["foot_position"][0]))
    size = picture_size(frames)
    reach = max(np.ptp(points[:, 2]), np.ptp(points[:, 0]), np.ptp(points[:, 1]))
    assert 1.1 * reach < size < 3.0 * reach


def test_slip_marks_are_where_held_feet_move(robot: Robot) -> None:
    run = make_run(robot)
    force, place = np.zeros((1001, 2, 3)), np.zeros((1001, 2, 3))
    force[200:801, 0, 2] = 40.0
    place[:, 0, 0] = np.interp(run["t"], [0.4, 0.6], [0.0, 0.05])
    place[:, 1, 0] = run["t"]  # moves, but in the air
    moved = Run(run.signals | {"foot_force": force, "foot_position": place}, run.metadata)
    frames = Frames(moved, robot, fps=50.0)
    row, steps = slip_steps(frames)
    assert frames.time[row[0]] == pytest.approx(0.42)
    assert frames.time[row[-1]] == pytest.approx(0.60)
    np.testing.assert_allclose(steps[:, 0, 0], 0.25 * (frames.time[row - 1] - 0.4), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(steps[:, 1] - steps[:, 0], axis=1).sum(), 0.05)
    np.testing.assert_allclose(footholds(frames), [[0.0, 0.0]])


def test_centre_of_pressure_is_between_the_feet(robot: Robot) -> None:
    run = make_run(robot, 3)
    force, place = np.zeros((3, 2, 3)), np.zeros((3, 2, 3))
    place[:, 0], place[:, 1] = (0.0, 0.1, 0.0), (0.4, -0.1, 0.002)
    force[1, :, 2], force[2, :, 2] = (30.0, 10.0), (0.0, 20.0)
    standing = Run(run.signals | {"foot_force": force, "foot_position": place}, run.metadata)
    frames = Frames(standing, robot, fps=1e3)
    point = centre_of_pressure(frames)
    assert np.all(np.isnan(point[0]))
    np.testing.assert_allclose(point[1:], [[0.1, 0.05], [0.4, -0.1]])


def test_forces_outside_their_cone() -> None:
    force = np.array(
        [[3.0, 4.0, 10.0], [3.0, 4.0, 9.9], [0.0, 0.0, 0.0], [1.0, 0.0, -1.0], [0.0, 0.0, 5.0]]
    )
    mu, still = np.full(5, 0.5), np.zeros_like(force)
    used = Contacts(still, force, still, mu).used
    np.testing.assert_allclose(used, [1.0, 5.0 / 4.95, 0.0, 0.0, 0.0])
    assert (used > ROUNDING).tolist() == [False, True, False, False, False]
    assert not (Contacts(still, force, still, mu, per_axis=True).used > ROUNDING).any()
    assert np.isinf(Contacts(still, force, still, np.zeros(5)).used[:2]).all()


def test_ground_is_coloured_by_its_friction() -> None:
    colours = [ground_colour(mu) for mu in (0.0, 0.1, 0.4, 0.8, 2.0)]
    blue_over_red = [int(c[5:7], 16) - int(c[1:3], 16) for c in colours]
    assert blue_over_red == sorted(blue_over_red, reverse=True)
    assert colours[3] == colours[4]


def test_ice_is_drawn_where_it_is(robot: Robot) -> None:
    ground = {
        "mu_s": 0.6,
        "cone": "circular",
        "friction_strips": [[0.2, 0.5, 0.1], [1.0, 1.5, 0.05]],
    }
    commands = commands_of(replay_html([(make_run(robot, 50, metadata={"ground": ground}), robot)]))
    for number, (begin, end, mu) in enumerate(ground["friction_strips"]):
        path = f"/meshcat/walk/ground/strip/{number + 1}"
        (drawn,) = (
            c["object"] for c in commands if c["type"] == "set_object" and c["path"] == path
        )
        (place,) = (
            c["matrix"][12:] for c in commands if c["path"] == path and c["type"] == "set_transform"
        )
        width = drawn["geometries"][0]["width"]
        assert (place[0] - 0.5 * width, place[0] + 0.5 * width) == pytest.approx((begin, end))
        assert f"#{drawn['materials'][0]['color']:06x}" == ground_colour(mu)


def test_power_is_that_of_a_battery_or_else_of_joints_and_fans(robot: Robot) -> None:
    """A battery's is the slope of its energies; without one a fan of 18 N takes 1 kW."""
    time, thrust, torque, v = (
        0.001 * np.arange(1001),
        *(np.zeros((1001, *n)) for n in ((2, 3), (6,), (12,))),
    )
    thrust[:, :, 2], torque[:, 4], v[:, 10] = 18.0, -3.0, 2.0
    battery = {
        "battery_energy": time[:, None] * np.array([100.0, 0.0, 5.0, 40.0, 20.0, 10.0, 25.0])
    }
    without = {"thrust": thrust, "torque": torque, "v": v}
    for signals, desired in ((battery, (100.0, 60.0, 35.0)), (without, (2000.0, -6.0))):
        charts = content_of(replay_html([(make_run(robot, **signals), robot)]))["charts"]["charts"]
        (chart,) = (chart for chart in charts if chart["title"] == "power")
        for line, expected in zip(chart["lines"], desired, strict=True):
            np.testing.assert_allclose(
                [v for v in line["values"] if v is not None], expected, rtol=1e-3
            )
    with pytest.raises(InputError, match="battery_energy"):
        replay_html([(make_run(robot, battery_energy=time), robot)])


def test_friction_that_changes_is_that_of_the_moment(robot: Robot) -> None:
    """A driven run logs the friction under its feet; charts, cones and values follow it."""
    force = np.zeros((1001, 2, 3))
    force[:, 0] = (4.0, 0.0, 40.0)
    friction = np.where(np.arange(1001)[:, None] < 500, 0.8, 0.2) * np.ones((1, 2))
    content = content_of(
        replay_html([(make_run(robot, foot_force=force, foot_friction=friction), robot)])
    )
    shares = [row.split(" · ")[0] for row in content["runs"][0]["values"]["friction"]]
    assert (shares[0], shares[-1]) == ("12 %", "50 %")
    assert content["moment"]["time"] >= 0.5
    chart = next(
        c for c in content["charts"]["charts"] if c["title"] == "friction force, left foot"
    )
    bound = [value for value in chart["lines"][0]["values"] if value is not None]
    assert (bound[0], bound[-1]) == (32.0, 8.0)


@pytest.mark.parametrize("name", ["t", "q", "foot_force", "thrust", "torque", "x_r"])
def test_signals_of_other_kinds_are_refused(robot: Robot, name: str) -> None:
    signal = make_run(robot, 20)[name]
    for strange in (np.full(signal.shape, "x"), signal.astype(complex), np.zeros((20, 2, 2, 2))):
        strange_run = make_run(robot, 20, **{name: strange})
        with pytest.raises(InputError):
            replay_html([(strange_run, robot)])


def test_metadata_and_times_of_other_kinds_are_refused(robot: Robot) -> None:
    parameters = ({"parameters": [1]}, {"parameters": {"gait": 3}})
    for metadata in ({"ground": "x"}, *parameters, {"feet": 3}, {"control_period": "x"}):
        with pytest.raises(InputError, match="metadata"):
            replay_html([(make_run(robot, 20, metadata=metadata), robot)])
    with pytest.raises(InputError, match="times"):
        replay_html([(make_run(robot, 20, t=np.linspace(0.0, 1e8, 20)), robot)])


def ask(server: ReplayServer, request: bytes) -> bytes:
    with socket.create_connection(
        ("127.0.0.1", int(server.url.rstrip("/").rsplit(":", 1)[1])), timeout=10
    ) as line:
        line.sendall(request)
        with contextlib.suppress(OSError):  # the server may have hung up on nonsense already
            line.shutdown(socket.SHUT_WR)
        answer = b""
        try:
            while piece := line.recv(65536):
                answer += piece
        except ConnectionResetError:
            pass
        return answer


def test_only_this_machine_is_answered(capfd: pytest.CaptureFixture[str]) -> None:
    with ReplayServer("<p>page</p>") as server:
        for host in ("localhost", "127.0.0.1:80", "[::1]:9000", "LOCALHOST:1"):
            assert b"<p>page</p>" in ask(server, f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        strangers = [
            "evil.example",
            "localhost.evil.example",
            "127.0.0.1.nip.io",
            "localhost@evil",
            "[::1",
            "0.0.0.0",
        ]
        for host in ("", *strangers):
            answer = ask(server, f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            assert answer.startswith(b"HTTP/1.0 403")
            assert b"page</p>" not in answer
        assert b"403" in ask(server, b"GET / HTTP/1.0\r\n\r\n")
        assert b"404" in ask(server, b"GET /../../etc/hostname HTTP/1.0\r\nHost: localhost\r\n\r\n")
    assert capfd.readouterr().err == ""


def test_nonsense_and_closed_tabs_leave_the_server_alive(capfd: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(5)
    good = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with ReplayServer("x" * 5_000_000) as server:
        port = int(server.url.rstrip("/").rsplit(":", 1)[1])
        requests = [
            b"",
            b"\r\n" * 50,
            b"GET",
            b"GET / HTTP/9.9\r\n\r\n",
            b"POST / HTTP/1.1\r\n\r\n",
            b"G" * 100_000,
        ]
        requests += [
            b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 500 + b"\r\n",
            b"GET /<script> HTTP/1.1\r\nHost: \xff\r\n\r\n",
        ]
        for _ in range(100):
            noise = bytearray(good)
            for at in rng.integers(0, len(good), 4):
                noise[at] = rng.integers(0, 256)
            requests.append(bytes(noise))
        for request in requests:
            assert b"<script>" not in ask(server, request)
        for _ in range(5):  # tabs that are closed while the page is on its way
            line = socket.create_connection(("127.0.0.1", port))
            line.sendall(good)
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.close()
        assert ask(server, good).endswith(b"x" * 1000)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("port", [70000, -1, 80.5, True])
def test_no_such_port(port: Any) -> None:
    with pytest.raises(InputError, match="port"):
        ReplayServer("", port=port)
