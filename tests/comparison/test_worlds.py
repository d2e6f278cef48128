"""Walks in other people's models: what a policy sees, what is taken from a model, and what is
measured of a walk.
"""

import sys

import numpy as np
import pinocchio as pin
import pytest
from biped_urdf import biped_urdf
from own_models import described, mujoco

import harpy_pin as hp
from comparison.cli import app
from comparison.joint_pd.controller import JointPD, JointPDGains, found_gains
from comparison.peers.environment import WORLDS, WorkerError, default_folder, interpreter
from comparison.studies import causes, worlds
from comparison.worlds.models import (
    HUMANOIDS,
    JOINTS,
    PLAYGROUND,
    PROPERTIES,
    ROBOTS,
    knowing,
    strip,
    world,
)
from comparison.worlds.policy import WEIGHTS, Policy, observation
from comparison.worlds.walk import (
    PD_GAINS,
    POLICY,
    STANDS,
    WALKERS,
    MotorPD,
    Watch,
    sliding,
    walked,
)

SOLES = ("L_sole", "R_sole")
FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


@pytest.fixture(scope="module")
def dog(tmp_path_factory):
    """File of Go2, with servos and joints that are not ideal."""
    go2, joints = (
        hp.load_robot("go2"),
        {"armature": 0.01, "damping": [0.5, 0.0, 0.0], "frictionloss": 0.2},
    )
    spec = described(go2, actuators="position", joints=joints)
    spec.option.timestep, spec.worldbody.geoms[0].pos = 2e-3, np.zeros(3)
    spec.body("base").add_site(name="imu", pos=(-0.1, 0.05, 0.02), quat=(0.5, 0.5, -0.1, 0.7))
    for name, kind in {"local_linvel": "VELOCIMETER", "gyro": "GYRO"}.items():
        sensor = getattr(mujoco.mjtSensor, f"mjSENS_{kind}")
        spec.add_sensor(name=name, type=sensor, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    spec.add_key(name="home", qpos=(0, 0, 0.3, 1, 0, 0, 0, *go2.posture))
    file = tmp_path_factory.mktemp("models") / "dog.xml"
    file.write_text(spec.to_xml())
    return str(file)


@pytest.fixture(scope="module")
def biped(tmp_path_factory):
    """File of a biped on boxes, with a waist, and with spheres on hips and thighs that are 1 mm
    deep in each other.
    """
    folder, shapes = tmp_path_factory.mktemp("models"), mujoco.mjtGeom
    (folder / "biped.urdf").write_text(biped_urdf(waist=("waist",)))
    points = hp.load_robot(folder / "biped.urdf", feet=SOLES)
    spec = described(points, actuators="motor", joints={"armature": 0.01})
    spec.option.timestep, spec.worldbody.geoms[0].pos = 2e-3, np.zeros(3)
    for side in "LR":
        for geom in spec.body(f"{side}_sole").geoms:
            spec.delete(geom)
        spec.body(f"{side}_sole").add_geom(
            type=shapes.mjGEOM_BOX, size=(0.1, 0.05, 0.01), pos=(0, 0, 0.01)
        )
        for link, height in (("yaw", 0.0), ("pitch", -0.099)):
            spec.body(f"{side}_{link}").add_geom(
                type=shapes.mjGEOM_SPHERE, size=(0.05, 0, 0), pos=(0, 0, height)
            )
    file = folder / "biped.xml"
    file.write_text(spec.to_xml())
    return str(file)


def moved(model, seed=0):
    """Data in any state."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qpos[:] = rng.normal(size=model.nq)
    mujoco.mj_normalizeQuat(model, data.qpos)
    data.qvel[:] = rng.normal(size=model.nv)
    mujoco.mj_forward(model, data)
    return data


def test_the_policy_sees_what_moving_the_robot_a_little_shows(dog):
    model, h = mujoco.MjModel.from_xml_path(dog), 1e-6
    data, action, command = moved(model), np.arange(12.0), np.array([1.0, 2.0, 3.0])
    seen = observation(model, data, action, command)
    later = mujoco.MjData(model)
    later.qpos[:] = data.qpos
    mujoco.mj_integratePos(model, later.qpos, data.qvel, h)
    mujoco.mj_forward(model, later)
    place, turned = data.site("imu").xpos, data.site("imu").xmat.reshape(3, 3)
    np.testing.assert_allclose(seen[:3], turned.T @ (later.site("imu").xpos - place) / h, atol=1e-4)
    turn = pin.log3(turned.T @ later.site("imu").xmat.reshape(3, 3)) / h
    np.testing.assert_allclose(seen[3:6], turn, atol=1e-4)
    np.testing.assert_allclose(turned @ seen[6:9], (0.0, 0.0, -1.0), atol=1e-6)
    angles = data.qpos[7:] - hp.load_robot("go2").posture
    np.testing.assert_allclose(seen[9:], [*angles, *data.qvel[6:], *action, *command], atol=1e-6)


@pytest.mark.parametrize("known", [(), ("armature",), JOINTS])
def test_a_robot_knows_of_its_joints_what_it_is_told(dog, known):
    """Its inertia is that of MuJoCo's model with as much armature."""
    model, whole = world(dog, FEET)
    robot, data = knowing(whole, known), moved(model, 1)
    np.testing.assert_array_equal(robot.model.damping[6:], 0.5 * ("damping" in known))
    np.testing.assert_array_equal(robot.dry_friction, 0.2 * ("friction" in known))
    model.dof_armature[6:] *= "armature" in known
    mujoco.mj_forward(model, data)
    state, momentum = hp.MujocoBridge(model, robot).read(data), np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    energy = state.v @ pin.crba(robot.model, robot.model.createData(), state.q) @ state.v
    assert energy == pytest.approx(data.qvel @ momentum)


@pytest.mark.parametrize("kept", [(), *[(name,) for name in PROPERTIES], PROPERTIES])
def test_only_what_is_kept_is_left_of_a_model(dog, kept):
    model, robot = world(dog, FEET)
    strip(model, robot, kept)
    found = {
        "dry friction": model.dof_frictionloss[6:].any(),
        "damping": model.dof_damping[6:].any(),
        "armature": model.dof_armature[6:].any(),
        "round feet": hp.MujocoBridge(model, robot).foot_radius.min() > 0.01,
        "steps": model.opt.timestep == 2e-3,
        "pyramids": model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL,
    }
    assert {name for name, there in found.items() if there} == set(kept)


@pytest.mark.parametrize(("spin", "expected"), [(0.0, 0.5), (25.0, 0.0), (-25.0, 1.0)])
def test_a_foot_that_rolls_does_not_slide(spin, expected):
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="0 0 1"/>
        <body pos="0 0 0.02"><freejoint/><geom size="0.02"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[:] = (0.3, 0.4, 0.0, -0.8 * spin, 0.6 * spin, 0.0)
    for height, found in ((-1e-6, {3: pytest.approx(expected, abs=1e-3)}), (0.01, {})):
        data.qpos[2] += height
        mujoco.mj_forward(model, data)
        assert sliding(model, data, [-1, 3]) == found


def test_slip_is_that_of_landing_and_of_lifting(dog):
    """A contact of 0.1 s slides at 2 m/s for 5 ms, hops, slides at 1 m/s for 10 ms in its middle
    and at the end.
    """
    model, robot = world(dog, FEET)
    data, dt = mujoco.MjData(model), 1e-3
    mujoco.mj_forward(model, data)
    watch = Watch(hp.MujocoBridge(model, robot), data)
    speed = np.zeros(100)
    speed[:5], speed[40:50], speed[90:] = 2.0, 1.0, 1.0
    for step in range(200):
        touches = step < 100 and not 5 <= step < 15
        watch._note_contacts({0: float(speed[step])} if touches else {}, dt)
    assert watch.landing == pytest.approx(0.010)
    assert watch.lifting == pytest.approx(0.010)


def test_velocity_is_measured_in_the_frame_of_the_heading(dog):
    """Without gravity the robot drifts at 0.5 m/s, heading to the left, and turns."""
    model, robot = world(dog, FEET)
    model.opt.gravity[:], data = 0.0, mujoco.MjData(model)
    data.qpos[:7], data.qvel[:2] = (0.0, 0.0, 1.0, np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)), (0.3, 0.4)
    mujoco.mj_forward(model, data)
    watch = Watch(hp.MujocoBridge(model, robot), data)
    for command, error in (((0.4, -0.3, 0.0), 0.0), ((0.4, -0.2, 0.0), 0.1 / np.sqrt(2.0))):
        data.time += model.opt.timestep
        watch.look(np.array(command))
        assert watch.measures()["error_m_s"] == pytest.approx(error, abs=1e-9)
    assert not watch.fell
    data.qpos[3:7] = (0.0, 1.0, 0.0, 0.0)
    mujoco.mj_forward(model, data)
    watch.look(np.zeros(3))
    assert watch.fell


