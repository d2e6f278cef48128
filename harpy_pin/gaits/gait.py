"""What every controller asks of a gait: targets of body and feet, at any time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.calls import Call
from harpy_pin.model.kinematics import LegGeometry
from harpy_pin.model.memory import KeepsViews, fixed_arrays, shares_memory
from harpy_pin.model.record import RecordOf, Records, field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

if TYPE_CHECKING:
    from harpy_pin.ground.terrain import Terrain

CHANGE_OVER = 0.3
"""Share of a swing in which :attr:`GaitTarget.world_frame_blend` rises."""
MAX_FEET = 1000
"""Most contact points of a robot."""
LONGEST = 1e9
"""Time beyond which steps are no longer counted, s."""


class Unobserved(InputError):
    """A gait that needs the measured state has seen none whose numbers are finite."""


class GaitTargetRecord(RecordOf):
    """The arrays of :class:`GaitTarget`, whose docstring says what they are."""

    body: Vector = sized(9)
    heading: Vector = sized(3)
    tilt_rate: Vector = sized(2, 2)
    foot_position: Vector = sized("feet", 3)
    foot_velocity: Vector = sized("feet", 3)
    foot_acceleration: Vector = sized("feet", 3)
    stance: Vector = sized("feet")
    phase: Vector = sized("feet")
    load: Vector = sized("feet", fill=1.0)
    world_frame_blend: Vector = sized("feet")
    normal: Vector = sized("feet", 3)
    ground_height: Vector = sized("feet")
    up: Vector = sized(3)
    centre_of_mass: Vector = sized(1)
    force: Vector = sized("feet", 3)


_ARRAYS = tuple(GaitTargetRecord.__annotations__)


@fixed_arrays("record", *_ARRAYS)
class GaitTarget(KeepsViews, GaitTargetRecord):
    """Targets at one time; overwritten by the next :meth:`Gait.update`.

    Args:
        feet: how many the robot has, in the order of :attr:`~harpy_pin.model.robot.Robot.feet`; a
            biped's left one first.

    Attributes:
        record: all of it, for kernels; the others are views of its fields, which have their names.
        body: (9,) position c_t (m), velocity (m/s), acceleration (m/s²) of the body, world.
        heading: (3,) yaw of the upright target body (rad), its rate (rad/s) and acceleration
            (rad/s²); zero where the gait faces x.
        tilt_rate: (2, 2) angular velocity of the target body about the world's x and y (rad/s), and
            its rate (rad/s²); zero where a gait says nothing else.
        foot_position: (feet, 3) each foot relative to the body's target, world axes, m.
        foot_velocity: (feet, 3) of that, m/s.
        foot_acceleration: (feet, 3) of that, m/s².
        stance: (feet,) 1 where the foot should be on the ground, else 0.
        phase: (feet,) share of its present stance or swing that each foot has done, 0 to 1. After
            half of its swing a foot that touches the ground is held.
        load: (feet,) share of the usual range of its normal force in which each foot may be loaded;
            1 where a gait says nothing else. A corner of a stance sole with 0 is lifted: it follows
            its target, while others bear.
        world_frame_blend: (feet,) for controllers that place feet relative to the measured body: 1
            where the target holds in world axes (a swing foot must meet the ground, however the
            body tilts), 0 where it holds in body axes (a stance leg sets the body upright), between
            them during the transition.
        normal: (feet, 3) normals of the ground at the feet, upwards; vertical where a gait says
            nothing else. Friction cones are about them. All corners of a flat foot have that of its
            first one.
        ground_height: (feet,) height of the ground below each foot, m.
        up: (3,) direction of the target body's z axis, world, of length one; vertical where a gait
            says nothing else.
        centre_of_mass: (1,) 1 where the horizontal acceleration in ``body`` is that of the centre
            of mass, for the whole-body controllers, instead of that of the body's origin.
        force: (feet, 3) planned contact forces, world axes, N, to which those that whole-body
            controllers choose are near where the other tasks leave a choice; zero where a gait says
            nothing else. Forces on feet that are not held do not count.
    """

    _record_: Records[GaitTargetRecord]

    def __init__(self, feet: int = 2) -> None:
        self.record = make_record(
            GaitTargetRecord, {"feet": checks.whole("feet", feet, high=MAX_FEET)}
        )
        self._record_["normal"][0, :, 2] = self._record_["up"][0, 2] = 1.0
        for name in _ARRAYS:
            setattr(self, name, field(self._record_, name))


class Gait(KeepsViews, ABC):
    """Targets of a walk for one robot. A gait of one's own derives from this class, and writes
    :meth:`update` and :meth:`initial_state`; all else has defaults.

    A gait around another one has to pass on what of the rest it wants. The paper's controller
    faces x: it refuses targets with a heading.

    The library's own gaits never change, and every controller takes a copy with targets of its own.
    A gait of one's own is used as it is, so that it may be steered during the walk: it is for one
    controller, in one thread. So is :class:`~harpy_pin.gaits.commanded.CommandedGait`.

    Args:
        robot: who walks.

    Attributes:
        robot: who walks.
        target: of the last :meth:`update`.
        step_duration: time from one touchdown to the next, s. By default one second, so that
            measures per step are per second.
        double_support: share of a step with both feet on the ground, over which the load moves from
            one foot to the other. By default zero: a foot may take the whole load at once.
        walks: whether it goes or steps. False of one that stands: where no stiffness is given, its
            ground is softer.
        terrain: that it knows. A gait with none is laid over the ground of a scenario.
        not_governed: why the paper's controller cannot follow it; empty where it can.
        controller_parameters: settings of whole-body controllers that fit it. They take them before
            those that fit its robot (:mod:`harpy_pin.gaits.fitting`), which are enough for most
            gaits.
        constant: whether it never changes; a class says so by ``class Own(Gait, constant=True)``,
            and not for those that derive from it.
    """

    robot: Robot
    target: GaitTarget
    step_duration: float = 1.0
    double_support: float = 0.0
    walks: bool = True
    terrain: Terrain | None = None
    not_governed: str = ""
    controller_parameters: Mapping[str, Any] = {}
    constant: ClassVar[bool] = False

    def __init_subclass__(cls, *, constant: bool = False) -> None:
        super().__init_subclass__()
        cls.constant = constant

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.robot.name}')"

    def __init__(self, robot: Robot) -> None:
        self.robot = checks.instance("robot", robot, Robot)
        self.target = GaitTarget(len(robot.feet))

    @abstractmethod
    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s. Controllers ask for finite times only.

        Args:
            t: time, s, finite and not negative.

        Returns:
            The targets, with as many feet as the robot has; best :attr:`target`, overwritten.
        """

    @abstractmethod
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            penetration: how deep the lower foot is in the ground, m (see
                ``Simulator.static_penetration``).
        """

    def observe(self, state: State) -> None:
        """Take what was measured in a tick, before :meth:`update` of its time, for gaits that
        choose their steps by it.

        Args:
            state: measured. Bad samples come, too: ignore them.
        """

    def expect_lag(self, lag: float) -> None:
        """Plan for what the controller assumes of its thrusts.

        Args:
            lag: time constant with which they follow, s.
        """

    def expect_friction(self, mu: float) -> None:
        """Plan for what the controller assumes of the ground.

        Args:
            mu: friction coefficient.
        """

    def expect_terrain(self, terrain: Terrain, *, reach: float) -> bool:
        """Plan for the ground over which it is laid (:class:`~harpy_pin.gaits.OnTerrain`).

        Args:
            terrain: of the ground.
            reach: half the side of the square around the body whose plane the body follows, m.

        Returns:
            Whether the targets of its swing feet have heights in the world from then on.
        """
        return False

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {"gait": type(self).__name__, "step_duration": self.step_duration}

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Signals of the last update, the same names and shapes each time, which the whole-body
        controllers log.
        """
        return {}

    def calls(self, state: State) -> Sequence[Call] | None:
        """The kernels of an update at the time of a tick, with those of :meth:`observe` before, for
        a loop in C (:mod:`harpy_pin.simulation.ticks`); None where Python takes part.

        They write :attr:`target`.

        Args:
            state: arrays of the measured state, which stay where they are; those of
                :meth:`telemetry` do, too.
        """
        return None


