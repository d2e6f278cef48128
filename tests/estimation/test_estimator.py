"""The estimator on simulated sensors: what it finds out, what it says of bad readings, and walks on
it alone.
"""

import copy

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_mujoco, needs_robots

import harpy_pin as hp
from harpy_pin.estimation import EstimatorSettings
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.simulation.sensing import Sensing

STANDING = np.array([0.0, 0.0, 9.81])
POSTURE = hp.make_gait(hp.load_harpy()).initial_state()[0][7:]
LEVEL = np.eye(3)
SLOPE = EstimatorSettings(height_noise=np.inf)
NAMES = ("gyroscope", "accelerometer", "joint_position", "joint_velocity")
STATES = ("q", "v", "foot_position", "foot_velocity", "foot_force")
EXACT = {
    name: 0.0
    for name in ("gyroscope_bias", "accelerometer_bias", "encoder_resolution", "torque_error")
}


def still(robot, t=0.0, *, tilt=LEVEL):
    """Readings of a robot at rest, tilted about its feet, without noise."""
    zero = np.zeros(len(robot.joints))
    quiver = np.full(3, 1e-9 * np.sin(1e5 * t))  # a gyroscope that says always the same is stuck
    return hp.Readings(
        t, quiver, tilt.T @ STANDING, POSTURE.copy(), zero, zero.copy(), None, np.full(2, 25.0)
    )


def rotations(q):
    return [pin.Quaternion(row[3:7]).toRotationMatrix() for row in q]


def errors(run):
    """Drift as a share of the way, rms of velocity, m/s, and of tilt, rad."""
    q, guess = run["q"], run["estimated_q"]
    way = np.linalg.norm(np.diff(q[:, :2], axis=0), axis=1).sum()
    true, own = rotations(q), rotations(guess)
    v = [
        a @ x[:3] - b @ y[:3]
        for a, x, b, y in zip(true, run["v"], own, run["estimated_v"], strict=True)
    ]
    tilt = [np.arccos(min(a[2] @ b[2], 1.0)) for a, b in zip(true, own, strict=True)]
    drift = np.linalg.norm((q - guess)[-1, :2] - (q - guess)[0, :2]) / way
    return drift, np.sqrt(np.mean(np.square(v)) * 3.0), np.sqrt(np.mean(np.square(tilt)))


@pytest.mark.parametrize(
    ("name", "plant"),
    [
        pytest.param("harpy", "mujoco", marks=needs_mujoco),
        pytest.param("go2", "compliant", marks=needs_robots),
    ],
)
def test_walk_on_the_estimate(name, plant):
    run = hp.walk(
        hp.Scenario(
            robot=name, plant=plant, state="estimated", ground=hp.Ground(mu_s=0.5), duration=3.0
        )
    )
    assert run.ending == "completed"
    drift, velocity, tilt = errors(run)
    assert drift < 0.02
    assert velocity < 0.02
    assert tilt < np.deg2rad(0.6)
    assert not run["estimator_status"].any()
    touching, held = run["foot_force"][:, :, 2] > 1.0, run["contact_probability"] > 0.5
    assert (touching & held).sum() > 0.95 * held.sum()
    assert (touching & held).sum() > 0.95 * touching.sum()


def test_exact_sensors_know_the_forces():
    """On the true state the momentum observer's forces are those of the plant, but for its
    delay.
    """
    sensors = hp.Imu(
        **EXACT, encoder_noise=0.0, velocity_noise=0.0, torque_noise=0.0, accelerometer_density=0.0
    )
    run = hp.walk(hp.Scenario(sensors=sensors, ground=hp.Ground(mu_s=0.5), duration=2.0))
    force, guess = run["foot_force"][500:], run["estimated_force"][500:]
    steady = np.abs(np.gradient(force, axis=0)).max(axis=(1, 2)) < 0.1
    assert steady.mean() > 0.3
    assert np.sqrt(np.mean((force - guess)[steady] ** 2)) < 0.02 * force.max()


@needs_robots
def test_joints_are_learned_in_swings():
    """Damping and dry friction that the model lacks do not look like forces of the ground."""
    actuators = hp.Actuators(viscous_friction=0.3, coulomb_friction=0.6)
    gait = hp.Walking(velocity=(0.4, 0.0, 0.0))
    disturbances = hp.Disturbances(actuators=actuators)
    law = hp.Condensed(
        parameters={"joint_stiffness": 1.0, "joint_damping": 0.3, "contact_damping": 20.0}
    )
    how = {"ground": hp.Ground(mu_s=0.6), "controller": law, "duration": 2.0}
    walk = hp.build(
        hp.Scenario(
            robot="go2", gait=gait, sensors=hp.Imu(**EXACT), disturbances=disturbances, **how
        )
    )
    walk.run()
    found = walk.sensors.estimator.record["contact"]["joint"][0].reshape(4, 3, 3)[
        :, 1:
    ]  # thighs and calves
    np.testing.assert_allclose(np.median(found[..., 1]), 0.3, atol=0.15)
    np.testing.assert_allclose(np.median(found[..., 2]), 0.6, atol=0.2)


