"""A walk of any robot with two or four feet that follows a velocity command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import GaitTarget, GaitTargetRecord
from harpy_pin.gaits.standing import GRAVITY, Standing
from harpy_pin.gaits.walking.body import demand_acceleration, write_targets
from harpy_pin.gaits.walking.commanding import hear_command, steer, want_velocity
from harpy_pin.gaits.walking.contacts import go_on, time_left
from harpy_pin.gaits.walking.footholds import choose_footholds
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.gaits.walking.schedules import groups_of
from harpy_pin.gaits.walking.settings import Build, build_of
from harpy_pin.gaits.walking.swinging import swing_foot
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.model.tree import tree_record

__all__ = ["WalkingGait"]

LONGEST = 1e9
"""Largest time, s."""
BENT, STRETCHED = 0.92, 0.98
"""Largest height of the hip while it walks, and largest distance from there to the foot, in lengths of the leg."""
SWING_WEIGHT = 1.0
"""Weight of the acceleration of a foot in the air: a fifth of the default, so that the body comes first at limits."""


class WalkingGait:
    """Targets of a robot on two or four feet that walks where it is told.

    Args:
        robot: with two or four feet, points or flat ones.
        schedule: ``trot``, ``crawl``, ``pace`` or ``bound`` on four feet, ``walk`` or ``step`` on two, or ``stand``.
        velocity: forward, to the left (m/s), turning to the left (rad/s), and optionally change of the height (m).
        posture: (joints,) angles in which it stands, rad; by default the robot's own.
    """

    def __init__(
        self,
        robot: Robot,
        schedule: str | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        *,
        posture: ArrayLike | None = None,
        step_duration: float | None = None,
        double_support: float | None = None,
        clearance: float | None = None,
        penetration_offset: float = 0.0015,
        max_speed: float | None = None,
        width: float = 1.0,
        squeeze: float = 0.2,
    ) -> None:
        self.robot = robot
        self._standing = Standing(robot, posture)
        q, v = self._standing.initial_state()
        build = build_of(robot, q)
        feet = len(build.place)
        nominal = build.place[:, :2] - build.place[:, :2].mean(axis=0)
        lower = max(build.hip_height - BENT * build.leg, 0.0)
        rise = float(build.centre[2] - build.point[:, 2].min()) - lower
        schedule = {2: "walk", 4: "trot"}.get(feet, "stand") if schedule is None else schedule
        group = groups_of(schedule, nominal)
        groups = int(group.max()) + 1
        sways = groups == 2 and _draw_together(nominal, group, 2.0 * squeeze * rise) > 0.01 * rise
        nominal[:, 1] *= width
        soles = bool(robot.flat_feet)
        natural = float(np.sqrt(build.leg / GRAVITY))
        self.step_duration = (1.7 if soles else 0.82) * natural if step_duration is None else step_duration
        self.double_support = (0.15 if soles else 0.1) if double_support is None else double_support
        omega = float(np.sqrt(GRAVITY / rise))
        reach = float(np.sqrt(max((STRETCHED * build.leg) ** 2 - (build.hip_height - lower) ** 2, 0.0)))
        self.schedule = schedule
        self.record = make_record(
            WalkingRecord,
            tree=tree_record(robot.model),
            **_points(robot, build),
            group=group,
            groups=np.int64(groups),
            nominal=nominal,
            middle=np.array([nominal[group == g].mean(axis=0) for g in range(groups)]),
            sways=np.int64(sways),
            step_duration=self.step_duration,
            double_support=self.double_support,
            start_time=0.0 if feet == 2 and not soles else 1.6 * natural,
            omega=omega,
            height=build.height - lower,
            clearance=0.075 * build.leg if clearance is None else clearance,
            penetration_offset=penetration_offset,
            reach=reach,
            touch_force=0.1 * robot.mass * GRAVITY / feet,
            acceleration=1.0,
            turn_acceleration=3.0,
            max_speed=2.0 * reach / self.step_duration if max_speed is None else max_speed,
            max_turn=2.0,
            height_range=np.array((-0.2 * build.height, 0.05 * build.height)),
            always=np.int64(schedule == "step" or (feet == 2 and not soles)),
            holds_heading=np.int64(soles or feet > 2),
            soles=np.int64(soles),
            command=np.zeros(4),
            heard=np.zeros(4),
            refused=0.0,
            goal=np.zeros(4),
            velocity=np.zeros(4),
            rate=np.zeros(3),
            raised=0.0,
            path=np.zeros(3),
            wanted=np.zeros(2),
            demand=np.zeros(2),
            pressure=np.zeros(2),
            time=-1.0,
            walking=np.int64(0),
            phase=0.0,
            swings=np.int64(0),
            steps=np.int64(0),
            in_air=np.zeros(feet),
            since=np.zeros(feet),
            lifted_at=np.zeros(feet),
            foothold=np.zeros((feet, 3)),
            swing=np.zeros((feet, 3, 3)),
            lift=np.zeros((feet, 3)),
            measured=make_record(
                MeasuredRecord,
                seen=np.int64(0),
                body=np.zeros(6),
                heading=0.0,
                centre=np.zeros(6),
                spin=np.zeros(3),
                drift=np.zeros(2),
                point=np.zeros((len(robot.feet), 3)),
                place=np.zeros((feet, 3)),
                turned=np.zeros(feet),
                load=np.zeros(feet),
            ),
        )
        self._measured = self.record["measured"]
        self.command: Vector = field(self.record, "command")
        velocity = np.asarray(velocity, dtype=float)
        self.command[: len(velocity)] = velocity
        self.target = GaitTarget(len(robot.feet))
        measure.prepare(self.record, q, v, np.zeros((len(robot.feet), 3)))
        _update.prepare(0.0, self.record, self.target.record)

    @property
    def parameters(self) -> dict[str, Any]:
        """Settings of whole-body controllers that fit this robot's weight, see :attr:`Standing.parameters`."""
        parameters = self._standing.parameters
        parameters["weights"]["swing"] = SWING_WEIGHT
        return parameters

    def observe(self, state: State) -> None:
        """What was measured, for the next update; a state that holds no numbers is ignored."""
        measure(self.record, state.q, state.v, state.foot_force)

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s, at the state that was observed last."""
        if not self._measured["seen"][0]:
            message = "hp.WalkingGait needs the measured state: call observe(state) before update(t)"
            raise InputError(message, name="gait")
        if not _update(float(t), self.record, self.target.record):
            raise InputError(f"the gait's time must be finite and below {LONGEST:g} s, got {t!r}", name="t", value=t)
        return self.target

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) at rest in the posture."""
        return self._standing.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        names = ("step_duration", "double_support", "clearance", "reach", "omega", "max_speed")
        return {"gait": "walking", "schedule": self.schedule, **{name: float(self.record[name][0]) for name in names}}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Signals."""
        return {
            "path": field(self.record, "path"),
            "wanted": field(self.record, "wanted"),
            "pressure": field(self.record, "pressure"),
            "centre": field(self._measured, "centre"),
            "foothold": field(self.record, "foothold"),
            "phase": float(self.record["phase"][0]),
            "steps": int(self.record["steps"][0]),
        }


def _draw_together(places: Vector, group: NDArray[np.int64], most: float) -> float:
    """Move two groups of feet, in place, until their middles are apart by no more than some distance.

    Returns:
        Their distance then, m.
    """
    middles = [places[group == g].mean(axis=0) for g in range(2)]
    apart = float(np.linalg.norm(middles[1] - middles[0]))
    share = max(1.0 - most / apart, 0.0) if apart > 0.0 else 0.0
    for g in range(2):
        places[group == g] -= share * middles[g]
    return (1.0 - share) * apart


def _points(robot: Robot, build: Build) -> dict[str, Any]:
    frames = [robot.model.frames[robot.frame_id(name)] for name in robot.feet]
    return {
        "point_body": np.array([frame.parentJoint - 1 for frame in frames], dtype=np.int64),
        "point_offset": np.array([frame.placement.translation for frame in frames]),
        "foot": build.foot.astype(np.int64),
        "corner": (build.point - build.place[build.foot])[:, :2],
    }


@kernel
def _update(t: float, gait: Records[WalkingRecord], target: Records[GaitTargetRecord]) -> bool:
    """All targets at time t; returns whether it is one."""
    p = gait[0]
    if not abs(t) < LONGEST:
        return False
    if t <= 0.0 or p.time < 0.0 or t < p.time - p.step_duration:
        _restart(p)
        p.time = t
    span = min(max(t - p.time, 0.0), 0.02)
    p.time = max(t, p.time)
    hear_command(p)
    steer(p, span)
    want_velocity(p)
    go_on(p, span)
    demand_acceleration(p)
    if p.walking:
        left = time_left(p)
        choose_footholds(p, left)
        for k in range(p.group.shape[0]):
            if p.in_air[k] != 0.0:
                swing_foot(p, k, left if p.group[k] == p.swings else 0.0, span)
    write_targets(p, target[0])
    return True


@kernel
def _restart(p: WalkingRecord) -> None:
    """Stand where the robot is."""
    m = p.measured
    p.path[0], p.path[1], p.path[2] = m.centre[0], m.centre[1], m.heading
    p.velocity[:] = 0.0
    p.rate[:] = 0.0
    p.raised = p.refused = 0.0
    p.walking = p.steps = p.swings = 0
    p.phase = 0.0
    p.in_air[:] = 0.0
    p.since[:] = 1.0
    p.heard[:] = 0.0
