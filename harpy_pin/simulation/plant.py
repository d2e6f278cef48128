"""What all plants share: a robot on a ground, its closed loops and their logs.

They are :class:`harpy_pin.simulation.simulator.Simulator`,
:class:`harpy_pin.simulation.pinocchio_plant.PinocchioPlant` and
:class:`harpy_pin.simulation.mujoco.MujocoPlant`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import ControlError, InputError, Interrupted, RunFileError
from harpy_pin.files import Shield
from harpy_pin.ground.ground import Ground
from harpy_pin.kernels import kernel
from harpy_pin.kernels.calls import Call
from harpy_pin.log.recorder import BLOCK, Recorder
from harpy_pin.log.run import Run
from harpy_pin.log.run_file import MAX_STEP
from harpy_pin.log.slip import forget_slip
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import all_finite, as_array, as_command
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import GRAVITY, Command, State, Vector
from harpy_pin.model.terms import write_thrusts
from harpy_pin.simulation.actuators import Actuators, motors_of, take_law
from harpy_pin.simulation.loop import ClosedLoop, Controller, RunLog, run_metadata
from harpy_pin.simulation.push import Push, check_pushes
from harpy_pin.simulation.sensors import Sensors
from harpy_pin.simulation.step import VERDICTS, PlantRecord, plant_record, stands
from harpy_pin.simulation.thrusters import settle_thrusters

if TYPE_CHECKING:
    from harpy_pin.simulation.sensing import EstimatedState
    from harpy_pin.simulation.ticks import CompiledLoop


@runtime_checkable
class Attachment(Protocol):
    """What acts on a plant besides commands and pushes, such as a battery behind its thrusters.

    It reads and writes the plant's :attr:`~Plant.record`. Its signals for the log are arrays, by
    name, that stay where they are.
    """

    signals: Mapping[str, NDArray[Any]]

    def reset(self, plant: Plant) -> None:
        """Begin anew, after a reset of the plant."""

    def after_step(self, plant: Plant) -> None:
        """Act, after each physics step."""


@fixed_arrays("counts", "gravity", "q", "record", "slip_net", "slip_path", "v")
class Plant(KeepsViews, ABC):
    """A robot, a ground and a time step. It has no state before :meth:`reset` gives it one.

    Args:
        robot: what to simulate; only its feet touch the ground, so that one without feet falls
            through it.
        ground: contact parameters, those that the feet feel.
        dt: physics step, s.
        gravity: (3,) gravity vector, m/s²; tilt it to stand on a slope.
        actuators: motors, joint friction and thrusters; those of the model by default.

    Attributes:
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
        t: time, s.
        dynamics: terms of the equations of motion at the present state.
        record: what kernels know of contact, motors and thrusters.
        attached: see :meth:`attach`.
        slip_path: (feet,) see :mod:`harpy_pin.log.slip`, m.
        slip_net: (feet,) net displacements of the same feet, m.
        counts: (3,) since the beginning of the last run: most iterations of the contact solver in a
            step; steps in which they ran out; forces commanded of a rotor that were not along its
            axis or beyond its limits. The rotor then has the part along its axis, within its
            limits.

    Raises:
        InputError: dt is not positive, or gravity is not a finite 3-vector.
    """

    name: str  # in the log
    _record_: Records[Any]
    _counts_: NDArray[np.int64]
    _q_: Vector
    _v_: Vector

    def __init__(
        self,
        robot: Robot,
        ground: Ground | None = None,
        *,
        dt: float = 5e-4,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY),
        actuators: Actuators | None = None,
    ) -> None:
        checks.instance("robot", robot, Robot)
        self.ground = Ground() if ground is None else checks.instance("ground", ground, Ground)
        self.dt = checks.number("dt", dt, low=1e-6)
        self.actuators = (
            Actuators() if actuators is None else checks.instance("actuators", actuators, Actuators)
        )
        self.robot = robot = self.actuators.damped(robot)
        self._ground = self.ground.record
        self._terrain = self._ground["terrain"]
        self.gravity = checks.vector("gravity", gravity, 3)
        self.dynamics = Dynamics(robot, gravity=self.gravity)
        self.record = record = self._make_record()
        self.attached: tuple[Attachment, ...] = ()
        self._foot_force: Vector = field(record, "force").reshape(-1, 3)
        self._shapes = ((len(robot.joints),), (len(robot.thrusters), 3))
        slip = record["slip"]
        self.slip_path: Vector = field(slip, "path")
        self.slip_net: Vector = field(slip, "net")
        self.counts: NDArray[np.int64] = field(record, "counts")
        self.q: Vector = robot.neutral
        self.v: Vector = np.zeros(robot.nv)
        self.t = 0.0
        self._applied = np.zeros(self._shapes[1])
        self._noted_torque, self._noted_thrust = (
            np.zeros(self._shapes[0]),
            np.zeros(self._shapes[1]),
        )
        self._law, self._has_law = (field(record["motors"], name) for name in ("law", "has_law"))
        # logged of commands with a law: it, and the torque of the motors in the last physics step
        self._law_signals = {
            "motor_law": self._law,
            "motor_torque": field(record["motors"], "mean_torque"),
        }
        self._clock, self._tick_ns = np.zeros(()), np.zeros((), np.int64)
        self._prepare()
        self.dynamics.update(self.q, self.v)
        self._placed = False

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}('{self.robot.name}', t={self.t:.3f} s, "
            f"mu_s={self.ground.mu_s:g})"
        )

    def _make_record(self) -> Records[PlantRecord]:
        """The record of contact and actuators."""
        return plant_record(
            PlantRecord, self.robot.sizes, self.actuators, self.dt, motors_of(self.robot)
        )

    def _prepare(self) -> None:
        """Begin to compile what every run needs; plants add their steps."""
        forget_slip.prepare(self._record_["slip"], self.dynamics.foot_position)
        stands.prepare(self._terrain, self.q, self.v, 0.0)
        are_finite.prepare(self._noted_torque, self._noted_thrust)

    def reset(self, q: ArrayLike, v: ArrayLike, *, t: float = 0.0) -> None:
        """Put the robot in a state; contact forces start at zero, motors and thrusters settle at
        the next command.

        Args:
            q: (nq,) configuration (the quaternion is normalised).
            v: (nv,) generalised velocity.
            t: time, s.

        Raises:
            InputError: wrong shapes or entries that are not finite.
        """
        self.q = configuration(self.robot, q)
        self.v = checks.vector("v", v, self.robot.nv)
        self.t = checks.number("t", t)
        self._foot_force[:] = 0.0
        self.dynamics.update(self.q, self.v)
        forget_slip(self._record_["slip"], self.dynamics.foot_position)
        motors = self._record_["motors"]
        motors["settled"] = motors["has_law"] = motors["mean_torque"] = 0
        self._noted_thrust[:] = 0.0
        settle_thrusters(self._record_["thrusters"], self.actuators.thrusters, self.dt)
        for part in self.attached:
            part.reset(self)
        self._placed = True

    def attach(self, part: Attachment) -> None:
        """Let something act after each physics step from now on; runs log its signals, in Python's
        loop.

        Args:
            part: what acts.

        Raises:
            InputError: it has not what an :class:`Attachment` has.
        """
        checks.instance("part", part, Attachment)
        part.reset(self)
        self.attached += (part,)
        vars(self).pop("signals", None)

    @property
    def state(self) -> State:
        """The present state (a copy); the contact forces are those of the last step.

        Raises:
            InputError: before the first :meth:`reset`.
        """
        self._check_placed()
        d = self.dynamics
        return State(
            self.t, self._q_, self._v_, d._foot_position_, d._foot_velocity_, self._foot_force
        ).copy()

    @property
    def static_penetration(self) -> float:
        """Penetration of the feet at rest under equal shares of the load normal to the ground, m;
        zero without feet.
        """
        if not self.robot.feet:
            return 0.0
        load = self.robot.mass * max(-float(self.gravity[2]), 0.0)
        return load / (len(self.robot.feet) * self.ground.stiffness)

    @property
    def ground_below(self) -> float:
        """Height of the ground below the body, m."""
        surface = self.ground.surface
        return 0.0 if surface is None else float(surface.height(self.q[0], self.q[1]))

    def verdict(self, fall_height: float) -> str:
        """How a run stands: ``completed`` so far, ``fell``, or ``diverged``.

        Args:
            fall_height: of the body above the ground, below which it has fallen, m.
        """
        return VERDICTS[stands(self._terrain, self._q_, self._v_, fall_height)]

    @cached_property
    def signals(self) -> dict[str, NDArray[Any]]:
        """What a log has of the plant, by name: arrays that stay where they are.

        The command and the times are those of the last logged tick. Of thrusters that lag there are
        the thrusts of the last step, ``applied_thrust``.
        """
        d = self.dynamics
        signals = {
            "t": self._clock,
            "q": self._q_,
            "v": self._v_,
            "foot_position": d.foot_position,
            "foot_velocity": d.foot_velocity,
            "foot_force": self._foot_force,
            "slip_path": self.slip_path,
            "slip_net": self.slip_net,
            "torque": self._noted_torque,
            "thrust": self._noted_thrust,
            "tick_ns": self._tick_ns,
        }
        if self.actuators.thrusters:
            signals["applied_thrust"] = self._applied
        for part in self.attached:
            signals |= part.signals
        return signals

    @cached_property
    def log_calls(self) -> tuple[Call, ...]:
        """What brings :attr:`signals` up to date before a row is logged."""
        if not self.actuators.thrusters:
            return ()
        given = field(self._record_["thrusters"], "mean_thrust")
        return (Call(write_thrusts, self.dynamics._record_, given, self._applied),)

    def _take_law(self, command: Command) -> None:
        """Give the motors the command's own law, or none."""
        law = getattr(command, "law", None)
        if law is not None and not take_law(
            self._record_["motors"], as_array("command.law", law, self._law.shape)
        ):
            checks.vector("command.law", law, self._law.shape)
        self._has_law[...] = law is not None

    @abstractmethod
    def advance(self, command: Command, pushes: Sequence[Push] = (), *, steps: int = 1) -> None:
        """Physics steps of length dt under a constant command.

        Args:
            command: torques and thrusts.
            pushes: forces on the body; those of another time do nothing.
            steps: how many.

        Raises:
            InputError: before the first :meth:`reset`, or the command's arrays have the wrong shape
                or are not finite numbers.
        """

    def compile_loop(
        self, controller: Any, recorder: Recorder, **rules: Any
    ) -> CompiledLoop | None:
        """The closed loop with a controller as one call of C for many ticks; None where Python
        makes every tick.

        Args:
            controller: may have ``calls(state)``, the :class:`~harpy_pin.kernels.calls.Call` of a
                tick at the state in these arrays, or None; ``command``, arrays of torques, thrusts
                and any motors' law; lasting signals.
            recorder: of the log; has its first row.
            rules: see :class:`harpy_pin.simulation.ticks.CompiledLoop`.
        """
        return None

    def describe(self) -> Mapping[str, Any]:
        """Which plant it is, with the settings that nothing else of the log's metadata has."""
        return {"name": self.name}

    def run(
        self,
        controller: Controller,
        duration: float,
        *,
        control_period: float | None = None,
        metadata: Mapping[str, object] | None = None,
        on_tick: Callable[[State], None] | None = None,
        on_piece: Callable[[float], None] | None = None,
        pushes: Sequence[Push] = (),
        sensors: Sensors | EstimatedState | None = None,
        save: str | Path | None = None,
    ) -> Run:
        """Run a controller in closed loop and log every tick.

        The command is held between ticks. A fall (body below 60 % of its starting height or tilted
        by more than 60°) or a divergence ends the run; the log so far is kept and
        :attr:`Run.ending` says why.

        With ``save`` every second of simulated time (every 1000 ticks if that is sooner) is added
        to ``<save>.part``, which :meth:`Run.load` reads should the process die. At the end the
        whole log takes its place, also after a fall, a failure or Ctrl-C; a second Ctrl-C waits
        until it is written.

        Args:
            controller: anything with ``step(state) -> Command``.
            duration: simulated time, s.
            control_period: time between ticks, s, a multiple of dt; the controller's ``period`` (1
                ms if it has none) by default.
            metadata: more entries for the log's metadata.
            on_tick: called with the true state at each tick, before the controller; then no two
                ticks are computed in one compiled call.
            on_piece: called with the time, s, now and then (progress bars).
            pushes: forces on the body, logged in the metadata; their times are the simulator's.
            sensors: what the controller knows of the state; the true state where there are none.
                The log keeps the true state.
            save: file of the log; it may need its size twice for a moment.

        Raises:
            InputError: bad duration or period, or a push that lies outside the run.
            ControlError: the controller raised, or returned no valid command; ``error.run`` holds
                the log so far.
            RunFileError: the log cannot be written: found out before the run, or with the log as
                ``error.run``.
            Interrupted: Ctrl-C; ``error.run`` holds the log so far.
        """
        duration = checks.number("duration", duration, low=0.0, strict=True)
        period = getattr(controller, "period", 1e-3) if control_period is None else control_period
        period = checks.number("control_period", period, low=0.0, high=MAX_STEP, strict=True)
        substeps = checks.multiple("control_period", period, "physics step", self.dt)
        ticks = checks.ticks(duration, period)
        check_pushes(pushes, self.t, self.t + ticks * period)
        checks.function("on_tick", on_tick, 1)
        checks.function("on_piece", on_piece, 1)
        metadata = {} if metadata is None else checks.mapping("metadata", metadata)

        def describe(ending: str) -> dict[str, Any]:
            return {**metadata, **run_metadata(self, controller, ending, period, pushes)}

        log = RunLog(self, save, describe, block=min(max(round(1.0 / period), 1), BLOCK))
        loop = ClosedLoop(
            self,
            controller,
            log.recorder,
            ticks,
            period,
            substeps,
            on_tick,
            on_piece,
            pushes,
            sensors,
        )
        with Shield() as shield:
            try:
                loop.run(shield)
            except KeyboardInterrupt:
                loop.ending = "interrupted"
            finally:
                shield.saving = True
                log.recorder.flush()
            try:
                run, unsaved = log.close(loop.ending), None
            except RunFileError as error:
                run, unsaved = error.run, error
            interrupted = loop.ending == "interrupted" or shield.late is not None
            shield.late = None
        lost = "" if unsaved is None else f"; {unsaved}"
        if interrupted:
            raise Interrupted(f"interrupted at t = {self.t:.3f} s{lost}", run=run) from unsaved
        if loop.failure is not None:
            raise ControlError(
                f"at t = {self.t:.3f} s the {loop.ending}{lost}", time=self.t, run=run
            ) from loop.failure
        if unsaved is not None:
            raise unsaved
        return run

    def log(
        self,
        recorder: Recorder,
        command: Command,
        elapsed: int,
        telemetry: Callable[[], Mapping[str, ArrayLike]] | None = None,
    ) -> None:
        """Append one tick to a log: :attr:`signals` and those of the controller.

        Args:
            recorder: of the log.
            command: what the controller returned.
            elapsed: time it took, ns.
            telemetry: gives more signals.

        Raises:
            InputError: telemetry uses a name of the log itself or none that a signal can have, or
                changed its names or shapes.
        """
        self._clock[...], self._tick_ns[...] = self.t, elapsed
        self._noted_torque[...], self._noted_thrust[...] = command._torque_, command._thrust_
        for call in self.log_calls:
            call.kernel(*call.arguments)
        own = self.signals
        if "motor_law" in recorder.layout.shapes or (
            len(recorder) == 0 and getattr(command, "law", None) is not None
        ):
            self._take_law(command)
            own = own | self._law_signals
        row: Mapping[str, ArrayLike] = own
        if telemetry is not None:
            signals = telemetry()
            row = {**own, **signals}
            if len(row) < len(own) + len(signals):
                taken = ", ".join(sorted(own.keys() & signals.keys()))
                raise InputError(
                    f"telemetry uses names of the log itself: {taken}", name="telemetry"
                )
        recorder.append(row)

    def checked(self, command: Command) -> Command:
        """The command itself where its arrays are finite, float64 and of the robot's sizes,
        otherwise a copy.

        Args:
            command: torques and thrusts.

        Raises:
            InputError: an array has the wrong shape, or an entry that is not finite.
        """
        try:
            torque, thrust = command._torque_, command._thrust_
            if (torque.shape, thrust.shape) == self._shapes and are_finite(torque, thrust):
                return command
        except (AttributeError, TypeError):
            pass
        command = as_command(command, self.robot)
        torque = checks.vector("command.torque", command.torque, self._shapes[0])
        fit = Command(torque, checks.vector("command.thrust", command.thrust, self._shapes[1]))
        fit.law = (
            None
            if command.law is None
            else checks.vector("command.law", command.law, self._law.shape)
        )
        return fit

    def _check_placed(self) -> None:
        if not self._placed:
            such = "reset(*gait.initial_state(penetration=simulator.static_penetration))"
            raise InputError(
                f"the simulator has no state yet: call reset(q, v), such as {such}",
                name="simulator",
            )


@kernel
def are_finite(torque: Vector, thrust: Vector) -> bool:
    """Whether all entries are finite."""
    return all_finite(torque) and all_finite(thrust.reshape((thrust.size,)))
