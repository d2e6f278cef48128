"""The scene: meshes in their colours and places, and ground that is not flat."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.errors import install_line
from harpy_pin.view.page.charts import charts_of
from harpy_pin.view.page.shown import Shown
from harpy_pin.view.scene import meshes
from harpy_pin.view.scene.frames import Frames, about_normals, ground_of, surface_of
from harpy_pin.view.scene.meshes import mesh_parts, thin_out
from harpy_pin.view.scene.nodes import Mesh
from harpy_pin.view.scene.scene import scene_of
from harpy_pin.view.scene.visuals import load_visuals


def ball(rings):
    """A ball of one metre as triangles."""
    polar, turn = np.meshgrid(
        np.linspace(0.0, np.pi, rings), np.linspace(0.0, 2.0 * np.pi, 2 * rings), indexing="ij"
    )
    points = np.stack(
        (np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)), axis=-1
    )
    number = np.arange(points[..., 0].size).reshape(points.shape[:2])
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate(
        (np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3))
    )
    return points.reshape(-1, 3), faces


def area(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize("most", [200, 1000, 4000])
def test_a_mesh_keeps_its_shape(most):
    vertices, faces = ball(80)
    thinned = thin_out(Mesh(vertices, faces), most)
    fewer, kept = thinned.vertices, thinned.faces
    assert most // 4 < len(kept) <= most
    np.testing.assert_allclose(np.linalg.norm(fewer, axis=1), 1.0, atol=0.1)
    assert area(fewer, kept) == pytest.approx(4.0 * np.pi, rel=0.15)
    assert kept.min() >= 0
    assert kept.max() < len(fewer)
    mesh = Mesh(vertices, faces)
    assert thin_out(mesh, len(faces)) is mesh


@needs_robots
def test_a_file_of_several_colours_is_drawn_in_them():
    """Go2's URDF paints everything white; its thighs are silver and white in their file."""
    pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    thigh = next(
        s for s in load_visuals(hp.load_robot("go2")) if Path(s.meshPath).name == "thigh.dae"
    )
    parts = mesh_parts(thigh)
    colours = {colour for _, colour in parts}
    assert len(colours) == 2
    assert any(max(colour[:3]) < 0.8 for colour in colours)
    vertices = np.asarray(thigh.geometry.vertices())
    drawn = np.concatenate([mesh.vertices for mesh, _ in parts])
    np.testing.assert_allclose(drawn.min(axis=0), vertices.min(axis=0), atol=2e-3)
    np.testing.assert_allclose(drawn.max(axis=0), vertices.max(axis=0), atol=2e-3)


@needs_robots
def test_a_colour_of_the_urdf_comes_first():
    hip = next(s for s in load_visuals(hp.load_robot("a1")) if Path(s.meshPath).name == "hip.dae")
    ((mesh, colour),) = mesh_parts(hip)
    np.testing.assert_allclose(colour, hip.meshColor, atol=1e-6)
    assert len(mesh.faces) <= meshes.MAX_TRIANGLES


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "bolt", "anymal_c"])
def test_without_trimesh_all_is_drawn_as_pinocchio_reads_it(name, monkeypatch):
    shapes = [s for s in load_visuals(hp.load_robot(name)) if hasattr(s.geometry, "num_tris")][:4]
    with_it = [mesh_parts(shape) for shape in shapes]
    monkeypatch.setattr(meshes, "_read_parts", lambda path, scale: None)
    for shape, parts in zip(shapes, with_it, strict=True):
        ((mesh, colour),) = mesh_parts(shape)
        np.testing.assert_allclose(colour, np.clip(shape.meshColor, 0.0, 1.0), atol=1e-6)
        low = np.min([part.vertices.min(axis=0) for part, _ in parts], axis=0)
        np.testing.assert_allclose(mesh.vertices.min(axis=0), low, atol=5e-3)


@needs_robots
def test_without_trimesh_wrong_surfaces_are_said_once(monkeypatch):
    shapes = [s for s in load_visuals(hp.load_robot("go2")) if Path(s.meshPath).suffix == ".dae"]
    monkeypatch.setattr(meshes, "_read_parts", lambda path, scale: None)
    meshes._warn_of_wrong_surfaces.cache_clear()
    with pytest.warns(UserWarning, match=re.escape(install_line("robots"))) as said:
        parts = [mesh_parts(shape) for shape in [*shapes, *shapes]]
    assert len(parts) > 1
    assert len(said) == 1


@needs_robots
@pytest.mark.parametrize("name", ["go2", "anymal_c"])
def test_every_corner_of_a_file_of_several_parts_is_drawn(name):
    """Pinocchio numbers the corners of each part from zero, so that the corners of the last ones
    are in no triangle.
    """
    pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    for shape in load_visuals(hp.load_robot(name)):
        if not hasattr(shape.geometry, "num_tris"):
            continue
        drawn = np.concatenate(
            [mesh.vertices[np.unique(mesh.faces)] for mesh, _ in mesh_parts(shape)]
        )
        vertices = np.asarray(shape.geometry.vertices())
        np.testing.assert_allclose(drawn.min(axis=0), vertices.min(axis=0), atol=5e-3)
        np.testing.assert_allclose(drawn.max(axis=0), vertices.max(axis=0), atol=5e-3)


