"""Joints identified from logs that MuJoCo made, and what is said of logs that are wrong."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from comparison.worlds.hung import PERIOD, Hidden, hang, hidden, logged
from harpy_pin.contrib.bag import read_log, read_signals
from harpy_pin.contrib.identify import command, equations, excitation, identify
from harpy_pin.contrib.identify.signals import Half, Samples
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.loading import harpy_urdf
from harpy_pin.model.robot import KnownJoints

mujoco = pytest.importorskip("mujoco")
SECONDS = 16.0
PARTS = ("hip", "thigh", "calf")
NUMBERS = ("torque_scale", "armature", "damping", "friction")


@pytest.fixture(scope="module")
def robot() -> hp.Robot:
    return hp.load_harpy()


@pytest.fixture(scope="module")
def plan(robot):
    return excitation(robot, duration=SECONDS)


@pytest.fixture(scope="module")
def truth(robot, plan) -> Hidden:
    return hidden(robot, np.random.default_rng(3), np.abs(plan.torque).max(axis=0))


@pytest.fixture(scope="module")
def log(robot, plan, truth):
    """MuJoCo reads the URDF itself, with the base fixed to the world."""
    model = hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot)
    return logged(model, truth, plan, np.random.default_rng(4))


@pytest.fixture
def copy(log):
    return {name: part.copy() for name, part in log.items()}


def test_joints_are_found(robot, log, truth):
    found = identify(robot, log)
    assert found.status == ()
    assert sum(np.isfinite(getattr(found, name)).sum() for name in NUMBERS) > 16
    for name in NUMBERS:
        known, told = found.excited[name], np.isfinite(getattr(found, name))
        assert getattr(found, name)[known] == pytest.approx(getattr(truth, name)[known], rel=0.1)
        assert getattr(found, name)[told] == pytest.approx(getattr(truth, name)[told], rel=0.2)
    assert found.delay == pytest.approx(truth.delay + 0.5 * PERIOD, abs=5e-4)
    assert np.all(found.left < 0.2)


def test_commands_and_gains_alone(robot, plan, truth):
    model = hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot)
    found = identify(robot, logged(model, truth, plan, np.random.default_rng(5), law=True))
    for name in NUMBERS:
        known = found.excited[name]
        assert getattr(found, name)[known] == pytest.approx(getattr(truth, name)[known], rel=0.1)
    assert found.delay == pytest.approx(truth.delay + 0.5 * PERIOD, abs=1e-3)


def test_the_plan_keeps_the_limits(robot, plan):
    assert np.all(plan.q > robot.joint_lower)
    assert np.all(plan.q < robot.joint_upper)
    assert np.gradient(plan.q, plan.t, axis=0)[1:-1] == pytest.approx(plan.v[1:-1], abs=0.02)
    assert plan.condition < 100.0
    assert plan.command(5).law[0] == pytest.approx(plan.q[5])


def test_standard_errors_are_such(robot, log, truth):
    """Where the log says how large the torques are; else they are taken as right."""
    found = identify(robot, log)
    sure = found.excited["torque_scale"]
    assert sure.sum() > 3
    for name in NUMBERS:
        off = np.abs(getattr(found, name) - getattr(truth, name)) / found.error[name]
        off = off[sure & np.isfinite(off)]
        assert off.max(initial=0.0) < 4.0
        assert len(off) == 0 or np.median(off) > 0.02


def test_a_joint_at_rest_is_not_known(robot, copy):
    copy["q"][:, 2] = copy["q"][0, 2]
    found = identify(robot, copy)
    assert np.isnan(found.armature[2])
    assert not found.excited["armature"][2]
    assert any(robot.joints[2] in line and "hardly moves" in line for line in found.status)


def test_a_constant_log_says_nothing(robot, copy):
    copy["q"][:], copy["torque"][:] = copy["q"][0], copy["torque"][0]
    found = identify(robot, copy)
    assert found.status == (f"{', '.join(robot.joints)}: hardly moves",)
    for name in (*NUMBERS, "bias", "delay"):
        assert np.all(np.isnan(getattr(found, name)))
    before = robot.with_joints(armature=0.02, damping=0.3, friction=0.4)
    assert before.with_joints(found).model == before.model
    assert found.figure().axes


def wrong_sign(log):
    log["torque"][:, 1] *= -1.0
    return log


def swapped(log):
    log["torque"][:, [1, 2]] = log["torque"][:, [2, 1]]
    return log


def in_degrees(log):
    return log | {"q": np.rad2deg(log["q"])}


def saturated(log):
    size = 0.6 * np.abs(log["torque"]).max(axis=0)
    return log | {"torque": np.clip(log["torque"], -size, size)}


def with_gaps(log):
    log["q"][50, 1] = np.nan
    kept = np.ones(len(log["t"]), bool)
    kept[1000:1300] = False
    return {name: part[kept] for name, part in log.items()}


def of_something_else(log):
    return log | {"torque": np.random.default_rng(0).standard_normal(log["torque"].shape)}


@pytest.mark.parametrize(
    ("spoil", "said", "unknown"),
    [
        (wrong_sign, "wrong sign", [1]),
        (swapped, "of another joint", [1, 2]),
        (in_degrees, "another unit", []),
        (saturated, "at its limit", []),
        (with_gaps, "1 gaps, the longest of 0.6", []),
        (of_something_else, "does not explain", range(6)),
    ],
)
def test_a_wrong_log_is_named(robot, copy, spoil, said, unknown):
    """Nothing is known of its joints then, and no inertia or friction is ever negative."""
    found = identify(robot, spoil(copy))
    assert any(said in line for line in found.status), found.status
    for name in ("armature", "damping", "friction"):
        assert not np.any(getattr(found, name) < 0.0)
        assert np.all(np.isnan(getattr(found, name)[list(unknown)]))


def test_what_saturates_and_gaps_leave_is_right(robot, copy, truth):
    for spoilt in (with_gaps(copy), saturated(copy)):
        found = identify(robot, spoilt)
        sure, known = found.excited["armature"], np.isfinite(found.armature)
        assert known.sum() > 1
        assert found.armature[sure] == pytest.approx(truth.armature[sure], rel=0.1)
        assert found.armature[known] == pytest.approx(truth.armature[known], rel=0.2)


def test_found_joints_go_into_the_robot(robot, log, tmp_path):
    found = identify(robot, log)
    file = tmp_path / "joints.json"
    found.save(file)
    known, read = (
        robot.with_joints(found),
        hp.load_robot(harpy_urdf(), feet=robot.feet, thrusters=robot.thrusters, joints=file),
    )
    for name in ("armature", "damping"):
        value = getattr(found, name)
        expected = np.where(np.isnan(value), getattr(robot.model, name)[6:], value)
        assert getattr(known.model, name)[6:] == pytest.approx(expected)
        assert getattr(read.model, name) == pytest.approx(getattr(known.model, name))
    assert read.dry_friction == pytest.approx(known.dry_friction)
    (tmp_path / "bad.json").write_text(json.dumps({"joints": 3}))
    with pytest.raises(RobotError, match="no joints in"):
        hp.load_robot(harpy_urdf(), feet=robot.feet, joints=tmp_path / "bad.json")
    with pytest.raises(InputError, match="another robot"):
        hp.load_robot(harpy_urdf(), feet=()).with_joints(KnownJoints(("a",), *np.full((3, 1), 0.1)))


def test_what_is_missing_is_said(robot, log):
    with pytest.raises(InputError, match="torque"):
        identify(robot, {"t": log["t"], "q": log["q"]})
    with pytest.raises(InputError, match="apart"):
        identify(robot, {name: part[::50] for name, part in log.items()})
    with pytest.raises(InputError, match="q must have"):
        identify(robot, {**log, "q": log["q"][:, 1:]})


def test_forces_of_feet_drop_out():
    """A payload on the base is found whatever forces are at the feet on the ground."""
    robot, rng = hp.load_robot(harpy_urdf(), feet=hp.load_harpy().feet), np.random.default_rng(0)
    model, n = equations.rigid(robot), 200
    data, truth = model.createData(), np.array([0.7, 0.07, -0.035, 0.14])

    def needed(q, v, a):
        regressor = pin.computeJointTorqueRegressor(model, data, q, v, a)[:, :4]
        return regressor @ truth + pin.rnea(model, data, q, v, a)

    low = -np.ones(model.nq)
    q = np.array([pin.randomConfiguration(model, low, -low) for _ in range(n)])
    v, a = rng.standard_normal((2, n, model.nv))
    torque, air = np.zeros((n, len(robot.joints))), rng.random((n, len(robot.feet))) < 0.3
    for k in range(n):
        pin.computeJointJacobians(model, data, q[k])
        pin.updateFramePlacements(model, data)
        stack = [np.zeros((0, model.nv))] + [
            pin.getFrameJacobian(model, data, robot.frame_id(foot), pin.LOCAL_WORLD_ALIGNED)[:3]
            for foot, up in zip(robot.feet, air[k], strict=True)
            if not up
        ]
        jacobian = np.concatenate(stack)
        pushed = jacobian.T @ rng.standard_normal(len(jacobian))
        before = needed(q[k], v[k], a[k])
        steps = np.array([needed(q[k], v[k], a[k] + x) - before for x in np.eye(model.nv)[:6]])
        a[k, :6] += np.linalg.solve(steps[:, :6].T, (pushed - before)[:6])
        rest = needed(q[k], v[k], a[k]) - pushed
        assert rest[:6] == pytest.approx(0.0, abs=1e-8)
        torque[k] = rest[6:]
    none, t = np.zeros_like(torque), 0.01 * np.arange(n)
    half = Half(q, v, a, none, none, t, None)
    samples = Samples(t, (half, half), none > 0.0, none > 0.0, False)
    found, error = equations.payload(robot, samples, air, torque, 0.0)
    assert found == pytest.approx(truth, abs=1e-8)
    assert np.all(error < 1e-8)


def test_a_walk_on_the_estimate_alone(solo12):
    """Joints of legs in the air: the plant is the library's own, with dry friction."""
    rng = np.random.default_rng(1)
    truth = {
        name: scale * np.exp(rng.uniform(-1.0, 1.0, 12))
        for name, scale in (("armature", 0.003), ("damping", 0.03), ("friction", 0.05))
    }
    scenario = hp.Scenario(
        robot=solo12.with_joints(**truth),
        gait=hp.Walking(velocity=(0.4, 0.0, 0.0)),
        ground=hp.Ground(mu_s=0.8),
        state="estimated",
        duration=12.0,
    )
    run = hp.walk(scenario)
    log = {"t": run["t"], "q": run["estimated_q"], "v": run["estimated_v"]}
    found = identify(solo12, log | {"torque": run["torque"]})
    for name, least in (("armature", 4), ("damping", 0), ("friction", 1)):
        known = np.isfinite(getattr(found, name))
        assert known.sum() >= least
        assert getattr(found, name)[known] == pytest.approx(truth[name][known], rel=0.2)
    mass, error = (part[0] for part in found.payload)
    assert abs(mass) < 3.0 * error < 1.0