def own_target(gait: Gait) -> Gait:
    """The gait that a controller follows: of one that never changes a copy with targets of its own,
    else the gait itself.
    """
    if not gait.constant:
        return gait
    own = shares_memory(gait)
    own.target = GaitTarget(len(gait.robot.feet))
    return own


def check_target(target: object, robot: Robot) -> GaitTarget:
    """The targets that a gait has given.

    Raises:
        InputError: they are none, or those of a robot with another number of feet.
    """
    feet = len(robot.feet)
    if not isinstance(target, GaitTarget) or len(target.stance) != feet:
        got = (
            f"one of {len(target.stance)}"
            if isinstance(target, GaitTarget)
            else type(target).__name__
        )
        raise InputError(
            f"update(t) of a gait must return a GaitTarget of {feet} feet, got {got}",
            name="gait",
            value=target,
        )
    return target


@kernel
def copy_target(g: GaitTargetRecord, o: GaitTargetRecord) -> None:
    """Copy all targets of ``g`` to ``o``."""
    o.body[:] = g.body
    o.heading[:] = g.heading
    o.tilt_rate[:] = g.tilt_rate
    o.foot_position[:] = g.foot_position
    o.foot_velocity[:] = g.foot_velocity
    o.foot_acceleration[:] = g.foot_acceleration
    o.stance[:] = g.stance
    o.phase[:] = g.phase
    o.load[:] = g.load
    o.world_frame_blend[:] = g.world_frame_blend
    o.normal[:] = g.normal
    o.ground_height[:] = g.ground_height
    o.up[:] = g.up
    o.centre_of_mass[:] = g.centre_of_mass
    o.force[:] = g.force


