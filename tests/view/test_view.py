"""View: scene mathematics, the page without a browser, the page in one, figures and errors."""

import base64
import re
import urllib.request
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pages import commands_of, content_of, make_run

import harpy_pin as hp
from harpy_pin.errors import InputError, RunFileError
from harpy_pin.log.run import Run
from harpy_pin.model.loading import load_harpy, load_robot
from harpy_pin.model.robot import Robot
from harpy_pin.view import figures_of, replay_html, show, write_html
from harpy_pin.view.scene.forces import Arrow, Cone, Scales, nice_scale
from harpy_pin.view.scene.frames import Contacts, Frames, sample_rows
from harpy_pin.view.scene.nodes import Mesh, Motions, turn_z_to
from harpy_pin.view.scene.robot_nodes import find_pantograph
from harpy_pin.view.scene.scene import follow, scene_of
from harpy_pin.view.scene.visuals import load_visuals

FPS = 30.0


def motions_of(run: Run, robot: Robot, *, fps: float = FPS) -> Motions:
    """How the nodes of the scene move, by path."""
    return scene_of(Frames(run, robot, fps=fps)).motions


def turn(quaternion: np.ndarray) -> np.ndarray:
    return np.asarray(pin.Quaternion(np.asarray(quaternion, dtype=float)).toRotationMatrix())


def test_turn_z_to_every_direction() -> None:
    rng = np.random.default_rng(1)
    directions = np.vstack(
        (rng.normal(size=(50, 3)), [[0, 0, 1], [0, 0, -1], [1e-12, 0, -1], [1, 0, 0]])
    )
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for direction, quaternion in zip(directions, turn_z_to(directions), strict=True):
        np.testing.assert_allclose(turn(quaternion) @ [0.0, 0.0, 1.0], direction, atol=1e-9)


def test_arrow_points_along_the_force_and_is_as_long() -> None:
    rng = np.random.default_rng(2)
    origin, force = rng.normal(size=(40, 3)), 30.0 * rng.normal(size=(40, 3))
    arrow = Arrow("arrow", "#000000", radius=0.008, metres_per_newton=0.01)
    moved = arrow.motions(origin, force)
    whole, shaft, head = moved["arrow"], moved["arrow/shaft"], moved["arrow/head"]
    for k in range(40):
        # Tip: where the head's node puts the point (0, 0, head) of the head's shape.
        local = head.position[k] + head.scale[k] * [0.0, 0.0, arrow.head]
        tip = whole.position[k] + turn(whole.quaternion[k]) @ local
        np.testing.assert_allclose(tip, origin[k] + 0.01 * force[k], atol=1e-12)
        if shaft.visible[k]:
            np.testing.assert_allclose(shaft.scale[k, 2], head.position[k, 2])


def test_arrow_of_no_force_is_hidden_and_finite() -> None:
    arrow = Arrow("arrow", "#000000", radius=0.008, metres_per_newton=0.01)
    moved = arrow.motions(np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0, 0, 1e-9]]))
    assert not moved["arrow"].visible.any()
    for array in (moved["arrow"].quaternion, moved["arrow/shaft"].scale, moved["arrow/head"].scale):
        assert np.isfinite(array).all()
        assert np.all(np.linalg.norm(array, axis=1) > 0.0)


def drawn_rim(cone: Cone, mu: float) -> np.ndarray:
    """(n, 3) upper corners of a cone as it is drawn on ground with a friction; its apex is at the
    origin.
    """
    side = next(node.shape for node in cone.nodes if node.path == "cone/sticking/side")
    assert isinstance(side, Mesh)
    corners = side.vertices[side.faces]
    np.testing.assert_array_equal(corners[:, 0], 0.0)
    one = np.zeros((1, 3))
    return (
        corners[:, 1:].reshape(-1, 3)
        * cone.motions(Contacts(one, one, one, np.array([mu])), None)["cone/sticking/side"].scale
    )


