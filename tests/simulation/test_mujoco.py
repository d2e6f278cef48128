"""MuJoCo as a second plant: the same robot, the same ground, the same walks."""

import sys
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots
from random_trees import BODIES, random_model, random_state
from scipy.integrate import solve_ivp

import harpy_pin as hp
from harpy_pin import (
    Command,
    Disturbances,
    Governed,
    Ground,
    InputError,
    Mujoco,
    Push,
    Robot,
    Scenario,
    Simulator,
)
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.simulation.mujoco import PRESETS, MujocoModel, MujocoPlant, preset_ground
from harpy_pin.simulation.mujoco import mujoco_plant as plant_module
from harpy_pin.simulation.mujoco.conventions import from_mujoco
from harpy_pin.simulation.mujoco.mujoco_model import MIN_INERTIA

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
G = np.array([0.0, 0.0, -9.81])
UNGOVERNED = hp.Governed(governor="none")

POLE = """<robot name="pole">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <link name="tip"/>
  <joint name="tip_fixed" type="fixed"><origin xyz="0 0 -0.4"/>
    <parent link="base"/><child link="tip"/></joint>
</robot>"""
"""A body that stands on a point 0.4 m below its centre of mass."""


@pytest.fixture(scope="module")
def pole(tmp_path_factory):
    path = tmp_path_factory.mktemp("pole") / "pole.urdf"
    path.write_text(POLE)
    return hp.load_robot(path, feet=("tip",))


def mass_matrix(model, data):
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


def walked(plant="compliant", *, friction=0.8, controller=UNGOVERNED, duration=3.0, **more):
    ground = Ground(mu_s=friction)
    return hp.walk(
        Scenario(controller=controller, plant=plant, ground=ground, duration=duration, **more)
    )