class ClockGait(Gait):
    """A gait whose targets one kernel finds from the time alone; where it never changes,
    controllers call the kernel by themselves.
    """

    _record: Records[Any]
    _kernel: ClassVar[Kernel[bool]]

    def update(self, t: float) -> GaitTarget:
        """See :meth:`Gait.update`; an InputError where t is not finite, or beyond 1e9 s."""
        if type(t) is not float:
            t = checks.number("t", t)
        if not self._kernel(t, self._record, self.target._record_):
            raise refuse_time(t)
        return self.target

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """See :meth:`Gait.calls`."""
        if not self.constant:
            return None
        return (Call(self._kernel, 0.0, self._record, self.target._record_, expected=True),)


def refuse_time(t: float) -> InputError:
    """The error for a time that is not finite, or beyond :data:`LONGEST`."""
    return InputError(
        f"the gait's time must be finite and below {LONGEST:g} s, got {shown(t)}", name="t", value=t
    )


def two_legs(robot: Robot) -> tuple[LegGeometry, LegGeometry]:
    """Both legs of a biped of Harpy's kind; compiling of their kernels begins.

    Raises:
        InputError: the robot has not two feet.
        RobotError: its legs are of another kind.
    """
    checks.instance("robot", robot, Robot)
    if len(robot.feet) != 2:
        raise InputError(
            f"this gait is for bipeds of Harpy's kind: it needs two feet, '{robot.name}' has "
            f"{len(robot.feet)}; "
            f"use {'hp.WalkingGait or hp.Standing' if robot.feet else 'hp.Hovering'}",
            name="robot",
        )
    left, right = (LegGeometry.from_robot(robot, foot) for foot in robot.feet)
    left.prepare()
    return left, right