@pytest.mark.parametrize("mu", [0.05, 0.25, 0.8, 3.0])
def test_cone_has_its_apex_at_the_foot_and_half_angle_atan_mu(mu: float) -> None:
    rim = drawn_rim(Cone("cone", slant=0.2), mu)
    angle = np.arccos(rim[:, 2] / np.linalg.norm(rim, axis=1))
    np.testing.assert_allclose(angle, np.arctan(mu), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), 0.2)


def test_pyramid_is_the_box_of_forces_per_axis() -> None:
    rim = drawn_rim(Cone("cone", slant=0.2, per_axis=True), 0.5)
    np.testing.assert_allclose(np.abs(rim[:, :2]), 0.5 * rim[:, 2:] * np.ones((1, 2)))
    assert len(np.unique(np.sign(rim[:, :2]), axis=0)) == 4


def test_pantograph_closes_at_the_foot(robot: Robot) -> None:
    run = make_run(robot)
    frames = Frames(run, robot, fps=FPS)
    data = robot.model.createData()
    for k, foot in enumerate(robot.feet):
        leg = find_pantograph(robot, foot)
        assert leg is not None
        assert (leg.thigh, leg.shin) == pytest.approx((0.3, 0.2))
        end = leg.ankle(frames.joints) - leg.shin * frames.joints[:, leg.thigh_joint, :3, 2]
        np.testing.assert_allclose(end, frames["foot_position"][:, k], atol=1e-9)
        bars = np.linalg.norm(leg.ankle(frames.joints) - leg.motor(frames.joints), axis=1)
        np.testing.assert_allclose(bars, leg.shin, atol=1e-12)
        # Parallel to the serial shank, whose knee Pinocchio places on its own.
        for row in range(0, len(frames), 7):
            pin.forwardKinematics(robot.model, data, frames["q"][row])
            knee = data.oMi[leg.shank_joint].translation
            shin = leg.ankle(frames.joints)[row] - leg.motor(frames.joints)[row]
            np.testing.assert_allclose(shin, frames["foot_position"][row, k] - knee, atol=1e-9)


def test_rows_of_a_frame_clock() -> None:
    t = 0.001 * np.arange(1001)
    rows = sample_rows(t, 30.0)
    assert len(rows) == 31
    assert np.abs(t[rows] - np.arange(31) / 30.0).max() < 0.00051
    np.testing.assert_array_equal(sample_rows(np.arange(5) * 0.1, 30.0), np.arange(5))
    np.testing.assert_array_equal(sample_rows(np.zeros(1), 30.0), [0])
    assert sample_rows(t, 7.0)[-1] == 1000


def test_camera_path_is_the_line_of_a_straight_walk(robot: Robot) -> None:
    frames = Frames(make_run(robot, 2001), robot, fps=FPS)
    path = follow(frames)
    np.testing.assert_allclose(path[:, 0], frames["q"][:, 0], atol=1e-3)
    assert np.ptp(path[:, 1]) < np.ptp(frames["q"][:, 1])


@pytest.mark.parametrize(
    ("given", "desired"), [(119.0, 100.0), (100.0, 100.0), (7.0, 5.0), (0.0, 100.0), (0.3, 0.2)]
)
def test_nice_scale(given: float, desired: float) -> None:
    assert nice_scale(given) == pytest.approx(desired)


@pytest.fixture(scope="module")
def run(robot: Robot) -> Run:
    return make_run(robot)


@pytest.fixture(scope="module")
def page(run: Run, robot: Robot) -> str:
    return replay_html([(run, robot)], fps=FPS)


def test_page_says_what_it_shows(page: str) -> None:
    title = re.search(r"<title>(.*)</title>", page)
    assert title is not None
    assert "harpy" in title.group(1)
    assert "0.25" in title.group(1)
    content = str(content_of(page))
    for text in (
        "contact force",
        "friction cone",
        "thrust",
        "target x",
        "applied x",
        "0.3 m/s",
        "completed",
    ):
        assert text in content
    assert "{{" not in page.split("<script>")[0]


