"""What is flown, and how: jumps by legs and thrust, which crouch, push and land, and flights by
thrust alone.

Legs swing when the feet leave the ground. Thrusters that stop their swing push the body aside, so
the push gives the body a velocity that takes most of it back. What is left over is found by a
preview: the equations of motion under the flight's own feedback, from the release until the feet
are at the ground. The jump aims so that these land where they should.
"""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.contrib.flight.airway import SWIFT, Airway, Fall, Quintic, rest
from harpy_pin.contrib.flight.flyer import ABOVE, BEND, LEGS, TOUCHDOWN, Flyer
from harpy_pin.errors import InputError
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.scenario.parts import Part, read_part

CROUCH, RELEASE = 0.22, 0.14
"""How much lower than in standing the body is before the push, and how much higher at its end, in
heights of the body.
"""
PUSH = 0.9  # duration of a push without lag, in √(height / g)
RECOIL = 0.7
"""Share of what the legs' swing will take from the velocity that the push gives in advance."""
TICK, LONGEST = 2e-3, 30.0  # period and longest duration of the preview, s
TRIES, CLOSE, SLOPE = 8, 5e-3, 1.5
"""The search for the aim: how often, how near the feet must land, m, and how far they go per metre
of aim.
"""
HIGHEST, FARTHEST = 100.0, 1e4  # largest height and distance of a flight, m
MAX_FLIGHTS = 100  # of one gait. A jump takes some tenths of a second to plan.


@dataclass(frozen=True, kw_only=True)
class Flight(Part):
    """What every flight has; an :class:`InputError` refuses a value out of its domain.

    By its ``height``, m, the body of a jump rises after the feet have left the ground; the feet of
    a flight are by so much above the higher of the two places. From where they leave the ground to
    where they touch it, the way is ``forward`` and ``left``, m.
    """

    height: float = checks.setting(0.3, low=0.02, high=HIGHEST)
    forward: float = checks.setting(0.0, low=-FARTHEST, high=FARTHEST)
    left: float = checks.setting(0.0, low=-FARTHEST, high=FARTHEST)


@dataclass(frozen=True, kw_only=True)
class Jump(Flight):
    """Legs throw the body up, thrusters carry a part of its weight, brake its fall, and keep it
    upright.

    Attributes:
        carried: share of the weight that thrusters carry until they brake, 0.2 to 0.9.
    """

    name = "jump"
    carried: float = checks.setting(0.5, low=0.2, high=0.9, called="carried share of the weight")


@dataclass(frozen=True, kw_only=True)
class Fly(Flight):
    """Thrusters lift the robot, bring it to another place, hold it there, and set it down.

    Attributes:
        hover: time for which it stays above the place where it lands, s.
        acceleration: largest on the way, m/s².
    """

    name = "fly"
    hover: float = checks.setting(0.0, low=0.0, high=1e6)
    acceleration: float = checks.setting(1.0, low=0.0, high=5.0, strict=True)


def read_flights(name: str, given: Any) -> tuple[Jump | Fly, ...]:
    """One or several flights from themselves, their names, or mappings as :meth:`Part.to_dict`
    makes them.

    Something else, none, or more than :data:`MAX_FLIGHTS` are an :class:`InputError`.
    """
    several = given if isinstance(given, list | tuple) else [given]
    kinds: dict[str, type[Jump | Fly]] = {"jump": Jump, "fly": Fly}
    flights = tuple(read_part(kinds, "flight", one) for one in several)
    if not 0 < len(flights) <= MAX_FLIGHTS:
        raise InputError(
            f"{name} must be at least one Jump or Fly, and at most {MAX_FLIGHTS}",
            name=name,
            value=given,
        )
    return flights


@dataclass(frozen=True)
class PlannedJump:
    """A jump that lands where it should."""

    jump: Jump  # what was asked for
    aim: Vector  # (2,) where the body's way ends, from where it would stand before the jump, m
    across: Vector  # (3,) horizontal velocity of the body at the release, m/s
    speed: float  # upwards, there, m/s


