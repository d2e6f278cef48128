"""The foothold governor: it slows a walk and moves its footholds while the robot cannot do what the gait demands.

A whole-body controller demands an acceleration a_d of the body at every tick, and finds the acceleration a_r that
friction, thrusts and torques allow. Where friction suffices, the gap a_d − a_r is 0.1 m/s².
On slippery ground a stance foot behind the centre of mass cannot tilt its force enough to pass near it; the pitching
moment is then balanced at the cost of the body's motion, and the gap is metres per second squared. Footholds further
ahead and shorter steps make the moment smaller. The gap is an acceleration: it shows before the body strays.

Let φ be the part of the gap beyond what is tolerated, 0 ≤ φ ≤ φ_m, and φ_x its component along x. Then

    ṡ = η φ_x − s / τ_s,  |s| ≤ s_m     shift of the footholds ahead of the gait's
    ċ = κ φ (1 − c) − c / τ             share of the forward speed v that is to be held back
    ḋ = r (c − d)                       share that is held back
    ȯ = −d v                            lag of the body's target behind the gait's

each stepped implicitly, in closed form. The body's target is the gait's, moved by o. A stance foot keeps its place in
the world. A swing foot is brought to the gait's foothold, moved by s and by the lag expected at its landing; this is
decided at lift-off.

What holds, for every sequence of gaps, every gait and every length of the ticks:

1. 0 ≤ d ≤ 1: the governed speed is between zero and the gait's. At least 1 / (1 + κ τ φ_m) of it is left.
2. While the gap is tolerated, s shrinks by 1 / (1 + Δt/τ_s) in each tick, c by 1 / (1 + Δt/τ), and d follows c by
   1 / (1 + r Δt): the speed returns exponentially. The lag stays: what is commanded is a speed.
3. The velocity of the body's target is continuous and changes by no more than r |v| per second besides the gait's own
   acceleration.
4. The feet's targets are continuous, with their velocities. On the ground and at touchdown they move in the world as
   the gait's do: at rest, where the gait's are.
5. Where every gap was tolerated, the targets are the gait's in every bit.

With a commanded gait (:class:`~harpy_pin.gaits.commanded.CommandedGait`) φ_x is the gap's component along the heading,
s moves the footholds along it, and what is held back is a share of the whole command, turning included. The gait plans
path and footholds for the velocity that is left, so there is no lag. Points 1, 2 and 5 hold for the goal of its
velocity, 3 and 4 with the gait's own limits; its largest speed is reduced by what s takes of the legs' reach.

Not proved is that the robot does not fall, and that its legs reach: a foot may be asked to land s_m further from the
body than in the gait and, where the share that is held back changes during its swing, up to |v| times the swing's
duration besides. ``docs/condensed.md`` says what the governor achieves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import Kernel, kernel
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import CommandedGait, CommandedRecord
from harpy_pin.gaits.flight.flying_gait import FlyingGait
from harpy_pin.gaits.gait import FullGait, Gait, GaitTarget, GaitTargetRecord, check_target, copy_target, own_target
from harpy_pin.gaits.steering import advance, note_command
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.simulation.ticks import CompiledTick, note_array

__all__ = ["FootholdGovernorParameters", "GovernedGait"]

MOST = 1e6
"""Largest setting, and slowest time constant."""


@dataclass(frozen=True, kw_only=True)
class FootholdGovernorParameters:
    """Settings of :class:`GovernedGait`.

    Attributes:
        tolerated: gap that has no effect, m/s².
        heard: φ_m, most of the gap beyond it that has an effect, m/s².
        shift_response: η, speed of the footholds' shift per gap, s.
        shift_recovery: τ_s, time constant with which the shift decays, s.
        shift_limit: s_m, m.
        response: κ, share of the speed that is held back per second and gap, s/m.
        recovery: τ, time constant with which the speed returns, s.
        rate: r, how fast the reference's speed follows, 1/s.
    """

    tolerated: float = 4.0
    heard: float = 10.0
    shift_response: float = 0.02
    shift_recovery: float = 20.0
    shift_limit: float = 0.06
    response: float = 0.1
    recovery: float = 2.0
    rate: float = 5.0

    def __post_init__(self) -> None:
        checks.numbers(self, "tolerated", "heard", "shift_response", "response", low=0.0, high=MOST)
        checks.numbers(self, "shift_recovery", "recovery", "rate", low=1.0 / MOST, high=MOST)
        checks.number("shift_limit", self.shift_limit, low=0.0, high=1.0)


class GovernedRecord(RecordOf, FootholdGovernorParameters):
    """What the foothold governor knows and remembers, besides its parameters.

    Attributes:
        step_duration: of the gait, s.
        swing_time: of a foot, s.
        time: of the last update, s; −1 before the first.
        shift: s, how far ahead the footholds are, m.
        desired: c, share of the speed to be held back.
        share: d, share that is held back.
        lag: of the body's target, along x, m; behind the gait's where it is negative.
        lag_velocity: m/s.
        in_air: (2,) 1 for a swing foot, else 0.
        lift_off: (2,) how far each foot was ahead of the gait's when it left the ground, along x, m.
        landing: (2,) likewise when it lands, m.
        foot: (2,) likewise now, m.
    """

    step_duration: float
    swing_time: float
    time: float = -1.0
    shift: float = 0.0
    desired: float = 0.0
    share: float = 0.0
    lag: float = 0.0
    lag_velocity: float = 0.0
    in_air: Vector = sized(2)
    lift_off: Vector = sized(2)
    landing: Vector = sized(2)
    foot: Vector = sized(2)


@fixed_arrays("gap")
class GovernedGait(KeepsViews):
    """A gait that the foothold governor modifies: a gait itself, for controllers that report the gap they leave.

    Args:
        gait: what is commanded; it walks along x, or is a :class:`~harpy_pin.gaits.commanded.CommandedGait`.
        parameters: of the governor.

    Raises:
        InputError: the gait has no ``step_duration``.

    Attributes:
        gait: what is commanded; a copy with targets of its own where the library knows that it may take one.
        parameters: of the governor.
        target: governed targets; those of a commanded gait are its own.
        gap: (4,) a_d − a_r of the body's linear acceleration in the last tick, world axes, m/s², and then 1 where it is
            new. Controllers write it, :meth:`update` reads it and sets the last entry to zero. Without a new gap, or
            where it is not finite, shift and speed stay as they are.
    """

    @checked
    def __init__(self, gait: Gait, parameters: FootholdGovernorParameters | None = None) -> None:
        if isinstance(gait, FlyingGait):
            raise InputError(
                "the governor of the command changes the steps of walks, not flights", name="gait", value=gait
            )
        if not hasattr(gait, "step_duration"):
            message = f"the governor of the command needs the gait's step_duration; {type(gait).__name__} has none"
            raise InputError(message, name="gait", value=gait)
        self.gait: FullGait = own_target(gait)
        self.parameters = p = parameters if parameters is not None else FootholdGovernorParameters()
        self.robot = gait.robot
        self.step_duration, self.double_support = self.gait.step_duration, self.gait.double_support
        self._commanded = self.gait if isinstance(self.gait, CommandedGait) else None
        self.target = GaitTarget() if self._commanded is None else self._commanded.target
        self._given = self.gait.target
        self.gap = np.zeros(4)
        self._record = make_record(
            GovernedRecord,
            **asdict(p),
            step_duration=self.step_duration,
            swing_time=self.step_duration * (1.0 - self.double_support),
        )
        self._state = self._record[0]
        if self._commanded is not None:
            _govern_command.prepare(0.0, self._commanded.record, self._record, self.gap)
        else:
            _govern.prepare(0.0, self._given.record, self._record, self.target.record, self.gap)

    @property
    def held_back(self) -> float:
        """d, the share of the forward speed, or of the whole command, that is held back, 0 to 1."""
        return float(self._state["share"])

    @property
    def shift(self) -> float:
        """s, how far ahead of the gait's the footholds are, m along x, or along the heading of a commanded gait."""
        return float(self._state["shift"])

    @property
    def lag(self) -> float:
        """How far the body's target is behind the gait's, m along x; zero with a commanded gait."""
        return -float(self._state["lag"])

    def update(self, t: float) -> GaitTarget:
        """Governed targets at time t ≥ 0, s; a time before the last one begins a new walk.

        For a commanded gait a clock that jitters does not, see there.

        Args:
            t: time, s.
        """
        if self._commanded is not None:
            _govern_command(t, self._commanded.record, self._record, self.gap)
            return self._commanded.update(t)
        given = self.gait.update(t)
        if given is not self._given:
            self._given = check_target(given, self.robot)
        _govern(t, given.record, self._record, self.target.record, self.gap)
        return self.target

    @property
    def compiled(self) -> CompiledTick | None:
        """Its tick for a compiled loop, where the gait has one."""
        gait: CompiledTick | None = getattr(self.gait, "compiled", None)
        if type(self) is not GovernedGait or gait is None:
            return None
        bent = ("held_back", "foothold_shift")
        if self._commanded is not None:
            parts = (*gait.parts, self._record, self.gap)
            return CompiledTick(_plan_commanded, _note_commanded, parts, (*gait.signals, *bent))
        parts = (gait.act, gait.parts, self.gait.target.record, self._record, self.target.record, self.gap)
        return CompiledTick(_plan, _note, parts, ("x_command", *bent))

    def reset(self) -> None:
        """Forget shift and lag; the next update begins a new walk."""
        self.gap[:] = 0.0
        self._state["time"] = np.inf

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`: the gait's own."""
        return self.gait.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """Parameters of the gait, and of the governor."""
        return {**self.gait.describe(), "command_governor": asdict(self.parameters)}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The commanded reference, or the command and what is applied of it; and what the governor changes."""
        bent = {"held_back": self.held_back, "foothold_shift": self.shift}
        if self._commanded is not None:
            return {**self._commanded.telemetry(), **bent}
        return {"x_command": self._given.body[:6].copy(), **bent}


Parts = tuple[
    Kernel[Any], tuple[Any, ...], Records[GaitTargetRecord], Records[GovernedRecord], Records[GaitTargetRecord], Vector
]
CommandedParts = tuple[Records[CommandedRecord], Records[GaitTargetRecord], Records[GovernedRecord], Vector]


@kernel
def _plan(t: float, parts: Parts) -> bool:
    plan, own, given, governor, target, gap = parts
    if not plan(t, own):
        return False
    _govern(t, given[0], governor[0], target[0], gap)
    return True


@kernel
def _note(parts: Parts, row: Vector, places: NDArray[np.int64], s: int) -> int:
    _, _, given, governor, _, _ = parts
    note_array(given[0].body[:6], row, places[s])
    row[places[s + 1]] = governor[0].share
    row[places[s + 2]] = governor[0].shift
    return s + 3


@kernel
def _plan_commanded(t: float, parts: CommandedParts) -> bool:
    gait, target, governor, gap = parts
    if t < gait[0].time or t >= gait[0].switch:
        return False
    _govern_command(t, gait[0], governor[0], gap)
    return advance(t, gait[0], target[0])


@kernel
def _note_commanded(parts: CommandedParts, row: Vector, places: NDArray[np.int64], s: int) -> int:
    gait, target, governor, _ = parts
    s = note_command((gait, target), row, places, s)
    row[places[s]] = governor[0].share
    row[places[s + 1]] = governor[0].shift
    return s + 2


@kernel
def _govern(t: float, g: GaitTargetRecord, p: GovernedRecord, o: GaitTargetRecord, gap: Vector) -> None:
    """Advance the governor to time t, and write the governed targets."""
    if not t >= p.time:
        _forget(p)
    step = t - p.time if p.time >= 0.0 else 0.0
    p.time = t
    size = np.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
    if gap[3] != 0.0 and size < np.inf:
        _bend(p, step, gap[0], size)
    gap[3] = 0.0
    before = p.lag_velocity
    p.lag_velocity = -p.share * g.body[3]
    p.lag += 0.5 * step * (before + p.lag_velocity)
    copy_target(g, o)
    o.body[0] += p.lag
    o.body[3] += p.lag_velocity
    o.body[6] -= p.share * g.body[6] + p.rate * (p.desired - p.share) * g.body[3]
    for k in range(2):
        _place(k, g, p, o)


@kernel
def _govern_command(t: float, g: CommandedRecord, p: GovernedRecord, gap: Vector) -> None:
    """Advance the governor to time t, and say what is left of a commanded gait's command."""
    if not t >= p.time:
        if t > max(p.time - p.step_duration, 0.0):
            return
        _forget(p)
    step = t - p.time if p.time >= 0.0 else 0.0
    p.time = t
    size = np.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
    if gap[3] != 0.0 and size < np.inf:
        _bend(p, step, np.cos(g.path[2]) * gap[0] + np.sin(g.path[2]) * gap[1], size)
    gap[3] = 0.0
    g.kept, g.shift = 1.0 - p.share, p.shift


@kernel
def _forget(p: GovernedRecord) -> None:
    """Begin a new walk with nothing bent."""
    p.time = -1.0
    p.shift = p.desired = p.share = p.lag = p.lag_velocity = 0.0
    p.in_air[:] = 0.0
    p.foot[:] = 0.0


@kernel
def _bend(p: GovernedRecord, step: float, along: float, size: float) -> None:
    """One implicit step of s, c and d."""
    beyond = min(max(size - p.tolerated, 0.0), p.heard)
    ahead = along * beyond / size if beyond > 0.0 else 0.0
    shift = (p.shift + step * p.shift_response * ahead) / (1.0 + step / p.shift_recovery)
    p.shift = min(max(shift, -p.shift_limit), p.shift_limit)
    take = step * p.response * beyond
    p.desired = (p.desired + take) / (1.0 + take + step / p.recovery)
    follow = step * p.rate
    p.share = (p.share + follow * p.desired) / (1.0 + follow)


@kernel
def _place(k: int, g: GaitTargetRecord, p: GovernedRecord, o: GaitTargetRecord) -> None:
    """Foot k: p.foot is how far its target is ahead of the gait's, in the world."""
    velocity, acceleration = 0.0, 0.0
    if g.stance[k] != 0.0:
        p.in_air[k] = 0.0
    else:
        s = g.phase[k]
        if p.in_air[k] == 0.0:
            p.in_air[k] = 1.0
            p.lift_off[k] = p.foot[k]
            p.landing[k] = p.lag + p.lag_velocity * (1.0 - s) * p.swing_time + p.shift
        way = p.landing[k] - p.lift_off[k]
        p.foot[k] = p.lift_off[k] + way * s * s * s * (10.0 + s * (6.0 * s - 15.0))
        velocity = way * 30.0 * s * s * (1.0 - s) * (1.0 - s) / p.swing_time
        acceleration = way * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (p.swing_time * p.swing_time)
    # Relative to the body's governed target.
    o.foot_position[k, 0] += p.foot[k] - p.lag
    o.foot_velocity[k, 0] += velocity - (o.body[3] - g.body[3])
    o.foot_acceleration[k, 0] += acceleration - (o.body[6] - g.body[6])


@kernel
def note_gap(desired: Vector, given: Vector, rotation: Vector, out: Vector) -> None:
    """What the body's linear acceleration lacks, world axes, for :attr:`GovernedGait.gap`.

    Args:
        desired: (nv,) demanded generalised acceleration; its first three entries in body axes.
        given: (nv,) the one that follows.
        rotation: (3, 3) body to world.
        out: (4,) out; the last entry says that it is new.
    """
    for i in range(3):
        s = 0.0
        for j in range(3):
            s += rotation[i, j] * (desired[j] - given[j])
        out[i] = s
    out[3] = 1.0
