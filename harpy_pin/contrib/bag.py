"""Logs of one's own robot: sensors from CSV, npz or MCAP, and the estimate on them as a run."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.drift import off
from harpy_pin.errors import InputError, install_line
from harpy_pin.estimation.estimator import Estimator
from harpy_pin.estimation.imu import Imu
from harpy_pin.estimation.readings import Readings
from harpy_pin.log.run import Run, describe_versions
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.model.urdf import TURNS

SLOW = 0.5
"""Steps of the time that no log in seconds has, s."""
UNEVEN = 0.2
"""Share of the period by which a step is off that is said."""
BEGIN = 100
"""Samples whose mean acceleration is compared with gravity at the start."""
KINDS = ("JointState", "Imu", "Odometry", "LowState", "LowCmd")
"""Types of the messages that are read of an MCAP; the last two are Unitree's."""
UNITREE_LEGS = ("FR_", "FL_", "RR_", "RL_")
"""Order of the legs in Unitree's messages; joints of other names are in the robot's order."""
Signals = dict[str, Vector]


@checked
def read_log(path: str | Path, robot: Robot) -> Signals:
    """The sensors of a log, a row for each sample, by the names of
    :class:`~harpy_pin.estimation.readings.Readings`.

    ``q`` (nq,) and ``v`` (nv,) are the truth where the log has it. An npz, such as :meth:`Run.save`
    writes, has arrays of these names; a CSV has columns ``t``, ``gyroscope/x``,
    ``joint_position/FL_hip_joint`` or ``joint_position/0``, as :meth:`Run.to_csv` names them. An
    MCAP (extra ``mcap``) has messages like ``sensor_msgs/JointState``, ``Imu`` and
    ``nav_msgs/Odometry``, of ROS 2 or in JSON, on any topics; the inertial unit's are interpolated
    to the times of the joints. Or it has Unitree's ``LowState``, with targets and gains of the
    motors (:class:`harpy_pin.Command`) where it has ``LowCmd``, too.

    Args:
        path: of the file; its ending says which.
        robot: whose joints they are.

    Raises:
        InputError: the file cannot be read, or something in it is missing or in another unit; the
            message says what.
    """
    return _checked(read_signals(path, robot), robot)


@checked
def read_signals(path: str | Path, robot: Robot) -> Signals:
    """All signals of a log as :func:`read_log` finds them, before anything is asked of them.

    Raises:
        InputError: the file cannot be read; the message says why.
    """
    source = checks.path("path", path)
    readers = {".csv": _read_csv, ".npz": _read_npz, ".mcap": _read_mcap}
    checks.one_of("ending of the log's name", source.suffix.lower(), readers)
    try:
        return readers[source.suffix.lower()](source, robot)
    except (OSError, ValueError, KeyError, StopIteration) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot read '{source}': {error}", name="path", value=source) from error


def _read_npz(path: Path, robot: Robot) -> Signals:
    with np.load(path, allow_pickle=False) as file:
        return {
            name: np.asarray(file[name], float)
            for name in file.files
            if file[name].dtype.kind in "fiub"
        }


def _read_csv(path: Path, robot: Robot) -> Signals:
    with path.open(encoding="utf-8", newline="") as file:
        names = [name.strip() for name in next(csv.reader(file))]
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    columns: dict[str, dict[str, Vector]] = {}
    for name, column in zip(names, table.T, strict=True):
        signal, _, part = name.partition("/")
        columns.setdefault(signal, {})[part] = column
    found = {}
    for signal, parts in columns.items():
        of_joints = set(robot.joints) <= parts.keys()
        values = [parts[joint] for joint in robot.joints] if of_joints else list(parts.values())
        found[signal] = values[0] if "" in parts else np.column_stack(values)
    return found


class _Json:
    """Decodes messages in JSON, with attributes, and passes over those of other kinds."""

    def decoder_for(self, encoding: str, schema: Any) -> Any:
        if _kind(schema) not in KINDS:
            return lambda data: None
        return (lambda data: json.loads(data, object_hook=_named)) if encoding == "json" else None


def _kind(schema: Any) -> str:
    """Name of a message's type without that of its package."""
    return schema.name.rpartition("/")[2] if schema else ""


def _named(entries: dict[str, Any]) -> Any:
    return SimpleNamespace(**entries)