def test_scene_has_its_objects_and_frames(page: str, robot: Robot) -> None:
    objects = {c["path"] for c in commands_of(page) if c["type"] == "set_object"}
    for desired in ("ground/plane", "reference/target", "reference/applied"):
        assert f"/meshcat/walk/{desired}" in objects
    for foot in robot.feet:
        assert f"/meshcat/walk/contact_force/{foot}/shaft" in objects
        assert f"/meshcat/walk/friction_cone/{foot}/sticking/side" in objects
        assert f"/meshcat/walk/lower_leg/{foot}/tarsus/bar" in objects
    for thruster in robot.thrusters:
        assert f"/meshcat/walk/thrust/{thruster}/head" in objects
    visuals = pin.buildGeomFromUrdf(robot.model, str(robot.urdf), pin.GeometryType.VISUAL)
    assert sum(path.startswith("/meshcat/walk/robot/") for path in objects) == len(
        visuals.geometryObjects
    )


def test_page_holds_the_keyframes_of_the_scene(page: str, run: Run, robot: Robot) -> None:
    packed = content_of(page)["runs"][0]
    np.testing.assert_allclose(packed["time"], Frames(run, robot, fps=FPS).time, atol=1e-6)
    held = {(track["path"], track["name"]): track for track in packed["tracks"]}
    for path, motion in motions_of(run, robot).items():
        for name in ("position", "quaternion", "scale", "visible"):
            exact = getattr(motion, name)
            if exact is None:
                continue
            track = held.pop((f"/meshcat/walk/{path}".rstrip("/"), name))
            exact = exact.astype(np.float32).reshape(31, -1)
            values = np.frombuffer(base64.b64decode(track["values"]), np.float32).reshape(
                -1, exact.shape[1]
            )
            assert len(values) == (1 if track["still"] else 31)
            np.testing.assert_array_equal(values + np.zeros_like(exact), exact)
    assert not held


def test_links_move_as_pinocchio_says(run: Run, robot: Robot) -> None:
    motions, data = motions_of(run, robot), robot.model.createData()
    rows = sample_rows(run["t"], FPS)
    for j, name in enumerate(robot.model.names):
        link = motions[f"robot/{name}"]
        for frame, row in enumerate(rows):
            pin.forwardKinematics(robot.model, data, run["q"][row])
            np.testing.assert_allclose(link.position[frame], data.oMi[j].translation, atol=1e-12)
            np.testing.assert_allclose(
                turn(link.quaternion[frame]), data.oMi[j].rotation, atol=1e-9
            )


def test_forces_in_the_scene_are_those_of_the_run(run: Run, robot: Robot) -> None:
    motions = motions_of(run, robot)
    rows = sample_rows(run["t"], FPS)
    scale = Scales.of(robot, 0.6).force
    for k, foot in enumerate(robot.feet):
        arrow, force = motions[f"contact_force/{foot}"], run["foot_force"][rows, k]
        np.testing.assert_array_equal(arrow.visible, force[:, 2] > 0.0)
        np.testing.assert_allclose(arrow.position, run["foot_position"][rows, k])
        length = motions[f"contact_force/{foot}/head"].position[:, 2]
        head = 2.0 * 0.009 * 0.6 * 3.2
        shown = arrow.visible
        np.testing.assert_allclose(
            length[shown] + head, np.linalg.norm(force[shown], axis=1) / scale
        )
        cone = motions[f"friction_cone/{foot}"]
        np.testing.assert_array_equal(cone.visible, force[:, 2] > 0.0)
        np.testing.assert_allclose(cone.position, run["foot_position"][rows, k])


def test_cone_turns_red_while_the_foot_slides(run: Run, robot: Robot) -> None:
    velocity = np.zeros_like(run["foot_velocity"])
    velocity[500:, :, 0] = 0.05
    motions = motions_of(make_run(robot, foot_velocity=velocity), robot)
    path = f"friction_cone/{robot.feet[0]}"
    red, blue = (motions[f"{path}/{name}"].visible for name in ("sliding", "sticking"))
    rows = sample_rows(run["t"], FPS)
    np.testing.assert_array_equal(red, (rows >= 500) & (run["foot_force"][rows, 0, 2] > 0.0))
    np.testing.assert_array_equal(red, ~blue)
    assert red.any()


