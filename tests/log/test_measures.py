"""Measures of runs made by hand, with everything known beforehand."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin import InputError, Run, measure
from harpy_pin.log.measures import WORDS, body_angles, contact_age

PERIOD = 1e-3


def still(rows, **metadata):
    """Two feet on the ground, 20 N each, nothing moves."""
    q = np.zeros((rows, 13))
    q[:, 2], q[:, 6] = 0.6, 1.0
    foot = np.tile([[0.0, 0.15, 0.0], [0.0, -0.15, 0.0]], (rows, 1, 1))
    force = np.zeros((rows, 2, 3))
    force[1:, :, 2] = 20.0  # the first row is logged before the first step
    signals = {
        "t": PERIOD * np.arange(rows),
        "q": q,
        "v": np.zeros((rows, 12)),
        "foot_position": foot,
        "foot_velocity": np.zeros((rows, 2, 3)),
        "foot_force": force,
        "torque": np.zeros((rows, 6)),
        "thrust": np.zeros((rows, 2, 3)),
    }
    return Run(signals, {"ending": "completed", "control_period": PERIOD, **metadata})


def move(run, foot, first, last, speed, axis=0):
    """Let a foot slide with a speed during rows first..last."""
    velocity = np.zeros(len(run))
    velocity[first:last] = speed
    run["foot_velocity"][:, foot, axis] += velocity
    run["foot_position"][:, foot, axis] += PERIOD * np.cumsum(velocity)


def test_standing_still():
    found = measure(still(1500))
    assert not found.fell
    assert found.ending == "completed"
    assert found.duration_s == pytest.approx(1.5)
    assert found.steps == pytest.approx(2.0)
    for name in (
        "slip_mm_per_step",
        "late_slip_mm_per_step",
        "sliding",
        "low_force",
        "no_contact",
        "distance_m",
    ):
        assert getattr(found, name) == 0.0, name
    assert np.isnan(found.tracking_rms_mm)
    assert found.thrust_rms_n == found.thrust_max_n == found.torque_max_nm == 0.0
    assert found.solver_failures == 0


def test_sums_of_the_physics_steps_are_taken_where_they_are_logged():
    run = still(1500)
    rows = np.arange(1500.0)
    # what was before does not count
    run.signals["slip_path"] = np.stack((2e-6 * rows, 1e-6 * rows), axis=1) + 7.0
    run.signals["slip_net"] = np.stack((1e-6 * rows, 0.5e-6 * rows), axis=1) + 3.0
    found = measure(run)
    assert found.slip_mm_per_step == pytest.approx(3e-3 * 1499 / 2)
    assert found.net_slip_mm_per_step == pytest.approx(1.5e-3 * 1499 / 2)


def test_late_slip_leaves_out_fifty_ms_after_touchdown():
    run = still(1500)
    run["foot_force"][400:800, 0, 2] = 0.0
    move(run, 0, 801, 840, 0.1)  # within 50 ms of touchdown: 3.9 mm
    early = measure(run)
    assert early.slip_mm_per_step == pytest.approx(3.9 / 2, rel=1e-9)
    assert early.late_slip_mm_per_step == 0.0
    move(run, 1, 900, 910, 0.1)  # the other foot, long on the ground: 1 mm
    late = measure(run)
    assert late.slip_mm_per_step == pytest.approx(4.9 / 2, rel=1e-9)
    assert late.late_slip_mm_per_step == pytest.approx(1.0 / 2, rel=1e-9)


def test_a_bounce_is_not_a_touchdown():
    run = still(1500)
    run["foot_force"][400:410, 0, 2] = 0.0  # 10 ms
    move(run, 0, 415, 425, 0.1)
    assert measure(run).late_slip_mm_per_step == pytest.approx(1.0 / 2, rel=1e-9)


def test_step_duration_and_period_come_from_the_run():
    run = still(1000, control_period=2e-3, parameters={"gait": {"step_duration": 0.5}})
    found = measure(run)
    assert found.duration_s == pytest.approx(2.0)
    assert found.steps == pytest.approx(4.0)
    assert measure(run, step_duration=0.25).steps == pytest.approx(8.0)


def test_distance_tracking_thrust_torque():
    run = still(1000)
    run["q"][:, 0] = np.linspace(1.0, 1.3, 1000)
    run.signals["x_r"] = np.zeros((1000, 6))
    run["x_r"][:, :3] = run["q"][:, :3] + np.array([0.003, 0.0, -0.004])
    run["thrust"][:, 0] = [3.0, 0.0, 4.0]  # 5 N
    run["thrust"][:500, 1] = [0.0, 0.0, 7.0]
    run["torque"][17, 3] = -6.5
    run["torque"][18, 2] = 5.0
    run["v"][:, 6 + 3] = -2.0  # the joint gives 13 W in a tick
    run["v"][:, 6 + 2] = -2.0  # and this one brakes
    found = measure(run)
    assert found.joint_power_w == pytest.approx(13.0 / 1000)
    fan = 1000.0 / 18.0**1.5
    assert found.thrust_power_w == pytest.approx(fan * (5.0**1.5 + 0.5 * 7.0**1.5))
    assert found.distance_m == pytest.approx(0.3)
    assert found.tracking_rms_mm == pytest.approx(5.0)
    assert found.thrust_rms_n == pytest.approx(np.sqrt((12.0**2 + 5.0**2) / 2))
    assert found.thrust_max_n == pytest.approx(7.0)
    assert found.torque_max_nm == 6.5


def test_power_is_that_of_the_thrusts_that_there_were():
    run = still(10)
    run["thrust"][:, 0] = [0.0, 0.0, 50.0]
    run.signals["applied_thrust"] = np.zeros((10, 2, 3))
    run.signals["applied_thrust"][:, 1] = [0.0, 18.0, 0.0]
    assert measure(run).thrust_power_w == pytest.approx(1000.0)
    run.signals["applied_thrust"] = np.zeros((10, 3))
    with pytest.raises(InputError, match="applied_thrust"):
        measure(run)


@given(roll=st.floats(-3.1, 3.1), pitch=st.floats(-1.5, 1.5), yaw=st.floats(-3.1, 3.1))
def test_body_angles_are_roll_pitch_yaw(roll, pitch, yaw):
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    q = np.concatenate((np.zeros(3), pin.Quaternion(rotation).coeffs(), np.zeros(6)))
    np.testing.assert_allclose(body_angles(q[None]), [[roll, pitch, yaw]], atol=1e-7)


def test_robot_without_thrusters_or_joints():
    run = still(5)
    run.signals["thrust"], run.signals["torque"] = np.zeros((5, 0, 3)), np.zeros((5, 0))
    found = measure(run)
    assert np.isnan([found.thrust_rms_n, found.thrust_max_n, found.thrust_power_w]).all()
    assert found.torque_max_nm == 0.0
    assert "thrust" not in str(found)


def test_why_a_walk_fell():
    """Joints less their targets for the middle of a tick, forces less those planned before, torques
    at limits.
    """
    run, rng = still(4), np.random.default_rng(0)
    assert np.isnan(
        [measure(run).joint_tracking_rms_rad, measure(run).force_mismatch, measure(run).clipped]
    ).all()
    q, law, force, planned = (
        rng.normal(size=(4, *size)) for size in ((13,), (4, 6), (2, 3), (2, 3))
    )
    run.signals.update(q=q, motor_law=law, foot_force=force, desired_force=planned)
    run.signals["torque"][:] = [[0.5, -2.0, 0, 0, 0, 0], *[[-0.9] * 6] * 2, [9.0] * 6]
    run.metadata.update({"torque_limit": [1.0, 2.0, None, None, None, None], "mass": 2.0})
    found = measure(run)
    apart = [law[k, 0] - 0.5 * (q[k, 7:] + q[k + 1, 7:]) for k in range(3)]
    off = [np.linalg.norm(force[k + 1] - planned[k]) ** 2 for k in range(3)]
    assert found.joint_tracking_rms_rad == pytest.approx(np.sqrt(np.mean(np.square(apart))))
    assert found.force_mismatch == pytest.approx(np.sqrt(np.mean(off)) / (2.0 * 9.81))
    assert (found.clipped, found.causes.count(";")) == (0.5, 2)
    for strange in (3, [1.0], ["a"] * 6, [10**400] * 6, [[1.0]] * 6):
        run.metadata["torque_limit"] = strange
        assert np.isnan(measure(run).clipped)


def test_measures_are_those_of_their_definition():
    """Feet that come and go, slide and touch down; a tilt and a peak in one row each."""
    rng = np.random.default_rng(0)
    run = still(400)
    run["foot_force"][:, :, 2] = np.repeat(rng.integers(0, 2, (40, 2)), 10, axis=0) * rng.uniform(
        1.0, 30.0, (400, 2)
    )
    for name in ("foot_position", "foot_velocity"):
        run[name][:] = 0.01 * rng.normal(size=(400, 2, 3))
    run["q"][211, 3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.6, -0.1, 0.2)).coeffs()
    run.signals["qp_status"] = rng.integers(0, 4, 400)
    expected = by_definition(run)
    found = measure(run)
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-13), name
    assert np.isnan(
        found.net_slip_mm_per_step
    )  # of the sums of the physics steps, which are not there


def by_definition(run):
    """Measures of a whole run at once."""
    force = run["foot_force"]
    touching = force[:, :, 2] > 0.0
    path = np.linalg.norm(np.diff(run["foot_position"][:, :, :2], axis=0), axis=2) * (
        touching[1:] | touching[:-1]
    )
    late = contact_age(touching, PERIOD)[1:] > 0.05
    speed = np.linalg.norm(run["foot_velocity"][:, :, :2], axis=2)
    total = force[1:, :, 2].sum(axis=1)
    steps = len(run) * PERIOD / 0.75
    return {
        "slip_mm_per_step": 1e3 * path.sum() / steps,
        "late_slip_mm_per_step": 1e3 * (path * late).sum() / steps,
        "sliding": (speed > 0.01)[touching].mean(),
        "low_force": (total < 20.0).mean(),
        "no_contact": (total == 0.0).mean(),
        "roll_max_rad": 0.6,
        "pitch_max_rad": 0.1,
        "yaw_max_rad": 0.2,
        "tilt_max_rad": np.arccos(np.cos(0.6) * np.cos(0.1)),
        "solver_failures": int((run["qp_status"] > 1).sum()),
    }


def test_a_walk_that_tilts_is_said_to_stumble():
    run = still(5)
    upright = measure(run)
    assert not upright.stumbled
    assert upright.tilt_max_rad == 0.0
    run["q"][3, 3:7] = (0.0, np.sin(0.4), 0.0, np.cos(0.4))
    tilted = measure(run)
    assert tilted.stumbled
    assert not tilted.fell
    assert tilted.tilt_max_rad == pytest.approx(0.8, abs=1e-9)
    run["q"][3, 3:7] = np.nan
    assert measure(run).stumbled


def test_empty_run():
    run = still(5)
    with pytest.raises(InputError):
        measure(Run({name: array[:0] for name, array in run.signals.items()}, run.metadata))
    with pytest.raises(InputError):
        measure(Run({}, {"ending": "interrupted"}))


@pytest.mark.parametrize("gait", ["walking", "standing"])
def test_only_a_target_of_its_own_is_tracked(gait):
    """The target of a walking gait is a velocity: its x_r is the measured body."""
    run = still(5, parameters={"gait": {"gait": gait}})
    run.signals["x_r"] = run["q"][:, :6].copy()
    found = measure(run)
    if gait == "walking":
        assert np.isnan(found.tracking_rms_mm)
        assert "distance from the target" not in str(found)
    else:
        assert found.tracking_rms_mm == 0.0


N, YAW = 2000, 0.7


def made_up(*, signals=None, **changes):
    """A body that goes along its heading, YAW, at 0.5 m/s, and turns at 0.2 rad/s; a joint at 10
    N·m and 3 rad/s.
    """
    run = still(N, **{"mass": 2.0, "parameters": {"gait": {"step_duration": 0.2}}} | changes)
    q, v, t = run["q"], run["v"], run["t"]
    q[:, 0], q[:, 1] = 0.5 * t * np.cos(YAW), 0.5 * t * np.sin(YAW)
    q[:, 5], q[:, 6] = np.sin(0.5 * YAW), np.cos(0.5 * YAW)
    v[:, 0], v[:, 5], v[:, 6] = 0.5, 0.2, 3.0
    run["torque"][:, 0] = 10.0
    run.signals["heading"] = np.tile([YAW, 0.0, 0.0], (N, 1))
    run.signals["applied_velocity"] = np.tile([0.4, 0.0, 0.1], (N, 1))
    run.signals.update(signals or {})
    return run


def test_known_numbers():
    measures = hp.measure(made_up())
    distance = 0.5 * PERIOD * (N - 1)
    assert measures.cost_of_transport == pytest.approx(30.0 * PERIOD * N / (2.0 * 9.81 * distance))
    assert measures.velocity_rms_m_s == pytest.approx(0.1)
    assert measures.turning_rms_rad_s == pytest.approx(0.1)
    assert math.isnan(measures.pressure_margin_mm)


def test_sway_within_a_step_is_no_error_of_tracking():
    run = made_up()
    run["v"][:, 0] = 0.4 + 0.3 * np.sin(2.0 * np.pi * run["t"] / 0.4)
    assert hp.measure(run).velocity_rms_m_s < 1e-3


def test_negative_power_is_not_given_back():
    run = made_up()
    run["torque"][::2] *= -1.0
    assert hp.measure(run).cost_of_transport == pytest.approx(
        0.5 * hp.measure(made_up()).cost_of_transport
    )


@pytest.mark.parametrize("turn", [0.0, 0.9])
def test_margin_of_a_sole(turn):
    """A sole of 200 by 120 mm with its centre of pressure 30 mm ahead and 40 mm to the left of its
    middle; at the end it rolls over its toes.
    """
    corners = np.array([(0.1, 0.06, 0.0), (0.1, -0.06, 0.0), (-0.1, 0.06, 0.0), (-0.1, -0.06, 0.0)])
    along, across = 0.5 + 0.03 / 0.2, 0.5 + 0.04 / 0.12
    share = np.array(
        [along * across, along * (1 - across), (1 - along) * across, (1 - along) * (1 - across)]
    )
    position = np.tile(
        corners @ pin.rpy.rpyToMatrix(0.0, 0.0, turn).T + (3.0, -1.0, 0.0), (N, 1, 1)
    )
    force = np.zeros((N, 4, 3))
    force[:, :, 2] = 19.62 * share
    force[: N // 2] *= 0.1  # too little to count
    force[: N // 2, 0] += (0.0, 0.0, 0.5)
    stance = np.ones((N, 4))
    force[-N // 4 :, 2:] = stance[-N // 4 :, 2:] = 0.0
    signals = {
        "foot_position": position,
        "foot_force": force,
        "foot_velocity": np.zeros((N, 4, 3)),
        "stance": stance,
    }
    run = made_up(signals=signals, feet=[f"sole_{k}" for k in range(4)])
    assert hp.measure(run).pressure_margin_mm == pytest.approx(20.0, abs=0.15)


def test_words_and_units_of_every_measure():
    measures = hp.measure(made_up())
    assert set(measures.as_dict()) == set(WORDS)
    text = str(measures)
    assert "cost of transport" in text
    assert "m/s rms: 0.1" in text
    assert "nan" not in text
    assert "pressure" not in text


def test_logs_without_these_signals_are_measured():
    run = made_up(signals={"applied_velocity": np.zeros((N, 7))}, mass="heavy")
    measures = hp.measure(run)
    assert math.isnan(measures.velocity_rms_m_s)
    assert math.isnan(measures.cost_of_transport)