def _read_mcap(path: Path, robot: Robot) -> Signals:
    try:
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
    except ImportError as error:
        raise InputError(
            f"mcap cannot be imported ({error}): {install_line('mcap')}", name="mcap"
        ) from error
    joints, inertial, truth = list[Any](), list[Any](), list[Any]()
    states, commands = list[Any](), list[Any]()
    motors = _unitree_order(robot)
    with path.open("rb") as file:
        decoders: list[Any] = [_Json(), DecoderFactory()]
        reader = make_reader(file, decoder_factories=decoders)
        for schema, _, message, content in reader.iter_decoded_messages():
            kind = _kind(schema)
            stamp = getattr(getattr(content, "header", None), "stamp", None)
            t = 1e-9 * message.log_time if stamp is None else stamp.sec + 1e-9 * stamp.nanosec
            if kind == "JointState" and set(robot.joints) <= set(content.name):
                order = [content.name.index(joint) for joint in robot.joints]
                parts = content.position, content.velocity, content.effort
                joints.append(
                    (
                        t,
                        *(
                            np.array(part)[order] if len(part) else np.full(len(order), np.nan)
                            for part in parts
                        ),
                    )
                )
            elif kind == "Imu":
                inertial.append(
                    (t, _xyz(content.angular_velocity), _xyz(content.linear_acceleration))
                )
            elif kind == "Odometry":
                pose, twist = content.pose.pose, content.twist.twist
                turn = [getattr(pose.orientation, axis) for axis in "xyzw"]
                truth.append(
                    (t, [*_xyz(pose.position), *turn], [*_xyz(twist.linear), *_xyz(twist.angular)])
                )
            elif kind == "LowState":
                unit, motor = content.imu_state, [content.motor_state[k] for k in motors]
                angles = [[getattr(m, part) for m in motor] for part in ("q", "dq", "tau_est")]
                states.append((t, 1e-3 * content.tick, unit.gyroscope, unit.accelerometer, *angles))
            elif kind == "LowCmd":
                motor = [content.motor_cmd[k] for k in motors]
                sent = (
                    [getattr(m, part) for m in motor] for part in ("q", "dq", "tau", "kp", "kd")
                )
                commands.append((t, *sent))
    if states:
        return _of_unitree(states, commands)
    found: Signals = {}
    if joints:
        t, *legs = (np.array(column, float) for column in zip(*joints, strict=True))
        found = {
            "t": t,
            **dict(zip(("joint_position", "joint_velocity", "joint_torque"), legs, strict=True)),
        }
        found = {name: values for name, values in found.items() if not np.isnan(values).all()}
    for rows, names in ((inertial, ("gyroscope", "accelerometer")), (truth, ("q", "v"))):
        if rows and joints:
            times, *values = (np.array(column, float) for column in zip(*rows, strict=True))
            for name, value in zip(names, values, strict=True):
                found[name] = np.column_stack(
                    [np.interp(found["t"], times, column) for column in value.T]
                )
    if "q" in found:
        found["q"] = np.hstack([found["q"], found["joint_position"]])
        found["v"] = np.hstack(
            [found["v"], found.get("joint_velocity", 0.0 * found["joint_position"])]
        )
    return found


def _unitree_order(robot: Robot) -> list[int]:
    """Place of each joint in Unitree's messages."""
    legs = {leg: place for place, leg in enumerate(UNITREE_LEGS)}
    order = sorted(robot.joints, key=lambda name: legs.get(name[:3], len(legs)))
    return [order.index(joint) for joint in robot.joints]


def _of_unitree(states: list[Any], commands: list[Any]) -> Signals:
    """Signals of Unitree's messages. Times are those of the robot's own clock; a command holds
    until the next one.
    """
    names = ("t", "gyroscope", "accelerometer", "joint_position", "joint_velocity", "joint_torque")
    received, *columns = (np.array(column, float) for column in zip(*states, strict=True))
    found = dict(zip(names, columns, strict=True))
    new = np.flatnonzero(np.diff(np.maximum.accumulate(found["t"]), prepend=-np.inf) > 0.0)
    if commands:
        sent, *parts = (np.array(column, float) for column in zip(*commands, strict=True))
        last = np.maximum(np.searchsorted(sent, received, side="right") - 1, 0)
        for name, part in zip(("target_q", "target_v", "torque", "k_p", "k_d"), parts, strict=True):
            found[name] = part[last]
    return {name: values[new] for name, values in found.items()}


