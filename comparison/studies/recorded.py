"""Estimate the state on a log that no one here recorded.

Reads clones of Contact-Aided-Invariant-EKF and cassie_description (UMich-BipedLab): Cassie walks
ten seconds in the simulation of the filter's authors (Hartley et al., IJRR 2020), felt by an
inertial unit, fourteen encoders and two contacts at 2 kHz. The sensors' noise is added here, as in
their example.
"""

import re
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.study import Job, Shown, Study, View, shown
from harpy_pin.contrib.drift import off
from harpy_pin.errors import HarpyError, InputError, install_line
from harpy_pin.estimation import EstimatorSettings
from harpy_pin.model.state import GRAVITY, Vector

SOURCES = ("Contact-Aided-Invariant-EKF", "cassie_description")
"""Repositories of UMich-BipedLab on GitHub, BSD-3-Clause. Nothing of theirs is part of this one."""
LOG = "matlab_example/data"
SIGNALS = {
    "gyroscope": "measurements/angular_velocity",
    "accelerometer": "measurements/linear_acceleration",
    "encoders": "measurements/encoders",
    "contact": "measurements/contact",
    "rotation": "ground_truth/orientation",
    "position": "ground_truth/position",
    "velocity": "ground_truth/velocity",
}
"""Files of the log; the truth is that of the inertial unit."""
PERIOD, BEGIN = 5e-4, 1000
"""Time between samples, s, and the first that is used: before, the simulation settles."""
NOISE = (1e-3, 1e-2)
"""Of a sample of the gyroscope, rad/s, and of the accelerometer, m/s²."""
TOUCHES = 0.5
"""Contact, between 0 and 1, from which on a foot touches."""
SIDES, TOE = ("left", "right"), "0.0177 0.0522 0"
"""Place of the contact in the frame of a toe, m, from their model of Cassie."""
JOINTS = [
    "hip_abduction",
    "hip_rotation",
    "hip_flexion",
    "knee_joint",
    "knee_to_shin",
    "ankle_joint",
    "toe_joint",
]
"""Of a leg, in the order of the encoders."""
PLACE, MOUNTED = (0.03155, 0.0, -0.07996), (np.pi, 0.0, 0.0)
"""Of the inertial unit in the pelvis, m and rad: it hangs upside down."""


