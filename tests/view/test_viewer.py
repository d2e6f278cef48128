"""The viewer of a loop of one's own: what its page gets, how often, what it refuses, and how it
ends.
"""

import base64
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from needs import needs_robots
from pages import make_run
from viewer_client import Commands, SlowBrowser, messages

import harpy_pin as hp
from harpy_pin.errors import HarpyError, InputError, RunFileError
from harpy_pin.view import Viewer
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.meshcat_backend import ROOT, node_commands
from harpy_pin.view.scene.nodes import Motion
from harpy_pin.view.scene.scene import scene_of
from harpy_pin.view.viewer import viewer as viewer_module
from harpy_pin.view.viewer.moments import Slot, moment_type

GROUND = hp.Ground(mu_s=0.25)
HISTORY = ("ground/", "path", "foothold", "slip/", "trail/")
"""Nodes of a replay that show a whole walk; a viewer has a ground of its own."""


@pytest.fixture(scope="module")
def viewer(robot: hp.Robot) -> Iterator[Viewer]:
    q = make_run(robot, 2)["q"][0]
    with Viewer(robot, ground=GROUND, q=q) as viewer:
        yield viewer


def moment(run: hp.Run, row: int) -> tuple[hp.State, hp.Command, Any]:
    """What a loop gives a viewer at a row of a run."""
    names = ("q", "v", "foot_position", "foot_velocity", "foot_force")
    state = hp.State(float(run["t"][row]), *(run[name][row] for name in names))
    signals = {name: run[name][row] for name in ("x_r", "x_w") if name in run}
    return (
        state,
        hp.Command(run["torque"][row], run["thrust"][row]),
        SimpleNamespace(telemetry=lambda: signals),
    )


def seen(viewer: Viewer) -> Commands:
    """The whole scene, after the newest moment was drawn for one who looks."""
    messages(viewer, 1)
    viewer.static_html()
    return messages(viewer, 1)[0]


def matrices(commands: Commands) -> dict[str, np.ndarray]:
    """Transforms by path below the world's frame."""
    moved = [c for c in commands if c["type"] == "set_transform"]
    return {c["path"].removeprefix(f"{ROOT}/"): np.reshape(c["matrix"], (4, 4)).T for c in moved}


def visibility(commands: Commands) -> dict[str, bool]:
    properties = [c for c in commands if c["type"] == "set_property" and c["property"] == "visible"]
    return {c["path"].removeprefix(f"{ROOT}/"): c["value"] for c in properties}


def matrix_of(motion: Motion, row: int) -> np.ndarray:
    """Position, quaternion and scale as one matrix."""
    matrix = np.eye(4)
    if motion.quaternion is not None:
        matrix[:3, :3] = pin.Quaternion(motion.quaternion[row]).matrix()
    if motion.scale is not None:
        matrix[:3, :3] = matrix[:3, :3] @ np.diag(motion.scale[row])
    if motion.position is not None:
        matrix[:3, 3] = motion.position[row]
    return matrix


