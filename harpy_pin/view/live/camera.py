"""The camera of the live page, which keeps the robot in its middle.

Viser moves the camera by the same keys that drive. Whoever drives would soon see nothing of the robot, so the point
that the camera looks at is put back; the mouse still turns the view about the robot, nearer and further away.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import viser

from harpy_pin.model.state import Vector

__all__ = ["EYE", "FIELD_OF_VIEW", "MIDDLE", "first_view", "followed", "keep_in_view"]

EYE, MIDDLE = (1.2, -1.42, 0.87), (0.0, 0.0, 0.33)
"""Where the camera is, and what it looks at, m; for a robot of Harpy's size."""
FIELD_OF_VIEW = 42.0
"""Its angle, degrees."""
UPRIGHT = 0.8
"""Aspect below which a screen is upright, with the panel below."""
TOLERANCE = 0.01
"""Distance that the camera may be off, m."""
ARRIVES_WITHIN = 20
"""Moves of a new page's camera until it is where it was put."""
FARTHEST = 1e6
"""Largest coordinate of a camera, m."""
LOWEST, HIGHEST = 0.03, 1.4
"""Elevation of the camera over the robot, rad: not below the ground, and not from straight above."""


def first_view(scale: float) -> tuple[Vector, Vector]:
    """Where the camera is first and what it looks at, m, for a robot of a size relative to Harpy's."""
    return scale * np.array(EYE), scale * np.array(MIDDLE)


def keep_in_view(client: viser.ClientHandle, scale: float, follows: Callable[[], bool]) -> None:
    """Put the camera of a new page in its place, and keep the robot in its middle.

    Args:
        client: the page.
        scale: size of the robot, relative to Harpy's.
        follows: whether the camera is to follow, asked at every move.
    """
    begin, middle = first_view(scale)
    upright = client.camera.image_width < UPRIGHT * client.camera.image_height
    if upright:  # from further away, and the robot in the upper half
        begin = middle + 2.1 * (begin - middle) - scale * np.array((0.0, 0.0, 0.6))
        middle = middle - scale * np.array((0.0, 0.0, 0.75))
    tries = 0 if _is_at(client.camera, begin) else ARRIVES_WITHIN
    if upright:
        _put(client.camera, begin, middle)

    def put_back(camera: viser.CameraHandle) -> None:
        nonlocal tries
        if tries > 0:  # a slow page still reports the place where its camera was before
            there = _is_at(camera, begin)
            tries = 0 if there else tries - 1
            eye = None if there else begin
        else:
            eye = followed(camera.position, camera.look_at, middle) if follows() else None
        if eye is not None:
            with client.atomic():
                _put(camera, eye, middle)

    client.camera.on_update(put_back)


def _is_at(camera: viser.CameraHandle, eye: Vector) -> bool:
    """Whether a camera is in a place."""
    return bool(np.shape(camera.position) == (3,) and np.allclose(camera.position, eye, rtol=0.0, atol=TOLERANCE))


def _put(camera: viser.CameraHandle, eye: Vector, look_at: Vector) -> None:
    """Put a camera in a place; one without directions, whose page has sent zeros for them, stays as it is."""
    with suppress(ValueError):
        camera.position = eye
    with suppress(ValueError):
        camera.look_at = look_at


def followed(eye: Vector, look_at: Vector, middle: Vector) -> Vector | None:
    """Where a camera belongs that has been moved.

    Args:
        eye: (3,) where it is, m.
        look_at: (3,) what it looks at, m.
        middle: (3,) what it should look at, m.

    Returns:
        (3,) the place from which it looks at the middle as it has looked, over the ground; None where it is there, or
        where what the page has sent is no place. A camera at what it looks at belongs where it was first.
    """
    if not (_is_place(eye) and _is_place(look_at)):
        return None
    away = eye - look_at if np.linalg.norm(eye - look_at) > TOLERANCE else np.array(EYE) - MIDDLE
    distance = float(np.linalg.norm(away))
    flat = float(np.hypot(away[0], away[1]))
    elevation = float(np.arctan2(away[2], flat))
    elevation_kept = min(max(elevation, LOWEST), HIGHEST)
    if elevation_kept != elevation:
        forward = away[:2] / flat if flat > 1e-6 * distance else np.array([0.0, -1.0])
        away = distance * np.array([*(np.cos(elevation_kept) * forward), np.sin(elevation_kept)])
    place: Vector = middle + away
    return None if np.allclose(place, eye, rtol=0.0, atol=TOLERANCE) else place


def _is_place(point: Vector) -> bool:
    """Whether what a page has sent is a point in space."""
    return point.shape == (3,) and bool(np.all(np.abs(point) <= FARTHEST))