def test_who_stands_is_told_nothing():
    """No leg is in the air."""
    run = hp.walk(hp.Scenario(robot="solo12", gait="standing", duration=2.0))
    found = identify(hp.load_robot("solo12"), run)
    assert any("hardly in the air" in line for line in found.status)
    assert np.all(np.isnan(found.armature))


def test_times_at_random_and_a_bag_of_ros(robot, log, truth, tmp_path):
    """What a foreign writer has put into a bag: messages of all joints in another order, at times
    of their own, and others beside them.
    """
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store, rng = get_typestore(Stores.ROS2_HUMBLE), np.random.default_rng(0)
    types = store.types
    period = 2e-3
    t = np.sort(log["t"] + rng.uniform(-0.4, 0.4, len(log["t"])) * period) + 10.0
    q, torque = (
        np.column_stack([np.interp(t - 10.0, log["t"], x) for x in log[name].T])
        for name in ("q", "torque")
    )
    order = rng.permutation(len(robot.joints))
    names = [robot.joints[k] for k in order]
    with rosbag2.Writer(
        tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as bag:
        kind = "sensor_msgs/msg/JointState"
        channel = bag.add_connection("/joint_states", kind, typestore=store)
        word = bag.add_connection("/said", "std_msgs/msg/String", typestore=store)
        for k in range(len(t)):
            stamp = round(1e9 * t[k])
            time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            header = types["std_msgs/msg/Header"](time, "")
            content = types[kind](header, names, q[k][order], 0.0 * q[k], torque[k][order])
            bag.write(channel, stamp, store.serialize_cdr(content, kind))
        said = types["std_msgs/msg/String"]("walks")
        bag.write(word, stamp, store.serialize_cdr(said, "std_msgs/msg/String"))
    (file,) = (tmp_path / "bag").glob("*.mcap")
    found = identify(robot, read_signals(file, robot))
    for name in NUMBERS:
        told = np.isfinite(getattr(found, name))
        assert getattr(found, name)[told] == pytest.approx(getattr(truth, name)[told], rel=0.2)
    assert np.isfinite(found.armature).sum() >= 2
    command.identify(file, robot="harpy", out=tmp_path / "joints.json")


def test_sensors_names_and_gains_that_never_change(robot, copy, plan, truth):
    named = {"t": copy["t"], "joint_position": copy["q"], "joint_torque": copy["torque"]}
    assert identify(robot, named).armature == pytest.approx(
        identify(robot, copy).armature, nan_ok=True
    )
    model = hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot)
    log = logged(model, truth, plan, np.random.default_rng(5), law=True)
    found = identify(robot, log)
    once = identify(robot, log | {"k_p": plan.k_p, "k_d": plan.k_d})
    assert once.armature == pytest.approx(found.armature, nan_ok=True)