@pytest.mark.parametrize(
    ("phase", "speed", "height", "lands"),
    [
        (0.5, 0.0, 0.0, True),
        (0.5, 0.5, 0.0, False),
        (0.2, 0.0, 0.0, False),
        (0.5, 0.0, -0.05, False),
    ],
)
def test_a_foot_at_rest_late_in_its_swing_has_landed(robot, phase, speed, height, lands):
    """Though it pushes nothing: where the ground is, and after half of the swing."""
    estimator, target = hp.Estimator(robot), GaitTarget()
    target.stance[0], target.phase[0], target.ground_height[0] = (
        0.0,
        phase,
        0.003 + height,
    )  # that of this foot
    for n in range(100):
        readings = still(robot, 1e-3 * n)
        readings.foot_force[:] = 0.0, 50.0
        readings.joint_velocity[:3] = speed
        state = estimator.step(readings, target)
    assert (state.foot_force[0, 2] > 0.01 * 9.81 * robot.mass) == lands
    assert estimator.probability[0] < 0.5  # the filter does not hold on to it before it is loaded


def test_sensors_alone_do_not_change_a_walk():
    plain = hp.walk(hp.Scenario(duration=0.5))
    sensed = hp.walk(hp.Scenario(duration=0.5, sensors=hp.Imu()))
    np.testing.assert_array_equal(plain["q"], sensed["q"])
    assert "estimated_q" in sensed.signals
    assert hp.Scenario.of(sensed) == hp.Scenario(duration=0.5, sensors=hp.Imu())