def test_per_axis_ground_draws_a_pyramid(robot: Robot) -> None:
    run = make_run(robot, 50, metadata={"ground": {"mu_s": 0.25, "cone": "per_axis"}})
    nodes = scene_of(Frames(run, robot)).nodes
    (side,) = (
        node for node in nodes if node.path == f"friction_cone/{robot.feet[0]}/sticking/side"
    )
    assert isinstance(side.shape, Mesh)
    assert len(side.shape.faces) == 4


def test_signals_and_metadata_that_are_missing_are_left_out(robot: Robot) -> None:
    bare = make_run(robot, 50, x_r=None, x_w=None)
    bare.metadata.clear()
    text = replay_html([(bare, robot)])
    paths = {c["path"] for c in commands_of(text) if c["type"] == "set_object"}
    assert not any("friction_cone" in path or "reference" in path for path in paths)
    assert "applied x" not in str(content_of(text))
    assert all(figure.axes for figure in figures_of(bare, robot).values())


def test_reference_that_is_not_known_is_hidden(robot: Robot) -> None:
    reference = np.zeros((1001, 6))
    reference[:500] = np.nan
    visible = motions_of(make_run(robot, x_r=reference), robot)["reference/target"].visible
    assert visible[[0, -1]].tolist() == [False, True]


def test_one_row_is_a_still_picture(robot: Robot) -> None:
    text = replay_html([(make_run(robot, 1), robot)])
    assert content_of(text)["runs"][0]["tracks"] == []


def test_divergence_is_cut_where_the_numbers_end(robot: Robot) -> None:
    run = make_run(robot, metadata={"ending": "diverged"})
    run["q"][700:, 9], run["foot_force"][650:] = np.nan, np.inf
    frames = Frames(run, robot, fps=FPS)
    assert frames.time[-1] == pytest.approx(0.649)
    assert "diverged" in replay_html([(run, robot)])
    assert len(figures_of(run, robot)["feet"].axes[0].lines[0].get_xdata()) == 650
    run["q"][:] = np.nan
    with pytest.raises(InputError, match="no finite row"):
        replay_html([(run, robot)])


@pytest.mark.parametrize("factor", [1e8, 1e-8, 0.0])
def test_rows_without_a_rotation_are_not_drawn(robot: Robot, factor: float) -> None:
    run = make_run(robot)
    run["q"][700:, 3:7] *= factor
    assert Frames(run, robot, fps=FPS).time[-1] == pytest.approx(0.699)
    replay_html([(run, robot)])


def test_empty_run(robot: Robot) -> None:
    for empty in (Run({}, {"ending": "interrupted"}), make_run(robot, 3, metadata={})):
        if empty.signals:
            empty = Run({name: array[:0] for name, array in empty.signals.items()}, empty.metadata)
        for use in (lambda r: replay_html([(r, robot)]), lambda r: figures_of(r, robot)):
            with pytest.raises(InputError, match="no tick"):
                use(empty)


def test_run_of_another_robot(robot: Robot, run: Run) -> None:
    one_foot = load_robot(robot.urdf, feet=("left_foot",))
    with pytest.raises(InputError, match="foot_position has rows of shape"):
        replay_html([(run, one_foot)])
    swapped = load_robot(robot.urdf, feet=robot.feet[::-1], thrusters=robot.thrusters)
    with pytest.raises(InputError, match="logged with feet"):
        replay_html([(run, swapped)])
    with pytest.raises(InputError, match="q has rows of shape"):
        replay_html([(Run(run.signals | {"q": run["q"][:, :-1]}, run.metadata), robot)])


@pytest.mark.parametrize("fps", [0.0, -1.0, np.nan])
def test_frame_rate_must_be_positive(run: Run, robot: Robot, fps: float) -> None:
    with pytest.raises(InputError, match="fps"):
        replay_html([(run, robot)], fps=fps)