def test_motors_add_what_joint_pd_adds(dog):
    """Torque and motors' law together are joint PD's torque, in stance and in swing."""
    model, robot = world(dog, FEET)
    state = hp.MujocoBridge(model, robot).read(moved(model, 2))
    gains, gaits = (
        JointPDGains(**found_gains()[PD_GAINS]["gains"]),
        [hp.WalkingGait(robot) for _ in range(2)],
    )
    whole, split = JointPD(gaits[0], gains, mu=0.5), MotorPD(gaits[1], mu=0.5, period=1e-3)
    whole._record["limit"] = split._inner._record["limit"] = np.inf
    swings = set()
    for t in np.arange(0.0, 1.0, 0.01):
        state.t = t
        for gait in gaits:
            gait.command[:3] = (0.3, 0.1, 0.2)
        torque, command = whole.step(state).torque, split.step(state)
        q, v, k_p, k_d = command.law
        given = command.torque + k_p * (q - state.q[7:]) + k_d * (v - state.v[6:])
        np.testing.assert_allclose(given, torque, rtol=1e-9, atol=1e-9)
        swings |= set(gaits[1].target.stance.tolist())
    assert swings == {0.0, 1.0}


WALK = {
    "feet": FEET,
    "friction": 0.8,
    "push": None,
    "noise": None,
    "duration": 3.0,
    "commands": [[0.5, 0.3, 0, 0]],
}