def test_unitree_messages(go2, tmp_path):
    """Legs come in Unitree's order, times from the robot's clock, and a command holds."""
    writer = pytest.importorskip("mcap.writer")
    legs = [f"{leg}_{part}_joint" for leg in ("FR", "FL", "RR", "RL") for part in PARTS]
    imu = {"gyroscope": [0.0, 0.0, 0.1], "accelerometer": [0.0, 0.0, 9.8]}
    with (tmp_path / "log.mcap").open("wb") as file:
        out = writer.Writer(file)
        out.start()
        channel = {}
        for kind in ("LowState", "LowCmd"):
            schema = out.register_schema(f"unitree_go/msg/{kind}", "jsonschema", b"{}")
            channel[kind] = out.register_channel(kind, "json", schema)
        for k in range(5):
            motors = [{"q": j + 0.1 * k, "dq": 0.0, "tau_est": 2.0 * j} for j in range(20)]
            state = {"tick": 1000 + 2 * k, "imu_state": imu, "motor_state": motors}
            order = [{"q": j, "dq": 0.0, "tau": k, "kp": 20.0, "kd": 0.5} for j in range(20)]
            for kind, content in (("LowState", state), ("LowCmd", {"motor_cmd": order})):
                late = 1_000_000 if kind == "LowCmd" else 0
                t = 2_000_000 * k + late
                out.add_message(channel[kind], t, json.dumps(content).encode(), t)
        out.finish()
    read = read_signals(tmp_path / "log.mcap", go2)
    assert read["t"] == pytest.approx(1.0 + 0.002 * np.arange(5))
    for j, name in enumerate(go2.joints):
        assert read["joint_position"][:, j] == pytest.approx(legs.index(name) + 0.1 * np.arange(5))
    assert read["torque"][:, 0] == pytest.approx([0.0, 0.0, 1.0, 2.0, 3.0])
    assert np.all(read["k_p"] == 20.0)
    assert read_log(tmp_path / "log.mcap", go2)["gyroscope"][0, 2] == 0.1


@pytest.mark.parametrize("ending", ["npz", "csv"])
def test_commands(tmp_path, monkeypatch, ending, capsys):
    """What ``harpy excite`` writes is a log but for the angles, and what ``identify`` says is in a
    file.
    """
    monkeypatch.chdir(tmp_path)
    command.excite(robot="harpy", duration=8.0, out=Path(f"motion.{ending}"))
    robot = hp.load_harpy()
    sent = read_signals(f"motion.{ending}", robot)
    sent["torque"] += 0.01 * np.gradient(sent["target_v"], sent["t"], axis=0)
    np.savez("log.npz", q=sent["target_q"], **sent)
    command.identify(Path("log.npz"), robot="harpy", out=Path("j.json"), figure=Path("j.png"))
    said = capsys.readouterr().out
    assert "left_knee" in said
    assert "numbers" in said
    assert hp.load_robot("go2").joints[0] not in said
    found = json.loads(Path("j.json").read_text())["joints"]
    for name in robot.joints:
        assert found[name]["armature"] == pytest.approx(0.01, rel=0.05)
    assert Path("j.png").stat().st_size > 10_000