def test_robot_without_thrusters_or_visuals(tmp_path: Path, robot: Robot) -> None:
    text = re.sub(
        r"<visual>.*?</visual>", "", robot.urdf.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    (tmp_path / "bare.urdf").write_text(text, encoding="utf-8")
    bare = load_robot(tmp_path / "bare.urdf", feet=robot.feet)
    run = make_run(bare, 50)
    paths = {
        c["path"] for c in commands_of(replay_html([(run, bare)])) if c["type"] == "set_object"
    }
    assert any("/robot/left_knee/rod_" in path for path in paths)
    assert not any("/thrust/" in path for path in paths)


STUB = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12345\n"


@pytest.mark.parametrize("name", ["package://nowhere/body.stl", "stub.stl"])
def test_an_unreadable_mesh_costs_that_mesh_and_is_named(
    tmp_path: Path, robot: Robot, name: str
) -> None:
    """Where no other shape is left a skeleton is drawn."""
    (tmp_path / "stub.stl").write_text(STUB)
    text = robot.urdf.read_text(encoding="utf-8").replace(
        '<box size="0.13 0.1 0.18"/>', f'<mesh filename="{name}"/>'
    )
    (tmp_path / "mesh.urdf").write_text(text, encoding="utf-8")
    other = load_harpy(tmp_path / "mesh.urdf")
    with pytest.warns(
        UserWarning, match=rf"mesh.urdf' without meshes that cannot be read: '.*{name}'; meshes are"
    ):
        assert len(load_visuals(other)) == len(load_visuals(robot)) - 1
    box = re.sub(r"<(box|cylinder|sphere) [^>]*/>", f'<mesh filename="{name}"/>', text)
    (tmp_path / "mesh.urdf").write_text(box, encoding="utf-8")
    with pytest.warns(UserWarning, match="; drawing a skeleton"):
        assert "rod_" in str(commands_of(replay_html([(make_run(other, 5), other)])))


def test_meshes_of_a_package_are_found_by_its_name(tmp_path: Path, robot: Robot) -> None:
    """The folder of a package need not have its name."""
    (tmp_path / "checkout" / "urdf").mkdir(parents=True)
    (tmp_path / "checkout" / "package.xml").write_text("<package><name>my_dog</name></package>")
    corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.2 0\nv 0 0 0.3\n"
    (tmp_path / "checkout" / "body.obj").write_text(
        corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    mesh = '<mesh filename="package://my_dog/body.obj"/>'
    text = robot.urdf.read_text(encoding="utf-8").replace('<box size="0.13 0.1 0.18"/>', mesh)
    (tmp_path / "checkout" / "urdf" / "robot.urdf").write_text(text, encoding="utf-8")
    shapes = load_visuals(load_harpy(tmp_path / "checkout" / "urdf" / "robot.urdf"))
    assert len(shapes) == len(load_visuals(robot))
    assert [Path(shape.meshPath).name for shape in shapes if "." in shape.meshPath] == ["body.obj"]


def test_capsules_are_drawn(
    tmp_path: Path, robot: Robot, capfd: pytest.CaptureFixture[str]
) -> None:
    capsule = '<capsule radius="0.05" length="0.2"/>'
    text = robot.urdf.read_text(encoding="utf-8").replace('<box size="0.13 0.1 0.18"/>', capsule)
    (tmp_path / "capsule.urdf").write_text(text, encoding="utf-8")
    (drawn,) = [
        shape
        for shape in load_visuals(load_harpy(tmp_path / "capsule.urdf"))
        if shape.name == "base_0"
    ]
    assert (drawn.geometry.radius, drawn.geometry.halfLength) == (0.05, pytest.approx(0.15))
    assert capfd.readouterr() == ("", "")


def test_mesh_is_drawn_in_its_place(tmp_path: Path, robot: Robot) -> None:
    corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.2 0\nv 0 0 0.3\n"
    (tmp_path / "body.obj").write_text(
        corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8"
    )
    mesh = '<mesh filename="body.obj" scale="2 2 2"/>'
    text = robot.urdf.read_text(encoding="utf-8").replace('<box size="0.13 0.1 0.18"/>', mesh)
    (tmp_path / "mesh.urdf").write_text(text, encoding="utf-8")
    other = load_harpy(tmp_path / "mesh.urdf")
    commands = commands_of(replay_html([(make_run(other, 5), other)]))
    (drawn,) = (c for c in commands if c["type"] == "set_object" and c["path"].endswith("0_base_0"))
    points = np.frombuffer(
        drawn["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].data, np.float32
    )
    np.testing.assert_allclose(points.reshape(-1, 3).max(axis=0), [0.2, 0.4, 0.6], rtol=1e-6)


def test_write_html_checks_the_file_first(tmp_path: Path, run: Run, robot: Robot) -> None:
    with pytest.raises(RunFileError, match="no folder"):
        write_html([(run, robot)], tmp_path / "nowhere" / "walk.html")
    with pytest.raises(RunFileError, match="is a folder"):
        write_html([(run, robot)], tmp_path)
    path = write_html([(run, robot)], tmp_path / "walk.html")
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert [p.name for p in tmp_path.iterdir()] == ["walk.html"]


def test_show_serves_the_page(run: Run, robot: Robot, capsys: pytest.CaptureFixture[str]) -> None:
    with show([(run, robot)], open_browser=False) as server:
        assert server.url in capsys.readouterr().out
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(server.url, timeout=10) as answer:
            assert b"MeshCat" in answer.read()
        with pytest.raises(RunFileError, match="cannot serve"):
            show(
                [(run, robot)],
                open_browser=False,
                port=int(server.url.rstrip("/").rsplit(":", 1)[1]),
            )


def test_figures_show_the_charts_of_the_page(tmp_path: Path, run: Run, robot: Robot) -> None:
    figures, charts = (
        figures_of(run, robot),
        content_of(replay_html([(run, robot)]))["charts"]["charts"],
    )
    assert {
        name: len([axes for axes in figure.axes if axes.axison]) for name, figure in figures.items()
    } == {
        name: sum(chart["group"].lower() == name for chart in charts)
        for name in ("feet", "body", "effort")
    }
    for figure in figures.values():
        assert all(axes.get_ylabel() for axes in figure.axes if axes.axison)
        figure.savefig(tmp_path / "figure.png", dpi=40)
    left = next(
        axes
        for axes in figures["feet"].axes
        if axes.get_title(loc="right") == "friction force, left foot"
    )
    band = left.collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(0.25 * 39.0)


def test_a_driven_walk_shows_what_was_given_and_applied() -> None:
    script = ((0.05, 3.0, 0.0, 0.5),)
    walked = hp.walk(
        hp.Scenario(controller="condensed", gait=hp.Commanded(velocity=script), duration=0.3)
    )
    figure = figures_of(walked)["command"]
    assert [axes.get_title(loc="right") for axes in figure.axes] == ["forward", "left", "turning"]
    given, applied = figure.axes[0].lines
    np.testing.assert_array_equal(given.get_ydata(), walked["command"][:, 0])
    np.testing.assert_array_equal(applied.get_ydata(), walked["applied_velocity"][:, 0])
    assert given.get_ydata()[-1] == 3.0
    assert 0.0 < applied.get_ydata()[-1] < 0.2


def test_a_robot_that_flies_stays_in_the_picture(run: Run, robot: Robot) -> None:
    """The picture is as much higher as the robot rises, about a point at the same share of its
    height.
    """
    lifted = Run({name: run[name].copy() for name in run.signals}, dict(run.metadata))
    lifted["q"][len(run) // 2 :, 2] += 0.4
    low, high = (motions_of(one, robot)[""].position[0, 2] for one in (run, lifted))
    rise = (lifted["q"][:, 2] - run["q"][0, 2]).max()
    assert high - low == pytest.approx(-0.32 * rise, abs=0.01)
