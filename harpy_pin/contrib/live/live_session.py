"""A walk that is driven: everything but the browser. It knows no threads, and no clock but the one
that it is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from time import perf_counter_ns
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.contrib.live.settings import (
    DrivenGait,
    DriveRanges,
    LiveSettings,
    make_driven_gait,
    usual_settings,
)
from harpy_pin.contrib.live.times import RealTimePacer, TickTimes
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.named_controllers import make_controller
from harpy_pin.errors import InputError, reason
from harpy_pin.estimation.imu import Imu
from harpy_pin.gaits.commanded import CommandedGait
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.ground.ground import Ground
from harpy_pin.ground.terrain import Plane
from harpy_pin.model.loading import load_harpy
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensing import EstimatedState, estimated_state
from harpy_pin.simulation.sensors import ESTIMATED, Noise, Sensors
from harpy_pin.simulation.simulator import Simulator
from harpy_pin.view.identity import CONTROLLERS

PERIOD, STEPS = 1e-3, 2
"""Time between control ticks, s, and physics steps in each."""
PULL_LASTS = 0.25
"""How long a pull acts that is not renewed, s: one whose driver is gone does not last."""
FOLLOWED = 10
"""Ticks between two changes of the ground."""
STIFFNESS_RATE, TILT_RATE = 4.0, 0.1
"""How fast the ground's stiffness changes, 1/s (by a factor of e in 0.25 s), and how fast it tilts,
rad/s.
"""
SLOW = 0.02
"""Velocity below which a robot that never stops stepping may change its schedule, m/s and rad/s."""
MAX_AT_ONCE = 50
"""Ticks that are made up for before the caller gets its turn."""
STRIP_LENGTH = 0.6
"""How far a friction strip goes along x, m."""


@dataclass(frozen=True, eq=False)
class Tick:
    """What one tick was."""

    state: State  # true, before it
    command: Command  # that the controller returned
    elapsed: int  # time it took, ns
    push: Vector  # (3,) force of pushes and pulls on the body, N


class LiveSession:
    """A robot that is driven, on a ground that changes.

    A new controller goes on from the present state, with the gait as it is. Only where the walk has
    turned and the new controller faces x does the robot begin anew.

    Args:
        settings: to begin with; by default :func:`usual_settings`.
        robot: who walks: Harpy, the default, or any robot with two, four or six feet and a posture
            in which it stands.
        on_standing: called with the session when the robot stands, before the controllers' kernels
            are compiled.

    Attributes:
        settings: as they are.
        ranges: what may be set with this robot.
        simulator: the plant.
        gait: the commanded walk.
        plane: surface of the ground as it is.
        controller: the present one.
        ending: empty while it walks; otherwise ``fell``, ``diverged``, or what the controller
            failed with. Then nothing moves until :meth:`reset`.
        paused: whether time stands still.
        ticks: of all walks since the session began.
        walks: that were begun.
        falls: so far.
        times: of the present controller's ticks; the first one with a controller is not counted,
            since it loads compiled code.
        pacer: of the clock.
        last: the last tick; before the first of a walk, the robot as it stands, and no command.
        on_tick: called after every tick (a log).
    """

    def __init__(
        self,
        settings: LiveSettings | None = None,
        *,
        robot: Robot | None = None,
        on_standing: Callable[[LiveSession], None] = lambda session: None,
    ) -> None:
        self.robot = robot if robot is not None else load_harpy()
        self.ranges = DriveRanges.of(self.robot)
        self.settings = s = settings if settings is not None else usual_settings(self.robot)
        self.ranges.check(s)
        self.simulator = Simulator(
            self.robot,
            Ground(mu_s=s.friction, stiffness=s.stiffness, friction_strips=s.friction_strips),
        )
        self.times, self.pacer = TickTimes(), RealTimePacer(PERIOD)
        self.paused = False
        self.ticks = self.falls = self.walks = 0
        self._tick, self._fall_height = 0, 0.0  # of the present walk
        self.gait: DrivenGait
        self._pushes: list[Push] = []
        self._pull, self._pull_until = np.zeros(3), 0.0
        self._nothing = Command(
            np.zeros(len(self.robot.joints)), np.zeros((len(self.robot.thrusters), 3))
        )
        self.on_tick: Callable[[Tick], None] | None = None
        self._slip_before = np.zeros((len(self.robot.feet), 2))
        self._sensors: Sensors | EstimatedState | None = None
        self._warm: set[str] = set()
        self._stand()
        on_standing(self)
        self._warm_up(self.ranges.controllers)
        self._take_over(self._make_controller(s))

    @property
    def time(self) -> float:
        """Simulated time of all walks, s."""
        return self.ticks * PERIOD

    target = property(attrgetter("controller.target"), doc="The gait's targets of the last tick.")

    @property
    def slip(self) -> Vector:
        """(feet, 2) path of the feet on the ground in all walks, and distances from touchdown to
        last touch, m.
        """
        return self._slip_before + np.stack(
            (self.simulator.slip_path, self.simulator.slip_net), axis=1
        )

    @property
    def signals(self) -> dict[str, ArrayLike]:
        """The last tick and how things stand: what is logged at each tick, by the names of logs.

        ``controller`` and ``schedule`` are numbers, whose names are in the metadata ``live``;
        ``push`` is the force on the body from outside, N.
        """
        tick, target, settings, s = self.last, self.target, self.settings, self.simulator
        schedules, gait, slip = self.ranges.schedules, self.gait, self.slip
        schedule = (
            {"schedule": schedules.index(gait.schedule)} if isinstance(gait, WalkingGait) else {}
        )
        return {
            "t": (self.ticks - 1) * PERIOD,
            "q": tick.state.q,
            "v": tick.state.v,
            "foot_position": tick.state.foot_position,
            "foot_velocity": tick.state.foot_velocity,
            "foot_force": tick.state.foot_force,
            "slip_path": slip[:, 0],
            "slip_net": slip[:, 1],
            "torque": tick.command.torque,
            "thrust": tick.command.thrust,
            "tick_ns": tick.elapsed,
            "x_r": target.body,
            "x_w": self._applied_reference(),
            "estimated_q": self._estimate,
            "stance": target.stance,
            "command": gait.command,
            "applied_velocity": gait.applied[:3],
            "heading": target.heading,
            "friction_estimate": self._friction_estimate(),
            "foot_friction": s.ground.friction(tick.state.foot_position[:, 0]),
            "ground_stiffness": s.ground.stiffness,
            "ground_slope": self.plane.slope,
            "assumed_friction": settings.mu,
            "controller": list(CONTROLLERS).index(settings.controller),
            **schedule,
            "push": tick.push,
        }

    def _applied_reference(self) -> Vector:
        """(3,) the governed reference, m; NaN where no governor acts on it."""
        c = self.controller
        reference = getattr(c, "applied", None)
        if reference is None or self.settings.controller == "none":
            return np.full(3, math.nan)
        bent = c.bent if c.force_filter is not None else reference  # type: ignore[attr-defined]
        return np.asarray(bent)[:3]

    def _friction_estimate(self) -> Vector:
        """(feet,) what the controller takes the friction for."""
        for holder in (self.controller, getattr(self.controller, "tasks", None)):
            estimator = getattr(holder, "friction", None)
            if estimator is not None:
                return np.asarray(estimator.estimate)
        return np.full(len(self.robot.feet), self.settings.mu)

    def change(self, changes: Mapping[str, Any]) -> str:
        """Set values of :class:`LiveSettings` by their names, from the next tick on.

        Returns:
            What a driver should know of it; empty where it is as expected.

        Raises:
            InputError: an unknown name or a value out of its domain; then nothing has changed.
        """
        before, after = self.settings, self.settings.changed(changes)
        self.ranges.check(after)
        note, controller, restarts = "", None, False
        if (after.controller, after.mu, after.estimate) != (
            before.controller,
            before.mu,
            before.estimate,
        ):
            restarts = not after.turns and bool(self.gait.target.heading[:2].any())
            if not restarts:
                controller = self._make_controller(after)
        self.settings = after
        if (after.friction, after.friction_strips) != (before.friction, before.friction_strips):
            self._lay_ground(self.simulator.ground.stiffness)
        seen = [
            (s.delay, s.noise, s.state, s.slope if s.state == ESTIMATED else 0.0)
            for s in (before, after)
        ]
        if seen[0] != seen[1]:
            self._make_sensors(goes_on=before.state == after.state == ESTIMATED)
        if restarts:
            note = "The walk had turned, and this controller faces x: it began anew."
            self.reset()
        elif controller is not None:
            self._take_over(controller)
        self._command_gait()
        if after.schedule != before.schedule and not self._schedule_fits():
            note = note or f"It stops, and then begins to {after.schedule}."
        if after.turning != 0.0 and not after.turns:
            note = note or "This controller faces x: it does not turn."
        return note

    def lay_strip(self, friction: float) -> str:
        """Lay a strip of this friction across x, ahead of the body; one that was there goes. See
        :meth:`change`.
        """
        x, ahead = float(self.simulator.q[0]), self.ranges.ahead
        begin = (
            x + ahead
            if math.cos(float(self.gait.target.heading[0])) >= 0.0
            else x - ahead - STRIP_LENGTH
        )
        return self.change({"friction_strips": ((begin, begin + STRIP_LENGTH, friction),)})

    def push(self, impulse: ArrayLike) -> None:
        """Push the body by a (3,) impulse, world axes, N·s, within a tenth of a second.

        Raises:
            InputError: no finite vector, or a larger one than 30 N·s; it may be larger for robots
                heavier than Harpy.
        """
        vector = checks.vector("impulse", impulse, 3)
        size, most = float(np.linalg.norm(vector)), self.ranges.impulse
        if size > most:
            raise InputError(
                f"a push has at most {most:g} N·s, got {size:g}", name="impulse", value=impulse
            )
        x, y, z = vector.tolist()
        self._pushes.append(Push(self.simulator.t, (x, y, z)))

    def pull(self, force: ArrayLike) -> None:
        """Pull the body by a (3,) force, world axes, N, for a quarter of a second unless it is
        pulled again.

        A force above 60 N is shortened; it may be larger for robots heavier than Harpy.

        Raises:
            InputError: no finite vector.
        """
        vector = checks.vector("force", force, 3)
        size = float(np.linalg.norm(vector))
        self._pull[:] = vector * min(1.0, self.ranges.pull / size) if size > 0.0 else 0.0
        self._pull_until = self.simulator.t + PULL_LASTS

    def pause(self, paused: bool) -> None:
        """Let time stand still, or go on; an :class:`InputError` for what is neither true nor
        false.
        """
        if not isinstance(paused, bool):
            raise InputError(
                f"paused must be true or false, got {paused!r:.60}", name="paused", value=paused
            )
        self.paused = paused
        self.pacer.restart()

    def reset(self) -> None:
        """Begin a new walk, standing at the origin, on the ground as it is set; its strip stays
        where it lies.
        """
        self._slip_before = self.slip
        self._stand()
        self._take_over(self._make_controller(self.settings))

    def step(self, ticks: int) -> None:
        """Pause, and walk some ticks, whatever the clock says.

        Raises:
            InputError: no whole number from 1 to 1000.
        """
        checks.whole("ticks", ticks, low=1, high=1000)
        self.pause(True)
        for _ in range(ticks):
            if self.ending:
                return
            self.tick()

    def advance(self, now: float) -> int:
        """Walk the ticks that are due by the clock (s), at most 50, and say how many there were."""
        if self.paused or self.ending:
            self.pacer.restart()
            return 0
        done = 0
        while done < MAX_AT_ONCE and not self.ending and self.pacer.is_due(now, self.settings.pace):
            self.tick()
            done += 1
        return done

    def tick(self) -> Tick:
        """One control tick, and the physics until the next."""
        s = self.simulator
        s.t = self._tick * PERIOD
        if self._tick % FOLLOWED == 0:
            self._follow_ground()
        state = s.state
        measured = state if self._sensors is None else self._sensors.measure(state)
        if not self._schedule_fits() and self._may_change_schedule():
            self.gait = make_driven_gait(
                self.robot, self.settings
            )  # it goes on from where the robot stands
            self._start_gait(measured)
            self._take_over(self._make_controller(self.settings))
        push, pushes = np.zeros(3), self._forces()
        for one in pushes:
            push += one.share(s.t, s.t + PERIOD) / PERIOD * np.array(one.impulse)
        begin = perf_counter_ns()
        try:
            command = self.controller.step(measured)
            elapsed = perf_counter_ns() - begin
            s.advance(command, pushes, steps=STEPS)
        except (
            Exception
        ) as error:  # one's own mistakes included: the log is kept, and the page says so
            self.ending = f"controller failed: {reason(error)}"
            command, elapsed = self._nothing, perf_counter_ns() - begin
        self.last = tick = Tick(state, command, elapsed, push)
        self.times.add(elapsed)
        self.ticks += 1
        self._tick += 1
        if self.on_tick is not None:
            self.on_tick(tick)
        if not self.ending:
            ending = s.verdict(self._fall_height)
            if ending != "completed":
                self.ending = ending
                self.falls += 1
        return tick

    def _stand(self) -> None:
        """Stand at the origin, without a controller."""
        settings, s = self.settings, self.simulator
        self.gait = make_driven_gait(self.robot, settings)
        self.plane = Plane(slope=settings.slope)
        self._lay_ground(settings.stiffness)
        placed = OnTerrain(self.gait, self.plane) if settings.slope else self.gait
        q, v = placed.initial_state(penetration=s.static_penetration)
        s.reset(q, v)
        self._fall_height = 0.6 * (float(q[2]) - s.ground_below)
        self._start_gait(s.state)
        self.ending, self._tick, self._pushes = "", 0, []
        self.walks += 1
        self._pull, self._pull_until = np.zeros(3), 0.0
        self._make_sensors()
        self.last = Tick(s.state, self._nothing, 0, np.zeros(3))
        self.controller: GaitController = cast(
            GaitController, SimpleNamespace(target=self.gait.target)
        )

    def _make_controller(self, settings: LiveSettings) -> GaitController:
        """A controller that goes on with the present walk, its compiled code loaded."""
        if settings.controller not in self._warm:
            self._warm_up([settings.controller])
        return self._controller_of(settings, self.gait)

    def _controller_of(self, settings: LiveSettings, driven: DrivenGait) -> GaitController:
        chosen, gait = CONTROLLERS[settings.controller], OnTerrain(driven, self.plane)
        given: dict[str, Any] = {
            "governor": chosen.governor,
            "period": PERIOD,
            "estimate_friction": settings.estimate,
        }
        return make_controller(chosen.name, gait, mu=settings.mu, **given)

    def _warm_up(self, names: Iterable[str]) -> None:
        """Compile or load the code of controllers by a tick of each; all are made before, to
        compile side by side.
        """
        made = []
        for name in sorted(
            names, key=lambda name: CONTROLLERS[name].name != "governed"
        ):  # these wait for nothing
            settings = self.settings.changed({"controller": name})
            scratch = make_driven_gait(self.robot, settings)
            made.append((self._controller_of(settings, scratch), scratch))
            self._warm.add(name)
        for controller, scratch in made:
            q, v = scratch.initial_state(penetration=self.simulator.static_penetration)
            feet = self.simulator.dynamics.foot_position.copy()
            controller.step(State(0.0, q, v, feet, np.zeros_like(feet), np.zeros_like(feet)))

    def _take_over(self, controller: GaitController) -> None:
        """Another controller from now on: its ticks are counted anew, and making it took no
        time.
        """
        controller.target._record_[:] = self.target._record_  # what feet do goes on
        self.controller = controller
        self.times = TickTimes()
        self.pacer.restart()

    def _start_gait(self, measured: State) -> None:
        """The gait's command and first target."""
        if isinstance(self.gait, WalkingGait):
            self.gait.observe(measured)
        self._command_gait()
        self.gait.update(measured.t)

    def _command_gait(self) -> None:
        """Give the gait the velocity that is set; one whose schedule is to change stops."""
        s = self.settings
        velocity = (s.forward, s.sideways, s.turning if s.turns else 0.0)
        if isinstance(self.gait, CommandedGait):
            self.gait.command[:] = velocity
        else:
            self.gait.command[:] = (*velocity, s.height) if self._schedule_fits() else 0.0

    def _schedule_fits(self) -> bool:
        """Whether the gait walks in the schedule that is set."""
        desired = self.settings.schedule
        return (
            desired is None or isinstance(self.gait, CommandedGait) or self.gait.schedule == desired
        )

    def _may_change_schedule(self) -> bool:
        """Whether the robot stands, or steps in place with every foot on the ground: a gait begins
        from standing.
        """
        gait = cast(WalkingGait, self.gait)
        always, swinging = (
            bool(gait._record_["pace"]["always"][0]),
            bool(gait._record_["steps"]["in_air"].any()),
        )
        return float(np.abs(gait.applied).max()) < SLOW and (
            not gait.walking or (always and not swinging)
        )

    def _make_sensors(self, *, goes_on: bool = False) -> None:
        """Sensors as set, anew; none where they would measure the true state. The estimate may go
        on from the last.
        """
        s, seed, last = self.settings, self.walks, self._sensors if goes_on else None
        self._sensors, self._estimate = None, np.full(len(self.simulator.q), math.nan)
        if s.state == ESTIMATED:
            level = s.slope == 0.0 and bool(self.plane.record["level"][0])
            how: dict[str, Any] = {"level": level, "controller": self, "seed": seed}
            self._sensors = estimated_state(self.simulator, self.robot, Imu(), period=PERIOD, **how)
            if isinstance(last, EstimatedState):
                self._sensors.estimator.reset(
                    last.signals["estimated_q"], last.signals["estimated_v"]
                )
            self._estimate = np.asarray(self._sensors.signals["estimated_q"])
        elif s.delay or s.noise:
            self._sensors = Sensors(self.robot, Noise.typical(s.noise), delay=s.delay, seed=seed)

    def _lay_ground(self, stiffness: float) -> None:
        s = self.settings
        ground = Ground(
            mu_s=s.friction,
            stiffness=stiffness,
            friction_strips=s.friction_strips,
            terrain=self.plane,
        )
        self.simulator.change_ground(ground)

    def _follow_ground(self) -> None:
        """The ground's stiffness and slope go to those that are set; it tilts about the place below
        the body.
        """
        now, desired = self.simulator.ground.stiffness, self.settings.stiffness
        plane, slope, span = self.plane, self.settings.slope, FOLLOWED * PERIOD
        if now == desired and plane.slope == slope:
            return
        if plane.slope != slope:
            x, y = self.simulator.q[:2].tolist()
            step, height = TILT_RATE * span, float(plane.height(x, y))
            angle = plane.slope + min(max(slope - plane.slope, -step), step)
            self.plane = Plane(slope=angle, above=height - math.tan(angle) * x)
            cast(OnTerrain, self.controller.gait).lay_over(self.plane)
        most = math.exp(STIFFNESS_RATE * span)
        self._lay_ground(min(max(desired, now / most), now * most))

    def _forces(self) -> list[Push]:
        """Pushes that still act, and the pull."""
        t = self.simulator.t
        if self._pushes:
            self._pushes = [push for push in self._pushes if push.time + push.duration > t]
        if t >= self._pull_until or not self._pull.any():
            return self._pushes
        x, y, z = (self._pull * PERIOD).tolist()
        return [*self._pushes, Push(t, (x, y, z), PERIOD)]
