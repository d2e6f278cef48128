"""The policy in our process: what it observes, and what its actions mean."""

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np

from comparison.peers.environment import NOT_INSTALLED, WORLDS, WorkerError, interpreter, last_line
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import import_mujoco

PERIOD = 0.02
"""Between two actions, s."""
SCALE = 0.5
"""Change of an angle's target for an action of one, rad."""
DOWN = (0.0, 0.0, -1.0)
WEIGHTS = Path("experimental", "sim2sim", "onnx", "go1_policy.onnx")


def package_in(folder: Path, name: str) -> Path:
    """Folder of a Python package in the worlds' environment, within the folder of the peers'
    environments.
    """
    for found in (folder / WORLDS.name.lower()).glob(f"[lL]ib/**/{name}"):
        return found
    raise InputError(f"'{name}' is {NOT_INSTALLED}", name="folder")


def observation(model: Any, data: Any, action: Vector, command: Vector) -> Vector:
    """(48,) what the policy was trained to see, without the noise.

    Velocity and angular velocity of the IMU and the direction of gravity, in the IMU's axes; angles
    of the joints from the first keyframe's, their velocities, the last action, and the command.

    Args:
        model: ``mujoco.MjModel``.
        data: ``mujoco.MjData``, after ``mj_forward``.
        action: (12,) the last.
        command: (3,) forward, to the left, turning, m/s and rad/s.
    """
    turned = data.site("imu").xmat.reshape(3, 3)
    body = data.sensor("local_linvel").data, data.sensor("gyro").data, turned.T @ DOWN
    joints = data.qpos[7:] - model.key_qpos[0, 7:], data.qvel[6:]
    return np.concatenate((*body, *joints, action, command)).astype(np.float32)


class Policy:
    """The network in its own process; to be used in a ``with`` statement.

    Args:
        folder: of the peers' environments.
        worker: script that evaluates it.

    Attributes:
        action: (12,) the last.
    """

    def __init__(self, folder: Path, worker: Path = WORLDS.worker) -> None:
        weights, pipe = package_in(folder, "mujoco_playground") / WEIGHTS, subprocess.PIPE
        command = [str(path) for path in (interpreter(folder, WORLDS.name), "-I", worker, weights)]
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        if not self._out.readline():
            raise WorkerError(last_line(self._process.communicate()[1].decode(errors="replace")))
        self.action = np.zeros(12)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ending: object) -> None:
        self._process.kill()
        self._process.communicate()

    def acting(self, model: Any) -> Callable[[Any, Vector], None]:
        """What sets the joints' targets in data of this model; :class:`WorkerError` where the
        process ended.
        """

        def act(data: Any, command: Vector) -> None:
            import_mujoco().mj_forward(model, data)
            self._in.write(observation(model, data, self.action, command).tobytes())
            self._in.flush()
            answer = self._out.read(4 * 12)
            if len(answer) < 4 * 12:
                raise WorkerError("the policy's process ended")
            self.action = np.frombuffer(answer, dtype=np.float32).astype(float)
            data.ctrl[:] = model.key_qpos[0, 7:] + SCALE * self.action

        return act