def plan_jump(flyer: Flyer, jump: Jump) -> PlannedJump:
    """The jump of which the feet land where they should; an :class:`InputError` where none does."""
    least = ABOVE - float(flyer.feet[2]) - _release(flyer)
    if jump.height < least:
        raise InputError(
            f"height of a jump of '{flyer.robot.name}' must be at least {least:.2g} m, got "
            f"{jump.height:g} m: "
            "its legs become longer before they land",
            name="height",
            value=jump.height,
        )
    goal = np.array((jump.forward, jump.left))
    aim, slope = goal.copy(), np.full(2, SLOPE)
    last = before = None
    for _ in range(TRIES):
        try:
            plan = _aimed(flyer, jump, aim)
        except InputError:  # the legs do not reach the ground where they would let go of it
            break
        place = _landing(flyer, plan)
        if not np.isfinite(place).all():
            break
        if float(np.linalg.norm(place - goal)) < CLOSE:
            return plan
        if last is not None and before is not None:
            moved = aim - last
            far = np.abs(moved) > 1e-3
            slope[far] = np.clip((place - before)[far] / moved[far], 0.5, 3.0)
        last, before = aim, place
        aim = aim + (goal - place) / slope
    what = (
        f"{jump.forward:g} m forward and {jump.left:g} m to the left at a height of "
        f"{jump.height:g} m"
    )
    raise InputError(
        f"a jump of {what} is too far: no push brings the feet there", name="flights", value=jump
    )


def _aimed(flyer: Flyer, jump: Jump, aim: Vector) -> PlannedJump:
    """The jump with an aim."""
    speed = sqrt(2.0 * (1.0 - jump.carried) * GRAVITY * jump.height)
    time = _fall(flyer, jump, _release(flyer), speed, 0.0).free + 0.5 * _push(flyer)
    desired = np.append(aim + (flyer.over - flyer.feet)[:2], 0.0) / time
    across = desired
    for _ in range(3):
        across = desired - RECOIL * flyer.postures.recoil(*_leaving(flyer, across, speed))
    return PlannedJump(jump, aim, across, speed)


def _push(flyer: Flyer) -> float:
    """Duration of a push, s: thrusts need their time."""
    return PUSH * flyer.scale + flyer.lag


def _release(flyer: Flyer) -> float:
    """Height of the body above the feet at the release, m."""
    return -float(flyer.stand[2]) + RELEASE * flyer.height


def _leaving(flyer: Flyer, across: Vector, speed: float) -> tuple[Vector, Vector]:
    """Configuration and velocity at the release, with the feet about the origin."""
    body = -flyer.over + 0.5 * _push(flyer) * across
    body[2] = _release(flyer)
    q, v = flyer.postures.on_feet(
        flyer.postures.feet - flyer.stand - body, np.append(across[:2], speed)
    )
    q[:3] = body
    return q, v


def _landing(flyer: Flyer, plan: PlannedJump) -> Vector:
    """(2,) where the middle of the feet comes to the ground, from where it left it; not finite
    where it does not.
    """
    q, v = _leaving(flyer, plan.across, plan.speed)
    body, joints = np.vstack((q[:3], v[:3])), np.vstack((q[7:], v[6:]))
    airway = fly_jump(flyer, plan, body, joints, np.zeros(3), 0.0)
    places = flyer.balance.dynamics.foot_position
    t = 0.0
    while t < LONGEST and np.abs(v).max() < 100.0:
        v = v + TICK * airway.acceleration(t, q, v, flyer.balance)
        if t > airway.sinks and places[:, 2].min() <= 0.0:
            return np.array(places.mean(axis=0)[:2])
        q = flyer.robot.integrate(q, TICK * v)
        t += TICK
    return np.full(2, np.nan)