def _xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def _checked(found: Signals, robot: Robot) -> Signals:
    """The sensors alone, of the robot's sizes and in their units."""
    places = robot.layout[0]
    if (
        "joint_position" not in found
        and "q" in found
        and found["q"].ndim == 2
        and found["q"].shape[1] == robot.nq
    ):
        found["joint_position"], found["joint_velocity"] = found["q"][:, places], found["v"][:, 6:]
    found.setdefault("joint_torque", found.get("torque", np.zeros(0)))
    if "foot_position" in found:  # a run's own: its forces are the truth, and no sensor's
        found.pop("foot_force", None)
    for name in ("t", "gyroscope", "accelerometer", "joint_position"):
        if name not in found:
            raise InputError(
                f"the log has no {name}; it has {', '.join(sorted(found)) or 'nothing'}", name=name
            )
    t, joints = found["t"], len(robot.joints)
    steps = np.diff(t)
    if len(t) < 2 or not np.isfinite(t).all() or (steps <= 0.0).any():
        raise InputError("the log's t must be finite and go on from row to row", name="t", value=t)
    if np.median(steps) > SLOW:
        raise InputError(
            f"the log's t goes on by {np.median(steps):g}: it must be in s, not ms or ns", name="t"
        )
    if "joint_velocity" not in found:
        found["joint_velocity"] = np.gradient(found["joint_position"], t, axis=0)
    if not found["joint_torque"].size:
        if "foot_force" not in found:
            raise InputError(
                "the log has neither joint_torque nor foot_force: which feet stand?",
                name="joint_torque",
            )
        found["joint_torque"] = np.zeros((len(t), joints))
    sizes = {
        "gyroscope": 3,
        "accelerometer": 3,
        **dict.fromkeys(("joint_position", "joint_velocity", "joint_torque"), joints),
    }
    sizes |= {
        "foot_force": len(robot.feet),
        "q": robot.nq,
        "v": robot.nv,
        "thrust": 3 * len(robot.thrusters),
    }
    kept = {"t": t}
    for name in sizes.keys() & found.keys():
        values = found[name].reshape(len(found[name]), -1)
        if values.shape != (len(t), sizes[name]):
            raise InputError(
                f"the log's {name} must be ({len(t)}, {sizes[name]}) for '{robot.name}', got "
                f"{found[name].shape}",
                name=name,
            )
        kept[name] = np.ascontiguousarray(values)
    felt = float(np.linalg.norm(np.nanmean(kept["accelerometer"][:BEGIN], axis=0)))
    if not 0.8 * GRAVITY < felt < 1.2 * GRAVITY:
        raise InputError(
            f"the log's accelerometer begins at {felt:.3g} and not 9.81 m/s²: in g?",
            name="accelerometer",
        )
    if np.nanmax(np.abs(kept["joint_position"])) > TURNS:
        raise InputError(
            "the log's joint_position is beyond two turns: it must be in rad", name="joint_position"
        )
    return kept


@checked
def estimate_log(
    signals: Signals, robot: Robot, imu: Imu | None = None
) -> tuple[Run, dict[str, Any]]:
    """The estimate on a log, as a run, and what is to be said of it.

    The run's ``q`` and ``v`` are the truth where the log has it, else the estimate; the estimate is
    in ``estimated_q``, ``estimated_v`` and further signals of
    :class:`~harpy_pin.estimation.estimator.Estimator`.

    Args:
        signals: of :func:`read_log`.
        robot: whose they are.
        imu: place and noise of its sensors.

    Returns:
        The run; and measures: duration, s, period, s, the share of uneven steps, that of each
        status, and where there is a truth those of :func:`~harpy_pin.contrib.drift.off`.
    """
    s, t = signals, signals["t"]
    period = float(np.median(np.diff(t)))
    estimator = Estimator(robot, imu, period=period)
    if "q" in s:
        estimator.reset(s["q"][0], s.get("v", [np.zeros(robot.nv)])[0])
    rows: dict[str, list[Any]] = {
        name: [] for name in ("foot_position", "foot_velocity", *estimator.signals)
    }
    said = dict[str, int]()
    names = ("gyroscope", "accelerometer", "joint_position", "joint_velocity", "joint_torque")
    for k in range(len(t)):
        readings = Readings(float(t[k]), *(s[name][k] for name in names))
        readings.foot_force = s["foot_force"][k] if "foot_force" in s else None
        readings.thrust = s["thrust"][k].reshape(-1, 3) if "thrust" in s else None
        state = estimator.step(readings)
        for name, value in {
            "foot_position": state.foot_position,
            "foot_velocity": state.foot_velocity,
            **estimator.signals,
        }.items():
            rows[name].append(np.copy(value))
        said[estimator.status] = said.get(estimator.status, 0) + 1
    found = {name: np.array(values) for name, values in rows.items()} | s
    found |= {
        "foot_force": found["estimated_force"],
        "torque": s["joint_torque"],
        "tick_ns": np.zeros(len(t), np.int64),
    }
    found["thrust"] = (
        s["thrust"].reshape(len(t), -1, 3) if "thrust" in s else np.zeros((len(t), 0, 3))
    )
    found |= {name: found[f"estimated_{name}"] for name in ("q", "v") if name not in s}
    metadata = {
        "ending": "completed",
        "end_time": float(t[-1]),
        "control_period": period,
        "robot": robot.name,
    }
    metadata |= {"mass": robot.mass, "feet": list(robot.feet), "thrusters": list(robot.thrusters)}
    measures: dict[str, Any] = {"duration_s": float(t[-1] - t[0]), "period_s": period}
    measures["uneven_steps"] = float(np.mean(np.abs(np.diff(t) / period - 1.0) > UNEVEN))
    measures |= {f"status: {name}": count / len(t) for name, count in said.items()}
    if "q" in s and "v" in s:
        measures |= off(s["q"], s["v"], found["estimated_q"], found["estimated_v"], period=period)
    return Run(found, metadata | {"versions": describe_versions()}), measures
