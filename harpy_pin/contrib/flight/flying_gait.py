"""One scheduler between a gait and flight: stand, push off, fly, touch down as it is felt, stand,
go on.

On the ground body and feet follow ways of their own, and the load comes on the feet and goes off
them gradually. In the air the body's target is the measured one, and its acceleration, the target's
leaning and the feet's accelerations are those of :mod:`harpy_pin.contrib.flight.airway`: whole-body
controllers find exactly these. A foot has landed when its measured force says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.flight.airway import ORIENTATION, Airway, Quintic, ask_for, rest
from harpy_pin.contrib.flight.flights import (
    Flight,
    Fly,
    Jump,
    crouch_and_push,
    fly_jump,
    lift,
    plan_jump,
    read_flights,
    stretch,
)
from harpy_pin.contrib.flight.flyer import LED, Flyer
from harpy_pin.contrib.flight.standing_feet import LandedGait, StandingFeet
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import LONGEST, Gait, GaitTarget, own_target, refuse_time
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.ground.terrain import Plane, Terrain
from harpy_pin.model.entry import as_state
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector
from harpy_pin.scenario.gait_parts import GAIT_PARTS, Commanded, GaitPart, read_rows

PHASES = ("stand", "bend", "push", "unload", "air", "land", "gait")
"""Phases, in the order of the signal ``flight_phase``."""
MOST_FORCE = 10.0  # largest normal force of all feet, in weights of the robot
SHARE, LANDING_SHARE = 0.4, 0.14
"""Shares of that force which a foot may take in standing and in landing."""
LOADING, UNLOADING, LET_GO = 0.15, 0.3, 0.25
"""Times in which the load comes on the feet and goes off them, s; and the part of a push in which
it does.
"""
LANDING = 1.2  # time from touchdown to standing, s


class FlyingGait(Gait):
    """Targets of a robot that stands, jumps or flies, lands, and then goes on by another gait.

    It needs the measured state: controllers of this library call :meth:`observe` before each
    :meth:`update`. It is for whole-body controllers, with the gains of the orientation that they
    have by default. It faces x.

    It is a gait with memory, for one controller, in one thread. A time before the last one begins
    anew.

    Args:
        gait: of a robot with feet, and thrusters or rotors, that begins at rest. Its posture is
            that of standing; it begins where the last flight has landed.
        flights: :class:`~harpy_pin.contrib.flight.Jump` and :class:`~harpy_pin.contrib.flight.Fly`,
            one or a sequence.
        start: for how long it stands before each flight, and before the gait goes on, s.
        terrain: of the ground; flat by default.
        normal_error: angle by which the normals of the ground that it tells are wrong, about y,
            rad.

    Attributes:
        flights: as given.
        phase: one of ``stand``, ``bend``, ``push``, ``unload``, ``air``, ``land`` and ``gait``.

    Raises:
        InputError: no flights, a robot that cannot fly, a jump that does not land where it should,
            or a gait that does not begin at rest.
    """

    not_governed = "neither jumps nor flies"

    @checked
    def __init__(
        self,
        gait: Gait,
        flights: Any,
        *,
        start: float = 0.5,
        terrain: Terrain | None = None,
        normal_error: float = 0.0,
    ) -> None:
        super().__init__(gait.robot)
        self.flights = read_flights("flights", flights)
        self.terrain = Plane(slope=0.0) if terrain is None else terrain
        if not self.robot.feet or not self.robot.thrusters:
            raise InputError(
                f"flights need feet, and thrusters or rotors: '{self.robot.name}' has not both",
                name="robot",
                value=self.robot,
            )
        self.gait, self.walks = own_target(gait), gait.walks
        most = MOST_FORCE * self.robot.mass * GRAVITY / len(self.robot.feet)
        self.controller_parameters = {
            **gait.controller_parameters,
            "orientation": ORIENTATION,
            "max_normal_force": most,
        }
        self.start = checks.number("start", start, low=0.0, high=1e6)
        self.step_duration, self.double_support = self.gait.step_duration, self.gait.double_support
        self._landed = LandedGait(self.gait)
        self._after = (
            self._landed
            if terrain is None
            else OnTerrain(self._landed, terrain, normal_error=normal_error)
        )
        begin = self.gait.update(0.0)
        if np.abs(begin.body[3:6]).max() > 1e-9 or not begin.stance.all():
            raise InputError(
                "the gait must begin standing, at rest, such as hp.make_commanded_gait", name="gait"
            )
        self._feet = StandingFeet(self.robot, begin, terrain)
        q, _ = self.gait.initial_state()
        self._flyer = Flyer(self.robot, q)
        self._plan()
        self._airway: Airway
        self._way: Quintic
        self._push: Quintic | None
        self._begin()

    @checked
    def expect_lag(self, lag: float) -> None:
        """Plan jumps for thrusts that lag: whole-body controllers that know a ``thrust_lag`` call
        this.

        Args:
            lag: time constant of the thrusts, s.

        Raises:
            InputError: a jump that does not land where it should.
        """
        led, self._flyer.lag = self._flyer.lag, LED * checks.number("lag", lag, low=0.0)
        if self._flyer.lag != led:
            self._plan()

    def _plan(self) -> None:
        """Find how the jumps land where they should."""
        plans = {
            one: one if isinstance(one, Fly) else plan_jump(self._flyer, one)
            for one in {*self.flights}
        }
        self._plans = [plans[one] for one in self.flights]

    def _begin(self) -> None:
        """Stand where the gait begins."""
        q, v = self._after.initial_state()
        d = self._flyer.balance.dynamics
        d.update(q, v)
        self._q, self._v = q, v
        self._feet.begin(d.foot_position)
        self._time, self._since, self._flight = -1.0, 0.0, 0
        self.phase = "stand"
        self._hold(self._feet.home - self._feet.middle)

    def __repr__(self) -> str:
        return f"FlyingGait({self.gait!r}, {len(self.flights)} flights)"

    @checked
    def over(self, terrain: Terrain, *, normal_error: float = 0.0) -> FlyingGait:
        """These flights over other ground.

        Args:
            terrain: of the ground.
            normal_error: angle by which its normals are wrong, about y, rad.
        """
        return FlyingGait(
            self.gait, self.flights, start=self.start, terrain=terrain, normal_error=normal_error
        )

    def observe(self, state: State) -> None:
        """What was measured, for the next update; a bad sample is ignored.

        Args:
            state: of the present tick.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self.robot)
        given = (state.q, state.v, state.foot_position, state.foot_force)
        if not all(np.isfinite(array).all() for array in given):
            return
        self._q, self._v = state.q.copy(), state.v.copy()
        self._feet.measure(state)
        if self.phase == "gait":
            self._landed.observe(state)

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s.

        Args:
            t: time, s.

        Raises:
            InputError: t is not finite.
        """
        t = checks.number("t", t)
        if not abs(t) < LONGEST:
            raise refuse_time(t)
        if t < self._time:
            self._begin()
        span, self._time = max(t - self._time, 0.0), t
        self._schedule(t)
        s = t - self._since
        if self.phase == "air":
            self._fly(s)
        elif self.phase == "gait":
            self.target._record_[:] = self._after.update(s)._record_
        else:
            self._stand_on_feet(s, span)
        return self.target

    def _schedule(self, t: float) -> None:
        """Go to the next phase where this one is over."""
        s = t - self._since
        if self.phase == "stand" and s >= self.start:
            if self._flight == len(self.flights):
                self._landed.move_to(self._feet.home)
                self._go("gait", t)
            else:
                plan, home = self._plans[self._flight], self._feet.home
                if isinstance(plan, Fly):
                    self._way, self._push = stretch(self._flyer, home)
                else:
                    self._way, self._push = crouch_and_push(self._flyer, plan, home)
                self._go("bend", t)
        elif self.phase == "bend" and s >= self._way.duration:
            if self._push is None:
                self._hold(self._way.at(s)[0])
                self._go("unload", t)
            else:
                self._way = self._push
                self._go("push", t)
        elif (self.phase == "push" and s >= self._way.duration) or (
            self.phase == "unload" and s >= UNLOADING
        ):
            self._leave(t)
        elif self.phase == "air" and s > self._airway.sinks and self._feet.touching.any():
            self._touch(t)
        elif self.phase == "land" and s >= self._way.duration:
            self._flight += 1
            self._feet.settle()
            self._hold(self._feet.home - self._feet.middle)
            self._go("stand", t)

    def _go(self, phase: str, t: float) -> None:
        self.phase, self._since = phase, t

    def _hold(self, place: Vector) -> None:
        """Keep the body where it is."""
        self._way = Quintic(rest(place), rest(place), 1.0)

    def _motion(self) -> tuple[Vector, Vector]:
        """Place and velocity of the body's origin, world, (2, 3); angles and rates of the joints,
        (2, n).
        """
        turn = pin.Quaternion(self._q[3:7]).matrix()
        return np.vstack((self._q[:3], turn @ self._v[:3])), np.vstack((self._q[7:], self._v[6:]))

    def _leave(self, t: float) -> None:
        """Let go of the ground."""
        flight, (body, joints) = self.flights[self._flight], self._motion()
        ground = self._feet.highest(self._feet.place[:, :2] + (flight.forward, flight.left))
        plan, home = self._plans[self._flight], self._feet.home
        if isinstance(plan, Fly):
            self._airway = lift(self._flyer, plan, joints, home, ground)
        else:
            self._airway = fly_jump(self._flyer, plan, body, joints, home, ground)
        self._go("air", t)

    def _touch(self, t: float) -> None:
        """A foot has landed: come to stand over where they are."""
        (place, velocity), _ = self._motion()
        self._feet.settle()
        self._feet.grounded[:] = self._feet.touching
        end = rest(self._feet.home - self._feet.middle)
        self._way = Quintic(np.vstack((place, velocity, np.zeros(3))), end, LANDING)
        self._go("land", t)

    def _stand_on_feet(self, s: float, span: float) -> None:
        """Body and feet while there are feet on the ground."""
        share = SHARE
        if self.phase == "push":
            share *= min((self._way.duration - s) / (LET_GO * self._way.duration), 1.0)
        elif self.phase == "unload":
            share *= 1.0 - s / UNLOADING
        elif self.phase == "land":
            share = LANDING_SHARE * min(s / LOADING, 1.0)
            self._feet.sink(span)
        self._feet.ask_for(self.target, self._way.at(s), share, self.double_support)

    def _fly(self, s: float) -> None:
        """Body and feet in the air."""
        balance = self._flyer.balance
        a = self._airway.acceleration(s, self._q, self._v, balance)
        ask_for(self.target, balance.dynamics, self._q, self._v, a)

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`."""
        return self._after.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """The flights, and the gait's parameters."""
        return {**self._after.describe(), "flights": [flight.to_dict() for flight in self.flights]}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The phase, as its place in :attr:`phase`'s list, and where the body should be, m."""
        s = self._time - self._since
        if self.phase == "gait":
            plan = self.target.body[:3]
        else:
            plan = self._airway.body(s)[0] if self.phase == "air" else self._way.at(s)[0]
        return {"flight_phase": PHASES.index(self.phase), "body_plan": plan}