def crouch_and_push(
    flyer: Flyer, plan: PlannedJump, feet: Vector
) -> tuple[Quintic, Quintic | None]:
    """From standing with the middle of the feet at a place (3,), m, into the crouch; then the push
    to the release.
    """
    duration = _push(flyer)
    above = feet - flyer.over
    low = above - 0.5 * duration * plan.across
    high = above + 0.5 * duration * plan.across
    low[2] -= CROUCH * flyer.height
    high[2] += RELEASE * flyer.height
    fall = (0.0, 0.0, (plan.jump.carried - 1.0) * GRAVITY)
    release = np.vstack((high, np.append(plan.across[:2], plan.speed), fall))
    bend = Quintic(rest(feet - flyer.stand), rest(low), BEND * flyer.scale)
    return bend, Quintic(rest(low), release, duration)


def fly_jump(
    flyer: Flyer, plan: PlannedJump, body: Vector, joints: Vector, feet: Vector, ground: float
) -> Airway:
    """From the release to touchdown.

    The body (2, 3) and the joints (2, n) have their places and velocities of the release. The
    middle of the feet (3,) was on the ground before, and ``ground`` is the height where they land,
    m.
    """
    fall = _fall(flyer, plan.jump, float(body[0, 2]), float(body[1, 2]), ground)
    end = (feet - flyer.feet)[:2] + plan.aim
    over = Quintic(np.vstack((body[:, :2], np.zeros(2))), rest(end), fall.free + fall.braked)
    loads = (
        (fall.free, plan.jump.carried),
        (fall.free + fall.braked, 1.0 + flyer.brake / GRAVITY),
        (inf, 1.0),
    )
    gains = tuple((until, flyer.gain(weight)) for until, weight in loads)
    return Airway((over,), fall, flyer.legs(joints, min(LEGS, fall.free)), gains, fall.free)


def _fall(flyer: Flyer, jump: Jump, height: float, speed: float, ground: float) -> Fall:
    """The body's height after the release."""
    end = ground + ABOVE - float(flyer.feet[2])
    return Fall(
        height, speed, end, TOUCHDOWN, flyer.brake, (1.0 - jump.carried) * GRAVITY, flyer.lag
    )


SHORTEST = 0.4  # shortest duration of a way, s


def stretch(flyer: Flyer, feet: Vector) -> tuple[Quintic, Quintic | None]:
    """Legs become as long as in the air; the centre of mass comes where thrusters can carry it.
    There is no push.
    """
    return Quintic(
        rest(feet - flyer.stand), rest(feet - flyer.feet), 2.0 * BEND * flyer.scale
    ), None


def lift(flyer: Flyer, flight: Fly, joints: Vector, feet: Vector, ground: float) -> Airway:
    """From lift-off, with angles and rates of the joints (2, n), to touchdown; see
    :func:`fly_jump`.
    """
    begin = feet - flyer.feet
    top = max(float(feet[2]), ground) + flight.height - float(flyer.feet[2])
    end = np.array((ground + ABOVE - float(flyer.feet[2]),))
    above, slow = np.array((top,)), np.array(((0.0,), (-TOUCHDOWN,), (0.0,)))
    over = _swift(
        begin[:2], begin[:2] + np.array((flight.forward, flight.left)), flight.acceleration
    )
    up = _swift(begin[2:], above, flyer.brake)
    slow[0] = end
    down = Quintic(rest(above), slow, _swift(above, end, 0.5 * flyer.brake).duration)
    heights = (up, _stay(above, over.duration + flight.hover), down)
    legs = flyer.legs(joints, LEGS)
    sinks = up.duration + heights[1].duration + 0.5 * down.duration
    return Airway(
        (_stay(begin[:2], up.duration), over), heights, legs, ((inf, flyer.gain(1.0)),), sinks
    )


def _stay(place: Vector, duration: float) -> Quintic:
    return Quintic(rest(place), rest(place), duration)


def _swift(begin: Vector, end: Vector, acceleration: float) -> Quintic:
    """From rest to rest with so much acceleration at most."""
    way = float(np.linalg.norm(end - begin))
    return Quintic(rest(begin), rest(end), max(sqrt(SWIFT * way / acceleration), SHORTEST))
