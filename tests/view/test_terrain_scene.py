"""Replays on ground that is not flat: the surface, the cones about its normals, and the friction that is told."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin.view.page.charts import charts_of
from harpy_pin.view.page.shown import Shown
from harpy_pin.view.scene.command_recorder import CommandRecorder
from harpy_pin.view.scene.drawn_cones import friction_used
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.scene import draw_scene
from harpy_pin.view.scene.surface import about_normals, surface_of

PLANE = hp.Plane(slope=0.3, heading=0.4)


@pytest.fixture(scope="module")
def run() -> hp.Run:
    return hp.walk(hp.Scenario(ground=hp.Ground(mu_s=0.6, terrain=PLANE), duration=0.5))


def test_the_surface_is_that_of_the_run(run):
    assert surface_of(run) == PLANE
    assert surface_of(hp.walk(hp.Scenario(duration=0.01))) is None


def test_vectors_about_the_normal(run):
    rng = np.random.default_rng(0)
    place, vector = rng.normal(size=(5, 2, 3)), rng.normal(size=(5, 2, 3))
    frame = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), PLANE.normal(0.0, 0.0)).matrix()
    np.testing.assert_allclose(about_normals(PLANE, place, vector), vector @ frame, atol=1e-12)
    assert about_normals(None, place, vector) is vector


def test_cones_stand_on_the_surface(run):
    robot = hp.load_harpy()
    animation = draw_scene(CommandRecorder().visualizer, run, robot, Frames.from_run(run, robot, fps=30.0))
    turned = 0
    for clip in animation.lower():
        for track in clip["clip"]["tracks"]:
            if "friction_cone" in clip["path"] and track["name"].lstrip(".") == "quaternion":
                turned += 1
                for key in track["keys"]:
                    up = pin.Quaternion(np.array(key["value"], dtype=float)).matrix() @ (0.0, 0.0, 1.0)
                    np.testing.assert_allclose(up, PLANE.normal(0.0, 0.0), atol=1e-9)
    assert turned == len(robot.feet)


def test_what_is_told_of_friction_is_about_the_normal(run):
    """The condensed controller keeps three quarters of the friction; about the vertical it would be far more."""
    force = run["foot_force"][100:]
    own = friction_used(about_normals(PLANE, run["foot_position"][100:], force), np.full(force.shape[:2], 0.6))
    assert np.median(own[own > 0.0]) < 0.8
    robot = hp.load_harpy()
    charts = charts_of(Shown("walk", "#123456", run, robot, Frames.from_run(run, robot, fps=30.0), True))
    margin = next(chart for chart in charts if "friction margin" in chart.title)
    values = np.concatenate([np.asarray(line.values, dtype=float) for line in margin.lines])
    assert np.nanmin(values) > -1e-6
