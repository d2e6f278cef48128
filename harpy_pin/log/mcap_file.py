"""A run as an MCAP file: the container that Foxglove, PlotJuggler and ROS 2 read. ``pip install 'harpy-pin[mcap]'``.

Every signal is a topic of its name, with a JSON message for each row: ``{"FL_foot": {"x": …, "y": …, "z": …}, …}`` for
forces of feet, ``{"values": […]}`` for plain vectors, ``{"value": …}`` for numbers. The body's pose is on ``/tf``, as
``foxglove.FrameTransform``. Times of messages are those of the run, from zero.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.files import replacing
from harpy_pin.log.table import column_names

if TYPE_CHECKING:
    from harpy_pin.log.run import Run

__all__ = ["write_mcap"]

NUMBER = {"type": ["number", "null"]}
VECTOR = {"type": "object", "properties": {"x": NUMBER, "y": NUMBER, "z": NUMBER}}
TRANSFORM = {
    "type": "object",
    "title": "foxglove.FrameTransform",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "parent_frame_id": {"type": "string"},
        "child_frame_id": {"type": "string"},
        "translation": {**VECTOR, "title": "foxglove.Vector3"},
        "rotation": {
            "type": "object",
            "title": "foxglove.Quaternion",
            "properties": {"x": NUMBER, "y": NUMBER, "z": NUMBER, "w": NUMBER},
        },
    },
}


def write_mcap(run: Run, path: str | Path, *, every: int = 1) -> None:
    """What :meth:`harpy_pin.log.run.Run.to_mcap` does, with the same arguments and errors."""
    path, step = checks.path("path", path), checks.whole("every", every, low=1)
    try:
        from mcap.writer import Writer
    except ImportError as error:
        message = f"the package mcap cannot be imported ({error}): pip install 'harpy-pin[mcap]'"
        raise InputError(message, name="mcap") from error
    topics = [_Topic(run, name) for name in run.signals if name != "t"]
    times = np.round(1e9 * (np.asarray(run["t"]) - (run["t"][0] if len(run) else 0.0))).astype(np.int64).tolist()
    with replacing(path) as file:
        writer: Any = Writer(file)
        writer.start(profile="", library="harpy_pin")
        channels = [_register(writer, f"/{topic.name}", topic.name, topic.schema) for topic in topics]
        tf = _register(writer, "/tf", "foxglove.FrameTransform", TRANSFORM)
        for row in range(0, len(run), step):
            time = times[row]
            for channel, topic in zip(channels, topics, strict=True):
                _add(writer, channel, time, row, topic.message(row))
            _add(writer, tf, time, row, _transform(np.asarray(run["q"][row]), time))
        writer.finish()


class _Topic:
    """Schema and messages of one signal.

    Args:
        run: of the signal.
        name: of the signal.
    """

    def __init__(self, run: Run, name: str) -> None:
        self.name = name
        self._values = np.asarray(run[name]).reshape(len(run), -1)
        self._paths = [path.split("/") for path in column_names(run, name)]
        self._plain = all(len(path) == 1 and path[0].isdigit() for path in self._paths)
        self._single = run[name].ndim == 1
        self.schema: dict[str, Any] = {"type": "object", "properties": self._properties()}

    def _properties(self) -> dict[str, Any]:
        if self._single:
            return {"value": NUMBER}
        if self._plain:
            return {"values": {"type": "array", "items": NUMBER}}
        properties: dict[str, Any] = {}
        for path in self._paths:
            level = properties
            for part in path[:-1]:
                level = level.setdefault(part, {"type": "object", "properties": {}})["properties"]
            level[path[-1]] = NUMBER
        return properties

    def message(self, row: int) -> dict[str, Any]:
        """The message of a row; numbers that are not finite, which JSON lacks, are null."""
        values = [value if math.isfinite(value) else None for value in self._values[row].tolist()]
        if self._single:
            return {"value": values[0]}
        if self._plain:
            return {"values": values}
        content: dict[str, Any] = {}
        for path, value in zip(self._paths, values, strict=True):
            level = content
            for part in path[:-1]:
                level = level.setdefault(part, {})
            level[path[-1]] = value
        return content


def _register(writer: Any, topic: str, name: str, schema: dict[str, Any]) -> int:
    """A channel for messages of a schema."""
    number = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return int(writer.register_channel(topic=topic, message_encoding="json", schema_id=number))


def _add(writer: Any, channel: int, time: int, row: int, content: dict[str, Any]) -> None:
    data = json.dumps(content, separators=(",", ":")).encode()
    writer.add_message(channel_id=channel, log_time=time, publish_time=time, sequence=row, data=data)


def _transform(q: Any, time: int) -> dict[str, Any]:
    """The body's pose in the world."""
    numbers = [value if math.isfinite(value) else 0.0 for value in q[:7].tolist()]
    return {
        "timestamp": {"sec": time // 10**9, "nsec": time % 10**9},
        "parent_frame_id": "world",
        "child_frame_id": "body",
        "translation": dict(zip("xyz", numbers[:3], strict=True)),
        "rotation": dict(zip("xyzw", numbers[3:], strict=True)),
    }