@dataclass(frozen=True, kw_only=True)
class Flying(GaitPart):
    """Harpy jumps or flies, lands, and then follows a velocity, see
    :class:`~harpy_pin.contrib.flight.FlyingGait`.

    Attributes:
        flights: jumps (:class:`~harpy_pin.contrib.flight.Jump`) and flights
            (:class:`~harpy_pin.contrib.flight.Fly`), one or several, also as the mappings that
            files have.
        velocity: what it does after the last landing, as that of
            :class:`~harpy_pin.scenario.Commanded`; it stands by default.
        start: for how long it stands before each flight, s.
    """

    name = "flying"
    extension = "harpy_pin.contrib.flight"
    not_governed = FlyingGait.not_governed
    flights: Flight | Sequence[Flight | Mapping[str, Any]] = checks.setting((Jump(),), read_flights)
    velocity: Sequence[float] | Sequence[Sequence[float]] = checks.setting(
        ((0.0, 0.0, 0.0, 0.0),), read_rows, entries=3
    )
    start: float = checks.setting(0.5, low=0.0, high=1e6)

    def to_dict(self) -> dict[str, Any]:
        """See :class:`~harpy_pin.scenario.parts.Part`."""
        flights = read_flights("flights", self.flights)
        return {**super().to_dict(), "flights": [flight.to_dict() for flight in flights]}

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return FlyingGait(
            Commanded(velocity=self.velocity).make(robot, stiffness), self.flights, start=self.start
        )

    @checked
    def over(self, gait: Gait, terrain: Terrain, *, normal_error: float, friction: float) -> Gait:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return checks.instance("gait", gait, FlyingGait).over(terrain, normal_error=normal_error)


GAIT_PARTS[Flying.name] = Flying