def test_robot_is_the_one_that_mujoco_reads_itself(robot, draw_state):
    """MuJoCo's own reading of the URDF has the same mass matrix and the same feet at any
    configuration.
    """
    spec = mujoco.MjSpec.from_file(str(robot.urdf))
    spec.compiler.discardvisual = True
    spec.bodies[1].add_freejoint()
    own = spec.compile()
    own.dof_armature[:] = robot.model.armature
    other = mujoco.MjData(own)
    ours = MujocoModel(robot, friction=0.8, dt=5e-4, gravity=G, foot_radius=1e-4)
    assert (ours.model.nq, ours.model.nv, ours.model.npair) == (13, 12, 2)
    np.testing.assert_array_equal(ours.model.dof_damping, robot.model.damping)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v = draw_state(rng)
        ours.reset(q, v)
        other.qpos[:] = np.concatenate((q[:3], q[[6, 3, 4, 5]], q[7:]))
        np.testing.assert_allclose(
            mass_matrix(ours.model, ours.data), mass_matrix(own, other), rtol=0, atol=1e-12
        )
        feet = hp.Dynamics(robot)
        feet.update(q, v)
        np.testing.assert_allclose(
            ours.data.geom_xpos[ours.feet], feet.foot_position, rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("seed", range(5))
def test_state_of_any_tree_comes_back_and_means_the_same(seed):
    """Every kind of joint, in any order: the state returns, and the frames and energies are
    Pinocchio's.
    """
    model, rng = random_model(seed)
    for i in range(1, BODIES + 1):
        body = model.inertias[i]
        model.inertias[i] = pin.Inertia(
            body.mass, body.lever, pin.Inertia.FromBox(body.mass, *rng.uniform(0.1, 1.0, 3)).inertia
        )
    model.addFrame(
        pin.Frame("tip", BODIES, 0, pin.SE3(np.eye(3), rng.normal(size=3)), pin.FrameType.OP_FRAME)
    )
    robot = Robot(model, hp.load_harpy().urdf, ("tip",), (), np.inf)
    inside = MujocoModel(robot, friction=1.0, dt=1e-3, gravity=G, foot_radius=1e-4)
    q, v = random_state(model, rng)
    inside.reset(q, v)
    again_q, again_v = pin.neutral(model), np.zeros(model.nv)
    from_mujoco(inside.conventions.record, inside.data.qpos, inside.data.qvel, again_q, again_v)
    np.testing.assert_allclose(again_q, q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(again_v, v, rtol=0, atol=1e-14)
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    for i in range(1, BODIES + 1):
        body = inside.data.body(f"body:{model.names[i]}")
        np.testing.assert_allclose(body.xpos, data.oMi[i].translation, rtol=0, atol=1e-12)
        np.testing.assert_allclose(
            body.xmat.reshape(3, 3), data.oMi[i].rotation, rtol=0, atol=1e-12
        )
    full = mass_matrix(inside.model, inside.data)
    energy = 0.5 * inside.data.qvel @ full @ inside.data.qvel
    assert energy == pytest.approx(0.5 * v @ pin.crba(model, model.createData(), q) @ v, rel=1e-12)


@needs_robots
def test_every_robot_of_the_catalogue_accelerates_as_pinocchio_says():
    for name in CATALOGUE:
        robot = hp.load_robot(name)
        if robot.loops is not None:  # test_loop_walks.py
            continue
        model, rng = robot.model, np.random.default_rng(1)
        inside = MujocoModel(robot, friction=1.0, dt=1e-3, gravity=G, foot_radius=1e-4)
        q = pin.integrate(model, pin.neutral(model), 0.3 * rng.standard_normal(model.nv))
        q[2] = 10.0
        inside.model.jnt_limited[:] = 0  # at any angle
        v, torque = rng.standard_normal(model.nv), rng.standard_normal(len(robot.joints))
        inside.reset(q, v)
        inside.apply(torque, np.zeros((len(robot.thrusters), 3)))
        mujoco.mj_forward(inside.model, inside.data)
        found, own, own_v = inside.data.qacc, pin.neutral(model), np.zeros(model.nv)
        # It turns accelerations as it does velocities.
        from_mujoco(inside.conventions.record, inside.qpos, found, own, own_v)
        own_v[:3] -= np.cross(v[3:6], v[:3])
        data = model.createData()
        matrix = np.triu(pin.crba(model, data, q))
        matrix += np.triu(matrix, 1).T
        force = matrix @ own_v + pin.nle(model, data, q, v) + model.damping * v
        given = np.concatenate((np.zeros(6), torque))
        # A link of icub has no inertia of its own; MuJoCo's copy has the least that it takes, a few
        # times.
        tolerance = 1e-11 * np.abs(matrix * own_v).max() + 4.0 * MIN_INERTIA * np.abs(own_v).max()
        np.testing.assert_allclose(force, given, rtol=0, atol=tolerance, err_msg=name)


def test_flight_under_torques_thrusts_and_a_push_converges_to_ours(robot):
    """Two integrators of order one for the same equations: their gap halves with the step."""
    command = Command(np.linspace(-1.0, 1.0, 6), np.array([[1.0, -2.0, 12.0], [-3.0, 1.0, 18.0]]))
    push = Push(0.0, (0.4, -0.3, 0.2), 0.02)
    gaps = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        plants = [kind(robot, dt=dt) for kind in (Simulator, MujocoPlant)]
        q = np.array([0, 0, 2.0, 0.1, -0.2, 0.3, 0.9, 0.1, -0.2, 0.5, 0.0, -0.3, 0.6])
        for plant in plants:
            plant.reset(q, np.linspace(-0.3, 0.3, 12))
            plant.advance(command, (push,), steps=round(0.04 / dt))
            assert plant.t == pytest.approx(0.04)
        gaps.append(np.abs(plants[0].q - plants[1].q).max())
        moved = np.abs(plants[1].v - np.linspace(-0.3, 0.3, 12)).max()
        for name in ("foot_position", "foot_velocity"):
            ours, theirs = (getattr(plant.state, name) for plant in plants)
            assert np.abs(ours - theirs).max() < 0.02 * moved
    assert moved > 1.0
    assert gaps[1] < 0.6 * gaps[0]
    assert gaps[2] < 0.6 * gaps[1] < 1e-3


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_have_the_stiffness_and_damping_they_state(sled, preset):
    """A body that falls on the ground follows the spring and the damper, and rests m g / k deep."""
    ground = preset_ground(Ground(mu_s=0.5), preset)
    k, d, mass = ground.stiffness, ground.damping, 2.0

    def slope(_, y):
        force = max(-k * y[0] - d * y[1], 0.0) if y[0] < 0.0 else 0.0
        return [y[1], -9.81 + force / mass]

    times = np.linspace(0.0, 0.1, 26)
    exact = solve_ivp(
        slope, (0, 0.1), [0.005, 0.0], rtol=1e-9, atol=1e-12, max_step=1e-4, t_eval=times
    ).y.T
    assert exact[:, 0].min() < -0.5 * mass * 9.81 / k  # it went in
    errors = []
    for dt in (4e-4, 2e-4, 1e-4):
        plant = MujocoPlant(sled, ground, dt=dt)
        q = pin.neutral(sled.model)
        q[2] = 0.005
        plant.reset(q, np.zeros(6))
        rows = []
        for _ in times:
            rows.append([plant.q[2], plant.v[2]])
            plant.advance(NOTHING, steps=round(0.004 / dt))
        errors.append(np.abs(np.array(rows) - exact).mean(axis=0))
    errors = np.array(errors)
    assert np.all(errors[2] < 0.4 * errors[0])
    assert errors[2, 0] < 2e-5
    plant.advance(NOTHING, steps=14000)
    assert plant.q[2] == pytest.approx(-plant.static_penetration, rel=1e-6)
    np.testing.assert_allclose(plant.state.foot_force, [[0, 0, mass * 9.81]], atol=1e-6)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_sliding_foot_is_lifted(sled, preset):
    """MuJoCo's contact is convex: at sliding speed s the normal force has μ (d + k Δt) s beside
    spring and damper.
    """
    angle, mu = np.radians(20), 0.25
    ground = preset_ground(Ground(mu_s=mu), preset)
    plant = MujocoPlant(sled, ground, gravity=9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    q = pin.neutral(sled.model)
    q[2] = -plant.static_penetration
    plant.reset(q, np.zeros(6))
    plant.advance(NOTHING, steps=60)
    k, d = ground.stiffness, ground.damping
    law = -k * plant.q[2] - d * plant.v[2]
    lift = mu * (d + k * plant.dt) * plant.v[0]
    assert lift > 1.0
    assert plant.state.foot_force[0, 2] == pytest.approx(law + lift, rel=1e-3)


def roll(pole, monkeypatch, *, radius, moved):
    """How far the foot's point goes while the pole falls by 0.4 rad about it, m, and the slip that
    is measured.
    """
    monkeypatch.setattr(plant_module, "FOOT_RADIUS", radius)
    if not moved:
        monkeypatch.setattr(MujocoPlant, "_move_contacts", lambda plant: None)
    plant = MujocoPlant(pole, Ground(mu_s=1.0))
    q, v = pin.neutral(pole.model), np.zeros(6)
    q[2] = 0.4 - plant.static_penetration
    v[0], v[4] = 0.4 * 2.0, 2.0  # turns about its foot
    plant.reset(q, v)
    start = plant.state.foot_position[0].copy()
    while plant.q[4] < np.sin(0.2):
        plant.advance(NOTHING)
    return np.hypot(*(plant.state.foot_position[0] - start)[:2]), plant.slip_path[0]


def test_feet_are_points(pole, monkeypatch):
    """A leg that turns about its foot leaves it where it is; on a sphere of 5 mm it would roll
    on.
    """
    with monkeypatch.context() as patch:
        away, path = roll(pole, patch, radius=plant_module.FOOT_RADIUS, moved=True)
    assert away < 5e-5
    assert path < 1e-4
    with monkeypatch.context() as patch:
        rolled, _ = roll(pole, patch, radius=5e-3, moved=False)
    assert rolled > 1e-3
    with monkeypatch.context() as patch:  # half the penetration is a radius, too
        sunk, _ = roll(pole, patch, radius=plant_module.FOOT_RADIUS, moved=False)
    assert sunk > 2e-4


def test_spheres_roll_and_that_is_no_slip(pole):
    """A pole that falls about a sphere moves its centre by radius times angle, and its lowest point
    by nothing.
    """
    radius = 0.02
    plant = MujocoPlant(pole, Ground(mu_s=1.0), foot_radius=radius)
    q, v = pin.neutral(pole.model), np.zeros(6)
    q[2] = 0.4 - plant.static_penetration
    v[0], v[4] = (0.4 + radius) * 2.0, 2.0
    plant.reset(q, v)
    start = plant.state.foot_position[0, 0]
    while plant.q[4] < np.sin(0.1):
        plant.advance(NOTHING)
    angle = 2.0 * np.arcsin(plant.q[4])
    # A contact lies half-way between plane and sphere, so that it rolls over half the penetration
    # less.
    assert plant.state.foot_position[0, 0] - start == pytest.approx(radius * angle, rel=0.1)
    assert plant.slip_path[0] < 0.02 * radius * angle
    still = MujocoPlant(pole, Ground(mu_s=1.0), foot_radius=radius)
    still.reset(q, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    still.advance(NOTHING, steps=4)
    assert still.slip_path[0] > 0.0


@pytest.mark.parametrize(
    "controller", [hp.Governed(), hp.Governed(governor="filter"), hp.Condensed(), hp.WholeBody()]
)
def test_walks_agree_with_ours(controller):
    """Distance within 5 %, mean normal force within 3 %, of our plant on the same ground."""
    ours = walked(friction=0.25, controller=controller, duration=2.0)
    for preset in PRESETS:
        theirs = walked(Mujoco(preset), friction=0.25, controller=controller, duration=2.0)
        assert ours.ending == theirs.ending == "completed"
        assert theirs.metadata["contact_unconverged"] == 0
        ways = [run["q"][-1, 0] - run["q"][0, 0] for run in (ours, theirs)]
        assert ways[1] == pytest.approx(ways[0], rel=0.05)
        normals = [run["foot_force"][:, :, 2].sum(axis=1).mean() for run in (ours, theirs)]
        assert normals[1] == pytest.approx(normals[0], rel=0.03)
        force = theirs["foot_force"]
        assert np.all(
            np.hypot(force[..., 0], force[..., 1]) <= 0.25 * force[..., 2] * (1.0 + 1e-5) + 1e-6
        )


def test_logged_forces_are_those_that_move_the_robot(robot):
    """Newton for the whole: the momentum changes by what is logged, step by step."""
    dt = 2.5e-4
    push = Push(0.3, (0.0, 0.5, 0.0))
    run = walked(
        "mujoco", duration=0.6, dt=dt, period=dt, disturbances=Disturbances(pushes=(push,))
    )
    model, data = robot.model, robot.model.createData()
    momentum = []
    for q, v in zip(run["q"], run["v"], strict=True):
        pin.centerOfMass(model, data, q, v)
        momentum.append(robot.mass * data.vcom[0])
    force = run["foot_force"][1:].sum(axis=1) + run["thrust"][:-1].sum(axis=1) + robot.mass * G
    impulse = dt * force + np.outer([push.share(t, t + dt) for t in run["t"][:-1]], push.impulse)
    defect = np.diff(momentum, axis=0) - impulse
    assert np.abs(defect.sum(axis=0)).max() < 2e-3
    assert np.abs(impulse).sum(axis=0).min() > 0.3


def test_slip_in_the_log_is_that_of_the_steps(robot):
    """The log of every step, summed by its definition."""
    run = walked("mujoco", friction=0.25, duration=1.2, period=5e-4)
    way = np.linalg.norm(np.diff(run["foot_position"][:, :, :2], axis=0), axis=2)
    path = np.sum(way * (run["foot_force"][1:, :, 2] > 0.0), axis=0)
    np.testing.assert_allclose(run["slip_path"][-1], path, rtol=1e-9)


def test_everything_of_a_scenario_works_and_walks_again(tmp_path):
    scenario = Scenario(
        plant=Mujoco("stiff"),
        controller=Governed(governor="filter"),
        ground=Ground(mu_s=0.6),
        disturbances=Disturbances(
            mass_error=0.1,
            start_velocity=(0.02, -0.03, 0.0, 0.0, 0.1, 0.0),
            pushes=(Push(0.1, (0.0, 1.0, 0.0)),),
            noise=hp.Noise.typical(0.2),
            delay=1e-3,
            seed=7,
        ),
        duration=0.4,
    )
    path = tmp_path / "run.npz"
    run = hp.walk(scenario, save=path)
    loaded = hp.Run.load(path)
    again = hp.walk(Scenario.of(loaded))
    for name in run.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(run[name], again[name])
    assert loaded.metadata["plant"]["name"] == "mujoco"
    assert loaded.metadata["plant"]["version"] == mujoco.__version__
    assert loaded.metadata["ground"]["stiffness"] == 80e3
    assert loaded.metadata["mass"] == pytest.approx(
        hp.build(scenario).simulator.model.body_mass.sum()
    )
    # Each of them matters.
    disturbances = (
        {"mass_error": 0.0},
        {"start_velocity": (0.0,) * 6},
        {"pushes": ()},
        {"noise": hp.Noise()},
        {"delay": 0.0},
    )
    changes = [
        {"disturbances": replace(scenario.disturbances, **change)} for change in disturbances
    ]
    for change in (*changes, {"plant": Mujoco("soft")}, {"plant": "compliant"}):
        assert not np.array_equal(hp.walk(replace(scenario, **change))["q"][-1], run["q"][-1]), (
            change
        )


def test_what_mujoco_cannot_do_is_refused(robot, monkeypatch):
    with pytest.raises(InputError, match="circular"):
        MujocoPlant(robot, Ground(cone="per_axis"))
    plant = MujocoPlant(robot)
    with pytest.raises(InputError, match="reset"):
        plant.advance(Command(np.zeros(6), np.zeros((2, 3))))
    plant.reset(pin.neutral(robot.model), np.zeros(12))
    for bad in (
        Command(np.full(6, np.nan), np.zeros((2, 3))),
        Command(np.zeros(5), np.zeros((2, 3))),
        None,
    ):
        with pytest.raises(InputError, match="torque"):
            plant.advance(bad)
    before = plant.q.copy()
    plant.advance(
        Command([0, 0, 0, 0, 0, 0], [[0, 0, 1], [0, 0, 1]])
    )  # lists of whole numbers are numbers
    assert not np.array_equal(plant.q, before)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match="pip install"):
        hp.build(Scenario(plant="mujoco"))


def test_a_divergence_ends_the_run(robot):
    """Torques beyond reason: the run is over, kept, and nothing warns or fails."""

    class Wild:
        period = 1e-3

        def step(self, state):
            return Command(np.full(6, 1e12), np.zeros((2, 3)))

    plant = MujocoPlant(robot)
    plant.reset(*hp.make_gait(robot).initial_state(penetration=plant.static_penetration))
    run = plant.run(Wild(), 0.1)
    assert run.fell
    assert len(run) >= 1


ARM = """<robot name="arm"><link name="base"><inertial><mass value="100"/>
<inertia ixx="9" ixy="0" ixz="0" iyy="9" iyz="0" izz="9"/></inertial></link>
<link name="arm"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="elbow" type="revolute"><axis xyz="0 1 0"/><parent link="base"/><child link="arm"/>
<limit lower="-0.2" upper="0.5" effort="10" velocity="10"/></joint></robot>"""


@pytest.mark.parametrize(("torque", "end"), [(2.0, 0.5), (-2.0, -0.2)])
def test_joints_end_where_the_robot_says(tmp_path, torque, end):
    (tmp_path / "arm.urdf").write_text(ARM)
    plant = MujocoPlant(hp.load_robot(tmp_path / "arm.urdf", feet=()), dt=1e-3, gravity=np.zeros(3))
    plant.reset(pin.neutral(plant.robot.model), np.zeros(7))
    angles = []
    for _ in range(2000):
        plant.advance(Command(np.array([torque]), np.zeros((0, 3))))
        angles.append(plant.q[7])
    assert np.abs(np.array(angles) - end).min() < 0.02
    assert np.abs(angles).max() < abs(end) + 0.05
    assert plant.q[7] == pytest.approx(end, abs=0.02)
