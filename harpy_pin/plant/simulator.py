"""The full robot on compliant ground: time steps that are implicit in the contact, closed loops, their log.

A step finds the velocity v⁺ at its end together with the contact forces (:func:`~harpy_pin.plant.step.implicit_step`),
then moves q by v⁺.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.compiling import seal
from harpy_pin.model.dynamics import Dynamics, update_terms
from harpy_pin.model.entry import all_finite, all_finite_rows, as_command
from harpy_pin.model.integrate import integrate
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.plant.controller import Controller
from harpy_pin.plant.ground import Ground
from harpy_pin.plant.loop import run_closed_loop
from harpy_pin.plant.push import Push
from harpy_pin.plant.recorder import Recorder
from harpy_pin.plant.run import Run
from harpy_pin.plant.sensors import Sensors
from harpy_pin.plant.slip import forget_slip, note_slip
from harpy_pin.plant.step import MAX_SWEEPS, implicit_step, step_record

__all__ = ["GRAVITY", "Simulator"]

GRAVITY = 9.81
"""Standard magnitude used throughout, m/s² (equations.md §3)."""
MOST_STEPS = 64
"""Physics steps in one control tick for which no array is made."""
MISFIT_COMMAND = -1
STATE_ARRAYS = 5
"""Of a state; they come first in a row of the log."""


class Simulator:
    """A robot, a ground and a time step. It has no state before :meth:`reset` gives it one.

    Args:
        robot: what to simulate.
        ground: contact parameters.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s²; tilt it to stand on a slope.

    Raises:
        InputError: dt is not positive, gravity is not a finite 3-vector, or the robot has no feet.
    """

    def __init__(
        self, robot: Robot, ground: Ground | None = None, *, dt: float = 5e-4, gravity: ArrayLike = (0.0, 0.0, -GRAVITY)
    ) -> None:
        if not robot.feet:
            raise InputError("the simulator needs a robot with at least one foot", name="robot")
        self.robot = robot
        self.ground = ground if ground is not None else Ground()
        self.dt = checks.number("dt", dt, low=1e-6)
        self.gravity = checks.vector("gravity", gravity, 3)
        self.dynamics = Dynamics(robot, gravity=self.gravity)
        model = self.dynamics.model
        feet, nv = len(robot.feet), model.nv
        self._ground = self.ground.record
        self._step = step_record(nv=nv, feet=feet, dt=self.dt)
        self._foot_force = field(self._step, "force").reshape(-1, 3)
        self._no_push = np.zeros((MOST_STEPS, 3))
        self._shapes = ((len(robot.joints),), (len(robot.thrusters), 3))
        self.sweeps = 0
        """Gauss–Seidel sweeps of the last step."""
        slip = self._step["slip"]
        self.slip_path: Vector = field(slip, "path")
        """(feet,) see :mod:`harpy_pin.plant.slip`, m."""
        self.slip_net: Vector = field(slip, "net")
        """(feet,) likewise."""
        self.counts: NDArray[np.int64] = field(self._step, "counts")
        """Most sweeps in a step, and steps in which they ran out, since the beginning of the last run."""
        self.reset(pin.neutral(model), np.zeros(nv))
        self._placed = False
        torque, thrust = np.zeros(self._shapes[0]), np.zeros(self._shapes[1])
        seal(_advance, self.dynamics.record, self._ground, self._step, self.q, self.v, torque, thrust, self._no_push)

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """Put the robot in a state; contact forces start at zero.

        Args:
            q: (nq,) configuration (the quaternion is normalised).
            v: (nv,) generalised velocity.
            t: time, s.

        Raises:
            InputError: wrong shapes or entries that are not finite.
        """
        model = self.dynamics.model
        self.q: Vector = configuration(model, q)
        self.v = checks.vector("v", v, model.nv)
        self.t = checks.number("t", t)
        self._foot_force[:] = 0.0
        self.dynamics.update(self.q, self.v)
        _forget_slip(self._step, self.dynamics.foot_position)
        self._placed = True

    @property
    def state(self) -> State:
        """The present state (a copy); the contact forces are those of the last step.

        Raises:
            InputError: before the first :meth:`reset`.
        """
        self._check_placed()
        d = self.dynamics
        return State(
            self.t,
            self.q.copy(),
            self.v.copy(),
            d.foot_position.copy(),
            d.foot_velocity.copy(),
            self._foot_force.copy(),
        )

    @property
    def static_sink(self) -> float:
        """Penetration of the feet at rest under equal shares of the load normal to the ground, m."""
        load = self.robot.mass * max(-float(self.gravity[2]), 0.0)
        return load / (len(self.robot.feet) * self.ground.stiffness)

    def advance(self, command: Command, pushes: Sequence[Push] = (), *, steps: int = 1) -> None:
        """Physics steps of length dt under a constant command.

        Args:
            command: torques and thrusts.
            pushes: forces on the body; those of another time do nothing.
            steps: how many.

        Raises:
            InputError: before the first :meth:`reset`, or the command's arrays have the wrong shape or are not finite
                numbers.
        """
        if not self._placed:
            self._check_placed()
        push = self._push_forces(pushes, steps) if pushes or steps > len(self._no_push) else self._no_push[:steps]
        try:
            torque, thrust = command.torque, command.thrust
            sweeps = _advance(self.dynamics.record, self._ground, self._step, self.q, self.v, torque, thrust, push)
        except (AttributeError, TypeError):
            sweeps = MISFIT_COMMAND
        if sweeps == MISFIT_COMMAND:
            command = as_command(command, self.robot)
            torque = checks.vector("command.torque", command.torque, self._shapes[0])
            thrust = checks.vector("command.thrust", command.thrust, self._shapes[1])
            sweeps = _advance(self.dynamics.record, self._ground, self._step, self.q, self.v, torque, thrust, push)
        self.sweeps = sweeps
        self.t += steps * self.dt

    def run(
        self,
        controller: Controller,
        duration: float,
        *,
        control_period: float | None = None,
        metadata: Mapping[str, object] | None = None,
        on_tick: Callable[[State], None] | None = None,
        pushes: Sequence[Push] = (),
        sensors: Sensors | None = None,
        save: str | Path | None = None,
    ) -> Run:
        """Run a controller in closed loop and log every tick.

        The command is held between ticks. A fall (body below 60 % of its starting height or tilted by more than
        60°) or a divergence ends the run; what was logged is kept and :attr:`Run.ending` says why. Ctrl-C raises
        :class:`~harpy_pin.errors.Interrupted`, which holds the log so far: a loop over many runs ends with it.

        With ``save`` the log is on disk while the run goes on: every second of simulated time (every 1000 ticks if
        that is sooner) is added to ``<save>.part``, which :meth:`Run.load` reads should the process die. At the end the
        whole log takes its place, also if the robot fell, the controller failed, or Ctrl-C was pressed; the next Ctrl-C
        waits until it is written. The arrays of a log of more than 256 MB lie in the file, not in memory.

        Args:
            controller: anything with ``step(state) -> Command``.
            duration: simulated time, s.
            control_period: time between ticks, s, a multiple of dt; the controller's ``period`` (1 ms if it has
                none) by default.
            metadata: more entries for the log's metadata.
            on_tick: called with the true state at each tick, before the controller (progress bars).
            pushes: forces on the body, logged in the metadata; their times are the simulator's.
            sensors: what the controller knows of the state; the true state where there are none. The log keeps the
                true state.
            save: file of the log; it may need its size twice for a moment.

        Raises:
            InputError: bad duration or period, or a push that lies outside the run.
            ControlError: the controller raised, or returned no valid command; ``error.run`` holds the log so far.
            RunFileError: the log cannot be written: found out before the run, or with the log as ``error.run``.
            Interrupted: Ctrl-C; ``error.run`` holds the log so far.
        """
        return run_closed_loop(
            self,
            controller,
            duration,
            control_period=control_period,
            metadata=metadata,
            on_tick=on_tick,
            pushes=pushes,
            sensors=sensors,
            save=save,
        )

    def log(
        self,
        recorder: Recorder,
        state: State,
        command: Command,
        elapsed: int,
        telemetry: Callable[[], Mapping[str, ArrayLike]] | None = None,
    ) -> None:
        """Append one tick to a log.

        Args:
            recorder: of the log.
            state: the true one.
            command: that it returned.
            elapsed: time it took, ns.
            telemetry: gives more signals.

        Raises:
            InputError: telemetry uses a name of the log itself or none that a signal can have, or changed its names or
                shapes.
        """
        row: dict[str, ArrayLike] = {
            "t": self.t,
            "q": state.q,
            "v": state.v,
            "foot_position": state.foot_position,
            "foot_velocity": state.foot_velocity,
            "foot_force": state.foot_force,
            "slip_path": self.slip_path,
            "slip_net": self.slip_net,
            "torque": command.torque,
            "thrust": command.thrust,
            "tick_ns": elapsed,
        }
        if telemetry is not None:
            signals = telemetry()
            if len(recorder) == 0 and row.keys() & signals.keys():
                taken = ", ".join(sorted(row.keys() & signals.keys()))
                raise InputError(f"telemetry uses names of the log itself: {taken}", name="telemetry")
            row.update(signals)
        recorder.append(row, known=STATE_ARRAYS)

    def _check_placed(self) -> None:
        if not self._placed:
            raise InputError(
                "the simulator has no state yet: call reset(q, v), such as "
                "reset(*gait.initial_state(sink=simulator.static_sink))",
                name="simulator",
            )

    def _push_forces(self, pushes: Sequence[Push], steps: int) -> Vector:
        """(steps, 3) mean force of the pushes over each of the coming steps, world axes, N."""
        force = np.zeros((steps, 3))
        for push in pushes:
            if push.time < self.t + steps * self.dt and push.time + push.duration > self.t:
                for n in range(steps):
                    begin = self.t + n * self.dt
                    force[n] += push.share(begin, begin + self.dt) / self.dt * np.array(push.impulse)
        return force


@njit(cache=True)
def _forget_slip(step, position):  # type: ignore[no-untyped-def]
    forget_slip(step[0].slip, position)


@njit(cache=True)
def _advance(dynamics, ground, step, q, v, torque, thrust, push):  # type: ignore[no-untyped-def]
    """A physics step for each row of ``push``, the force on the body's origin.

    Returns:
        Sweeps of the last contact problem; ``MISFIT_COMMAND``, with nothing done, for a command of the wrong size or
        one that is no number.
    """
    d, s = dynamics[0], step[0]
    if torque.shape[0] != v.shape[0] - 6 or 3 * thrust.shape[0] != d.thruster_jacobian.shape[0] or thrust.shape[1] != 3:
        return MISFIT_COMMAND
    if not (all_finite(torque) and all_finite_rows(thrust)):
        return MISFIT_COMMAND
    sweeps, forces = 0, thrust.reshape(-1)
    for n in range(push.shape[0]):
        for i in range(3):
            for c in range(3):
                d.bias[i] -= d.tree.rotation[c, i] * push[n, c]
        sweeps = implicit_step(dynamics, ground, step, v, torque, forces)
        s.counts[0] = max(s.counts[0], sweeps)
        s.counts[1] += sweeps > MAX_SWEEPS
        integrate(d.tree, q, s.displacement)
        update_terms(d, q, v)
        note_slip(s.slip, d.foot_position, s.force, s.dt)
    return sweeps
