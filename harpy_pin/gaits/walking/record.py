"""What a walking gait knows, has measured and remembers, for kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.ground.surface import TerrainRecord
    from harpy_pin.model.tree import TreeRecord

__all__: list[str] = []


class MeasuredRecord(RecordOf):
    """What the last good state says. A foot is a point, or a sole with several contact points.

    Attributes:
        seen: 1 once a state was measured.
        ground: height of the plane that fits the ground around the body, m.
        body: (6,) place (m) and velocity (m/s) of the body's origin, world axes.
        heading: of the body, rad.
        centre: (6,) place (m) and velocity (m/s) of the centre of mass.
        spin: (3,) angular momentum about it, per mass, m²/s.
        drift: (2,) horizontal velocity of a pendulum with the robot's angular momentum about the ground below it, m/s.
        point: (points, 3) places of the contact points, m.
        place: (feet, 3) middles of the feet, m.
        turned: (feet,) heading of each foot, rad.
        load: (feet,) normal force on each foot, of the last samples, N.
    """

    seen: int = ZERO
    ground: float = 0.0
    body: Vector = sized(6)
    heading: float = 0.0
    centre: Vector = sized(6)
    spin: Vector = sized(3)
    drift: Vector = sized(2)
    point: Vector = sized("points", 3)
    place: Vector = sized("feet", 3)
    turned: Vector = sized("feet")
    load: Vector = sized("feet")


class WalkingRecord(RecordOf):
    """What :class:`~harpy_pin.gaits.walking.WalkingGait` knows, has measured and remembers.

    Attributes:
        tree: bodies and joints of the robot.
        terrain: the ground; all heights below are above it.
        steps_over: 1 where swing feet go over the ground by world heights: ``lift`` holds these.
        ground_reach: half the side of the square to which that plane is fitted, m.
        point_body: (points,) the body that carries each contact point.
        point_offset: (points, 3) its place there, m.
        foot: (points,) the foot that each contact point is of.
        corner: (points, 2) its place about the foot's middle, axes of the foot, m.
        group: (feet,) in which step of the cycle each foot swings.
        groups: steps of a cycle.
        nominal: (feet, 2) place of each foot about the centre of mass, axes of the heading, m.
        middle: (groups, 2) mean of those of a group, m.
        sways: 1 where two groups stand apart, so that the body goes to and fro between them.
        step_duration: T of the present step, from one touchdown to the next, s.
        usual_step: that of a slow walk, s.
        stride: longest way of a step, m: at high speed steps are shorter in time.
        double_support: share of the present step in which every foot is on the ground.
        fast_double_support: that at the largest speed.
        slow_double_support: that of a robot that hardly walks.
        fast_load_ramp: share of its largest normal force up to which a foot's load rises over that time, and from
            which it falls, at the largest speed.
        slow_load_ramp: that of a robot that hardly walks.
        first_load: share of it that a foot which has just landed may carry.
        last_load: share of it that a foot may carry which is about to be lifted.
        start_time: for which the robot stands on every foot before its first step, s.
        omega: of the pendulum, 1/s.
        height: of the body, m.
        clearance: height of a foot at mid-swing, m.
        penetration_offset: how much deeper than the ground a swing foot aims, m.
        low: height from which on a foot goes down slowly, m.
        deeper: how much deeper than the ground it then aims, m.
        reach: largest horizontal distance of a foot from its hip, m.
        hip: height of the hips above the feet, of four legs, m.
        beside: (feet,) how far each foot is to the left of the axis about which its leg swings sideways, m.
        arrives: share of its swing before its end at which a foot is almost where it lands.
        lean: distance of the centre of mass from a single stance foot on a point at which the next one should land, m.
        most_aside: largest velocity sideways, m/s.
        reaction: (feet, 2, 3) acceleration of the pendulum for that of each foot relative to the body, axes of the
            heading.
        touch_force: normal force from which on a foot touches the ground, N.
        acceleration: largest change of the applied velocity, m/s².
        turn_acceleration: largest change of the applied turning velocity, rad/s².
        max_speed: largest velocity, m/s.
        max_turn: largest turning velocity, rad/s.
        height_range: (2,) least and largest change of the height, m.
        always: 1 where it steps at zero command, too.
        holds_heading: 1 where the stance feet can hold the heading.
        soles: 1 where feet are flat.
        command: (4,) given: forward, to the left (m/s), turning (rad/s), change of the height (m).
        last_command: (4,) the last one that is all numbers.
        refused: updates with a command that was not all numbers.
        goal: (4,) the command within its limits.
        velocity: (4,) that is applied, of the height m/s.
        rate: (3,) of the first three, m/s² and rad/s².
        raised: present change of the height, m.
        path: (3,) x, y (m) and heading (rad) that the walk follows.
        desired: (2,) velocity of the centre of mass, world axes, m/s.
        demand: (2,) acceleration of the centre of mass, world axes, m/s².
        pressure: (2,) centre of pressure that goes with it, m.
        time: of the last update, s; −1 before the first.
        switch: when the next row of the script begins, s.
        walking: 1 while it steps.
        phase: share of the present step that is done.
        haste: how much faster than its clock the present step goes on.
        load_ramp: that of the present step.
        swings: the group that swings in the present step.
        steps: made since the walk began.
        in_air: (feet,) 1 for a swing foot.
        since: (feet,) time since the last touchdown, s.
        lifted_at: (feet,) height of a swing foot when it was lifted, m.
        felt: (feet,) height of the ground that each foot met last, where that is not what was expected, m.
        touched: (feet,) height below which a stance foot touches the ground, m.
        settled: (feet,) 1 once a stance foot has settled.
        pressed: (feet,) mean of its load, N.
        rest: (feet,) mean of its height, m.
        foothold: (feet, 3) where it lands, m, and its heading there, rad.
        swing: (feet, 3, 3) place, velocity and acceleration of x, y (m) and heading (rad) of a swing foot.
        lift: (feet, 3) its height, velocity and acceleration.
        risen: (feet,) height to which it rises, where feet step over the ground: it stays when an edge is behind, m.
        measured: the last good state.
    """

    tree: TreeRecord
    terrain: TerrainRecord
    steps_over: int
    ground_reach: float
    point_body: NDArray[np.int64]
    point_offset: Vector
    foot: NDArray[np.int64]
    corner: Vector
    group: NDArray[np.int64]
    groups: int
    nominal: Vector
    middle: Vector
    sways: int
    step_duration: float
    usual_step: float
    stride: float
    double_support: float
    fast_double_support: float
    slow_double_support: float
    fast_load_ramp: float
    slow_load_ramp: float
    first_load: float
    last_load: float
    start_time: float
    omega: float
    height: float
    clearance: float
    penetration_offset: float
    low: float
    deeper: float
    reach: float
    hip: float
    beside: Vector
    arrives: float
    lean: float
    most_aside: float
    reaction: Vector
    touch_force: float
    acceleration: float
    turn_acceleration: float
    max_speed: float
    max_turn: float
    height_range: Vector
    always: int
    holds_heading: int
    soles: int
    command: Vector = sized(4)
    last_command: Vector = sized(4)
    refused: float = 0.0
    goal: Vector = sized(4)
    velocity: Vector = sized(4)
    rate: Vector = sized(3)
    raised: float = 0.0
    path: Vector = sized(3)
    desired: Vector = sized(2)
    demand: Vector = sized(2)
    pressure: Vector = sized(2)
    time: float = -1.0
    switch: float = np.inf
    walking: int = ZERO
    phase: float = 0.0
    haste: float = 1.0
    load_ramp: float = 1.0
    swings: int = ZERO
    steps: int = ZERO
    in_air: Vector = sized("feet")
    since: Vector = sized("feet")
    lifted_at: Vector = sized("feet")
    felt: Vector = sized("feet")
    touched: Vector = sized("feet")
    settled: Vector = sized("feet")
    pressed: Vector = sized("feet")
    rest: Vector = sized("feet")
    foothold: Vector = sized("feet", 3)
    swing: Vector = sized("feet", 3, 3)
    lift: Vector = sized("feet", 3)
    risen: Vector = sized("feet")
    measured: MeasuredRecord