@pytest.mark.parametrize("who", ["joint PD", "motor law, joints known", "QP, motor law"])
def test_a_model_of_ones_own_walks(dog, who):
    found = walked(WALK | {"world": dog, "who": who, "noise": 3})
    assert (found["fell"], found["stood_s"]) == (False, pytest.approx(3.0))
    assert 0.0 < found["cost_of_transport"] < 3.0
    assert walked(WALK | {"world": dog, "who": who, "push": [1.0, 0.0, 40.0]})["fell"]


def test_links_that_push_each_other_apart_where_the_robot_stands_do_not_touch(biped):
    """Those of both sides; other links still do."""
    whole, (model, robot) = mujoco.MjModel.from_xml_path(biped), world(biped, SOLES)
    q = hp.Standing(robot).initial_state(penetration=1e-3)[0]
    assert len(hp.MujocoBridge(whole, robot).self_contacts(q)) == 2
    bridge, data = hp.MujocoBridge(model, robot), mujoco.MjData(model)
    assert not bridge.self_contacts(q)
    bridge.place((q, np.zeros(len(q) - 1)), data)
    mujoco.mj_forward(model, data)
    assert {model.body(model.geom_bodyid[pair[1]]).name for pair in data.contact.geom} == set(SOLES)


@pytest.mark.parametrize("who", ["joint PD", "motor law"])
def test_a_biped_on_soles_walks_below_its_waist(biped, who):
    walk = WALK | {"world": biped, "feet": SOLES, "who": who}
    found = walked(walk | {"commands": [[0.5, 0.15, 0.0, 0.2]]})
    assert (found["fell"], found["stood_s"]) == (False, pytest.approx(3.0))
    assert walked(walk | {"push": [1.0, 0.0, 40.0]})["fell"]


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
    python = interpreter(folder, WORLDS.name)
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    (folder / "worlds" / "lib" / "python3" / "mujoco_playground" / WEIGHTS.parent).mkdir(
        parents=True
    )
    (folder / "worker.py").write_text(worker, encoding="utf-8")
    return Policy(folder, folder / "worker.py")


