"""The sensors of a simulated robot, and a controller's state that is estimated from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.estimation.estimator import Estimator, EstimatorSettings
from harpy_pin.estimation.imu import Imu
from harpy_pin.estimation.readings import Readings
from harpy_pin.model.entry import as_array, as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.simulation.plant import Plant


class Sensing(KeepsViews):
    """Sensors of a robot whose true motion is known.

    Between two samples the inertial unit takes the mean, as real ones do: its acceleration is the
    difference of two velocities.

    Args:
        robot: the true one.
        imu: its sensors.
        period: between samples, s.
        gravity: (3,) world, m/s².
        seed: of noise and biases.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        imu: Imu,
        *,
        period: float,
        gravity: Vector | tuple[float, ...] = (0.0, 0.0, -9.81),
        seed: int = 0,
    ) -> None:
        self.robot, self.imu, self.period = (
            robot,
            imu,
            checks.number("period", period, low=0.0, strict=True),
        )
        self.gravity, self.seed = checks.vector("gravity", gravity, 3), checks.whole("seed", seed)
        self._place, unbounded = robot.layout
        self._unbounded = unbounded != 0
        self._every = 1 if imu.rate is None else max(round(1.0 / (imu.rate * self.period)), 1)
        self.reset()

    def reset(self) -> None:
        """Begin anew, with the biases and the noise of the seed."""
        imu, self._rng = (
            self.imu,
            np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(1,))),
        )
        self.gyroscope_bias = imu.gyroscope_bias * self._rng.standard_normal(3)
        self.accelerometer_bias = imu.accelerometer_bias * self._rng.standard_normal(3)
        self._gain = 1.0 + imu.torque_error * self._rng.standard_normal(len(self.robot.joints))
        self._last: tuple[Vector, Vector] | None = None
        self._samples = 0
        self._unit = np.zeros((2, 3))

    def read(self, state: State, torque: Vector, thrust: Vector | None = None) -> Readings:
        """A sample.

        Args:
            state: the true one.
            torque: (joints,) of the motors since the last sample, N·m.
            thrust: (thrusters, 3) since then, N.
        """
        state, imu, rng = as_state(state, self.robot), self.imu, self._rng
        torque, q, v = as_array("torque", torque, (len(self.robot.joints),)), state.q, state.v
        self._feel(q, v)
        angle = q[self._place].copy()
        if self._unbounded.any():
            angle[self._unbounded] = np.arctan2(q[self._place + 1], angle)[self._unbounded]
        angle += imu.encoder_noise * rng.standard_normal(len(angle))
        if imu.encoder_resolution > 0.0:
            angle = imu.encoder_resolution * np.round(angle / imu.encoder_resolution)
        speed = v[6:] + imu.velocity_noise * rng.standard_normal(len(angle))
        felt = self._gain * torque + imu.torque_noise * rng.standard_normal(len(angle))
        force = None
        if imu.foot_noise is not None:
            force = state.foot_force[:, 2] + imu.foot_noise * rng.standard_normal(
                len(state.foot_force)
            )
        gyroscope, accelerometer = self._unit.copy()
        return Readings(state.t, gyroscope, accelerometer, angle, speed, felt, thrust, force)

    def _feel(self, q: Vector, v: Vector) -> None:
        """Sample the inertial unit, where its time has come."""
        imu, rng, place = self.imu, self._rng, np.array(self.imu.position)
        due, self._samples = self._samples % self._every == 0, self._samples + 1
        if not due:
            return
        period = self._every * self.period
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        speed, force = rotation @ (v[:3] + np.cross(v[3:6], place)), -self.gravity
        middle, turn = rotation, v[3:6]
        if self._last is not None:
            before, velocity = self._last
            turn = pin.log3(before.T @ rotation) / period
            middle, force = (
                before @ pin.exp3(0.5 * period * turn),
                force + (speed - velocity) / period,
            )
        self._last = rotation, speed
        axes, root = imu.rotation.T, np.sqrt(period)
        self.gyroscope_bias += imu.gyroscope_walk * root * rng.standard_normal(3)
        self.accelerometer_bias += imu.accelerometer_walk * root * rng.standard_normal(3)
        gyroscope = (
            axes @ turn
            + self.gyroscope_bias
            + imu.gyroscope_density / root * rng.standard_normal(3)
        )
        accelerometer = axes @ (middle.T @ force) + self.accelerometer_bias
        accelerometer += imu.accelerometer_density / root * rng.standard_normal(3)
        self._unit[0] = np.clip(gyroscope, -imu.gyroscope_range, imu.gyroscope_range)
        self._unit[1] = np.clip(accelerometer, -imu.accelerometer_range, imu.accelerometer_range)


class EstimatedState(KeepsViews):
    """What a controller in a plant knows: the estimate from simulated sensors.

    Args:
        plant: placed already; the estimate begins at its state.
        estimator: of the sensors that are simulated, and of what the controller believes of the
            robot.
        controller: whose ``target``, where it has one, says which feet the gait expects on the
            ground, and whose ``acceleration`` by what the estimate goes on without readings.
        feedback: whether the controller gets the estimate; the true state otherwise.
        seed: of the sensors.

    Attributes:
        signals: for the log: the estimate and what sensors said.
    """

    @checked
    def __init__(
        self,
        plant: Plant,
        estimator: Estimator,
        *,
        controller: Any = None,
        feedback: bool = True,
        seed: int = 0,
    ) -> None:
        self.estimator, self.feedback, self._controller = estimator, feedback, controller
        self.sensing = Sensing(
            plant.robot, estimator.imu, period=estimator.period, gravity=plant.gravity, seed=seed
        )
        motors = plant._record_["motors"]
        self._torque, self._thrust = field(motors, "mean_torque"), plant.signals["thrust"]
        self._unit = np.zeros((2, 3))
        self._plant_state = plant.q, plant.v
        self.reset()

    @property
    def signals(self) -> Mapping[str, NDArray[Any]]:
        """For the log."""
        return self.estimator.signals | {"gyroscope": self._unit[0], "accelerometer": self._unit[1]}

    def reset(self) -> None:
        """Begin anew, at the plant's present state."""
        self.sensing.reset()
        self.estimator.reset(*self._plant_state)

    def measure(self, state: State) -> State:
        """What the controller gets at a tick."""
        readings = self.sensing.read(state, self._torque, self._thrust)
        self._unit[0], self._unit[1] = readings.gyroscope, readings.accelerometer
        plan = (getattr(self._controller, name, None) for name in ("target", "acceleration"))
        estimate = self.estimator.step(readings, *plan)
        return estimate if self.feedback else state


def estimated_state(
    plant: Plant, robot: Robot, imu: Imu, *, period: float, level: bool | None = None, **how: Any
) -> EstimatedState:
    """The estimate of a robot in a plant.

    Args:
        plant: see :class:`EstimatedState`.
        robot: as the controller believes it to be.
        imu: its sensors.
        period: between samples, s.
        level: whether footholds are known to be at height zero; by default, whether the plant's
            ground is.
        how: ``controller``, ``feedback`` and ``seed`` of :class:`EstimatedState`.
    """
    if level is None:
        level = plant.ground.surface is None or bool(plant.ground.surface.record["level"][0])
    settings = EstimatorSettings() if level else EstimatorSettings(height_noise=math.inf)
    radius = getattr(plant, "foot_radius", 0.0)
    estimator = Estimator(robot, imu, settings=settings, period=period, foot_radius=radius)
    return EstimatedState(plant, estimator, **how)
