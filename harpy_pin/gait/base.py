"""What every controller asks of a gait: targets of body and feet, at any time."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any, Protocol

import numpy as np

from harpy_pin.model.record import RecordViews, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Gait", "GaitTarget", "own_target"]


class GaitTarget(RecordViews):
    """Targets at one time; overwritten by the next :meth:`Gait.update`.

    Args:
        feet: how many the robot has, in the order of :attr:`~harpy_pin.model.robot.Robot.feet`; a biped's left one
            first.

    Attributes:
        record: all of it, for kernels; the others are views of its fields, which have their names.
        body: (9,) position c_t (m), velocity (m/s), acceleration (m/s²) of the body, world.
        heading: (3,) yaw of the upright target body (rad), its rate (rad/s) and acceleration (rad/s²); zero where the
            gait faces x.
        foot_position: (feet, 3) each foot relative to the body's target, world axes, m.
        foot_velocity: (feet, 3) likewise, m/s.
        foot_acceleration: (feet, 3) likewise, m/s².
        stance: (feet,) 1 where the foot should be on the ground, else 0.
        progress: (feet,) share of its present stance or swing that each foot has done, 0 to 1.
        level: (feet,) for controllers that place feet relative to the measured body: 1 where the target holds in world
            axes (a foot in the air must meet the ground, however the body tilts), 0 where it holds in body axes (a
            leg that carries sets the body upright), between them while the foot changes over.
    """

    __slots__ = (
        "body",
        "foot_acceleration",
        "foot_position",
        "foot_velocity",
        "heading",
        "level",
        "progress",
        "record",
        "stance",
    )

    def __init__(self, feet: int = 2) -> None:
        points = np.zeros((feet, 3))
        self.record = make_record(
            body=np.zeros(9),
            heading=np.zeros(3),
            foot_position=points,
            foot_velocity=points,
            foot_acceleration=points,
            stance=np.zeros(feet),
            progress=np.zeros(feet),
            level=np.zeros(feet),
        )
        self.body: Vector = field(self.record, "body")
        self.heading: Vector = field(self.record, "heading")
        self.foot_position: Vector = field(self.record, "foot_position")
        self.foot_velocity: Vector = field(self.record, "foot_velocity")
        self.foot_acceleration: Vector = field(self.record, "foot_acceleration")
        self.stance: Vector = field(self.record, "stance")
        self.progress: Vector = field(self.record, "progress")
        self.level: Vector = field(self.record, "level")


class Gait(Protocol):
    """Targets of a walk for one robot.

    The targets belong to the gait, so that only one controller may use it at a time. The library's own gaits never
    change, and every controller takes a copy with targets of its own (:func:`own_target`). A gait of one's own is used
    as it is, so that it may be steered during the walk: it is for one controller, in one thread. So is
    :class:`~harpy_pin.gait.commanded.CommandedGait`.

    A method ``telemetry() -> Mapping[str, ArrayLike]`` is used where there is one: signals of the last update, the same
    names and shapes each time, which the whole-body controllers log.

    Attributes:
        robot: who walks.
        target: the targets of the last :meth:`update`.
        step_duration: time from one touchdown to the next, s.
        double_support: share of it with both feet on the ground.
    """

    robot: Robot
    target: GaitTarget
    step_duration: float
    double_support: float

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s: the object :attr:`target` itself. Controllers ask for finite times only.

        Args:
            t: time, s, finite and not negative.
        """
        ...

    def initial_state(self, *, sink: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            sink: how deep the lower foot is in the ground, m (see ``Simulator.static_sink``).
        """
        ...

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        ...


def own_target(gait: Gait) -> Gait:
    """A copy of the gait with targets of its own, where its class says itself that it never changes (that of a
    subclass may); otherwise the gait itself."""
    if not vars(type(gait)).get("constant", False):
        return gait
    own = copy(gait)
    own.target = GaitTarget(len(gait.robot.feet))
    return own