def test_actions_are_targets_about_the_posture(dog, tmp_path):
    model = mujoco.MjModel.from_xml_path(dog)
    data = moved(model)
    with installed(tmp_path, ECHO) as policy:
        act = policy.acting(model)
        for count in (1, 2):
            act(data, np.array([0.3, 0.0, 0.0]))
            np.testing.assert_allclose(
                data.ctrl, model.key_qpos[0, 7:] + 0.5 * 0.3 * count, rtol=1e-6
            )
        with pytest.raises((WorkerError, BrokenPipeError)):
            act(data, np.zeros(3))


def test_what_is_missing_is_said(tmp_path, monkeypatch, dog):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    for command in ("worlds", "causes"):
        with pytest.raises(hp.InputError, match="peers --install"):
            app([command])
    with pytest.raises(WorkerError, match="no weights"):
        installed(tmp_path, "raise SystemExit('no weights')")
    with pytest.raises(hp.RobotError, match="no foot frame 'knee'"):
        app(["worlds", "--mjcf", dog, "--feet", "FL_foot,knee"])


def test_all_walk_the_same(monkeypatch, dog):
    robot = world(dog, FEET)
    monkeypatch.setattr(worlds, "world", lambda name, feet: robot)
    jobs = list(worlds.STUDY.jobs(worlds.STUDY.settings(sequences=3, noisy=2, pushes=24)))
    of = {who: [{**job, "who": ""} for job in jobs if job["who"] == who] for who in WALKERS}
    assert of["torque alone"] == of["joint PD"] == of["motor law"]
    assert all(job in of["motor law"] for job in [*of[POLICY], *of["QP, motor law"]])
    assert {job["world"] for job in of[STANDS]} == {*ROBOTS, PLAYGROUND, *HUMANOIDS}
    assert {job["world"] for job in of[POLICY]} == {PLAYGROUND}
    pushes = np.array(
        [job["push"][1:] for job in of["motor law"] if job["world"] == "Go2" and job["push"]]
    )
    np.testing.assert_allclose(pushes.sum(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(pushes, axis=1), [0.5] * 24)


def test_fast_commands_last_turn_and_go_back():
    """Up to 0.8 of the largest speed, every turning on both sides; those in turn cancel out."""
    walks = list(worlds.fast_walks(2.0, 12.5))
    lasting = np.array([walk["commands"][0] for walk in walks if walk["what"] == worlds.LASTING[0]])
    assert (lasting[:, 1].max(), lasting[:, 1].min()) == pytest.approx((1.6, 1.0))
    np.testing.assert_allclose(lasting[:, 3].sum(), 0.0)
    assert len(np.unique(lasting[:, 1:], axis=0)) == len(lasting) == 15
    turns, reversals = (np.array(walk["commands"]) for walk in walks[-2:])
    np.testing.assert_allclose([turns[:, 3].sum(), reversals[:, 1].sum()], 0.0)
    assert {walk["friction"] for walk in walks} == {0.8, 0.4}


def test_causes_are_drawn():
    rows = [
        {"case": case, "world": "Go2", "fell": case == "armature", "slip_mm_s": 3.0}
        for case in causes.CASES
    ]
    texts = [text.get_text() for panel in causes.STUDY.figure(rows).axes for text in panel.texts]
    assert sorted(texts) == ["3"] * (len(rows) - 1) + ["–, 1 of 1"]


@pytest.mark.long
@pytest.mark.parametrize("name", ["Go2", PLAYGROUND])
def test_other_peoples_robots_walk(name):
    if not interpreter(default_folder(), WORLDS.name).exists():
        pytest.skip("the models are not installed")
    for who in ["motor law"] + [POLICY] * (name == PLAYGROUND):
        assert not walked(WALK | {"world": name, "who": who, "feet": worlds.FEET})["fell"]
