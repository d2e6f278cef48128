"""Made-up walks for the viewer, and what a replay page holds."""

import base64
import json
import re
import zlib
from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack

from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot

ATTACKS = (
    "</script><script>attack()</script>",
    "\"'><img src=x onerror=attack()>",
    "\u2028attack()//",
    "\ud800",
    "{{meshcat}}",
)
"""Texts that would do something if a page took them as markup or as a script."""


def make_run(robot: Robot, rows: int = 1001, **changes: Any) -> Run:
    """A made-up walk: the body sways forward, the joints swing, the feet carry in turn."""
    model, data = robot.model, robot.model.createData()
    t = 0.001 * np.arange(rows)
    q = np.tile(pin.neutral(model), (rows, 1))
    q[:, 0], q[:, 1], q[:, 2] = 0.3 * t, 0.02 * np.sin(4.0 * t), 0.6
    q[:, 7:] = 0.3 * np.sin(5.0 * t[:, None] + np.arange(model.nq - 7)) + np.resize(
        [0.0, -0.6, 1.2], model.nq - 7
    )
    for row in range(rows):
        roll = 0.1 * np.sin(3.0 * t[row])
        q[row, 3:7] = (np.sin(0.5 * roll), 0.0, 0.0, np.cos(0.5 * roll))
    feet = np.zeros((rows, len(robot.feet), 3))
    for row in range(rows):
        pin.framesForwardKinematics(model, data, q[row])
        for k, name in enumerate(robot.feet):
            feet[row, k] = data.oMf[robot.frame_id(name)].translation
    force = np.zeros_like(feet)
    left = np.sin(8.0 * t) > 0.0
    for k in range(len(robot.feet)):
        carries = left if k % 2 == 0 else ~left
        force[carries, k] = (3.0, -2.0, 39.0)
    thrust = np.zeros((rows, len(robot.thrusters), 3))
    thrust += np.array([2.0, 1.0, 5.0])
    reference = np.column_stack((q[:, :3] + 0.01, np.zeros((rows, 3))))
    signals = {
        "t": t,
        "q": q,
        "v": np.zeros((rows, model.nv)),
        "foot_position": feet,
        "foot_velocity": np.zeros_like(feet),
        "foot_force": force,
        "torque": np.zeros((rows, model.nv - 6)),
        "thrust": thrust,
        "tick_ns": np.zeros(rows),
        "x_r": reference,
        "x_w": reference - 0.005,
    }
    metadata = {
        "ending": "completed",
        "ground": {"mu_s": 0.25, "cone": "circular"},
        "robot": robot.name,
        "feet": list(robot.feet),
        "thrusters": list(robot.thrusters),
        "control_period": 0.001,
        "controller": "Test",
        "parameters": {"gait": {"speed": 0.3, "step_duration": 0.75}, "governor": "none"},
    }
    metadata |= changes.pop("metadata", {})
    signals |= changes
    return Run({name: array for name, array in signals.items() if array is not None}, metadata)


def unpack(text: str) -> Any:
    """The data that a page holds in a word of base64."""
    return json.loads(zlib.decompress(base64.b64decode(text)))


def content_of(page: str) -> dict[str, Any]:
    """All that a page holds, read back from it."""
    found = re.search(r'^const PACKED = "([A-Za-z0-9+/=]*)";$', page, re.MULTILINE)
    assert found is not None
    content: dict[str, Any] = unpack(found.group(1))
    return content


def commands_of(page: str) -> list[dict[str, Any]]:
    """The scene's commands, read back from a page."""
    return [
        umsgpack.unpackb(base64.b64decode(text)) for text in content_of(page)["runs"][0]["commands"]
    ]
