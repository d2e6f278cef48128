"""The log of a loop of one's own, such as one in MuJoCo, as a run."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.log.recorder import Recorder as Rows
from harpy_pin.log.run import Run
from harpy_pin.model.entry import as_command, as_state
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State
from harpy_pin.simulation.loop import about


class Recorder:
    """Records a loop of one's own as a run, to be saved, measured and seen like any other.

    Args:
        robot: that walks.
        controller: whose signals and parameters are kept, too; it may have what a
            :class:`Controller` may have.
        ground: as far as it is known; pages show its friction and terrain.
    """

    @checked
    def __init__(
        self, robot: Robot, controller: Any = None, *, ground: Ground | None = None
    ) -> None:
        self.robot, self.controller, self.ground = robot, controller, ground
        self._rows, self._last, self._motors = Rows(), 0.0, np.zeros(len(robot.joints))

    def add(self, state: State, command: Command) -> None:
        """Record a tick.

        Args:
            state: that was measured.
            command: of the controller at that state.

        Raises:
            InputError: it is another robot's, not finite, or not after the last tick. A late one is
                kept with its time.
        """
        state, command = as_state(state, self.robot), as_command(command, self.robot)
        if len(self._rows) and not state.t > self._last:
            raise InputError(
                f"time must go on from tick to tick, got {state.t:g} s after {self._last:g} s",
                name="state.t",
                value=state.t,
            )
        row: dict[str, Any] = {entry.name: getattr(state, entry.name) for entry in fields(State)}
        row |= {"torque": command.torque, "thrust": command.thrust}
        if command.law is not None:
            row |= {"motor_law": command.law, "motor_torque": self._motors}
            limit, (q, v, k_p, k_d) = self.robot.torque_limit, command.law
            torque = command.torque + k_p * (q - state.q[7:]) + k_d * (v - state.v[6:])
            self._motors = np.clip(torque, -limit, limit)
        for name, array in row.items():
            checks.vector(name, array, np.shape(array))
        self._rows.append({**row, **getattr(self.controller, "telemetry", dict)()})
        self._last = state.t

    def run(self) -> Run:
        """What was recorded since the last call, two ticks at least; the robot fell where it lies
        at the end.
        """
        if len(self._rows) < 2:
            raise InputError("two ticks at least make a run", name="recorder")
        signals = self._rows.take()
        q, lowest = signals["q"], signals["foot_position"][:, :, 2].min(axis=1, initial=np.inf)
        high, cosine = q[:, 2] - lowest, 1.0 - 2.0 * (q[-1, 3] ** 2 + q[-1, 4] ** 2)
        ending = "fell" if high[-1] < 0.6 * high[0] or cosine < 0.5 else "completed"
        metadata = {"ending": ending, "end_time": self._last, **about(self.robot, self.controller)}
        ground = {} if self.ground is None else {"ground": self.ground.to_dict()}
        return Run(
            signals,
            {**metadata, **ground, "control_period": float(np.median(np.diff(signals["t"])))},
        )
