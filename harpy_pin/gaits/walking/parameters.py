"""Every tuned number of :class:`~harpy_pin.gaits.walking.WalkingGait`: unit, meaning and source.

What is no tuning, such as tolerances and peaks of motions, stands beside its formula.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any

from harpy_pin import checks
from harpy_pin.model.record import RecordOf, Records, make_record

LEG, RISE, BODY = "lengths of the leg", "heights of the centre of mass", "heights of the body"
NATURAL = "√(leg / g)"  # unit of times
FROUDE = "√(g leg)"  # of velocities
CHOICE = "a choice"
BOUND = "a bound, which the meaning says"
WALKS = "by hand, on walks of the catalogue's robots"
FAST = "by hand, on trots up to 2 m/s"
LANDING = "by hand, on trots, paces and bounds whose feet slip where they land hard"
POINTS = "by hand, on walks and pushes of Bolt"
SOLES = "by hand, on walks of G1, Talos and iCub"
PUSHED = "by hand, on pushes of G1, Talos and iCub"
SLIPPERY = "by hand, on soles at friction 0.05 to 0.2"
STAIRS = "by hand, on Go2 over stairs"
UNKNOWN = "by hand, on steps and bumps that the gait does not know"


def number(
    value: float, unit: str, meaning: str, source: str, *, high: float = inf, zero: bool = False
) -> Any:
    """A parameter: above zero, or at it where that has a meaning, and at most ``high``."""
    metadata = {"unit": unit, "meaning": meaning, "source": source, "high": high, "zero": zero}
    return field(default=value, metadata=metadata)


def share(
    value: float, of: str, meaning: str, source: str, *, high: float = 1.0, zero: bool = False
) -> Any:
    """A parameter that is a share of something, at most all of it."""
    return number(value, f"share of {of}", meaning, source, high=high, zero=zero)


@dataclass(frozen=True, kw_only=True)
class WalkingParameters:
    """The tuned numbers of a walk; ``dataclasses.fields`` gives unit, meaning and source of each as
    its ``metadata``.

    Raises:
        InputError: a number out of its domain, by name.
    """

    # How the body is held, and where feet stand
    hip_height: float = share(
        0.92, "the leg", "largest height of the hip while it walks, on points", WALKS
    )
    sole_hip_height: float = share(0.9, "the leg", "the same on soles", SOLES, high=0.99)
    stretch: float = share(0.98, "the leg", "largest distance from hip to foot, on points", WALKS)
    sole_stretch: float = share(0.965, "the leg", "the same on soles", PUSHED)
    narrow: float = number(
        0.27,
        RISE,
        "largest distance of the two centres of pressure between which the body sways, on points: "
        "a pendulum needs half of it as friction",
        BOUND,
    )
    sole_narrow: float = number(0.15, RISE, "the same on soles", SOLES)
    inner: float = share(
        0.35,
        "the width of a sole",
        "how far the centre of pressure may come towards the other foot from its middle",
        SOLES,
        high=0.5,
        zero=True,
    )
    sway: float = number(
        0.01, RISE, "distance of two groups of feet below which the body does not sway", CHOICE
    )
    apart: float = share(
        0.4,
        "the distance of two feet when standing",
        "least distance in the direction in which they stand apart",
        WALKS,
    )
    clear: float = number(0.01, "m", "least gap between two soles", CHOICE, zero=True)

    # How long steps last, and how far they go
    step: float = number(0.82, NATURAL, "duration of a step on points", WALKS)
    sole_step: float = number(1.7, NATURAL, "the same on soles, slow", SOLES)
    fast_sole_step: float = number(1.25, NATURAL, "the same at the largest speed", SOLES)
    weak_step: float = number(
        15.5,
        "√(g leg) over the acceleration that the motors give a foot",
        "least duration of a step of heavy legs with weak motors",
        WALKS,
    )
    stride: float = number(0.6, LEG, "longest way of a step", FAST)
    start: float = number(
        1.6,
        NATURAL,
        "time for which it stands on every foot before the first step",
        WALKS,
        zero=True,
    )
    double_support: float = share(
        0.05, "a step", "in which every foot is on the ground, on four feet", WALKS, high=0.9
    )
    slow_double_support: float = share(
        0.2,
        "a step",
        "the same of four feet that hardly walk: soft ground hardly moves feet to which the load "
        "goes over slowly",
        LANDING,
        high=0.9,
    )
    point_double_support: float = share(0.1, "a step", "the same on two points", POINTS, high=0.9)
    sole_double_support: float = share(0.15, "a step", "the same on soles", SOLES, high=0.9)
    max_haste: float = number(
        2.0, "", "how much faster than its clock a step goes on at most, on points", POINTS
    )
    max_sole_haste: float = number(1.6, "", "the same on soles", PUSHED)
    longest_wait: float = share(
        0.5, "a step", "how long the next step waits for a foot that has not landed", WALKS
    )
    longest_terrain_wait: float = share(
        1.0, "a step", "the same on ground that is not flat", UNKNOWN
    )

    # How fast the robot walks
    trot_speed: float = number(
        0.8,
        FROUDE,
        "largest velocity of a foot's place where two groups of point feet on four or more legs "
        "take turns",
        FAST,
    )
    point_speed: float = number(0.65, FROUDE, "the same on other points", WALKS)
    sole_speed: float = number(0.26, FROUDE, "the same on four soles", SOLES)
    rolling_speed: float = number(0.33, FROUDE, "the same on two soles, which roll", SOLES)
    sole_aside: float = number(0.117, FROUDE, "largest velocity sideways on two soles", SOLES)
    sole_shift: float = number(
        0.012,
        "m",
        "how far a change of velocity to the side may move a foothold of two soles towards the "
        "other foot: beyond, it would have to land on that",
        SOLES,
    )
    acceleration: float = number(
        1.0, "m/s²", "largest change of the applied velocity, and so of its direction", CHOICE
    )
    turn_acceleration: float = number(
        3.0, "rad/s²", "largest change of the applied turning velocity", CHOICE
    )
    max_turn: float = number(2.0, "rad/s", "largest turning velocity", CHOICE)
    height_speed: float = number(0.5, f"{BODY} per s", "largest velocity of the height", CHOICE)
    max_lower: float = share(0.2, "the body's height", "which it may go down on command", WALKS)
    max_higher: float = share(0.05, "the body's height", "which it may go up", WALKS)
    reach_used: float = share(
        0.75,
        "the reach that is left where feet are drawn together",
        "which is used: a stretched leg cannot push",
        WALKS,
    )
    knee_torque: float = share(
        0.62,
        "a knee's torque",
        "which the weight may need on two soles; with more, less of the reach is used",
        SOLES,
    )
    max_push: float = number(
        0.25, "g", "largest acceleration of the body by legs that are swung", FAST
    )
    free_push: float = number(
        0.22, "g", "the same from which on motors swing legs with less of their torques", FAST
    )
    swing_torque: float = share(
        0.85, "its limit", "largest torque of a leg that swings in a trot, pace or bound", FAST
    )
    lift_torque: float = number(
        1.1,
        "the torque for lifting a foot",
        "the same in a walk in which lifting a foot takes more than all of it",
        POINTS,
    )

    # Friction that the controller assumes, on soles
    full_grip: float = number(
        0.6, "", "friction coefficient from which on it walks at its largest speed", SOLES
    )
    slowest: float = number(0.07, FROUDE, "largest speed at any friction below", SLIPPERY)
    firm: float = number(
        0.2, "", "friction coefficient from which on it steps as on firm ground", SLIPPERY
    )
    slippery: float = number(
        0.1, "", "the same below which it sways least and hands over fastest", SLIPPERY
    )
    slippery_gap: float = number(0.025, "m", "there: distance between the two soles", SLIPPERY)
    slippery_double_support: float = share(
        0.05, "a step", "there: in which both are on the ground", SLIPPERY, high=0.9
    )

    # The path, and the way back to it
    path_range: float = number(
        0.25,
        BODY,
        "how far the path may be from the centre of mass: pushes are not walked back",
        WALKS,
    )
    heading_range: float = number(
        0.3, "rad", "how far the path's heading may be from the body's", WALKS
    )
    path_return: float = number(
        2.0, "1/s", "velocity back to the path, over the distance to it", WALKS, zero=True
    )
    max_path_return: float = number(0.05, f"ω {BODY}", "largest velocity back to the path", WALKS)

    # The acceleration of the body
    velocity_gain: float = number(
        1.1, "ω", "gain of the centre of mass's velocity", WALKS, zero=True
    )
    place_gain: float = number(
        0.7, "ω²", "gain of its place while the robot stands", WALKS, zero=True
    )
    cycle_gain: float = number(
        1.0, "ω", "gain of the divergent component towards an endless walk's", WALKS, zero=True
    )
    height_gain: float = number(60.0, "1/s²", "gain of the body's height", WALKS, zero=True)
    height_damping: float = number(15.0, "1/s", "gain of its velocity", WALKS, zero=True)
    max_demand: float = number(
        3.0, "m/s²", "largest acceleration that velocity and place ask for", WALKS
    )
    sole_margin: float = share(
        0.3, "a sole from its edge to its middle", "where the centre of pressure does not go", WALKS
    )
    least_sole_margin: float = share(
        0.05, "a sole", "the same of a robot that has been pushed", PUSHED, zero=True
    )
    margin_gain: float = number(
        2.0,
        f"1 / {BODY}",
        "how fast that margin falls with the distance of the centre of pressure from where it "
        "should be",
        PUSHED,
        zero=True,
    )
    beyond: float = share(
        0.5,
        "what a centre of pressure beyond the soles would push more",
        "which is demanded, too: the turning of body, torso and arms pays for it",
        PUSHED,
        zero=True,
    )
    max_beyond: float = number(0.5, BODY, "farthest such centre of pressure", PUSHED, zero=True)
    stretch_ahead: float = number(
        0.1, "s", "how far ahead legs on soles must not be stretched", PUSHED, zero=True
    )
    lowering_rate: float = number(
        20.0, "1/s", "rate at which the body goes down where one would be", PUSHED, zero=True
    )

    # The load of the feet
    load_filter: float = share(
        0.5, "the last sample", "in the load of a foot: noise must not look like a touchdown", WALKS
    )
    load_ramp: float = share(
        0.26,
        "its largest normal force",
        "up to which a foot of a slow trot or pace is loaded that is about to take over its part, "
        "or begins to give it away; in other walks, all of it",
        LANDING,
    )
    fast_load_ramp: float = share(
        0.4, "its largest normal force", "the same at the largest speed", FAST
    )
    first_load: float = share(
        0.07,
        "its largest normal force",
        "up to which a foot of a trot or pace may be loaded that has just landed",
        LANDING,
    )
    last_load: float = share(
        0.01, "its largest normal force", "the same that is about to be lifted", LANDING
    )
    least_load: float = share(0.05, "its largest normal force", "both in other walks", LANDING)
    upset: float = number(
        2.0,
        "",
        "how much an undesired velocity counts, beside a commanded one, in how fast the load "
        "goes over",
        LANDING,
        zero=True,
    )

    # Steps: when feet have landed, and when the walk ends
    earliest: float = share(
        0.6, "its swing", "from which on a foot that is loaded has landed", WALKS
    )
    touch_force: float = share(
        0.03, "a foot's load when standing", "from which on it touches the ground", WALKS
    )
    min_touch_force: float = number(0.6, "N", "the same at least", WALKS)
    blocked: float = number(
        0.005,
        BODY,
        "how far above where it should be a late foot is that rests on the ground",
        WALKS,
    )
    resting_force: float = share(
        0.3,
        "the force from which on a foot touches",
        "load of such a foot: one that comes down slowly pushes hardly more",
        WALKS,
    )
    uneven: float = number(
        0.03, BODY, "how far from the expected height a point meets ground that is uneven", UNKNOWN
    )
    sole_uneven: float = number(
        0.01, BODY, "the same of a sole, which spoils the sway where it lands late", UNKNOWN
    )
    averaged: float = share(
        0.05, "a step", "over which height and load of a foot that has landed are averaged", UNKNOWN
    )
    settling: float = share(
        0.1, "a step", "after which they say where the ground is", UNKNOWN, zero=True
    )
    pressed: float = share(
        0.7, "the force from which on a foot touches", "load from which on they do", UNKNOWN
    )
    rebound: float = number(
        0.005,
        BODY,
        "how far above the place where it touched a foot still touches",
        UNKNOWN,
        zero=True,
    )
    lean: float = number(
        0.45,
        RISE,
        "distance of the centre of mass from a single point foot at which the next one should "
        "land: the friction that it needs",
        BOUND,
    )
    steepest: float = number(0.5, RISE, "largest distance of a foothold on two points", BOUND)
    missed: float = number(
        0.01, BODY, "how far from where it must land a foot on a sole may land in time", SOLES
    )
    outside: float = number(
        0.02, BODY, "how far outside of the feet the capture point is for a step", WALKS, zero=True
    )
    at_rest: float = number(
        0.03, f"ω {BODY}", "velocity of the centre of mass below which the walk may end", WALKS
    )
    in_place: float = number(
        0.06, BODY, "how far a foot may be from where it stands for the walk to end", WALKS
    )

    # Footholds
    frozen: float = share(
        0.25,
        "a step",
        "before its end, from which on footholds stay where they are",
        WALKS,
        zero=True,
    )
    early_frozen: float = share(
        0.4, "a step", "the same where feet step over the ground", STAIRS, zero=True
    )

    # The way of a swing foot
    clearance: float = number(0.075, LEG, "height of a foot at mid-swing", WALKS)
    penetration_offset: float = number(
        0.0015, "m", "how much deeper than the ground a swing foot aims", WALKS, zero=True
    )
    settle: float = share(
        0.9,
        "its swing",
        "after which a foot is at the ground and goes down slowly",
        LANDING,
        high=0.99,
    )
    low: float = number(
        0.02,
        "clearances",
        "height from which on a foot of a trot or pace goes down slowly: one that lands hard "
        "slips, because the inertia of its leg turns it aside",
        LANDING,
    )
    aim: float = share(
        0.2, "the penetration offset", "how far below the ground it then aims", LANDING, zero=True
    )
    upright_end: float = share(
        0.1, "its swing", "least, at the end, in which a foot moves vertically", WALKS, high=0.9
    )
    near: float = share(
        0.166,
        "its swing",
        "at the end, in which a foot that goes down slowly is nearer to the ground than 5 % of its "
        "clearance",
        BOUND,
        high=0.9,
    )
    straight_near: float = share(
        0.185, "its swing", "the same of other feet, nearer than 4 %", BOUND, high=0.9
    )
    stuck: float = share(
        0.03, "its swing", "least in which a foot that is in the ground goes straight up", LANDING
    )
    out: float = share(
        0.12, "its swing", "after which a foot has left ground that gives way", LANDING
    )
    creep: float = number(
        0.14, f"ω {BODY}", "largest horizontal velocity of a foot near the ground", LANDING
    )
    descent: float = number(
        0.3, "m/s", "velocity at which a foot goes on down that has not met the ground", WALKS
    )
    deepest: float = number(0.25, BODY, "how far below the ground it is searched for", UNKNOWN)
    start_across: float = share(
        0.2, "its swing", "at which a foot over steps begins to move across", STAIRS, high=0.9
    )
    apex: float = share(0.4, "its swing", "at which it is at its highest", STAIRS)
    sink: float = share(0.5, "its swing", "at which it begins to sink", STAIRS)
    end_across: float = share(0.7, "its swing", "at which it ends to move across", STAIRS)
    landed: float = share(0.9, "its swing", "at which it is at the ground", STAIRS)
    least_phase: float = share(
        0.1, "its swing", "that it has at least for what is left of one of these", STAIRS
    )
    longest_way: float = number(
        0.68, BODY, "way of a foot on which it steps over what is higher", STAIRS
    )
    lift_acceleration: float = number(
        80.0, "m/s²", "largest acceleration of a foot on its way up", STAIRS
    )

    # How soles roll
    roll: float = number(
        0.9, f"rad per {LEG}", "largest pitch of a sole over the way of a step", SOLES, zero=True
    )
    flat_roll: float = number(
        0.05, "rad", "less this: a sole stays flat on a short step", SOLES, zero=True
    )
    max_roll: float = number(0.6, "rad", "largest pitch of all", SOLES, zero=True)
    roll_begin: float = share(
        0.3,
        "the double support",
        "at which the pitch begins, until which the other edge is unloaded",
        SOLES,
        high=0.99,
    )
    roll_end: float = share(0.6, "the swing", "at which the pitch ends", SOLES)

    def __post_init__(self) -> None:
        for one in fields(self):
            strict, high = not one.metadata["zero"], one.metadata["high"]
            value = checks.number(
                one.name, getattr(self, one.name), low=0.0, high=high, strict=strict
            )
            checks.keep(self, **{one.name: value})
        checks.number("slippery", self.slippery, low=0.0, high=0.99 * self.firm)


class TunedRecord(RecordOf, WalkingParameters):
    """The numbers of :class:`WalkingParameters`."""


def parameters_of(given: WalkingParameters | Mapping[str, Any] | None) -> WalkingParameters:
    """The parameters that are given, or the defaults with the numbers that are given by name.

    Raises:
        InputError: an unknown name, or a number out of its domain.
    """
    if isinstance(given, WalkingParameters):
        return given
    changes = {} if given is None else checks.mapping("parameters", given)
    for name in changes:
        checks.one_of("parameter", name, (one.name for one in fields(WalkingParameters)))
    return WalkingParameters(**changes)


def changed(w: WalkingParameters) -> dict[str, float]:
    """The numbers that are not the defaults, by name."""
    return {one.name: n for one in fields(w) if (n := getattr(w, one.name)) != one.default}


def tuned_record(w: WalkingParameters) -> Records[TunedRecord]:
    """The numbers for kernels."""
    return make_record(TunedRecord, **vars(w))
