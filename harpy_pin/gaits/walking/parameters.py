"""Every tuned number of :class:`~harpy_pin.gaits.walking.WalkingGait`: unit, meaning and source.

What is no tuning, such as tolerances and peaks of motions, stands beside its formula.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

from harpy_pin import checks
from harpy_pin.model.record import RecordOf

positive = partial(checks.setting, low=0.0, high=1e6, strict=True)
not_negative = partial(checks.setting, low=0.0, high=1e6)
share = partial(checks.setting, low=0.0, high=1.0, strict=True)
share_or_none = partial(checks.setting, low=0.0, high=1.0)
part = partial(checks.setting, low=0.0, high=0.99, strict=True)
"""A share that leaves something."""


@dataclass(frozen=True, kw_only=True)
class WalkingParameters(checks.Checked):
    """The tuned numbers of a walk: what each is [its unit; its source].

    Leg, rise, body: lengths of the leg, heights of the centre of mass and of the body. Sources are
    choices, bounds that the text says, or tuning by hand: on *walks* of the catalogue's robots, on
    *fast* trots up to 2 m/s, on trots, paces and bounds whose feet slip at *landing*, on *points*
    (Bolt, also pushed), on *soles* (G1, Talos, iCub) that walk, are *pushed* or stand on *slippery*
    ground (friction 0.05 to 0.2), on Go2 over *stairs*, and on *unknown* steps and bumps.

    Attributes:
        hip_height: largest height of the hip while it walks, on points [share of the leg; walks].
        sole_hip_height: the same on soles [share of the leg; soles].
        stretch: largest distance from hip to foot, on points [share of the leg; walks].
        sole_stretch: the same on soles [share of the leg; pushed].
        narrow: largest distance of the two centres of pressure between which the body sways, on
            points: a pendulum needs half of it as friction [rise; bound].
        sole_narrow: the same on soles [rise; soles].
        inner: how far the centre of pressure may come towards the other foot from its middle [share
            of the width of a sole; soles].
        sway: distance of two groups of feet below which the body does not sway [rise; choice].
        apart: least distance in the direction in which they stand apart [share of the distance of
            two feet when standing; walks].
        clear: least gap between two soles [m; choice].
        step: duration of a step on points [√(leg / g); walks].
        sole_step: the same on soles, slow [√(leg / g); soles].
        fast_sole_step: the same at the largest speed [√(leg / g); soles].
        weak_step: least duration of a step of heavy legs with weak motors [√(g leg) over the
            acceleration that the motors give a foot; walks].
        stride: longest way of a step [leg; fast].
        start: time for which it stands on every foot before the first step [√(leg / g); walks].
        double_support: share of a step in which every foot is on the ground, on four feet [share;
            walks].
        slow_double_support: the same of four feet that hardly walk: soft ground hardly moves feet
            to which the load goes over slowly [share of a step; landing].
        point_double_support: the same on two points [share of a step; points].
        sole_double_support: the same on soles [share of a step; soles].
        max_haste: how much faster than its clock a step goes on at most, on points [1; points].
        max_sole_haste: the same on soles [1; pushed].
        longest_wait: how long the next step waits for a foot that has not landed [share of a step;
            walks].
        longest_terrain_wait: the same on ground that is not flat [share of a step; unknown].
        trot_speed: largest velocity of a foot's place where two groups of point feet on four or
            more legs take turns [√(g leg); fast].
        point_speed: the same on other points [√(g leg); walks].
        sole_speed: the same on four soles [√(g leg); soles].
        rolling_speed: the same on two soles, which roll [√(g leg); soles].
        sole_aside: largest velocity sideways on two soles [√(g leg); soles].
        sole_shift: how far a change of velocity to the side may move a foothold of two soles
            towards the other foot: beyond, it would have to land on that [m; soles].
        acceleration: largest change of the applied velocity, and so of its direction [m/s²;
            choice].
        turn_acceleration: largest change of the applied turning velocity [rad/s²; choice].
        max_turn: largest turning velocity [rad/s; choice].
        height_speed: largest velocity of the height [body per s; choice].
        max_lower: share of the body's height which it may go down on command [share; walks].
        max_higher: share of the body's height which it may go up [share; walks].
        reach_used: share of the reach that is left where feet are drawn together, which is used: a
            stretched leg cannot push [share; walks].
        knee_torque: share of a knee's torque which the weight may need on two soles; with more,
            less of the reach is used [share; soles].
        max_push: largest acceleration of the body by legs that are swung [g; fast].
        free_push: the same from which on motors swing legs with less of their torques [g; fast].
        swing_torque: largest torque of a leg that swings in a trot, pace or bound [share of its
            limit; fast].
        lift_torque: the same in a walk in which lifting a foot takes more than all of it [the
            torque for lifting a foot; points].
        full_grip: friction coefficient from which on it walks at its largest speed [1; soles].
        slowest: largest speed at any friction below [√(g leg); slippery].
        firm: friction coefficient from which on it steps as on firm ground [1; slippery].
        slippery: the same below which it sways least and hands over fastest [1; slippery].
        slippery_gap: there: distance between the two soles [m; slippery].
        slippery_double_support: there: share of a step in which both are on the ground [share;
            slippery].
        path_range: how far the path may be from the centre of mass: pushes are not walked back
            [body; walks].
        heading_range: how far the path's heading may be from the body's [rad; walks].
        path_return: velocity back to the path, over the distance to it [1/s; walks].
        max_path_return: largest velocity back to the path [ω body; walks].
        velocity_gain: gain of the centre of mass's velocity [ω; walks].
        place_gain: gain of its place while the robot stands [ω²; walks].
        cycle_gain: gain of the divergent component towards an endless walk's [ω; walks].
        height_gain: gain of the body's height [1/s²; walks].
        height_damping: gain of its velocity [1/s; walks].
        max_demand: largest acceleration that velocity and place ask for [m/s²; walks].
        sole_margin: share of a sole from its edge to its middle, where the centre of pressure does
            not go [share; walks].
        least_sole_margin: the same of a robot that has been pushed [share of a sole; pushed].
        margin_gain: how fast that margin falls with the distance of the centre of pressure from
            where it should be [1/body; pushed].
        beyond: share of what a centre of pressure beyond the soles would push more, which is
            demanded, too: the turning of body, torso and arms pays for it [share; pushed].
        max_beyond: farthest such centre of pressure [body; pushed].
        stretch_ahead: how far ahead legs on soles must not be stretched [s; pushed].
        lowering_rate: rate at which the body goes down where one would be [1/s; pushed].
        load_filter: share of the last sample in the load of a foot: noise must not look like a
            touchdown [share; walks].
        load_ramp: share of its largest normal force up to which a foot of a slow trot or pace is
            loaded that is about to take over its part, or begins to give it away; in other walks,
            all of it [share; landing].
        fast_load_ramp: the same at the largest speed [share of its largest normal force; fast].
        first_load: share of its largest normal force up to which a foot of a trot or pace may be
            loaded that has just landed [share; landing].
        last_load: the same that is about to be lifted [share of its largest normal force; landing].
        least_load: both in other walks [share of its largest normal force; landing].
        upset: how much an undesired velocity counts, beside a commanded one, in how fast the load
            goes over [1; landing].
        earliest: share of its swing from which on a foot that is loaded has landed [share; walks].
        touch_force: share of a foot's load when standing, from which on it touches the ground
            [share; walks].
        min_touch_force: the same at least [N; walks].
        blocked: how far above where it should be a late foot is that rests on the ground [body;
            walks].
        resting_force: load of such a foot: one that comes down slowly pushes hardly more [share of
            the force from which on a foot touches; walks].
        uneven: how far from the expected height a point meets ground that is uneven [body;
            unknown].
        sole_uneven: the same of a sole, which spoils the sway where it lands late [body; unknown].
        averaged: share of a step over which height and load of a foot that has landed are averaged
            [share; unknown].
        settling: share of a step after which they say where the ground is [share; unknown].
        pressed: load from which on they do [share of the force from which on a foot touches;
            unknown].
        rebound: how far above the place where it touched a foot still touches [body; unknown].
        lean: distance of the centre of mass from a single point foot at which the next one should
            land: the friction that it needs [rise; bound].
        steepest: largest distance of a foothold on two points [rise; bound].
        missed: how far from where it must land a foot on a sole may land in time [body; soles].
        outside: how far outside of the feet the capture point is for a step [body; walks].
        at_rest: velocity of the centre of mass below which the walk may end [ω body; walks].
        in_place: how far a foot may be from where it stands for the walk to end [body; walks].
        frozen: share of a step before its end, from which on footholds stay where they are [share;
            walks].
        early_frozen: the same where feet step over the ground [share of a step; stairs].
        clearance: height of a foot at mid-swing [leg; walks].
        penetration_offset: how much deeper than the ground a swing foot aims [m; walks].
        settle: share of its swing after which a foot is at the ground and goes down slowly [share;
            landing].
        low: height from which on a foot of a trot or pace goes down slowly: one that lands hard
            slips, because the inertia of its leg turns it aside [clearances; landing].
        aim: how far below the ground it then aims [share of the penetration offset; landing].
        upright_end: least share of its swing, at the end, in which a foot moves vertically [share;
            walks].
        near: share of its swing at the end, in which a foot that goes down slowly is nearer to the
            ground than 5 % of its clearance [share; bound].
        straight_near: the same of other feet, nearer than 4 % [share of its swing; bound].
        stuck: least share of its swing in which a foot that is in the ground goes straight up
            [share; landing].
        out: share of its swing after which a foot has left ground that gives way [share; landing].
        creep: largest horizontal velocity of a foot near the ground [ω body; landing].
        descent: velocity at which a foot goes on down that has not met the ground [m/s; walks].
        deepest: how far below the ground it is searched for [body; unknown].
        start_across: share of its swing at which a foot over steps begins to move across [share;
            stairs].
        apex: share of its swing at which it is at its highest [share; stairs].
        sink: share of its swing at which it begins to sink [share; stairs].
        end_across: share of its swing at which it ends to move across [share; stairs].
        landed: share of its swing at which it is at the ground [share; stairs].
        least_phase: share of its swing that it has at least for what is left of one of these
            [share; stairs].
        longest_way: way of a foot on which it steps over what is higher [body; stairs].
        lift_acceleration: largest acceleration of a foot on its way up [m/s²; stairs].
        roll: largest pitch of a sole over the way of a step [rad per leg; soles].
        flat_roll: less this: a sole stays flat on a short step [rad; soles].
        max_roll: largest pitch of all [rad; soles].
        roll_begin: share of the double support at which the pitch begins, until which the other
            edge is unloaded [share; soles].
        roll_end: share of the swing at which the pitch ends [share; soles].

    Raises:
        InputError: a number out of its domain, by name.
    """

    # How the body is held, and where feet stand
    hip_height: float = share(0.92)
    sole_hip_height: float = part(0.9)
    stretch: float = share(0.98)
    sole_stretch: float = share(0.965)
    narrow: float = positive(0.27)
    sole_narrow: float = positive(0.15)
    inner: float = share_or_none(0.35)
    sway: float = positive(0.01)
    apart: float = share(0.4)
    clear: float = not_negative(0.01)

    # How long steps last, and how far they go
    step: float = positive(0.82)
    sole_step: float = positive(1.7)
    fast_sole_step: float = positive(1.25)
    weak_step: float = positive(15.5)
    stride: float = positive(0.6)
    start: float = not_negative(1.6)
    double_support: float = part(0.05)
    slow_double_support: float = part(0.2)
    point_double_support: float = part(0.1)
    sole_double_support: float = part(0.15)
    max_haste: float = positive(2.0)
    max_sole_haste: float = positive(1.6)
    longest_wait: float = share(0.5)
    longest_terrain_wait: float = share(1.0)

    # How fast the robot walks
    trot_speed: float = positive(0.8)
    point_speed: float = positive(0.65)
    sole_speed: float = positive(0.26)
    rolling_speed: float = positive(0.33)
    sole_aside: float = positive(0.117)
    sole_shift: float = positive(0.012)
    acceleration: float = positive(1.0)
    turn_acceleration: float = positive(3.0)
    max_turn: float = positive(2.0)
    height_speed: float = positive(0.5)
    max_lower: float = share(0.2)
    max_higher: float = share(0.05)
    reach_used: float = share(0.75)
    knee_torque: float = share(0.62)
    max_push: float = positive(0.25)
    free_push: float = positive(0.22)
    swing_torque: float = share(0.85)
    lift_torque: float = positive(1.1)

    # Friction that the controller assumes, on soles
    full_grip: float = positive(0.6)
    slowest: float = positive(0.07)
    firm: float = positive(0.2)
    slippery: float = positive(0.1)
    slippery_gap: float = positive(0.025)
    slippery_double_support: float = part(0.05)

    # The path, and the way back to it
    path_range: float = positive(0.25)
    heading_range: float = positive(0.3)
    path_return: float = not_negative(2.0)
    max_path_return: float = positive(0.05)

    # The acceleration of the body
    velocity_gain: float = not_negative(1.1)
    place_gain: float = not_negative(0.7)
    cycle_gain: float = not_negative(1.0)
    height_gain: float = not_negative(60.0)
    height_damping: float = not_negative(15.0)
    max_demand: float = positive(3.0)
    sole_margin: float = share(0.3)
    least_sole_margin: float = share_or_none(0.05)
    margin_gain: float = not_negative(2.0)
    beyond: float = share_or_none(0.5)
    max_beyond: float = not_negative(0.5)
    stretch_ahead: float = not_negative(0.1)
    lowering_rate: float = not_negative(20.0)

    # The load of the feet
    load_filter: float = share(0.5)
    load_ramp: float = share(0.26)
    fast_load_ramp: float = share(0.4)
    first_load: float = share(0.07)
    last_load: float = share(0.01)
    least_load: float = share(0.05)
    upset: float = not_negative(2.0)

    # Steps: when feet have landed, and when the walk ends
    earliest: float = share(0.6)
    touch_force: float = share(0.03)
    min_touch_force: float = positive(0.6)
    blocked: float = positive(0.005)
    resting_force: float = share(0.3)
    uneven: float = positive(0.03)
    sole_uneven: float = positive(0.01)
    averaged: float = share(0.05)
    settling: float = share_or_none(0.1)
    pressed: float = share(0.7)
    rebound: float = not_negative(0.005)
    lean: float = positive(0.45)
    steepest: float = positive(0.5)
    missed: float = positive(0.01)
    outside: float = not_negative(0.02)
    at_rest: float = positive(0.03)
    in_place: float = positive(0.06)

    # Footholds
    frozen: float = share_or_none(0.25)
    early_frozen: float = share_or_none(0.4)

    # The way of a swing foot
    clearance: float = positive(0.075)
    penetration_offset: float = not_negative(0.0015)
    settle: float = part(0.9)
    low: float = positive(0.02)
    aim: float = share_or_none(0.2)
    upright_end: float = part(0.1)
    near: float = part(0.166)
    straight_near: float = part(0.185)
    stuck: float = share(0.03)
    out: float = share(0.12)
    creep: float = positive(0.14)
    descent: float = positive(0.3)
    deepest: float = positive(0.25)
    start_across: float = part(0.2)
    apex: float = share(0.4)
    sink: float = share(0.5)
    end_across: float = share(0.7)
    landed: float = share(0.9)
    least_phase: float = share(0.1)
    longest_way: float = positive(0.68)
    lift_acceleration: float = positive(80.0)

    # How soles roll
    roll: float = not_negative(0.9)
    flat_roll: float = not_negative(0.05)
    max_roll: float = not_negative(0.6)
    roll_begin: float = part(0.3)
    roll_end: float = share(0.6)

    def __post_init__(self) -> None:
        super().__post_init__()
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
