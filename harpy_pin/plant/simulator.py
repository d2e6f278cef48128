"""The full robot on compliant ground: time steps that are implicit in the contact, closed loops, their log.

A step finds the velocity v⁺ at its end together with the contact forces (:func:`~harpy_pin.plant.step.implicit_step`),
then moves q by v⁺.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from time import perf_counter_ns

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import ControlError, InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.plant.controller import Controller
from harpy_pin.plant.ground import Ground
from harpy_pin.plant.push import Push
from harpy_pin.plant.run import Recorder, Run, describe_versions
from harpy_pin.plant.step import MAX_SWEEPS, implicit_step, step_record

__all__ = ["GRAVITY", "Simulator"]

GRAVITY = 9.81
"""Standard magnitude used throughout, m/s² (equations.md §3)."""
FLOAT64 = np.dtype(np.float64)
_VERDICTS = ("completed", "fell", "diverged")


class Simulator:
    """A robot, a ground and a time step.

    Args:
        robot: what to simulate.
        ground: contact parameters.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s²; tilt it to stand on a slope.

    Raises:
        InputError: dt is not positive, gravity is not a finite 3-vector, or the robot has no feet.
    """

    def __init__(
        self,
        robot: Robot,
        ground: Ground | None = None,
        *,
        dt: float = 5e-4,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY),
    ) -> None:
        if not robot.feet:
            raise InputError("the simulator needs a robot with at least one foot", name="robot")
        self.robot = robot
        self.ground = ground if ground is not None else Ground()
        self.dt = checks.number("dt", dt, low=0.0, strict=True)
        self.gravity = checks.vector("gravity", gravity, 3)
        self.dynamics = Dynamics(robot, gravity=self.gravity)
        model = self.dynamics.model
        feet, nv = len(robot.feet), model.nv
        self._ground = self.ground.record
        self._step = step_record(nv=nv, feet=feet, dt=self.dt)
        self._foot_force = field(self._step, "force").reshape(-1, 3)
        self._displacement = field(self._step, "displacement")
        # Pinocchio writes into these views of the body's placement in place.
        base = self.dynamics.data.oMi[1]
        self._base_position, self._base_rotation = base.translation, base.rotation
        self._shapes = ((len(robot.joints),), (len(robot.thrusters), 3))
        self.sweeps = 0
        """Gauss–Seidel sweeps of the last step."""
        self.reset(pin.neutral(model), np.zeros(nv))

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
        self.q = configuration(model, q)
        self.v = checks.vector("v", v, model.nv)
        self.t = checks.number("t", t)
        self._foot_force[:] = 0.0
        self.dynamics.update(self.q, self.v)

    @property
    def state(self) -> State:
        """The present state (a copy); the contact forces are those of the last step."""
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

    def advance(self, command: Command, pushes: Sequence[Push] = ()) -> None:
        """One physics step of length dt under a constant command.

        A chain of :meth:`accelerate`, :meth:`move` and :meth:`evaluate`, which may be called (and timed) apart.

        Args:
            command: torques and thrusts.
            pushes: forces on the body; those of another time do nothing.
        """
        self.accelerate(command, pushes)
        self.move()
        self.evaluate()

    def accelerate(self, command: Command, pushes: Sequence[Push] = ()) -> None:
        """Contact forces and generalised velocity at the end of a step.

        Args:
            command: torques and thrusts.
            pushes: forces on the body.
        """
        bias = self.dynamics.bias
        push = self._push_force(pushes) if pushes else None
        if push is not None:
            unpushed = bias.copy()
            bias -= push
        self.sweeps = implicit_step(
            self.dynamics.record, self._ground, self._step, self.v, command.torque, command.thrust.reshape(-1)
        )
        if push is not None:
            bias[:] = unpushed

    def move(self) -> None:
        """Move the configuration by the velocity of the end of the step, and the time by dt."""
        self.q = pin.integrate(self.dynamics.model, self.q, self._displacement)
        self.t += self.dt

    def evaluate(self) -> None:
        """Terms of the equations of motion at the present configuration and velocity."""
        self.dynamics.update(self.q, self.v)

    def run(
        self,
        controller: Controller,
        duration: float,
        *,
        control_period: float | None = None,
        metadata: Mapping[str, object] | None = None,
        on_tick: Callable[[State], None] | None = None,
        pushes: Sequence[Push] = (),
    ) -> Run:
        """Run a controller in closed loop and log every tick.

        The command is held between ticks. A fall (body below 60 % of its starting height or tilted by more than
        60°), a divergence, or Ctrl-C ends the run; what was logged is kept and :attr:`Run.ending` says why.

        Args:
            controller: anything with ``step(state) -> Command``.
            duration: simulated time, s.
            control_period: time between ticks, s, a multiple of dt; the controller's ``period`` (1 ms if it has
                none) by default.
            metadata: more entries for the log's metadata.
            on_tick: called with the state at each tick, before the controller (progress bars).
            pushes: forces on the body, logged in the metadata; their times are the simulator's.

        Raises:
            InputError: bad duration or period, or a push that lies outside the run.
            ControlError: the controller raised, or returned no valid command; ``error.run`` holds the log so far.
        """
        duration = checks.number("duration", duration, low=0.0, strict=True)
        period = getattr(controller, "period", 1e-3) if control_period is None else control_period
        period = checks.number("control_period", period, low=0.0, strict=True)
        substeps = round(period / self.dt)
        if substeps < 1 or abs(substeps * self.dt - period) > 1e-9:
            raise InputError(
                f"control_period {period:g} s must be a multiple of the physics step {self.dt:g} s",
                name="control_period",
                value=period,
            )
        ticks = max(round(duration / period), 1)
        for push in pushes:
            if push.time + push.duration <= self.t or push.time >= self.t + ticks * period:
                message = (
                    f"a push at {push.time:g} s lies outside the run from {self.t:g} to {self.t + ticks * period:g} s"
                )
                raise InputError(message, name="pushes", value=push)
        telemetry = getattr(controller, "telemetry", None)
        describe = getattr(controller, "describe", None)
        recorder = Recorder()
        height = float(self._base_position[2])
        fall_height = 0.6 * height if height > 0.0 else -math.inf
        start, ending, worst_sweeps, unconverged = self.t, "completed", 0, 0
        failure: BaseException | None = None
        try:
            for tick in range(ticks):
                self.t = start + tick * period
                state = self.state
                try:
                    if on_tick is not None:
                        on_tick(state)
                    begin = perf_counter_ns()
                    command = controller.step(state)
                    elapsed = perf_counter_ns() - begin
                    command = self._checked(command)
                    self.log(recorder, state, command, elapsed, telemetry)
                except Exception as error:
                    ending, failure = f"controller failed: {error}", error
                    break
                for _ in range(substeps):
                    self.advance(command, pushes)
                    if self.sweeps > worst_sweeps:
                        worst_sweeps = self.sweeps
                    if self.sweeps > MAX_SWEEPS:
                        unconverged += 1
                ending = self._verdict(fall_height)
                if ending != "completed":
                    break
        except KeyboardInterrupt:
            ending = "interrupted"
        run = Run(
            recorder.arrays() or self._no_rows(),
            {
                **(metadata or {}),
                "ending": ending,
                "end_time": self.t,
                "control_period": period,
                "dt": self.dt,
                "gravity": self.gravity.tolist(),
                "ground": asdict(self.ground),
                "robot": self.robot.name,
                "mass": self.robot.mass,
                "feet": list(self.robot.feet),
                "thrusters": list(self.robot.thrusters),
                "pushes": [asdict(push) for push in pushes],
                "contact_sweeps_max": worst_sweeps,
                "contact_unconverged": unconverged,
                "controller": type(controller).__name__,
                "parameters": dict(describe()) if describe is not None else {},
                "versions": describe_versions(),
            },
        )
        if failure is not None:
            raise ControlError(f"at t = {self.t:.3f} s the {ending}", time=self.t, run=run) from failure
        return run

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
            state: that the controller was given.
            command: that it returned.
            elapsed: time it took, ns.
            telemetry: gives more signals.

        Raises:
            InputError: telemetry uses a name of the log itself, or changed its names or shapes.
        """
        row: dict[str, ArrayLike] = {
            "t": self.t,
            "q": state.q,
            "v": state.v,
            "foot_position": state.foot_position,
            "foot_velocity": state.foot_velocity,
            "foot_force": state.foot_force,
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
        recorder.append(row)

    def _push_force(self, pushes: Sequence[Push]) -> Vector | None:
        """(nv,) generalised force of the mean of the pushes over the coming step, None where there is none."""
        d = self.dynamics
        force = np.zeros(3)
        for push in pushes:
            force += push.share(self.t, self.t + self.dt) / self.dt * np.array(push.impulse)
        if not force.any():
            return None
        body = pin.getJointJacobian(d.model, d.data, 1, pin.LOCAL_WORLD_ALIGNED)[:3]
        return np.asarray(force @ body)

    def _no_rows(self) -> dict[str, Vector]:
        """Signals of a run that ended before its first tick."""
        feet, (joints,), thrusts = len(self.robot.feet), self._shapes[0], self._shapes[1]
        shapes = {
            "t": (),
            "q": (len(self.q),),
            "v": (len(self.v),),
            "foot_position": (feet, 3),
            "foot_velocity": (feet, 3),
            "foot_force": (feet, 3),
            "torque": (joints,),
            "thrust": thrusts,
            "tick_ns": (),
        }
        return {name: np.zeros((0, *shape)) for name, shape in shapes.items()}

    def _verdict(self, fall_height: float) -> str:
        """Whether the run goes on (``completed``) or how it ended."""
        return _VERDICTS[_upright(self.v, self._base_position, self._base_rotation, fall_height)]

    def _checked(self, command: Command) -> Command:
        """A command as float64 arrays; raises unless it has the right shapes and finite entries."""
        if not isinstance(command, Command):
            raise InputError(f"step() must return a Command, got {type(command).__name__}", name="command")
        torque, thrust = command.torque, command.thrust
        if (
            getattr(torque, "dtype", None) is FLOAT64
            and getattr(thrust, "dtype", None) is FLOAT64
            and (torque.shape, thrust.shape) == self._shapes
            and _finite(torque, thrust)
        ):
            return command
        return Command(
            checks.vector("command.torque", torque, self._shapes[0]),
            checks.vector("command.thrust", thrust, self._shapes[1]),
        )


@njit(cache=True)
def _finite(torque, thrust):  # type: ignore[no-untyped-def]
    """Whether every entry is finite."""
    total = 0.0
    for i in range(torque.shape[0]):
        total += abs(torque[i])
    for k in range(thrust.shape[0]):
        for i in range(3):
            total += abs(thrust[k, i])
    return np.isfinite(total)


@njit(cache=True)
def _upright(v, position, rotation, fall_height):  # type: ignore[no-untyped-def]
    """0 for a body that stands, 1 for one that fell, 2 for one whose velocity is beyond reason or no number."""
    speed = 0.0
    for i in range(v.shape[0]):
        speed += abs(v[i])
    if not speed <= 1e4:
        return 2
    return 1 if position[2] < fall_height or rotation[2, 2] < 0.5 else 0