def test_place_and_heading_do_not_matter(robot):
    """The same readings from two places and headings give the same motion, turned."""
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, 2.0)
    rng = np.random.default_rng(0)
    one, other = (hp.Estimator(robot) for _ in "12")
    q, v = hp.make_gait(robot).initial_state()
    away = q.copy()
    away[:2] += (300.0, -200.0)
    away[3:7] = pin.Quaternion(turn @ pin.Quaternion(q[3:7]).toRotationMatrix()).coeffs()
    one.reset(q, v)
    other.reset(away, v)
    for n in range(300):
        readings = still(robot, 1e-3 * n)
        readings.gyroscope += 0.2 * rng.standard_normal(3)
        readings.accelerometer += rng.standard_normal(3)
        readings.joint_position += 1e-3 * rng.standard_normal(6)
        if n > 150:
            readings.foot_force[n // 50 % 2] = 0.0
        a, b = one.step(readings), other.step(readings)
    np.testing.assert_allclose(b.v, a.v, atol=1e-9)
    np.testing.assert_allclose(b.q[:3] - away[:3], turn @ (a.q[:3] - q[:3]), atol=1e-9)
    np.testing.assert_allclose(rotations(b.q[None])[0], turn @ rotations(a.q[None])[0], atol=1e-9)
    covariance = one.record["filter"]["covariance"][0, 9:15, 9:15]
    np.testing.assert_allclose(
        other.record["filter"]["covariance"][0, 9:15, 9:15], covariance, atol=1e-12
    )
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.6)])
def test_first_sample_says_how_the_body_is_tilted(robot, tilt):
    turn, estimator = pin.rpy.rpyToMatrix(*tilt, 0.0), hp.Estimator(robot, settings=SLOPE)
    state = estimator.step(still(robot, tilt=turn))
    np.testing.assert_allclose(rotations(state.q[None])[0][2], turn[2], atol=1e-12)
    assert state.foot_position[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    for n in range(1, 500):
        state = estimator.step(still(robot, 1e-3 * n, tilt=turn))
    np.testing.assert_allclose(state.v, 0.0, atol=1e-6)
    assert estimator.status == "good"


def test_place_of_the_inertial_unit_does_not_matter():
    """A unit away from the body's origin, with axes of its own, tells the same."""
    for imu in (
        hp.Imu(**EXACT),
        hp.Imu(**EXACT, position=(0.1, -0.05, 0.08), orientation=(0.3, -1.2, 2.0)),
    ):
        run = hp.walk(hp.Scenario(sensors=imu, duration=2.0))
        drift, velocity, tilt = errors(run)
        assert drift < 0.02
        assert velocity < 0.02
        assert tilt < np.deg2rad(0.3)


SPOILED = {
    "nan": ("no sample", lambda given, n: given.gyroscope.__setitem__(n % 3, np.nan)),
    "no legs": ("no sample", lambda given, _: given.joint_position.fill(np.inf)),
    "huge": ("no sample", lambda given, _: given.joint_torque.fill(1e7)),
    "stuck": ("stuck gyroscope", lambda given, _: given.gyroscope.fill(0.01)),
    "saturated": ("saturated", lambda given, _: given.accelerometer.__setitem__(2, 157.0)),
    "backwards": ("time does not go on", lambda given, _: setattr(given, "t", given.t - 1.0)),
}


@pytest.mark.parametrize("name", SPOILED)
def test_bad_readings_are_said_and_survived(robot, name):
    status, spoil = SPOILED[name]
    rng, estimator = np.random.default_rng(1), hp.Estimator(robot)
    seen = set()
    for n in range(1200):
        readings = still(robot, 1e-3 * n)
        readings.gyroscope += 1e-3 * rng.standard_normal(3)
        bad = 400 <= n < 470
        if bad:
            spoil(readings, n)
        state = estimator.step(readings)
        assert all(
            np.isfinite(x).all() for x in (state.q, state.v, state.foot_position, state.foot_force)
        )
        if bad:
            seen.add(estimator.status)
    assert status in seen
    assert estimator.status == "good"
    np.testing.assert_allclose(state.v, 0.0, atol=0.02)
    assert rotations(state.q[None])[0][2, 2] > np.cos(0.02)


def test_a_clock_that_was_set_back_is_followed(robot):
    estimator, said = hp.Estimator(robot, settings=SLOPE), []
    for t in (*np.arange(5.0, 5.2, 1e-3), np.nan, *np.arange(0.0, 0.2, 1e-3)):
        estimator.step(still(robot, t))
        said.append(estimator.status)
    assert said.count("time does not go on") < 30
    assert said.count("no sample") == 1
    assert said[-1] == "good"


def test_a_gap_is_made_up_for(robot):
    """Of samples that are missing the last one holds; after a long pause the estimate goes on from
    where it was.
    """
    estimator = hp.Estimator(robot, settings=SLOPE)
    for t in (
        *np.arange(0.0, 0.5, 1e-3),
        *np.arange(0.53, 0.8, 1e-3),
        *np.arange(100.0, 100.3, 1e-3),
    ):
        state = estimator.step(still(robot, t))
    assert estimator.status == "good"
    np.testing.assert_allclose(state.v, 0.0, atol=1e-3)


QUIET = {
    name: 0.0
    for name in ("gyroscope_density", "accelerometer_density", "encoder_noise", "velocity_noise")
}
FINE = 2e-4
"""Between the states of a run, s."""


@pytest.fixture(scope="module")
def fine_run():
    return hp.walk(hp.Scenario(ground=hp.Ground(mu_s=0.8), dt=FINE, period=FINE, duration=3.0))


@pytest.mark.parametrize("steps", [(3,), (4,), (6,), (8,), (4, 5, 6), (5,) * 40 + (50,)], ids=str)
def test_the_time_that_passes_counts(robot, fine_run, steps):
    """Steps of 0.6 to 1.6 ms, uneven ones, and gaps of 10 ms: the place is that of steps of the
    stated 1 ms.
    """

    def end(multiples):
        run, k, n = fine_run, 0, 0
        sensing = Sensing(robot, hp.Imu(**EXACT, **QUIET, torque_noise=0.0), period=1e-3)
        estimator = hp.Estimator(robot)
        estimator.reset(run["q"][0], run["v"][0])
        while k < len(run):
            before, sensing.period = (
                max(k - multiples[n % len(multiples)], 0),
                FINE * multiples[n % len(multiples)],
            )
            state = hp.State(run["t"][k], *(run[name][k] for name in STATES))
            readings = sensing.read(
                state, run["torque"][before : k + 1].mean(0), run["thrust"][before : k + 1].mean(0)
            )
            estimate, last = estimator.step(readings), k
            n += 1
            k += multiples[n % len(multiples)]
        return estimate.q[:3] - run["q"][last, :3]

    way = np.linalg.norm(np.diff(fine_run["q"][:, :2], axis=0), axis=1).sum()
    np.testing.assert_allclose(end(steps), end((5,)), rtol=0, atol=1e-3 * way)


def test_steps_that_are_missing_are_said(robot):
    estimator, said = hp.Estimator(robot), []
    for t in (0.0, 0.001, 0.0024, 0.0044, 0.0054):
        estimator.step(still(robot, t))
        said.append(estimator.status)
    assert said == ["good", "good", "good", "steps are missing", "good"]


@pytest.mark.parametrize("settings", [SLOPE, EstimatorSettings()], ids=["slope", "level"])
@pytest.mark.parametrize("acceleration", [(20.0, 0.0, 0.0), (-30.0, 40.0, 10.0)])
def test_feet_that_agree_are_believed_against_a_velocity_that_is_lost(
    robot, acceleration, settings
):
    """A blow while the encoders are gone: metres per second, with which no foot could be in
    contact.
    """
    estimator, said, speed = hp.Estimator(robot, settings=settings), [], []
    for n in range(3000):
        readings = still(robot, 1e-3 * n)
        if 500 <= n < 700:
            readings.joint_position[:] = np.nan
            readings.accelerometer += acceleration
        state = estimator.step(readings)
        said.append(estimator.status)
        speed.append(np.linalg.norm(state.v[:3]))
    assert max(speed) > 3.0
    assert max(speed[2000:]) < 0.05
    assert all(status != "good" for status, v in zip(said[:2000], speed, strict=False) if v > 1.0)
    assert said[-1] == "good"


def test_a_wrong_mounting_is_said(robot):
    run = hp.walk(hp.Scenario(sensors=hp.Imu(), duration=3.0))
    mounted = [(0.4, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 1.5), (np.pi, 0.0, 0.0)]
    wrong = [hp.Estimator(robot, hp.Imu(orientation=orientation)) for orientation in mounted]
    for each in wrong:
        each.reset(run["q"][0], run["v"][0])
    sensing, said = Sensing(robot, hp.Imu(), period=1e-3), np.zeros(len(wrong))
    for n, t in enumerate(run["t"]):
        state = hp.State(
            t,
            *(run[name][n] for name in ("q", "v", "foot_position", "foot_velocity", "foot_force")),
        )
        readings = sensing.read(state, run["torque"][max(n - 1, 0)], run["thrust"][max(n - 1, 0)])
        for each in wrong:
            each.step(readings)
        said += [each.status == "readings contradict each other" for each in wrong]
    assert (said > 100).all()


@needs_robots
def test_contacts_that_shake_the_robot_are_no_contradiction():
    """MuJoCo's default contact creeps under round feet, and looks like a bias of the
    accelerometer.
    """
    plant, ground = hp.Mujoco("default", foot_radius=0.022), hp.Ground(mu_s=0.6)
    run = hp.walk(
        hp.Scenario(robot="anymal_c", state="estimated", plant=plant, ground=ground, duration=5.0)
    )
    np.testing.assert_allclose(run["estimated_q"][-1, :3], run["q"][-1, :3], atol=0.03)
    assert (run["estimator_status"] == 0.0).all()


def test_misfits_are_refused(robot):
    estimator, good = hp.Estimator(robot), still(robot)
    for name in (*NAMES, "joint_torque", "foot_force", "thrust"):
        bad = copy.copy(good)
        setattr(bad, name, np.zeros(7))
        with pytest.raises(hp.InputError, match=name):
            estimator.step(bad)
    lists = hp.Readings(0.0, [0, 0, 0], [0, 0, 9.81], [0.0] * 6, [0.0] * 6, [0.0] * 6)
    assert np.isfinite(estimator.step(lists).q).all()
    with pytest.raises(hp.InputError, match="noise of their own"):
        hp.Scenario(state="estimated", disturbances=hp.Disturbances(noise=hp.Noise.typical()))
    with pytest.raises(hp.InputError, match="valid names: estimated, true"):
        hp.Scenario(state="guessed")


def test_copies_and_resets_are_their_own(robot):
    estimator = hp.Estimator(robot)
    for n in range(100):
        estimator.step(still(robot, 1e-3 * n))
    twin = copy.deepcopy(estimator)
    moving = still(robot, 0.1)
    moving.gyroscope[:] = 3.0
    estimator.step(moving)
    other = hp.Estimator(robot)
    for n in range(101):
        state = other.step(still(robot, 1e-3 * n))
    np.testing.assert_array_equal(twin.step(still(robot, 0.1)).q, state.q)
    estimator.reset()
    np.testing.assert_array_equal(
        estimator.step(still(robot)).q, hp.Estimator(robot).step(still(robot)).q
    )
