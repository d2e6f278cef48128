"""What breaks a robot's readings: none is called good while the estimate is wrong, and after each
it comes back.

A robot stands, is lifted, swayed and set down. Its readings are computed from that motion, with
noise and biases: the torques are those of inverse dynamics, with the least forces that carry it
where it stands.
"""

import copy
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.controllers.parameters import JOINT_TARGETS
from harpy_pin.estimation import EstimatorSettings
from harpy_pin.estimation.plausibility import KNOWN
from harpy_pin.simulation.sensing import EstimatedState, Sensing

pytestmark = needs_robots
PERIOD = 1e-3
STANDING = np.array([0.0, 0.0, 9.81])
WRONG = 0.05
"""Error of the velocity from which on it is wrong, m/s."""
LATE = 150
"""Ticks in which a fault may not have been seen."""
BACK = 2.0
"""Time after which an estimate has come back, s."""
POSTURE = hp.make_gait(hp.load_harpy()).initial_state()[0][7:]
SLOPE = EstimatorSettings(height_noise=np.inf)


@dataclass
class Motion:
    """Readings, a row for each tick, and the truth."""

    robot: hp.Robot
    inertial: np.ndarray  # (ticks, 6) gyroscope and accelerometer
    joints: np.ndarray  # (ticks, 3, joints) angles, velocities, torques
    q: np.ndarray
    v: np.ndarray

    def readings(self, n):
        spin, push = np.split(self.inertial[n].copy(), 2)
        return hp.Readings(PERIOD * n, spin, push, *self.joints[n].copy())

    def ticks(self, plan, until):
        for n in range(until or len(self.q)):
            yield self.readings(n), plan, self.q[n], self.v[n]


