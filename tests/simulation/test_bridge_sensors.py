"""The sensors of a MuJoCo model as readings of the estimator, and a loop on them."""

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots
from own_models import described, mujoco

import harpy_pin as hp
from harpy_pin import InputError, MujocoBridge

pytestmark = needs_robots
PLACE, TURN = (-0.02, 0.01, 0.04), (0.3, -0.2, 1.0)
GYROSCOPE, ACCELEROMETER = mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER
SITE = mujoco.mjtObj.mjOBJ_SITE


def sensing(robot, *, body="base", kinds=(GYROSCOPE, ACCELEROMETER), apart=0.0, off=False, **how):
    """Go2 in MuJoCo, with sensors at a site of a body; the last one is made so, or all are
    disabled.
    """
    spec = described(robot, actuators="motor")
    x, y, z, w = pin.Quaternion(pin.rpy.rpyToMatrix(*TURN)).coeffs()
    for n, kind in enumerate(kinds):
        spec.body(body).add_site(
            name=f"unit_{n}", pos=PLACE + np.array([n * apart, 0, 0]), quat=(w, x, y, z)
        )
        sensor = spec.add_sensor(name=f"sensor_{n}", type=kind, objtype=SITE, objname=f"unit_{n}")
    for name, value in how.items():
        setattr(sensor, name, value)
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_SENSOR) if off else 0
    return spec.compile()


def test_a_robot_stands_on_what_the_models_sensors_say(go2):
    bridge, gait = MujocoBridge(sensing(go2), go2), hp.Standing(go2)
    np.testing.assert_allclose(bridge.imu.position, PLACE, atol=1e-9)
    np.testing.assert_allclose(bridge.imu.rotation, pin.rpy.rpyToMatrix(*TURN), atol=1e-9)
    data, period = mujoco.MjData(bridge.model), float(bridge.model.opt.timestep)
    controller = hp.make_controller("condensed", gait, mu=0.6, period=period)
    estimator = hp.Estimator(go2, bridge.imu, period=period)
    q, v = gait.initial_state()
    bridge.place((q, v), data)
    mujoco.mj_forward(bridge.model, data)
    estimator.reset(q, v)
    for _ in range(round(1.0 / period)):
        state = estimator.step(bridge.readings(data), controller.target)
        bridge.write(controller.step(state), data)
        mujoco.mj_step(bridge.model, data)
    true = bridge.read(data)
    np.testing.assert_allclose(state.q[:3], true.q[:3], atol=0.01)
    assert pin.Quaternion(state.q[3:7]).angularDistance(pin.Quaternion(true.q[3:7])) < 0.02
    axes, readings = bridge.imu.rotation.T, bridge.readings(data)
    upright = pin.Quaternion(true.q[3:7]).toRotationMatrix().T @ [0.0, 0.0, 9.81]
    np.testing.assert_allclose(readings.accelerometer, axes @ upright, atol=0.3)
    np.testing.assert_allclose(readings.gyroscope, axes @ true.v[3:6], atol=0.05)
    np.testing.assert_allclose(readings.joint_position, true.q[7:])


@pytest.mark.parametrize(
    ("how", "what"),
    [
        ({"kinds": (ACCELEROMETER,)}, "no gyroscope"),
        ({"kinds": (GYROSCOPE,)}, "no accelerometer"),
        ({"kinds": (GYROSCOPE, GYROSCOPE, ACCELEROMETER)}, "2 gyroscope"),
        ({"body": "FL_calf"}, "no gyroscope"),
        ({"apart": 0.1}, "apart"),
        ({"off": True}, "no gyroscope"),
        (
            {"delay": 0.01, "nsample": 20},
            "accelerometer 'sensor_1' of the MuJoCo model has a delay or an interval",
        ),
        (
            {"interval": (0.01, 0.0), "nsample": 4},
            "accelerometer 'sensor_1' of the MuJoCo model has a delay or an",
        ),
    ],
)
def test_sensors_that_are_no_inertial_unit(go2, how, what):
    bridge = MujocoBridge(sensing(go2, **how), go2)
    with pytest.raises(InputError, match=what):
        _ = bridge.imu
    with pytest.raises(InputError, match=what):
        bridge.readings(mujoco.MjData(bridge.model))


def test_a_sensor_that_readings_do_not_use_may_be_late(go2):
    kinds = (GYROSCOPE, ACCELEROMETER, mujoco.mjtSensor.mjSENS_VELOCIMETER)
    bridge = MujocoBridge(sensing(go2, kinds=kinds, delay=0.01, nsample=20), go2)
    np.testing.assert_allclose(bridge.imu.position, PLACE, atol=1e-9)
