"""What a page holds, packed: keyframes as 32-bit numbers, and everything together compressed to base64.

Nothing of a log stands in the page as text, so nothing of it can become markup or script.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
from meshcat.animation import Animation

from harpy_pin.model.state import Vector

__all__ = ["pack", "pack_animation", "unpack"]


def pack_animation(animation: Animation, time: Vector) -> list[dict[str, Any]]:
    """Tracks of an animation whose keys lie at the frames.

    Args:
        animation: of :func:`harpy_pin.view.scene.scene.draw_scene`.
        time: (n,) of the frames, s.

    Returns:
        For each track its path, property, kind, and (n, …) values as base64 of little-endian 32-bit floats; one that
        never changes is ``still`` and has its first row alone.
    """
    tracks = []
    for path, clip in animation.clips.items():
        for name, track in clip.tracks.items():
            values = np.asarray(track.values, dtype="<f4").reshape(len(time), -1)
            still = bool(np.all(values == values[0]))
            values = values[:1] if still else values
            data = base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
            tracks.append({"path": path.lower(), "name": name, "kind": track.jstype, "still": still, "values": data})
    return tracks


def pack(content: Any) -> str:
    """Plain data as one word of base64 (zlib over JSON)."""
    return base64.b64encode(zlib.compress(json.dumps(content, allow_nan=False).encode("ascii"), 6)).decode("ascii")


def unpack(text: str) -> Any:
    """The data of :func:`pack`."""
    return json.loads(zlib.decompress(base64.b64decode(text)))