def read_log(folder: Path) -> dict[str, Vector]:
    """The signals of the log, each (samples, ...).

    Raises:
        InputError: a file is missing, or is none of the log's.
        HarpyError: h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise HarpyError(f"files of Matlab 7.3 need h5py: {install_line('compare')}") from None
    found = {}
    for name, file in SIGNALS.items():
        path = _file(folder, SOURCES[0], f"{LOG}/{file}.mat")
        try:
            with h5py.File(
                path
            ) as content:  # a time series is the largest array among Matlab's own entries
                entries = [
                    entry for entry in content["#refs#"].values() if isinstance(entry, h5py.Dataset)
                ]
                values = np.array(
                    max((e for e in entries if e.dtype == np.float64), key=lambda e: e.size)
                )
        except (OSError, KeyError, ValueError) as error:
            raise InputError(
                f"'{path}' is no file of the log: {error}", name="data", value=path
            ) from error
        # Matlab stores columns: vectors lie along the first axis, rotations are transposed.
        found[name] = values.transpose(0, 2, 1) if values.ndim == 3 else values.T
    samples = min(map(len, found.values()))
    return {name: np.ascontiguousarray(values[:samples]) for name, values in found.items()}


def _file(folder: Path, source: str, name: str) -> Path:
    """A file of a clone."""
    path = folder / source / name
    if not path.is_file():
        how = f"in '{folder}': git clone https://github.com/UMich-BipedLab/{source}"
        raise InputError(f"'{path}' is missing; {how}", name="data", value=path)
    return path


def load_cassie(folder: Path) -> hp.Robot:
    """Cassie with the springs of its shins as joints, and a point in the middle of each toe as a
    foot.
    """
    text = _file(folder, SOURCES[1], "urdf/cassie.urdf").read_text(encoding="utf-8")
    text = re.sub(
        r"<inertial>(?:(?!</inertial>).)*<mass value=\"0\"/>.*?</inertial>",
        "",
        text,
        flags=re.DOTALL,
    )
    feet = ""
    for side in SIDES:
        link = (
            f'<link name="{side}_foot"/><joint name="{side}_sole" type="fixed"><origin '
            f'xyz="{TOE}"/>'
        )
        feet += f'{link}<parent link="{side}_toe"/><child link="{side}_foot"/></joint>'
    with TemporaryDirectory() as own, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # springs have no motors
        file = Path(own) / "cassie.urdf"
        file.write_text(text.replace("</robot>", f"{feet}</robot>"), encoding="utf-8")
        return hp.load_robot(file, feet=[f"{side}_foot" for side in SIDES])


def estimate_log(
    folder: Path, *, seed: int = 0, settings: EstimatorSettings | None = None
) -> dict[str, Any]:
    """How far the estimate of the log is off, by :func:`harpy_pin.contrib.drift.off`, and what it
    says at the end.

    Args:
        folder: with a clone of each repository, under its name.
        seed: of the sensors' noise.
        settings: of the estimator.
    """
    log, robot = read_log(folder), load_cassie(folder)
    imu, rng = hp.Imu(position=PLACE, orientation=MOUNTED), np.random.default_rng(seed)
    names = [f"{joint}_{side}" for side in SIDES for joint in JOINTS]
    if not set(robot.joints) <= set(names):
        raise InputError(
            f"cassie.urdf has other joints: {', '.join(robot.joints)}", name="data", value=folder
        )
    angles = log["encoders"][:, [names.index(joint) for joint in robot.joints]]
    speeds = np.diff(angles, axis=0, prepend=angles[:1]) / PERIOD
    q, v = _truth(robot, log, imu, angles, speeds)
    estimator = hp.Estimator(robot, imu, period=PERIOD, settings=settings)
    estimator.reset(q[BEGIN], v[BEGIN])
    torque, weight = np.zeros(len(robot.joints)), GRAVITY * robot.mass
    guess, speed = [], []
    for k in range(BEGIN, len(q)):
        gyroscope = log["gyroscope"][k] + NOISE[0] * rng.standard_normal(3)
        accelerometer = log["accelerometer"][k] + NOISE[1] * rng.standard_normal(3)
        force = 0.5 * weight * (log["contact"][k] > TOUCHES)
        legs = angles[k], speeds[k], torque
        state = estimator.step(
            hp.Readings(PERIOD * k, gyroscope, accelerometer, *legs, foot_force=force)
        )
        guess.append(state.q.copy())
        speed.append(state.v.copy())
    error = off(q[BEGIN:], v[BEGIN:], np.array(guess), np.array(speed), period=PERIOD)
    return error | {"status": estimator.status}


def _truth(
    robot: hp.Robot, log: dict[str, Vector], imu: hp.Imu, angles: Vector, speeds: Vector
) -> tuple[Vector, Vector]:
    """(samples, nq) configurations and (samples, nv) velocities, from those of the inertial
    unit.
    """
    model, arm = robot.model, np.array(imu.position)
    q, v = np.zeros((len(angles), model.nq)), np.zeros((len(angles), model.nv))
    turned = log["rotation"] @ imu.rotation.T
    angular = log["gyroscope"] @ imu.rotation.T
    q[:, :3] = log["position"] - turned @ arm
    q[:, 3:7] = [pin.Quaternion(one).coeffs() for one in turned]
    v[:, :3] = np.einsum("nji,nj->ni", turned, log["velocity"]) - np.cross(angular, arm)
    v[:, 3:6], v[:, 6:] = angular, speeds
    for j, joint in enumerate(list(model.joints)[2:]):
        turning = joint.nq == 2
        q[:, joint.idx_q] = np.cos(angles[:, j]) if turning else angles[:, j]
        if turning:
            q[:, joint.idx_q + 1] = np.sin(angles[:, j])
    return q, v


def _measured(job: Job) -> dict[str, Any]:
    return estimate_log(Path(job["data"]))


_COLUMNS: dict[str, Shown] = {
    "drift": (shown("drift"), "%"),
    "path": (shown("trajectory_mm"), "mm"),
    "velocity": (shown("velocity_cm_s"), "cm/s"),
    "tilt": (shown("tilt_deg"), "°"),
    "way": (shown("way_m"), "m"),
    "status": shown("status"),
}
STUDY = Study(
    name="recorded",
    help=__doc__,
    example="--data clones --json recorded.json",
    defaults={"data": "out/clones"},
    quick={},
    options={"data": "Folder with your clones of the repositories."},
    timed=lambda s: [{"data": s.data}],
    measure=_measured,
    views=[
        View(
            "recorded",
            "On the log of others",
            row="Cassie",
            columns=_COLUMNS,
            note="As of python -m comparison senses.",
        )
    ],
)