def smooth(x):
    """From 0 to 1 with x, with two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def biases(rng):
    """(6,) of gyroscope and accelerometer."""
    imu = hp.Imu()
    return np.repeat((imu.gyroscope_bias, imu.accelerometer_bias), 3) * rng.standard_normal(6)


def carried(name, duration, aloft=(np.inf, np.inf), *, biased=True):
    """A robot that stands, but between two times, s: then it hangs 0.3 m higher, and sways."""
    robot, imu, rng = hp.load_robot(name), hp.Imu(), np.random.default_rng(0)
    t, model, data = (
        PERIOD * np.arange(round(duration / PERIOD)),
        robot.model,
        robot.model.createData(),
    )
    sway = smooth(t - aloft[0] - 1.0) - smooth(t - aloft[1] + 2.0)
    angles = sway * np.sin(2.5 * t) * np.array([[0.2], [0.1], [0.15]])
    turns = np.array([pin.rpy.rpyToMatrix(*row) for row in angles.T])
    q, v, a = (np.zeros((len(t), size)) for size in (model.nq, model.nv, model.nv))
    q[:, 7:], q[:, 3:7] = robot.posture, [pin.Quaternion(turn).coeffs() for turn in turns]
    feet = [model.getFrameId(foot) for foot in robot.feet]
    pin.framesForwardKinematics(model, data, q[0])
    height = smooth(t - aloft[0]) - smooth(t - aloft[1] + 1.0)
    q[:, 0] = 0.3 * sway * np.sin(2.0 * t)
    q[:, 2] = 0.3 * height - min(data.oMf[foot].translation[2] for foot in feet)
    speed = np.gradient(q[:, :3], PERIOD, axis=0)
    push = np.gradient(speed, PERIOD, axis=0)
    spin = np.array([np.zeros(3)] + [pin.log3(a.T @ b) / PERIOD for a, b in pairwise(turns)])
    v[:, :3], v[:, 3:6] = np.einsum("nji,nj->ni", turns, speed), spin
    a[:, :3] = np.einsum("nji,nj->ni", turns, push) - np.cross(spin, v[:, :3])
    standing, torque = (t < aloft[0]) | (t >= aloft[1]), np.zeros((len(t), model.nv - 6))
    for n in range(len(t)):
        if n > 1 and (q[n] == q[n - 1]).all() and not a[n].any() and standing[n] == standing[n - 1]:
            torque[n] = torque[n - 1]
            continue
        force = pin.rnea(model, data, q[n], v[n], a[n])
        pin.computeJointJacobians(model, data, q[n])
        pin.updateFramePlacements(model, data)
        jacobian = np.vstack(
            [pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED)[:3] for k in feet]
        )
        ground = standing[n] * np.linalg.lstsq(jacobian[:, :6].T, force[:6], rcond=None)[0]
        torque[n] = (force - jacobian.T @ ground)[6:]
    felt = np.einsum("nji,nj->ni", turns, push + STANDING)
    density = np.repeat((imu.gyroscope_density, imu.accelerometer_density), 3) / np.sqrt(PERIOD)
    inertial = np.hstack([spin, felt])
    inertial += density * rng.standard_normal(inertial.shape) + biased * biases(rng)
    noise = np.array([imu.encoder_noise, imu.velocity_noise, imu.torque_noise])[:, None]
    joints = np.stack([q[:, 7:], v[:, 6:], torque], axis=1)
    joints += noise * rng.standard_normal(joints.shape)
    return Motion(robot, inertial, joints, q, v)


def no_fault(readings, n):
    """All readings come as they are."""


def followed(estimator, ticks, spoil=no_fault):
    """What is said, and the error of the velocity, m/s, of readings that a function spoils; where
    it returns False they do not come.
    """
    said, errors = [], []
    for n, (readings, plan, _, v) in enumerate(ticks):
        if spoil(readings, n) is not False:
            state = estimator.step(readings, plan)
            assert np.isfinite(state.q).all()
            said.append(estimator.status)
            errors.append(np.linalg.norm(state.v[:3] - v[:3]))
    assert np.isfinite(errors).all()
    return np.array(said), np.array(errors)


def estimated(motion, spoil=no_fault, *, plan=None, settings=None, known=False, until=None):
    """The same of a motion up to a tick, and the estimator."""
    estimator = hp.Estimator(motion.robot, settings=settings)
    if known:
        estimator.reset(motion.q[0])
    return *followed(estimator, motion.ticks(plan, until), spoil), estimator


def walked(ticks, name, spoil):
    """The same of a walk, from its first state on."""
    estimator = hp.Estimator(hp.load_harpy() if name == "harpy" else hp.load_robot(name))
    estimator.reset(*ticks[0][2:])
    return followed(estimator, ((copy.deepcopy(given), *rest) for given, *rest in ticks), spoil)


def stance(robot):
    feet = len(robot.feet)
    return SimpleNamespace(stance=np.ones(feet), phase=np.zeros(feet), ground_height=np.zeros(feet))


@pytest.fixture(scope="module")
def lifted():
    return carried("go2", 64.5, (1.0, 62.0))


@pytest.fixture(scope="module")
def still():
    return carried("go2", 64.5)


@pytest.mark.parametrize("settings", [None, SLOPE], ids=["level", "slope"])
@pytest.mark.parametrize("expected", [stance, lambda robot: None], ids=["stance", "nothing"])
def test_a_robot_that_was_lifted_for_a_minute(lifted, settings, expected):
    said, errors, _ = estimated(lifted, plan=expected(lifted.robot), settings=settings)
    assert errors.max() > 1.0
    assert not (said[errors > WRONG] == "good").any()
    assert (said[2000:62000] == "feet do not bear the weight").all()
    back = round((62.0 + BACK) / PERIOD)
    assert errors[back:].max() < WRONG
    assert (said[back:] == "good").all()


def switched_off(readings, n):
    """Switches of the feet, which fail between 1 and 62 s."""
    readings.foot_force = np.full(4, 0.0 if 1000 <= n < 62000 else 150.0)


def without_encoders(readings, n):
    if 1000 <= n < 62000:
        readings.joint_position[:] = np.nan


@pytest.mark.parametrize(
    ("spoil", "status"),
    [(switched_off, "feet do not bear the weight"), (without_encoders, "no sample")],
)
def test_feet_that_were_not_felt_for_a_minute(still, spoil, status):
    said, errors, estimator = estimated(still, spoil, plan=stance(still.robot))
    assert errors.max() > 1.0
    assert not (said[errors > WRONG] == "good").any()
    assert (said[10_000:62_000] == status).all()
    back = round((62.0 + BACK) / PERIOD)
    assert errors[back:].max() < WRONG
    assert (said[back:] == "good").all()
    state = estimator.step(still.readings(len(still.q) - 1), None)
    assert (np.abs(state.q[:3] - still.q[-1, :3]) < 4.0 * estimator.position_deviation).all()


def test_the_velocity_is_as_uncertain_as_it_says():
    """Four seconds in the air, with biases of 12 sensors: the mean normalised error is about
    one.
    """
    motion, ratios = carried("go2", 5.0, (1.0, 20.0), biased=False), []
    inertial = motion.inertial
    for seed in range(12):
        motion.inertial = inertial + biases(np.random.default_rng(seed))
        said, errors, estimator = estimated(motion)
        deviation = estimator.velocity_deviation
        assert deviation.max() > KNOWN
        assert said[-1] == "feet do not bear the weight"
        assert f"deviation is {deviation.max():.2g} m/s" in estimator.explanation
        ratios.append(errors[-1] / np.linalg.norm(deviation))
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_no_foothold_is_said(robot):
    """Thrusters bear the weight, so that nothing is wrong with the readings; but the velocity is
    not known.
    """
    estimator, zero, rng = hp.Estimator(robot), np.zeros(6), np.random.default_rng(0)
    lift = np.tile([0.0, 0.0, 0.5 * robot.mass * 9.81], (2, 1))

    def hangs():
        for n in range(15_000):
            spin = 1e-3 * rng.standard_normal(3)
            readings = hp.Readings(PERIOD * n, spin, STANDING, POSTURE.copy(), zero, zero, lift)
            yield readings, None, None, np.zeros(12)

    said, _ = followed(estimator, hangs())
    assert said[0] == "good"
    assert said[-1] == "no foothold"
    assert f"{estimator.velocity_deviation.max():.2g} m/s" in estimator.explanation


def turned(readings, n):
    readings.accelerometer *= -1.0


def in_g(readings, n):
    readings.accelerometer /= 9.81


def twice(readings, n):
    readings.accelerometer *= 9.81


def without_gravity(readings, n):
    readings.accelerometer[2] -= 9.81


def in_degrees(readings, n):
    readings.gyroscope *= 180.0 / np.pi


def no_torque(readings, n):
    readings.joint_torque[:] = 0.0


def opposite_torque(readings, n):
    readings.joint_torque *= -1.0


def between(begin, end, spoil):
    """A fault from one tick to another."""
    return lambda readings, n: spoil(readings, n) if begin <= n < end else None


def clock(factor):
    def spoil(readings, n):
        readings.t *= factor

    return spoil


IMPLAUSIBLE = {
    "upside down": (turned, "gravity upside down", "(0, 0, +9.81)"),
    "g": (in_g, "gravity is not felt", "m/s² and not 9.81; near 1 it is in units of g"),
    "twice": (twice, "gravity is not felt", "near 96 it was multiplied by g twice"),
    "without gravity": (without_gravity, "gravity is not felt", "near 0 gravity was taken off"),
    "degrees": (in_degrees, "gyroscope contradicts the legs", "may be in degrees per second"),
    "no torque": (
        no_torque,
        "feet do not bear the weight",
        "of the weight; the robot is carried or lies",
    ),
    "opposite torque": (opposite_torque, "gravity upside down", "torques must have the sign"),
    "ms": (clock(1e3), "clock in other units", "must be in s"),
    "us": (clock(1e6), "clock in other units", "must be in s"),
    "ns": (clock(1e9), "clock in other units", "must be in s"),
    "ks": (clock(1e-3), "time does not go on", "must be in s"),
}


@pytest.mark.parametrize("known", [False, True], ids=["from gravity", "from a configuration"])
@pytest.mark.parametrize("name", IMPLAUSIBLE)
def test_what_cannot_be_is_said(still, name, known):
    spoil, status, cause = IMPLAUSIBLE[name]
    said, errors, estimator = estimated(still, spoil, known=known, until=4000)
    assert (said[errors > WRONG] == "good").sum() < LATE
    assert (said[2500:] == status).all()
    assert cause in estimator.explanation
    assert estimator.explanation.startswith(status)


@pytest.mark.parametrize("name", ["upside down", "g", "twice", "without gravity", "degrees"])
def test_what_was_implausible_comes_back(still, name):
    """Five seconds of it; then all is well."""
    spoil = IMPLAUSIBLE[name][0]
    said, errors, _ = estimated(still, between(1000, 6000, spoil), until=11000)
    lies = (errors > WRONG) & (said == "good")
    assert lies.sum() < LATE
    assert not lies[2000:].any()
    assert errors[9000:].max() < WRONG
    assert (said[9000:] == "good").all()


@pytest.fixture(scope="module")
def walks():
    """Of Harpy, Go2 and G1: readings, targets and the truth."""
    found = {}
    for name in ("harpy", "go2", "g1"):
        ticks = []

        class Kept(EstimatedState):
            def measure(self, state, ticks=ticks):
                readings, sensing = [], self.sensing
                read = sensing.read
                sensing.read = lambda *given: readings.append(read(*given)) or readings[0]
                super().measure(state)
                sensing.read, target = read, self._controller.target
                plan = SimpleNamespace(
                    **{n: getattr(target, n).copy() for n in ("stance", "phase", "ground_height")}
                )
                ticks.append((readings[0], plan, state.q.copy(), state.v.copy()))
                return state

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("harpy_pin.simulation.sensing.EstimatedState", Kept)
            hp.walk(
                hp.Scenario(robot=name, sensors=hp.Imu(), ground=hp.Ground(mu_s=0.6), duration=4.5)
            )
        found[name] = ticks
    return found


def lost(readings):
    for array in (readings.gyroscope, readings.accelerometer, readings.joint_position):
        array[:] = np.nan


HARD = {"100 m/s² ahead": (100.0, 0.0, 0.0), "down": (0.0, -40.0, 60.0), "none": (0.0, 0.0, 0.0)}


@pytest.mark.parametrize("gap", [50, 100, 200])
@pytest.mark.parametrize("hard", [*HARD, "NaN"])
@pytest.mark.parametrize("name", ["harpy", "go2"])
def test_a_loop_that_stalls(walks, name, hard, gap):
    """While it walks, before a sample of a hard impact; or with readings that are not numbers."""
    end = 2000 + gap

    def stalls(readings, n):
        if 2000 <= n < end and hard == "NaN":
            lost(readings)
        if n == end and hard != "NaN":
            readings.accelerometer += HARD[hard]
        return hard == "NaN" or not 2000 <= n < end

    said, errors = walked(walks[name], name, stalls)
    assert not (said[errors > WRONG] == "good").any()
    assert errors[-400:].max() < 0.02
    assert (said[-400:] == "good").all()


def scaled(factor, *names):
    """Of angles in degrees, or of another sign."""

    def spoil(readings, n):
        for name in names:
            setattr(readings, name, factor * getattr(readings, name))

    return spoil


def stuck_encoders(readings, n):
    readings.joint_position[:] = POSTURE[0]


DISAGREE, DEGREES = "angles contradict velocities", 180.0 / np.pi
IN_A_WALK = {name: IMPLAUSIBLE[name][:2] for name in IMPLAUSIBLE} | {
    "encoders in degrees": (scaled(DEGREES, "joint_position"), DISAGREE),
    "all angles in degrees": (scaled(DEGREES, "joint_position", "joint_velocity"), ""),
    "stuck encoders": (stuck_encoders, DISAGREE),
    "opposite velocities": (scaled(-1.0, "joint_velocity"), DISAGREE),
    "opposite torque": (opposite_torque, ""),
}
del IN_A_WALK["ks"]


@pytest.mark.parametrize("fault", IN_A_WALK)
@pytest.mark.parametrize("name", ["harpy", "go2", "g1"])
def test_a_fault_in_a_walk_is_said_soon(walks, name, fault):
    """For 1.5 s of a walk."""
    spoil, status = IN_A_WALK[fault]
    said, errors = walked(walks[name], name, between(1500, 3000, spoil))
    assert (said[errors > WRONG] == "good").sum() < LATE
    assert not status or status in said[1500:3000]
    assert np.mean(said[2500:3000] == "good") < 0.5


@pytest.mark.parametrize("begin", [1000, 1500, 2000, 2500])
@pytest.mark.parametrize("name", ["harpy", "go2", "g1"])
def test_degrees_per_second_are_said_as_soon_as_they_hurt(walks, name, begin):
    """In any phase of a walk, on one foot, too, within 20 ticks; and never before."""
    fault = between(begin, begin + 1000, in_degrees)
    said, errors = walked(walks[name][: begin + 1000], name, fault)
    assert (said[:begin] == "good").all()
    assert (said[errors > WRONG] == "good").sum() < 20
    assert "gyroscope contradicts the legs" in said[errors > WRONG]


@pytest.mark.parametrize(
    ("name", "plant", "held"),
    [
        ("go2", "compliant", {}),
        ("go2", "compliant", JOINT_TARGETS),
        ("go2", "mujoco", JOINT_TARGETS),
        ("g1", "compliant", JOINT_TARGETS),
    ],
    ids=str,
)
def test_a_walk_without_any_reading_for_200_ms(monkeypatch, name, plant, held):
    """It goes on as intended: nobody falls, and the velocity is right soon after.

    Torques alone fell it in MuJoCo.
    """
    begin = 1.5 + 0.3 * len(held) / 3 + 0.1 * (plant == "mujoco") + 0.3 * (name == "g1")
    read = Sensing.read

    def spoilt(sensing, state, *given):
        readings = read(sensing, state, *given)
        if begin <= state.t < begin + 0.2:
            lost(readings)
            readings.joint_velocity[:] = readings.joint_torque[:] = np.nan
        return readings

    monkeypatch.setattr(Sensing, "read", spoilt)
    how = {
        "gait": hp.Walking(velocity=(0.5 if name == "go2" else 0.3, 0.0, 0.0)),
        "controller": {"name": "condensed", "parameters": held},
    }
    scenario = hp.Scenario(
        robot=name, plant=plant, state="estimated", ground=hp.Ground(mu_s=0.6), duration=3.5, **how
    )
    run = hp.walk(scenario)
    assert run.ending == "completed"
    error = np.linalg.norm(run["estimated_v"][:, :3] - run["v"][:, :3], axis=1)
    without = (begin <= run["t"]) & (run["t"] < begin + 0.2)
    assert (run["estimator_status"][without] != 0).all()
    assert not (run["estimator_status"][error > WRONG] == 0).any()
    assert error[run["t"] > begin + 0.7].max() < WRONG


def test_targets_and_starts_that_are_no_numbers(robot):
    estimator, zero = hp.Estimator(robot), np.zeros(6)
    readings = hp.Readings(0.0, np.zeros(3), STANDING, POSTURE.copy(), zero, zero)
    for name in ("stance", "phase", "ground_height"):
        target = stance(robot)
        getattr(target, name)[1] = np.nan
        with pytest.raises(hp.InputError, match="must be finite"):
            estimator.step(readings, target)
    assert np.isfinite(estimator.step(readings, stance(robot)).foot_force).all()
    with pytest.raises(hp.InputError, match="at most 1e"):
        estimator.reset(v=np.full(12, 1e200))
    with pytest.raises(hp.InputError, match="at most 1e"):
        estimator.reset(q=np.concatenate([[1e200, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], POSTURE]))


def test_states_that_are_given_another_shape_are_refused_until_the_reset(robot):
    """Nothing is written past their ends: kernels write into the record, whose memory no view
    changes.
    """
    estimator, zero = hp.Estimator(robot), np.zeros(6)
    readings = [
        hp.Readings(1e-3 * n, zero[:3], STANDING, POSTURE.copy(), zero, zero) for n in range(2)
    ]
    controller = hp.make_controller("condensed", hp.make_gait(robot), mu=0.5)
    state = estimator.step(readings[0])
    with pytest.raises(ValueError, match="resize"):
        state.q.resize((3,), refcheck=False)
    state.q.shape = (13, 1)
    with pytest.raises(hp.InputError, match=r"state.q must have shape \(13,\)"):
        controller.step(estimator.step(readings[1]))
    fresh = hp.Estimator(robot)
    for given in readings[:2]:
        same = fresh.step(given)
    np.testing.assert_array_equal(estimator.signals["estimated_q"].ravel(), same.q)
    estimator.reset()
    assert estimator.step(readings[0]).q.shape == (13,)


def test_a_reset_estimator_is_a_new_one(walks):
    """After a walk with faults, to the bit, also without readings."""
    robot, used = hp.load_harpy(), hp.Estimator(hp.load_harpy())
    acceleration = np.full(12, 3.0)
    for n, (readings, plan, _, _) in enumerate(walks["harpy"][:2000]):
        given = copy.deepcopy(readings)
        if n % 200 > 150:
            IN_A_WALK["encoders in degrees"][0](given, n)
        used.step(given, plan, acceleration)
    used.reset()
    fresh = hp.Estimator(robot)
    for n, (readings, plan, _, _) in enumerate(walks["harpy"][2000:2600]):
        given = copy.deepcopy(readings)
        given.thrust = given.thrust if n % 2 else None
        if 200 < n < 300:
            lost(given)
        one, other = (each.step(given, plan) for each in (used, fresh))
        for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_probabilities_that_are_given_another_shape_are_no_ones_else(robot):
    estimator = hp.Estimator(robot)
    estimator.probability.shape = (2, 1)
    assert estimator.probability.shape == (2,)
