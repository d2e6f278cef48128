"""A viewer for a loop of one's own: the loop's thread copies numbers, and another process draws
them in Meshcat.

Drawing takes milliseconds of Python. In a thread it would hold the interpreter's lock, and the loop
would wait for it whenever it comes back from a simulator or from sleep. So the page has a process
of its own, and the loop writes into a slot of memory that both share: nothing is sent, and nothing
is waited for.
"""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
import tempfile
import webbrowser
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import HarpyError, InputError, RunFileError, shown
from harpy_pin.files import check_writable, replacing
from harpy_pin.gaits.gait import Gait, own_target
from harpy_pin.gaits.standing import Standing
from harpy_pin.ground.ground import Ground
from harpy_pin.model.entry import as_array, as_state
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.view.scene.frames import LARGEST
from harpy_pin.view.scene.meshcat_backend import ROOT
from harpy_pin.view.viewer.moments import Slot, moment_type

PROGRAM = "harpy_pin.view.viewer.page_process"
PATIENCE = 60.0
"""Time in which the page's process answers, s: it may be drawing meshes."""
END = 5.0
"""Time that it gets to end by itself, s."""
UNIT = (0.5, 2.0)
"""Bounds of the squared length of a unit quaternion."""


class Viewer(AbstractContextManager["Viewer"]):
    """A Meshcat page of a robot that follows a loop of one's own, at most 30 times a second.

    It has the habits of Pinocchio's ``MeshcatVisualizer``: :meth:`display` draws a configuration.
    :meth:`show` draws a state with contact forces, friction cones, thrusts and references: the
    scene of a replay. Both return at once; what they are given is checked and copied, and the
    newest is drawn by a process of its own, while a browser looks.

    The page ends with :meth:`close`, with its ``with`` block, or with the program, however that
    ends. In a notebook the viewer as the value of a cell is the page. It is for one thread.

    Args:
        robot: that is drawn.
        ground: as far as it is known: its friction gives the cones, its terrain is drawn within
            some metres of the origin. Level ground without cones by default.
        q: (nq,) configuration that is shown first, from which sizes are taken; by default the robot
            stands.
        open: open the page in the default browser.
        port: to serve the page on, on this machine; any free one by default.

    Attributes:
        robot: as given.
        url: address of the page.

    Raises:
        InputError: a configuration that is not the robot's, or no port has that number.
        RunFileError: the port is taken, or may not be used.
        HarpyError: the page's process did not start; what it said is on the terminal.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        *,
        ground: Ground | None = None,
        q: ArrayLike | None = None,
        open: bool = False,
        port: int = 0,
    ) -> None:
        checks.whole("port", port, high=65535)
        self.robot, kind = robot, moment_type(robot)
        self._moment = np.zeros(1, kind)
        self._views = {name: self._moment[name][0] for name in kind.names or () if name != "t"}
        self._numbers = self._moment.view(np.float64)
        self._measured = self._numbers[: kind.fields["x_r"][1] // 8]  # type: ignore[index]
        self._quaternion = self._views["q"][3:7]
        # a gait of the clock alone, which controllers and the viewer follow by copies
        self._followed: Any = None
        self._set_configuration(_standing(robot) if q is None else q)
        with _listen(port) as listener, tempfile.TemporaryFile() as file:
            self.url = f"http://127.0.0.1:{listener.getsockname()[1]}/static/"
            file.truncate(Slot.size(kind))
            self._slot = Slot(file.fileno(), kind)
            self._slot.write(self._numbers)
            self._process = _start(file.fileno(), listener.fileno())
        try:
            described = {} if ground is None else ground.to_dict()
            pickle.dump((robot, described, self._moment), self._process.stdin)
            self._process.stdin.flush()
            self._address = self._process.stdout.readline().decode().strip()
        except OSError:
            self._address = ""
        except BaseException:
            self.close()
            raise
        if not self._address:
            self.close()
            raise HarpyError("the viewer's page did not start: its process ended")
        print(f"view of {robot.name}: {self.url}", flush=True)
        if open:
            webbrowser.open(self.url)

    def display(self, q: ArrayLike) -> None:
        """Draw a configuration, without forces and references.

        Args:
            q: (nq,) configuration, in Pinocchio's order (see
                :class:`~harpy_pin.model.state.State`).

        Raises:
            InputError: another size, not finite, or no unit quaternion.
        """
        self._set_configuration(q)
        self._slot.write(self._numbers)

    def show(self, state: State, command: Command | None = None, reference: Any = None) -> None:
        """Draw a state with the ground's forces on the feet, the thrusts of a command, and
        references.

        What it costs is a row of ``python -m comparison rates``.

        Args:
            state: that was measured.
            command: of the controller at that state, whose thrusts are drawn.
            reference: whose target is drawn: a controller of this library, with its applied
                reference where it has one; a gait; or any object with a
                :class:`~harpy_pin.gaits.gait.GaitTarget` as ``target``.

        Raises:
            InputError: of another robot, not finite, no unit quaternion, or a reference without a
                target.
        """
        state, views = as_state(state, self.robot), self._views
        thrust = getattr(command, "thrust", None)
        target, applied = self._places(reference, state.t)
        self._numbers[0] = state.t
        views["q"][:] = state.q
        views["foot_position"][:] = state.foot_position
        views["foot_velocity"][:] = state.foot_velocity
        views["foot_force"][:] = state.foot_force
        views["thrust"][:] = (
            0.0 if command is None else as_array("command.thrust", thrust, views["thrust"].shape)
        )
        views["x_r"][:] = target
        views["x_w"][:] = applied
        self._require_possible()
        self._slot.write(self._numbers)

    def static_html(self) -> str:
        """The present scene as HTML text that needs nothing else.

        Raises:
            HarpyError: the viewer is closed, or its process does not answer.
        """
        import zmq

        if self._process.poll() is not None:
            raise HarpyError("the viewer's page is closed: there is no scene")
        client: Any = zmq.Context.instance().socket(zmq.REQ)
        with client:
            client.linger, client.rcvtimeo = 0, int(1e3 * PATIENCE)
            client.connect(self._address)
            client.send(b"get_scene")
            try:
                text: str = client.recv().decode()
            except zmq.Again:
                raise HarpyError("the viewer's page does not answer") from None
        return text

    @checked
    def save(self, path: str | Path) -> Path:
        """Write :meth:`static_html` as one file.

        Args:
            path: the file, which is returned.

        Raises:
            RunFileError: the file cannot be written.
            HarpyError: as :meth:`static_html`.
        """
        target = Path(path)
        check_writable(target)
        text = self.static_html()
        with replacing(target) as file:
            file.write(text.encode())
        return target

    @property
    def meshcat(self) -> Any:
        """A ``meshcat.Visualizer`` of the page in world axes, for objects of one's own: Pinocchio's
        ``viz.viewer``.
        """
        from meshcat import Visualizer

        return Visualizer(zmq_url=self._address)[ROOT]

    def close(self) -> None:
        """End the page; what is shown later is not drawn."""
        process = self._process
        with suppress(OSError):
            process.stdin.close()  # the process ends at that
        process.stdout.close()
        try:
            process.wait(END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        style = "width: 100%; height: 480px; border: 0"
        return f'<iframe src="{escape(self.url)}" style="{style}"></iframe>'

    def _set_configuration(self, q: ArrayLike) -> None:
        """Take up a configuration, at rest in the air."""
        given = checks.vector("q", q, self.robot.nq)
        self._numbers[:] = 0.0
        self._views["q"][:] = given
        for name in ("x_r", "x_w"):
            self._views[name][:] = np.nan
        self._require_possible()

    def _places(self, reference: Any, t: float) -> tuple[Vector | float, Vector | float]:
        """Where the body should be, and the applied reference, (3,) each; NaN for none."""
        if reference is None:
            return np.nan, np.nan
        signals: Mapping[str, Any] = getattr(reference, "telemetry", dict)()
        if "x_r" in signals:
            applied = signals.get("x_w")
            return _place("x_r", signals["x_r"]), np.nan if applied is None else _place(
                "x_w", applied
            )
        if isinstance(reference, Gait) and reference.constant:
            if self._followed is not reference:
                self._followed, self._gait = reference, own_target(reference)
            return self._gait.update(t).body[:3], np.nan
        target = getattr(reference, "target", reference)
        return _place("target", getattr(target, "body", None)), np.nan

    def _require_possible(self) -> None:
        """Refuse numbers that cannot be drawn."""
        if not self._measured @ self._measured < LARGEST**2:
            possible = {
                name: np.abs(self._moment[name]) < LARGEST for name in ("t", *self._views)[:-2]
            }
            name = next((name for name, each in possible.items() if not each.all()), "t")
            raise InputError(
                f"{name} must be finite, got {shown(self._moment[name][0].tolist())}", name=name
            )
        unit = self._quaternion
        if not UNIT[0] <= unit @ unit <= UNIT[1]:
            raise InputError(
                f"q must have a unit quaternion, got {shown(unit.tolist())}",
                name="q",
                value=unit.copy(),
            )


def _place(of: str, value: Any) -> Vector:
    """The first three numbers of a reference, m."""
    if (
        not isinstance(value, np.ndarray)
        or value.dtype != np.float64
        or value.ndim != 1
        or len(value) < 3
    ):
        raise InputError(
            f"the reference's {of} must be an array of three numbers or more, got {shown(value)}",
            name="reference",
            value=value,
        )
    return value[:3]


def _standing(robot: Robot) -> Vector:
    """(nq,) the robot as it stands; one that cannot has straight joints, and the lowest at height
    zero.
    """
    with suppress(HarpyError):
        return Standing(robot).initial_state()[0]
    model, data = robot.model, robot.model.createData()
    q = robot.reference
    pin.forwardKinematics(model, data, robot.closed(q))
    q[2] -= min(data.oMi[joint].translation[2] for joint in range(1, model.njoints))
    return np.asarray(q)


def _listen(port: int) -> socket.socket:
    """A socket of this machine."""
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise RunFileError(
            f"cannot serve the viewer on port {port}: {error.strerror or error}"
        ) from error


def _start(slot: int, listener: int) -> Any:
    """The page's process, with the modules of this one; Ctrl-C is not for it."""
    known = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(
        [sys.executable, "-m", PROGRAM, str(slot), str(listener)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=(slot, listener),
        env=known,
        start_new_session=True,
    )
