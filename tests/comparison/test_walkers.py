"""A policy and the condensed WBC in one MuJoCo model: what the policy sees, and what is measured of both."""

from __future__ import annotations

import sys

import numpy as np
import pinocchio as pin
import pytest

from comparison.cli import app
from comparison.peers.environment import PLAYGROUND, WorkerError, default_folder, interpreter
from comparison.studies.walkers import RANGE, STUDY
from comparison.walkers.policy import WEIGHTS, Policy, observation
from comparison.walkers.walk import FEET, LAW, NETWORK, Law, Watch, followed, robot_of, sliding, walked
from harpy_pin import InputError
from harpy_pin.simulation.mujoco import MujocoBridge

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra")

RADIUS = 0.02
LEG = """
<body name="{foot}_hip" pos="{x} {y} 0"><inertial pos="0 {a} 0" mass="0.7" diaginertia="7e-4 5e-4 4e-4"/>
 <joint name="{foot}_hip" axis="1 0 0"/>
 <body name="{foot}_thigh" pos="0 {b} 0"><inertial pos="0 0 -0.03" mass="1" diaginertia="5e-3 5e-3 7e-4"/>
  <joint name="{foot}_thigh" axis="0 1 0"/>
  <body name="{foot}_calf" pos="0 0 -0.21"><inertial pos="0 0 -0.1" mass="0.2" diaginertia="1e-3 1e-3 4e-5"/>
   <joint name="{foot}_calf" axis="0 1 0"/>
   <geom name="{foot}" size="0.02" pos="0 0 -0.21"/><site name="{foot}" pos="0 0 -0.21"/>
</body></body></body>"""


def dog():
    """A robot such as Go1, on a plane."""
    sides = {"FR": (1, -1), "FL": (1, 1), "RR": (-1, -1), "RL": (-1, 1)}
    legs = [LEG.format(foot=f, x=0.19 * x, y=0.05 * y, a=0.01 * y, b=0.08 * y) for f, (x, y) in sides.items()]
    joints = [f"{foot}_{joint}" for foot in FEET for joint in ("hip", "thigh", "calf")]
    driven = [f'<position joint="{name}" kp="35" forcerange="-30 30"/>' for name in reversed(joints)]
    return mujoco.MjSpec.from_string(f"""<mujoco>
<compiler angle="radian"/><option timestep="0.001" cone="elliptic" impratio="100"/>
<default><joint armature="0.005" damping="0.5"/></default>
<worldbody><geom name="floor" type="plane" size="0 0 1" pos="0 0 {-RADIUS}"/>
<body name="trunk" pos="0 0 0.27"><freejoint/><inertial pos="0.02 0 0" mass="5" diaginertia="0.02 0.06 0.07"/>
<site name="imu" pos="-0.1 0.05 0.02" euler="0.3 0.2 -0.4"/>{"".join(legs)}</body></worldbody>
<actuator>{"".join(driven)}</actuator>
<sensor><velocimeter site="imu" name="local_linvel"/><gyro site="imu" name="gyro"/></sensor>
<keyframe><key qpos="0 0 0.262 1 0 0 0 {" ".join(["0 0.9 -1.8"] * 4)}"/></keyframe></mujoco>""")