def test_a_run_under_a_gait_of_ones_own_is_viewed(tmp_path):
    """The example of the page on gaits, through its file."""
    from harpy_pin.view import write_html
    from harpy_pin.view.identity import robot_of

    class Slower(hp.Gait):
        def __init__(self, inner):
            super().__init__(inner.robot)
            self.inner = inner

        def update(self, t):
            return self.inner.update(0.5 * t if t < 2.0 else t - 1.0)

        def initial_state(self, *, penetration=0.0):
            return self.inner.initial_state(penetration=penetration)

    gait = Slower(hp.make_gait(hp.load_harpy()))
    run = hp.walk(hp.Scenario(controller="condensed", duration=0.1), gait=gait)
    run.save(tmp_path / "slower.npz")
    again = hp.Run.load(tmp_path / "slower.npz")
    write_html([(again, robot_of(again))], tmp_path / "slower.html")
    assert (tmp_path / "slower.html").stat().st_size > 100_000


PLANE = hp.ground.Plane(slope=0.3, heading=0.4)


@pytest.fixture(scope="module")
def run() -> hp.Run:
    return hp.walk(hp.Scenario(ground=hp.Ground(mu_s=0.9, terrain=PLANE), duration=0.5))


def test_the_surface_is_that_of_the_run(run):
    assert surface_of(ground_of(run)) == PLANE
    assert surface_of(ground_of(hp.walk(hp.Scenario(duration=0.01)))) is None


def test_vectors_about_the_normal(run):
    rng = np.random.default_rng(0)
    place, vector = rng.normal(size=(5, 2, 3)), rng.normal(size=(5, 2, 3))
    frame = pin.Quaternion.FromTwoVectors(
        np.array((0.0, 0.0, 1.0)), PLANE.normal(0.0, 0.0)
    ).matrix()
    np.testing.assert_allclose(about_normals(PLANE, place, vector), vector @ frame, atol=1e-12)
    assert about_normals(None, place, vector) is vector


def test_cones_stand_on_the_surface(robot, run):
    motions = scene_of(Frames(run, robot, fps=30.0)).motions
    for foot in robot.feet:
        for quaternion in motions[f"friction_cone/{foot}"].quaternion:
            up = pin.Quaternion(quaternion).matrix() @ (0.0, 0.0, 1.0)
            np.testing.assert_allclose(up, PLANE.normal(0.0, 0.0), atol=1e-9)


def test_what_is_told_of_friction_is_about_the_normal(robot, run):
    """The condensed controller keeps 0.4 of the friction; about the vertical it would be far
    more.
    """
    frames = Frames(run, robot, fps=30.0)
    own = frames.contacts[100:].used
    assert np.median(own[own > 0.0]) < 0.5
    charts = charts_of([Shown("walk", "#123456", frames)])
    margin = next(chart for chart in charts if "friction margin" in chart.title)
    values = np.concatenate([np.asarray(line.values, dtype=float) for line in margin.lines])
    assert np.nanmin(values) > -1e-6


@needs_robots
@pytest.mark.parametrize(
    ("name", "turned"), [("icub", True), ("borinot", False), ("hextilt", False), ("go1", False)]
)
def test_meshes_with_y_up_are_turned_where_that_fits_the_links(name, turned):
    robot = hp.load_robot(name)
    folders = [str(folder) for folder in robot.urdf.resolve().parents]
    plain = pin.buildGeomFromUrdf(
        robot.model, str(robot.urdf), pin.GeometryType.VISUAL, package_dirs=folders
    )
    for shape, read in zip(load_visuals(robot), plain.geometryObjects, strict=True):
        change = (read.placement.inverse() * shape.placement).rotation
        expected = pin.utils.rotate("x", 0.5 * np.pi) if turned else np.eye(3)
        np.testing.assert_allclose(change, expected, atol=1e-12)


@needs_robots
def test_the_shanks_of_icub_reach_from_knee_to_ankle():
    robot = hp.load_robot("icub")
    ankle = robot.model.jointPlacements[robot.model.getJointId("l_ankle_pitch")].translation
    shank = next(shape for shape in load_visuals(robot) if shape.name.startswith("l_lower_leg"))
    corners = (
        np.asarray(shank.geometry.vertices()) @ shank.placement.rotation.T
        + shank.placement.translation
    )
    along = corners @ ankle / np.linalg.norm(ankle)
    assert along.min() < 0.0
    assert along.max() == pytest.approx(np.linalg.norm(ankle), abs=0.02)
