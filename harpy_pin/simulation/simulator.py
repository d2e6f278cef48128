"""The full robot on compliant ground: time steps that are implicit in the contact.

A step finds the velocity v⁺ at its end together with the contact forces
(:func:`~harpy_pin.simulation.step.implicit_step`), then moves q by v⁺.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.ground.ground import Ground
from harpy_pin.kernels.calls import Call
from harpy_pin.kernels.record_view import read_only
from harpy_pin.log.recorder import Recorder
from harpy_pin.model.record import Records
from harpy_pin.model.state import Command, State
from harpy_pin.simulation.actuators import motors_of, take_law
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.push import Push, push_forces
from harpy_pin.simulation.step import MISFIT_COMMAND, StepRecord, physics_steps, step_record
from harpy_pin.simulation.ticks import CompiledLoop, lasting_signals

NO_PUSH = read_only(np.zeros((64, 3)))
"""Forces of physics steps in which nobody pushes; for more steps than these an array is made."""


class Simulator(Plant):
    """This library's own plant. It has no state before :meth:`reset` gives it one.

    Args:
        robot: what to simulate.
        ground: contact parameters.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s²; tilt it to stand on a slope.
        actuators: motors, joint friction and thrusters; those of the model by default.

    Attributes:
        sweeps: of the contact solver in the last step; Newton's steps where feet are flat.
        record: what the kernel of a step reads and works in.
        actuators: as given.

    Raises:
        InputError: dt is not positive, or gravity is not a finite 3-vector.
    """

    name = "compliant"
    sweeps = 0

    def _make_record(self) -> Records[StepRecord]:
        robot, actuators = self.robot, self.actuators
        passive = self.dynamics._record_["tree"]["loops"][0]
        return step_record(
            robot.sizes,
            dt=self.dt,
            actuators=actuators,
            motors=motors_of(robot),
            friction=np.append(actuators.coulomb(robot), passive["dry"]),
            robot=robot,
        )

    def _prepare(self) -> None:
        arrays = (self.q, self.v, self._noted_torque, self._noted_thrust, NO_PUSH)
        physics_steps.prepare(self.dynamics._record_, self._ground, self._record_, *arrays)
        super()._prepare()

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.reset`."""
        super().reset(q, v, t=t)
        self._record_["joints"]["torque"] = 0.0

    @checked
    def change_ground(self, ground: Ground) -> None:
        """Another ground from the next step on; the robot stays where it is.

        A ground that becomes stiffer at once throws a foot that stands in it.

        Args:
            ground: from the next step on.
        """
        self.ground = ground
        self._ground[:] = ground.record

    def advance(self, command: Command, pushes: Sequence[Push] = (), *, steps: int = 1) -> None:
        """See :meth:`harpy_pin.simulation.plant.Plant.advance`."""
        if not self._placed:
            self._check_placed()
        if type(steps) is not int or not 0 <= steps <= checks.MAX_TICKS:
            steps = checks.whole("steps", steps, high=checks.MAX_TICKS)
        if self.attached and steps > 1:
            for _ in range(steps):
                self.advance(command, pushes)
            return
        quiet = isinstance(pushes, tuple | list) and not pushes and steps <= len(NO_PUSH)
        push = NO_PUSH[:steps] if quiet else push_forces(pushes, self.t, self.dt, steps)
        plant = (self.dynamics._record_, self._ground, self._record_, self._q_, self._v_)
        self._take_law(command)
        try:
            sweeps = physics_steps(*plant, command._torque_, command._thrust_, push)
        except (AttributeError, TypeError):
            sweeps = MISFIT_COMMAND
        if sweeps == MISFIT_COMMAND:
            command = self.checked(command)
            sweeps = physics_steps(*plant, command._torque_, command._thrust_, push)
        self.sweeps = sweeps
        self.t += steps * self.dt
        for part in self.attached:
            part.after_step(self)

    def compile_loop(
        self, controller: Any, recorder: Recorder, **rules: Any
    ) -> CompiledLoop | None:
        """See :meth:`harpy_pin.simulation.plant.Plant.compile_loop`."""
        own = vars(self).keys() & {"advance", "log"}  # with a clock around them
        if own or self.attached or type(self) is not Simulator or not hasattr(controller, "calls"):
            return None
        d = self.dynamics
        state = State(0.0, self.q, self.v, d.foot_position, d.foot_velocity, self._foot_force)
        calls: Sequence[Call] | None = controller.calls(state)
        if calls is None:
            return None
        torque, thrust, *law = controller.command
        logged, before_row = {**self.signals, "torque": torque, "thrust": thrust}, self.log_calls
        if law:
            logged |= self._law_signals
            before_row = (Call(take_law, self._record_["motors"], *law, expected=True), *before_row)
        signals, again = ({**logged, **controller.telemetry()} for _ in "12")
        if not lasting_signals(signals, again, recorder):
            return None
        return CompiledLoop(self, calls, before_row, (torque, thrust), signals, recorder, **rules)