def moved(model, seed=0):
    """Data in any state."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qpos[:] = rng.normal(size=model.nq)
    data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
    data.qvel[:] = rng.normal(size=model.nv)
    mujoco.mj_forward(model, data)
    return data


def test_the_policy_sees_what_moving_the_robot_a_little_shows():
    model = dog().compile()
    data, action, command, h = moved(model), np.arange(12.0), np.array([1.0, 2.0, 3.0]), 1e-6
    seen = observation(model, data, action, command)
    assert seen.shape == (48,)
    later = mujoco.MjData(model)
    later.qpos[:] = data.qpos
    mujoco.mj_integratePos(model, later.qpos, data.qvel, h)
    mujoco.mj_forward(model, later)
    place, turned = data.site("imu").xpos, data.site("imu").xmat.reshape(3, 3)
    np.testing.assert_allclose(seen[:3], turned.T @ (later.site("imu").xpos - place) / h, atol=1e-4)
    turn = pin.log3(turned.T @ later.site("imu").xmat.reshape(3, 3)) / h
    np.testing.assert_allclose(seen[3:6], turn, atol=1e-4)
    np.testing.assert_allclose(turned @ seen[6:9], (0.0, 0.0, -1.0), atol=1e-6)
    np.testing.assert_allclose(seen[9:21], data.qpos[7:] - np.tile([0.0, 0.9, -1.8], 4), atol=1e-6)
    np.testing.assert_allclose(seen[21:33], data.qvel[6:], atol=1e-6)
    np.testing.assert_array_equal(seen[33:], [*action, *command])


def test_our_robot_is_the_one_of_mujoco():
    spec = dog()
    model, robot = spec.compile(), robot_of(spec)
    data = moved(model, 1)
    state, ours = MujocoBridge(model, robot).read(data), robot.model.createData()
    np.testing.assert_allclose(state.foot_position, [data.site(foot).xpos for foot in FEET], atol=1e-9)
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    energy = state.v @ pin.crba(robot.model, ours, state.q) @ state.v
    assert energy == pytest.approx(data.qvel @ momentum)
    assert robot.mass == pytest.approx(model.body_subtreemass[1])
    np.testing.assert_array_equal(robot.torque_limit, 30.0)
    np.testing.assert_array_equal(robot.model.damping[6:], 0.5)


@pytest.mark.parametrize(("spin", "expected"), [(0.0, 0.5), (25.0, 0.0), (-25.0, 1.0)])
def test_a_foot_that_rolls_does_not_slide(spin, expected):
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="0 0 1"/>
        <body pos="0 0 0.02"><freejoint/><geom name="ball" size="0.02"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[2] -= 1e-6
    data.qvel[:] = (0.3, 0.4, 0.0, -0.8 * spin, 0.6 * spin, 0.0)
    mujoco.mj_forward(model, data)
    speed, on = sliding(model, data, [model.geom("ball").id])
    assert on.all()
    assert speed[0] == pytest.approx(expected, abs=1e-3)
    data.qpos[2] += 0.01
    mujoco.mj_forward(model, data)
    assert not sliding(model, data, [model.geom("ball").id])[1].any()


def test_velocity_is_measured_in_the_frame_of_the_heading():
    """Without gravity the robot drifts at 0.5 m/s, heading to the left, and turns."""
    model = dog().compile()
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2], data.qpos[3:7] = 1.0, (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    data.qvel[:2] = (0.3, 0.4)
    watch = Watch(model, data, FEET)
    for _ in range(3):
        mujoco.mj_forward(model, data)
        watch.look(np.array([0.4, -0.3, 0.0]))
    assert watch.measures()["error_m_s"] == pytest.approx(0.0, abs=1e-9)
    watch.look(np.array([0.4, -0.2, 0.0]))
    assert watch.measures()["error_m_s"] == pytest.approx(0.1 / 2.0)
    assert watch.measures()["settled_error_m_s"] is None
    assert not watch.fell
    data.qpos[3:7] = (0.0, 1.0, 0.0, 0.0)
    mujoco.mj_forward(model, data)
    watch.look(np.zeros(3))
    assert watch.fell


WALK = {"walker": LAW, "plant": "MuJoCo as trained", "friction": 0.8, "push": None, "duration": 3.0}
WALK["commands"] = [[0.5, 0.3, 0.0, 0.0]]


@pytest.mark.parametrize("learning", [False, True])
def test_the_law_walks_any_model_that_takes_torques(learning):
    spec = dog()
    model = spec.compile()
    law = Law(robot_of(spec), model, 0.8, learning=learning)
    found = followed(WALK, model, law.act, law.period)
    assert not found["fell"]
    assert found["steps_per_s"] > 4.0
    beside = WALK | {"push": [1.0, 0.0, 40.0]}
    again = Law(robot_of(spec), model, 0.8, learning=learning)
    assert followed(beside, model, again.act, again.period)["fell"]


ECHO = """
import sys, numpy as np
assert sys.argv[1].endswith("go1_policy.onnx")
out = sys.stdout.buffer
out.write(b"\\n"); out.flush()
for _ in range(2):
    seen = np.frombuffer(sys.stdin.buffer.read(192), dtype=np.float32)
    out.write((seen[33:45] + seen[45]).tobytes()); out.flush()
"""


def installed(folder, worker):
    """A folder that looks like the policy's, and a worker."""
    python = interpreter(folder, PLAYGROUND.name)
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    (folder / "playground" / "lib" / "python3" / "mujoco_playground" / WEIGHTS.parent).mkdir(parents=True)
    script = folder / "worker.py"
    script.write_text(worker, encoding="utf-8")
    return script


def test_actions_are_targets_about_the_posture(tmp_path):
    model = dog().compile()
    data = moved(model)
    with Policy(tmp_path, installed(tmp_path, ECHO)) as policy:
        for count in (1, 2):
            policy.act(model, data, np.array([0.3, 0.0, 0.0]))
            np.testing.assert_allclose(policy.action, 0.3 * count, rtol=1e-6)
            np.testing.assert_allclose(data.ctrl, model.key_qpos[0, 7:] + 0.5 * policy.action)
        with pytest.raises((WorkerError, BrokenPipeError)):
            policy.act(model, data, np.zeros(3))


def test_a_policy_that_does_not_start_says_why(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    with pytest.raises(InputError, match="peers --install"):
        app(["walkers"])
    with pytest.raises(WorkerError, match="no weights"):
        Policy(tmp_path, installed(tmp_path, "raise SystemExit('no weights')"))


def test_all_walk_the_same(monkeypatch):
    monkeypatch.setattr("comparison.studies.walkers.package_in", lambda folder: folder)
    jobs = list(STUDY.jobs(STUDY.settings(walks=3, pushes=1)))
    law = [job | {"walker": NETWORK} for job in jobs if job["walker"] == LAW]
    assert law == [job for job in jobs if job["walker"] == NETWORK]
    commands = np.array([row[1:] for job in law if job["what"] == "go1, random" for row in job["commands"]])
    assert np.all(np.abs(commands).max(axis=0) <= RANGE)
    pushes = [job["push"][1:] for job in law if job["push"] is not None and job["plant"] == "MuJoCo as trained"]
    np.testing.assert_allclose(np.sum(pushes, axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(pushes, axis=1), 0.6)


@pytest.mark.long
def test_the_policy_walks():
    if not interpreter(default_folder(), PLAYGROUND.name).exists():
        pytest.skip("the policy is not installed")
    assert not walked(WALK | {"walker": NETWORK}, default_folder())["fell"]
