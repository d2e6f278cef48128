"""What surrounds the robot: ground, light, background and camera.

The camera follows the walk: all that belongs to the world hangs under one node that slides the other way, so that
the robot stays in front of a camera that stands still. This needs no script, so it works in a live viewer and in a
file alike, and turning the view with the mouse turns it about the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from meshcat import geometry as g

from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain import Terrain
from harpy_pin.view.palette import as_int, ground_colour
from harpy_pin.view.scene.command_recorder import set_exactly
from harpy_pin.view.scene.frames import Frames

__all__ = ["draw_friction_strips", "draw_ground", "follow", "frame_camera", "light"]

FINE, COARSE = 0.1, 0.5
"""Distance between thin and between strong lines of the ground's grid, m."""
MARGIN = 2.5
"""How far the grid reaches beyond the walk, m."""
WINDOW = 1.5
"""Time over which the camera's path is averaged, s: two steps of the gait."""
FIELD_OF_VIEW = 32.0
"""Of the camera, vertical, degrees."""
LARGEST = 30.0
"""Largest half-width of the grid, m, for runs that flew away."""


def follow(frames: Frames, surface: Terrain | None = None) -> Vector:
    """Where the camera looks: the body's path on the ground, without its sway.

    Args:
        frames: the motion.
        surface: of the ground, where it is not flat.

    Returns:
        (n, 3) world, m, at the height of the ground, averaged over the same time.
    """
    path = np.zeros((len(frames), 3))
    half = min(round(0.5 * WINDOW * frames.fps), len(frames) - 1)
    lines = [frames.q[:, 0], frames.q[:, 1]]
    if surface is not None:
        lines.append(surface.height(lines[0].copy(), lines[1].copy()))
    for axis, line in enumerate(lines):
        # Continued straight on at both ends, so that the camera starts and stops with the body in the middle.
        before = 2.0 * line[0] - line[half:0:-1]
        after = 2.0 * line[-1] - line[-2 : -half - 2 : -1]
        padded = np.concatenate((before, line, after))
        path[:, axis] = np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    return path


def draw_ground(node: Any, path: Vector, *, colour: str = "#f1f4f8") -> None:
    """Add the ground z = 0, with a line every 0.1 m and a stronger one every 0.5 m.

    Args:
        node: a Meshcat visualizer at the ground's path; its parent's frame is the world's.
        path: (n, 3) points that the grid has to reach, world, m.
        colour: ``#rrggbb``.
    """
    low = np.clip(np.floor(path[:, :2].min(axis=0) - MARGIN), -LARGEST, LARGEST)
    high = np.clip(np.ceil(path[:, :2].max(axis=0) + MARGIN), -LARGEST, LARGEST)
    # An even colour whatever the light, and a second plane that shows nothing but shadows.
    node["plane"].set_object(g.Box([400.0, 400.0, 0.02]), g.MeshBasicMaterial(color=as_int(colour)))
    node["plane"].set_property("position", [0.0, 0.0, -0.0135])
    shadow = g.MeshBasicMaterial(color=0x22304A, opacity=0.28, transparent=True)
    shadow._type = "ShadowMaterial"
    node["shadow"].set_object(g.Box([400.0, 400.0, 0.001]), shadow)
    node["shadow"].set_property("position", [0.0, 0.0, -0.001])
    for name in ("plane", "shadow"):
        set_exactly(node[name]["<object>"], "castShadow", False)
    for name, step, shade, height in (("fine", FINE, 0xDCE2EA, 0.0), ("coarse", COARSE, 0xB4BFCC, 0.0003)):
        lines = g.PointsGeometry(_grid(low, high, step, height).T.astype(np.float32))
        node[name].set_object(g.LineSegments(lines, g.LineBasicMaterial(color=shade)))
        set_exactly(node[name]["<object>"], "castShadow", False)


def draw_friction_strips(node: Any, friction_strips: Sequence[Sequence[float]]) -> None:
    """Add strips of ground across x in the colours of their friction, below the lines of the grid.

    Args:
        node: a Meshcat visualizer at the strips' path; its parent's frame is the world's.
        friction_strips: (from x, to x, friction) of each, m.
    """
    for number, (begin, end, mu) in enumerate(friction_strips):
        strip = node[str(number + 1)]
        strip.set_object(g.Box([end - begin, 400.0, 0.001]), g.MeshBasicMaterial(color=as_int(ground_colour(mu))))
        strip.set_property("position", [0.5 * (begin + end), 0.0, -0.0020])
        set_exactly(strip["<object>"], "castShadow", False)


def _grid(low: Vector, high: Vector, step: float, height: float) -> Vector:
    """(2 segments, 3) ends of a grid's segments; short ones, as some renderers lose lines that pass the camera."""
    points = []
    for axis in range(2):
        lines = np.arange(low[axis], high[axis] + 0.5 * step, step)
        cuts = np.linspace(low[1 - axis], high[1 - axis], 2 + int(high[1 - axis] - low[1 - axis]))
        block = np.full((len(lines), len(cuts) - 1, 2, 3), height)
        block[..., axis] = lines[:, None, None]
        block[..., 0, 1 - axis], block[..., 1, 1 - axis] = cuts[:-1], cuts[1:]
        points.append(block.reshape(-1, 3))
    return np.concatenate(points)


def light(visualizer: Any) -> None:
    """Bright background, soft light all round, and one lamp that casts the robot's shadow."""
    visualizer["/Grid"].set_property("visible", False)
    visualizer["/Axes"].set_property("visible", False)
    visualizer["/Background"].set_property("top_color", [0.80, 0.87, 0.95])
    visualizer["/Background"].set_property("bottom_color", [0.97, 0.98, 0.99])
    visualizer["/Lights/AmbientLight/<object>"].set_property("intensity", 0.62)
    visualizer["/Lights/FillLight/<object>"].set_property("intensity", 0.18)
    for name in ("PointLightNegativeX", "PointLightPositiveX"):
        visualizer[f"/Lights/{name}"].set_property("visible", False)
    lamp = visualizer["/Lights/SpotLight"]
    lamp.set_property("visible", True)
    lamp["<object>"].set_property("position", [1.2, -2.2, 5.0])
    lamp["<object>"].set_property("intensity", 0.55)
    lamp["<object>"].set_property("angle", 0.5)
    lamp["<object>"].set_property("penumbra", 1.0)
    set_exactly(lamp["<object>"], "castShadow", True)


def frame_camera(visualizer: Any, *, size: float) -> None:
    """Three-quarter view from the robot's right front, of the point that :func:`follow` keeps in the middle.

    Args:
        visualizer: the Meshcat visualizer.
        size: height that has to fit in the picture, m.
    """
    distance = 0.5 * size / np.tan(0.5 * np.radians(FIELD_OF_VIEW))
    x, y, z = distance * np.array([0.62, -0.74, 0.26]) / np.linalg.norm([0.62, -0.74, 0.26])
    camera = visualizer["/Cameras/default/rotated/<object>"]
    camera.set_property("fov", FIELD_OF_VIEW)
    # Meshcat's camera has its own axes: y up, z towards the world's −y.
    camera.set_property("position", [float(x), float(z), float(-y)])