def drawn(commands: Commands) -> dict[str, Any]:
    """Geometry and material of the objects by path, without the numbers that Meshcat gives each."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {
                k: plain(v)
                for k, v in value.items()
                if k not in ("uuid", "geometry", "material", "image")
            }
        return (
            [plain(v) for v in value] if isinstance(value, list) else getattr(value, "data", value)
        )

    objects = {
        c["path"].removeprefix(f"{ROOT}/"): plain(c["object"])
        for c in commands
        if c["type"] == "set_object"
    }
    return {path: value for path, value in objects.items() if not path.startswith(HISTORY)}


SLOPE = hp.Ground(mu_s=0.6, cone="per_axis", slope=0.2)


@pytest.mark.parametrize(
    ("name", "ground"),
    [("harpy", GROUND), ("harpy", SLOPE), pytest.param("solo12", SLOPE, marks=needs_robots)],
    ids=["harpy", "slope", "solo12"],
)
def test_the_scene_is_the_replays(name, ground):
    robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
    sliding = np.zeros((300, len(robot.feet), 3))
    sliding[:, 0, 0] = 0.3
    run = make_run(robot, 300, foot_velocity=sliding, metadata={"ground": ground.to_dict()})
    frames = Frames(run, robot, fps=1e3)
    scene = scene_of(frames)
    with Viewer(robot, ground=ground, q=run["q"][0]) as viewer:
        for row in (0, 123, 299):
            viewer.show(*moment(run, row))
            commands = seen(viewer)
            moved, visible = matrices(commands), visibility(commands)
            for path, motion in scene.motions.items():
                if path == "" or path.startswith(HISTORY):
                    continue
                if motion.visible is not None:
                    assert visible[path] == motion.visible[row], (path, row)
                if motion.position is not None or motion.scale is not None:
                    np.testing.assert_allclose(
                        moved[path], matrix_of(motion, row), atol=1e-12, err_msg=path
                    )
    replayed = [
        umsgpack.unpackb(umsgpack.packb(command)) for command in node_commands(scene.nodes, {})
    ]
    assert drawn(commands) == drawn(replayed)


def test_forces_of_a_walk_are_where_and_as_long_as_they_are(
    robot: hp.Robot, viewer: Viewer
) -> None:
    run = hp.walk(hp.Scenario(controller="condensed", ground=GROUND, duration=1.0))
    page = urllib.request.urlopen(viewer.url).read().decode()
    newtons_per_metre = float(re.findall(r"(\d+) N per metre", page)[0])
    loaded = np.flatnonzero(run["foot_force"][:, 0, 2] > 20.0)
    data, forces, shafts = robot.model.createData(), [], []
    foot, thruster = robot.feet[0], robot.thrusters[1]
    for row in loaded[[10, len(loaded) // 2, -10]]:
        viewer.show(*moment(run, int(row))[:2])
        moved = matrices(seen(viewer))
        pin.framesForwardKinematics(robot.model, data, run["q"][row])
        arrow, force = moved[f"contact_force/{foot}"], run["foot_force"][row, 0]
        np.testing.assert_allclose(
            arrow[:3, 3], data.oMf[robot.frame_id(foot)].translation, atol=1e-6
        )
        np.testing.assert_allclose(arrow[:3, 2], force / np.linalg.norm(force), atol=1e-9)
        place = data.oMf[robot.frame_id(thruster)].translation
        np.testing.assert_allclose(moved[f"thrust/{thruster}"][:3, 3], place, atol=1e-9)
        forces.append(np.linalg.norm(force))
        shafts.append(moved[f"contact_force/{foot}/shaft"][2, 2])
    assert np.ptp(forces) > 1.0
    np.testing.assert_allclose(np.diff(forces) / np.diff(shafts), newtons_per_metre, rtol=1e-6)


def test_targets_of_controllers_gaits_and_objects(
    gait: hp.Gait, robot: hp.Robot, viewer: Viewer
) -> None:
    controller = hp.make_controller("governed", gait, mu=0.25)
    plant = hp.Simulator(robot, ground=GROUND)
    plant.reset(*gait.initial_state(penetration=plant.static_penetration))
    for _ in range(50):
        plant.advance(controller.step(plant.state))
    command = controller.step(plant.state)
    of_gait = controller.gait.target.body[:3]
    for reference in (
        controller,
        gait,
        controller.gait,
        SimpleNamespace(target=controller.target),
        None,
    ):
        viewer.show(plant.state, command, reference)
        commands = seen(viewer)
        moved, visible = matrices(commands), visibility(commands)
        assert visible["reference/target"] == visible["reference/body"] == (reference is not None)
        assert visible["reference/applied"] == (reference is controller)
        if reference is not None:
            np.testing.assert_allclose(moved["reference/target"][:3, 3], of_gait)
            np.testing.assert_allclose(moved["reference/body"][:3, 3], plant.state.q[:3])
    viewer.show(plant.state, command, controller)
    np.testing.assert_allclose(
        matrices(seen(viewer))["reference/applied"][:3, 3], controller.telemetry()["x_w"][:3]
    )


def test_a_configuration_is_drawn_without_forces(
    robot: hp.Robot, viewer: Viewer, draw_state: Any
) -> None:
    q, _ = draw_state(np.random.default_rng(3))
    viewer.show(*moment(make_run(robot, 5), 3))
    viewer.display(q)
    commands = seen(viewer)
    moved, visible = matrices(commands), visibility(commands)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    for joint in range(1, robot.model.njoints):
        np.testing.assert_allclose(
            moved[f"robot/{robot.model.names[joint]}"], data.oMi[joint].homogeneous, atol=1e-12
        )
    kinds = ("contact_force", "thrust", "friction_cone", "reference", "pressure")
    assert not any(
        visible[path] for path in visible if path.split("/")[0] in kinds and path.count("/") <= 1
    )


def test_the_newest_state_comes_at_most_thirty_times_a_second(
    robot: hp.Robot, viewer: Viewer
) -> None:
    run, shown = make_run(robot, 1000), 0

    def next_moment() -> None:
        nonlocal shown
        for _ in range(20):
            viewer.show(*moment(run, shown % 1000))
            shown += 1

    next_moment()  # what stood here before is no frame of this run
    begin = time.perf_counter()
    frames = messages(viewer, 31, next_moment)
    assert (
        time.perf_counter() - begin > 0.9 * 29 / 30.0
    )  # from the second frame to the last one, or longer
    assert shown > 2 * len(frames)
    for frame in frames[1:]:  # each is of one moment, whole and once
        paths = [(command["type"], command["path"]) for command in frame]
        assert len(set(paths)) == len(paths)
        moved = matrices(frame)
        gap = moved["reference/target"][:3, 3] - moved["robot/root_joint"][:3, 3]
        np.testing.assert_allclose(gap, 0.01, atol=1e-9)


def test_a_page_that_nobody_looks_at_gets_the_newest_state_later(
    robot: hp.Robot, viewer: Viewer
) -> None:
    run = make_run(robot, 400)
    messages(viewer, 1)  # a browser that came and went
    for row in range(400):
        viewer.show(*moment(run, row))
    np.testing.assert_allclose(
        matrices(seen(viewer))["robot/root_joint"][:3, 3], run["q"][399, :3], atol=1e-12
    )


def test_a_browser_that_reads_late_holds_up_no_other_and_catches_up(
    robot: hp.Robot, viewer: Viewer
) -> None:
    run, shown = make_run(robot, 1000), 0

    def next_moment() -> None:
        nonlocal shown
        viewer.show(*moment(run, shown % 1000))
        shown += 1

    with SlowBrowser(viewer) as slow:
        assert len(messages(viewer, 10, next_moment)) == 10
        final = seen(viewer)
        found = slow.read_until_quiet()
    assert len(found) < 10
    assert len(found[0]) > 100  # the scene
    newest = {path: matrix for commands in found for path, matrix in matrices(commands).items()}
    for path, matrix in matrices(final).items():
        np.testing.assert_array_equal(newest[path], matrix)


def test_the_ground_goes_along(robot: hp.Robot, viewer: Viewer) -> None:
    """The body stays in the picture's middle, and the lines of the ground stay below it, at their
    places.
    """
    q = make_run(robot, 2)["q"][0].copy()
    for place in ((0.0, 0.0), (123.26, -45.13), (1e4, 0.0)):
        q[:2] = place
        viewer.display(q)
        moved = {
            c["path"]: np.reshape(c["matrix"], (4, 4)).T
            for c in seen(viewer)
            if c["type"] == "set_transform"
        }
        assert np.linalg.norm(moved[ROOT][:2, 3] + place) < 1.0
        lines = moved[f"{ROOT}/ground/coarse"][:2, 3]
        assert np.abs(lines - place).max() < 1.5
        np.testing.assert_allclose(lines / 0.5, np.round(lines / 0.5), atol=1e-9)


def of_another_robot(state: hp.State) -> hp.State:
    return hp.State(0.0, np.append(state.q, 0.0), np.append(state.v, 0.0), *np.zeros((3, 2, 3)))


def with_(state: hp.State, name: str, value: Any) -> hp.State:
    changed = state.copy()
    setattr(changed, name, value)
    return changed


HOSTILE = {
    "q of another robot": lambda v, s, u: v.show(of_another_robot(s), u),
    "three feet": lambda v, s, u: v.show(with_(s, "foot_force", np.zeros((3, 3))), u),
    "NaN in q": lambda v, s, u: v.show(with_(s, "q", s.q * np.nan), u),
    "infinite force": lambda v, s, u: v.show(with_(s, "foot_force", s.foot_force + np.inf), u),
    "huge velocity": lambda v, s, u: v.show(with_(s, "foot_velocity", s.foot_velocity + 1e30), u),
    "time of NaN": lambda v, s, u: v.show(with_(s, "t", np.nan), u),
    "no quaternion": lambda v, s, u: v.show(with_(s, "q", 0.0 * s.q), u),
    "no state": lambda v, s, u: v.show(None),
    "no command": lambda v, s, u: v.show(s, 3.0),
    "one thrust": lambda v, s, u: v.show(s, hp.Command(u.torque, u.thrust[:1])),
    "NaN in a thrust": lambda v, s, u: v.show(s, hp.Command(u.torque, u.thrust * np.nan)),
    "a gait at no time": lambda v, s, u: v.show(with_(s, "t", np.nan), u, hp.make_gait(v.robot)),
    "a target without a body": lambda v, s, u: v.show(s, u, SimpleNamespace(target=3)),
    "no reference": lambda v, s, u: v.show(s, u, "target"),
    "telemetry of words": lambda v, s, u: v.show(
        s, u, SimpleNamespace(telemetry=lambda: {"x_r": "here"})
    ),
    "telemetry of one number": lambda v, s, u: v.show(
        s, u, SimpleNamespace(telemetry=lambda: {"x_r": 1.0})
    ),
    "a short q": lambda v, s, u: v.display(np.zeros(3)),
    "a q of NaN": lambda v, s, u: v.display(np.full(13, np.nan)),
    "a q of zeros": lambda v, s, u: v.display(np.zeros(13)),
    "a q of words": lambda v, s, u: v.display("standing"),
    "no path": lambda v, s, u: v.save(5),
}


@pytest.mark.parametrize("attack", HOSTILE.values(), ids=HOSTILE)
def test_what_cannot_be_drawn_is_refused_where_it_is_given(
    robot: hp.Robot, viewer: Viewer, attack: Any
) -> None:
    run = make_run(robot, 60)
    state, command, _ = moment(run, 50)
    viewer.show(state, command)
    with pytest.raises(InputError):
        attack(viewer, state, command)
    moved = matrices(seen(viewer))
    np.testing.assert_allclose(moved["robot/root_joint"][:3, 3], run["q"][50, :3], atol=1e-12)


def test_a_scene_as_a_file(robot: hp.Robot, viewer: Viewer, tmp_path: Path) -> None:
    """It is the newest state's, though nobody looks, and asks the network for nothing."""
    q = make_run(robot, 2)["q"][0].copy()
    q[:3] = 0.1, 0.2, 0.7
    viewer.display(q)
    path = viewer.save(tmp_path / "scene.html")
    text = path.read_text()
    packed = re.findall(r'fetch\("data:application/octet-binary;base64,([^"]*)"\)', text)
    commands = [umsgpack.unpackb(base64.b64decode(data)) for data in packed]
    np.testing.assert_allclose(matrices(commands)["robot/root_joint"][:3, 3], q[:3])
    assert drawn(commands) == drawn(seen(viewer))
    assert not re.search(r'(src|href)="', text.partition("<script>")[0])
    with pytest.raises(RunFileError):
        viewer.save(tmp_path / "missing" / "scene.html")


