"""The estimator: readings in, a state out."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.estimation.imu import NOT_NEGATIVE, POSITIVE, Imu
from harpy_pin.estimation.plausibility import BAD_TARGET, MISMATCH, NO_SAMPLE
from harpy_pin.estimation.readings import Readings
from harpy_pin.estimation.record import ContactRecord, EstimatorRecord, FilterRecord
from harpy_pin.estimation.statuses import EXPLANATIONS, STATUS
from harpy_pin.estimation.tick import estimate
from harpy_pin.model.dynamics import dynamics_record
from harpy_pin.model.entry import MAX_SAMPLE, all_possible, as_array
from harpy_pin.model.legs import legs
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import GRAVITY, State, Vector
from harpy_pin.model.terms import read_thrusts

POINT_RATE, SOLE_RATE = 300.0, 150.0
"""Of the momentum observer, 1/s."""
ESTIMATED = ("q", "v", "foot_position", "foot_velocity", "foot_force")
"""What of the record makes a :class:`~harpy_pin.model.state.State`."""
NEAR = 0.3
"""Distance below which a foot is where the ground is, as a share of the noise of the ground's
height.
"""


def _finite_or_endless(name: str, value: Any) -> float:
    endless = isinstance(value, float) and value == np.inf
    return value if endless else checks.number(name, value, **POSITIVE)


@dataclass(frozen=True, kw_only=True)
class EstimatorSettings(checks.Checked):
    """Settings of the estimator besides the noise of its sensors; the defaults are for all robots.

    Attributes:
        foothold_density: random walk of a foot in stance, m/s/√Hz: soft ground, small slips.
        foothold_noise: of a foot's place by kinematics, besides the encoders', m: links that bend,
            calibration.
        height_noise: of the height of footholds about zero, m. Infinite for ground that is not
            level: then the robot's height drifts like its place.
        gate: squared Mahalanobis distance of a foot's place from which on the foot has slipped.
        force_rate: of the momentum observer, 1/s; None for 300 on points and 150 on flat feet,
            whose gait feels the sum of four noisy points.
        load: normal force of a foot as likely in contact as not, as a share of the robot's weight;
            of a contact point of a flat foot the share of that share.
        load_width: share of the same weight by which the log-odds of contact change by one.
        prior: log-odds of contact that the gait's plan adds to a foot in stance or about to land;
            it takes off twice as much in a swing.
        foot_speed: at which the log-odds of contact have fallen by one, m/s.
        rest: log-odds of contact, for the gait, that a swing foot gains which is at rest where the
            ground is, late in its swing. A foot that lands softly pushes less than the forces'
            noise.
        rest_speed: from which on it is not at rest, m/s.
        damping: of the least squares for the forces of a leg, m²; it keeps singular legs finite.
        tilt: standard deviation at the start, rad.
        velocity: standard deviation at the start, m/s.

    Raises:
        InputError: a number out of its domain.
    """

    whose = "estimator "
    foothold_density: float = checks.setting(0.002, **POSITIVE)
    foothold_noise: float = checks.setting(5e-4, **POSITIVE)
    height_noise: float = checks.setting(0.01, _finite_or_endless)
    gate: float = checks.setting(40.0, **POSITIVE)
    force_rate: float | None = checks.setting(None, **POSITIVE)
    load: float = checks.setting(0.06, **NOT_NEGATIVE)
    load_width: float = checks.setting(0.02, **POSITIVE)
    prior: float = checks.setting(2.0, **NOT_NEGATIVE)
    foot_speed: float = checks.setting(0.5, **POSITIVE)
    rest: float = checks.setting(4.5, **POSITIVE)
    rest_speed: float = checks.setting(0.08, **POSITIVE)
    damping: float = checks.setting(1e-4, **POSITIVE)
    tilt: float = checks.setting(0.01, **POSITIVE)
    velocity: float = checks.setting(0.02, **POSITIVE)


@fixed_arrays("record", "probability")
class Estimator(KeepsViews):
    """Where a robot is and how it moves, from what it feels itself.

    Place and heading cannot be observed: they drift from where the estimate began. Equations and
    what to expect: ``docs/estimation.md``. ::

        estimator = hp.Estimator(robot)
        while True:
            state = estimator.step(hp.Readings(t, gyroscope, accelerometer, q, dq, tau))
            command = controller.step(state)

    Args:
        robot: with joints as they are known (:meth:`~harpy_pin.model.robot.Robot.with_joints`).
            What friction and armature they have besides is learned in swings, and counts as force
            of the ground before.
        imu: noise and place of the sensors.
        settings: the rest.
        period: time at which steps are expected, s. Each goes on by the time that has passed.
        foot_radius: of round feet that roll, one for all or (feet,), m; by default what the robot's
            file says of them (:attr:`Robot.foot_radius`). Their centres are the robot's feet, which
            stand on level ground at height zero.

    Attributes:
        record: all that the kernels know.
        probability: (feet,) of contact, of the last step.
    """

    _record_: Records[EstimatorRecord]

    @checked
    def __init__(
        self,
        robot: Robot,
        imu: Imu | None = None,
        *,
        settings: EstimatorSettings | None = None,
        period: float = 1e-3,
        foot_radius: ArrayLike | None = None,
    ) -> None:
        self.robot, self.period = robot, checks.number("period", period, low=0.0, strict=True)
        self.imu = Imu() if imu is None else checks.instance("imu", imu, Imu)
        self.settings = EstimatorSettings() if settings is None else settings
        checks.instance("settings", self.settings, EstimatorSettings)
        feet = len(robot.feet)
        foot_radius = robot.foot_radius if foot_radius is None else foot_radius
        radius = np.full(feet, foot_radius) if np.ndim(foot_radius) == 0 else foot_radius
        self.record = _record(
            robot, self.imu, self.settings, self.period, checks.vector("foot_radius", radius, feet)
        )
        self._fresh = self._record_.copy()
        self.probability: Vector = field(self._record_["contact"], "probability")
        self._thrust: Vector = field(self._record_, "thrust")
        self._intended: Vector = field(self._record_, "intended")
        self._no_force = np.full(feet, np.nan)
        self._nothing = SimpleNamespace(
            stance=np.full(feet, 0.5), phase=np.zeros(feet), ground_height=np.zeros(feet)
        )
        self.signals: dict[str, NDArray[Any]] = {
            "estimated_q": field(self._record_, "q"),
            "estimated_v": field(self._record_, "v"),
            "estimated_force": field(self._record_, "foot_force"),
            "contact_probability": self.probability,
            "estimator_status": field(self._record_, "status"),
        }
        self.reset()

    def __repr__(self) -> str:
        return f"Estimator('{self.robot.name}', period {1e3 * self.period:g} ms, {self.status})"

    def reset(self, q: ArrayLike | None = None, v: ArrayLike | None = None) -> None:
        """Begin anew.

        Args:
            q: (nq,) configuration at the next step. By default the body is at rest at the origin,
                as the first sample of accelerometer and encoders tilts it, with its lowest foot on
                the ground.
            v: (nv,) velocity; zero by default.

        Raises:
            InputError: wrong shapes, or entries that are not finite or beyond 1e6.
        """
        r, robot = self._record_, self.robot
        level, q = q is None, robot.neutral if q is None else configuration(robot, q)
        v = np.zeros(robot.nv) if v is None else checks.vector("v", v, robot.nv)
        if not (all_possible(q) and all_possible(v)):
            raise InputError(f"q and v must be at most {MAX_SAMPLE:g}", name="v", value=v)
        rotation, place = pin.Quaternion(q[3:7]).toRotationMatrix(), r["place"][0]
        r[...], f = self._fresh, r["filter"]
        f["rotation"], f["position"] = rotation, q[:3] + rotation @ place
        f["velocity"] = rotation @ (v[:3] + np.cross(v[3:6], place))
        r["level"], r["q"], r["v"], r["status"] = level, q, v, NO_SAMPLE
        self._arrays = tuple(field(r, name) for name in ESTIMATED)  # whoever has one can reshape it

    @property
    def status(self) -> str:
        """What the last step says of its readings; :attr:`explanation` says why.

        With ``good`` they fit each other, the weight and gravity, and the velocity is known to
        5 cm/s. With all others the estimate goes on and is finite.
        """
        return STATUS[int(self._record_["status"][0])]

    @property
    def explanation(self) -> str:
        """The status in a sentence, with its likely cause and the numbers that it goes by."""
        r, deviation = self._record_[0], self.velocity_deviation.max()
        return f"{self.status}: " + EXPLANATIONS[int(r["status"])].format(
            period=self.period,
            felt=r["gravity"] * GRAVITY,
            borne=r["borne"],
            deviation=deviation,
            twice=2.0 * deviation,
            mismatch=MISMATCH,
        )

    @property
    def velocity_deviation(self) -> Vector:
        """(3,) standard deviations of the velocity, body axes, m/s."""
        f = self._record_["filter"][0]
        rotation: Vector = f["rotation"]
        return np.sqrt(np.diag(rotation.T @ f["covariance"][3:6, 3:6] @ rotation))

    @property
    def position_deviation(self) -> Vector:
        """(3,) standard deviations of the place since the start, world axes, m."""
        return np.sqrt(np.diag(self._record_["filter"]["covariance"][0, 6:9, 6:9]))

    def step(
        self, readings: Readings, target: Any = None, acceleration: Vector | None = None
    ) -> State:
        """One step.

        Args:
            readings: of the sensors.
            target: the gait's targets of the last tick (:class:`~harpy_pin.gaits.gait.GaitTarget`,
                such as a controller's ``target``): which feet it expects on the ground. None: it
                expects nothing.
            acceleration: (nv,) of all coordinates that the last command intends (a controller's
                ``acceleration``). For half a second readings that are missing are those of this
                motion. None: the last ones stay.

        Returns:
            The estimate; it shares memory with the next one.

        Raises:
            InputError: arrays of another robot, or targets that are not finite.
        """
        intended = (
            np.nan
            if acceleration is None
            else as_array("acceleration", acceleration, self._intended.shape)
        )
        self._intended[...] = intended
        try:
            self._estimate(readings, target)
        except (TypeError, AttributeError, InputError):
            self._estimate(self._fit(readings), self._expected(target))
        return State(float(readings.t), *self._arrays)

    def _estimate(self, s: Readings, target: Any) -> None:
        """One step with arrays as kernels take them."""
        force = self._no_force if s.foot_force is None else s.foot_force
        if s.thrust is not None and len(self._thrust):
            if s.thrust.shape != (len(self.robot.thrusters), 3):
                raise InputError("thrusts of another robot", name="readings.thrust")
            read_thrusts(self._record_["dynamics"], s.thrust, self._thrust)
        legs, expected = (
            (s.joint_position, s.joint_velocity, s.joint_torque),
            target or self._nothing,
        )
        plan = (expected.stance, expected.phase, expected.ground_height)
        if (
            estimate(self._record_, s.t, s.gyroscope, s.accelerometer, *legs, force, *plan)
            == BAD_TARGET
        ):
            raise InputError(
                "a target's stance, phase and ground_height must be finite",
                name="target",
                value=target,
            )

    def _fit(self, readings: Readings) -> Readings:
        """The same readings in arrays of the sizes that kernels take."""
        s, joints, feet = (
            checks.instance("readings", readings, Readings),
            len(self.robot.joints),
            len(self.robot.feet),
        )
        shapes: dict[str, tuple[int, ...]] = {"gyroscope": (3,), "accelerometer": (3,)}
        shapes |= dict.fromkeys(("joint_position", "joint_velocity", "joint_torque"), (joints,))
        shapes |= {"thrust": (len(self.robot.thrusters), 3)} if s.thrust is not None else {}
        shapes |= {"foot_force": (feet,)} if s.foot_force is not None else {}
        arrays = {
            name: as_array(f"readings.{name}", getattr(s, name), shape)
            for name, shape in shapes.items()
        }
        return Readings(checks.number("readings.t", s.t), **arrays)

    def _expected(self, target: Any) -> Any:
        """The same targets, of as many feet as the robot has."""
        if target is None:
            return None
        names, feet = ("stance", "phase", "ground_height"), (len(self.robot.feet),)
        arrays = {
            name: as_array(f"target.{name}", getattr(target, name, None), feet) for name in names
        }
        return SimpleNamespace(**arrays)


def _record(
    robot: Robot, imu: Imu, settings: EstimatorSettings, period: float, radius: Vector
) -> Records[EstimatorRecord]:
    """A new :class:`~harpy_pin.estimation.record.EstimatorRecord`."""
    s, gravity, (place, unbounded) = settings, np.array([0.0, 0.0, -GRAVITY]), robot.layout
    start = (s.tilt, s.tilt, 0.0, *[s.velocity] * 3, 0.0, 0.0, 0.0)
    start += (max(imu.gyroscope_bias, 1e-6),) * 3 + (max(imu.accelerometer_bias, 1e-6),) * 3
    names = ("gyroscope_density", "accelerometer_density", "gyroscope_walk", "accelerometer_walk")
    joints_of, feet = _legs(robot)
    return make_record(
        EstimatorRecord,
        robot.sizes,
        filter=make_record(
            FilterRecord,
            robot.sizes,
            period=period,
            gravity=gravity,
            **{name: getattr(imu, name) for name in names},
            **{
                name: getattr(s, name)
                for name in ("foothold_density", "foothold_noise", "height_noise", "gate")
            },
            encoder_noise=np.hypot(imu.encoder_noise, imu.encoder_resolution / np.sqrt(12.0)),
            start=np.array(start),
            innovation=0.0,
        ),
        contact=make_record(
            ContactRecord,
            robot.sizes,
            rate=s.force_rate or (POINT_RATE if max(robot.corners, default=1) == 1 else SOLE_RATE),
            **{
                name: getattr(s, name)
                for name in (
                    "load",
                    "load_width",
                    "prior",
                    "foot_speed",
                    "rest",
                    "rest_speed",
                    "damping",
                )
            },
            weight=robot.mass * GRAVITY / np.repeat(robot.corners, robot.corners),
            of_sole=np.repeat(robot.corners, robot.corners) > 1,
            near=NEAR * s.height_noise if np.isfinite(s.height_noise) else 0.0,
            unlearned=0.0,
            skid=0.0,
            creep=0.0,
            sunk=0.0,
            leg_joints=joints_of,
            leg_feet=feet,
        ),
        dynamics=dynamics_record(robot, gravity=gravity),
        mounting=imu.rotation,
        place=np.array(imu.position),
        angle_place=place,
        unbounded=unbounded,
        foot_radius=radius,
        gyroscope_range=imu.gyroscope_range,
        accelerometer_range=imu.accelerometer_range,
        period=period,
        missing=0.0,
        intended=np.full(robot.nv, np.nan),
        weight=robot.mass * GRAVITY,
        gravity=1.0,
        borne=1.0,
        up=1.0,
        turning=0.0,
        turned=0.0,
        unread=0.0,
        unlike=0.0,
        contested=0.0,
        settling=0.0,
        loose=0.0,
        lost=0.0,
        t=np.nan,
        level=np.int64(1),
        q=robot.neutral,
    )


def _legs(robot: Robot) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns in v of the joints that each leg alone has, and its contact points; −1 where there
    are fewer.
    """
    points_on: dict[tuple[int, ...], list[int]] = {}
    for leg in legs(robot):
        columns = leg.columns[::-1]
        points_on.setdefault(columns, []).extend(robot.feet.index(name) for name in leg.points)
    own = list(points_on)
    most, points = max(map(len, own), default=0), max(map(len, points_on.values()), default=0)
    joints = np.full((len(own), most), -1, np.int64)
    feet = np.full((len(own), points), -1, np.int64)
    for n, (columns, numbers) in enumerate(zip(own, points_on.values(), strict=True)):
        joints[n, : len(columns)], feet[n, : len(numbers)] = columns, numbers
    return joints, feet