def test_objects_of_ones_own(robot: hp.Robot, viewer: Viewer) -> None:
    from meshcat.geometry import Sphere

    viewer.meshcat["goal"].set_object(Sphere(0.1))
    viewer.meshcat["goal"].set_transform(np.diag([1.0, 1.0, 1.0, 1.0]))
    assert "goal" in drawn(seen(viewer))
    viewer.meshcat["goal"].delete()
    assert "goal" not in drawn(seen(viewer))


def test_in_a_notebook_the_viewer_is_its_page(viewer: Viewer) -> None:
    assert f'src="{viewer.url}"' in viewer._repr_html_()


def test_only_this_machine_is_answered(viewer: Viewer) -> None:
    asked = urllib.request.Request(viewer.url, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(asked)
    assert b"main.min.js" in urllib.request.urlopen(viewer.url).read()
    assert len(urllib.request.urlopen(f"{viewer.url}main.min.js").read()) > 100_000


def test_several_at_once_and_ports(robot: hp.Robot, viewer: Viewer) -> None:
    port = int(viewer.url.split(":")[2].split("/")[0])
    with pytest.raises(RunFileError, match=str(port)):
        Viewer(robot, port=port)
    for wrong in (-1, 70_000, 1.5, "http"):
        with pytest.raises(InputError, match="port"):
            Viewer(robot, port=wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="q must have shape"):
        Viewer(robot, q=np.zeros(4))
    with socket.create_server(("127.0.0.1", 0)) as free:
        chosen = free.getsockname()[1]
    with Viewer(robot, port=chosen) as other:
        assert f":{chosen}/" in other.url
        q = make_run(robot, 2)["q"][0].copy()
        for number, each in enumerate((viewer, other)):
            q[0] = number
            each.display(q)
        places = [matrices(seen(each))["robot/root_joint"][0, 3] for each in (viewer, other)]
        np.testing.assert_allclose(places, [0.0, 1.0])
        assert not any(
            "friction_cone" in path for path in drawn(seen(other))
        )  # of unknown friction


def ended(number: int) -> bool:
    """Whether a process ends, within a minute."""
    for _ in range(600):
        try:
            state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return True
        if state == "Z":
            return True
        time.sleep(0.1)
    return False


def test_after_its_end_and_without_its_process_it_draws_nothing_and_does_no_harm(
    robot: hp.Robot,
) -> None:
    run = make_run(robot, 3)
    for end in (Viewer.close, lambda viewer: os.kill(viewer._process.pid, signal.SIGKILL)):
        viewer = Viewer(robot)
        end(viewer)
        viewer._process.wait(10.0)
        viewer.show(*moment(run, 2))
        viewer.display(run["q"][0])
        with pytest.raises(HarpyError, match="closed"):
            viewer.static_html()
        with pytest.raises(OSError):
            urllib.request.urlopen(viewer.url)
        viewer.close()


def test_a_page_that_does_not_start_is_said(
    robot: hp.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer_module, "PROGRAM", "harpy_pin.view.viewer.missing")
    with pytest.raises(HarpyError, match="did not start"):
        Viewer(robot)


LOOP = """
import time, harpy_pin as hp
from harpy_pin.view import Viewer
viewer = Viewer(hp.load_harpy())
print(viewer._process.pid, flush=True)
while True:
    time.sleep(0.01)
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_page_ends_with_the_program(how: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", LOOP], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as program:
        assert program.stdout is not None
        assert b"view of harpy" in program.stdout.readline()
        page = int(program.stdout.readline())
        program.send_signal(how)
        program.wait(60.0)
        assert ended(page)


def test_a_moment_that_is_being_written_is_not_read(robot: hp.Robot) -> None:
    kind = moment_type(robot)
    with tempfile.TemporaryFile() as file:
        file.truncate(Slot.size(kind))
        writer, reader = Slot(file.fileno(), kind), Slot(file.fileno(), kind)
        moment = np.zeros(1, kind)
        for number in range(1, 4):
            moment["q"] = number
            writer.write(moment.view(np.float64))
            read = reader.read(0)
            assert read is not None
            np.testing.assert_array_equal(read[0], moment)
            assert reader.read(read[1]) is None
        writer._count[0] += 1
        assert reader.read(0) is None


def test_a_page_in_a_browser(browser: Any, robot: hp.Robot, viewer: Viewer) -> None:
    """What is shown moves there, nothing is complained about, and nothing comes from elsewhere."""
    page = browser.new_page(viewport={"width": 390, "height": 844}, is_mobile=True)
    page.set_default_timeout(90e3)
    said: list[str] = []
    asked: list[str] = []
    page.on(
        "console", lambda message: said.append(message.text) if message.type == "error" else None
    )
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    run = make_run(robot, 500)
    viewer.show(*moment(run, 0))
    page.goto(viewer.url)
    for row in (100, 400):
        viewer.show(*moment(run, row))
        place = run["q"][row, :3].tolist()
        body = (
            'viewer.scene_tree.find(["meshcat", "walk", "robot", '
            '"root_joint"]).object.position.toArray()'
        )
        page.wait_for_function(f"{body}.every((value, k) => Math.abs(value - {place}[k]) < 1e-9)")
    assert page.evaluate("viewer.camera.zoom") < 1.0  # a narrow window shows all of the robot
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.evaluate('document.getElementById("ended").textContent') == ""
    assert said == []
    assert all(url.startswith(viewer.url.removesuffix("static/")) for url in asked)
    page.close()
